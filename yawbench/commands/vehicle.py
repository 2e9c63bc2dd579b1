"""`yawbench vehicle`: handling figures of a car."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from .json_and_latex import tabular
from .options import RunOptions, takes
from .output import print_tables, save_figure
from .terminal_progress import say

if TYPE_CHECKING:
    from collections.abc import Callable

    from yawbench.proving_ground.handling import Handling
    from yawbench.studies.tables import Cell, Table


VehicleAction = Annotated[Literal["show"], typer.Argument(help="show: drive the car and show its handling.")]
VehicleSource = Annotated[
    Path, typer.Argument(metavar="FILE", help="Vehicle file, or a name that `yawbench list vehicles` gives.")
]
Plants = Annotated[
    str | None,
    typer.Option(
        "--plant",
        metavar="FMU,FMU,...",
        help="Plants to drive. Default: the most detailed that the file has values for.",
    ),
]
TyreOption = Annotated[
    str,
    typer.Option(metavar="FMU", help="Tyre FMU. Default: the tyres that the file is made for."),
]
VehicleFriction = Annotated[float, typer.Option(min=0.05, help="Friction coefficient of the road.")]
VehicleOutput = Annotated[
    Path | None,
    typer.Option(
        "--out",
        metavar="FILE",
        help="Figure to write, as .svg and .png. Default: results/vehicles/<name>.",
    ),
]


@tabular
@takes("fmus", "no_build")
def vehicle(
    action: VehicleAction,
    file: VehicleSource,
    options: RunOptions,
    plant: Plants = None,
    tyre: TyreOption = "",
    friction: VehicleFriction = 1.0,
    out: VehicleOutput = None,
) -> None:
    """Show the handling and braking of a car.

    Drives the plant FMU and shows, in tables and a figure, static loads, characteristic speed, roll
    gradient, body modes, stopping distance; understeer over lateral acceleration; yaw gain, natural
    frequency and damping over speed.
    """
    from yawbench.orchestrator.results.folder_names import below_results
    from yawbench.orchestrator.scenario import catalogue, like
    from yawbench.orchestrator.scenario.schema import Vehicle
    from yawbench.orchestrator.scenario.schema_validation import validated
    from yawbench.planner import Planner
    from yawbench.proving_ground.handling import TestTrack, draw_cars, fitting_plant, handling_of
    from yawbench.vehicles.suspicious_values import suspicious_vehicle

    file = catalogue.find(file, "a vehicle file")
    document = like.read(file, what="vehicle file")
    spec = validated(Vehicle, document)
    for warning in suspicious_vehicle(spec.values):
        say(f"note: {warning}")
    planner = Planner(build=options.build)
    names = plant.split(",") if plant else [fitting_plant(file, tyre, options.fmus, planner)]
    tracks = [TestTrack(file, name.strip(), tyre, friction, options.fmus, planner) for name in names]
    cars = [handling_of(track) for track in tracks]
    print_tables(_tables(cars))
    for car in cars:
        for why in car.failed:
            say(f"note: {car.plant}: {why}")
    note = f"on {tracks[0].tyres}, friction {friction:g}"
    save_figure(draw_cars(cars, file.stem, note), out, below_results("vehicles", file.stem))


def _tables(cars: list[Handling]) -> list[Table]:
    """Return the tables, with a column for each plant."""
    import math

    from yawbench.proving_ground.handling import SPEEDS
    from yawbench.proving_ground.steady_state_steering import ACCELERATIONS, G
    from yawbench.studies.tables import Table
    from yawbench.vocabulary.roles import without_role

    names = [without_role(car.plant) for car in cars]
    numbers = set(range(1, len(names) + 1))
    whole = Table("The car", ["", *names], numbers=numbers)
    per_g = math.degrees(G)  # of rad s2/m
    for label, values in (
        ("load of a front wheel at rest", [_with_unit(car.loads[0], 1e-3, "kN") for car in cars]),
        ("load of a rear wheel at rest", [_with_unit(car.loads[2], 1e-3, "kN") for car in cars]),
        ("characteristic speed", [_with_unit(car.characteristic_speed, 3.6, "km/h") for car in cars]),
        ("roll gradient", [_with_unit(car.roll_gradient, per_g, "°/g") for car in cars]),
        ("roll mode at 80 km/h: natural frequency", [_mode(car.roll_mode, "frequency") for car in cars]),
        ("roll mode at 80 km/h: damping ratio", [_mode(car.roll_mode, "damping") for car in cars]),
        ("heave: natural frequency", [_mode(car.heave, "frequency") for car in cars]),
        ("heave: damping ratio", [_mode(car.heave, "damping") for car in cars]),
        ("stopping distance from 100 km/h", [_with_unit(car.stopping_distance, 1.0, "m") for car in cars]),
    ):
        whole.rows.append([label, *values])
    turn = Table("Understeer gradient at 80 km/h", ["lateral acceleration", *names], numbers=numbers)
    for a_y in (0.0, *ACCELERATIONS):
        label = f"{a_y:g} m/s²" if a_y else "linear range"
        turn.rows.append([label, *(_with_unit(car.steering.get(a_y), per_g, "°/g") for car in cars)])
    over_speed: list[tuple[str, Callable[[Handling, float], Cell]]] = [
        ("Steady yaw gain", lambda car, v: _with_unit(car.gains.get(v), 1.0, "1/s")),
        ("Yaw mode: natural frequency", lambda car, v: _mode(car.yaw.get(v), "frequency")),
        ("Yaw mode: damping ratio", lambda car, v: _mode(car.yaw.get(v), "damping")),
    ]
    of_yaw = []
    for title, text in over_speed:
        rows = [[f"{3.6 * speed:.0f} km/h", *(text(car, speed) for car in cars)] for speed in SPEEDS]
        of_yaw.append(Table(title, ["speed", *names], [*rows], numbers=numbers))
    return [whole, turn, *of_yaw]


def _with_unit(value: float | None, factor: float, unit: str) -> str:
    return "-" if value is None else f"{factor * value:.3g}{f' {unit}' if unit else ''}"


def _mode(mode: object, what: str) -> str:
    value = getattr(mode, what, None)
    return _with_unit(value, 1.0, "Hz" if what == "frequency" else "")
