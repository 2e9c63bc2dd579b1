"""Supervisor of a production-like stability control: states with thresholds, yaw moment, cut of the engine.

    e_r    = r_ref - r                             D(x, d): excess of |x| over d, with the sign of x
    e_beta = D(beta + T_beta dbeta, beta_max)      dbeta = a_y / v - r, smoothed
    oversteer      D(e_r) opposes the rotation r, or e_beta is not zero
    understeer     else

    off -> on      |e_r| > d = r_0 + share |r_ref| or e_beta not zero, for T_confirm
    on -> off      |e_r| < release d and e_beta zero, for T_release
    while on       M = k_r D(e_r, release d) + k_beta e_beta,   in understeer with a share of k_r
                   the engine is cut by |D(e_r, release d)| over a range, at limited rates

Below `full_speed` an intervention fades out, below `release_speed` and in reverse there is none.
`brake_preparation` is 1 while |e_r| exceeds `preparation_share` of d, and while the control is on, so that
brakes can be filled before they are needed.

A positive moment raises the yaw rate and lowers the sideslip. The sideslip angle is an estimator's; its rate
is estimated here, from what a sensor cluster measures.

Source: A. T. van Zanten, R. Erhardt, G. Pfaff, VDC, the vehicle dynamics control system of Bosch, SAE 950759,
1995, for dead band, states and engine torque; its parameters are not public. 49 CFR 571.126, S4 and S5.1, for
what such a system has: brake torques of single wheels in a closed loop against oversteer and understeer, yaw
rate measured, sideslip or its rate estimated, engine torque modified, at work from 20 km/h on, not in
reverse. Chosen: all numbers; docs/esc.md shows what they do.
"""

from dataclasses import dataclass
from math import exp

from ..control_laws.moment_limit import LimitParameters
from ..control_laws.phase_plane import beyond
from ..control_laws.sideslip_bound import sideslip_bound
from ..fmi.component import Component
from ..fmi.variables import like, output, parameter
from .dead_band import DeadBandParameters

OFF, OVERSTEER, UNDERSTEER = 0.0, 1.0, 2.0
"""Values of `stability_state`."""


@dataclass(frozen=True)
class EscParameters:
    """Thresholds, gains, times and gates."""

    yaw_rate_threshold: float = like(
        DeadBandParameters, "yaw_rate_threshold", 0.05, "chosen: 3 degrees per second"
    )
    yaw_rate_threshold_share: float = like(DeadBandParameters, "yaw_rate_threshold_share")
    release_share: float = parameter(
        0.5,
        "1",
        "Share of the threshold at which an intervention ends",
        "chosen: half",
        minimum=0.0,
        maximum=1.0,
    )
    preparation_share: float = parameter(
        0.6,
        "1",
        "Share of the threshold at which brakes are filled",
        "chosen: 20 to 50 ms before",
        minimum=0.0,
    )
    confirmation_time: float = parameter(
        0.02,
        "s",
        "Time T_confirm for which a threshold must be exceeded",
        "chosen: bumps and noise",
        minimum=0.0,
    )
    release_time: float = parameter(
        0.1,
        "s",
        "Time T_release below the lower threshold after which an intervention ends",
        "chosen",
        minimum=0.0,
    )
    yaw_rate_gain: float = like(DeadBandParameters, "yaw_rate_gain", 60000.0, "chosen: the limit at 10 deg/s")
    understeer_share: float = like(DeadBandParameters, "understeer_share")
    sideslip_gain: float = like(DeadBandParameters, "sideslip_gain")
    sideslip_lead: float = parameter(
        0.1,
        "s",
        "Time T_beta by which the sideslip is foreseen",
        "chosen: the delay of the brakes",
        minimum=0.0,
    )
    sideslip_friction: float = parameter(
        0.35,
        "1",
        "Friction whose bound on the sideslip is taken",
        "chosen: 4 degrees, on any road",
        minimum=0.0,
    )
    sideslip_rate_lag: float = parameter(
        0.02, "s", "Lag of the sideslip's rate", "chosen: noise of a_y", minimum=0.0
    )
    moment_limit: float = like(LimitParameters, "moment_limit", 10000.0, "chosen: that of the ranking")
    engine_range: float = parameter(
        0.1,
        "rad/s",
        "Excess of the yaw-rate error at which the engine gives nothing",
        "chosen: 6 deg/s",
        minimum=1e-4,
    )
    engine_fall: float = parameter(
        5.0, "1/s", "Fastest fall of the engine's share", "chosen: throttle and ignition, 0.2 s", minimum=0.01
    )
    engine_rise: float = parameter(
        1.0, "1/s", "Fastest rise of the engine's share", "chosen: the driver is not surprised", minimum=0.01
    )
    release_speed: float = like(DeadBandParameters, "release_speed")
    full_speed: float = like(
        DeadBandParameters, "full_speed", 5.5, "49 CFR 571.126, S5.1: works from 20 km/h on"
    )


