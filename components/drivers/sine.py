"""Open-loop sine steering: a number of whole periods, then the wheel is held straight.

    delta(t) = amplitude sin(2 pi frequency (t - start_time)),   0 <= frequency (t - start_time) <= periods

Stimuli live in a unit, not in the master, so that they are exact at every instant and not
quantised to whole communication steps.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..core.component import Component
from ..core.variables import parameter


@dataclass(frozen=True)
class SineParameters:
    """Of the steering input; the papers name a sine but neither amplitude nor period."""

    amplitude: float = parameter(0.05, "rad", "Amplitude at the road wheels; chosen: paper A at 15 m/s")
    frequency: float = parameter(
        0.2, "Hz", "Frequency; chosen: one period of 5 s, as in paper A's figure 6", minimum=0.0
    )
    start_time: float = parameter(1.0, "s", "Time of the first zero crossing; chosen: 1 s straight ahead")
    periods: float = parameter(1.0, "1", "Number of periods, then straight ahead; chosen: one", minimum=0.0)
    constant_drive_force: float = parameter(
        0.0, "N", "Sum of the longitudinal tyre forces asked for, always; paper A: no driving"
    )


def sine_steer(t: float, p: SineParameters) -> float:
    """Return the steer angle [rad] at time `t` [s]."""
    phase = p.frequency * (t - p.start_time)
    if phase <= 0.0 or phase >= p.periods:
        return 0.0
    return p.amplitude * math.sin(2.0 * math.pi * phase)


class Sine(Component):
    """Open-loop sine steering at the road wheels."""

    Parameters = SineParameters
    outputs = ("steer_angle", "drive_force")

    def output(self, t, u):
        p = self.p
        return sine_steer(t, p), p.constant_drive_force
