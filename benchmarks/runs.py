"""Cost of a run: `make bench`, or `python -m benchmarks.runs [--long] [SCENARIO ...]`.

Prints, and asserts nothing: times depend on the machine and on who else uses it. Every figure is the best of
several runs, which is the one least disturbed, if nothing else is said. First comes a table of ratios, each
of two things measured in turn, beside what they are to be at most; `--long` adds what takes minutes. Then,
for every scenario, what the instances cost in the loop in Python, and what other masters take.
`benchmarks.pages` measures pages.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import replace
from math import nan
from pathlib import Path
from time import perf_counter, perf_counter_ns

import numpy as np

from tests.cars import load_scenario, make_plan
from yawbench.fmus.archive import runs_as
from yawbench.fmus.build import HERE as FMUS
from yawbench.foundation.interrupts import StopFlag
from yawbench.interop.second_opinion import MASTERS, installed, second_opinion
from yawbench.orchestrator.master.compiled_loop import WANTED as LOOP
from yawbench.orchestrator.master.fmi import open_instance
from yawbench.orchestrator.master.log import Log
from yawbench.orchestrator.master.step_loop import Master
from yawbench.orchestrator.master.step_program import Operation
from yawbench.orchestrator.plan import Plan

DEFAULT = Path(__file__).parents[1] / "scenarios" / "fnn_sideslip" / "25mps.yaml"
REPEATS = 3
BARE_LOOP = "x = 0\nfor i in range(10**7): x += i"
RUNS = 20, 220
"""Numbers of runs of the two sweeps of which the difference is taken: what a run costs, without the start."""
STEPS = 4000
"""Communication steps measured at most; a scenario's start is representative of its cost."""


class Meter:
    """Adds up the time of calls by unit and kind, less what the clock itself takes."""

    def __init__(self) -> None:
        self.spent: dict[tuple[str, str], int] = defaultdict(int)
        self._own = min(self._once(lambda: None) for _ in range(10_000))

    @staticmethod
    def _once(call: Callable[[], object]) -> int:
        begin = perf_counter_ns()
        call()
        return perf_counter_ns() - begin

    def around(self, operation: Operation) -> list[Operation]:
        call, spent, own, key = operation.call, self.spent, self._own, (operation.instance, operation.kind)

        def timed():
            begin = perf_counter_ns()
            status = call()
            spent[key] += perf_counter_ns() - begin - own
            return status

        return [operation._replace(call=timed, data=None)]


Change = Callable[[Operation], list[Operation]]
"""Replacement of an operation of the program before it is measured."""


def measure(plan: Plan, change: Change = lambda operation: [operation]) -> dict[str, float]:
    """Run the first steps of a plan; return the seconds of every phase, those of stepping per step."""
    log, slaves = Log(), {}
    corrupted: set[Path] = set()
    begin = perf_counter()
    try:
        for unit in plan.instances:
            slaves[unit.name] = open_instance(unit, log, corrupted)
        opened = perf_counter()
        master = Master(plan, slaves, log, StopFlag())
        row = np.zeros(1 + len(plan.record))
        master.initialize(row, [])
        ready = perf_counter()
        for k in range(1, master.program.cycle + 1):
            program = master.program.at(k)
            program[:] = [changed for operation in program for changed in change(operation)]
        n = min(STEPS, plan.n_steps)
        started = perf_counter()
        master.advance(n, [row] * n, [])
        ended = perf_counter()
    finally:
        for slave in slaves.values():
            slave.free()
    return {"instantiate": opened - begin, "initialize": ready - opened, "step": (ended - started) / n}


