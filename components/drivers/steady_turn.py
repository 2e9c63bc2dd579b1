"""Steady-state circle at constant speed, then lift-off or braking with a fixed hand wheel.

    kappa*   = ramp to 1 / radius within turn_in_time
    delta    = c kappa* + I,   dI/dt = c (kappa* - r / v) / T_i,    c = L (1 + K v^2)       before the action
    then delta is held, the drive force falls to 0, and the brake force rises to mass deceleration

L is the wheelbase, K the stability factor: feedforward for a car with linear tyres, and an integral for the
rest. A deceleration of 0 is a lift-off.

Source: after ISO 7975 (braking in a turn) and ISO 9816 (power-off in a turn), open loop, from memory of the
standards: 100 m, lateral acceleration of 5 m/s2, fixed hand wheel.
"""

from dataclasses import dataclass
from math import sqrt

from ..cars.published_cars import PaperC
from ..cars.single_track_car import SingleTrackCar
from ..driving.hand_wheel import ramp
from ..driving.speed_holding import HeldSpeedParameters, SpeedHold
from ..fmi.component import Component
from ..fmi.variables import like, parameter
from .double_lane_change import DoubleLaneChangeParameters


@dataclass(frozen=True)
class SteadyTurnParameters(HeldSpeedParameters):
    """Parameters of the circle, of the action, and of the driver's model of the car."""

    radius: float = parameter(
        100.0, "m", "Radius of the circle, positive to the left", "after ISO 7975, from memory"
    )
    target_speed: float = parameter(
        sqrt(500.0), "m/s", "Speed held", "after ISO 7975: 5 m/s2 on 100 m", minimum=0.0
    )
    start_time: float = parameter(1.0, "s", "Time at which steering begins", "chosen: 1 s straight ahead")
    turn_in_time: float = parameter(
        2.0, "s", "Time until the requested curvature is full", "chosen: without overshoot", minimum=0.0
    )
    integral_time: float = parameter(
        1.0, "s", "Integral time T_i of the curvature", "chosen: slower than the yaw response", minimum=0.01
    )
    action_time: float = parameter(
        9.0, "s", "Time at which the hand wheel is fixed and the pedals change", "chosen: a steady turn"
    )
    deceleration: float = parameter(
        0.0,
        "m/s2",
        "Brake force over mass; 0: lift-off only",
        "chosen: lift-off",
        minimum=0.0,
    )
    brake_rise_time: float = parameter(
        0.2, "s", "Time until the brake force is full", "chosen: a quick foot", minimum=0.0
    )
    steering_ratio: float = like(DoubleLaneChangeParameters, "steering_ratio")
    mass: float = like(PaperC, "mass")
    cg_to_front_axle: float = like(PaperC, "cg_to_front_axle")
    cg_to_rear_axle: float = like(PaperC, "cg_to_rear_axle")
    cornering_stiffness_front: float = like(DoubleLaneChangeParameters, "cornering_stiffness_front")
    cornering_stiffness_rear: float = like(DoubleLaneChangeParameters, "cornering_stiffness_rear")


class SteadyTurn(Component):
    """Driver that holds a circle and a speed, then releases the accelerator or brakes."""

    Parameters = SteadyTurnParameters
    inputs = ("velocity_x", "yaw_rate")
    outputs = ("steer_angle", "drive_force", "steering_wheel_angle")

    def configure(self) -> None:
        if self.p.radius == 0.0:
            raise ValueError("radius must not be 0: positive to the left, negative to the right")
        self.car = SingleTrackCar.of(self.p)

    def start(self, t: float, u: list[float]) -> None:
        self.speed = SpeedHold(self.p, u[0], self.p.action_time)
        self.learnt = 0.0
        self.steer = 0.0
        self._steer(t, u[0])

    def advance(self, t: float, h: float, u: list[float]) -> None:
        self.speed.advance(t, h, u[0])
        held = min(max(self.p.action_time - t, 0.0), h)  # part of the step before the action
        if held > 0.0:
            v = max(u[0], 1.0)
            lacking = self._wanted(t) - u[1] / v
            self.learnt += held * lacking * v / self.car.gains(v)[0] / self.p.integral_time
            self._steer(t + held, u[0])

    def output(self, t: float, u: list[float]) -> tuple[float, ...] | list[float]:
        p = self.p
        brake = ramp(t - p.action_time, p.brake_rise_time, -p.mass * p.deceleration)
        return self.steer, self.speed.force + brake, self.steer * p.steering_ratio

    def _wanted(self, t: float) -> float:
        p = self.p
        return ramp(t - p.start_time, p.turn_in_time, 1.0 / p.radius)

    def _steer(self, t: float, v: float) -> None:
        v = max(v, 1.0)
        self.steer = self._wanted(t) * v / self.car.gains(v)[0] + self.learnt
