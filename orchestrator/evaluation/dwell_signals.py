"""Signals as the regulation on electronic stability control wants them: filtered, sampled evenly.

Cut-off frequencies of GTR 8: hand-wheel angle 10 Hz, yaw rate and lateral acceleration 6 Hz. Unfiltered
signals change a yaw-rate ratio by up to 0.8 points, another order or cut-off by 0.1 points at most.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from .filters import SLOWEST, low_pass
from .judgement import NotJudged
from .trace import Trace

CUT_OFF = {"steering_wheel_angle": 10.0, "yaw_rate": 6.0, "acceleration_y": 6.0}
"""Of the low pass [Hz]."""
SHORTEST = 1.0
"""Record without which there is nothing to filter [s]."""


def prepared(trace: Trace, names: Iterable[str]) -> dict[str, np.ndarray]:
    """Return the signals of a trace behind their filters, and `time`.

    Raises:
        NotJudged: the record is too short or too coarse.
        ResultsError: a signal is missing.
    """
    wanted = [(name, trace[name]) for name in names]
    if trace.time.size < 2 or trace.time[-1] - trace.time[0] < SHORTEST:
        raise NotJudged(f"the record is shorter than {SHORTEST:g} s")
    if trace.rate < SLOWEST:
        raise NotJudged(f"sampled at {trace.rate:.3g} Hz; at least {SLOWEST:g} Hz are needed")
    even = trace.even
    filtered = {name: low_pass(even[name], CUT_OFF[name], even.rate) for name, _ in wanted}
    return {"time": even.time, **filtered}
