"""Sliding-mode slip control with a known tyre model.

The law is described in `control_laws.slip_control`. It needs the tyre's F_x(kappa) at the current slip angle,
load and friction, which it evaluates with the functions of the tyre components. Its tyre parameters must be
those of the tyre, as with a vehicle file in a scenario.

`slip_share_*` tells whether a wheel keeps to (33) at this instant: its slip over the share of the optimum
that it may have there, whatever is asked for.

Source: paper B, equations (31)-(38).
"""

from dataclasses import dataclass
from typing import Any

from ..control_laws.slip_control import SlipControlParameters, wheel_torque
from ..fmi.component import Component
from ..fmi.variables import output, parameter
from ..tyre_models.slip_curve import slip_for_force
from ..tyre_models.tyre import Curve, Tyre
from ..tyres.dugoff import Dugoff
from ..tyres.linear import LinearTyre
from ..tyres.magic_formula import MagicFormula
from ..tyres.magic_formula_62 import MagicFormula62
from ..tyres.magic_formula_1987 import MagicFormula1987

TYRES: dict[str, type[Tyre]] = {
    "magic_formula": MagicFormula,
    "magic_formula_1987": MagicFormula1987,
    "magic_formula_62": MagicFormula62,
    "dugoff": Dugoff,
    "linear": LinearTyre,
}
"""Tyre models available to the slip control."""


ANY_FORCE = 1e6
"""More than any tyre gives [N], so that what is asked for is the limit of the slip."""


def slip_share(kappa: float, curve: Curve, share: float) -> float:
    """Return |kappa| over the slip limit of equation (33), `share` of the optimum on its side."""
    force, first = curve
    most = ANY_FORCE if kappa > 0.0 else -ANY_FORCE
    return abs(kappa / slip_for_force(most, force, first=first, cap=1.0, share=share))


OF_TYRES: Any = tuple(tyre.CurveParameters for tyre in TYRES.values())


@dataclass(frozen=True)
class SlipParameters(SlipControlParameters, *OF_TYRES):  # type: ignore[misc]  # as many bases as tyres
    """Parameters of the slip control and of all tyre models; only those of the selected model are used."""

    tyre: str = parameter(
        "magic_formula",
        None,
        "Tyre model",
        "chosen: the tyre of paper B",
        choices=tuple(TYRES),
    )


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
