"""Evaluation of straight-line braking, braking or lifting off in a turn, and side wind.

**Straight-ahead braking** on split friction, or over a jump of friction. From the start of braking (the
driver's force falls below zero; where that is not recorded, the deceleration exceeds 1 m/s2) until the car
has stopped:

    stopping distance      distance travelled by the centre of mass
    mean deceleration      ((0.8 v_0)^2 - (0.1 v_0)^2) / (2 distance in between)
    yaw                    largest yaw rate, within the first second and in all, and largest yaw angle
    deviation              largest distance from the line along which the car was travelling
    hand wheel             largest angle, and rate over 0.1 s
    sideslip               largest above 10 km/h: below that speed it is meaningless (`motion`)

If the friction under the front wheels jumps meanwhile:

    before, after          mean deceleration over the 0.5 s before it, and from 0.5 to 1 s after it
    adaptation             from the jump until nine tenths of that change, deceleration as mean over 0.1 s
    yaw                    largest yaw rate within the second after it

Source: after ISO 14512, Passenger cars - Straight-ahead braking on surfaces with split coefficient of
friction - Open-loop test procedure, from memory of the standard; a driver who corrects makes it closed loop.
The mean deceleration is that of UN Regulation No. 13-H. The quantities of the jump are ours: the regulation
asks that brakes of an anti-lock system adapt "within a reasonable time".

**Braking or lifting off in a turn**: how a steady turn continues while the hand wheel is held. Steady state:
means over the last 0.5 s before the action, with the radius R_0 = v_0 / r_0. 1 s after it:

    yaw rate ratio     r / (v / R_0)     1: still the same circle, more: turns in, less: pushes out
    a_y ratio          a_y / (v^2 / R_0)
    deceleration       mean over that second
    sideslip           change against the steady state

and the largest yaw rate ratio within that second.

Source: after ISO 7975, Passenger cars - Braking in a turn - Open-loop test method, and ISO 9816 (power-off
reactions), from memory of the standards.

**Side wind**: how far a gust pushes the car off its path while the hand wheel is held. From the start of the
wind, relative to the direction of travel before it (means over 0.5 s):

    after 2 s        distance from that line, yaw angle
    within 2 s       largest yaw rate and lateral acceleration, their instants, largest sideslip

Positive: to the left. The wind starts where the road, or in measurements the signal `wind_force_y`, has a
side force.

Source: after ISO 12021, Road vehicles - Sensitivity to lateral wind - Open-loop test method using wind
generator input, from memory of the standard: 100 km/h, a zone of wind of 25 m, the hand wheel held, evaluated
over 2 s.
"""

from __future__ import annotations

import math

import numpy as np

from yawbench.metrics.measures import running_integral
from yawbench.metrics.verdict import NotJudged
from yawbench.vehicles.motion import largest
from yawbench.vocabulary.motion import LEAST_SPEED

from .standard_tests import Evaluation, evaluation
from .trace import Trace, at, first_crossing, known, refuse_opposed, running_mean

BRAKED = 1.0
"""Deceleration at which braking starts, if the pedal is not recorded [m/s2]."""
STOPPED = 0.1
"""Speed below which a car has stopped [m/s]; chosen."""
UPPER, LOWER = 0.8, 0.1
"""Fractions of v_0 between which the mean deceleration is computed: UN R13-H."""
MEAN = 0.1
"""Width of the running mean of rates and decelerations [s]; chosen."""
JUMP = 0.05
"""Change of the friction at both front wheels that counts as a jump [1]; chosen."""
BEFORE_BRAKING, LATE, LATER, ADAPTED = 0.5, 0.5, 1.0, 0.9
"""Time spans before and after a jump [s], and the fraction of the change at which brakes have adapted."""


