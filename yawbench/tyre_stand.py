"""A test stand for tyre FMUs: forces at given slips, slip angles and loads, stiffnesses, and their figure.

`cornering_stiffness` measures the tyres of a scenario at given loads.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from yawbench.figures.style import QUIET, ROW, frame, line_style, new_figure
from yawbench.fmus.fmu import Fmu, Value, is_path
from yawbench.fmus.opener import Building, Opener, find_fmu, find_folder
from yawbench.foundation.errors import ScenarioError
from yawbench.foundation.messages import listed
from yawbench.orchestrator.master.simulate import simulate_in_memory
from yawbench.orchestrator.plan import InputSeries, Instance, Plan
from yawbench.orchestrator.scenario.loader import load_scenario
from yawbench.orchestrator.signal_names import SignalName
from yawbench.orchestrator.wiring.make_plan import make_plan
from yawbench.vehicles.car import cars
from yawbench.vehicles.tir import read_tir

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


FOR_FILES = "tyre_magic_formula_62_transient"
"""FMU used for tyre property files: it also has relaxation lengths as outputs."""
SPEED = 20.0
"""Speed of the wheel [m/s]."""
WHEEL = "fl"
KNOWN_BY = ("tyre_force_x_fl", "tyre_force_y_fl", "slip_angle_fl", "vertical_load_fl")
"""Variables by which a tyre FMU is recognized."""
RADIUS = 0.3
"""Wheel radius [m] for tyre FMUs that take the wheel speed and have no radius parameter."""
SMALL = 1e-4
"""Slip [1] and slip angle [rad] on each side of zero for stiffnesses."""


class WheelState(NamedTuple):
    """The state of a wheel: slip angle [rad], longitudinal slip [1] as in the interface, load [N]."""

    alpha: float = 0.0
    kappa: float = 0.0
    load: float = 4000.0


@dataclass(frozen=True)
class TyreStand:
    """A tyre on a stand, by default the front left one."""

    plan: Plan
    wheel: str = WHEEL

    @property
    def instance(self) -> Instance:
        """The tyre instance."""
        return self.plan.instances[0]

    @property
    def nominal_load(self) -> float:
        """The tyre's nominal load [N], or that of a passenger car's tyre."""
        load = self.instance.parameter("fnomin_front") or self.instance.parameter("nominal_load")
        return float(load) if load else 4000.0

    def measure(self, states: Sequence[WheelState]) -> dict[str, np.ndarray]:
        """Return every output of the wheel, by its name without the wheel; shape (n,), SI.

        In every state the wheel keeps rolling until lagging forces have settled.

        Raises:
            SimulationError: the FMU failed.
        """
        alpha, kappa, load = (np.array(column, float) for column in zip(*states, strict=True))
        v = SPEED * np.cos(alpha)
        radius = self.instance.parameter("wheel_radius")
        rolling = np.where(kappa > 0.0, v / (1.0 - np.minimum(kappa, 0.999)), v * (1.0 + kappa))
        inputs = {
            "slip_angle": alpha,
            "slip_ratio": kappa,
            "vertical_load": load,
            "wheel_velocity": v,
            "wheel_speed": rolling / (float(radius) if isinstance(radius, float) else RADIUS),
        }
        times = 2.0 * np.arange(len(states))
        series = {
            f"{name}_{self.wheel}": InputSeries("stand", name, "", True, times, values)
            for name, values in inputs.items()
            if f"{name}_{self.wheel}" in self.instance.constants
        }
        instance = replace(self.instance, series=series)
        results = simulate_in_memory(replace(self.plan, instances=(instance,), n_steps=2 * len(states)))
        names = (SignalName(instance.name, v.name) for v in instance.fmu.of("output"))
        at_end = slice(2, None, 2)  # the second of two steps in each state
        return {
            name.variable.removesuffix(f"_{self.wheel}"): results[str(name)][at_end]
            for name in names
            if name.variable.endswith(f"_{self.wheel}")
        }


def stiffnesses(stand: TyreStand, loads: Sequence[float]) -> tuple[np.ndarray, np.ndarray]:
    """Return dF_x/dkappa [N] and -dF_y/dalpha [N/rad] at zero slip for the loads; shape (n,) each."""
    slopes = []
    for force, sign, states in (
        ("tyre_force_x", 1.0, [WheelState(0.0, k, load) for load in loads for k in (-SMALL, SMALL)]),
        ("tyre_force_y", -1.0, [WheelState(a, 0.0, load) for load in loads for a in (-SMALL, SMALL)]),
    ):
        forces = stand.measure(states)[force].reshape(-1, 2)
        slopes.append(sign * (forces[:, 1] - forces[:, 0]) / (2.0 * SMALL))
    return slopes[0], slopes[1]


def put_on_stand(source: str, *, friction: float, fmus: Path | None, build: Building) -> TyreStand:
    """Return a tyre on a stand.

    Args:
        source: a tyre property file, a tyre FMU's path or its name in the folder of FMUs.
        friction: coefficient of the road [1].
        fmus: folder of FMUs given by name; None: the nearest.
        build: build the FMU first if it is out of date.

    Raises:
        YawbenchError: the tyre does not exist or is invalid.
    """
    file = source.lower().endswith(".tir")
    near = Path(source).parent / "stand"
    opener = Opener(build=build)
    fmu = open_role(FOR_FILES if file else source, "tyre", KNOWN_BY, near=near, fmus=fmus, opener=opener)
    inputs = [variable.name for variable in fmu.of("input")]
    data = {
        "title": Path(source).name,
        "step_size": 1.0,  # [s], far beyond any relaxation length
        "stop_time": 1.0,
        "algorithm": "jacobi",
        "units": {"tyre": {"fmu": str(fmu.path.absolute())}},
        "inputs": {name: friction if name.startswith("friction") else 0.0 for name in inputs},
        **({"tyres": os.path.abspath(source)} if file else {}),
    }
    return TyreStand(
        make_plan(load_scenario(near, data=data, read_tyre=read_tir), opener=opener, domain=cars())
    )


def open_role(
    fmu: str, role: str, known_by: Iterable[str], *, near: Path, fmus: Path | None, opener: Opener
) -> Fmu:
    """Open an FMU given by path or by its name in a folder, and check its role.

    Args:
        fmu: path or name.
        role: the role it must have.
        known_by: variables that FMUs of this role have.
        near: where the search for the folder starts.
        fmus: the folder; None: the nearest.
        opener: opens it.

    Raises:
        YawbenchError: it does not exist, or has another role.
    """
    path = is_path(fmu)
    folder = Path() if path else fmus or find_folder(near, opener=opener)
    name = os.path.abspath(fmu) if path else fmu
    opened = opener.open(find_fmu(name, scenario=near, fmus=folder, opener=opener))
    if missing := [variable for variable in known_by if variable not in opened.variables]:
        raise ScenarioError(f"{fmu}: not a {role} FMU: it has no {listed(missing)}", code="fmu-wrong-kind")
    return opened


def cornering_stiffness(tyres: Instance, loads: Mapping[str, float]) -> dict[str, float]:
    """Return the cornering stiffness [N/rad] of one tyre for each wheel, under the wheel's load [N].

    The road is given by the instance's constants; where a wire gives road or motion, the tyre rolls straight
    ahead on a dry road, friction 1.

    Raises:
        SimulationError: the FMU failed.
        ValueError: it cannot be stepped outside the run.
    """
    if tyres.fmu.once_per_process:
        raise ValueError(f"{tyres.fmu.name} can be instantiated only once per process")
    inputs: dict[str, Value] = {
        v.name: 1.0 if v.name.startswith("friction") else 0.0 for v in tyres.fmu.of("input")
    }
    instance = replace(tyres, constants=inputs | tyres.constants, series={}, period=1)
    record = tuple(SignalName(instance.name, v.name) for v in instance.fmu.of("output"))
    plan = Plan((instance,), (), record, Fraction(1), 1, "jacobi", title=instance.name)
    return {wheel: float(stiffnesses(TyreStand(plan, wheel), [load])[1][0]) for wheel, load in loads.items()}


OF_NOMINAL = (0.5, 1.0, 1.5, 2.0)
"""Loads of the curves over the nominal load."""
ANGLES = (0.0, 2.0, 4.0, 7.0, 12.0)
"""Slip angles of the friction ellipse [deg]."""
LARGEST_ANGLE, LARGEST_SLIP = np.radians(15.0), 0.5
"""Ends of the curves [rad], [1]."""
POINTS = 151


def draw_tyre(stand: TyreStand, title: str, note: str) -> Figure:
    """Return the figure of a tyre: forces, aligning moment, friction ellipse, stiffnesses, relaxation.

    Raises:
        SimulationError: the FMU failed.
    """
    nominal = stand.nominal_load
    loads = [share * nominal for share in OF_NOMINAL]
    angles = np.linspace(-LARGEST_ANGLE, LARGEST_ANGLE, POINTS)
    slips = np.linspace(-LARGEST_SLIP, LARGEST_SLIP, POINTS)
    around = np.sort(
        np.concatenate([-np.geomspace(1e-3, 0.98, POINTS), [0.0], np.geomspace(1e-3, 0.95, POINTS)])
    )
    with new_figure() as figure:
        grid = figure.add_gridspec(3, 2)
        axes = [figure.add_subplot(grid[i // 2, i % 2]) for i in range(6)]
        over_angle = [stand.measure([WheelState(alpha, 0.0, load) for alpha in angles]) for load in loads]
        over_slip = [stand.measure([WheelState(0.0, kappa, load) for kappa in slips]) for load in loads]
        names = [f"F_z = {load / 1e3:.3g} kN" for load in loads]
        degrees = np.degrees(angles)
        _curves(axes[0], degrees, [y["tyre_force_y"] / 1e3 for y in over_angle], names)
        axes[0].set(title="Lateral force", xlabel="slip angle [°]", ylabel="F_y [kN]")
        if "aligning_moment" in over_angle[0]:
            _curves(axes[1], degrees, [y["aligning_moment"] for y in over_angle], names)
        else:
            _nothing(axes[1], "this tyre has no aligning moment")
        axes[1].set(title="Aligning moment", xlabel="slip angle [°]", ylabel="M_z [N·m]")
        _curves(axes[2], slips, [y["tyre_force_x"] / 1e3 for y in over_slip], names)
        axes[2].set(title="Longitudinal force", xlabel="slip κ [1]", ylabel="F_x [kN]")
        for number, angle in enumerate(ANGLES):
            y = stand.measure([WheelState(np.radians(angle), kappa, nominal) for kappa in around])
            style = line_style(number)
            axes[3].plot(y["tyre_force_x"] / 1e3, -y["tyre_force_y"] / 1e3, **style, label=f"{angle:g}°")
        inside: dict[str, Any] = {"loc": "lower center", "bbox_to_anchor": (0.5, 0.17), "ncols": 3}
        axes[3].legend(title="slip angle", fontsize=7.5, title_fontsize=7.5, **inside)
        axes[3].set(title=f"Combined slip at {nominal / 1e3:.3g} kN", xlabel="F_x [kN]", ylabel="-F_y [kN]")
        _over_load(stand, axes[4], axes[5], np.linspace(0.05, OF_NOMINAL[-1], 60) * nominal)
        handles = [axes[0].plot([], [], **line_style(i), label=name)[0] for i, name in enumerate(names)]
        frame(figure, 3 * 1.25 * ROW, handles, title, note)
    return figure


def _over_load(stand: TyreStand, left: Axes, right: Axes, loads: np.ndarray) -> None:
    k_x, k_y = stiffnesses(stand, list(loads))
    left.plot(loads / 1e3, k_x / 1e3, **line_style(0), label="∂F_x/∂κ [kN]")
    left.plot(loads / 1e3, k_y / 1e3, **line_style(1), label="-∂F_y/∂α [kN/rad]")
    left.legend(fontsize=7.5, loc="upper left")
    left.set(title="Stiffnesses at zero slip", xlabel="load F_z [kN]", ylabel="")
    at_rest = stand.measure([WheelState(0.0, 0.0, load) for load in loads])
    lengths = [(f"relaxation_length_{axis}", f"σ_{axis}") for axis in "xy"]
    for number, (name, label) in enumerate(lengths):
        if name in at_rest:
            right.plot(loads / 1e3, at_rest[name], **line_style(number), label=label)
    if right.get_lines():
        right.legend(fontsize=7.5, loc="upper left")
        right.set_ylim(bottom=0.0)
    else:
        _nothing(right, "this tyre's forces do not lag")
    right.set(title="Relaxation lengths", xlabel="load F_z [kN]", ylabel="σ [m]")


def _curves(axes: Axes, x: np.ndarray, every: Sequence[np.ndarray], names: Sequence[str]) -> None:
    for number, (y, name) in enumerate(zip(every, names, strict=True)):
        axes.plot(x, y, **line_style(number), label=name)


def _nothing(axes: Axes, why: str) -> None:
    axes.text(0.5, 0.5, why, transform=axes.transAxes, ha="center", color=QUIET)
    axes.xaxis.set_visible(False)
    axes.yaxis.set_visible(False)
