"""Monitor of gyro, accelerometer, hand wheel and wheel speeds by comparing what they imply about each other.

Wheels say how fast the car goes, three signals how fast it turns:

    v   = R median(w_i)
    r_1 = r                                          the gyro
    r_2 = a_y / v                                    short of it by the rate of the sideslip angle
    r_3 = v delta / (l (1 + v^2 / v_ch^2)), at most mu g / v       the car's, as far as the road bears it

A signal is taken for faulty

    that jumps, as a yaw rate, by `jump` from one sample to the next, more than a car can                 (0)
    that stands still to the last digit for `still_time` while both others move by `moved`                (1)
    that is the further one from r_3, of gyro and accelerometer, when the sideslip angle which the two
      imply, the integral of r_2 - r_1 with a washout of `washout`, passes `largest_sideslip`             (2)
    the hand wheel, if r_1 and r_2 agree to `agreeing` but differ from r_3 by `differing`                 (3)
    the wheel whose speed is off the median by the share `wheel_share`                                    (4)

where (3) and (4) must last for `lasting`. (0) and (1) are about gyro and accelerometer alone: a driver may
jerk or hold the wheel. The output `fault` is the last fault found. If control needs the signal
(`uses_*`), the yaw moment fades to zero within `fade_time`, for good, and nothing more is looked for: no
control is the law that needs no signal. If it does not, the signal bears no more witness, for good, and the
others are watched on without it: (1) asks those that are left, (2) and (3) need both gyro and accelerometer,
(2) lays it at the gyro's door if the hand wheel is lost, (4) needs three wheels. With fewer than two wheels
nothing is judged any more.

Limits: what is late or a little wrong passes, and so does a fault while nothing moves, until something does.
A gyro that is a little wrong passes where the accelerometer is lost. A bias that grows slowly may be laid at
the accelerometer's door. A car that slides far without control gives alarms too: (2) and (3) know cars that
follow their steering. One that understeers and is taken for neutral gives a false alarm (3).

Source: that signals are judged by such relations is the practice of van Zanten, Bosch ESP Systems: 5 Years of
Experience, SAE 2000-01-1633; the relations are kinematics, all thresholds are chosen.
"""

from dataclasses import dataclass
from math import inf

from vocabulary.gravity import G
from vocabulary.wheels import wheels

from ..cars.published_cars import PaperB
from ..fmi.component import Component
from ..fmi.variables import like, output, parameter, signal

GYRO, ACCELEROMETER, HAND_WHEEL, WHEEL = 1.0, 2.0, 3.0, 4.0
SIGNALS = (GYRO, ACCELEROMETER, HAND_WHEEL)
"""Signals from which the three yaw rates are made, in their order."""
INPUTS = ("yaw_rate", "acceleration_y", "steer_angle", "wheel_speed_*", "friction")
SEEN = (*INPUTS[:3], *wheels("wheel_speed_*"), "friction")
"""Inputs in which any step may show a fault."""
SLOWEST = 3.0
"""Speed below which nothing is judged [m/s]; chosen: a_y / v is noise there."""
SLOW = 10.0
"""Speed below which a jump of a_y counts as at this one [m/s]; chosen: five times the noise of a_y / v."""


def median_speed(wheels: list[float], rolling: list[bool], count: int) -> float:
    """Return the median speed [rad/s] of the wheels that are believed, `count` of them, two at least."""
    ordered = sorted([w if rolls else inf for rolls, w in zip(rolling, wheels, strict=True)])
    return 0.5 * (ordered[(count - 1) // 2] + ordered[count // 2])


@dataclass(frozen=True)
class RedundancyParameters:
    """Parameters of the car, and how far signals may be apart."""

    cg_to_front_axle: float = like(PaperB, "cg_to_front_axle")
    cg_to_rear_axle: float = like(PaperB, "cg_to_rear_axle")
    wheel_radius: float = like(PaperB, "wheel_radius")
    characteristic_speed: float = parameter(
        0.0, "m/s",
        "Speed v_ch at which an understeering car turns half as much as a neutral one; 0: neutral",
        "chosen: the car of paper B is nearly neutral",
        minimum=0.0,
    )  # fmt: skip
    jump: float = parameter(
        0.1, "rad/s", "What no car turns faster by from sample to sample", "chosen: 10 rad/s2 in 10 ms",
        minimum=0.001,
    )  # fmt: skip
    still_time: float = parameter(
        0.1, "s", "A signal that is alive changes within this", "chosen: ten messages", minimum=0.0
    )
    moved: float = parameter(
        0.05, "rad/s", "What others must have moved by, as yaw rates", "chosen: 3 deg/s", minimum=0.001
    )
    washout: float = parameter(
        1.0, "s", "Time constant of the implied sideslip angle", "chosen: bias of 1 deg/s passes", minimum=0.1
    )
    largest_sideslip: float = parameter(
        0.12, "rad", "Largest implied sideslip angle", "chosen: cars under control reach 0.09", minimum=0.01
    )
    agreeing: float = parameter(
        0.1, "rad/s", "Up to this gyro and accelerometer agree", "chosen: 6 deg/s", minimum=0.001
    )
    differing: float = parameter(
        0.1, "rad/s", "From this on the hand wheel is wrong", "chosen: 6 deg/s", minimum=0.001
    )
    wheel_share: float = parameter(
        0.3, "1", "Share of its speed that a wheel may be off", "chosen: beyond what slip control allows",
        minimum=0.01,
    )  # fmt: skip
    lasting: float = parameter(
        0.3, "s", "How long (3) and (4) must last", "chosen: longer than a tyre or a brake takes", minimum=0.0
    )
    uses_yaw_rate: bool = parameter(True, None, "Control needs the gyro", "chosen: so does every law here")
    uses_acceleration: bool = parameter(True, None, "Control needs a_y", "chosen: no fault is taken lightly")
    uses_steer_angle: bool = parameter(
        True, None, "Control needs the hand wheel", "chosen: the reference does"
    )
    uses_wheel_speeds: bool = parameter(True, None, "Control needs wheel speeds", "chosen: as of a_y")
    fade_time: float = parameter(
        0.1, "s", "Time in which the yaw moment fades", "chosen: no jolt, and soon", minimum=0.001
    )


class Redundancy(Component):
    """Monitor that fades the yaw moment out when gyro, a_y, hand wheel or a wheel contradict the others."""

    Parameters = RedundancyParameters
    sampled = True
    inputs = (
        *INPUTS,
        signal("yaw_moment_wanted", "N.m", "Yaw moment that the controller asks for"),
    )
    outputs = (
        output("yaw_moment", "yaw_moment_wanted"),
        output(
            "fault", *SEEN, unit="1", text="0: none; 1: gyro, 2: accelerometer, 3: hand wheel, 4: wheel speed"
        ),
        output(
            "implied_sideslip", *SEEN, unit="rad", text="Sideslip angle that gyro and accelerometer imply"
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
        self.rolling = [True] * 4  # wheels that are believed

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
        """Believe a signal no more."""
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
        """Return the number of the first fault that is found, 0 if there is none."""
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
