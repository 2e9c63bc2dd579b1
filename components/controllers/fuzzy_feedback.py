"""Fuzzy feedback of yaw rate and sideslip: weighted sum of two Mamdani systems.

    M_1 =  k_u1 f(k_e1 e_r, k_c1 de_r/dt)             e_r = r_ref - r
    M_2 = -k_u2 f(k_e2 e_beta, k_c2 de_beta/dt)       e_beta = beta_ref - beta
    M = W_1 M_1 + W_2 M_2                             limited to +-moment_limit                       (1)

f has five triangular sets {NB, NS, Z, PS, PB} on [-1, 1] for every variable and centroid defuzzification; its
range is +-5/6. The quantisation factors k_e, k_c scale the inputs, k_u the output. A positive moment lowers
the sideslip, so the second system enters negated; the paper's errors are actual minus reference.

de_r/dt is the difference of two samples of e_r (smoothed by `rate_filter`), so it contains the moment of the
previous sample divided by I_z. k_c1 k_u1 / I_z times the slope of f along its second input must therefore
stay well below 1, or the moment chatters from sample to sample; with the defaults it is about 0.1.

Source: paper D, section 3. Its tables 1, 2 and all factors were lost or not given: see
`control_laws.rule_tables` and the chosen values below.
"""

from dataclasses import dataclass

from ..control_laws.moment_limit import LimitParameters, limit
from ..control_laws.rule_tables import FIVE_BY_FIVE
from ..fmi.component import Component
from ..fmi.variables import like, output, parameter
from ..mathematics.fuzzy import FIVE, Mamdani, Partition
from ..mathematics.pid_loop import Pid


@dataclass(frozen=True)
class FuzzyFeedbackParameters:
    """Scales, weights and choice of the rule table; the paper gives none."""

    rule_table: str = parameter(
        "standard",
        None,
        "Rule table of both systems",
        "chosen: the standard one; those of paper D are missing from the text at hand",
        choices=tuple(FIVE_BY_FIVE),
    )
    yaw_rate_error_factor: float = parameter(
        40.0, "s/rad", "k_e of the yaw-rate system", "chosen: saturates at 0.025 rad/s", minimum=0.0
    )
    yaw_rate_error_rate_factor: float = parameter(
        0.02, "s2/rad", "k_c of the yaw-rate system", "chosen: saturates at 50 rad/s2", minimum=0.0
    )
    yaw_rate_moment: float = parameter(
        8000.0, "N.m", "k_u of the yaw-rate system", "chosen", minimum=0.0, tunable=True
    )
    yaw_rate_weight: float = parameter(
        1.0, "1", "Weight W_1 of the yaw-rate system", "chosen", minimum=0.0, tunable=True
    )
    sideslip_error_factor: float = parameter(
        10.0, "1/rad", "k_e of the sideslip system", "chosen: saturates at 0.1 rad", minimum=0.0
    )
    sideslip_error_rate_factor: float = parameter(
        0.5, "s/rad", "k_c of the sideslip system", "chosen: saturates at 2 rad/s", minimum=0.0
    )
    sideslip_moment: float = parameter(
        4000.0, "N.m", "k_u of the sideslip system", "chosen", minimum=0.0, tunable=True
    )
    sideslip_weight: float = parameter(
        1.0, "1", "Weight W_2 of the sideslip system", "chosen", minimum=0.0, tunable=True
    )
    rate_filter: float = parameter(
        0.0, "s", "Time constant smoothing the rate of the yaw-rate error", "chosen: none", minimum=0.0
    )
    moment_limit: float = like(
        LimitParameters,
        "moment_limit",
        6700.0,
        "chosen: mu m g d / 2 at mu 0.5, the most that longitudinal forces could give",
    )
    fade_speed: float = like(LimitParameters, "fade_speed")


YAW_RATE = ("yaw_rate_ref", "yaw_rate")
SIDESLIP = ("sideslip_ref", "sideslip", "sideslip_rate_ref", "sideslip_rate")


class FuzzyFeedback(Component):
    """Fuzzy yaw-moment controller: weighted sum of a yaw-rate and a sideslip system."""

    Parameters = FuzzyFeedbackParameters
    sampled = True
    inputs = (*YAW_RATE, *SIDESLIP, "velocity_x")
    outputs = (
        output("yaw_moment", *YAW_RATE, *SIDESLIP, "velocity_x"),
        output("yaw_rate_part", *YAW_RATE, unit="N.m", text="Moment W_1 M_1 of the yaw-rate system"),
        output("sideslip_part", *SIDESLIP, unit="N.m", text="Moment W_2 M_2 of the sideslip system"),
    )

    def configure(self) -> None:
        p = self.p
        sets = Partition.even(FIVE)
        self.surface = Mamdani(sets, sets, [sets], FIVE_BY_FIVE[p.rule_table])
        self.moments = (p.yaw_rate_weight * p.yaw_rate_moment, -p.sideslip_weight * p.sideslip_moment)

    def start(self, t: float, u: list[float]) -> None:
        self.yaw_rate = Pid(self.p.rate_filter, u[0] - u[1])

    def advance(self, t: float, h: float, u: list[float]) -> None:
        self.yaw_rate.see(u[0] - u[1], h)

    def output(self, t: float, u: list[float]) -> tuple[float, ...] | list[float]:
        p = self.p
        e_r = self.yaw_rate
        (share_r,) = self.surface(
            p.yaw_rate_error_factor * e_r.error, p.yaw_rate_error_rate_factor * e_r.slope
        )
        (share_beta,) = self.surface(
            p.sideslip_error_factor * (u[2] - u[3]), p.sideslip_error_rate_factor * (u[4] - u[5])
        )
        m_1 = self.moments[0] * share_r
        m_2 = self.moments[1] * share_beta
        return limit(m_1 + m_2, p, u[6]), m_1, m_2