@evaluation
def evaluate_braking(judged: Evaluation, trace: Trace) -> None:
    """Evaluate straight-line braking: distance, deceleration, yaw, steering correction, friction jump."""
    t, v_x, r = trace.time, trace["velocity_x"], trace["yaw_rate"]
    speed = np.hypot(v_x, trace["velocity_y"]) if "velocity_y" in trace else v_x
    begin = _braking_start(trace)
    way = running_integral(t, speed)
    way = way - at(t, way, begin)
    v_0 = at(t, speed, begin)
    if v_0 < LEAST_SPEED:
        raise NotJudged(f"the car is slower than {3.6 * LEAST_SPEED:.0f} km/h when it is braked")
    stop = first_crossing(t, -speed, -STOPPED, begin)
    end = float(t[-1]) if stop is None else stop
    judged.add("speed", "speed at the start of braking", v_0, "m/s")
    judged.add("begin", "start of braking", begin, "s")
    distance = None if stop is None else at(t, way, stop)
    judged.add("distance", "stopping distance", distance, "m", "distance travelled by the centre of mass")
    if stop is None:
        left = 3.6 * at(t, speed, end)  # km/h
        judged.report("car-not-stopped", f"the car has not stopped by {end:.2f} s: {left:.0f} km/h")
    judged.add("deceleration", "mean deceleration", _mean_deceleration(t, speed, way, v_0, begin), "m/s2",
               "from 0.8 to 0.1 of the speed (UN R13-H)")  # fmt: skip
    during = (t >= begin) & (t <= end)
    first = during & (t <= begin + 1.0)
    turned = trace["yaw_angle"] if "yaw_angle" in trace else running_integral(t, r)
    judged.add("yaw_rate_first", "largest yaw rate in the first second", _peak(r, first), "rad/s")
    judged.add("yaw_rate", "largest yaw rate", _peak(r, during), "rad/s")
    judged.add("yaw_angle", "largest yaw angle", _peak(turned - at(t, turned, begin), during), "rad")
    judged.add("deviation", "largest distance from the line", _deviation(trace, begin, during), "m")
    if "steering_wheel_angle" in trace:
        even = trace.even
        hand = even["steering_wheel_angle"]
        turning = running_mean(np.gradient(hand, even.time), MEAN, even.rate)
        within = (even.time >= begin) & (even.time <= end)
        correction = hand - at(even.time, hand, begin)
        judged.add("hand", "largest correction of the hand wheel", _peak(correction, within), "rad")
        judged.add("hand_rate", "its largest rate", _peak(turning, within), "rad/s", f"mean over {MEAN:g} s")
    if "sideslip" in trace:
        peak = _peak(trace.while_moving("sideslip"), during)
        judged.add("sideslip", "peak sideslip", peak, "rad", "above 10 km/h")
    _add_jump(judged, trace, begin, end)


def _braking_start(trace: Trace) -> float:
    """Return the instant at which braking starts [s]."""
    t = trace.time
    if "drive_force" in trace:
        pressed = np.flatnonzero(trace["drive_force"] < 0.0)
        if pressed.size:
            return float(t[pressed[0]])
    elif "acceleration_x" in trace:
        start = first_crossing(t, -trace["acceleration_x"], BRAKED, float(t[0]))
        if start is not None:
            return start
    else:
        raise NotJudged("neither drive_force nor acceleration_x is recorded, so braking cannot be detected")
    raise NotJudged("the car is not braked")


def _peak(x: np.ndarray, where: np.ndarray) -> float | None:
    return largest(x[where])


def _mean_deceleration(
    t: np.ndarray, speed: np.ndarray, way: np.ndarray, v_0: float, begin: float
) -> float | None:
    instants = [first_crossing(t, -speed, -share * v_0, begin) for share in (UPPER, LOWER)]
    if None in instants:
        return None
    upper, lower = (at(t, way, instant or 0.0) for instant in instants)
    return v_0**2 * (UPPER**2 - LOWER**2) / (2.0 * (lower - upper))


def _deviation(trace: Trace, begin: float, during: np.ndarray) -> float | None:
    """Return the largest distance [m] from the line along which the car travelled when braking started."""
    if not {"position_x", "position_y", "yaw_angle"} <= set(trace.signals):
        return None
    t = trace.time
    x, y = (trace[name] - at(t, trace[name], begin) for name in ("position_x", "position_y"))
    course = at(t, trace["yaw_angle"], begin)
    if "velocity_y" in trace:
        course += math.atan2(at(t, trace["velocity_y"], begin), at(t, trace["velocity_x"], begin))
    return _peak(y * math.cos(course) - x * math.sin(course), during)