SEEN = ("yaw_rate_ref", "yaw_rate", "sideslip", "velocity_x", "acceleration_y")


class EscController(Component):
    """Supervisor of a production-like stability control: states, yaw moment, cut of the engine."""

    Parameters = EscParameters
    sampled = True
    inputs = SEEN
    outputs = (
        output("yaw_moment", *SEEN),
        output("engine_reduction", *SEEN),
        output("brake_preparation", *SEEN),
        output(
            "stability_state",
            *SEEN,
            unit="1",
            text="State of the supervisor: 0 off, 1 oversteer, 2 understeer",
        ),
        output("sideslip_excess", *SEEN, unit="rad", text="Sideslip, foreseen, beyond its bound"),
    )

    def configure(self) -> None:
        self.bound = sideslip_bound(self.p.sideslip_friction)

    def start(self, t: float, u: list[float]) -> None:
        self.on = False
        self.waited = 0.0  # time [s] for which a change of state has been due
        self.reduction = 0.0
        self.prepared = 0.0
        self.state = OFF
        self.rate = self._rate(u)

    def advance(self, t: float, h: float, u: list[float]) -> None:
        p = self.p
        rate = self._rate(u)
        lag = p.sideslip_rate_lag
        self.rate = rate + (self.rate - rate) * exp(-h / lag) if lag > 0.0 else rate
        error = u[0] - u[1]
        threshold = self._threshold(u)
        foreseen = self._foreseen(u)
        if u[3] < p.release_speed:
            due = self.on = False
        elif self.on:
            due = abs(error) < p.release_share * threshold and foreseen == 0.0
        else:
            due = abs(error) > threshold or foreseen != 0.0
        self.waited = self.waited + h if due else 0.0
        if due and self.waited >= (p.release_time if self.on else p.confirmation_time):
            self.on, self.waited = not self.on, 0.0
        near = u[3] >= p.release_speed and abs(error) > p.preparation_share * threshold
        self.prepared = 1.0 if self.on or near else 0.0
        excess = beyond(error, p.release_share * threshold)
        self.state = (
            OFF if not self.on else OVERSTEER if excess * u[1] < 0.0 or foreseen != 0.0 else UNDERSTEER
        )
        wanted = min(abs(excess) / p.engine_range, 1.0) if self.on else 0.0
        self.reduction = min(
            max(wanted, self.reduction - p.engine_rise * h), self.reduction + p.engine_fall * h
        )

    def output(self, t: float, u: list[float]) -> tuple[float, ...]:
        p = self.p
        foreseen = self._foreseen(u)
        if not self.on:
            return 0.0, self.reduction, self.prepared, self.state, foreseen
        excess = beyond(u[0] - u[1], p.release_share * self._threshold(u))
        share = 1.0 if excess * u[1] < 0.0 else p.understeer_share
        moment = share * p.yaw_rate_gain * excess + p.sideslip_gain * foreseen
        awake = (u[3] - p.release_speed) / max(p.full_speed - p.release_speed, 1e-3)
        moment *= min(max(awake, 0.0), 1.0)
        moment = min(max(moment, -p.moment_limit), p.moment_limit)
        return moment, self.reduction, self.prepared, self.state, foreseen

    def _threshold(self, u: list[float]) -> float:
        """Return the yaw-rate error [rad/s] at which an intervention begins."""
        threshold: float = self.p.yaw_rate_threshold + self.p.yaw_rate_threshold_share * abs(u[0])
        return threshold

    def _foreseen(self, u: list[float]) -> float:
        """Return the excess [rad] of the sideslip, foreseen, over its bound; none at walking pace."""
        if u[3] < self.p.release_speed:
            return 0.0
        return beyond(u[2] + self.p.sideslip_lead * self.rate, self.bound)

    def _rate(self, u: list[float]) -> float:
        """Return the rate of the sideslip [rad/s] that a_y, yaw rate and speed tell."""
        slowest: float = max(self.p.release_speed, 0.1)
        return u[4] / max(u[3], slowest) - u[1]
