"""Cost of short runs on a Dask cluster of this machine: `python -m benchmarks.cluster [--runs 5000]`.

Starts a scheduler and two workers, runs a sweep there by the command line, and prints the memory of the
command and the scheduler and the scheduler's share of the time as the number of finished runs grows; the
largest memory of the command, which at its end writes the table and the page; the processor time of the
command, the scheduler and the workers with the processes that they start, from the first run to the last; and
what the scheduler needs without runs, measured while the command plans.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from time import perf_counter, sleep

import distributed
import psutil

from .runs import DEFAULT

WORKERS = 2
PARTS = 8
"""Equal parts of the runs, after each of which the memory is read."""


@contextmanager
def dask(what: str, file: Path, *options: str) -> Iterator[psutil.Process]:
    """Start a scheduler or a worker."""
    command = [sys.executable, "-m", f"distributed.cli.dask_{what}", "--scheduler-file", str(file)]
    local = ["--host", "127.0.0.1", "--dashboard-address", "127.0.0.1:0"]
    with subprocess.Popen([*command, *local, *options], stderr=subprocess.DEVNULL) as process:
        try:
            yield psutil.Process(process.pid)
        finally:
            process.terminate()


def processor_time(process: psutil.Process) -> float:
    """Return the processor time of a process and of all that it has started [s]."""
    while True:
        try:
            everyone = [one.cpu_times() for one in (process, *process.children(recursive=True))]
        except psutil.NoSuchProcess:  # a child has just ended: its time is its parent's now
            continue
        return sum(one.user + one.system + one.children_user + one.children_system for one in everyone)


def finished(journal: Path) -> Iterator[int]:
    """Yield the number of runs in a journal, whose first line is its head, reading what has been added."""
    while not journal.is_file():
        yield 0
    lines = 0
    with journal.open("rb") as file:
        while True:
            lines += file.read().count(b"\n")
            yield max(0, lines - 1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=5000)
    parser.add_argument("--stop", type=float, default=0.05, help="stop time of each run [s]")
    chosen = parser.parse_args()
    axis = {"vary": "plant.mass", "from": 1000, "to": 2000, "count": chosen.runs}
    sweep = {"title": "Short runs", "scenario": str(DEFAULT), "set": {"stop_time": chosen.stop}}
    metrics = {"sideslip": {"metric": "peak(sideslip)"}, "yaw_rate": {"metric": "rms(yaw_rate)"}}
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        file, out = folder / "sweep.yaml", folder / "out"
        file.write_text(json.dumps({**sweep, "axes": {"mass": axis}, "metrics": metrics}))
        cluster = folder / "scheduler.json"
        scheduler = stack.enter_context(dask("scheduler", cluster, "--port", "0"))
        workers = [stack.enter_context(dask("worker", cluster, "--nthreads", "1")) for _ in range(WORKERS)]
        with distributed.Client(scheduler_file=str(cluster), set_as_default=False) as client:
            client.wait_for_workers(WORKERS)
            address = client.scheduler.address
        command = [sys.executable, "-m", "yawbench", "sweep", str(file), "--out", str(out)]
        planning, idle = perf_counter(), processor_time(scheduler)
        with subprocess.Popen([*command, "--scheduler", address], stderr=subprocess.DEVNULL) as running:
            everyone = psutil.Process(running.pid), scheduler, *workers
            made = finished(out / "runs.jsonl")
            while not (done := next(made)):
                assert running.poll() is None
                before, began = [*map(processor_time, everyone)], perf_counter()
                sleep(0.05)
            idle = (before[1] - idle) / (began - planning)
            for part in range(PARTS + 1):
                while done < part * chosen.runs // PARTS:
                    assert running.poll() is None
                    sleep(0.05)
                    done = next(made)
                wall = perf_counter() - began
                spent = [processor_time(one) - start for one, start in zip(everyone, before, strict=True)]
                memory = [one.memory_info().rss / 1e6 for one in everyone[:2]]
                print(
                    f"after {done:6d} runs, {wall:.0f} s: command {memory[0]:.0f} MB, scheduler "
                    f"{memory[1]:.0f} MB and {spent[1] / wall:.1%} of the time",
                    flush=True,
                )
        assert running.wait() == 0
        most = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss  # only the command has ended
    print(f"command: at most {most / 1e3:.0f} MB, from its start to its page")
    print(f"{chosen.runs} runs, planned in {began - planning:.0f} s, made in {wall:.0f} s")
    for what, seconds in (
        ("command, planning", before[0]), ("command, runs", spent[0]), ("scheduler", spent[1]),
        ("workers", sum(spent[2:])),
    ):  # fmt: skip
        print(f"{what:18s}{seconds:8.1f} s of processor time, {1e3 * seconds / chosen.runs:6.2f} ms a run")
    print(f"scheduler: {spent[1] / wall:.1%} of the time, {idle:.1%} without runs")


if __name__ == "__main__":
    main()
