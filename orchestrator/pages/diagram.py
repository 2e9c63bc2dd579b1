"""Block diagrams of a system as SVG: units on a diagonal for wide pages, one below the other for narrow ones.

On the diagonal, signals run from a unit sideways into the column of the unit that takes them: above the
diagonal to later units, below it back to earlier ones. Both drawings show the same wires.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

from markupsafe import Markup

from ..figures.style import line_style
from .system import Block, System

WIDE = 0.62
"""Width of a character over the font size, of the widest usual sans-serif font (DejaVu Sans)."""
NAME, SMALL, SIGNAL = 13, 10, 10.5
"""Font sizes of a unit's name, of its FMUs, of signals [px]."""
LEADING = 1.25
"""Distance of lines over the font size."""
PAD, GAP = 7, 20
"""Room inside a block, between two blocks [px]."""
ARROW = 7
"""Length of an arrow's head [px]."""

Parts = list[Markup]


def _width(texts: Sequence[str], size: float) -> float:
    return max((len(text) for text in texts), default=0) * size * WIDE


def _text(x: float, y: float, text: str, size: float, extra: str = "") -> Markup:
    return Markup('<text x="{:.1f}" y="{:.1f}" font-size="{}"{}>{}</text>').format(
        x, y, size, Markup(extra), text
    )


def _lines(x: float, y: float, texts: Sequence[str], size: float, extra: str = "") -> Parts:
    """Return lines of text from the top y on."""
    return [_text(x, y + (i * LEADING + 0.95) * size, text, size, extra) for i, text in enumerate(texts)]


def _arrow(x: float, y: float, dx: int, dy: int, colour: str) -> Markup:
    """Return an arrow's head with its tip at (x, y), pointing along (dx, dy)."""
    back_x, back_y, half = x - ARROW * dx, y - ARROW * dy, 0.5 * ARROW
    points = (
        f"{x:.1f},{y:.1f} {back_x + half * dy:.1f},{back_y + half * dx:.1f} "
        f"{back_x - half * dy:.1f},{back_y - half * dx:.1f}"
    )
    return Markup('<polygon points="{}" fill="{}"/>').format(points, colour)


def _line(points: Sequence[tuple[float, float]], colour: str, width: float = 1.3, dash: str = "") -> Markup:
    return Markup('<polyline points="{}" fill="none" stroke="{}" stroke-width="{}"{}/>').format(
        " ".join(f"{x:.1f},{y:.1f}" for x, y in points), colour, width, Markup(dash)
    )


def _rectangle(x: float, y: float, w: float, h: float, style: str) -> Markup:
    return Markup('<rect x="{:.1f}" y="{:.1f}" width="{:.1f}" height="{:.1f}" {}/>').format(
        x, y, w, h, Markup(style)
    )


def _svg(kind: str, width: float, height: float, title: str, parts: Parts) -> Markup:
    head = Markup(
        '<svg class="{}" viewBox="0 0 {:.0f} {:.0f}" style="max-width:{:.0f}px" role="img" '
        'aria-label="{}" font-family="system-ui, sans-serif">'
    ).format(kind, width, height, width, title)
    return head + Markup("\n").join(parts) + Markup("</svg>")


BLOCK = 'rx="5" fill="#eef4fa" stroke="#0072B2" stroke-width="1.6"'
LABEL = 'rx="2" fill="#ffffff" stroke="#c9c9c9" stroke-width="0.8"'
BUS = "#555555"


def _block_lines(block: Block) -> tuple[float, float]:
    """Return the width and height of a block's text."""
    width = max(_width([block.name], NAME) * 1.05, _width(block.fmus, SMALL))
    return width, LEADING * (NAME + SMALL * len(block.fmus))


