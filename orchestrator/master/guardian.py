"""A guardian process between master and isolated instance: nothing that the FMU has started outlives it.

It is forked before the FMU is loaded and adds nothing to the cost of an exchange: it sleeps until the
instance's process or the master has ended (even by SIGKILL), then kills what is left. On Linux these are all
descendants, daemons too, which become its children when their parents die; elsewhere it is the process group
of the instance.
"""

from __future__ import annotations

import contextlib
import os
import resource
import select
import signal
import time
from collections.abc import Iterable
from pathlib import Path

from ..processes import die_with_parent, prctl

_PR_SET_CHILD_SUBREAPER = 36  # linux/prctl.h
PATIENCE = 2.0
"""Time spent on killing descendants [s]: a process may start new ones faster than they can be killed."""


def stand_guard(reading: int, others: Iterable[int]) -> None:
    """Fork a guardian; return only in the child, which becomes the instance's process.

    Args:
        reading: pipe from the master; it closes when the master ends.
        others: descriptors that only the instance's process needs.
    """
    prctl(_PR_SET_CHILD_SUBREAPER, 1)
    waking, woken = os.pipe()
    os.set_blocking(woken, False)
    signal.signal(signal.SIGCHLD, lambda number, frame: None)
    signal.set_wakeup_fd(woken, warn_on_full_buffer=False)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    guardian = os.getpid()
    child = os.fork()
    if child:
        try:
            _watch(child, reading, waking, others)
        finally:
            os._exit(1)
    signal.set_wakeup_fd(-1)
    for number in (signal.SIGCHLD, signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)
    for descriptor in (waking, woken):
        os.close(descriptor)
    for descriptor in (reading, *others):
        os.set_inheritable(descriptor, False)  # not by programs that the FMU starts
    os.setsid()  # signals to its group must not reach the guardian
    die_with_parent()
    if os.getppid() != guardian:
        os._exit(1)


def _watch(process: int, reading: int, waking: int, others: Iterable[int]) -> None:
    """Wait until the instance's process or the master ends; kill what is left; exit with the same status."""
    for descriptor in others:
        os.close(descriptor)
    events = select.poll()
    events.register(reading, 0)  # no events requested: only the end of the pipe is reported
    events.register(waking, select.POLLIN)
    ended: dict[int, int] = {}
    while process not in ended:
        ready = [descriptor for descriptor, _ in events.poll()]
        _reap(ended)
        if reading in ready:
            break
        os.read(waking, 512)
    _kill_all(process, ended)
    code = os.waitstatus_to_exitcode(ended.get(process, 0))
    if code >= 0:
        os._exit(code)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with contextlib.suppress(OSError, ValueError):
        signal.signal(-code, signal.SIG_DFL)
    os.kill(os.getpid(), -code)
    os._exit(128 - code)


def _kill_all(process: int, ended: dict[int, int]) -> None:
    """Kill the instance's process and everything it has started."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        with contextlib.suppress(OSError):
            os.killpg(process, signal.SIGKILL)
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
    """Collect the exit statuses of ended children; return whether children are left."""
    with contextlib.suppress(ChildProcessError):
        while (child := os.waitpid(-1, os.WNOHANG))[0]:
            ended.setdefault(*child)
        return True
    return False
