"""The cars of the papers, as far as several units know them."""

from __future__ import annotations

from dataclasses import dataclass

from ..fmi.variables import parameter


@dataclass(frozen=True)
class PaperA:
    """The car of paper A, table 1, with in-wheel motors."""

    mass: float = parameter(1100.0, "kg", "Vehicle mass m", "paper A, table 1", minimum=1.0)
    yaw_inertia: float = parameter(1249.0, "kg.m2", "Yaw inertia I_z", "paper A, table 1", minimum=1.0)
    cg_to_front_axle: float = parameter(
        1.256, "m", "Distance a of the centre of mass from the front axle", "paper A, table 1", minimum=0.1
    )
    cg_to_rear_axle: float = parameter(
        1.368, "m", "Distance b of the centre of mass from the rear axle", "paper A, table 1", minimum=0.1
    )
    track_width: float = parameter(1.65, "m", "Track width d", "paper A, table 1", minimum=0.1)
    cg_height: float = parameter(0.7, "m", "Height h of the centre of mass", "paper A, table 1", minimum=0.0)
    wheel_radius: float = parameter(0.31, "m", "Wheel radius R", "paper A, table 1", minimum=0.05)
    wheel_inertia: float = parameter(
        2.1, "kg.m2", "Inertia J of one wheel", "chosen: paper B's value, paper A names none", minimum=0.01
    )


@dataclass(frozen=True)
class PaperB:
    """The car of paper B, table 1, with four driven wheels."""

    mass: float = parameter(1350.0, "kg", "Vehicle mass m", "paper B, table 1", minimum=1.0)
    yaw_inertia: float = parameter(1343.1, "kg.m2", "Yaw inertia I_z", "paper B, table 1", minimum=1.0)
    cg_to_front_axle: float = parameter(
        1.04, "m", "Distance a of the centre of mass from the front axle", "paper B, table 1", minimum=0.1
    )
    cg_to_rear_axle: float = parameter(
        1.56, "m", "Distance b of the centre of mass from the rear axle", "paper B, table 1", minimum=0.1
    )
    track_width: float = parameter(1.48, "m", "Track width d", "paper B, table 1", minimum=0.1)
    cg_height: float = parameter(0.54, "m", "Height h of the centre of mass", "paper B, table 1", minimum=0.0)
    wheel_radius: float = parameter(0.313, "m", "Wheel radius R", "chosen: that of tyre set 1", minimum=0.05)
    wheel_inertia: float = parameter(2.1, "kg.m2", "Inertia J of one wheel", "paper B, table 1", minimum=0.01)


@dataclass(frozen=True)
class PaperC:
    """The large saloon of paper C, table 1."""

    mass: float = parameter(
        1830.0,
        "kg",
        "Vehicle mass m",
        "paper C, table 1: 1650 kg sprung; chosen: 45 kg per wheel",
        minimum=1.0,
    )
    cg_to_front_axle: float = parameter(
        1.4, "m", "Distance a of the centre of mass from the front axle", "paper C, table 1", minimum=0.1
    )
    cg_to_rear_axle: float = parameter(
        1.65, "m", "Distance b of the centre of mass from the rear axle", "paper C, table 1", minimum=0.1
    )
    track_width: float = parameter(
        1.6,
        "m",
        "Track width d",
        "erratum: paper C prints 1.36, implausible with this wheelbase; peaks change by 1-4 %",
        minimum=0.1,
    )
    wheel_radius: float = parameter(
        0.33, "m", "Rolling radius R", "chosen: tyre of 0.34 unloaded", minimum=0.05
    )