def diagonal(system: System, title: str) -> Markup:
    """Return the diagram with units on the diagonal, for wide pages."""
    blocks, count = system.blocks, len(system.blocks)
    place = {block.name: i for i, block in enumerate(blocks)}
    cells = {(place[a], place[b]): names for (a, b), names in system.signals.items()}
    sizes = [_block_lines(block) for block in blocks]
    widths = [
        2 * PAD + max(sizes[j][0], *(_width(cells.get((i, j), ()), SIGNAL) for i in range(count)))
        for j in range(count)
    ]
    heights = [
        2 * PAD + max(sizes[i][1], *(LEADING * SIGNAL * len(cells.get((i, j), ())) for j in range(count)))
        for i in range(count)
    ]
    left = [1 + sum(widths[:j]) + GAP * j for j in range(count)]
    top = [1 + sum(heights[:i]) + GAP * i for i in range(count)]
    middle_x = [x + w / 2 for x, w in zip(left, widths, strict=True)]
    middle_y = [y + h / 2 for y, h in zip(top, heights, strict=True)]
    lines: Parts = []
    labels: Parts = []
    for (i, j), names in cells.items():
        forward, loop = j > i, j == i
        if loop:
            continue
        start = left[i] + widths[i] if forward else left[i]
        end = top[j] if forward else top[j] + heights[j]
        corner = (middle_x[j], middle_y[i])
        lines += [
            _line([(start, middle_y[i]), corner, (middle_x[j], end)], BUS),
            _arrow(middle_x[j], end, 0, 1 if forward else -1, BUS),
        ]
        high, wide = LEADING * SIGNAL * len(names) + 6, _width(names, SIGNAL) + 8
        y = middle_y[i] - high / 2
        labels.append(_rectangle(middle_x[j] - wide / 2, y, wide, high, LABEL))
        labels += _lines(middle_x[j], y + 2.5, names, SIGNAL, ' text-anchor="middle" fill="#222"')
    for i, block in enumerate(blocks):
        labels.append(_rectangle(left[i], top[i], widths[i], heights[i], BLOCK))
        y = middle_y[i] - sizes[i][1] / 2
        labels += _lines(middle_x[i], y, [block.name], NAME, ' text-anchor="middle" font-weight="600"')
        fmus = _lines(middle_x[i], y + LEADING * NAME, block.fmus, SMALL, ' text-anchor="middle" fill="#444"')
        labels += fmus
    return _svg("diagonal", left[-1] + widths[-1] + 1, top[-1] + heights[-1] + 1, title, lines + labels)


STACK = 372
"""Width of the narrow diagram [px]; chosen: a phone's 400 less its margins."""
LANE = 11
"""Distance of lanes [px]."""


def stack(system: System, title: str) -> Markup:
    """Return the diagram with one unit below the other, for phones and print.

    Each source has a lane on the right; an arrow into a unit points at the line that says what it brings.
    """
    sources = [block.name for block in system.blocks if any(a == block.name for a, _ in system.signals)]
    right = STACK - LANE * len(sources) - 10  # of the blocks
    characters = int((right - 2 * PAD) / (SIGNAL * WIDE))
    lane = {name: right + 14 + LANE * k for k, name in enumerate(sources)}
    leaves: dict[str, float] = {}
    enters: dict[str, list[float]] = {name: [] for name in sources}
    drawn: Parts = []
    y = 1.0
    for block in system.blocks:
        content: list[tuple[str, float, str, str]] = [(block.name, NAME, ' font-weight="600"', "")]
        fmus = textwrap.wrap(", ".join(block.fmus), characters, break_on_hyphens=False)
        content += [(line, SMALL, ' fill="#444"', "") for line in fmus]
        for source in system.sources_of(block.name):
            said = f"{source}: {', '.join(system.signals[source, block.name])}"
            rows = textwrap.wrap(said, characters, subsequent_indent="  ", break_on_hyphens=False)
            content += [(row, SIGNAL, "", source if k == 0 else "") for k, row in enumerate(rows)]
        height = 2 * PAD + sum(LEADING * size for _, size, _, _ in content)
        drawn.append(_rectangle(1, y, right - 1, height, BLOCK))
        leaves[block.name] = y + PAD + 0.6 * NAME
        line_y = y + PAD
        for text, size, extra, source in content:
            indent = 10 if text.startswith(" ") else 0
            drawn.append(_text(PAD + indent, line_y + 0.95 * size, text.strip(), size, extra))
            if source:
                enters[source].append(line_y + 0.6 * size)
            line_y += LEADING * size
        y += height + 12
    lines: Parts = []
    for k, name in enumerate(sources):
        style = line_style(k)
        dash = style["linestyle"][1] if isinstance(style["linestyle"], tuple) else ()
        dashes = f' stroke-dasharray="{" ".join(str(2 * part) for part in dash)}"' if dash else ""
        x, colour, ends = lane[name], style["color"], [leaves[name], *enters[name]]
        lines.append(_line([(right, leaves[name]), (x, leaves[name])], colour, 1.6))
        lines.append(_line([(x, min(ends)), (x, max(ends))], colour, 1.6, dashes))
        lines.append(
            Markup('<circle cx="{:.1f}" cy="{:.1f}" r="2.6" fill="{}"/>').format(right, leaves[name], colour)
        )
        for end in enters[name]:
            lines.append(_line([(x, end), (right + ARROW - 1, end)], colour, 1.3))
            lines.append(_arrow(right + 0.8, end, -1, 0, colour))
    return _svg("stack", STACK, y - 11, title, lines + drawn)


def diagrams(system: System, title: str) -> Markup:
    """Return both drawings; the page's style shows the one that fits."""
    return diagonal(system, title) + stack(system, title)
