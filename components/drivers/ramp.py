"""Open-loop ramp steering: the hand wheel turns at a constant rate to an angle and is held there.

    delta_h(t) = amplitude (t - start_time) / ramp_time,   held at 0 before and at the amplitude after
    delta(t) = delta_h(t) / steering_ratio

A ramp time of zero gives a step. The speed is held by default (`driving.speed_holding`).

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
    """Open-loop ramp steering to an angle, at constant speed."""

    Parameters = RampParameters

    def hand_wheel_angle(self, t: float) -> float:
        p = self.p
        return ramp(t - p.start_time, p.ramp_time, p.amplitude)
