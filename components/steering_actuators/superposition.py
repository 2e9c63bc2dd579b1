"""Superposition steering: an actuator adds an angle to the driver's, with dead time, lag and limits.

    delta   = delta_driver + delta_a
    tau d(delta_a)/dt = delta_a*(t - delay) - delta_a,     |d(delta_a)/dt| <= rate_limit
    delta_a* = request limited to +-range

All angles are those of the road wheels. The driver's angle passes without delay, since the mechanical link
stays: a planetary gear adds the angle of an electric motor to the angle of the hand wheel. Without a request
the outputs are the driver's angle to the last bit. References see the driver's angle, plants the total one: a
scenario connects `total_steer_angle` to `plant.steer_angle`. Delay and lag are exact for any step size
(`mathematics.first_order_lag`).

Source: the principle, W. Klier, G. Reimann, W. Reinelt, Concept and functionality of the active front
steering system, SAE 2004-21-0073, 2004, of which the abstract and the beginning were read. P. Koehn, M.
Eckrich, Active steering, SAE 2004-01-1105, and W. Klier, W. Reinelt, SAE 2004-01-1102 (eight bodies and a
synchronous motor), were not read in full, and what was read of them prints no figures: limits and lag are
chosen. Ours differs: the gear is rigid, the torque at the hand wheel is not modelled.
"""

from dataclasses import dataclass

from ..fmi.component import Component
from ..fmi.variables import output, parameter, signal
from ..mathematics.first_order_lag import Stage


@dataclass(frozen=True)
class SuperpositionParameters:
    """Parameters of the actuator, at the road wheels."""

    time_constant: float = parameter(
        0.016,
        "s",
        "Lag tau of the added angle",
        "chosen: bandwidth of 10 Hz, above that of the car",
        minimum=0.0,
    )
    delay: float = parameter(0.0, "s", "Dead time of the added angle", "chosen: none", minimum=0.0)
    rate_limit: float = parameter(
        0.5,
        "rad/s",
        "Fastest change of the added angle",
        "chosen: 490 degrees per second at a hand wheel of ratio 17, half a fast driver's",
        minimum=1e-3,
    )
    range: float = parameter(
        0.07, "rad", "Largest added angle", "chosen: 4 degrees, 68 at a hand wheel of ratio 17", minimum=0.0
    )


class Superposition(Component):
    """Superposition steering: adds a requested angle to the driver's, with lag, rate and range limit."""

    Parameters = SuperpositionParameters
    inputs = ("steer_angle", signal("added_steer_angle_request", optional=True))
    outputs = (output("total_steer_angle", "steer_angle"), "added_steer_angle")

    def start(self, t: float, u: list[float]) -> None:
        p = self.p
        self.motor = Stage(tau=p.time_constant, delay=p.delay, rate=p.rate_limit)

    def advance(self, t: float, h: float, u: list[float]) -> None:
        most = self.p.range
        self.motor.advance(t, h, min(max(u[1], -most), most))

    def output(self, t: float, u: list[float]) -> tuple[float, ...]:
        added = self.motor.value
        return u[0] + added, added
