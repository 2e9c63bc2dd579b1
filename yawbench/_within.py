"""Calls with a deadline, for code that may never return."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from yawbench.foundation.errors import YawbenchError
from yawbench.foundation.processes import ProcessLost, call_in_copy

from . import arguments as checked


def within(limit: float, function: Callable[..., Any], *arguments: Any) -> Any:
    """Call a function in a copy of this process, which ends with the call or at a deadline; return its value.

        >>> def area(width, height):
        ...     return width * height
        >>> yb.within(60, area, 2.0, 3.0)
        6.0

    For code of others that is run as it is, such as the laws of an exercise: it can neither keep this process
    nor end it. What it changes in memory is lost with the copy.

    Args:
        limit: time that the function has [s].
        function: anything that can be called; its value must be possible to pickle.
        arguments: of the function.

    Raises:
        YawbenchError: it did not return in time, or ended its process.
        Exception: raised by the function; as a `RuntimeError` with its traceback if it cannot be pickled, or
            if its class is one of the copy alone.
    """
    with checked.as_scenario_errors():
        seconds = checked.number(limit, "limit")
        if not seconds > 0.0:
            raise ValueError(f"limit: must be above 0 s (got {limit!r})")
        if not callable(function):
            checked.refuse("function", "something that can be called", function)
    try:
        return call_in_copy(function, arguments, seconds)
    except ProcessLost as lost:
        name = getattr(function, "__name__", "the function")
        how = f"did not return within {seconds:g} s" if lost.late else str(lost)
        code = "call-late" if lost.late else "run-process-died"
        raise YawbenchError(f"{name} {how}", code=code) from None
