"""Validations in studies: runs compared with measured cars, as the section `validations` asks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from pydantic import Field

from yawbench.measurements.measurement import Measurement, load_measurement
from yawbench.orchestrator.results.reader import Results
from yawbench.orchestrator.scenario.schema_validation import StrictModel
from yawbench.studies.claim_schema import RunName
from yawbench.studies.sections import Section

from .validation import Bands, Validation, compare_run, load_bands
from .validation_page import validation_table, validation_view


class ValidationSpec(StrictModel):
    """A run compared with measurements of the car (`docs/measured_cars.md`)."""

    run: RunName = Field(description="Name of a run, of a steady-state test")
    measured: str = Field(description="Measurement file, relative to this file", min_length=1)
    bands: str = Field(
        "steady_state", description="Tolerances: a name in scenarios/bands, or a file beside it"
    )


Recordings = list[tuple[ValidationSpec, Measurement, Bands]]


def _load(specs: Sequence[ValidationSpec], folder: Path) -> Recordings:
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


def _compare(results: Mapping[str, Results], recordings: Recordings) -> list[Validation]:
    """Return the comparisons of the runs that have results."""
    return [
        compare_run(results[spec.run], measurement, bands)
        for spec, measurement, bands in recordings
        if spec.run in results
    ]


VALIDATIONS = Section(
    ValidationSpec, "Runs to be compared with measured cars", _load, _compare, validation_table,
    validation_view,
)  # fmt: skip
