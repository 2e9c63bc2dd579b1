"""Motor and friction brake of each wheel: pure delay, first-order lag, limits; the motor comes first.

    motor asked for   T_m* = T* limited to +-motor_torque_limit
    brake asked for   T_f* = T* - T_m* limited to -brake_torque_limit .. 0
    either one        tau dT/dt = T*(t - delay) - T,    |dT/dt| <= rate limit              (14), (15)
    wheel torque      T_m + T_f

so braking is regenerative up to the motor's limit, and friction does the rest.

A request is held over the step for which it is given. Between two changes of the delayed request the
lag has a closed form, also while its rate is limited (a straight line until the exponential is
slower), so nothing is integrated numerically: the delay may be any time, no multiple of the step,
and a request held over two half steps gives what it gives over one.

Source: Vehicle yaw stability control based on fuzzy sliding mode direct yaw moment, equations
(14), (15). Erratum: printed with exp(+k s), which would be an advance. The paper names no values.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import exp, inf

from ..core.component import Component
from ..core.variables import output, parameter

History = list[tuple[float, float]]
"""Requests as (time from which it holds [s], value [N.m]), oldest first."""


@dataclass(frozen=True)
class LagParameters:
    """Of one wheel's motor and brake; all four are equal."""

    motor_time_constant: float = parameter(0.015, "s", "Lag of the motor; chosen", minimum=0.0)
    motor_delay: float = parameter(0.003, "s", "Pure delay of the motor; chosen", minimum=0.0)
    motor_torque_limit: float = parameter(
        800.0, "N.m", "Largest motor torque at the wheel, driving or braking; chosen", minimum=0.0
    )
    motor_rate_limit: float = parameter(
        1e6, "N.m/s", "Fastest change of the motor torque; chosen: no limit in the paper", minimum=1.0
    )
    brake_time_constant: float = parameter(0.08, "s", "Lag of the friction brake; chosen", minimum=0.0)
    brake_delay: float = parameter(0.015, "s", "Pure delay of the friction brake; chosen", minimum=0.0)
    brake_torque_limit: float = parameter(
        2500.0, "N.m", "Largest friction brake torque at the wheel; chosen", minimum=0.0
    )
    brake_rate_limit: float = parameter(
        1e6, "N.m/s", "Fastest change of the brake torque; chosen: no limit in the paper", minimum=1.0
    )


def blend(request: float, motor_limit: float, brake_limit: float) -> tuple[float, float]:
    """Return the torques [N.m] asked of motor and friction brake, the latter never positive."""
    motor = min(max(request, -motor_limit), motor_limit)
    return motor, max(min(request - motor, 0.0), -brake_limit)


def relax(torque: float, target: float, h: float, *, tau: float, rate: float) -> float:
    """Return the torque [N.m] after `h` [s] with a held target: lag `tau` [s], `rate` limit [N.m/s]."""
    gap = target - torque
    excess = abs(gap) - rate * tau  # what is left for the straight line
    if excess > 0.0:
        line = excess / rate
        if h <= line:
            return torque + (rate * h if gap > 0.0 else -rate * h)
        h -= line
        gap = rate * tau if gap > 0.0 else -rate * tau
    if tau <= 0.0:
        return target
    return target - gap * exp(-h / tau)


class Stage:
    """One delay and lag: its torque and the requests that still count.

    Args:
        tau, delay: time constant and pure delay [s].
        rate: rate limit [N.m/s].
    """

    def __init__(self, *, tau: float, delay: float, rate: float) -> None:
        self.tau, self.delay, self.rate = tau, delay, rate
        self.torque = 0.0
        self.history: History = [(-inf, 0.0)]

    def advance(self, t: float, h: float, request: float) -> None:
        """Take the torque from `t` to `t + h` [s], the request [N.m] holding over that step."""
        history = self.history
        if history[-1][1] != request:
            history.append((t, request))
        begin, end = t - self.delay, t + h - self.delay
        torque = self.torque
        if len(history) > 1:
            while len(history) > 1 and history[1][0] <= begin:
                del history[0]
            for (_, value), (change, _) in pairwise(history):
                if change >= end:
                    break
                torque = relax(torque, value, change - begin, tau=self.tau, rate=self.rate)
                begin = change
        value = current(history, begin)
        if torque != value and end > begin:
            torque = relax(torque, value, end - begin, tau=self.tau, rate=self.rate)
        self.torque = torque


def current(history: Sequence[tuple[float, float]], t: float) -> float:
    """Return the request [N.m] that holds from `t` [s] on."""
    value = history[0][1]
    for time, later in history:
        if time > t:
            break
        value = later
    return value


class Lag(Component):
    """Motor and friction brake at each wheel: delay, first-order lag, limits, blending."""

    Parameters = LagParameters
    inputs = ("torque_request_*",)
    outputs = (
        "wheel_torque_*",
        output("motor_torque_*", unit="N.m", text="Torque of the wheel's motor"),
        output("brake_torque_*", unit="N.m", text="Torque of the wheel's friction brake, never positive"),
    )

    def start(self, t, u):
        p = self.p
        self.motors = [
            Stage(tau=p.motor_time_constant, delay=p.motor_delay, rate=p.motor_rate_limit) for _ in range(4)
        ]
        self.brakes = [
            Stage(tau=p.brake_time_constant, delay=p.brake_delay, rate=p.brake_rate_limit) for _ in range(4)
        ]

    def advance(self, t, h, u):
        p = self.p
        for request, motor, brake in zip(u, self.motors, self.brakes, strict=True):
            asked_motor, asked_brake = blend(request, p.motor_torque_limit, p.brake_torque_limit)
            motor.advance(t, h, asked_motor)
            brake.advance(t, h, asked_brake)

    def output(self, t, u):
        motors = [stage.torque for stage in self.motors]
        brakes = [stage.torque for stage in self.brakes]
        return [m + b for m, b in zip(motors, brakes, strict=True)] + motors + brakes
