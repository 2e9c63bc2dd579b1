"""Open-loop pulse of braking or driving force, straight ahead or with ramp steering.

    F(t)     = force                                                    during the pulse, else 0
    delta(t) = final_steer_angle (t - steer_start_time) / steer_time    while the wheel is turned;
               0 before, final_steer_angle after

The pulse is a step up and down, as in a panic stop; wheel control and tyres limit the force to the available
grip. A steer time of zero gives a steering step.
"""

from dataclasses import dataclass

from ..driving.hand_wheel import ramp
from ..fmi.component import Component
from ..fmi.variables import parameter


@dataclass(frozen=True)
class ForcePulseParameters:
    """Parameters of pedal and steering wheel; not from a paper, chosen for slip control on slippery roads."""

    force: float = parameter(
        -6000.0,
        "N",
        "Requested sum of the longitudinal tyre forces, negative when braking",
        "chosen: one and a half times the grip of paper B's car at mu 0.3",
    )
    start_time: float = parameter(0.5, "s", "Time at which the pulse begins", "chosen: shows the beginning")
    duration: float = parameter(1.5, "s", "Duration of the pulse", "chosen: wheels can lock", minimum=0.0)
    final_steer_angle: float = parameter(
        0.0, "rad", "Final steer angle at the road wheels", "chosen: straight on"
    )
    steer_start_time: float = parameter(
        0.5, "s", "Time at which the wheel begins to turn", "chosen: that of the pulse"
    )
    steer_time: float = parameter(
        0.1, "s", "Duration of the steering ramp", "chosen: a quick evasive turn", minimum=0.0
    )


def pulse_force(t: float, p: ForcePulseParameters) -> float:
    """Return the force [N] at time `t` [s]."""
    return p.force if 0.0 <= t - p.start_time < p.duration else 0.0


def held_steer(t: float, p: ForcePulseParameters) -> float:
    """Return the steer angle [rad] at time `t` [s]."""
    return ramp(t - p.steer_start_time, p.steer_time, p.final_steer_angle)


class ForcePulse(Component):
    """Open-loop pulse of braking or driving force, straight ahead or with ramp steering."""

    Parameters = ForcePulseParameters
    outputs = ("steer_angle", "drive_force")

    def output(self, t: float, u: list[float]) -> tuple[float, ...] | list[float]:
        return held_steer(t, self.p), pulse_force(t, self.p)