def bench(path: Path) -> None:
    """Print the costs of one scenario."""
    begin = perf_counter()
    scenario = load_scenario(path)
    plan = make_plan(scenario)
    opening = perf_counter() - begin
    runs = [measure(plan) for _ in range(REPEATS)]
    best = {phase: min(run[phase] for run in runs) for phase in runs[0]}
    meters = [Meter() for _ in range(REPEATS)]
    metered = [measure(plan, meter.around) for meter in meters]
    meter = meters[min(range(REPEATS), key=lambda i: metered[i]["step"])]
    n = min(STEPS, plan.n_steps)
    unit_steps = sum(n // unit.period for unit in plan.instances) / n

    print(f"{path}: {plan.title}")
    print(f"  {plan.algorithm}, step {float(plan.step):g} s, {n} of {plan.n_steps} steps measured\n")
    print(
        f"  {'us per call':24s}{'set':>8s}{'step':>8s}{'get':>8s}{'sum':>8s}   of its time   calls per step"
    )
    for unit in plan.instances:
        times = [1e-3 * meter.spent[unit.name, kind] * unit.period / n for kind in ("set", "step", "get")]
        cells = "".join(f"{t:8.2f}" for t in (*times, sum(times)))
        share = 1e-6 * sum(times) / (unit.period * float(plan.step))  # of the time from call to call
        often = "1" if unit.period == 1 else f"1/{unit.period}"
        print(f"  {unit.name:24s}{cells}{100 * share:11.2f} %   {often}")
    inside = {kind: 0.0 for kind in ("set", "step", "get", "gather", "keep", "fault")}
    for (_, kind), spent in meter.spent.items():
        inside[kind] += 1e-3 * spent / n
    whole = 1e6 * best["step"]
    loop = 1e6 * min(measure(plan, lambda operation: [])["step"] for _ in range(REPEATS))
    units_share = inside["set"] + inside["step"] + inside["get"]
    own = inside["gather"] + inside["keep"] + inside["fault"] + loop
    print(f"\n  per communication step   {whole:8.2f} us")
    print(
        f"    in the units           {units_share:8.2f} us: set {inside['set']:.2f}, "
        f"step {inside['step']:.2f}, get {inside['get']:.2f}"
    )
    print(
        f"    master's own           {own:8.2f} us: gather {inside['gather']:.2f}, "
        f"keep {inside['keep']:.2f}, loop, check and recorded row {loop:.2f}"
    )
    print(f"  per step of a unit       {whole / unit_steps:8.2f} us on average, {unit_steps:g} in a step")
    print(
        f"\n  start-up: imports {1e3 * imports():.0f} ms, scenario and FMUs {1e3 * opening:.0f} ms, "
        f"instantiate {1e3 * best['instantiate']:.1f} ms, initialize {1e3 * best['initialize']:.1f} ms"
    )
    print(f"  yawbench run, process start to files written: {process(path):.2f} s\n")


def masters(path: Path) -> None:
    """Print the time per step of other masters on the same FMUs, each beside ours.

    Their default runs get the span of all repeats, not the best: they step units in threads, which
    compete for the interpreter and are slower the more cores are free for them.
    """
    there = [one for one in MASTERS if installed(one)]
    plan = make_plan(load_scenario(path))
    plan = replace(plan, n_steps=min(STEPS, plan.n_steps))
    begin, used = perf_counter(), busy()
    with tempfile.TemporaryDirectory() as folder:
        runs = [second_opinion(plan, Path(folder), masters=there) for _ in range(REPEATS)]
    others = (busy() - used) / (perf_counter() - begin)
    print(f"{path}: us per communication step, `jacobi`, each master in a process of its own")
    print(f"  {processors()} cores, of which other programs kept {others:.2f} busy; with none free, threads")
    print("  take turns, and a default run costs hardly more than one on one core\n")
    print(
        f"  {'':10s}{'default':>14s}{'ours':>7s}{'ratio':>12s}   {'one core':>10s}{'ours':>7s}{'ratio':>7s}"
    )
    for k, master in enumerate(there):
        if problem := next((run[k].problem for run in runs if run[k].problem), ""):
            print(f"  {master.title:10s}{problem}")
            continue
        times = {key: sorted(1e6 * run[k].seconds[key] for run in runs) for key in runs[0][k].seconds}
        theirs, ours = times["theirs"], times["ours"][0]
        span = f"{theirs[0]:.0f} .. {theirs[-1]:.0f}"
        ratio = f"{ours / theirs[-1]:.2f} .. {ours / theirs[0]:.2f}"
        line = f"  {master.title:10s}{span:>14s}{ours:7.0f}{ratio:>14s}"
        if "theirs on one core" in times:
            theirs_1, ours_1 = times["theirs on one core"][0], times["ours on one core"][0]
            line += f" {theirs_1:10.0f}{ours_1:7.0f}{ours_1 / theirs_1:7.2f}"
        print(line + ("   one step for all instances" if runs[0][k].one_step else ""))
    print()


def processors() -> int:
    """Return how many processor cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def busy() -> float:
    """Return the processor time [s] that programs other than this one and its children have used so far."""
    try:
        spent = [int(word) for word in Path("/proc/stat").read_text().split("\n", 1)[0].split()[1:9]]
    except OSError:
        return nan
    user, nice, system, _idle, _waiting, *interrupts = spent
    everything = (user + nice + system + sum(interrupts)) / os.sysconf("SC_CLK_TCK")
    return everything - sum(os.times()[:4])


def imports() -> float:
    """Return the time [s] to import what a run needs, in a fresh interpreter."""
    code = (
        "import time; t = time.perf_counter(); import yawbench.cli, yawbench.orchestrator.master.simulate, "
        "yawbench.orchestrator.wiring.make_plan; print(time.perf_counter() - t)"
    )
    command = [sys.executable, "-c", code]
    return min(float(subprocess.run(command, capture_output=True, check=True).stdout) for _ in range(REPEATS))


def spent(*arguments: object, **environment: str) -> float:
    """Return the processor time [s] of a Python process and its children."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [sys.executable, *map(str, arguments)]
    subprocess.run(command, capture_output=True, check=True, env=os.environ | environment)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def took(*arguments: object, **environment: str) -> float:
    """Return the time [s] of a Python process from start to end."""
    begin = perf_counter()
    spent(*arguments, **environment)
    return perf_counter() - begin


def ratio(one: Callable[[], float], other: Callable[[], float]) -> float:
    """Return the ratio of two costs, the best of several measured in turn."""
    pairs = [(one(), other()) for _ in range(REPEATS)]
    return min(first for first, _ in pairs) / min(second for _, second in pairs)


def stepping(path: Path, **environment: str) -> float:
    """Return the time of a communication step [s], in a process with this environment."""
    command = [sys.executable, "-m", "benchmarks.runs", "--step", str(path)]
    done = subprocess.run(command, capture_output=True, check=True, env=os.environ | environment)
    return float(done.stdout)


def beyond_stepping(path: Path) -> float:
    """Return the processor time [s] of a short run in a sweep, less that of its steps."""
    with tempfile.TemporaryDirectory() as folder:
        sweep = Path(folder, "sweep.yaml")

        def cost(runs: int) -> float:
            axis = {"vary": "inputs.friction*", "from": 0.3, "to": 0.9, "count": runs}
            keys = {"title": "Short runs", "scenario": str(path), "set": {"stop_time": 0.05}}
            metrics = {"yaw_rate": {"metric": "peak(yaw_rate)"}}
            sweep.write_text(json.dumps({**keys, "axes": {"friction": axis}, "metrics": metrics}))
            out = Path(folder, str(runs))
            return spent("-m", "yawbench", "sweep", sweep, "--fresh", "--out", out, "--jobs", 1)

        few, many = (min(cost(runs) for _ in range(REPEATS)) for runs in RUNS)
    plan = make_plan(load_scenario(path))
    return (many - few) / (RUNS[1] - RUNS[0]) - stepping(path) * round(0.05 / float(plan.step))


def episode_steps() -> float:
    """Return the steps per second of an environment for training, over an episode, in this process."""
    import yawbench.gym

    env = yawbench.gym.SineWithDwell()
    rates = []
    for _ in range(REPEATS):
        env.reset(options={"amplitude": yawbench.gym.ANGLE})
        began, steps, over = perf_counter(), 0, False
        while not over:
            over = env.step(np.zeros(1))[2]
            steps += 1
        rates.append(steps / (perf_counter() - began))
    return max(rates)


def against(path: Path) -> dict[str, float]:
    """Return the time of our step over that of other masters, with the same FMUs on one core."""
    plan = make_plan(load_scenario(path))
    plan = replace(plan, n_steps=min(STEPS, plan.n_steps))
    there = [one for one in MASTERS if installed(one) and one.title != "fmpy"]
    with tempfile.TemporaryDirectory() as folder:
        runs = [second_opinion(plan, Path(folder), masters=there) for _ in range(REPEATS)]
    best = {}
    for k, master in enumerate(there):
        if all("ours on one core" in run[k].seconds for run in runs):
            ours, theirs = (
                min(run[k].seconds[f"{whose} on one core"] for run in runs) for whose in ("ours", "theirs")
            )
            best[master.title] = ours / theirs
    return best


def ratios(path: Path, *, long: bool) -> None:
    """Print the table of what this program is to come to."""

    def line(what: str, value: float, limit: str) -> None:
        print(f"  {what:78s}{value:9.3g}   {limit}", flush=True)

    print(f"{path}: {processors()} cores; what it is to be at most stands behind each figure\n")
    native = [runs_as(archive) for archive in sorted(FMUS.glob("*.fmu"))]
    line(
        f"FMUs of {len(native)} that do not run natively",
        sum(not (how and how.native) for how in native),
        "3",
    )
    reference = {LOOP: "python", "YAWBENCH_UNITS": "python"}

    def bare() -> float:
        return spent("-c", BARE_LOOP)

    def importing() -> float:
        return spent("-c", "import yawbench")

    step = ratio(lambda: stepping(path), lambda: stepping(path, **reference))
    line("a step of the compiled loop and native units, over Python loop and units", step, "1/20 = 0.05")
    loop = ratio(lambda: stepping(path), lambda: stepping(path, **{LOOP: "python"}))
    line("a step of the compiled loop over one of the Python loop, native units", loop, "")
    for title, share in against(path).items():
        line(f"a step over one of {title}, native units, one core", share, "0.5 of the better")
    line("`import yawbench` over a bare loop of 1e7 additions", ratio(importing, bare), "0.3")
    with tempfile.TemporaryDirectory() as folder:
        run = ratio(lambda: spent("-m", "yawbench", "run", path, "--out", folder), bare)
    line("`yawbench run` over a bare loop of 1e7 additions", run, "1.2")
    line("processor time of a run in a sweep beyond stepping [s]", beyond_stepping(path), "0.03")
    line("steps per second of the environment yawbench/sine-with-dwell-v0", episode_steps(), "")
    if long:
        command = "-m", "yawbench"
        with tempfile.TemporaryDirectory() as folder:
            built = took(*command, "build", "--out", folder, YAWBENCH_CACHE=f"{folder}/cache")
            line("first build of all FMUs [s]", built, "180")
            again = took(*command, "build", "--force", "--out", folder, YAWBENCH_CACHE=f"{folder}/cache")
            line("build of all FMUs, translations cached [s]", again, "")
            line("`yawbench report` [s]", took(*command, "report", "--out", f"{folder}/report"), "240")
            line("`yawbench rank` [s]", took(*command, "rank", "--fresh", "--out", f"{folder}/rank"), "180")
    print()


def process(path: Path) -> float:
    """Return the time [s] of a whole `yawbench run`."""
    with tempfile.TemporaryDirectory() as folder:
        return min(took("-m", "yawbench", "run", path, "--out", folder) for _ in range(REPEATS))


def main(arguments: Sequence[str]) -> None:
    """Print a single step's time for `--step SCENARIO`, else everything."""
    files = [Path(argument) for argument in arguments if not argument.startswith("--")]
    if "--step" in arguments:
        print(measure(make_plan(load_scenario(files[0])))["step"])
        return
    ratios(DEFAULT, long="--long" in arguments)
    os.environ[LOOP] = "python"  # its calls are timed one by one
    for path in files or [DEFAULT]:
        bench(path)
    del os.environ[LOOP]
    for path in files or [DEFAULT]:
        masters(path)


if __name__ == "__main__":
    main(sys.argv[1:])
