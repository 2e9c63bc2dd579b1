"""Ideal sensors: every signal as it is, at once.

The cluster of `sensors.production` with all figures without effect and accelerometers that do not feel
gravity, so a run with it in the loop is that without it, to the bit. Where a figure is set, it alone acts:
a sample time and a latency show what time costs, noise on the gyro what that noise costs.
"""

from ..fmi.variables import parameter
from ..sensing.cluster_parameters import parameters_of
from .production import Production

IdealParameters = parameters_of(
    __name__,
    "IdealParameters",
    {},
    common={
        "feels_gravity": parameter(
            False,
            None,
            "The accelerometers roll and pitch with the body and feel gravity",
            "chosen: the acceleration as it is",
        )
    },
)


class Ideal(Production):
    """Ideal sensors: every signal as it is, at once, unless a figure is set."""

    Parameters = IdealParameters
