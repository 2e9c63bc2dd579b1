"""Reference from the linear single-track model, dynamic or in steady state, limited by friction.

    model of cars.single_track_car,            |delta| <= share mu g / (v r/delta)     `limit_steer_angle`
    r_ref    = r limited to                +-share mu g / v                        `limit_yaw_rate`, (17)
    beta_ref = beta limited to             +-atan(c mu)             `control_laws.sideslip_bound`, (18)

The limits keep the sign of the linear value (paper B writes the sign of delta). If only the outputs are
limited, yaw rate and sideslip belong to different turns; if the steer angle of the model is limited, they
belong to the same turn. Paper B limits the outputs, paper D requires the steer angle to be limited first.

Rates of the limited references, as needed by sliding mode: `control_laws.reference`.

The model interpolates steer angle and speed linearly between their last and new values. Below `low_speed`,
where its time constants vanish, it runs at that speed and the yaw rate is reduced in proportion to the true
speed; for a car at rest or rolling backwards it is zero. `speed` says which speed that is.

Source: paper B, equations (16)-(18); paper D, equation (3).
"""

from collections.abc import Sequence
from dataclasses import dataclass

from yawbench.vocabulary.gravity import G

from ..cars.published_cars import PaperB
from ..cars.single_track_car import SingleTrackCar
from ..control_laws.reference import RateParameters, Reference
from ..control_laws.sideslip_bound import PER_FRICTION, sideslip_bound
from ..fmi.variables import like, parameter
from ..mathematics.integrators import rk4


@dataclass(frozen=True)
class SingleTrackParameters:
    """Parameters of paper B's car, table 1, and of the limits."""

    mass: float = like(PaperB, "mass")
    yaw_inertia: float = like(PaperB, "yaw_inertia")
    cg_to_front_axle: float = like(PaperB, "cg_to_front_axle")
    cg_to_rear_axle: float = like(PaperB, "cg_to_rear_axle")
    cornering_stiffness_front: float = parameter(
        91600.0, "N/rad", "Stiffness C_f of the front axle", "chosen: that of the tyres of set 1", minimum=1.0
    )
    cornering_stiffness_rear: float = parameter(
        67800.0, "N/rad", "Stiffness C_r of the rear axle", "chosen: that of the tyres of set 1", minimum=1.0
    )
    mode: str = parameter(
        "steady_state", None, "Steady state or dynamic model", "chosen", choices=("steady_state", "dynamic")
    )
    limit_steer_angle: bool = parameter(
        False, None, "Limit the steer angle of the model according to friction", "paper B does not"
    )
    limit_yaw_rate: bool = parameter(True, None, "Limit the yaw rate", "paper B, equation (17)")
    limit_sideslip: bool = parameter(True, None, "Limit the sideslip", "paper B, equation (18)")
    friction_share: float = parameter(
        1.0, "1", "Share of mu in the limits of steer angle and yaw rate", "paper B: all of it", minimum=0.0
    )
    sideslip_per_friction: float = parameter(
        PER_FRICTION,
        "1",
        "c in |beta_ref| <= atan(c mu)",
        "paper B, equation (18): 0.02 s2/m times g",
        minimum=0.0,
    )
    speed: str = parameter(
        "actual",
        None,
        "Speed of model and limits: the car's actual one, or the initial one as that which is desired",
        "chosen: paper B's equations have V_x, its text and figure 2 the desired V_xd",
        choices=("actual", "initial"),
    )
    rate_time_constant: float = like(RateParameters, "rate_time_constant")
    low_speed: float = parameter(
        2.0, "m/s", "Smallest speed of the model", "chosen: walking pace", minimum=0.1
    )


def clamp(x: float, most: float) -> float:
    """Return `x` limited to +-`most`."""
    return min(max(x, -most), most)


class SingleTrack(Reference):
    """Reference from the linear single-track model, dynamic or in steady state, limited by friction."""

    Parameters = SingleTrackParameters

    def configure(self) -> None:
        self.car = SingleTrackCar.of(self.p, self.p.yaw_inertia)

    def begin(self, u: list[float]) -> tuple[float, float]:
        self.initial = u[1]
        self.feed = self._feed(u)
        self.model = self._steady(*self.feed)  # a dynamic model starts in its steady state
        return self._limit(u)

    def follow(self, h: float, u: list[float]) -> tuple[float, float]:
        delta, v = self.feed
        delta_end, v_end = self.feed = self._feed(u)
        if self.p.mode == "steady_state":
            self.model = self._steady(delta_end, v_end)
        elif h > 0.0:
            derivatives = self.car.derivatives

            def along(time: float, state: Sequence[float]) -> tuple[float, float]:
                part = time / h
                return derivatives(
                    state[0], state[1], delta=delta + part * (delta_end - delta), v=v + part * (v_end - v)
                )

            beta, r = rk4(along, 0.0, h, self.model)
            self.model = beta, r
        return self._limit(u)

    def _speed(self, u: list[float]) -> float:
        """Return the speed [m/s] that the reference goes by."""
        return self.initial if self.p.speed == "initial" else u[1]

    def _feed(self, u: list[float]) -> tuple[float, float]:
        """Return the steer angle [rad] and speed [m/s] of the model."""
        p = self.p
        delta, v = u[0], max(self._speed(u), p.low_speed)
        if p.limit_steer_angle:  # to that of a steady turn at the friction limit
            gain, _ = self.car.gains(v)
            delta = clamp(delta, p.friction_share * max(u[2], 0.0) * G / max(v * gain, 1e-9))
        return delta, v

    def _steady(self, delta: float, v: float) -> tuple[float, float]:
        """Return (beta [rad], r [rad/s]) in the steady state."""
        r_gain, beta_gain = self.car.gains(v)
        return beta_gain * delta, r_gain * delta

    def _limit(self, u: list[float]) -> tuple[float, float]:
        """Return (r_ref [rad/s], beta_ref [rad]) for the model's state; equations (17), (18)."""
        p = self.p
        beta, r = self.model
        v = max(self._speed(u), 0.0)
        mu = max(u[2], 0.0)
        if v < p.low_speed:
            r *= v / p.low_speed
        if p.limit_yaw_rate:
            r = clamp(r, p.friction_share * mu * G / max(v, p.low_speed))
        if p.limit_sideslip:
            beta = clamp(beta, sideslip_bound(mu, p.sideslip_per_friction))
        return r, beta
