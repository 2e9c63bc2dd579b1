"""Execution of runs on a Dask cluster; needs the package `distributed`.

Workers only need the same version of this program: every FMU is sent once to each worker, with its
description, and the worker unpacks it into its own cache. Runs travel in batches, which refer to the FMUs and
are compressed bytes: a scheduler unpickles the arguments of tasks, pickles them again, and keeps the last
thousand messages to each worker. As with local runs, they are made by processes that the worker starts
(`execute`) and keeps from one batch to the next, so an FMU that crashes does not take it down.
"""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
import itertools
import logging
import os
import pickle
import platform
import tempfile
import threading
import zlib
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import distributed

from yawbench.fmus.archive import open_fmu, read_archive
from yawbench.fmus.fmu import Fmu
from yawbench.foundation.cache import OF_METRICS, sources_hash
from yawbench.foundation.errors import Diagnostic, ResultsError, ScenarioError
from yawbench.foundation.interrupts import terminable
from yawbench.foundation.messages import listed
from yawbench.foundation.processes import pickled
from yawbench.foundation.workers import Pool
from yawbench.studies.jobs import LASTING, NEEDED, Job, OnOutcome, Outcome, execute

TIMEOUT = 10.0
"""Time limit for connecting to the scheduler [s]."""
AHEAD = 3
"""Batches of runs submitted ahead of time per worker thread."""
BATCH_TIME = 2.0
"""Time that a batch takes a worker [s]; chosen: long beside the scheduler's few milliseconds, short for a
user who watches the progress."""
LARGEST_BATCH = 200
"""Largest number of runs in a batch."""

_UNPACKED: dict[str, Fmu] = {}
"""On a worker: key of an FMU -> the FMU in this machine's cache."""
_NO_JOB = Job("", Path(), Path())
"""Stand-in for the job in outcomes that travel back: the caller has the jobs."""


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
    parcels = _Parcels(jobs)
    with _connected(scheduler) as client, terminable():
        threads = _check_workers(client, scheduler)
        client.register_plugin(_Fmus(parcels.fmus))
        _submit_all(client, jobs, done, scheduler, threads, parcels)


class _Parcels:
    """Packs batches of jobs.

    Args:
        jobs: all that will be packed.
    """

    def __init__(self, jobs: Sequence[Job]) -> None:
        every = {
            id(instance.fmu): instance.fmu for job in jobs if job.plan for instance in job.plan.instances
        }
        self._keys = {number: hashlib.sha256(pickle.dumps(fmu)).hexdigest() for number, fmu in every.items()}
        self.fmus = {self._keys[number]: fmu for number, fmu in every.items()}

    def pack(self, batch: Sequence[Job]) -> bytes:
        """Return a batch as bytes, which `_unpack` reads where the FMUs are known."""
        return zlib.compress(pickled(batch, lambda fmu: (_fmu, (self._keys[id(fmu)],))))


def _unpack(parcel: bytes) -> list[Job]:
    batch: list[Job] = pickle.loads(zlib.decompress(parcel))
    return batch


class _Batches:
    """The runs that are still to be submitted, in batches that keep a worker busy for `BATCH_TIME`."""

    def __init__(self, jobs: Sequence[Job], threads: int) -> None:
        self._waiting = iter(jobs)
        self._left = len(jobs)
        self._alone: deque[Job] = deque()
        self._threads = threads
        self._seconds, self._runs = 0.0, 0  # of finished runs

    def next(self) -> list[Job]:
        """Return the next batch; it is empty if there are no more."""
        if self._alone:
            return [self._alone.popleft()]
        size = 1.0
        if self._runs:
            in_time = BATCH_TIME * self._runs / max(self._seconds, 1e-9)
            share = self._left / (AHEAD * self._threads)  # lest workers wait for one at the end
            size = max(1.0, min(in_time, share, LARGEST_BATCH))
        batch = [*itertools.islice(self._waiting, int(size))]
        self._left -= len(batch)
        return batch

    def note(self, outcomes: Sequence[Outcome]) -> None:
        """Learn how long runs take."""
        self._seconds += sum(outcome.seconds for outcome in outcomes)
        self._runs += len(outcomes)

    def divide(self, batch: Sequence[Job]) -> None:
        """Have each run of a batch submitted by itself, before all others."""
        self._alone.extend(batch)


