"""Fault monitor of gyro, accelerometer, hand wheel and wheel speeds by parity relations with memory.

Four signals give the yaw rate:

    gyro            r
    accelerometer   a_y / v, apart from the rate of the sideslip angle
    hand wheel      r_s of a single-track model with steer angle and moment (`estimation.steered_track`)
    wheel speeds    r_w = mean over axles of R (w_right - w_left) / track, minus v M / (track^2 C_x)

Each pair of them is a relation, whose residual e is zero while both are correct. The residual of gyro and
accelerometer is integrated, so that a small bias accumulates:

    z' = a_y / v - r - z / washout - beta',     beta = b r / v - m a a_y / (l C_r)                  (1)

and likewise that of accelerometer and wheel speeds, with r_w for r. Tolerances grow with the effects that the
models neglect: with the use of the tyres within the last `forget` (2), with the moment, which causes wheel
slip (3), and with the difference of r_w between the axles:

    tol_s = base + share |r_s| + (0.8 used_s + used_y) mu g / v + 0.6 M dr/dM                        (2)
    tol_w = base + 0.1 |r_w| + v M / (track^2 C_x) (1 + 9 (M / M_mu)^2) + |r_wf - r_wr|              (3)

Residuals pass a lag of `smoothing`; the mean of (e / tol)^2 with the time constant `memory` is the statistic
of a relation, and a value above 1 is a fault. The faulty signal is isolated by longer means, with
`evidence_time`: without a faulty signal the remaining relations have little evidence. The fault is located at
the signal whose exclusion leaves the least evidence, if that is below `ratio` times that of the next
candidate. A fault not located within `patience` is output as such (`UNLOCATED`) and may be located later.
Further faults:

    a gyro or accelerometer that jumps, as a yaw rate, by `jump`, more than a car can, and stays away, or that
    is constant to the last digit for `still_time` while the others change
    a wheel whose speed deviates from that of its position by more than a tolerance like (3), by the same
    statistic

If control needs the faulty signal (`uses_*`), the moment fades to zero within `fade_time`, permanently.
Otherwise the signal is excluded from the relations. An unlocated fault has no consequence.

Limits: a small gain error of the gyro is not detected while the car drives nearly straight ahead, and not
located while tyres slide. A wrong hand wheel cannot be distinguished from the driver's intention if the
controller follows it, because M then explains the car's yaw rate. Noise is averaged out.

Source: parity relations, and isolation of a fault by the relations that it does not affect: E. Y. Chow, A. S.
Willsky, Analytical redundancy and the design of robust failure detection systems, IEEE Trans. Automatic
Control 29 (1984) 603-614. Exponentially weighted means as a statistic: S. W. Roberts, Control chart tests
based on geometric moving averages, Technometrics 1 (1959) 239-250. Four sources of a yaw rate: A. T. van
Zanten, SAE 2000-01-1633. Tolerances are chosen on the runs described in docs/faults.md.
"""

from dataclasses import dataclass
from math import inf

from yawbench.vocabulary.gravity import G
from yawbench.vocabulary.wheels import wheels

from ..cars.published_cars import PaperB
from ..estimation.estimator_parameters import EstimatorParameters
from ..estimation.single_track_filter import FilterParameters
from ..estimation.steered_track import SteeredTrack, limited
from ..fmi.component import Component
from ..fmi.variables import like, output, parameter, signal
from ..mathematics.sums import added
from .redundancy import INPUTS, SLOW, RedundancyParameters, median_speed

