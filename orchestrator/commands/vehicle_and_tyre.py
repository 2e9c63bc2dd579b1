"""`yawbench vehicle` and `yawbench tyre`: handling figures of a car, characteristics of a tyre."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from .options import RunOptions, takes

if TYPE_CHECKING:
    from collections.abc import Callable

    from ..experiments.tables import Cell, Table
    from ..vehicles.handling_and_braking import Handling


VehicleAction = Annotated[
    Literal["show"], typer.Argument(help="show: drive it, and tell what that comes to.")
]
VehicleSource = Annotated[
    Path, typer.Argument(metavar="FILE", help="Vehicle file; a name is looked for as in list.")
]
Plants = Annotated[
    str | None,
    typer.Option(
        "--plant",
        metavar="FMU,FMU,...",
        help="Plants; default: the most detailed one that the file has the values for.",
    ),
]
TyreOption = Annotated[
    str,
    typer.Option(metavar="FMU", help="Tyres; default: those that the file is made for."),
]
VehicleFriction = Annotated[float, typer.Option(min=0.05, help="Coefficient of the road.")]
VehicleOutput = Annotated[
    Path | None,
    typer.Option(
        "--out",
        metavar="FILE",
        help="The figure, written as .svg and .png; default: results/vehicles/<name>.",
    ),
]


@takes("fmus", "no_build")
def vehicle(
    action: VehicleAction,
    file: VehicleSource,
    wishes: RunOptions,
    plant: Plants = None,
    tyre: TyreOption = "",
    friction: VehicleFriction = 1.0,
    out: VehicleOutput = None,
) -> None:
    """Show what a car is like, by driving its FMUs.

    Static loads, characteristic speed, roll gradient, body modes, stopping distance; understeer over lateral
    acceleration; yaw gain, natural frequency and damping over speed. All in tables, and in one figure.
    """
    from ..errors import ScenarioError
    from ..planner import Planner
    from ..results.folder import below_results
    from ..scenario import catalogue, yaml_lines
    from ..scenario.scenario_schema import Vehicle
    from ..scenario.validation import validate
    from ..vehicles.handling_and_braking import TestTrack, draw_cars, fitting_plant, handling_of
    from ..wiring.warnings import suspicious_vehicle
    from .progress import print_tables, save_figure, say

    file = catalogue.find(file, "a vehicle file")
    document = yaml_lines.read(file, what="vehicle file")
    spec = validate(Vehicle, document)
    if spec is None:
        raise ScenarioError(document.sorted_errors())
    for one in suspicious_vehicle(spec.parameters):
        say(f"note: {one}")
    planner = Planner(build=wishes.build)
    names = plant.split(",") if plant else [fitting_plant(file, tyre, wishes.fmus, planner)]
    tracks = [TestTrack(file, name.strip(), tyre, friction, wishes.fmus, planner) for name in names]
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

    from vocabulary.roles import without_role

    from ..evaluation.steering_tests import LEVELS, G
    from ..experiments.tables import Table
    from ..vehicles.handling_and_braking import SPEEDS

    names = [without_role(car.plant) for car in cars]
    numbers = set(range(1, len(names) + 1))
    whole = Table("The car", ["", *names], numbers=numbers)
    per_g = math.degrees(G)  # of rad s2/m
    for label, values in (
        ("load of a front wheel at rest", [_told(car.loads[0], 1e-3, "kN") for car in cars]),
        ("load of a rear wheel at rest", [_told(car.loads[2], 1e-3, "kN") for car in cars]),
        ("characteristic speed", [_told(car.characteristic_speed, 3.6, "km/h") for car in cars]),
        ("roll gradient", [_told(car.roll_gradient, per_g, "°/g") for car in cars]),
        ("roll mode at 80 km/h: natural frequency", [_mode(car.roll_mode, "frequency") for car in cars]),
        ("roll mode at 80 km/h: damping ratio", [_mode(car.roll_mode, "damping") for car in cars]),
        ("heave: natural frequency", [_mode(car.heave, "frequency") for car in cars]),
        ("heave: damping ratio", [_mode(car.heave, "damping") for car in cars]),
        ("stopping distance from 100 km/h", [_told(car.stopping_distance, 1.0, "m") for car in cars]),
    ):
        whole.rows.append([label, *values])
    turn = Table("Understeer gradient at 80 km/h", ["lateral acceleration", *names], numbers=numbers)
    for a_y in (0.0, *LEVELS):
        label = f"{a_y:g} m/s²" if a_y else "linear range"
        turn.rows.append([label, *(_told(car.steering.get(a_y), per_g, "°/g") for car in cars)])
    over_speed: list[tuple[str, Callable[[Handling, float], Cell]]] = [
        ("Steady yaw gain", lambda car, v: _told(car.gains.get(v), 1.0, "1/s")),
        ("Yaw mode: natural frequency", lambda car, v: _mode(car.yaw.get(v), "frequency")),
        ("Yaw mode: damping ratio", lambda car, v: _mode(car.yaw.get(v), "damping")),
    ]
    of_yaw = []
    for title, told in over_speed:
        rows = [[f"{3.6 * speed:.0f} km/h", *(told(car, speed) for car in cars)] for speed in SPEEDS]
        of_yaw.append(Table(title, ["speed", *names], [*rows], numbers=numbers))
    return [whole, turn, *of_yaw]


def _told(value: float | None, factor: float, unit: str) -> str:
    return "-" if value is None else f"{factor * value:.3g}{f' {unit}' if unit else ''}"


def _mode(mode: object, what: str) -> str:
    value = getattr(mode, what, None)
    return _told(value, 1.0, "Hz" if what == "frequency" else "")


TyreAction = Annotated[
    Literal["show"], typer.Argument(help="show: draw its forces, moments, stiffnesses, relaxation.")
]
TyreSource = Annotated[
    str,
    typer.Argument(metavar="FILE|FMU", help="Tyre property file (.tir), or a tyre FMU: its name or path."),
]
TyreOutput = Annotated[
    Path | None,
    typer.Option(
        "--out",
        metavar="FILE",
        help="The figure, written as .svg and .png; default: results/tyres/<name>.",
    ),
]
TyreFriction = Annotated[float, typer.Option(min=0.0, help="Coefficient of the road.")]


@takes("fmus", "no_build")
def tyre(
    action: TyreAction,
    source: TyreSource,
    wishes: RunOptions,
    out: TyreOutput = None,
    friction: TyreFriction = 1.0,
) -> None:
    """Show what a tyre is like, by stepping its FMU.

    One figure: lateral force and aligning moment over slip angle and longitudinal force over slip at four
    loads, forces in combined slip at five slip angles, stiffnesses and relaxation lengths over load.
    """
    from ..results.folder import below_results
    from ..tyres.stand import draw_tyre, put_on_stand
    from .progress import save_figure, say

    stand = put_on_stand(source, friction=friction, fmus=wishes.fmus, build=wishes.build)
    name, fmu = Path(source).name, stand.instance.fmu
    kind, side = "", ""
    if file := stand.plan.scenario.get("tyre_files", {}).get("front"):
        kind, side = f", {file['kind']}", f", {file['side'].lower()} side"
        for warning in file["warnings"]:
            say(f"warning: {warning}")
    note = f"front left wheel, friction {friction:g}, no camber · {fmu.name} ({fmu.sha256[:8]})"
    default = below_results("tyres", Path(source).stem)
    save_figure(draw_tyre(stand, f"{name}{kind}{side}", note), out, default)
