"""`yawbench animate`: runs seen from above, as a page that needs no server."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .options import CHANGES, Wishes, takes
from .recorded import Labels, Sources

Page = Annotated[Path | None, typer.Option("--out", metavar="FILE.html", help="The page to write.")]


@takes(*CHANGES, "fmus", "no_build")
def animate(sources: Sources, wishes: Wishes, label: Labels = None, out: Page = None) -> None:
    """Write a page that animates runs seen from above.

    Cars, paths, lanes, patches of the road, steer angles, tyre forces and their friction circles; of at
    most seven runs.
    A scenario is run first if its results are missing or were made from another scenario or FMU.
    Without --out, the page of one run is animation.html in its folder; that of several lies in the
    folder that holds them all.
    """
    from ..errors import ResultsError, ScenarioError
    from ..pages.animation import MOST, page
    from ..results.read import load_results
    from ..titles import changed_each, changes_in
    from ..writing import write_whole
    from .batch import say
    from .recorded import folder_of_all, labels_of, recorded

    if len(sources) > MOST:
        raise ScenarioError(f"an animation shows up to {MOST} runs, not {len(sources)}")
    folders = recorded(sources, wishes)
    runs = list(zip(labels_of(folders, label), map(load_results, folders), strict=True))
    titles = [results.record.title or name for name, results in runs]
    changed = changed_each([(name, changes_in(results.run)) for name, results in runs])
    if len(runs) == 1:
        text = page(runs, title=titles[0], changed=changed)
    else:
        text = page(runs, below="; ".join(dict.fromkeys(titles)), changed=changed)
    file = out or folder_of_all(folders) / "animation.html"
    try:
        write_whole(file, text, named=out is not None)
    except OSError as error:
        raise ResultsError(f"{file}: the page cannot be written: {error.strerror or error}.") from None
    say(f"{file}: {len(text.encode()) / 1000:.0f} kB")
