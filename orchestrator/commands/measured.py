"""`yawbench measured`: what is wrong with a recording."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import typer

MeasuredAction = Annotated[Literal["show"], typer.Argument(help="show: examine the recording.")]
MeasurementFile = Annotated[Path, typer.Argument(metavar="FILE", help="Measurement file.")]


def measured(action: MeasuredAction, file: MeasurementFile) -> None:
    """Show what a recording holds, and its flaws.

    Names spikes, uneven, repeated and restarting time, and what contradicts the motion of a rigid car: signs,
    factors of mistaken units, lag, place and zero points of sensors. Exit status 1 if there is any flaw.
    """
    from ..experiments.tables import Cell, Table
    from ..measured.flaws import flaws_of
    from ..measured.measurement import load_measurement
    from .progress import print_tables, say

    flaws = flaws_of(file)
    if not any(flaw.kind == "refused" for flaw in flaws):
        measurement = load_measurement(file)
        say(f"{measurement.title}; {measurement.origin or 'source and licence not stated'}")
        rows: list[Sequence[Cell]] = [
            (one.name, f"{one.time[0]:.6g}", f"{one.time[-1]:.6g}", f"{one.rate:.4g}", ", ".join(one.signals))
            for one in measurement.segments
        ]
        print_tables([Table("Segments", ["segment", "from [s]", "to [s]", "rate [Hz]", "signals"], rows)])
    for flaw in flaws:
        say(f"{flaw.signal}: {flaw.text}" if flaw.signal else flaw.text)
    if flaws:
        raise typer.Exit(1)
    say("no flaw found")
