"""Block diagrams of a system as SVG: instances on a diagonal for wide pages, in a column for narrow ones.

On the diagonal, signals run from an instance sideways into the column of the instance that takes them: above
the diagonal to later instances, below it back to earlier ones. Both drawings show the same wires. A diagram
may cover several runs with the same instances; a block then lists all FMUs used for its instance.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from markupsafe import Markup

from ..figures.style import line_style
from ..messages import fold_wires
from ..plan import Plan


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
        by_name = {unit.name: unit for unit in plan.instances}
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
        groups.setdefault(frozenset(unit.name for unit in plan.instances), []).append(number)
    return [(system_of([plans[k] for k in numbers]), numbers) for numbers in groups.values()]


WIDE = 0.62
"""Width of a character over the font size in the widest common sans-serif font (DejaVu Sans)."""
NAME, SMALL, SIGNAL = 13, 10, 10.5
"""Font sizes of an instance's name, of its FMUs, of signals [px]."""
LEADING = 1.25
"""Line spacing over the font size."""
PAD, GAP = 7, 20
"""Padding inside a block and gap between blocks [px]."""
ARROW = 7
"""Length of an arrowhead [px]."""

BLOCK = {"rx": 5, "fill": "#eef4fa", "stroke": "#0072B2", "stroke_width": 1.6}
LABEL = {"rx": 2, "fill": "#ffffff", "stroke": "#c9c9c9", "stroke_width": 0.8}
BUS = "#555555"

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


def _width(texts: Sequence[str], size: float) -> float:
    return max((len(text) for text in texts), default=0) * size * WIDE


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


def _box(x: float, y: float, width: float, height: float, look: Mapping[str, Any]) -> Markup:
    return _tag("rect", x=x, y=y, width=width, height=height, **look)


def _svg(kind: str, width: float, height: float, title: str, parts: DiagramParts) -> Markup:
    frame = {"viewBox": f"0 0 {width:.0f} {height:.0f}", "style": f"max-width:{width:.0f}px", "class": kind}
    about = {"role": "img", "aria_label": title, "font_family": "system-ui, sans-serif"}
    return _tag("svg", Markup("\n").join(parts), **frame, **about)


def _block_size(block: DiagramBlock) -> tuple[float, float]:
    """Return the width and height of a block's text."""
    width = max(_width([block.name], NAME) * 1.05, _width(block.fmus, SMALL))
    return width, LEADING * (NAME + SMALL * len(block.fmus))


def diagonal(system: SystemDiagram, title: str) -> Markup:
    """Return the diagram with instances on the diagonal, for wide pages."""
    blocks, count = system.blocks, len(system.blocks)
    place = {block.name: i for i, block in enumerate(blocks)}
    cells = {(place[a], place[b]): names for (a, b), names in system.signals.items()}
    sizes = [_block_size(block) for block in blocks]
    widths, heights = [2 * PAD + width for width, _ in sizes], [2 * PAD + height for _, height in sizes]
    for (i, j), names in cells.items():
        widths[j] = max(widths[j], 2 * PAD + _width(names, SIGNAL))
        heights[i] = max(heights[i], 2 * PAD + LEADING * SIGNAL * len(names))
    left = [1 + sum(widths[:j]) + GAP * j for j in range(count)]
    top = [1 + sum(heights[:i]) + GAP * i for i in range(count)]
    middle_x = [x + w / 2 for x, w in zip(left, widths, strict=True)]
    middle_y = [y + h / 2 for y, h in zip(top, heights, strict=True)]
    lines: DiagramParts = []
    labels: DiagramParts = []
    for (i, j), names in cells.items():
        if i == j:
            continue
        forward = j > i
        start = left[i] + widths[i] if forward else left[i]
        end = top[j] if forward else top[j] + heights[j]
        corner = (middle_x[j], middle_y[i])
        lines.append(_line([(start, middle_y[i]), corner, (middle_x[j], end)], BUS))
        lines.append(_arrow(middle_x[j], end, 0, 1 if forward else -1, BUS))
        high, wide = LEADING * SIGNAL * len(names) + 6, _width(names, SIGNAL) + 8
        y = middle_y[i] - high / 2
        labels.append(_box(middle_x[j] - wide / 2, y, wide, high, LABEL))
        labels += _lines(middle_x[j], y + 2.5, names, SIGNAL, text_anchor="middle", fill="#222")
    for i, block in enumerate(blocks):
        x, y = middle_x[i], middle_y[i] - sizes[i][1] / 2
        labels.append(_box(left[i], top[i], widths[i], heights[i], BLOCK))
        labels += _lines(x, y, [block.name], NAME, text_anchor="middle", font_weight=600)
        labels += _lines(x, y + LEADING * NAME, block.fmus, SMALL, text_anchor="middle", fill="#444")
    return _svg("diagonal", left[-1] + widths[-1] + 1, top[-1] + heights[-1] + 1, title, lines + labels)


STACK = 372
"""Width of the narrow diagram [px]; chosen: a phone's 400 less its margins."""
LANE = 11
"""Distance between lanes [px]."""


def stack(system: SystemDiagram, title: str) -> Markup:
    """Return the diagram with the instances in a column, for phones and print.

    Each source has a lane on the right; an arrow into a block points at the line that lists its signals.
    """
    sources = [block.name for block in system.blocks if any(a == block.name for a, _ in system.signals)]
    right = STACK - LANE * len(sources) - 10  # right edge of the blocks
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
        drawn.append(_box(1, y, right - 1, height, BLOCK))
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
    return _svg("stack", STACK, y - 11, title, lines + drawn)


def diagrams(system: SystemDiagram, title: str) -> Markup:
    """Return both drawings; the style of the page shows the one that fits."""
    return diagonal(system, title) + stack(system, title)
