"""Parameters of a sensor cluster, created from a table of the properties of its channels.

    YAW_RATE_NOISE = {"yaw_rate": {"noise": (0.0017, "a data sheet")}}
    parameters_of(__name__, "NoisyParameters", YAW_RATE_NOISE)

is a dataclass with the nine properties of every channel (`sensing.channel.ChannelSpec`), all without effect
except the noise of the gyro, and the common parameters of a cluster.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

from ..fmi.variables import parameter, parameter_class
from .channel import ChannelSpec


class MeasuredSignal(NamedTuple):
    """Measured signal: its unit, the unit of its drift, and the name of its sensor."""

    unit: str
    rate_unit: str
    text: str


CHANNELS = {
    "yaw_rate": MeasuredSignal("rad/s", "rad/s2", "gyro"),
    "acceleration_x": MeasuredSignal("m/s2", "m/s3", "longitudinal accelerometer"),
    "acceleration_y": MeasuredSignal("m/s2", "m/s3", "lateral accelerometer"),
    "steer_angle": MeasuredSignal("rad", "rad/s", "hand-wheel sensor (at the road wheels)"),
    "wheel_speed": MeasuredSignal("rad/s", "rad/s2", "wheel-speed sensors"),
    "brake_pressure": MeasuredSignal("Pa", "Pa/s", "brake-pressure sensors"),
}
"""Signal, without `_*` for four wheels -> its measurement."""

Figures = Mapping[str, Mapping[str, tuple[float, str]]]
"""Channel -> property -> value in SI units, and its source."""

NONE = "chosen: none"


def parameters_of(module: str, name: str, by_channel: Figures, *, common: Mapping[str, Any]) -> type:
    """Create a dataclass with the properties of every channel; properties not given have no effect.

    Args:
        module, name: of the class.
        by_channel: properties of the channels.
        common: name -> common parameter of the cluster; missing ones are taken from `COMMON`.
    """
    fields: dict[str, Any] = {**COMMON, **common}
    for channel, (unit, rate_unit, text) in CHANNELS.items():
        figures = by_channel.get(channel, {})
        for figure, (unit_of_it, what, least) in _FIGURES.items():
            default, source = figures.get(figure, (getattr(ChannelSpec(), figure), NONE))
            fields[f"{channel}_{figure}"] = parameter(
                default,
                {"signal": unit, "rate": rate_unit}.get(unit_of_it, unit_of_it),
                what.format(text),
                source,
                minimum=least,
            )
    made: type = parameter_class(module, name, fields)
    return made


_FIGURES = {
    "bandwidth": ("Hz", "Frequency (-3 dB) of the low pass of the {}, 0: none", 0.0),
    "gain": ("1", "Measured over true value of the {}", None),
    "bias": ("signal", "Bias of the {}", None),
    "drift": ("rate", "Drift of the bias of the {}", None),
    "noise": ("signal", "Noise of the {}, root mean square", 0.0),
    "range": ("signal", "Largest magnitude measured by the {}, from its offset, 0: unlimited", 0.0),
    "quantum": ("signal", "Resolution of the {}, 0: unlimited", 0.0),
    "offset": ("signal", "Value from which messages of the {} count", None),
    "sample_time": ("s", "Time between messages of the {}, 0: that of the cluster", 0.0),
    "latency": ("s", "Latency of the {} beyond that of the cluster", 0.0),
}
"""Property -> unit, text, smallest value."""

COMMON = {
    "seed": parameter(1, None, "Seed of the noise", "chosen: arbitrary"),
    "sample_time": parameter(
        0.0, "s", "Time between messages, 0: at every communication point", NONE, minimum=0.0
    ),
    "latency": parameter(0.0, "s", "Latency of every message", NONE, minimum=0.0),
    "feels_gravity": parameter(
        True,
        None,
        "Whether the accelerometers roll and pitch with the body and measure gravity",
        "chosen: they are fixed to the body",
    ),
}
"""Parameters of every cluster."""


def figures_of(p: Any) -> dict[str, ChannelSpec]:
    """Return the properties of every channel from the parameters `p` of a cluster.

    Raises:
        ValueError: a channel with noise has no sample time, so its noise would depend on the step size.
    """
    made = {}
    for channel in CHANNELS:
        own = {figure: getattr(p, f"{channel}_{figure}") for figure in _FIGURES}
        own["sample_time"] = own["sample_time"] or p.sample_time
        own["latency"] += p.latency
        if own["noise"] and not own["sample_time"]:
            raise ValueError(
                f"{channel}_noise needs a sample_time above 0 s, or one of the channel: noise of every "
                "communication point would change with the step size"
            )
        made[channel] = ChannelSpec(**own)
    return made
