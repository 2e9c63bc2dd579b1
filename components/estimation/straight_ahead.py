"""What is known while a car drives straight ahead: zero points of gyro and accelerometer, and no sideslip.

Straight ahead means that |delta|, |r| and |a_y| as measured are below thresholds for some time. The zero
points are then the mean of the measurements, at first of all of them, later with a long memory

    b <- b + max(1 / n, h / memory) (y - b)

The zero point of the accelerometer includes the bank of the road. Zero points are limited to plausible
values. An estimated v_y fades while the car goes on straight ahead.
"""

from .estimator_parameters import EstimatorParameters


class ZeroPoints:
    """Zero points of yaw rate [rad/s] and lateral acceleration [m/s2], and time straight ahead [s]."""

    def __init__(self, p: EstimatorParameters) -> None:
        self.p = p
        self.yaw_rate = self.acceleration = 0.0
        self.messages = 0
        self.straight = 0.0

    def see(self, h: float, *, r: float, a_y: float, delta: float) -> None:
        """Learn from a message `h` [s] after the last: yaw rate, lateral acceleration, steer angle."""
        p = self.p
        if abs(delta) > p.straight_steer_angle or abs(r - self.yaw_rate) > p.straight_yaw_rate:
            self.straight = 0.0
            return
        self.straight += h
        if self.straight < p.straight_time and self.messages >= 10:
            return
        self.messages += 1
        part = max(1.0 / self.messages, h / p.zero_point_memory)
        self.yaw_rate += part * (r - self.yaw_rate)
        self.acceleration += part * (a_y - self.acceleration)
        most, most_a = p.zero_point_limit_yaw_rate, p.zero_point_limit_acceleration
        self.yaw_rate = min(max(self.yaw_rate, -most), most)
        self.acceleration = min(max(self.acceleration, -most_a), most_a)


def faded(v_y: float, h: float, straight: float, p: EstimatorParameters) -> float:
    """Return v_y [m/s] after `h` [s]; it decays once the car drives straight ahead long enough."""
    return v_y * (1.0 - min(h / p.straight_fade, 1.0)) if straight > p.straight_time else v_y
