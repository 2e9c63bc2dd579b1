"""A car of a vehicle file on a plant and tyres, steered, braked or dropped, in scenarios made for it."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from ..errors import WiringError
from ..fmu.opener import Opener
from ..master.simulate import simulate_in_memory
from ..plan import Fmu, Plan
from ..results.read import Results
from ..scenario import yaml_lines
from ..scenario.load import load_scenario
from ..scenario.overrides import is_path
from ..tyres.axle_stiffness import cornering_stiffness
from ..tyres.stand import KNOWN_BY, open_given, reader_of
from ..wiring.make_plan import make_plan

PLANTS = ("plant_fourteen_dof", "plant_eight_dof", "plant_seven_dof", "plant_two_dof")
"""In the order in which one is looked for that a file describes a car for."""
STEP = 0.002
"""Communication step [s]. Chosen: steady turns and yaw differ by less than 1e-4 from those at 1 ms."""
TORQUES = "wheel_torque_fl"
"""An input of plants whose wheels are driven and braked."""
PLANT_KNOWN_BY = ("velocity_y", "yaw_rate", "acceleration_y", "vertical_load_fl", "slip_angle_fl")
"""Variables of a plant."""


@dataclass(frozen=True)
class TestTrack:
    """A car on a dry, flat road.

    Args:
        vehicle: its file.
        plant: an FMU, by name or path.
        tyre: likewise; "": what the file is made for.
        friction: coefficient of the road [1].
        fmus: folder of FMUs given by name; None: the nearest.
        opener: opens FMUs, building first what is stale if it may.
    """

    __test__ = False  # no test of pytest's

    vehicle: Path
    plant: str
    tyre: str = ""
    friction: float = 1.0
    fmus: Path | None = None
    opener: Opener = field(default_factory=Opener)

    @cached_property
    def place(self) -> Path:
        """Where the scenario stands, which is no file: messages name the car's."""
        return Path(os.path.relpath(self.vehicle))

    @cached_property
    def plant_fmu(self) -> Fmu:
        """The plant's FMU."""
        return open_given(
            self.plant, "plant", PLANT_KNOWN_BY, place=self.place, fmus=self.fmus, opener=self.opener
        )

    def has(self, variable: str) -> bool:
        """Return whether the plant has a variable."""
        return variable in self.plant_fmu.variables

    @cached_property
    def tyres(self) -> str:
        """The tyres' FMU: as told, or that which takes the file's tyre property files or stiffness."""
        data = yaml_lines.read(self.vehicle, what="vehicle file").data
        given = data if isinstance(data, dict) else {}
        if self.tyre or given.get("tyres"):
            return self.tyre or "tyre_magic_formula_62"
        no_load = "cornering_stiffness" in (given.get("parameters") or {})
        return "tyre_dugoff" if no_load else "tyre_magic_formula"

    def plan(self, driver: Mapping[str, Any], speed: float, stop_time: float, **of_plant: float) -> Plan:
        """Return the plan of a run.

        Args:
            driver: the unit, as a scenario has it.
            speed: at the start, and held if the driver does [m/s].
            stop_time: [s].
            of_plant: parameters of the plant.

        Raises:
            YawbenchError: the file, the plant or the tyres are none, or do not go together.
        """
        open_given(self.tyres, "tyre", KNOWN_BY, place=self.place, fmus=self.fmus, opener=self.opener)
        units: dict[str, Any] = {"driver": dict(driver)}
        plant: dict[str, Any] = {"fmu": self._named(self.plant), "parameters": of_plant}
        inputs: dict[str, Any] = {}
        connections = []
        if self.has(TORQUES):
            units["allocator"] = {"fmu": "allocator_load_proportional"}
            units["wheel_control"] = {"fmu": "wheel_control_hydraulic"}
            connections.append({"from": "wheel_control.torque_request_*", "to": "plant.wheel_torque_*"})
            inputs["allocator.yaw_moment"] = 0.0
        if self.has("yaw_moment"):
            inputs["plant.yaw_moment"] = 0.0
        units |= {"plant": plant, "tyre": {"fmu": self._named(self.tyres)}}
        data = {
            "title": Path(self.vehicle).name,
            "vehicle": os.path.abspath(self.vehicle),
            "friction": self.friction,
            "speed": speed,
            "step_size": STEP,
            "stop_time": round(round(stop_time / STEP) * STEP, 6),
            "units": units,
            "inputs": inputs,
            "connections": connections,
        }
        loaded = load_scenario(self.place, read=reader_of(data))
        return make_plan(loaded, fmus=self.fmus, opener=self.opener, measure=cornering_stiffness)

    def drive(self, driver: Mapping[str, Any], speed: float, stop_time: float, **of_plant: float) -> Results:
        """Return the results of a run; arguments as of `plan`.

        Raises:
            YawbenchError: as `plan`, or the run failed: a car has rolled over.
        """
        return simulate_in_memory(self.plan(driver, speed, stop_time, **of_plant))

    def _named(self, fmu: str) -> str:
        return os.path.abspath(fmu) if is_path(fmu) else fmu


def fitting_plant(vehicle: Path, tyre: str, fmus: Path | None, opener: Opener) -> str:
    """Return the plant of the most degrees of freedom that a file describes a car for.

    Raises:
        YawbenchError: it describes one for none; why not for that of the fewest.
    """
    steer = {"fmu": "driver_sine"}
    for plant in PLANTS[:-1]:
        try:
            TestTrack(vehicle, plant, tyre, fmus=fmus, opener=opener).plan(steer, 20.0, STEP)
        except WiringError:
            continue
        return plant
    TestTrack(vehicle, PLANTS[-1], tyre, fmus=fmus, opener=opener).plan(steer, 20.0, STEP)
    return PLANTS[-1]
