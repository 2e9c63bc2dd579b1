"""Open-loop sine with dwell: a sine period with a pause at its second peak, while the car coasts.

    delta_h(t) = amplitude sin(2 pi f s),    s = t - t_0                    0 <= s <= 3 / (4 f)
               = -amplitude                                                 for the dwell
               = amplitude sin(2 pi f (s - dwell))                          until s = 1 / f + dwell, else 0
    delta(t) = delta_h(t) / steering_ratio

A positive amplitude steers to the left first. The speed is held until the accelerator is released, shortly
before the steering begins (`driving.speed_holding`), so that drive forces have decayed by then.

Source: UN Global Technical Regulation No. 8 and UN Regulation No. 140, Electronic stability control
systems: 0.7 Hz, a pause of 500 ms, coasting in the highest gear at 80 km/h; likewise FMVSS 126.
"""

import math
from dataclasses import dataclass

from ..driving.hand_wheel import HandWheelDriver, SteeringParameters
from ..driving.speed_holding import HeldSpeedParameters
from ..fmi.variables import parameter


@dataclass(frozen=True)
class SineWithDwellParameters(SteeringParameters, HeldSpeedParameters):
    """Parameters of the steering input and of the accelerator."""

    amplitude: float = parameter(
        math.radians(270.0), "rad", "Amplitude at the hand wheel", "UN R140: smallest of the final runs"
    )
    frequency: float = parameter(0.7, "Hz", "Frequency f of the sine", "UN R140, GTR 8", minimum=0.01)
    dwell: float = parameter(0.5, "s", "Pause at the second peak", "UN R140, GTR 8", minimum=0.0)
    start_time: float = parameter(
        1.5,
        "s",
        "Time t_0 at which steering begins",
        "chosen: leaves the second over which signals are zeroed",
    )
    coasting_before: float = parameter(
        1.1,
        "s",
        "Time between releasing the accelerator and steering",
        "chosen: the car coasts throughout the second over which signals are zeroed",
    )
    target_speed: float = parameter(
        80.0 / 3.6, "m/s", "Speed held until then", "UN R140, GTR 8: 80 km/h", minimum=0.0
    )


def sine_with_dwell(t: float, p: SineWithDwellParameters) -> float:
    """Return the hand-wheel angle [rad] at time `t` [s]."""
    s = t - p.start_time
    peak = 0.75 / p.frequency
    if s > peak:
        s = max(s - p.dwell, peak)
    phase = p.frequency * s
    wave = math.sin(2.0 * math.pi * phase) if 0.0 < phase < 1.0 else 0.0
    return p.amplitude * wave


class SineWithDwell(HandWheelDriver):
    """Open-loop sine with dwell, with the car coasting."""

    Parameters = SineWithDwellParameters

    def hand_wheel_angle(self, t: float) -> float:
        return sine_with_dwell(t, self.p)

    def coasts_from(self) -> float:
        p: SineWithDwellParameters = self.p
        return p.start_time - p.coasting_before
