"""Ideal sensor cluster: true signals without delay.

The cluster of `sensors.production` without any effect, and with accelerometers that do not measure gravity,
so that a run with it equals the run without it, to the bit. Single properties can be set to study their
effect: sample time and latency, or the noise of the gyro.
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
            "Whether the accelerometers roll and pitch with the body and measure gravity",
            "chosen: the true acceleration",
        )
    },
)


class Ideal(Production):
    """Ideal sensor cluster: true signals without delay, unless a property is set."""

    Parameters = IdealParameters
