"""Open-loop ramp steering: the wheel is turned at a steady rate to an angle and held there.

    delta_h(t) = amplitude (t - start_time) / ramp_time,   held at 0 before and at the amplitude after
    delta(t) = delta_h(t) / steering_ratio

A ramp time of zero makes it a step. The speed is held by default (`driving.speed_holding`).

Source: paper C, section 3.3: 1.5 rad, reached in 2 s.
"""

from dataclasses import dataclass

from ..driving.hand_wheel import HandWheelDriver, SteeringParameters, ramp
from ..driving.speed_holding import HeldSpeedParameters
from ..fmi.variables import parameter


@dataclass(frozen=True)
class RampParameters(SteeringParameters, HeldSpeedParameters):
    """Parameters of the steering input."""

    amplitude: float = parameter(1.5, "rad", "Final angle of the hand wheel", "paper C, section 3.3")
    ramp_time: float = parameter(2.0, "s", "Duration of the ramp", "paper C, section 3.3", minimum=0.0)


class Ramp(HandWheelDriver):
    """Open-loop steering to an angle, held there, at a held speed."""

    Parameters = RampParameters

    def hand_wheel_angle(self, t: float) -> float:
        p = self.p
        return ramp(t - p.start_time, p.ramp_time, p.amplitude)
