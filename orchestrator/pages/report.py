"""The report: one page of all studies, made from results on disk, and the runs that it has to make first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import ScenarioError
from ..plan import Plan
from ..results.folder import RUN_FILE
from ..scenario import catalogue, yaml_lines
from ..scenario.load import Scenario
from ..studies.jobs import Job, Once, planned
from ..studies.study_file import Study, load_study
from .animation import assets
from .facts import made_by
from .freshness import staleness
from .rendering import render, style

PAGE = "report.html"
"""Name of the page."""
SCENARIOS = Path("scenarios")
"""Where studies are looked for when none is named."""
TITLE = "Yaw-stability control: what papers say, and what comes out"


@dataclass(frozen=True)
class Wanted:
    """A study with its jobs, the plan of every run, and which results are missing or stale."""

    study: Study
    folder: Path
    jobs: dict[str, Job]
    plans: dict[str, tuple[Scenario, Plan]]
    stale: dict[str, str]  # run -> why


def found_studies(folder: Path = SCENARIOS) -> list[Path]:
    """Return all study files in the folders of a folder, sorted by title.

    The studies of one folder stay together, `study.yaml` first.

    Raises:
        ScenarioError: there are none.
    """
    titles: dict[Path, str] = {}
    for path, _ in catalogue.files(folder, ["a study file"], below="*/*"):
        data = yaml_lines.read(path, what="study file").data
        titles[path] = str(data.get("title", "")) if isinstance(data, dict) else ""
    if not titles:
        raise ScenarioError(f"no study file was named, and there is none in {folder}/*/")
    first = {path.parent: min(titles[p] for p in titles if p.parent == path.parent) for path in titles}
    return sorted(titles, key=lambda path: (first[path.parent], path.stem != "study", titles[path]))


def wanted(
    path: Path,
    folder: Path,
    *,
    fmus: Path | None,
    format: str,
    call_limit: float | None = None,
    build: bool = False,
) -> Wanted:
    """Read a study and look which of its runs have results that are still good; `build`: see `Once`.

    Raises:
        YawbenchError: the study, a scenario or an FMU is wrong.
    """
    from dataclasses import replace

    study = load_study(path)
    jobs = {
        name: replace(run.job(folder, fmus), format=format, call_limit=call_limit)
        for name, run in study.runs.items()
    }
    once = Once(build=build)
    plans = {name: planned(job, once) for name, job in jobs.items()}
    found = {name: staleness(plans[name][1], job.out) for name, job in jobs.items()}
    return Wanted(study, folder, jobs, plans, {name: why for name, why in found.items() if why})


def still_stale(one: Wanted) -> dict[str, str]:
    """Return run -> why its results are not those of its plan, of runs that have results."""
    found = {
        name: staleness(one.plans[name][1], job.out)
        for name, job in one.jobs.items()
        if (job.out / RUN_FILE).is_file()
    }
    return {name: why for name, why in found.items() if why}


def report_page(chapters: Sequence[dict[str, Any]]) -> str:
    """Return the report as HTML."""
    title = TITLE if len(chapters) > 1 else str(chapters[0]["title"])
    return render(
        "report.html.j2", title=title, chapters=chapters, style=style(), assets=assets(),
        **made_by(),
    )  # fmt: skip
