"""Curves of a run on the terminal while it is made (`run --live`).

Drawn with braille characters, of which each holds 2 by 4 dots: that needs no window and no picture, so it
works over ssh, too. Where there is no terminal, a line per second has the values instead.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from yawbench.events.kinds import RunWatch

if TYPE_CHECKING:
    from rich.console import RenderableType

    from yawbench.orchestrator.plan import Plan

MOST = 4
"""Curves at once. Chosen: so many fit on a terminal of 24 lines."""
HIGH = 4
"""Lines of a curve."""
EVERY = 0.1
"""Time between two pictures [s]; chosen: more often nobody sees."""
TOLD = 1.0
"""Time between two lines without a terminal [s]."""
DOTS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]])
"""Dots of a braille character by row and column (Unicode, block 2800 to 28FF)."""


class Live(RunWatch):
    """Looks at a run as `RunWatch` does, and shows its rows as they are recorded.

    Args:
        plan: of the run.
        terminal: whether there is a terminal that can redraw.
    """

    def __init__(self, plan: Plan, *, terminal: bool) -> None:
        from yawbench.figures.display import shown_unit, unit_of_signal
        from yawbench.figures.plots import OVERVIEW
        from yawbench.metrics.measures import variable_of, words
        from yawbench.orchestrator.results.record_of_plan import recorded_variables, units_of

        super().__init__(plan)
        variables, units = recorded_variables(plan), units_of(plan)
        reals = [name for name, variable in variables.items() if variable.type == "Real"]
        usual = [name for wanted in OVERVIEW for name in reals if variable_of(name) == wanted]
        chosen = [*dict.fromkeys([*usual, *reals])][:MOST]
        self._at = [1 + reals.index(name) for name in chosen]
        shown = [shown_unit(unit_of_signal(units.get(name) or "")) for name in chosen]
        self._units, self._factors = [unit for unit, _ in shown], np.array([factor for _, factor in shown])
        self._names = [f"{words(variable_of(name))} ({name})" for name in chosen]
        self._span = plan.time(0), plan.time(plan.n_steps)
        self._drawn, self._last = 0.0, np.full(1 + len(chosen), np.nan)
        self._live = None
        if terminal:
            from rich.console import Console
            from rich.live import Live as Redrawn

            console = Console(stderr=True)
            self._wide = max(20, console.width - 12)
            self._live = Redrawn(console=console, auto_refresh=False)
            self._ends = np.full((2, len(chosen), 2 * self._wide), np.nan)  # smallest, largest per dot

    def __enter__(self) -> Live:
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(self, *of: object) -> None:
        self._show()
        if self._live is not None:
            self._live.stop()

    def look(self, rows: np.ndarray) -> None:
        super().look(rows)
        values = rows[:, self._at] * self._factors
        self._last = np.concatenate([rows[-1, :1], values[-1]])
        if self._live is not None:
            begin, end = self._span
            part = (rows[:, 0] - begin) / max(end - begin, 1e-9)
            dots = np.minimum((part * self._ends.shape[2]).astype(int), self._ends.shape[2] - 1)
            for dot in np.unique(dots):
                here = values[dots == dot]
                self._ends[0, :, dot] = np.fmin(self._ends[0, :, dot], np.fmin.reduce(here))
                self._ends[1, :, dot] = np.fmax(self._ends[1, :, dot], np.fmax.reduce(here))
        if time.monotonic() - self._drawn >= (TOLD if self._live is None else EVERY):
            self._show()

    def _show(self) -> None:
        self._drawn = time.monotonic()
        if not np.isfinite(self._last[0]):
            return
        if self._live is not None:
            self._live.update(self._picture(), refresh=True)
            return
        from .terminal_progress import say

        numbers = zip(self._names, self._last[1:], self._units, strict=True)
        values = ", ".join(f"{name} {x:.4g} {unit}".rstrip() for name, x, unit in numbers)
        say(f"t = {self._last[0]:.2f} s: {values}")

    def _picture(self) -> RenderableType:
        from rich.text import Text

        lines = [f"t = {self._last[0]:.2f} of {self._span[1]:g} s"]
        for k, name in enumerate(self._names):
            low, high = self._ends[:, k]
            bottom, top = (float(x) for x in (np.nanmin(low), np.nanmax(high)))
            lines.append(f"{name}: {self._last[1 + k]:.4g} {self._units[k]}".rstrip())
            curve = braille(low, high, bottom, top, HIGH)
            beside = [f"{top:.4g}", *[""] * (HIGH - 2), f"{bottom:.4g}"]
            lines += [f"{label:>10} {row}" for label, row in zip(beside, curve, strict=True)]
        return Text("\n".join(lines), no_wrap=True)


def braille(
    low: Sequence[float] | np.ndarray, high: np.ndarray, bottom: float, top: float, lines: int
) -> list[str]:
    """Return a curve as lines of braille characters.

    Args:
        low, high: smallest and largest value of each column of dots, an even number of them; NaN: none.
        bottom, top: values of the lowest and the highest dot.
        lines: their number.
    """
    rows = 4 * lines
    size = top - bottom if top > bottom else 1.0
    dots = np.zeros((rows, len(high)), bool)
    for column, ends in enumerate(np.stack([low, high], axis=1)):
        if np.isfinite(ends).all():
            first, last = ((rows - 1) * (1.0 - (ends[::-1] - bottom) / size)).round().astype(int)
            dots[max(first, 0) : last + 1, column] = True
    cells = dots.reshape(lines, 4, -1, 2)
    codes = 0x2800 + np.einsum("lrcd,rd->lc", cells.astype(int), DOTS)
    return ["".join(map(chr, line)).rstrip(chr(0x2800)) for line in codes]
