"""Studies of the papers: in the first tier of the tests some of their runs, in the second all of them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from tests.command_line import status_of
from yawbench.fmus.build import HERE as FMUS
from yawbench.fmus.build import build_all
from yawbench.studies.executor import left_to_do
from yawbench.studies.experiment import plan_experiment
from yawbench.studies.experiment_result import judge_results
from yawbench.studies.jobs import execute
from yawbench.studies.load_experiment import load_experiment
from yawbench.studies.result_files import RECORD, write_findings


def judge_some(file: Path, out: Path, *runs: str) -> dict[str, Any]:
    """Make some runs of a study, and return its record; what needs others is not judged.

    Args:
        file: the study; all its runs are planned, so that none can be wrong unnoticed.
        out: folder of the results; `judge_all` completes them.
        runs: names or patterns of those that are made.
    """
    build_all(FMUS)
    experiment = load_experiment(file)
    planned = plan_experiment(experiment, out, fmus=FMUS)
    named = {run.name for run in experiment.matching(runs)}
    outcomes = execute([job for job in left_to_do(planned.jobs, {})[0] if job.label in named])
    assert [outcome.diagnostics for outcome in outcomes if not outcome.ok] == []
    write_findings(judge_results(planned.experiment, out, planned=planned), {}, out)
    return record_of(out)


def judge_all(file: Path, out: Path, *options: str) -> dict[str, Any]:
    """Make all runs of a study as a user does, and return its record."""
    assert status_of("study", file, "--out", out, "--fmus", FMUS, *options) == 0
    return record_of(out)


def record_of(out: Path) -> dict[str, Any]:
    """Return what the record of a study says, with its folder."""
    return json.loads((out / RECORD).read_text(encoding="utf-8")) | {"folder": out}


def check_figures(study: dict[str, Any], *names: str) -> None:
    """Assert that a study has drawn these figures, as SVG and PNG."""
    assert set(study["figures"]) >= set(names)
    for name in names:
        for kind in ("svg", "png"):
            assert (study["folder"] / "figures" / f"{name}.{kind}").stat().st_size > 10_000
