"""Open-loop sine steering for a number of periods, then straight ahead.

    delta_h(t) = amplitude sin(2 pi frequency (t - start_time)),   0 <= frequency (t - start_time) <= periods
    delta(t) = delta_h(t) / steering_ratio

With the default steering ratio of 1 the amplitude is that of the road wheels. The speed is held if
`speed_gain` is positive (`driving.speed_holding`).
"""

import math
from dataclasses import dataclass

from ..driving.hand_wheel import HandWheelDriver, SteeringParameters
from ..driving.speed_holding import SpeedHoldingParameters
from ..fmi.variables import of_car, parameter


@dataclass(frozen=True)
class SineParameters(SteeringParameters, SpeedHoldingParameters):
    """Parameters of the steering input; papers A and B mention a sine but neither amplitude nor period."""

    amplitude: float = parameter(0.05, "rad", "Amplitude at the hand wheel", "chosen: paper A at 15 m/s")
    steering_ratio: float = of_car(1.0, "chosen: 1, the amplitude is that of the road wheels")
    frequency: float = parameter(
        0.2, "Hz", "Frequency", "chosen: a period of 5 s, as in paper A's figure 6", minimum=0.0
    )
    periods: float = parameter(1.0, "1", "Number of periods, then straight ahead", "chosen: one", minimum=0.0)


def sine_steer(t: float, p: SineParameters) -> float:
    """Return the hand-wheel angle [rad] at time `t` [s]."""
    phase = p.frequency * (t - p.start_time)
    if phase <= 0.0 or phase >= p.periods:
        return 0.0
    return p.amplitude * math.sin(2.0 * math.pi * phase)


class Sine(HandWheelDriver):
    """Open-loop sine steering, optionally at constant speed."""

    Parameters = SineParameters

    def hand_wheel_angle(self, t: float) -> float:
        return sine_steer(t, self.p)
