"""Parameters of the papers' cars that several components share."""

from dataclasses import dataclass

from ..fmi.variables import like, of_car


@dataclass(frozen=True)
class PaperA:
    """The car of paper A, table 1, with in-wheel motors."""

    mass: float = of_car(1100.0, "paper A, table 1", text="Vehicle mass m")
    yaw_inertia: float = of_car(1249.0, "paper A, table 1", text="Yaw inertia I_z")
    cg_to_front_axle: float = of_car(1.256, "paper A, table 1")
    cg_to_rear_axle: float = of_car(1.368, "paper A, table 1")
    track_width: float = of_car(1.65, "paper A, table 1", text="Track width d")
    cg_height: float = of_car(0.7, "paper A, table 1")
    wheel_radius: float = of_car(0.31, "paper A, table 1", text="Wheel radius R")
    wheel_inertia: float = of_car(2.1, "chosen: paper B's value, paper A gives none")


@dataclass(frozen=True)
class PaperASingleTrack:
    """The car of paper A as a linear single-track model, which several controllers know."""

    mass: float = like(PaperA, "mass")
    yaw_inertia: float = like(PaperA, "yaw_inertia")
    cg_to_front_axle: float = like(PaperA, "cg_to_front_axle")
    cg_to_rear_axle: float = like(PaperA, "cg_to_rear_axle")
    cornering_stiffness_front: float = of_car(100000.0, "paper A, table 1, two tyres")
    cornering_stiffness_rear: float = of_car(100000.0, "paper A, table 1, two tyres")


@dataclass(frozen=True)
class PaperB:
    """The car of paper B, table 1, with four driven wheels."""

    mass: float = like(PaperA, "mass", 1350.0, "paper B, table 1")
    yaw_inertia: float = like(PaperA, "yaw_inertia", 1343.1, "paper B, table 1")
    cg_to_front_axle: float = of_car(1.04, "paper B, table 1")
    cg_to_rear_axle: float = of_car(1.56, "paper B, table 1")
    track_width: float = like(PaperA, "track_width", 1.48, "paper B, table 1")
    cg_height: float = of_car(0.54, "paper B, table 1")
    wheel_radius: float = like(PaperA, "wheel_radius", 0.313, "chosen: that of tyre set 1")
    wheel_inertia: float = of_car(2.1, "paper B, table 1")


@dataclass(frozen=True)
class PaperC:
    """The large saloon of paper C, table 1."""

    mass: float = like(PaperA, "mass", 1830.0, "paper C, table 1: 1650 kg sprung; chosen: 45 kg per wheel")
    cg_to_front_axle: float = of_car(1.4, "paper C, table 1")
    cg_to_rear_axle: float = of_car(1.65, "paper C, table 1")
    track_width: float = like(
        PaperA,
        "track_width",
        1.6,
        "erratum: paper C prints 1.36, implausible with this wheelbase; peaks change by 1-4 %",
    )
    wheel_radius: float = of_car(0.33, "chosen: tyre of 0.34 unloaded", text="Rolling radius R")
