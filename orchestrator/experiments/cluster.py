"""Execution of runs on a Dask cluster; needs the package `distributed`.

Workers only need the same version of this program: plans travel with their tasks, and every FMU is sent
once to each worker, which unpacks it into its own cache. As with local runs, each run has its own
process, so an FMU that crashes does not take the worker down.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import logging
import os
import platform
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import distributed

from ..cache import OF_METRICS, sources_hash
from ..errors import Diagnostic, ResultsError, ScenarioError
from ..fmu.archive import open_fmu, read_archive
from ..interrupts import terminable
from ..messages import listed
from ..plan import Plan
from .jobs import Job, OnOutcome, Outcome, execute

TIMEOUT = 10.0
"""Time limit for connecting to the scheduler [s]."""
AHEAD = 4
"""Runs submitted ahead of time per worker thread."""

_LOCAL: dict[str, Path] = {}
"""On a worker: SHA-256 of an FMU -> the folder it is unpacked in."""


def run_on_cluster(jobs: Sequence[Job], done: OnOutcome, *, scheduler: str) -> None:
    """Execute jobs on the workers of a Dask scheduler.

    Args:
        jobs: the runs.
        done: called with each outcome as it arrives.
        scheduler: address, tcp://host:port.

    Raises:
        ScenarioError: no scheduler answers, or its workers are incompatible.
        ResultsError: the connection to the cluster was lost.
        KeyboardInterrupt: Ctrl-C or SIGTERM.
    """
    fmus = {unit.fmu.sha256: unit.fmu for job in jobs if job.plan for unit in job.plan.instances}
    with _connected(scheduler) as client, terminable():
        threads = _check_workers(client, scheduler)
        client.register_plugin(_Archives({digest: read_archive(fmu.path) for digest, fmu in fmus.items()}))
        _submit_all(client, jobs, done, scheduler, AHEAD * threads)


def _submit_all(client: Any, jobs: Sequence[Job], done: OnOutcome, scheduler: str, ahead: int) -> None:
    waiting = iter(jobs)
    named: dict[str, Job] = {}

    def submit(job: Job) -> Any:
        future = client.submit(_make, job, key=f"yawbench-{os.getpid()}-{job.key}", pure=False, retries=0)
        named[future.key] = job
        return future

    futures = [submit(job) for job in itertools.islice(waiting, ahead)]
    completed = distributed.as_completed(futures)
    try:
        for future in completed:
            done(_outcome(future, named.pop(future.key), scheduler))
            future.release()
            if (following := next(waiting, None)) is not None:
                completed.add(submit(following))
    except KeyboardInterrupt:
        client.cancel(list(completed.futures))
        raise


def _outcome(future: Any, job: Job, scheduler: str) -> Outcome:
    """Return the outcome that a worker reported, or the reason why it reported none."""
    if future.status == "cancelled" or future.status == "lost":
        raise ResultsError(
            f"{scheduler}: the cluster was lost; what it had finished is kept.", code="runs-missing"
        )
    error = future.exception() if future.status == "error" else None
    if isinstance(error, distributed.KilledWorker):
        lost = Diagnostic("run-process-died", "the workers that made this run died")
        return Outcome(job, (lost,), 1, died=True)
    if error is not None:
        text = " ".join(str(error).split())
        raise ResultsError(
            f"{scheduler}: a worker failed: {type(error).__name__}: {text}", code="runs-missing"
        )
    return replace(future.result(), job=job)


def _make(job: Job) -> Outcome:
    """Execute a run on a worker, in a separate process."""
    assert job.plan is not None
    here = replace(job, plan=_unpacked_here(job.plan))
    (outcome,) = execute([here], workers=1)
    return replace(outcome, job=replace(job, plan=None))  # the caller has the plan: do not send it back


def _unpacked_here(plan: Plan) -> Plan:
    units = tuple(
        replace(unit, fmu=replace(unit.fmu, directory=_LOCAL[unit.fmu.sha256])) for unit in plan.instances
    )
    return replace(plan, instances=units)


class _Archives(distributed.WorkerPlugin):
    """Dask worker plugin that unpacks the FMUs before the first run starts.

    Args:
        archives: SHA-256 -> content of the FMU.
    """

    def __init__(self, archives: dict[str, bytes]) -> None:
        self.archives = archives
        self.name = "yawbench-fmus"
        self.idempotent = False

    def setup(self, worker: Any) -> None:
        """Unpack the FMUs; Dask calls this on every worker, including those that join later."""
        with tempfile.TemporaryDirectory() as folder:
            for digest, content in self.archives.items():
                path = Path(folder, f"{digest}.fmu")
                path.write_bytes(content)
                _LOCAL[digest] = open_fmu(path, validate=False).directory


@contextlib.contextmanager
def _connected(address: str) -> Iterator[Any]:
    """Connect to a scheduler while the block runs."""
    try:
        client = distributed.Client(address, timeout=TIMEOUT)
    except (OSError, TimeoutError, asyncio.TimeoutError, ValueError, TypeError) as error:
        reason = f": {' '.join(str(error).split())}" if isinstance(error, ValueError) else ""
        raise ScenarioError(
            f"--scheduler {address}: no Dask scheduler answers there within {TIMEOUT:g} s{reason}",
            code="cluster-unavailable",
        ) from None
    log = logging.getLogger("distributed.client")
    level = log.level
    log.setLevel(logging.CRITICAL)  # it logs tracebacks when the scheduler is lost, which we report
    try:
        with client:
            yield client
    finally:
        log.setLevel(level)


def _check_workers(client: Any, address: str) -> int:
    """Check that all workers are compatible and return their number of threads."""
    threads = sum(client.nthreads().values())
    if not threads:
        raise ScenarioError(
            f"--scheduler {address}: this scheduler has no workers", code="cluster-unavailable"
        )
    here = ours()
    for worker, theirs in client.run(versions, on_error="return").items():
        if isinstance(theirs, OSError):  # it has gone or is restarting; runs go to the others
            continue
        if isinstance(theirs, Exception):  # any error of a worker without this program
            text = " ".join(str(theirs).split())
            raise ScenarioError(
                f"--scheduler {address}: its workers cannot run this program; "
                f"is yawbench installed there? ({text})",
                code="cluster-unavailable",
            )
        differs = [f"{k} {theirs.get(k)} there, {here[k]} here" for k in here if theirs.get(k) != here[k]]
        if differs:
            raise ScenarioError(
                f"--scheduler {address}: worker {worker} does not fit: {listed(differs)}",
                code="cluster-unavailable",
            )
    return threads


def versions() -> dict[str, str]:
    """Return the versions that must be the same on every worker."""
    python = ".".join(platform.python_version_tuple()[:2])
    return {
        "Python": python,
        "yawbench": version("yawbench"),
        "orchestrator": f"sources {sources_hash(OF_METRICS)}",
        "pythonfmu": version("pythonfmu"),
    }


ours = versions
"""The versions here, which those of the workers must match."""
