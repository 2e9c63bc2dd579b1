"""The process that stands between master and unit, so that nothing a unit has started outlives it.

Every isolated unit has one, forked before the FMU is loaded, and costs an exchange nothing: it
sleeps until the unit's process has ended or the master has (even by SIGKILL), then kills what is left.
On Linux that is all descendants, daemons too: they become its children when their parents die.
Elsewhere it is the unit's process group.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import resource
import select
import signal
import sys
import time
from collections.abc import Iterable
from pathlib import Path

_PR_SET_PDEATHSIG, _PR_SET_CHILD_SUBREAPER = 1, 36  # linux/prctl.h
PATIENCE = 2.0
"""Time for which what is left is killed [s]: something may start processes faster than they end."""


def stand_guard(reading: int, others: Iterable[int]) -> None:
    """Fork; return in the child, which is to be the unit's process, and never in the guardian.

    Args:
        reading: pipe from the master; when it has no writer any more, the master is gone.
        others: descriptors that only the unit's process needs.
    """
    _prctl(_PR_SET_CHILD_SUBREAPER, 1)
    waking, woken = os.pipe()
    os.set_blocking(woken, False)
    signal.signal(signal.SIGCHLD, lambda number, frame: None)
    signal.set_wakeup_fd(woken, warn_on_full_buffer=False)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    guardian = os.getpid()
    unit = os.fork()
    if unit:
        try:
            _watch(unit, reading, waking, others)
        finally:
            os._exit(1)
    signal.set_wakeup_fd(-1)
    for number in (signal.SIGCHLD, signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)
    for descriptor in (waking, woken):
        os.close(descriptor)
    for descriptor in (reading, *others):
        os.set_inheritable(descriptor, False)  # by programs that the FMU starts
    os.setsid()  # what it sends to its group is not for the guardian
    die_with_parent()
    if os.getppid() != guardian:
        os._exit(1)


def _watch(unit: int, reading: int, waking: int, others: Iterable[int]) -> None:
    """Wait for the unit's process or the master to end; kill what is left; end as the unit's did."""
    for descriptor in others:
        os.close(descriptor)
    events = select.poll()
    events.register(reading, 0)  # nothing is asked for, so what comes is the end of the pipe
    events.register(waking, select.POLLIN)
    ended: dict[int, int] = {}
    while unit not in ended:
        ready = [descriptor for descriptor, _ in events.poll()]
        _reap(ended)
        if reading in ready:
            break
        os.read(waking, 512)
    _kill_all(unit, ended)
    code = os.waitstatus_to_exitcode(ended.get(unit, 0))
    if code >= 0:
        os._exit(code)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with contextlib.suppress(OSError, ValueError):
        signal.signal(-code, signal.SIG_DFL)
    os.kill(os.getpid(), -code)
    os._exit(128 - code)


def _kill_all(unit: int, ended: dict[int, int]) -> None:
    """Kill the unit's process and all that it has started."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        with contextlib.suppress(OSError):
            os.killpg(unit, signal.SIGKILL)
        for child in _children():
            with contextlib.suppress(OSError):
                os.kill(child, signal.SIGKILL)
        if not _reap(ended):
            break
        time.sleep(0.001)


def _children() -> list[int]:
    try:
        return [int(word) for word in Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()]
    except OSError:  # not Linux
        return []


def _reap(ended: dict[int, int]) -> bool:
    """Note how children have ended that did; return whether there are more."""
    with contextlib.suppress(ChildProcessError):
        while (child := os.waitpid(-1, os.WNOHANG))[0]:
            ended.setdefault(*child)
        return True
    return False


def die_with_parent() -> None:
    """Let this process be killed when the one that has forked it ends (Linux)."""
    _prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def _prctl(option: int, value: int) -> None:
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(option, value, 0, 0, 0)
