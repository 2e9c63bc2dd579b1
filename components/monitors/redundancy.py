"""Fault monitor of gyro, accelerometer, hand wheel and wheel speeds by instantaneous redundancy.

The wheels give the speed, three signals the yaw rate:

    v   = R median(w_i)
    r_1 = r                                          gyro
    r_2 = a_y / v                                    apart from the rate of the sideslip angle
    r_3 = v delta / (l (1 + v^2 / v_ch^2))           of a car that follows its steering; at most mu g / v

The following signals are faulty:

    gyro or accelerometer, if it jumps, as a yaw rate, by `jump` between samples, more than a car can     (0)
    gyro or accelerometer, if it is constant to the last digit for `still_time` while both other
      signals change by `moved`                                                                           (1)
    gyro or accelerometer, whichever is further from r_3, if the sideslip angle implied by both, the
      integral of r_2 - r_1 with a washout of `washout`, exceeds `largest_sideslip`                       (2)
    hand wheel, if r_1 and r_2 agree to `agreeing` but differ from r_3 by `differing`                     (3)
    a wheel whose speed deviates from the median by the share `wheel_share`                               (4)

where (3) and (4) must last for `lasting`. (0) and (1) do not apply to the hand wheel, which a driver may jerk
or hold. The output `fault` is the last fault detected. If control needs the signal (`uses_*`), the yaw moment
fades to zero within `fade_time`, permanently, and monitoring ends, since zero moment needs no signal.
Otherwise the signal is excluded permanently and monitoring continues without it: (1) compares with the
remaining signals, (2) and (3) need both gyro and accelerometer, (2) blames the gyro if the hand wheel is
excluded, (4) needs three wheels. With fewer than two wheels monitoring ends.

Limits: delayed or slightly wrong signals are not detected, nor is any fault while no signal changes. A
slightly wrong gyro is not detected without the accelerometer. A slowly growing bias may be attributed to the
accelerometer. An uncontrolled car at large sideslip causes alarms, because (2) and (3) assume a car that
follows its steering. An understeering car with parameters of a neutral car causes a false alarm (3).

Source: relations between signals as in van Zanten, Bosch ESP Systems: 5 Years of Experience, SAE
2000-01-1633; the relations are kinematic, all thresholds are chosen.
"""

from dataclasses import dataclass
from math import inf

from yawbench.vocabulary.gravity import G
from yawbench.vocabulary.wheels import wheels

from ..cars.published_cars import PaperB
from ..fmi.component import Component
from ..fmi.variables import like, output, parameter, signal

GYRO, ACCELEROMETER, HAND_WHEEL, WHEEL = 1.0, 2.0, 3.0, 4.0
SIGNALS = (GYRO, ACCELEROMETER, HAND_WHEEL)
"""Signals of the three yaw rates, in their order."""
INPUTS = ("yaw_rate", "acceleration_y", "steer_angle", "wheel_speed_*", "friction")
SEEN = (*INPUTS[:3], *wheels("wheel_speed_*"), "friction")
"""Inputs on which the detection of faults depends directly."""
SLOWEST = 3.0
"""Speed below which the monitor is inactive [m/s]; chosen: a_y / v is noise there."""
SLOW = 10.0
"""Smallest speed for jumps of a_y / v [m/s]; chosen: five times the noise of a_y / v."""


