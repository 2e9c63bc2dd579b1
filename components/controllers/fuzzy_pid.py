"""Fuzzy PID yaw-moment control: PID loops whose gains follow the error and its rate.

    M = PID(r_ref - r) + PID(beta - beta_ref)         K_x = max(K_x0 + range_x f_x(e, de/dt), 0)

for x = p, i, d of each loop, e = r_ref - r and beta_ref - beta with their filtered rates. f is a Mamdani
system of seven triangular sets per variable (`control_laws.rule_tables.PID_GAINS`), the same for both loops;
the centroid reaches +-8/9 of a range.

Reading of the table: its dK_p is antisymmetric, so that as printed gains rise for e < 0 and fall for e > 0,
and left and right turns differ. By default it is therefore read at (-|e|, -sign(e) de/dt), the half in which
gains rise with the error and with its growth; `printed` reads it at (e, de/dt).

Source: paper C, section 2.2, table 2; ranges are not given.
"""

from dataclasses import dataclass

from ..control_laws.rule_tables import PID_GAINS
from ..fmi.variables import output, parameter
from ..mathematics.fuzzy import SEVEN, Mamdani, Partition
from ..mathematics.pid_loop import Gains
from .pid import PidController, PidParameters, gains_of


@dataclass(frozen=True)
class FuzzyPidParameters(PidParameters):
    """Base gains as in `pid`, and the ranges of the gain corrections."""

    table_reading: str = parameter(
        "mirrored",
        None,
        "Reading of the rule table: mirrored at (-|e|, -sign(e) de/dt), printed at (e, de/dt)",
        "chosen: left and right turns alike",
        choices=("mirrored", "printed"),
    )
    yaw_rate_error_range: float = parameter(
        0.05,
        "rad/s",
        "Yaw-rate error beyond which the outer sets saturate",
        "chosen: twice that of paper C's runs",
        minimum=1e-6,
    )
    yaw_rate_error_rate_range: float = parameter(
        1.0,
        "rad/s2",
        "Rate of the yaw-rate error beyond which the outer sets saturate",
        "chosen: twice the runs'",
        minimum=1e-6,
    )
    sideslip_error_range: float = parameter(
        0.02,
        "rad",
        "Sideslip error beyond which the outer sets saturate",
        "chosen: that of paper C's runs",
        minimum=1e-6,
    )
    sideslip_error_rate_range: float = parameter(
        1.0,
        "rad/s",
        "Rate of the sideslip error beyond which the outer sets saturate",
        "chosen: far beyond the runs'",
        minimum=1e-6,
    )
    yaw_rate_proportional_range: float = parameter(
        40000.0,
        "N.m.s/rad",
        "Range of dK_p of the yaw rate",
        "chosen: with the sideslip's, a quarter off paper C's peaks",
        minimum=0.0,
        tunable=True,
    )
    yaw_rate_integral_range: float = parameter(
        0.0, "N.m/rad", "Range of dK_i of the yaw rate", "chosen: none", minimum=0.0, tunable=True
    )
    yaw_rate_derivative_range: float = parameter(
        100.0, "N.m.s2/rad", "Range of dK_d of the yaw rate", "chosen: as K_d", minimum=0.0, tunable=True
    )
    sideslip_proportional_range: float = parameter(
        30000.0,
        "N.m/rad",
        "Range of dK_p of the sideslip",
        "chosen: see the yaw rate's",
        minimum=0.0,
        tunable=True,
    )
    sideslip_integral_range: float = parameter(
        0.0, "N.m/(rad.s)", "Range of dK_i of the sideslip", "chosen: none", minimum=0.0, tunable=True
    )
    sideslip_derivative_range: float = parameter(
        100.0, "N.m.s/rad", "Range of dK_d of the sideslip", "chosen: as K_d", minimum=0.0, tunable=True
    )


class GainSchedule:
    """Fuzzy gain scheduling of the loop "yaw_rate" or "sideslip"."""

    def __init__(self, p: FuzzyPidParameters, loop: str) -> None:
        self.base, self.ranges = gains_of(p, loop), gains_of(p, loop, "range")
        self.mirrored = p.table_reading == "mirrored"
        error, rate = getattr(p, f"{loop}_error_range"), getattr(p, f"{loop}_error_rate_range")
        self.system = Mamdani(
            Partition.even(SEVEN, -error, error),
            Partition.even(SEVEN, -rate, rate),
            [Partition.even(SEVEN)] * 3,
            PID_GAINS,
        )

    def gains(self, e: float, rate: float) -> Gains:
        """Return the gains at the error `e`, reference minus actual, and its rate."""
        if self.mirrored and e > 0.0:
            e, rate = -e, -rate
        return Gains(
            *[
                max(base + width * share, 0.0)
                for base, width, share in zip(self.base, self.ranges, self.system(e, rate), strict=True)
            ]
        )


class FuzzyPid(PidController):
    """Fuzzy PID yaw-moment controller for yaw rate and sideslip."""

    Parameters = FuzzyPidParameters
    outputs = (
        *PidController.outputs,
        output(
            "yaw_rate_proportional_gain_now",
            *("yaw_rate_ref", "yaw_rate"),
            unit="N.m.s/rad",
            text="Scheduled gain K_p of the yaw rate",
        ),
        output(
            "sideslip_proportional_gain_now",
            *("sideslip_ref", "sideslip"),
            unit="N.m/rad",
            text="Scheduled gain K_p of the sideslip",
        ),
    )

    def configure(self) -> None:
        self.yaw_rate, self.sideslip = GainSchedule(self.p, "yaw_rate"), GainSchedule(self.p, "sideslip")

    def decide(self) -> None:
        yaw_rate, sideslip = self.loops.yaw_rate, self.loops.sideslip  # its error is actual minus reference
        self.gains = (
            self.yaw_rate.gains(yaw_rate.error, yaw_rate.slope),
            self.sideslip.gains(-sideslip.error, -sideslip.slope),
        )
        super().decide()

    def output(self, t: float, u: list[float]) -> tuple[float, ...]:
        yaw_rate, sideslip = self.gains
        return *super().output(t, u), yaw_rate.p, sideslip.p
