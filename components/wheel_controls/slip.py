"""Sliding-mode slip control with a known tyre model.

The law is described in `control_laws.slip_control`. It needs the tyre's F_x(kappa) at the current slip angle,
load and friction, which it evaluates with the functions of the tyre components. Its tyre parameters must be
those of the tyre, as with a vehicle file in a scenario.

`slip_share_*` tells whether a wheel keeps to (33) at this instant: its slip over the share of the optimum
that it may have there, whatever is asked for.

Source: paper B, equations (31)-(38).
"""

from dataclasses import dataclass

from ..control_laws.known_tyre import ANY_FORCE, TYRES, KnownTyreParameters
from ..control_laws.slip_control import SlipControlParameters, wheel_torque
from ..fmi.component import Component
from ..fmi.variables import output
from ..tyre_models.slip_curve import slip_for_force
from ..tyre_models.tyre import Curve


def slip_share(kappa: float, curve: Curve, share: float) -> float:
    """Return |kappa| over the slip limit of equation (33), `share` of the optimum on its side."""
    force, first = curve
    most = ANY_FORCE if kappa > 0.0 else -ANY_FORCE
    return abs(kappa / slip_for_force(most, force, first=first, cap=1.0, share=share))


@dataclass(frozen=True)
class SlipParameters(SlipControlParameters, KnownTyreParameters):
    """Parameters of the slip control and of all tyre models; only those of the selected model are used."""


class Slip(Component):
    """Slip control: wheel torque for the slip at which the tyre gives the requested force."""

    Parameters = SlipParameters
    inputs = (
        "force_request_*",
        "slip_ratio_*",
        "slip_angle_*",
        "vertical_load_*",
        "wheel_speed_*",
        "wheel_velocity_*",
        "friction_*",
    )
    outputs = (
        output("torque_request_*", *inputs),
        output(
            "slip_ratio_target_*",
            *("force_request_*", "slip_angle_*", "vertical_load_*", "friction_*"),
            unit="1",
            text="Slip that gives the requested force, within the limits",
        ),
        output(
            "slip_share_*",
            *("slip_ratio_*", "slip_angle_*", "vertical_load_*", "friction_*"),
            unit="1",
            text="Slip over the share of the optimum that it may have, equation (33): above 1 it is beyond",
        ),
    )
    sampled = True

    def configure(self) -> None:
        self.axles = TYRES[self.p.tyre].for_curve(self.p)

    def start(self, t: float, u: list[float]) -> None:
        *_, self.velocities, _ = self.by_signal(u)
        self.accelerations = [0.0, 0.0, 0.0, 0.0]
        self.sample_time = 0.001  # until the first step

    def advance(self, t: float, h: float, u: list[float]) -> None:
        if h <= 0.0:
            return
        *_, velocities, _ = self.by_signal(u)
        weight = 1.0 / (self.p.acceleration_filter + h)
        self.accelerations = [
            dv + weight * (now - before - h * dv)
            for dv, now, before in zip(self.accelerations, velocities, self.velocities, strict=True)
        ]
        self.velocities = velocities
        self.sample_time = h

    def output(self, t: float, u: list[float]) -> list[float]:
        curve_of = TYRES[self.p.tyre].curve
        torques, targets, shares = [], [], []
        by_wheel = zip(*self.by_signal(u), self.accelerations, self.axles, strict=True)
        for request, kappa, alpha, f_z, w, v, mu, dv, axle in by_wheel:
            curve = curve_of(alpha, f_z, mu, axle)
            torque, target = wheel_torque(
                request,
                kappa,
                curve,
                w=w,
                v=v,
                dv=dv,
                sample_time=self.sample_time,
                p=self.p,
            )
            torques.append(torque)
            targets.append(target)
            shares.append(slip_share(kappa, curve, self.p.optimum_share))
        return torques + targets + shares