def median_speed(wheels: list[float], rolling: list[bool], count: int) -> float:
    """Return the median speed [rad/s] of the trusted wheels; `count` is their number, at least two."""
    ordered = sorted([w if rolls else inf for rolls, w in zip(rolling, wheels, strict=True)])
    return 0.5 * (ordered[(count - 1) // 2] + ordered[count // 2])


@dataclass(frozen=True)
class RedundancyParameters:
    """Parameters of the car, and thresholds of the relations."""

    cg_to_front_axle: float = like(PaperB, "cg_to_front_axle")
    cg_to_rear_axle: float = like(PaperB, "cg_to_rear_axle")
    wheel_radius: float = like(PaperB, "wheel_radius")
    characteristic_speed: float = parameter(
        0.0, "m/s",
        "Characteristic speed v_ch, at which the yaw gain is half that of a neutral car; 0: neutral",
        "chosen: the car of paper B is nearly neutral",
        minimum=0.0,
    )  # fmt: skip
    jump: float = parameter(
        0.1, "rad/s", "Change of a yaw rate between samples beyond any car's", "chosen: 10 rad/s2 in 10 ms",
        minimum=0.001,
    )  # fmt: skip
    still_time: float = parameter(
        0.1, "s", "Time within which a working signal changes", "chosen: ten messages", minimum=0.0
    )
    moved: float = parameter(
        0.05, "rad/s", "Required change of the other signals, as yaw rates", "chosen: 3 deg/s", minimum=0.001
    )
    washout: float = parameter(
        1.0, "s", "Time constant of the implied sideslip angle", "chosen: bias of 1 deg/s passes", minimum=0.1
    )
    largest_sideslip: float = parameter(
        0.12, "rad", "Largest implied sideslip angle", "chosen: cars under control reach 0.09", minimum=0.01
    )
    agreeing: float = parameter(
        0.1, "rad/s", "Difference up to which gyro and accelerometer agree", "chosen: 6 deg/s", minimum=0.001
    )
    differing: float = parameter(
        0.1, "rad/s", "Difference above which the hand wheel is faulty", "chosen: 6 deg/s", minimum=0.001
    )
    wheel_share: float = parameter(
        0.3, "1", "Relative tolerance of a wheel's speed", "chosen: beyond what slip control allows",
        minimum=0.01,
    )  # fmt: skip
    lasting: float = parameter(
        0.3, "s", "Time for which (3) and (4) must last", "chosen: slower than tyres and brakes", minimum=0.0
    )
    uses_yaw_rate: bool = parameter(True, None, "Control needs the gyro", "chosen: all laws here do")
    uses_acceleration: bool = parameter(True, None, "Control needs a_y", "chosen: every fault counts")
    uses_steer_angle: bool = parameter(
        True, None, "Control needs the hand wheel", "chosen: the reference does"
    )
    uses_wheel_speeds: bool = parameter(True, None, "Control needs wheel speeds", "chosen: as of a_y")
    fade_time: float = parameter(
        0.1, "s", "Time in which the yaw moment fades", "chosen: fast, without a jolt", minimum=0.001
    )


class Redundancy(Component):
    """Fault monitor of gyro, a_y, hand wheel and wheel speeds by instantaneous redundancy."""

    Parameters = RedundancyParameters
    sampled = True
    inputs = (
        *INPUTS,
        signal("yaw_moment_wanted", "N.m", "Yaw moment requested by the controller"),
    )
    outputs = (
        output("yaw_moment", "yaw_moment_wanted"),
        output(
            "fault", *SEEN, unit="1", text="0: none; 1: gyro, 2: accelerometer, 3: hand wheel, 4: wheel speed"
        ),
        output(
            "implied_sideslip", *SEEN, unit="rad", text="Sideslip angle implied by gyro and accelerometer"
        ),
    )

    def configure(self) -> None:
        p = self.p
        self.uses = (
            (GYRO, p.uses_yaw_rate),
            (ACCELEROMETER, p.uses_acceleration),
            (HAND_WHEEL, p.uses_steer_angle),
            (WHEEL, p.uses_wheel_speeds),
        )
        self.understeer = 1.0 / p.characteristic_speed**2 if p.characteristic_speed else 0.0

    def start(self, t: float, u: list[float]) -> None:
        self.fault = 0.0
        self.lost = [False] * 3  # gyro, accelerometer, hand wheel
        self.share = 1.0
        self.implied = 0.0
        self.last = (u[0], u[1])
        self.since: list[tuple[float, tuple[float, float, float]] | None] = [None, None]
        self.contradicted = 0.0
        self.off = [0.0] * 4
        self.rolling = [True] * 4  # wheels that are trusted

    def advance(self, t: float, h: float, u: list[float]) -> None:
        p = self.p
        if any(used and self.fault == fault for fault, used in self.uses):
            self.share = max(0.0, self.share - h / p.fade_time)
            return
        rolling = sum(self.rolling)
        if rolling < 2:
            return
        r, a_y, delta, *wheels, mu, _ = u
        median = median_speed(wheels, self.rolling, rolling)
        v = p.wheel_radius * median
        if v < SLOWEST:
            self.since, self.implied, self.contradicted, self.off = [None, None], 0.0, 0.0, [0.0] * 4
            self.last = (r, a_y)
            return
        length = p.cg_to_front_axle + p.cg_to_rear_axle
        most = mu * G / v
        steered = min(max(v * delta / (length * (1.0 + self.understeer * v * v)), -most), most)
        rates = (r, a_y / v, steered)
        no_gyro, no_accelerometer, _ = self.lost
        if not (no_gyro or no_accelerometer):
            self.implied += h * (rates[1] - r - self.implied / p.washout)
            self.contradicted = self._lasting(self.contradicted, h, self._hand_wheel_contradicts(rates))
        if rolling > 2:
            self.off = [
                self._lasting(off, h, abs(w - median) > p.wheel_share * median) if rolls else off
                for rolls, off, w in zip(self.rolling, self.off, wheels, strict=True)
            ]
        jumps = abs(r - self.last[0]), abs(a_y - self.last[1]) / max(v, SLOW)
        fault = self._judged(t + h, (r, a_y), rates, jumps)
        if fault:
            self._lose(fault)
        self.last = (r, a_y)

    def output(self, t: float, u: list[float]) -> tuple[float, ...]:
        return self.share * u[-1], self.fault, self.implied

    def _lose(self, fault: float) -> None:
        """Exclude a signal."""
        self.fault = fault
        if fault == WHEEL:
            self.rolling = [
                rolls and off <= self.p.lasting for rolls, off in zip(self.rolling, self.off, strict=True)
            ]
            self.off = [0.0] * 4
            return
        self.lost = [lost or fault == name for lost, name in zip(self.lost, SIGNALS, strict=True)]
        self.implied = self.contradicted = 0.0

    @staticmethod
    def _lasting(so_far: float, h: float, still: bool) -> float:
        return so_far + h if still else 0.0

    def _hand_wheel_contradicts(self, rates: tuple[float, float, float]) -> bool:
        gyro, felt, steered = rates
        p = self.p
        if abs(gyro - felt) > p.agreeing:
            return False
        return abs(0.5 * (gyro + felt) - steered) > p.differing  # type: ignore[no-any-return]

    def _judged(
        self,
        t: float,
        seen: tuple[float, float],
        rates: tuple[float, float, float],
        jumps: tuple[float, float],
    ) -> float:
        """Return the number of the first fault detected, 0 if none."""
        p, lost = self.p, self.lost
        for k in (0, 1):
            if not lost[k] and jumps[k] > p.jump:
                return SIGNALS[k]
        for k in (0, 1):
            if lost[k]:
                continue
            if seen[k] != self.last[k]:
                self.since[k] = None
                continue
            since, then = self.since[k] or (t, rates)
            self.since[k] = since, then
            others = [j for j in range(3) if j != k]
            alone = all(lost[j] for j in others)
            moved = all(lost[j] or abs(rates[j] - then[j]) > p.moved for j in others)
            if moved and not alone and t - since >= p.still_time:
                return SIGNALS[k]
        if abs(self.implied) > p.largest_sideslip:
            gyro, felt, steered = rates
            at_gyro = lost[2] or abs(gyro - steered) > abs(felt - steered)
            return GYRO if at_gyro else ACCELEROMETER
        if self.contradicted > p.lasting and not lost[2]:
            return HAND_WHEEL
        return WHEEL if max(self.off) > p.lasting else 0.0
