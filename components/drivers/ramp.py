"""Open-loop ramp steering: the wheel is turned at a steady rate to an angle and held there.

    delta_h(t) = amplitude (t - start_time) / ramp_time,   held at 0 before and at the amplitude after
    delta(t) = delta_h(t) / steering_ratio

A ramp time of zero makes it a step. The speed is held by default (`driving.speed_holding`).

Source: Nie, Xiong, Pan, Multi-condition co-simulations of vehicle stability control via fuzzy PID
algorithm, Journal of Dynamics and Control 19(3), 2021, section 3.3: 1.5 rad, reached in 2 s.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..driving.speed_holding import HeldSpeedParameters, SpeedHold
from ..fmi.component import Component
from ..fmi.variables import parameter, signal


@dataclass(frozen=True)
class RampParameters(HeldSpeedParameters):
    """Of the steering input."""

    amplitude: float = parameter(1.5, "rad", "Final angle of the hand wheel; paper C, section 3.3")
    ramp_time: float = parameter(2.0, "s", "Duration of the ramp; paper C, section 3.3", minimum=0.0)
    start_time: float = parameter(1.0, "s", "Time at which the ramp begins; chosen: 1 s straight ahead")
    steering_ratio: float = parameter(
        17.0, "1", "Hand-wheel angle over road-wheel angle; chosen: large saloon", minimum=0.1
    )


def ramp_steer(t: float, p: RampParameters) -> float:
    """Return the hand-wheel angle [rad] at time `t` [s]."""
    late = t - p.start_time
    if late <= 0.0:
        return 0.0
    return p.amplitude if late >= p.ramp_time else p.amplitude * late / p.ramp_time


class Ramp(Component):
    """Open-loop steering to an angle, held there, at a held speed."""

    Parameters = RampParameters
    inputs = (signal("velocity_x", optional=True),)
    outputs = ("steer_angle", "drive_force", "steering_wheel_angle")

    def start(self, t, u):
        self.speed = SpeedHold(self.p)
        self.speed.start(u[0])

    def advance(self, t, h, u):
        self.speed.advance(t, h, u[0])

    def output(self, t, u):
        hand = ramp_steer(t, self.p)
        return hand / self.p.steering_ratio, self.speed.force, hand