def _add_jump(judged: Evaluation, trace: Trace, begin: float, end: float) -> None:
    """Add the quantities of a jump of the friction under both front wheels, if there is one."""
    if not {"friction_fl", "friction_fr", "acceleration_x"} <= set(trace.signals):
        return
    t = trace.time
    frictions = [trace[name] for name in ("friction_fl", "friction_fr")]
    changed = [np.abs(mu - mu[np.searchsorted(t, begin)]) > JUMP for mu in frictions]
    jumps = np.flatnonzero(changed[0] & changed[1] & (t > begin) & (t < end))
    if not jumps.size:
        return
    jump = float(t[jumps[0]])
    mu = [float(np.mean([friction[k] for friction in frictions])) for k in (jumps[0] - 1, jumps[0])]
    judged.add("jump", "the friction jumps", jump, "s", f"from {mu[0]:.2f} to {mu[1]:.2f} in front")
    judged.add("jump_speed", "speed there", at(t, trace["velocity_x"], jump), "m/s")
    even = trace.even
    slowing = running_mean(-even["acceleration_x"], MEAN, even.rate)
    before = even.time >= max(jump - BEFORE_BRAKING, begin)
    before &= even.time < jump - 0.5 * MEAN
    after = (even.time >= jump + LATE) & (even.time <= min(jump + LATER, end))
    means = [float(slowing[part].mean()) if part.any() else None for part in (before, after)]
    judged.add(
        "deceleration_before", "mean deceleration before it", means[0], "m/s2", f"{BEFORE_BRAKING:g} s"
    )
    judged.add("deceleration_after", "mean deceleration after it", means[1], "m/s2",
               f"{LATE:g} to {LATER:g} s after it")  # fmt: skip
    adapted = None
    if means[0] is not None and means[1] is not None and abs(means[1] - means[0]) > 0.0:
        share = (slowing - means[0]) / (means[1] - means[0])
        instant = first_crossing(even.time, share, ADAPTED, jump)
        adapted = None if instant is None else instant - jump
    judged.add("adaptation", "adaptation time", adapted, "s", f"{100 * ADAPTED:g} % of the change")
    near = (t >= jump) & (t <= min(jump + 1.0, end))
    judged.add("jump_yaw_rate", "largest yaw rate after it", _peak(trace["yaw_rate"], near), "rad/s", "1 s")


BEFORE_ACTION, AFTER_ACTION = 0.5, 1.0
"""Length of the steady state before the action, and time after it that is evaluated [s]."""
STEADY = 0.03
"""Largest range of the yaw rate in a steady turn, relative to its mean; chosen."""


@evaluation
def evaluate_turn(judged: Evaluation, trace: Trace) -> None:
    """Evaluate braking or lifting off in a turn, 1 s after the pedals change."""
    t, v, r, a_y = trace.time, trace["velocity_x"], trace["yaw_rate"], trace["acceleration_y"]
    now = trace.parameter("action_time", "when the pedals change")
    before = (t >= now - BEFORE_ACTION) & (t <= now)
    if now - BEFORE_ACTION < t[0] or now + AFTER_ACTION > t[-1] or np.count_nonzero(before) < 5:
        raise NotJudged(
            f"the record does not cover {BEFORE_ACTION:g} s before and {AFTER_ACTION:g} s after {now:g} s"
        )
    v_0, r_0 = float(v[before].mean()), float(r[before].mean())
    if abs(r_0) < 1e-3 or np.ptp(r[before]) > STEADY * abs(r_0):
        raise NotJudged(f"the turn is not steady before {now:g} s")
    if "steering_wheel_angle" in trace:
        refuse_opposed(trace["steering_wheel_angle"][before], r[before], "yaw rate")
    side, radius = math.copysign(1.0, r_0), v_0 / abs(r_0)
    judged.add("radius", "radius of the steady turn", side * radius, "m", "v / r, positive: to the left")
    judged.add("speed", "speed of the steady turn", v_0, "m/s")
    judged.add("acceleration", "lateral acceleration of the steady turn", float(a_y[before].mean()), "m/s2")
    judged.add(
        "deceleration",
        f"mean deceleration over {AFTER_ACTION:g} s",
        (at(t, v, now) - at(t, v, now + AFTER_ACTION)) / AFTER_ACTION,
        "m/s2",
    )
    moving = np.where(v < LEAST_SPEED, np.nan, v)  # below it, ratios over the speed mean nothing
    ratio = side * r * radius / moving
    judged.add(
        "yaw_ratio",
        f"yaw rate ratio after {AFTER_ACTION:g} s",
        known(at(t, ratio, now + AFTER_ACTION)),
        "1",
        "r R_0 / v",
    )
    during = (t >= now) & (t <= now + AFTER_ACTION)
    highest = float(np.fmax.reduce(ratio[during]))
    judged.add("yaw_ratio_peak", f"largest yaw rate ratio within {AFTER_ACTION:g} s", known(highest), "1")
    aside = side * at(t, a_y, now + AFTER_ACTION) * radius / at(t, moving, now + AFTER_ACTION) ** 2
    judged.add(
        "a_y_ratio",
        f"lateral acceleration ratio after {AFTER_ACTION:g} s",
        known(aside),
        "1",
        "a_y R_0 / v^2",
    )
    if "sideslip" in trace:
        sideslip = trace.while_moving("sideslip")
        change = at(t, sideslip, now + AFTER_ACTION) - float(sideslip[before].mean())
        judged.add("sideslip", f"change of sideslip after {AFTER_ACTION:g} s", known(change), "rad")
        judged.add("sideslip_peak", "peak sideslip from the action on", largest(sideslip[t >= now]), "rad",
                   "above 10 km/h")  # fmt: skip


