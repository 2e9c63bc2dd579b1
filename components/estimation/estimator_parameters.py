"""Parameters common to all estimators: the control unit's model of the car, and its signals."""

from dataclasses import dataclass

from ..cars.published_cars import PaperB
from ..fmi.variables import like, parameter


@dataclass(frozen=True)
class EstimatorParameters:
    """Parameters common to all estimators: the control unit's model of the car, and its signals."""

    mass: float = like(PaperB, "mass")
    cg_to_front_axle: float = like(PaperB, "cg_to_front_axle")
    cg_to_rear_axle: float = like(PaperB, "cg_to_rear_axle")
    track_width: float = like(PaperB, "track_width")
    cg_height: float = like(PaperB, "cg_height")
    wheel_radius: float = like(PaperB, "wheel_radius")
    roll_at_1_g: float = parameter(
        0.0, "rad", "Roll angle phi_g of the body at 1 g", "chosen: a car without roll", minimum=0.0
    )
    slip_stiffness_per_load: float = parameter(
        20.0,
        "1",
        "Slip stiffness c over load of the tyres",
        "chosen: between dry tyres of 15 and 25",
        minimum=1.0,
    )
    inertial_bandwidth: float = parameter(
        21.0,
        "Hz",
        "Low pass (-3 dB) of gyro and accelerometers, 0: none",
        "Bosch, SMI700 product sheet: 21 Hz",
        minimum=0.0,
    )
    signal_delay: float = parameter(
        0.02,
        "s",
        "Age of the inertial signals",
        "chosen: 10 ms of a message and its latency, 10 ms of a low pass of 21 Hz",
        minimum=0.0,
    )
    speed_gain: float = parameter(
        10.0, "1/s", "Gain by which the speed follows trusted wheels", "chosen: 0.1 s", minimum=0.0
    )
    speed_doubt: float = parameter(
        0.5, "m/s", "Difference s above which a wheel is distrusted", "chosen: 2 % of 90 km/h", minimum=0.01
    )
    straight_steer_angle: float = parameter(
        0.003, "rad", "Straight ahead: largest steer angle", "chosen: 3 deg at the hand wheel", minimum=0.0
    )
    straight_yaw_rate: float = parameter(
        0.01, "rad/s", "Straight ahead: largest yaw rate", "chosen: six times the gyro's noise", minimum=0.0
    )
    straight_time: float = parameter(
        0.3, "s", "Straight ahead: least duration", "chosen: a yaw motion has died away", minimum=0.0
    )
    straight_fade: float = parameter(
        0.1, "s", "Time constant with which v_y fades straight ahead", "chosen: fast", minimum=0.001
    )
    zero_point_memory: float = parameter(
        5.0, "s", "Memory of the zero points", "chosen: beyond the noise, before temperature", minimum=0.1
    )
    zero_point_limit_yaw_rate: float = parameter(
        0.01, "rad/s", "Largest zero point of the gyro", "chosen: twice 0.3 deg/s", minimum=0.0
    )
    zero_point_limit_acceleration: float = parameter(
        0.7, "m/s2", "Largest zero point of a_y", "chosen: 0.2 m/s2 and a bank of 3 deg", minimum=0.0
    )
