"""The sentence that says why a unit has failed, from what it has logged."""

from __future__ import annotations

import re

from .log import OK, PENDING, PROCESS, STATUS, Log, Message
from .slave import Status

_TELLS_WHEN = re.compile(r"^[^:]* failed at t = [^:]* s: ")


def describe(unit: str, what: str, time: float, status: Status, log: Log) -> str:
    """Return one sentence: unit, what failed, when, and the reason.

    Args:
        what: "step", "initialization", "setting inputs", ...
        time: beginning of the step [s].
    """
    errors = _latest(unit, log)
    if status != OK and errors and errors[0].time < log.time.value:
        errors = []  # the unit has gone on since
    if status == PENDING and not errors:
        reason = "the FMU wants to compute asynchronously, which is not supported"
    elif not errors:
        reason = f"the FMU returned {STATUS[status]} and gave no reason"
    else:
        ended = (m for m in errors if m.category == PROCESS)  # what the unit said before is told with it
        reason = " ".join(next(ended, errors[0]).text.split())
        if _TELLS_WHEN.match(reason):  # a component of this project: it knows where and when
            return f"{unit}: {reason.partition('; inputs: ')[0]}"
    return f"{unit}: {what} failed at t = {time:.9g} s: {reason}"


def _latest(unit: str, log: Log) -> list[Message]:
    """Return the errors that a unit has logged at the last instant at which it logged any."""
    errors = log.errors(unit)
    return [m for m in errors if m.time == errors[-1].time]