GYRO, ACCELEROMETER, HAND_WHEEL, WHEEL, UNLOCATED = 1.0, 2.0, 3.0, 4.0, 5.0
SIGNALS = (GYRO, ACCELEROMETER, HAND_WHEEL, WHEEL)
PAIRS = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))
"""Relations, as indices of `SIGNALS`."""
SEEN = (
    "yaw_rate",
    "acceleration_y",
    "steer_angle",
    *wheels("wheel_speed_*"),
    "friction",
    "yaw_moment_wanted",
)
"""Inputs on which the detection of faults depends directly."""
SLOWEST = 5.0
"""Speed below which the monitor is inactive [m/s]; chosen: a_y / v is noise there."""
SMALLEST = 0.1
"""Smallest friction [1]; chosen: ice."""
LARGEST = 25.0
"""Largest (e / tol)^2 in a mean; chosen: bounds the weight of a single message."""
SATURATED, USED = 0.5, 0.4
"""Share of the grip above which axles, and a_y, widen tolerances; chosen: tyres are linear below."""
LEAN_SHARE = 0.04
"""Tolerated relative error of a_y; chosen: error of the roll angle of 2 degrees at 1 g."""
LEVEL_LAG = 0.03
"""Lag of the level before a jump [s]; chosen: three messages, so that noise is not taken for a jump."""
SLIP_LIMIT = 0.1
"""Largest slip due to the moment; chosen: limit of slip control."""
WHEEL_HARD = 0.17
"""Additional wheel slip when the moment uses all grip; chosen: on runs of paper B's car at mu 0.3."""
LARGEST_OF_WHEELS = 4.0
"""Largest (e / tol)^2 of wheels; chosen: slip control may release a wheel for a moment."""
SMALL = 0.1
"""Evidence below which no signal is suspected; chosen: a third of a tolerance, squared."""


@dataclass(frozen=True)
class ParityParameters:
    """Parameters of the car, and tolerances of the relations."""

    mass: float = like(PaperB, "mass")
    yaw_inertia: float = like(PaperB, "yaw_inertia")
    cg_to_front_axle: float = like(PaperB, "cg_to_front_axle")
    cg_to_rear_axle: float = like(PaperB, "cg_to_rear_axle")
    track_width: float = like(PaperB, "track_width")
    wheel_radius: float = like(PaperB, "wheel_radius")
    cornering_stiffness_front: float = like(FilterParameters, "cornering_stiffness_front")
    cornering_stiffness_rear: float = like(FilterParameters, "cornering_stiffness_rear")
    roll_at_1_g: float = like(EstimatorParameters, "roll_at_1_g")
    wheel_slip_stiffness: float = parameter(
        60000.0, "N", "Slip stiffness C_x of a wheel", "chosen: tyres of set 1 at 3.3 kN", minimum=1.0
    )
    rate_tolerance: float = parameter(
        0.026, "rad/s", "Tolerance base_s, base_w of yaw rates", "chosen: 1.5 deg/s, below a manoeuvre",
        minimum=0.001,
    )  # fmt: skip
    rate_share: float = parameter(
        0.15,
        "1",
        "Relative tolerance share_s of yaw rates",
        "chosen: stiffness known to 15 %",
        minimum=0.0,
    )
    sideslip_tolerance: float = parameter(
        0.02, "rad", "Tolerance of z, larger when tyres are used", "chosen: a bias of 0.6 deg/s passes",
        minimum=0.001,
    )  # fmt: skip
    wheel_tolerance: float = parameter(
        0.02, "1", "Relative tolerance of a wheel's speed", "chosen: drive and tyre wear", minimum=0.001
    )
    washout: float = parameter(
        2.0, "s", "Time constant of the implied sideslip angle", "chosen: longer than a lane change",
        minimum=0.1,
    )  # fmt: skip
    smoothing: float = parameter(0.1, "s", "Lag of the residuals", "chosen: ten messages", minimum=0.001)
    memory: float = parameter(
        0.3, "s", "Time constant of the statistic", "chosen: a large fault is found in 0.1 s", minimum=0.01
    )
    evidence_time: float = parameter(
        1.0,
        "s",
        "Time constant of the evidence that locates a fault",
        "chosen: half a lane change",
        minimum=0.01,
    )
    forget: float = parameter(
        0.5, "s", "Time in which use of tyres and moment is forgotten", "chosen: a car settles within it",
        minimum=0.01,
    )  # fmt: skip
    patience: float = parameter(
        0.5, "s", "Time after which an unlocated fault is output", "chosen: as `memory`", minimum=0.0
    )
    ratio: float = parameter(
        0.5, "1", "Largest ratio of remaining evidence to the next candidate's", "chosen: twice as likely",
        minimum=0.0, maximum=1.0,
    )  # fmt: skip
    jump: float = like(RedundancyParameters, "jump")
    still_time: float = like(RedundancyParameters, "still_time")
    moved: float = like(RedundancyParameters, "moved")
    uses_yaw_rate: bool = like(RedundancyParameters, "uses_yaw_rate")
    uses_acceleration: bool = like(RedundancyParameters, "uses_acceleration")
    uses_steer_angle: bool = like(RedundancyParameters, "uses_steer_angle")
    uses_wheel_speeds: bool = like(RedundancyParameters, "uses_wheel_speeds")
    fade_time: float = like(RedundancyParameters, "fade_time")


