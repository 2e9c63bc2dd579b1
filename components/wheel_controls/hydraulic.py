"""Hydraulic brakes: from braking force to cylinder pressure to wheel torque; driving force passes through.

    P* = min(F R / C, P_max) g(kappa),   F > 0 the braking part of the request
    tau dP/dt = P* - P,                  -falling rate <= dP/dt <= rising rate
    T = R (driving part of the request) - C P

C = A_w u_b R_b is the torque per pressure of a drum brake, A_w area and u_b friction coefficient of the shoe,
R_b radius of the drum. The slip release g falls from 1 to 0 between two values of braking slip, so that a
wheel does not lock; it fades out at walking pace, where slip is meaningless.

A request takes effect from the communication point at which it arrives, so the pressure has no direct
feedthrough; the driving part has.

Source: paper C, equations (10), (11), without values.
"""

from dataclasses import dataclass

from ..cars.published_cars import PaperC
from ..fmi.component import Component
from ..fmi.variables import like, output, parameter
from ..mathematics.first_order_lag import Stage


@dataclass(frozen=True)
class HydraulicParameters:
    """Parameters of brakes, hydraulics and slip release."""

    wheel_radius: float = like(PaperC, "wheel_radius")
    brake_factor_front: float = parameter(
        2.2e-4, "m3", "Torque per pressure C of a front brake", "chosen: large saloon", minimum=1e-7
    )
    brake_factor_rear: float = parameter(
        1.1e-4, "m3", "Torque per pressure C of a rear brake", "chosen: half of the front", minimum=1e-7
    )
    pressure_limit: float = parameter(
        1e7, "Pa", "Largest cylinder pressure P_max", "chosen: 100 bar", minimum=0.0
    )
    pressure_rise_limit: float = parameter(
        2e7, "Pa/s", "Fastest rise of the pressure", "chosen: an ESP pump", minimum=1.0
    )
    pressure_fall_limit: float = parameter(
        4e7, "Pa/s", "Fastest fall of the pressure", "chosen: open valves", minimum=1.0
    )
    pressure_lag: float = parameter(0.08, "s", "Lag tau of the pressure", "chosen", minimum=0.0)
    release_slip: float = parameter(
        0.05, "1", "Braking slip above which pressure is released", "chosen: before the optimum", minimum=0.0
    )
    full_release_slip: float = parameter(
        0.1,
        "1",
        "Braking slip above which the pressure request is zero",
        "chosen: about the optimum",
        minimum=0.001,
    )
    release_speed: float = parameter(
        3.0,
        "m/s",
        "Wheel velocity from which slip release is fully active; below a third of it, off",
        "chosen: walking pace",
        minimum=0.1,
    )
    drive_torque_limit: float = parameter(
        2500.0, "N.m", "Largest driving torque of a wheel", "chosen: an engine in a low gear", minimum=0.0
    )


def asked_pressure(force: float, kappa: float, v: float, *, factor: float, p: HydraulicParameters) -> float:
    """Return the requested cylinder pressure [Pa] for a force request [N], negative when braking.

    Args:
        kappa, v: longitudinal slip [1] and velocity [m/s] of the wheel.
        factor: torque per pressure C of the brake [m3].
    """
    if force >= 0.0:
        return 0.0
    pressure = min(-force * p.wheel_radius / factor, p.pressure_limit)
    braking_slip = -kappa if v >= 0.0 else kappa
    beyond = (braking_slip - p.release_slip) / max(p.full_release_slip - p.release_slip, 1e-6)
    if beyond <= 0.0:
        return pressure
    fade = min(max(1.5 * abs(v) / p.release_speed - 0.5, 0.0), 1.0)
    return pressure * (1.0 - fade * min(beyond, 1.0))


class Hydraulic(Component):
    """Hydraulic brakes with slip release, and drive torque."""

    Parameters = HydraulicParameters
    inputs = ("force_request_*", "slip_ratio_*", "wheel_velocity_*")
    outputs = (
        output("torque_request_*", "force_request_*"),
        output("brake_pressure_*", unit="Pa", text="Pressure in the wheel's brake cylinder"),
    )

    def configure(self) -> None:
        p = self.p
        if p.full_release_slip < p.release_slip:
            raise ValueError(
                f"full_release_slip must be at least release_slip = {p.release_slip:g} "
                f"(got {p.full_release_slip:g})"
            )
        front, rear = p.brake_factor_front, p.brake_factor_rear
        self.factors = (front, front, rear, rear)

    def start(self, t: float, u: list[float]) -> None:
        p = self.p
        self.requests = u[:4]
        self.cylinders = [
            Stage(tau=p.pressure_lag, rate=p.pressure_rise_limit, falling_rate=p.pressure_fall_limit)
            for _ in range(4)
        ]

    def advance(self, t: float, h: float, u: list[float]) -> None:
        p = self.p
        for i, cylinder in enumerate(self.cylinders):
            demand = asked_pressure(self.requests[i], u[4 + i], u[8 + i], factor=self.factors[i], p=p)
            cylinder.advance(t, h, demand)
        self.requests = u[:4]

    def output(self, t: float, u: list[float]) -> tuple[float, ...] | list[float]:
        p = self.p
        pressures = [cylinder.value for cylinder in self.cylinders]
        torques = [
            min(max(force, 0.0) * p.wheel_radius, p.drive_torque_limit) - factor * pressure
            for force, factor, pressure in zip(u[:4], self.factors, pressures, strict=True)
        ]
        return torques + pressures
