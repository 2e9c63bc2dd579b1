"""Validations in studies: runs compared with measured cars, as the key `validations` asks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from yawbench.orchestrator.recordings.measurement import Measurement, load_measurement
from yawbench.orchestrator.results.reader import Results
from yawbench.studies.claim_schema import ValidationSpec

from .validation import Bands, Validation, compare_run, load_bands
from .validation_page import validation_table, validation_view

Recordings = list[tuple[ValidationSpec, Measurement, Bands]]

table, view = validation_table, validation_view


def load(specs: Sequence[ValidationSpec], folder: Path) -> Recordings:
    """Return the validations of a study in a folder, with their measurements and bands.

    Raises:
        YawbenchError: a measurement or a file of bands is missing or wrong.
    """
    return [
        (
            spec,
            load_measurement(folder / spec.measured),
            load_bands(folder / spec.bands if (folder / spec.bands).is_file() else spec.bands),
        )
        for spec in specs
    ]


def compare(results: Mapping[str, Results], recordings: Recordings) -> list[Validation]:
    """Return the comparisons of the runs that have results."""
    return [
        compare_run(results[spec.run], measurement, bands)
        for spec, measurement, bands in recordings
        if spec.run in results
    ]
