"""Poor sensor cluster: noise, biases and delays at the bad end of production cars.

The cluster of `sensors.production` with other values. Noise and slow messages are those of sensors of the
1990s, biases those of a production sensor without zero-point learning.
"""

from ..fmi.variables import parameter
from ..sensing.cluster_parameters import Figures, parameters_of
from .production import PRODUCTION, Production

_OLD = "eeNews Automotive, 2014: sensors for ESP at that time, 0.4 deg/s and 15 mg rms"

POOR: Figures = {
    **PRODUCTION,
    "yaw_rate": {
        **PRODUCTION["yaw_rate"],
        "noise": (0.006981, _OLD),
        "bias": (0.005236, "chosen: 0.3 deg/s, remaining after poor zero-point learning"),
    },
    "acceleration_x": {**PRODUCTION["acceleration_x"], "noise": (0.1472, _OLD)},
    "acceleration_y": {
        **PRODUCTION["acceleration_y"],
        "noise": (0.1472, _OLD),
        "bias": (0.2, "chosen: 20 mg, a sensor not quite level"),
    },
    "steer_angle": {
        **PRODUCTION["steer_angle"],
        "quantum": (0.00164, "chosen: 1.5 deg at the hand wheel, an early optical sensor"),
    },
    "wheel_speed": {
        **PRODUCTION["wheel_speed"],
        "noise": (0.4, "chosen: 0.5 % of 90 km/h"),
        "quantum": (0.05, "chosen: 0.06 km/h, an early bus"),
    },
}

PoorParameters = parameters_of(
    __name__,
    "PoorParameters",
    POOR,
    common={
        "sample_time": parameter(0.02, "s", "Time between messages", "chosen: an early bus", minimum=0.0),
        "latency": parameter(
            0.02, "s", "Latency of every message", "chosen: the latest of 5 to 20 ms in cars", minimum=0.0
        ),
    },
)


class Poor(Production):
    """Poor sensor cluster: noisy, biased, slow and delayed."""

    Parameters = PoorParameters
