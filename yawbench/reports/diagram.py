"""Block diagrams of a system as SVG: instances in a column, in the order of the scenario.

Each source has a lane on the right; an arrow into a block points at the line that lists its signals. A
diagram may cover several runs with the same instances; a block then lists all FMUs used for its instance.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from markupsafe import Markup

from yawbench.figures.style import line_style
from yawbench.foundation.messages import fold_wires
from yawbench.orchestrator.plan import Plan


@dataclass(frozen=True)
class DiagramBlock:
    """An instance and the FMUs used for it in any of the runs."""

    name: str
    fmus: tuple[str, ...]


@dataclass(frozen=True)
class SystemDiagram:
    """Blocks in the order of the scenario, and the signals between them."""

    blocks: tuple[DiagramBlock, ...]
    signals: dict[tuple[str, str], tuple[str, ...]]  # (source, target) -> names, four wheels as one with `*`

    def sources_of(self, target: str) -> list[str]:
        """Return the instances that an instance has inputs from, in order."""
        return [block.name for block in self.blocks if (block.name, target) in self.signals]


def system_of(plans: Iterable[Plan]) -> SystemDiagram:
    """Return the diagram of plans that have the same instances."""
    fmus: dict[str, dict[str, None]] = {}
    wires: dict[tuple[str, str], dict[tuple[str, str], None]] = {}
    for plan in plans:
        by_name = {instance.name: instance for instance in plan.instances}
        for name in [*plan.scenario.get("units", {}), *by_name]:
            if name in by_name:
                fmus.setdefault(name, {})[by_name[name].fmu.name] = None
        for wire in plan.wires:
            wires.setdefault((wire.source, wire.target), {})[wire.output, wire.input] = None
    signals = {
        ends: tuple(
            output if output == name else f"{output} → {name}" for output, name in fold_wires(list(pairs))
        )
        for ends, pairs in wires.items()
    }
    return SystemDiagram(
        tuple(DiagramBlock(name, tuple(programs)) for name, programs in fmus.items()), signals
    )


def systems_of(plans: Sequence[Plan]) -> list[tuple[SystemDiagram, list[int]]]:
    """Return a diagram for each set of instances that occurs in the plans, with the indices of its plans."""
    groups: dict[frozenset[str], list[int]] = {}
    for number, plan in enumerate(plans):
        groups.setdefault(frozenset(instance.name for instance in plan.instances), []).append(number)
    return [(system_of([plans[k] for k in numbers]), numbers) for numbers in groups.values()]


WIDE = 0.62
"""Width of a character over the font size in the widest common sans-serif font (DejaVu Sans)."""
NAME, SMALL, SIGNAL = 13, 10, 10.5
"""Font sizes of an instance's name, of its FMUs, of signals [px]."""
LEADING = 1.25
"""Line spacing over the font size."""
PAD = 7
"""Padding inside a block [px]."""
ARROW = 7
"""Length of an arrowhead [px]."""

BLOCK: dict[str, Any] = {"rx": 5, "fill": "#eef4fa", "stroke": "#0072B2", "stroke_width": 1.6}

DiagramParts = list[Markup]


def _tag(name: str, content: str = "", **attributes: Any) -> Markup:
    """Return an SVG element; `_` in the name of an attribute becomes `-`."""
    written = (
        Markup(' {}="{}"').format(
            key.replace("_", "-"), round(attribute, 1) if isinstance(attribute, float) else attribute
        )
        for key, attribute in attributes.items()
    )
    return Markup("<{0}{1}>{2}</{0}>").format(name, Markup("").join(written), content)


def _lines(x: float, y: float, texts: Sequence[str], size: float, **look: Any) -> DiagramParts:
    """Return lines of text, top-aligned at y."""
    return [
        _tag("text", text, x=x, y=y + (i * LEADING + 0.95) * size, font_size=size, **look)
        for i, text in enumerate(texts)
    ]


