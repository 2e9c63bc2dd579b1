"""Runs on a Dask cluster; needs the package distributed.

The workers need this program, in this version, and nothing else: plans travel with their tasks, the
FMUs once to every worker, which unpacks them into its own cache. As on this machine every run has a
process of its own, so a unit that crashes takes no worker with it.
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
from ..errors import ResultsError, ScenarioError
from ..fmu.archive import open_fmu, read_archive
from ..master.process_state import terminable
from ..messages import listed
from ..plan import Plan
from .jobs import Job, OnOutcome, Outcome
from .workers import execute

TIMEOUT = 10.0
"""Time that a scheduler has to answer [s]."""
AHEAD = 4
"""Runs handed to the cluster ahead of time, for each thread of its workers."""

_LOCAL: dict[str, Path] = {}
"""On a worker: hash of an FMU -> where it is unpacked."""


def run_on_cluster(jobs: Sequence[Job], done: OnOutcome, *, scheduler: str) -> None:
    """Make all runs on the workers of a Dask scheduler.

    Args:
        jobs: what to run.
        done: called with every outcome as it comes.
        scheduler: its address, tcp://host:port.

    Raises:
        ScenarioError: no scheduler answers, or its workers do not fit.
        ResultsError: the cluster was lost on the way.
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
    """Return what a worker handed back, or why it handed back nothing."""
    if future.status == "cancelled" or future.status == "lost":
        raise ResultsError(f"{scheduler}: the cluster was lost; what it had finished is kept.")
    error = future.exception() if future.status == "error" else None
    if isinstance(error, distributed.KilledWorker):
        return Outcome(job, ("the workers that made this run died",), 1, died=True)
    if error is not None:
        text = " ".join(str(error).split())
        raise ResultsError(f"{scheduler}: a worker failed: {type(error).__name__}: {text}")
    return replace(future.result(), job=job)


def _make(job: Job) -> Outcome:
    """Make a run on a worker, in a process of its own."""
    assert job.plan is not None
    here = replace(job, plan=_unpacked_here(job.plan))
    (outcome,) = execute([here], workers=1)
    return replace(outcome, job=replace(job, plan=None))  # the plan is known where it came from


def _unpacked_here(plan: Plan) -> Plan:
    units = tuple(
        replace(unit, fmu=replace(unit.fmu, directory=_LOCAL[unit.fmu.sha256])) for unit in plan.instances
    )
    return replace(plan, instances=units)


class _Archives(distributed.WorkerPlugin):
    """A plugin of Dask's workers that unpacks FMUs before the first run starts.

    Args:
        archives: hash -> content.
    """

    def __init__(self, archives: dict[str, bytes]) -> None:
        self.archives = archives
        self.name = "yawbench-fmus"
        self.idempotent = False

    def setup(self, worker: Any) -> None:
        """Called on every worker, those too that join later."""
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
            f"--scheduler {address}: no Dask scheduler answers there within {TIMEOUT:g} s{reason}"
        ) from None
    log = logging.getLogger("distributed.client")
    level = log.level
    log.setLevel(logging.CRITICAL)  # it logs tracebacks when the scheduler is lost; the runs tell of that
    try:
        with client:
            yield client
    finally:
        log.setLevel(level)


def _check_workers(client: Any, address: str) -> int:
    """Return the number of threads of all workers, after making sure that they can do the work."""
    threads = sum(client.nthreads().values())
    if not threads:
        raise ScenarioError(f"--scheduler {address}: this scheduler has no workers")
    here = ours()
    for worker, theirs in client.run(versions, on_error="return").items():
        if isinstance(theirs, OSError):  # it is gone, or begins anew; runs go to the others
            continue
        if isinstance(theirs, Exception):  # whatever a worker without this program says
            text = " ".join(str(theirs).split())
            raise ScenarioError(
                f"--scheduler {address}: its workers cannot run this program; "
                f"is yawbench installed there? ({text})"
            )
        differs = [f"{k} {theirs.get(k)} there, {here[k]} here" for k in here if theirs.get(k) != here[k]]
        if differs:
            raise ScenarioError(f"--scheduler {address}: worker {worker} does not fit: {listed(differs)}")
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
"""What the workers' versions are compared with."""