AFTER_GUST, BEFORE_GUST = 2.0, 0.5
"""Time evaluated after the start of the wind, and time before it for the means [s]."""
HELD = math.radians(1.0)
"""Largest range of a hand wheel that counts as held [rad]; chosen: a loose grip."""


@evaluation
def evaluate_side_wind(judged: Evaluation, trace: Trace) -> None:
    """Evaluate the response of a car to a gust of side wind within 2 s."""
    t, wind = trace.time, trace["wind_force_y"]
    x, y, psi = trace["position_x"], trace["position_y"], trace["yaw_angle"]
    blown = np.flatnonzero(wind != 0.0)
    if not blown.size:
        raise NotJudged("the run has no side wind")
    begin = float(t[blown[0]])
    before = (t >= begin - BEFORE_GUST) & (t < begin)
    if begin - BEFORE_GUST < t[0] or begin + AFTER_GUST > t[-1] or np.count_nonzero(before) < 5:
        raise NotJudged(
            f"the record does not cover {BEFORE_GUST:g} s before and {AFTER_GUST:g} s after {begin:.2f} s"
        )
    during = (t >= begin) & (t <= begin + AFTER_GUST)
    judged.add("begin", "start of the wind", begin, "s")
    judged.add("speed", "speed there", at(t, trace["velocity_x"], begin), "m/s")
    strongest = int(np.argmax(np.abs(wind)))
    judged.add("force", "largest side force of the wind", float(wind[strongest]), "N")
    course = math.atan2(*(float(np.polyfit(t[before], line[before], 1)[0]) for line in (y, x)))
    off = (y - at(t, y, begin)) * math.cos(course) - (x - at(t, x, begin)) * math.sin(course)
    reading = f"{AFTER_GUST:g} s after the start of the wind"
    judged.add("deviation", "lateral deviation", at(t, off, begin + AFTER_GUST), "m", reading)
    turned = at(t, psi, begin + AFTER_GUST) - float(psi[before].mean())
    judged.add("yaw_angle", "change of the yaw angle", turned, "rad", reading)
    for name, says, unit in (
        ("yaw_rate", "largest yaw rate", "rad/s"),
        ("acceleration_y", "largest lateral acceleration", "m/s2"),
        ("sideslip", "largest change of sideslip", "rad"),
    ):
        if name == "sideslip" and name not in trace:
            continue
        signal = trace.while_moving(name) if name == "sideslip" else trace[name]
        values = np.nan_to_num(np.where(during, signal - float(signal[before].mean()), 0.0))
        k = int(np.argmax(np.abs(values)))
        judged.add(name, says, float(values[k]), unit, f"within {AFTER_GUST:g} s")
        if name != "sideslip":
            judged.add(f"{name}_at", "its instant", float(t[k]) - begin, "s", "after the start of the wind")
    if "steering_wheel_angle" in trace and np.ptp(trace["steering_wheel_angle"][during]) > HELD:
        turned_by = math.degrees(float(np.ptp(trace["steering_wheel_angle"][during])))
        judged.report("steering-not-held", f"the hand wheel is not held: it moves by {turned_by:.0f} degrees")
