"""Conventional fuzzy control of the sideslip angle, the baseline of paper A.

    e = beta_ref - beta
    M_z = -moment_range f(e / error_range, (de/dt) / error_rate_range)

f is a Mamdani system (min, max, centroid) of seven triangular sets per variable with the standard
rule table. A positive moment lowers beta, so the output is negated. The range of f is +-8/9, the centroid
of the outermost set.

Source: paper A, section 3, which gives neither table nor ranges.

Chosen ranges: the moment range is the moment limit of `fnn`, so that both can request the same moment. The
error ranges were selected on a grid of 9 x 9 (0.0025 to 0.04 rad, 0.025 to 0.4 rad/s, factor sqrt 2): least
mean of max|e| / max|beta_ref| over the three runs (15, 25, 40 m/s), with at most the total variation of the
moment that `fnn` has in its worst run, sampled at 2 and at 5 ms. If chatter is allowed, narrower ranges
(0.0025 rad, 0.05 rad/s) come close to `fnn`; wide ranges (0.02 rad, 0.2 rad/s) triple the error, which is
nearer to the paper's baseline.
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
    """Ranges of the three variables; the paper gives none."""

    error_range: float = parameter(
        0.005,
        "rad",
        "Error e at which the outer sets saturate",
        "chosen: best of a grid, see the source",
        minimum=1e-6,
    )
    error_rate_range: float = parameter(
        0.05,
        "rad/s",
        "Rate de/dt at which the outer sets saturate",
        "chosen: best of a grid, see the source",
        minimum=1e-6,
    )
    moment_range: float = parameter(
        5000.0,
        "N.m",
        "Peak of the outermost sets of M_z",
        "chosen: as controller_fnn",
        minimum=0.0,
        tunable=True,
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
