"""A tyre FMU by itself: its forces at slips, slip angles and loads that are given, and their slopes."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import ScenarioError
from ..fmu.opener import Opener, find_fmu, find_folder
from ..master.simulate import simulate_in_memory
from ..plan import Fmu, Plan, Series, Unit
from ..scenario import yaml_lines
from ..scenario.load import load_scenario
from ..scenario.overrides import is_path
from ..scenario.yaml_lines import Document
from ..wiring.make_plan import make_plan
from ..wording import listed

FOR_FILES = "tyre_magic_formula_62_transient"
"""The FMU on which a tyre property file is looked at: it tells relaxation lengths, too."""
SPEED = 20.0
"""At which the wheel travels [m/s]."""
WHEEL = "fl"
KNOWN_BY = ("tyre_force_x_fl", "tyre_force_y_fl", "slip_angle_fl", "vertical_load_fl")
"""Variables of a tyre."""
RADIUS = 0.3
"""Of the wheel [m], for tyres that want its speed and have none of their own."""
SMALL = 1e-4
"""Slip [1] and slip angle [rad] to each side of zero for stiffnesses."""


class State(NamedTuple):
    """How a wheel stands and rolls: slip angle [rad], longitudinal slip [1] of the interface, load [N]."""

    alpha: float = 0.0
    kappa: float = 0.0
    load: float = 4000.0


@dataclass(frozen=True)
class Stand:
    """A tyre on a stand, front left unless another wheel is named."""

    plan: Plan
    wheel: str = WHEEL

    @property
    def unit(self) -> Unit:
        """The tyre."""
        return self.plan.units[0]

    @property
    def nominal_load(self) -> float:
        """The tyre's own [N], or that of a passenger car's."""
        given = self.unit.parameter("fnomin_front") or self.unit.parameter("nominal_load")
        return float(given) if given else 4000.0

    def measure(self, states: Sequence[State]) -> dict[str, np.ndarray]:
        """Return every output of the wheel, by its name without the wheel; shape (n,), SI.

        The wheel rolls on in every state until forces that lag have settled.

        Raises:
            SimulationError: the FMU failed.
        """
        alpha, kappa, load = (np.array(column, float) for column in zip(*states, strict=True))
        v = SPEED * np.cos(alpha)
        radius = self.unit.parameter("wheel_radius")
        rolling = np.where(kappa > 0.0, v / (1.0 - np.minimum(kappa, 0.999)), v * (1.0 + kappa))
        given = {
            "slip_angle": alpha,
            "slip_ratio": kappa,
            "vertical_load": load,
            "wheel_velocity": v,
            "wheel_speed": rolling / (float(radius) if isinstance(radius, float) else RADIUS),
        }
        times = 2.0 * np.arange(len(states))
        series = {
            f"{name}_{self.wheel}": Series("stand", name, "", True, times, values)
            for name, values in given.items()
            if f"{name}_{self.wheel}" in self.unit.constants
        }
        unit = replace(self.unit, series=series)
        results = simulate_in_memory(replace(self.plan, units=(unit,), n_steps=2 * len(states)))
        columns = [
            f"{unit.name}.{v.name}" for v in unit.fmu.of("output") if v.name.endswith(f"_{self.wheel}")
        ]
        at_end = slice(2, None, 2)  # the second of two steps in each state
        return {c.partition(".")[2].removesuffix(f"_{self.wheel}"): results[c][at_end] for c in columns}


def stiffnesses(stand: Stand, loads: Sequence[float]) -> tuple[np.ndarray, np.ndarray]:
    """Return dF_x/dkappa [N] and -dF_y/dalpha [N/rad] at zero slip for some loads; shape (n,) each."""
    slopes = []
    for force, sign, states in (
        ("tyre_force_x", 1.0, [State(0.0, k, load) for load in loads for k in (-SMALL, SMALL)]),
        ("tyre_force_y", -1.0, [State(a, 0.0, load) for load in loads for a in (-SMALL, SMALL)]),
    ):
        found = stand.measure(states)[force].reshape(-1, 2)
        slopes.append(sign * (found[:, 1] - found[:, 0]) / (2.0 * SMALL))
    return slopes[0], slopes[1]


def put_on_stand(source: str, *, friction: float, fmus: Path | None, build: bool) -> Stand:
    """Return a tyre on a stand.

    Args:
        source: a tyre property file, a tyre FMU's path or its name in the folder of FMUs.
        friction: coefficient of the road [1].
        fmus: folder of FMUs given by name; None: the nearest.
        build: build the FMU first if it is stale.

    Raises:
        YawbenchError: there is no such tyre, or something is wrong with it.
    """
    file = source.lower().endswith(".tir")
    place = Path(source).parent / "stand"
    opener = Opener(build=build)
    fmu = open_given(FOR_FILES if file else source, "tyre", KNOWN_BY, place=place, fmus=fmus, opener=opener)
    inputs = [variable.name for variable in fmu.of("input")]
    data = {
        "title": Path(source).name,
        "step_size": 1.0,  # s: far beyond any relaxation length
        "stop_time": 1.0,
        "algorithm": "jacobi",
        "units": {"tyre": {"fmu": str(fmu.path.absolute())}},
        "inputs": {name: friction if name.startswith("friction") else 0.0 for name in inputs},
        **({"tyres": os.path.abspath(source)} if file else {}),
    }
    return Stand(make_plan(load_scenario(place, read=reader_of(data)), opener=opener))


def open_given(
    fmu: str, role: str, known_by: Iterable[str], *, place: Path, fmus: Path | None, opener: Opener
) -> Fmu:
    """Return the FMU that somebody names for a role, by a path from here or its name in a folder.

    Args:
        fmu: path or name.
        role: it is to have.
        known_by: variables that it then has.
        place: from where the folder is looked for.
        fmus: the folder; None: the nearest.
        opener: opens it.

    Raises:
        YawbenchError: there is none, or it is something else.
    """
    path = is_path(fmu)
    folder = Path() if path else fmus or find_folder(place, opener=opener)
    name = os.path.abspath(fmu) if path else fmu
    found = opener.open(find_fmu(name, scenario=place, fmus=folder, opener=opener))
    if missing := [variable for variable in known_by if variable not in found.variables]:
        raise ScenarioError(f"{fmu}: this is no {role}: it has no {listed(missing)}")
    return found


def reader_of(data: dict[str, Any]) -> Callable[..., Document]:
    """Return what reads a scenario that is no file, and the files that it names."""

    def read(path: Path, *, what: str) -> Document:
        return Document(path, data=data) if what == "scenario file" else yaml_lines.read(path, what=what)

    return read
