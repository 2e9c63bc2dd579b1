"""Hydraulic brakes: from braking force to cylinder pressure to wheel torque; driving force passes through.

    P* = min(F R / C, P_max) g(kappa),   F > 0 the braking part of the request
    tau dP/dt = P* - P,                  -falling rate <= dP/dt <= rising rate
    T = R (driving part of the request) - C P

C = A_w u_b R_b is the torque per pressure of a drum brake, A_w area and u_b friction coefficient of the shoe,
R_b radius of the drum. The slip release g falls from 1 to 0 between two values of braking slip, so that a
wheel does not lock; it fades out at walking pace, where slip is meaningless. These two values are

    optimum     shares of the slip at which the braking force of the known tyre is largest at the wheel's slip
                angle, load and friction (`control_laws.known_tyre`)
    slip        fixed

Released at a fixed slip near the optimum of straight braking, a wheel at 8 degrees of slip angle has less
than half of its braking force. A load-sensing valve, off by default, limits the braking force of a rear
brake to a multiple of the wheel's load.

A request takes effect from the communication point at which it arrives, so the pressure has no direct
feedthrough; the driving part has.

Source: paper C, equations (10), (11), without values.
"""

from dataclasses import dataclass

from ..cars.published_cars import PaperC
from ..control_laws.known_tyre import TYRES, KnownTyreParameters, optimum_slip
from ..fmi.component import Component
from ..fmi.variables import like, output, parameter
from ..mathematics.first_order_lag import Stage


@dataclass(frozen=True)
class HydraulicParameters(KnownTyreParameters):
    """Parameters of brakes, hydraulics, slip release and of the tyres that it knows."""

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
    release: str = parameter(
        "optimum",
        None,
        "Where pressure is released: from the tyre's optimum on, or from release_slip on",
        "chosen: at 8 degrees of slip angle a fixed 0.05 gives 44 % of the braking force at the optimum",
        choices=("optimum", "slip"),
    )
    release_share: float = parameter(
        0.95,
        "1",
        "Share of the optimum above which pressure is released",
        "paper B, equation (33)",
        minimum=0.0,
    )
    full_release_share: float = parameter(
        1.9,
        "1",
        "Share of the optimum above which the pressure request is zero",
        "chosen: twice the beginning, as for release_slip",
        minimum=0.01,
    )
    largest_release_slip: float = parameter(
        0.4,
        "1",
        "Largest optimum that the release follows",
        "chosen: that of tyre set 1 at 11 degrees; beyond, the optimum soon exceeds any slip",
        minimum=0.001,
        maximum=1.0,
    )
    release_slip: float = parameter(
        0.05,
        "1",
        "Fixed braking slip above which pressure is released",
        "chosen: before the optimum",
        minimum=0.0,
    )
    full_release_slip: float = parameter(
        0.1,
        "1",
        "Fixed braking slip above which the pressure request is zero",
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
    rear_braking_per_load: float = parameter(
        0.0,
        "1",
        "Largest braking force of a rear brake over the wheel's load, by a load-sensing valve; 0: no valve",
        "chosen: no valve",
        minimum=0.0,
    )


def asked_pressure(
    force: float,
    kappa: float,
    v: float,
    *,
    factor: float,
    p: HydraulicParameters,
    most: float,
    slips: tuple[float, float],
) -> float:
    """Return the requested cylinder pressure [Pa] for a force request [N], negative when braking.

    Args:
        kappa, v: longitudinal slip [1] and velocity [m/s] of the wheel.
        factor: torque per pressure C of the brake [m3].
        most: largest pressure [Pa].
        slips: braking slip from which the pressure is released, and that at which nothing is left [1].
    """
    if force >= 0.0:
        return 0.0
    pressure = min(-force * p.wheel_radius / factor, most)
    braking_slip = -kappa if v >= 0.0 else kappa
    begin, end = slips
    beyond = (braking_slip - begin) / max(end - begin, 1e-6)
    if beyond <= 0.0:
        return pressure
    fade = min(max(1.5 * abs(v) / p.release_speed - 0.5, 0.0), 1.0)
    return pressure * (1.0 - fade * min(beyond, 1.0))


class Hydraulic(Component):
    """Hydraulic brakes with slip release, and drive torque."""

    Parameters = HydraulicParameters
    inputs = (
        "force_request_*",
        "slip_ratio_*",
        "wheel_velocity_*",
        "slip_angle_*",
        "vertical_load_*",
        "friction_*",
    )
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
        if p.full_release_share < p.release_share:
            raise ValueError(
                f"full_release_share must be at least release_share = {p.release_share:g} "
                f"(got {p.full_release_share:g})"
            )
        self.axles = TYRES[p.tyre].for_curve(p)
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
            most = p.pressure_limit
            if i >= 2 and p.rear_braking_per_load > 0.0:
                most = min(most, p.rear_braking_per_load * u[16 + i] * p.wheel_radius / self.factors[i])
            demand = asked_pressure(
                self.requests[i],
                u[4 + i],
                u[8 + i],
                factor=self.factors[i],
                p=p,
                most=most,
                slips=self._release(i, u),
            )
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

    def _release(self, i: int, u: list[float]) -> tuple[float, float]:
        """Return the braking slips [1] at which the release of a wheel begins and ends."""
        p = self.p
        if p.release == "slip":
            return p.release_slip, p.full_release_slip
        if self.requests[i] >= 0.0:
            return 0.0, 0.0  # nothing to release
        curve = TYRES[p.tyre].curve(u[12 + i], u[16 + i], u[20 + i], self.axles[i])
        optimum = optimum_slip(curve, driving=u[8 + i] < 0.0, cap=p.largest_release_slip)
        return p.release_share * optimum, p.full_release_share * optimum
