"""Model-predictive control of a safe envelope, by front steering or by a yaw moment.

Inside the envelope of yaw rate and rear slip angle it does nothing, else as little as holds it.
The program is that of `control_laws.envelope_law`, solved by `mathematics.quadratic_program`. With steering,
the front side force it asks for is that of a slip angle of the axle (`control_laws.brush_axle`), and the
added angle is what the driver's lacks to it.

Source: C. E. Beal, J. C. Gerdes, Model predictive control for vehicle stabilization at the limits of
handling, IEEE Transactions on Control Systems Technology 21(4), 2013, 1258-1269; C. G. Bobier, J. C. Gerdes,
Staying within the nullcline boundary for vehicle envelope control using a sliding surface, Vehicle System
Dynamics 51(2), 2013. Of both, and of Beal's thesis (Stanford, 2011), only abstract and title were read:
envelope, front force as input and the tyre are as later papers of the group describe them; weights and
horizon are ours. Ours differs: friction is told, no rate of steering in the cost, rear forces linearized once
per sample, and the yaw moment in place of steering as an option.
"""

from dataclasses import dataclass

from ..cars.published_cars import PaperA
from ..cars.single_track_car import SingleTrackCar
from ..control_laws.envelope_law import Envelope, axles_of
from ..control_laws.moment_limit import LimitParameters, limit
from ..fmi.component import Component
from ..fmi.variables import like, output, parameter, signal
from ..references.steady_state import SteadyStateParameters
from .lqr import LqrParameters
from .mpc import MpcParameters
from .steering_and_braking import SteeringAndBrakingParameters

LEAST_FRICTION = 0.05
"""Friction [1] below which the law takes this one. Chosen: wet ice."""


@dataclass(frozen=True)
class EnvelopeMpcParameters:
    """Parameters of car, program and limits."""

    mass: float = like(PaperA, "mass")
    yaw_inertia: float = like(PaperA, "yaw_inertia")
    cg_to_front_axle: float = like(PaperA, "cg_to_front_axle")
    cg_to_rear_axle: float = like(PaperA, "cg_to_rear_axle")
    cornering_stiffness_front: float = like(SteadyStateParameters, "cornering_stiffness_front")
    cornering_stiffness_rear: float = like(SteadyStateParameters, "cornering_stiffness_rear")
    actuation: str = parameter(
        "steering", None, "What holds the envelope", "Beal, Gerdes: steering", choices=("steering", "moment")
    )
    envelope_share: float = parameter(
        1.0, "1", "Share of the envelope that is used", "Beal, Gerdes: all of it", minimum=0.05
    )
    penalty: float = parameter(
        300.0,
        "1",
        "Weight of the excess over the envelope",
        "chosen: 6 % of excess cost as much as all of the input",
        minimum=1e-3,
    )
    prediction_step: float = like(MpcParameters, "prediction_step")
    steps_per_move: int = like(MpcParameters, "steps_per_move")
    moves: int = like(MpcParameters, "moves")
    scheduling_speed: float = like(LqrParameters, "scheduling_speed")
    added_angle_limit: float = like(SteeringAndBrakingParameters, "added_angle_limit")
    moment_limit: float = like(LimitParameters, "moment_limit")
    fade_speed: float = like(LimitParameters, "fade_speed")


SEEN = ("yaw_rate", "sideslip", "velocity_x", "friction", "steer_angle")


class EnvelopeMpc(Component):
    """Model-predictive controller of a safe envelope of yaw rate and rear slip angle."""

    Parameters = EnvelopeMpcParameters
    sampled = True
    inputs = ("yaw_rate", "sideslip", "velocity_x", signal("friction", start=1.0), "steer_angle")
    outputs = (output("yaw_moment", *SEEN), output("added_steer_angle_request", *SEEN))

    def configure(self) -> None:
        self.car = SingleTrackCar.of(self.p, self.p.yaw_inertia)

    def output(self, t: float, u: list[float]) -> tuple[float, ...]:
        p, car = self.p, self.car
        r, beta, speed, friction, delta = u
        mu = p.envelope_share * max(friction, LEAST_FRICTION)
        v = max(speed, p.scheduling_speed)
        axles = axles_of(car, mu)
        steering = p.actuation == "steering"
        program = Envelope(car, axles, v=v, mu=mu, beta=beta, r=r, delta=delta, steering=steering)
        if not steering:
            moment = self._first(program, p.moment_limit, -p.moment_limit, p.moment_limit)
            return limit(moment, p, speed), 0.0
        front = axles[0]
        unsteered = beta + car.a * r / v
        force = front.force(unsteered - delta)
        more = self._first(program, front.grip, -front.grip - force, front.grip - force)
        if more == 0.0 or speed <= 0.0:
            return 0.0, 0.0
        wanted = unsteered - front.slip_for(force + more) - delta
        wanted *= min(speed / p.fade_speed, 1.0)
        return 0.0, min(max(wanted, -p.added_angle_limit), p.added_angle_limit)

    def _first(self, program: Envelope, unit: float, low: float, high: float) -> float:
        p = self.p
        return program.first(
            unit=max(unit, 1e-3),
            low=low,
            high=high,
            penalty=p.penalty,
            step=p.prediction_step,
            moves=p.moves,
            steps_per_move=p.steps_per_move,
        )