def _arrow(x: float, y: float, dx: int, dy: int, colour: str) -> Markup:
    """Return an arrowhead with its tip at (x, y), pointing along (dx, dy)."""
    back_x, back_y, half = x - ARROW * dx, y - ARROW * dy, 0.5 * ARROW
    left, right = (back_x + half * dy, back_y + half * dx), (back_x - half * dy, back_y - half * dx)
    return _tag("polygon", points=_places([(x, y), left, right]), fill=colour)


def _line(points: Sequence[tuple[float, float]], colour: str, width: float = 1.3, **look: Any) -> Markup:
    return _tag("polyline", points=_places(points), fill="none", stroke=colour, stroke_width=width, **look)


def _places(points: Sequence[tuple[float, float]]) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in points)


COLUMN = 372
"""Width of a diagram [px]; chosen: a phone's 400 less its margins."""
LANE = 11
"""Distance between lanes [px]."""


def diagram(system: SystemDiagram, title: str) -> Markup:
    """Return the drawing of a system."""
    sources = [block.name for block in system.blocks if any(a == block.name for a, _ in system.signals)]
    right = COLUMN - LANE * len(sources) - 10  # right edge of the blocks
    characters = int((right - 2 * PAD) / (SIGNAL * WIDE))
    lane = {name: right + 14 + LANE * k for k, name in enumerate(sources)}
    leaves: dict[str, float] = {}
    enters: dict[str, list[float]] = {name: [] for name in sources}
    drawn: DiagramParts = []
    y = 1.0
    for block in system.blocks:
        content: list[tuple[str, float, dict[str, Any], str]] = []
        content.append((block.name, NAME, {"font_weight": 600}, ""))
        fmus = textwrap.wrap(", ".join(block.fmus), characters, break_on_hyphens=False)
        content += [(line, SMALL, {"fill": "#444"}, "") for line in fmus]
        for source in system.sources_of(block.name):
            line = f"{source}: {', '.join(system.signals[source, block.name])}"
            rows = textwrap.wrap(line, characters, subsequent_indent="  ", break_on_hyphens=False)
            content += [(row, SIGNAL, {}, source if k == 0 else "") for k, row in enumerate(rows)]
        height = 2 * PAD + sum(LEADING * size for _, size, _, _ in content)
        drawn.append(_tag("rect", x=1, y=y, width=right - 1, height=height, **BLOCK))
        leaves[block.name] = y + PAD + 0.6 * NAME
        line_y = y + PAD
        for text, size, look, source in content:
            drawn += _lines(PAD + 10 * text.startswith(" "), line_y, [text.strip()], size, **look)
            if source:
                enters[source].append(line_y + 0.6 * size)
            line_y += LEADING * size
        y += height + 12
    lines: DiagramParts = []
    for k, name in enumerate(sources):
        style = line_style(k)
        dash = style["linestyle"][1] if isinstance(style["linestyle"], tuple) else ()
        x, colour, ends = lane[name], style["color"], [leaves[name], *enters[name]]
        dashes = {"stroke_dasharray": " ".join(str(2 * part) for part in dash)} if dash else {}
        lines.append(_line([(right, leaves[name]), (x, leaves[name])], colour, 1.6))
        lines.append(_line([(x, min(ends)), (x, max(ends))], colour, 1.6, **dashes))
        lines.append(_tag("circle", cx=right, cy=leaves[name], r=2.6, fill=colour))
        for end in enters[name]:
            lines.append(_line([(x, end), (right + ARROW - 1, end)], colour, 1.3))
            lines.append(_arrow(right + 0.8, end, -1, 0, colour))
    frame = {"viewBox": f"0 0 {COLUMN} {y - 11:.0f}", "style": f"max-width:{COLUMN}px"}
    about = {"role": "img", "aria_label": title, "font_family": "system-ui, sans-serif"}
    return _tag("svg", Markup("\n").join(lines + drawn), **frame, **about)