def _submit_all(
    client: Any, jobs: Sequence[Job], done: OnOutcome, scheduler: str, threads: int, parcels: _Parcels
) -> None:
    batches = _Batches(jobs, threads)
    submitted: dict[str, list[Job]] = {}
    numbers = itertools.count()
    completed = distributed.as_completed()

    def submit() -> None:
        while len(submitted) < AHEAD * threads and (batch := batches.next()):
            key = f"yawbench-{os.getpid()}-{next(numbers)}-{batch[0].key}"
            submitted[key] = batch
            completed.add(client.submit(_make, parcels.pack(batch), key=key, pure=False, retries=0))

    submit()
    try:
        for future in completed:
            batch = submitted.pop(future.key)
            outcomes = _outcomes(future, batch, scheduler)
            future.release()
            if outcomes is None:
                batches.divide(batch)
            else:
                batches.note(outcomes)
                for outcome in outcomes:
                    done(outcome)
            submit()
    except KeyboardInterrupt:
        client.cancel(list(completed.futures))
        raise


def _outcomes(future: Any, batch: Sequence[Job], scheduler: str) -> list[Outcome] | None:
    """Return the outcomes that a worker reported; None if the workers died of one of several runs."""
    if future.status == "cancelled" or future.status == "lost":
        raise ResultsError(f"{scheduler}: the connection lost; finished runs are kept.", code="runs-missing")
    error = future.exception() if future.status == "error" else None
    if isinstance(error, distributed.KilledWorker):
        if len(batch) > 1:
            return None
        lost = Diagnostic("run-process-died", "the workers that made this run died")
        return [Outcome(batch[0], (lost,), 1, died=True)]
    if error is not None:
        text = " ".join(str(error).split())
        raise ResultsError(
            f"{scheduler}: a worker failed: {type(error).__name__}: {text}", code="runs-missing"
        )
    return [replace(outcome, job=job) for outcome, job in zip(future.result(), batch, strict=True)]


class _Pools:
    """On a worker: a process per thread, which makes one run after the other, of this batch and the next."""

    def __init__(self) -> None:
        self._of_thread: dict[int, Pool] = {}

    def execute(self, batch: Sequence[Job]) -> list[Outcome]:
        """Execute the runs of a batch in the process of this thread."""
        thread = threading.get_ident()
        if thread not in self._of_thread:
            self._of_thread[thread] = Pool(1, preload=NEEDED, lasting=LASTING)
        try:
            return execute(batch, pool=self._of_thread[thread])
        except BaseException:
            self._of_thread.pop(thread).end()  # it may still make a run
            raise

    def end(self) -> None:
        """End the processes."""
        while self._of_thread:
            self._of_thread.popitem()[1].end()


_POOLS = _Pools()


def _make(parcel: bytes) -> list[Outcome]:
    """Execute runs on a worker, one after the other."""
    return [replace(outcome, job=_NO_JOB) for outcome in _POOLS.execute(_unpack(parcel))]


def _fmu(key: str) -> Fmu:
    return _UNPACKED[key]


class _Fmus(distributed.WorkerPlugin):
    """Dask worker plugin that unpacks the FMUs before the first run starts.

    Args:
        fmus: key -> FMU.
    """

    def __init__(self, fmus: Mapping[str, Fmu]) -> None:
        self.fmus = {key: (fmu, read_archive(fmu.path)) for key, fmu in fmus.items()}
        # those of another campaign are still needed by workers that join later
        self.name = f"yawbench-{hashlib.sha256(''.join(sorted(fmus)).encode()).hexdigest()[:16]}"
        self.idempotent = False

    def setup(self, worker: Any) -> None:
        """Unpack the FMUs; Dask calls this on every worker, including those that join later."""
        with tempfile.TemporaryDirectory() as folder:
            for key, (fmu, content) in self.fmus.items():
                path = Path(folder, f"{fmu.sha256}.fmu")
                path.write_bytes(content)
                _UNPACKED[key] = replace(fmu, directory=open_fmu(path, validate=False).directory)

    def teardown(self, worker: Any) -> None:
        """End the processes of runs; Dask calls this when the worker is closed."""
        _POOLS.end()


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
    threads: int = sum(client.nthreads().values())
    if not threads:
        raise ScenarioError(
            f"--scheduler {address}: this scheduler has no workers", code="cluster-unavailable"
        )
    here = versions()
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
