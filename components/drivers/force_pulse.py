"""Open-loop braking or driving for a while, with the wheel straight or turned.

    F(t)     = force                                                    during the pulse, else 0
    delta(t) = final_steer_angle (t - steer_start_time) / steer_time    while the wheel is turned;
               0 before, final_steer_angle after

The pulse begins and ends at once, as a panic stop does. What the car cannot carry out, because the
road has less grip, is the business of wheel control and tyres. A steer time of zero makes it a step.
"""

from dataclasses import dataclass

from ..driving.hand_wheel import ramp
from ..fmi.component import Component
from ..fmi.variables import parameter


@dataclass(frozen=True)
class ForcePulseParameters:
    """Parameters of pedal and steering wheel; in no paper: chosen for slip control on a slippery road."""

    force: float = parameter(
        -6000.0,
        "N",
        "Sum of the longitudinal tyre forces asked for, negative when braking",
        "chosen: half again what paper B's car can have at mu 0.3",
    )
    start_time: float = parameter(0.5, "s", "Time at which the pulse begins", "chosen: time to see it begin")
    duration: float = parameter(1.5, "s", "Duration of the pulse", "chosen: long enough to lock", minimum=0.0)
    final_steer_angle: float = parameter(
        0.0, "rad", "Final steer angle at the road wheels", "chosen: straight on"
    )
    steer_start_time: float = parameter(
        0.5, "s", "Time at which the wheel begins to turn", "chosen: that of the pulse"
    )
    steer_time: float = parameter(
        0.1, "s", "Time it takes to turn the wheel", "chosen: a quick evasive turn", minimum=0.0
    )


def pulse_force(t: float, p: ForcePulseParameters) -> float:
    """Return the force [N] at time `t` [s]."""
    return p.force if 0.0 <= t - p.start_time < p.duration else 0.0


def held_steer(t: float, p: ForcePulseParameters) -> float:
    """Return the steer angle [rad] at time `t` [s]."""
    return ramp(t - p.steer_start_time, p.steer_time, p.final_steer_angle)


class ForcePulse(Component):
    """Open-loop braking or driving for a while, straight on or in a turn."""

    Parameters = ForcePulseParameters
    outputs = ("steer_angle", "drive_force")

    def output(self, t: float, u: list[float]) -> tuple[float, ...] | list[float]:
        return held_steer(t, self.p), pulse_force(t, self.p)
