"""Where the cars lie within published ranges: `python -m docs.generate.car_tables [--drive]`.

The figures come from scenarios/vehicles/handling.csv, which `--drive` writes anew from runs of every vehicle
file, as `yawbench vehicle` makes them: slow ramp, small sine, full braking.
"""

from __future__ import annotations

import csv
import math
import sys
from dataclasses import dataclass
from pathlib import Path

from yawbench.foundation.errors import YawbenchError
from yawbench.planner import Planner
from yawbench.proving_ground.handling import TestTrack, fitting_plant, handling_of
from yawbench.studies.tables import Table

from .published import markdown, pages_with, rows_in

ROOT = Path(__file__).resolve().parents[2]
CARS = ROOT / "scenarios" / "vehicles"
FIGURES = CARS / "handling.csv"
PAGE = ROOT / "docs" / "vehicles.md"
G = 9.80665


@dataclass(frozen=True)
class Range:
    """A figure of cars with the range that cars are published to have."""

    heading: str
    column: str  # of the file, SI
    factor: float  # to the unit of the heading
    low: float
    high: float
    source: str

    def cell(self, value: str) -> str:
        """Return a figure as text, bold outside the range."""
        if not value:
            return "–"
        number = self.factor * float(value)
        text = f"{number:.3g}"
        return text if self.low <= number <= self.high else f"**{text}**"


RANGES = (
    Range(
        "understeer [°/g]", "understeer [rad.s2/m]", math.degrees(G), 1.0, 5.0,
        "1 to 5 °/g: T. D. Gillespie, Fundamentals of Vehicle Dynamics, 1992, and road tests, from memory",
    ),
    Range(
        "characteristic speed [km/h]", "characteristic_speed [m/s]", 3.6, 65.0, 100.0,
        "65 to 100 km/h: course of EuroMotor on vehicle dynamics, on today's cars",
    ),
    Range(
        "roll [°/g]", "roll_gradient [rad.s2/m]", math.degrees(G), 3.0, 7.0,
        "3 to 7 °/g: Gillespie, from memory",
    ),
    Range(
        "roll damping", "roll_damping [1]", 1.0, 0.2, 0.6,
        "0.2 to 0.6: the upper end is that of cars that Allen et al. measured, DOT HS 807 956, 1992, the "
        "lower one from memory",
    ),
    Range(
        "stop from 100 km/h [m]", "stopping_distance [m]", 1.0, 33.0, 50.0,
        "33 to 50 m: road tests on dry asphalt, from memory; 49 CFR 571.135 S7.5 allows 70 m",
    ),
)  # fmt: skip
"""Figures and ranges; those from memory could not be read again."""


def drive() -> None:
    """Drive every vehicle file and write its figures."""
    planner = Planner()
    fmus = ROOT / "fmus"
    rows = []
    for file in sorted(CARS.glob("*.yaml")):
        try:
            plant = fitting_plant(file, "", fmus, planner)
            car = handling_of(TestTrack(file, plant, friction=0.9, fmus=fmus, planner=planner))
        except YawbenchError as error:
            print(f"{file.stem}: {error}")
            continue
        figures = (
            car.steering.get(0.0),
            car.characteristic_speed,
            car.roll_gradient,
            car.roll_mode.damping if car.roll_mode else None,
            car.stopping_distance,
        )
        numbers = ("" if x is None else f"{x:.6g}" for x in figures)
        rows.append({"vehicle": file.stem, "plant": plant, **dict(zip(_columns(), numbers, strict=True))})
        print(rows[-1], flush=True)
    with FIGURES.open("w", encoding="utf-8", newline="") as out:
        writer = csv.DictWriter(out, ["vehicle", "plant", *_columns()], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def _columns() -> list[str]:
    return [one.column for one in RANGES]


def cars_table() -> Table:
    """Return the figures of all cars; bold outside the range."""
    rows = [
        [f"`{row['vehicle']}`", f"`{row['plant']}`", *(one.cell(row[one.column]) for one in RANGES)]
        for row in rows_in(FIGURES)
    ]
    headings = ["vehicle", "plant", *(one.heading for one in RANGES)]
    notes = [f"Bold: outside the published range. {'; '.join(one.source for one in RANGES)}."]
    return Table("", headings, [*rows], notes, {*range(2, len(headings))})


def pages_with_tables() -> dict[Path, str]:
    """Return docs/vehicles.md with its table written anew."""
    return pages_with({PAGE: {"cars": markdown(cars_table())}})


if __name__ == "__main__":
    if "--drive" in sys.argv[1:]:
        drive()
    for page, text in pages_with_tables().items():
        page.write_text(text, encoding="utf-8")