class Parity(Component):
    """Fault monitor of gyro, a_y, hand wheel and wheel speeds by parity relations with memory."""

    Parameters = ParityParameters
    sampled = True
    inputs = (
        *INPUTS,
        signal("yaw_moment_wanted", "N.m", "Yaw moment requested by the controller"),
    )
    outputs = (
        output("yaw_moment", "yaw_moment_wanted"),
        output(
            "fault", *SEEN, unit="1",
            text="0: none; 1: gyro, 2: accelerometer, 3: hand wheel, 4: wheel speed, 5: not located",
        ),
        output(
            "implied_sideslip", *SEEN, unit="rad",
            text="Sideslip angle z implied by gyro and accelerometer, minus that of the rear axle",
        ),
        output("contradiction", *SEEN, unit="1", text="Largest statistic of a relation; 1 is a fault"),
    )  # fmt: skip

    def configure(self) -> None:
        p = self.p
        self.length = p.cg_to_front_axle + p.cg_to_rear_axle
        self.uses = (p.uses_yaw_rate, p.uses_acceleration, p.uses_steer_angle, p.uses_wheel_speeds)
        stiff = p.cornering_stiffness_front * p.cornering_stiffness_rear * self.length**2
        self.gain = (p.cornering_stiffness_front + p.cornering_stiffness_rear) / stiff  # of r by M, over v
        self.softness = p.cg_to_front_axle * p.mass / (self.length * p.cornering_stiffness_rear)

    def start(self, t: float, u: list[float]) -> None:
        self.fault, self.share = 0.0, 1.0
        self.lost = [False] * 4  # as `SIGNALS`
        self.rolling = [True] * 4  # wheels that are trusted
        self.last = (u[0], u[1])
        self.track = SteeredTrack(self.p)
        self._forget()

    def _forget(self) -> None:
        """Restart all means."""
        self.z = self.z_wheels = self.z_tolerance = self.z_allowed = 0.0
        self.sideslip: tuple[float, float] | None = None  # of the rear axle, from gyro and from wheels
        self.used = self.used_y = self.moment = self.apart = 0.0
        self.lagged, self.statistic = [0.0] * 6, [0.0] * 6
        self.long_lagged, self.evidence = [0.0] * 6, [0.0] * 6
        self.off, self.wheel_statistic = [0.0] * 4, [0.0] * 4
        self.pending = 0.0
        self.levels, self.away = [0.0, 0.0], [0.0, 0.0]  # level before the jump, time since the jump
        self.still = [0.0, 0.0]  # time for which gyro and accelerometer have been constant
        self.then = [(0.0, 0.0, 0.0), (0.0, 0.0, 0.0)]  # rates at their last change

    def advance(self, t: float, h: float, u: list[float]) -> None:
        if any(uses and self.fault == fault for uses, fault in zip(self.uses, SIGNALS, strict=True)):
            self.share = max(0.0, self.share - h / self.p.fade_time)
            return
        rolling = sum(self.rolling)
        if rolling < 2:
            return
        r, felt, delta, *wheels, mu, moment = u
        a_y = felt / (1.0 + self.p.roll_at_1_g)
        median = median_speed(wheels, self.rolling, rolling)
        v = self.p.wheel_radius * median
        if v < SLOWEST:
            self._forget()
            self.last = (r, a_y)
            return
        mu = max(mu, SMALLEST)
        self.track.advance(h, v, delta, mu, limited(moment, self._grip_moment(mu)))
        self._remember(h, a_y, mu, moment)
        turned = self._relate(h, v, (r, a_y), wheels, mu, moment)
        self._compare_wheels(h, r, v, wheels, mu)
        jumped = self._jumped(h, (r, a_y / max(v, SLOW)), (self.last[0], self.last[1] / max(v, SLOW)))
        located = jumped or self._still(h, (r, a_y), (r, a_y / v, turned)) or self._located(h)
        if located:
            self._lose(located)
        self.last = (r, a_y)

    def output(self, t: float, u: list[float]) -> tuple[float, ...]:
        return self.share * u[-1], self.fault, self.z, max(*self.statistic, *self.wheel_statistic)

    def _grip_moment(self, mu: float) -> float:
        """Return the moment [N.m] of the wheels of a side at their grip limit."""
        return float(mu * self.p.mass * G * 0.5 * self.p.track_width)

    def _remember(self, h: float, a_y: float, mu: float, moment: float) -> None:
        """Update the peaks of tyre use and moment, which decay with `forget`."""
        kept = 1.0 - min(h / self.p.forget, 1.0)
        self.used = max(kept * self.used, min(self.track.used, 3.0))
        self.used_y = max(kept * self.used_y, min(abs(a_y) / (mu * G), 1.2))
        self.moment = max(kept * self.moment, abs(moment))

    def _by_wheels(self, v: float, wheels: list[float], moment: float) -> tuple[float, float]:
        """Return r_w [rad/s] and the difference of its axles; only one axle if the other has a lost wheel."""
        p = self.p
        front = p.wheel_radius * (wheels[1] - wheels[0]) / p.track_width
        rear = p.wheel_radius * (wheels[3] - wheels[2]) / p.track_width
        slipped = self._slipped(v) * moment
        if not (self.rolling[0] and self.rolling[1]):
            return rear - slipped, 0.0
        if not (self.rolling[2] and self.rolling[3]):
            return front - slipped, 0.0
        return 0.5 * (front + rear) - slipped, abs(front - rear)

    def _slipped(self, v: float) -> float:
        """Return the increase of r_w by the slip due to a moment, v / (track^2 C_x) [rad/s per N.m]."""
        p = self.p
        return float(v / (p.track_width * p.track_width * p.wheel_slip_stiffness))

    def _relate(
        self, h: float, v: float, seen: tuple[float, float], wheels: list[float], mu: float, moment: float
    ) -> float:
        """Advance all relations by a step; return r_s [rad/s]."""
        p, (r, a_y) = self.p, seen
        steered = self.track.yaw_rate
        rolled, apart = self._by_wheels(v, wheels, moment)
        self.apart += min(h / p.smoothing, 1.0) * (apart - self.apart)
        self._integrate(h, v, r, a_y, rolled)
        of_road, slips = mu * G / v, self._slipped(v) * self.moment
        tol_s = p.rate_tolerance + p.rate_share * abs(steered) + 0.6 * self.gain * v * self.moment
        tol_s += of_road * (
            0.8 * max(0.0, min(self.used, 2.0) - SATURATED) + max(0.0, self.used_y - SATURATED)
        )
        hard = 1.0 + 9.0 * min(1.0, (self.moment / self._grip_moment(mu)) ** 2)
        tol_w = p.rate_tolerance + 0.1 * abs(rolled) + slips * hard + self.apart
        self.z_allowed += h * (LEAN_SHARE * abs(a_y) / v - self.z_allowed / p.washout)
        self.z_tolerance += h * (tol_w - self.z_tolerance / p.washout)
        sliding = max(0.0, self.used_y - USED)
        tol_z = p.sideslip_tolerance + self.softness * mu * G * sliding + self.z_allowed
        felt = (a_y - self.track.acceleration) / v
        tol_a = tol_s + 0.3 * p.rate_tolerance
        self._accumulate(
            h,
            (self.z, r - steered, r - rolled, felt, self.z_wheels, rolled - steered),
            (tol_z, tol_s, tol_w, tol_a, tol_z + self.z_tolerance, tol_w + tol_s),
            a_y / v - rolled,
            tol_w + 0.3 * (p.rate_tolerance + of_road * sliding),
        )
        return steered

    def _integrate(self, h: float, v: float, r: float, a_y: float, rolled: float) -> None:
        """Advance the implied sideslip angles by a step; equation (1)."""
        p = self.p
        rear = self.softness * a_y
        now = p.cg_to_rear_axle * r / v - rear, p.cg_to_rear_axle * rolled / v - rear
        before = self.sideslip or now
        self.z += h * (a_y / v - r - self.z / p.washout) - (now[0] - before[0])
        self.z_wheels += h * (a_y / v - rolled - self.z_wheels / p.washout) - (now[1] - before[1])
        self.sideslip = now

    def _accumulate(
        self,
        h: float,
        contradictions: tuple[float, ...],
        tolerances: tuple[float, ...],
        rolling: float,
        rolling_tolerance: float,
    ) -> None:
        """Advance statistics and evidence by a step; evidence compares a_y and wheels as yaw rates."""
        p = self.p
        lag, short = min(h / p.smoothing, 1.0), min(h / p.memory, 1.0)
        long = min(h / p.evidence_time, 1.0)
        self.lagged = [x + lag * (e - x) for x, e in zip(self.lagged, contradictions, strict=True)]
        self.statistic = [
            s + short * (min((x / tol) ** 2, LARGEST) - s)
            for s, x, tol in zip(self.statistic, self.lagged, tolerances, strict=True)
        ]
        now, tol_now = (*contradictions[:4], rolling, contradictions[5]), (
            *tolerances[:4], rolling_tolerance, tolerances[5],
        )  # fmt: skip
        self.long_lagged = [x + lag * (e - x) for x, e in zip(self.long_lagged, now, strict=True)]
        self.evidence = [
            s + long * (min((x / tol) ** 2, LARGEST) - s)
            for s, x, tol in zip(self.evidence, self.long_lagged, tol_now, strict=True)
        ]

    def _compare_wheels(self, h: float, r: float, v: float, wheels: list[float], mu: float) -> None:
        """Advance the statistics of the wheels' deviations from the speeds of their positions by a step."""
        p = self.p
        hard = min(1.0, (2.0 * self.moment / self._grip_moment(mu)) ** 2)
        slip = 2.0 * self.moment / (p.track_width * p.wheel_slip_stiffness)
        tolerance = p.wheel_tolerance + min(slip, SLIP_LIMIT) + WHEEL_HARD * hard
        turning = 0.5 * p.track_width * r
        places = (v - turning, v + turning, v - turning, v + turning)
        lag, short = min(h / p.smoothing, 1.0), min(h / p.memory, 1.0)
        self.off = [
            x + lag * ((p.wheel_radius * w - place) / v - x) if rolls else 0.0
            for x, w, place, rolls in zip(self.off, wheels, places, self.rolling, strict=True)
        ]
        self.wheel_statistic = [
            s + short * (min((x / tolerance) ** 2, LARGEST_OF_WHEELS) - s)
            for s, x in zip(self.wheel_statistic, self.off, strict=True)
        ]

    def _pairs(self) -> list[bool]:
        """Return the relations with two valid signals."""
        return [not (self.lost[i] or self.lost[k]) for i, k in PAIRS]

    def _located(self, h: float) -> float:
        """Return the number of the fault located in this step, 0 if none."""
        known = self._pairs()
        if max(self.wheel_statistic) > 1.0 and not (known[0] and self.statistic[0] > 1.0):
            return WHEEL
        if not any(both and s > 1.0 for both, s in zip(known, self.statistic, strict=True)):
            self.pending = max(0.0, self.pending - h)
            return 0.0
        self.pending += h
        left = [
            added(
                [
                    s if both and i not in pair else 0.0
                    for both, s, pair in zip(known, self.evidence, PAIRS, strict=True)
                ]
            )
            for i in range(4)
        ]
        believed = [x if not lost else inf for x, lost in zip(left, self.lost, strict=True)]
        first, second, *_ = sorted(believed)
        clear = first + SMALL < self.p.ratio * second and sum(self.lost) < 2
        if clear and self.pending > self.p.smoothing:
            return max([name if x <= first else 0.0 for name, x in zip(SIGNALS, believed, strict=True)])
        if self.pending > self.p.patience:
            self.fault = UNLOCATED
        return 0.0

    def _lose(self, located: float) -> None:
        """Exclude a signal; of the wheel speeds, the worst, and after a second fault all."""
        self.fault = located
        if located == WHEEL:
            worst = max(self.wheel_statistic)
            self.rolling = [
                rolls and s < worst for rolls, s in zip(self.rolling, self.wheel_statistic, strict=True)
            ]
        self.lost = [
            lost or (located == name and (name != WHEEL or sum(self.rolling) < 3))
            for lost, name in zip(self.lost, SIGNALS, strict=True)
        ]
        self._forget()

    def _jumped(self, h: float, rates: tuple[float, float], last: tuple[float, float]) -> float:
        """Return the number of the signal (gyro or accelerometer) that has jumped and stays away, or 0."""
        p, lag = self.p, min(h / LEVEL_LAG, 1.0)
        jumps = [abs(rate - before) > p.jump for rate, before in zip(rates, last, strict=True)]
        stays = [
            jump == (away == 0.0) and abs(rate - level) > p.jump and not lost  # noise keeps jumping
            for jump, away, rate, level, lost in zip(
                jumps, self.away, rates, self.levels, self.lost[:2], strict=True
            )
        ]
        self.away = [away + h if stay else 0.0 for away, stay in zip(self.away, stays, strict=True)]
        self.levels = [
            level if stay else level + lag * (rate - level)
            for level, rate, stay in zip(self.levels, rates, stays, strict=True)
        ]
        return self._longest(self.away)

    def _still(self, h: float, seen: tuple[float, float], rates: tuple[float, float, float]) -> float:
        """Return the number of the signal (gyro or accelerometer) that is stuck while others change, or 0."""
        same = [now == before for now, before in zip(seen, self.last, strict=True)]
        self.still = [still + h if alike else 0.0 for still, alike in zip(self.still, same, strict=True)]
        self.then = [then if still > h else rates for then, still in zip(self.then, self.still, strict=True)]
        return self._longest(
            [
                still if self._others_moved(k, rates, then) else 0.0
                for k, still, then in zip((0, 1), self.still, self.then, strict=True)
            ]
        )

    def _others_moved(
        self, k: int, rates: tuple[float, float, float], then: tuple[float, float, float]
    ) -> bool:
        """Return whether all trusted ones of the other two signals have changed, at least one."""
        others = [j for j in range(3) if j != k]
        alone = all(self.lost[j] for j in others)
        moved = all(self.lost[j] or abs(rates[j] - then[j]) > self.p.moved for j in others)
        return moved and not alone and not self.lost[k]

    def _longest(self, times: list[float]) -> float:
        """Return the number of the signal (gyro or accelerometer) whose time exceeds `still_time`, or 0."""
        if times[0] >= self.p.still_time:
            return GYRO
        return ACCELEROMETER if times[1] >= self.p.still_time else 0.0
