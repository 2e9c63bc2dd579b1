"""Open-loop sine sweep: hand-wheel sine with linearly rising frequency, at constant speed.

    delta_h(t) = amplitude sin(2 pi (f_0 s + (f_1 - f_0) s^2 / (2 T))),   s = t - t_0,   0 <= s <= T,   else 0
    delta(t) = delta_h(t) / steering_ratio

Source: after ISO 7401, Road vehicles - Lateral transient response test methods: continuous sinusoidal
input, 0.2 Hz to at least 2 Hz, from memory of the standard.
"""

import math
from dataclasses import dataclass

from ..driving.hand_wheel import HandWheelDriver, SteeringParameters
from ..driving.speed_holding import HeldSpeedParameters
from ..fmi.variables import parameter


@dataclass(frozen=True)
class SineSweepParameters(SteeringParameters, HeldSpeedParameters):
    """Parameters of the steering input."""

    amplitude: float = parameter(
        math.radians(20.0), "rad", "Amplitude at the hand wheel", "chosen: tyres stay linear"
    )
    first_frequency: float = parameter(
        0.1, "Hz", "Frequency f_0 at the beginning", "chosen: half of ISO 7401's 0.2 Hz", minimum=0.0
    )
    last_frequency: float = parameter(
        3.0, "Hz", "Frequency f_1 at the end", "chosen: beyond ISO 7401's 2 Hz", minimum=0.0
    )
    duration: float = parameter(30.0, "s", "Duration T", "chosen: 0.1 Hz per second", minimum=0.01)


def sweep(t: float, p: SineSweepParameters) -> float:
    """Return the hand-wheel angle [rad] at time `t` [s]."""
    s = t - p.start_time
    if s <= 0.0 or s >= p.duration:
        return 0.0
    turns = p.first_frequency * s + 0.5 * (p.last_frequency - p.first_frequency) * s * s / p.duration
    wave: float = math.sin(2.0 * math.pi * turns)
    return p.amplitude * wave


class SineSweep(HandWheelDriver):
    """Open-loop sine sweep with linearly rising frequency, at constant speed."""

    Parameters = SineSweepParameters

    def hand_wheel_angle(self, t: float) -> float:
        return sweep(t, self.p)
