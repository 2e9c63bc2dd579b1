"""Tuned laws as entries of a ranking, in a file that a ranking names."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from yawbench.foundation.safe_files import write_whole
from yawbench.studies.experiment import LoadedExperiment
from yawbench.studies.tuning import TunedLaw, changes_of, tuning_of

ENTRIES = "entries.yaml"
"""File in the results folder with the tuned laws as entries of a ranking."""


def write_entries(
    experiment: LoadedExperiment, tuned_laws: Sequence[TunedLaw], folder: Path, command: str
) -> None:
    """Write the tuned laws as entries of a ranking into the folder of a tuning."""
    write_whole(folder / ENTRIES, entries_text(entries_of(experiment, tuned_laws), command))


def entries_of(experiment: LoadedExperiment, tuned_laws: Sequence[TunedLaw]) -> dict[str, dict[str, Any]]:
    """Return the best trials as entries of a ranking: name -> title, FMU, parameters, source."""
    tuning = tuning_of(experiment)
    entries = {}
    for tuned in tuned_laws:
        if tuned.best.objective is None:
            continue  # all trials failed
        law = tuning.laws[tuned.law]
        settings = changes_of(law, tuned.best.values).set
        beside = {instance: fmu for instance, fmu in law.swap.items() if instance != tuning.entries}
        made = f"{experiment.identity}: {len(tuned.trials)} trials, seed {tuning.seed}"
        comes_to = f"{tuning.objective} {tuned.best.cost:.4g}, {tuned.trials[0].cost:.4g} amid the ranges"
        entries[re.sub(r"\W+", "_", f"{tuned.law.lower()}_tuned")] = {
            "title": f"tuned {tuned.law}",
            "fmu": law.swap[tuning.entries],
            **({"swap": beside} if beside else {}),
            "gains": "tuned",
            "parameters": {target.variable: value for target, value in settings.items()},
            "source": f"{made}; {comes_to}",
        }
    return entries


def entries_text(entries: dict[str, dict[str, Any]], command: str) -> str:
    """Return tuned entries as the text of a YAML file."""
    from io import StringIO

    from ruamel.yaml import YAML

    yaml: Any = YAML(typ="safe", pure=True)
    yaml.default_flow_style, yaml.sort_base_mapping_type_on_output, yaml.width = False, False, 110
    yaml.dump({"entries": entries}, stream := StringIO())
    return f"# Written by: {command}\n{stream.getvalue()}"
