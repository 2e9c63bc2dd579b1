"""Super-twisting sliding-mode control of yaw rate and sideslip, of second order.

    s = (r_ref - r) + w (beta_ref - beta)                                 `control_laws.sliding_surface`, (19)
    M = I_z [dr_ref/dt + w (dbeta_ref/dt - dbeta/dt) + u(s)]              `mathematics.super_twisting`

The moment is continuous: it is the rate of the moment that switches, and s and its rate reach zero in finite
time if the yaw acceleration that the law does not know changes by no more than L. Both gains follow from L.
Beyond the moment's limit the integral only moves back.

Source of the algorithm: A. Levant, in `mathematics.super_twisting`. Sliding modes of second order for the
yaw rate: M. Canale, L. Fagiano, A. Ferrara, C. Vecchio, Vehicle yaw control via second-order sliding-mode
technique, IEEE Transactions on Industrial Electronics 55(11), 2008, 3908-3916; L. De Novellis, A.
Sorniotti, P. Gruber, A. Pennycott, IEEE Transactions on Vehicular Technology 63(8), 2014, 3612-3623, which
compares two of them. Of the last the abstract was at hand, of the others nothing, and no gains; as we know
the first, it has the sub-optimal algorithm, another one of second order. The surface is that of paper B; w
= 0 leaves the yaw rate alone, as these papers do.
"""

from dataclasses import dataclass
from math import sqrt

from ..control_laws.moment_limit import limit
from ..control_laws.sliding_surface import ERRORS, SURFACE, SlidingSurface, SurfaceParameters
from ..fmi.component import Component
from ..fmi.variables import like, output, parameter
from ..mathematics.super_twisting import SuperTwisting


@dataclass(frozen=True)
class SuperTwistingParameters:
    """Parameters of surface, algorithm and limit."""

    sideslip_weight: float = like(SurfaceParameters, "sideslip_weight")
    disturbance_slope: float = parameter(
        20.0,
        "rad/s3",
        "Bound L on the change of the unknown yaw acceleration",
        "chosen: all that tyres give, 4.4 rad/s2, in a sine of 0.7 Hz",
        minimum=1e-6,
    )
    square_root_factor: float = parameter(
        1.5, "1", "Gain of the square root over sqrt(L)", "Levant 1998", minimum=0.0
    )
    integral_factor: float = parameter(1.1, "1", "Gain of the integral over L", "Levant 1998", minimum=1e-6)
    yaw_inertia: float = like(SurfaceParameters, "yaw_inertia")
    moment_limit: float = like(SurfaceParameters, "moment_limit")
    fade_speed: float = like(SurfaceParameters, "fade_speed")


class SuperTwistingController(Component):
    """Super-twisting sliding-mode yaw-moment controller of second order."""

    Parameters = SuperTwistingParameters
    sampled = True
    inputs = (*ERRORS, "velocity_x")
    outputs = (
        output("yaw_moment", *ERRORS, "velocity_x"),
        output("sliding_surface", *SURFACE, unit="rad/s", text="Sliding surface s"),
    )

    def start(self, t: float, u: list[float]) -> None:
        p = self.p
        slope = p.disturbance_slope
        self.law = SuperTwisting(p.square_root_factor * sqrt(slope), p.integral_factor * slope)
        surface = SlidingSurface(u[:7], p)
        self.moment = p.yaw_inertia * (surface.equivalent + self.law.value(surface.s))

    def advance(self, t: float, h: float, u: list[float]) -> None:
        p = self.p
        surface = SlidingSurface(u[:7], p)
        most, known = p.moment_limit / p.yaw_inertia, surface.equivalent
        self.moment = p.yaw_inertia * (known + self.law.see(surface.s, h, -most - known, most - known))

    def output(self, t: float, u: list[float]) -> tuple[float, ...] | list[float]:
        return limit(self.moment, self.p, u[7]), SlidingSurface(u[:7], self.p).s
