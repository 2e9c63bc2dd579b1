"""The page of an experiment, or of several: one file, made from what stands on disk."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..errors import ScenarioError
from ..scenario import catalogue, yaml_lines
from .animation import assets
from .facts import made_by
from .rendering import render, style

PAGE = "report.html"
"""Name of the page."""
RANKING = Path("results/proving_ground/ranking", PAGE)
"""Where the page of the ranking is unless its command is told otherwise."""
SCENARIOS = Path("scenarios")
"""Where studies are looked for when none is named."""
TITLE = "Yaw-stability control: what papers say, and what comes out"


def found_studies(folder: Path = SCENARIOS) -> list[Path]:
    """Return all study files in the folders of a folder, sorted by title.

    The studies of one folder stay together, `study.yaml` first.

    Raises:
        ScenarioError: there are none.
    """
    titles: dict[Path, str] = {}
    for path, _ in catalogue.files(folder, ["a study file"], depth=2):
        data = yaml_lines.read(path, what="study file").data
        titles[path] = str(data.get("title", "")) if isinstance(data, dict) else ""
    if not titles:
        raise ScenarioError(f"no study file was named, and there is none in {folder}/*/")
    first = {path.parent: min(titles[p] for p in titles if p.parent == path.parent) for path in titles}
    return sorted(titles, key=lambda path: (first[path.parent], path.stem != "study", titles[path]))


def report_page(chapters: Sequence[dict[str, Any]], ranking: str = "") -> str:
    """Return the page of one chapter or of several as HTML; `ranking`: address of its page if it is there."""
    title = TITLE if len(chapters) > 1 else str(chapters[0]["title"])
    return render(
        "report.html.j2", title=title, chapters=chapters, ranking=ranking, style=style(), assets=assets(),
        **made_by(),
    )  # fmt: skip
