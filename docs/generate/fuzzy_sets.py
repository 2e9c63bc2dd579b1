"""The figure of triangular sets on the page about paper C, from the sets of its components."""

from __future__ import annotations

from yawbench.components.mathematics.fuzzy import SEVEN, Partition

WIDTH, HEIGHT, MARGIN, TOP = 640, 170, 30, 30
"""Size of the figure, of its margin at the sides and at the bottom, and at the top [px]."""
GREY = "#808080"
"""Readable on light pages and on dark ones."""
COLOUR = "#0072b2"


def figure() -> str:
    """Return the sets as SVG: grade over the variable, which its range makes -1 to 1."""
    sets = Partition.even(SEVEN)
    base = HEIGHT - MARGIN

    def across(x: float) -> float:
        return WIDTH / 2 + x * (WIDTH / 2 - MARGIN)

    def triangle(k: int) -> str:
        near = range(max(k - 1, 0), min(k + 2, len(sets.peaks)))
        points = (f"{across(sets.peaks[i]):.1f},{TOP if i == k else base}" for i in near)
        return f'<polyline points="{" ".join(points)}" fill="none" stroke="{COLOUR}" stroke-width="1.5"/>'

    def word(x: float, y: float, text: str) -> str:
        return f'<text x="{across(x):.1f}" y="{y}" text-anchor="middle">{text}</text>'

    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" '
        f'font-family="sans-serif" font-size="13" fill="{GREY}">',
        f'<line x1="{MARGIN}" y1="{base}" x2="{WIDTH - MARGIN}" y2="{base}" stroke="{GREY}"/>',
        *map(triangle, range(len(sets.peaks))),
        *(word(peak, TOP - 8, label) for peak, label in zip(sets.peaks, sets.labels, strict=True)),
        *(word(x, HEIGHT - 10, f"{x:g}") for x in (-1.0, -0.5, 0.0, 0.5, 1.0)),
        "</svg>",
    ]
    return "\n".join(lines)
