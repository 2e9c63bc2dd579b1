"""Progress bar of long calls, in terminals and notebooks.

The bar appears after `DELAY` and is removed at the end. Where it would not be visible (output to a file,
tests, worker processes) no thread is started. `YAWBENCH_PROGRESS=off` turns it off.
"""

from __future__ import annotations

import contextlib
import os
import sys
import textwrap
import threading
from collections.abc import Iterator
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from .messages import printable

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress

DELAY = 2.0
"""Time [s] before a bar appears. Chosen: shorter calls need none."""
SWITCH = "YAWBENCH_PROGRESS"
"""Environment variable; "off" disables bars."""
BESIDE = 36
"""Columns of the terminal reserved for the bar and its numbers."""
_shown = threading.Lock()
"""Lock of the call whose bar is shown; calls within it show none."""


class Bar:
    """Progress of a call; safe to use from other threads."""

    def __init__(self, title: str, total: int | None, ticking: bool) -> None:
        self._title, self._total, self._done, self._ticking = title, total, 0, ticking
        self._display: Progress | None = None
        self._task: Any = None

    def update(self, done: int, total: int | None) -> None:
        """Set the number of completed items, and the total if known."""
        self._done, self._total = done, total
        if self._display is not None:
            self._display.update(self._task, completed=done, total=total, refresh=not self._ticking)

    def advance(self) -> None:
        """Count a completed item."""
        self.update(self._done + 1, self._total)

    def extend(self, more: int) -> None:
        """Increase the total."""
        self.update(self._done, (self._total or 0) + more)

    def appear(self, on: Console) -> None:
        """Show the bar."""
        from rich.progress import Progress

        display = Progress(console=on, transient=True, auto_refresh=self._ticking)
        shown = textwrap.shorten(self._title, max(10, on.width - BESIDE), placeholder="…")
        title = printable(shown).replace("[", r"\[")
        self._task = display.add_task(title, total=self._total, completed=self._done)
        display.start()
        self._display = display

    def vanish(self) -> None:
        """Remove the bar."""
        if self._display is not None:
            self._display.stop()


@contextlib.contextmanager
def bar(
    title: str, total: int | None = None, *, wanted: bool | None = None, ticking: bool = True
) -> Iterator[Bar]:
    """Show a bar while the block runs, if it runs long and output goes to a terminal or notebook.

    Args:
        title: label of the bar.
        total: number of items, if known.
        wanted: True: show it immediately and anywhere; False: never.
        ticking: whether a thread redraws it between reports, too: not where this process is copied meanwhile.
    """
    made, on = Bar(title, total, ticking), None if wanted is False else _console(always=bool(wanted))
    if on is None or not _shown.acquire(blocking=False):
        yield made
        return
    timer = threading.Timer(DELAY, made.appear, (on,))
    timer.daemon = True
    try:
        if wanted:
            made.appear(on)
        else:
            timer.start()
        yield made
    finally:
        timer.cancel()
        if timer.ident is not None:
            timer.join()
        made.vanish()
        _shown.release()


def _console(*, always: bool = False) -> Console | None:
    """Return the console for bars, None if they would not be visible."""
    in_terminal = sys.stderr is not None and sys.stderr.isatty()
    if not always and (os.environ.get(SWITCH) == "off" or not (in_terminal or "IPython" in sys.modules)):
        return None
    from rich.console import Console

    console = Console(stderr=True)
    if console.is_jupyter:
        return Console() if find_spec("ipywidgets") else None  # rich shows bars with widgets
    return console if console.is_terminal or always else None
