"""Conventional fuzzy control of the sideslip angle, the baseline of paper A.

    e = beta_ref - beta
    M_z = -moment_range f(e / error_range, (de/dt) / error_rate_range)

f is a Mamdani system (min, max, centroid) of seven triangular sets per variable with the standard
rule table. A positive moment lowers beta, so the output is negated. f reaches +-8/9, the centroid of
the outermost set.

Source: paper A, section 3, which names neither table nor ranges.

Chosen ranges. The moment range is the moment limit of `fnn`, so that both may ask for the same. Over a
grid of 9 x 9 (0.0025 to 0.04 rad, 0.025 to 0.4 rad/s, factor sqrt 2) the error ranges are those with
the least mean of max|e| / max|beta_ref| over the three runs (15, 25, 40 m/s), at no more total variation
of the moment than `fnn` has in its worst run, sampled at 2 and at 5 ms. Left free to chatter,
narrower ranges (0.0025 rad, 0.05 rad/s) come close to `fnn`; wide ones (0.02 rad, 0.2 rad/s) triple
the error, which is nearer to the baseline that the paper shows.
"""

from dataclasses import dataclass

from ..fmi.component import Component
from ..fmi.variables import output, parameter
from ..mathematics.fuzzy import SEVEN, Mamdani, Partition

RULES = """
    NB NB NB NB NM NS ZO
    NB NB NB NM NS ZO PS
    NB NB NM NS ZO PS PM
    NB NM NS ZO PS PM PB
    NM NS ZO PS PM PB PB
    NS ZO PS PM PB PB PB
    ZO PS PM PB PB PB PB
"""
"""Rows e, columns de/dt, both from NB to PB; the standard table."""


@dataclass(frozen=True)
class FuzzySideslipParameters:
    """Ranges of the three variables; the paper names none."""

    error_range: float = parameter(
        0.005, "rad", "e beyond this saturates", "chosen: best of a grid, see the source", minimum=1e-6
    )
    error_rate_range: float = parameter(
        0.05, "rad/s", "de/dt beyond this saturates", "chosen: best of a grid, see the source", minimum=1e-6
    )
    moment_range: float = parameter(
        5000.0, "N.m", "Peak of the outermost sets of M_z", "chosen: as controller_fnn", minimum=0.0
    )


_SEEN = ("sideslip_ref", "sideslip", "sideslip_rate_ref", "sideslip_rate")


class FuzzySideslip(Component):
    """Conventional Mamdani fuzzy control of the sideslip angle."""

    Parameters = FuzzySideslipParameters
    inputs = _SEEN
    outputs = (output("yaw_moment", *_SEEN),)
    sampled = True

    def configure(self) -> None:
        p = self.p
        self.surface = Mamdani(
            Partition.even(SEVEN, -p.error_range, p.error_range),
            Partition.even(SEVEN, -p.error_rate_range, p.error_rate_range),
            [Partition.even(SEVEN)],
            RULES,
        )

    def output(self, t: float, u: list[float]) -> tuple[float, ...]:
        beta_ref, beta, beta_ref_rate, beta_rate = u
        (share,) = self.surface(beta_ref - beta, beta_ref_rate - beta_rate)
        return (-self.p.moment_range * share,)
