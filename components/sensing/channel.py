"""Sensor channel: from a true signal to the messages that a control unit receives.

    low pass    x'' + sqrt(2) w x' + w^2 x = w^2 u           w = 2 pi bandwidth                  (1)
    measured    y_k = gain x(t_k) + bias + drift (t_k - t_0) + noise N_k       t_k = t_0 + k T    (2)
    message     m_k = offset + round(limit(y_k - offset) / quantum) quantum                      (3)
    received    m_k from t_k + latency until the next message is there                            (4)

A bandwidth, noise, range, quantum or latency of zero disables the effect; without a sample time T every
communication point is a message. The signal is linear between communication points and the low pass
(`mathematics.low_pass`) is solved exactly for that, so the times of messages do not depend on the step. N_k
is a function of k, not drawn from a stream (`sensing.noise`). The value of the first message is output from
the start; the low pass starts settled.
"""

from dataclasses import dataclass

from ..mathematics.low_pass import LowPass
from . import noise

SLACK = 1e-9
"""Tolerance [s] for comparing times; chosen: far below a step, far above rounding."""


@dataclass(frozen=True)
class ChannelSpec:
    """Properties of a channel; `unit` is that of its signal.

    Attributes:
        bandwidth: cutoff frequency of the low pass [Hz].
        gain: measured over true value [1].
        bias: offset [unit].
        drift: rate of the bias [unit/s].
        noise: root mean square [unit].
        range: largest distance of a message from the offset [unit].
        quantum: resolution of a message [unit].
        offset: value from which messages count [unit].
        sample_time: time between messages [s].
        latency: time from the sample to the arrival of the message [s].
    """

    bandwidth: float = 0.0
    gain: float = 1.0
    bias: float = 0.0
    drift: float = 0.0
    noise: float = 0.0
    range: float = 0.0
    quantum: float = 0.0
    offset: float = 0.0
    sample_time: float = 0.0
    latency: float = 0.0

    def measured(self, x: float, t: float, key: int, k: int) -> float:
        """Return message `k` of the filtered signal `x`, `t` [s] after the start; equations (2), (3)."""
        y = self.gain * x
        if self.bias or self.drift:
            y += self.bias + self.drift * t
        if self.noise:
            y += self.noise * noise.normal(key, k)
        if self.offset:
            y -= self.offset
        if self.range:
            y = min(max(y, -self.range), self.range)
        if self.quantum:
            y = round(y / self.quantum) * self.quantum
        return y + self.offset if self.offset else y


class Channel:
    """Messages of a signal.

    Args:
        figures: properties of the channel.
        key: key of its noise, see `sensing.noise.key`.
        t: start time t_0 [s].
        value: initial value of the signal.
    """

    def __init__(self, figures: ChannelSpec, key: int, t: float, value: float) -> None:
        self.figures, self.key, self.begin = figures, key, t
        self.signal = value
        self.filter = LowPass(figures.bandwidth, value) if figures.bandwidth else None
        self.received = figures.measured(value, 0.0, key, 0)
        self.number = 1  # of the next message
        self.under_way: list[tuple[float, float]] = []  # (arrival [s], message)

    def advance(self, t: float, h: float, value: float) -> None:
        """Advance the channel from `t` to `t + h` [s], where the signal has the value `value`."""
        if h <= 0.0:
            return
        end, figures = t + h, self.figures
        slope = (value - self.signal) / h
        now, here = t, self.signal
        while True:
            due = self.begin + self.number * figures.sample_time if figures.sample_time else end
            if due > end + SLACK:
                break
            last = due > end - SLACK
            at, there = (end, value) if last else (due, self.signal + slope * (due - t))
            self._filter(at - now, here, there)
            now, here = at, there
            x = there if self.filter is None else self.filter.x
            message = figures.measured(x, due - self.begin, self.key, self.number)
            self.under_way.append((due + figures.latency, message))
            self.number += 1
            if last and not figures.sample_time:
                break
        self._filter(end - now, here, value)
        self.signal = value
        while self.under_way and self.under_way[0][0] <= end + SLACK:
            self.received = self.under_way.pop(0)[1]

    def _filter(self, h: float, begin: float, end: float) -> None:
        if self.filter is not None and h > 0.0:
            self.filter.advance(h, begin, end)
