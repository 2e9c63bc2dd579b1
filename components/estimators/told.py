"""Ideal estimator: true states, sampled at the message rate.

    output = x(t_k) from t_k + latency until the next message,     t_k = t_0 + k sample_time

In place of an estimator it keeps only the delay of the estimation, so that differences from it are estimation
errors. With zero sample time and latency a run equals that with the true values. Friction is not a signal of
the car: it comes as `friction_true`, from a road or as a constant.

Inputs are the true values, named `*_true`, as those of sensors: `{from: plant.*, to: estimator.*_true}`.

Source: sampling and latency as in `sensing.channel`, equation (4) there.
"""

from dataclasses import dataclass

from yawbench.vocabulary.signals import SIGNALS

from ..estimation.estimator import NAMES
from ..fmi.component import Component
from ..fmi.variables import output, parameter, signal
from ..sensing.channel import Channel, ChannelSpec

KNOWN = (*NAMES, "friction")
NEEDED = ("velocity_x", "sideslip")
"""Signals that every car has; others are zero if the car lacks them."""


@dataclass(frozen=True)
class ToldParameters:
    """Parameters of the messages."""

    sample_time: float = parameter(
        0.01, "s", "Time between messages, 0: at every communication point", "chosen: as of sensors",
        minimum=0.0,
    )  # fmt: skip
    latency: float = parameter(0.0, "s", "Latency of every message", "chosen: none", minimum=0.0)


class Told(Component):
    """Ideal estimator: true states, sampled at the message rate and delayed."""

    Parameters = ToldParameters
    sampled = True
    inputs = tuple(
        signal(
            f"{name}_true", SIGNALS[name].unit, f"True: {SIGNALS[name].text}",
            optional=name not in (*NEEDED, "friction"),
        )
        for name in KNOWN
    )  # fmt: skip
    outputs = tuple(output(name, f"{name}_true") for name in KNOWN)

    def start(self, t: float, u: list[float]) -> None:
        figures = ChannelSpec(sample_time=self.p.sample_time, latency=self.p.latency)
        self.channels = [Channel(figures, 0, t, value) for value in u]

    def advance(self, t: float, h: float, u: list[float]) -> None:
        for channel, value in zip(self.channels, u):  # noqa: B905 - strict= costs a tenth
            channel.advance(t, h, value)

    def output(self, t: float, u: list[float]) -> list[float]:
        return [channel.received for channel in self.channels]
