"""Every function of the library called with wrong things: `python -m campaigns.wrong_calls`.

    python -m campaigns.wrong_calls                       # all calls
    python -m campaigns.wrong_calls --only run.metric     # those of a function or parameter

What must hold: a wrong argument is answered by TypeError, ValueError or a YawbenchError, raised by our own
code, whose text names the argument or the value; it is never taken, and no call hangs, dies or leaves
anything in the folder of the scenarios. What is right is taken. Prints every call that did not hold, and a
table of the outcomes. Each call is made in a process that is watched, which goes on behind one that hangs.
"""

from __future__ import annotations

import argparse
import contextlib
import inspect
import io
import os
import resource
import signal
import sys
import tempfile
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import yawbench as yb
from yawbench.foundation.messages import unprintable

from .child import told_by, working_in
from .wrong_values import TEXTS, WRONG, plant_links

ROOT = Path(__file__).resolve().parents[1]
OURS = [
    ROOT / name for name in ("yawbench", "orchestrator", "foundation", "fmus", "components", "vocabulary")
]
LIMIT = 120.0
"""Time that a call may take by the clock [s]: none takes two seconds of the processor's."""
MEMORY = 12_000_000_000
"""Bytes that the process of the calls may take."""
LONGEST = 3000
"""Characters of a message. Chosen: a sentence that lists all signals of a run has less."""
TAKEN, REFUSED = "taken", "refused by name"
SENTINEL = "beyond the arguments"
"""Message of the error with which a call that would take long ends if its arguments are right."""

FINITE = {
    "zero", "minus one", "three", "two and a half", "minus one and a half", "10**18", "1e308", "numpy int",
    "numpy uint8", "array of no dimensions", "fraction",
}  # fmt: skip
INTEGERS = {"zero", "minus one", "three", "numpy int", "numpy uint8"}
TRUTHS = {"True", "False", "numpy True"}
PRINTABLE = {
    "number as text", "nan as text", "1e400 as text", "numpy text",
    "path upwards", "root", "markup", "minus one second", "one apple", "pattern", "point",
    "arrow",
}  # fmt: skip
"""Texts that may stand wherever any text may."""
PATHS = {"path", "link to nothing", "link to itself", "link to a folder", "device"}
COLOURED = {"text turned around", "escape sequence"}
ODD_TEXTS = {"numpy text"}
"""Texts that are none to declarations, which become part of an FMU."""
EMPTY = {"empty text"}
NO_ITEMS = {"empty array", "zip"}
"""Kinds of values without items in an order."""


class Law:
    """A controller in plain Python."""

    inputs = ("yaw_rate_ref", "yaw_rate")
    outputs = ("yaw_moment",)

    def output(self, t: float, u: Any) -> float:
        return 1e4 * (u.yaw_rate_ref - u.yaw_rate)


def beside(call: Callable[[Any], object]) -> Callable[[Any], object]:
    """Return a call that is made in a folder of its own, so that it meets no file of another."""

    def made(value: Any) -> object:
        folder = Path("beside").resolve()
        if not folder.is_dir():
            folder.mkdir()
            plant_links(folder)
        with working_in(folder):
            return call(value)

    return made


class Bench:
    """Objects for the calls: a scenario, a run, an experiment; made once."""

    @cached_property
    def base(self) -> yb.Scenario:
        return yb.load("fnn_sideslip/25mps").set({"stop_time": 0.05})

    @cached_property
    def run(self) -> yb.Run:
        return self.base.run()

    @cached_property
    def view(self) -> yb.View:
        return yb.view(self.run)

    @cached_property
    def experiment(self) -> yb.Experiment:
        axes = {"controller": [Law()], "driver.amplitude": [0.02, 0.03]}
        return yb.experiment(self.base, axes, metrics="peak(sideslip)")

    @cached_property
    def runs(self) -> yb.Runs:
        return self.experiment.run()

    @cached_property
    def recorded(self) -> yb.RecordedRuns:
        self.folder = tempfile.TemporaryDirectory()
        self.run.save(Path(self.folder.name) / "run")
        return yb.RecordedRuns(Path(self.folder.name), {})

    @cached_property
    def draws(self) -> yb.Runs:
        axes = {"driver.amplitude": yb.uniform(0.02, 0.03)}
        return yb.experiment(self.base, axes, metrics="peak(sideslip)", points=4, seed=1).run()

    def stepped(self, call: Callable[[yb.SteppedRun], object]) -> object:
        """Return what comes of a run that has been started."""
        with self.base.start() as run:
            return call(run)

    @cached_property
    def places(self) -> yb.Ranking:
        return yb.rank(against=["none"], conditions=["hard"], quick=True)

    def warm(self) -> None:
        """Make everything, so that no call pays for it."""
        for made in (self.base, self.run, self.experiment, self.runs, self.places, self.recorded):
            repr(made)


BENCH = Bench()


@dataclass(frozen=True)
class Parameter:
    """A parameter of a function of the library.

    Attributes:
        name: `function.parameter`, or `Class.method.parameter`, perhaps with more behind it.
        call: calls the function with a value there, and with what is right elsewhere.
        names: a message has to have one of these; default: the parameter's own name.
        right: the values that it takes.
        may: those that it may take or refuse.
        skip: those that it is not called with.
    """

    name: str
    call: Callable[[Any], Any]
    names: tuple[str, ...] = ()
    right: frozenset[str] = frozenset()
    may: frozenset[str] = frozenset()
    skip: frozenset[str] = frozenset()


def _parameters() -> Iterator[Parameter]:
    """Yield every parameter of every public function."""

    def of(name: str, call: Callable[[Any], Any], *names: str, **sets: set[str]) -> Parameter:
        last = name.split(" ")[0].rpartition(".")[2]
        return Parameter(name, call, names or (last,), **{key: frozenset(one) for key, one in sets.items()})

    b = BENCH
    # What there is.
    yield of("load.source", yb.load, "source", "scenario")
    yield of("open.folder", yb.open, "folder", "no results here", "contains no results",
             "loop.yaml", may={"root"})  # fmt: skip
    yield of("Run.__getitem__.name", lambda x: b.run[x], "column")
    yield of("Run.__contains__.name", lambda x: x in b.run, right=set(WRONG))
    yield of("Run.unit_of.name", lambda x: b.run.unit_of(x), "column")
    # Changes.
    plan = yb.Scenario.plan
    yield of(
        "Scenario.swap.instances",
        lambda x: b.base.swap(**{x: "controller_off"}),
        "instance",
        skip=set(WRONG) - set(TEXTS),
    )
    yield of("Scenario.swap.replacements", lambda x: b.base.swap(x), "replacements", "instance",
             right={"None"}, may={"dict"})  # fmt: skip
    yield of("Scenario.swap.instances [controller]", lambda x: plan(b.base.swap(controller=x)), "controller",
             may={"lambda", "builtin"})  # fmt: skip
    yield of("Scenario.set.values", lambda x: b.base.set(x), "values", "has no instance", "set ")
    yield of("Scenario.set.values [place]", lambda x: b.base.set({x: 1}), "values", "has no instance", "set ",
             skip=_unhashable())  # fmt: skip
    for place in ("plant.initial_speed", "vehicle.mass", "stop_time", "step_size", "inputs.friction*",
                  "driver.amplitude", "friction", "speed", "controller.step_size"):  # fmt: skip
        few = {"three", "two and a half", "numpy uint8", "10**18", "1e308"}
        yield of(f"Scenario.set.values [{place}]", lambda x, place=place: plan(b.base.set({place: x})), place,
                 may=FINITE if place not in ("stop_time", "step_size") else few)  # fmt: skip
    for place in ("algorithm", "controller", "vehicle", "tyres", "faults.plant.sideslip", "plant.validate"):
        may = TRUTHS if place == "plant.validate" else set()
        yield of(f"Scenario.set.values [{place}]", lambda x, place=place: plan(b.base.set({place: x})), place,
                 "sideslip", "fmu", may=may)  # fmt: skip
    yield of("Scenario.fault.target", lambda x: plan(b.base.fault(x, kind="freeze")), "target", "fault",
             "on")  # fmt: skip
    yield of(
        "Scenario.fault.kind",
        lambda x: b.base.fault("plant.sideslip", kind=x, value=1.0),
        "kind",
        "fault plant.sideslip",
    )
    fault = b_fault
    yield of("Scenario.fault.value", fault("bias", "value"), "value", "fault plant.sideslip", may=FINITE)
    for name in ("start", "until"):
        yield of(
            f"Scenario.fault.{name}",
            fault("freeze", name),
            name,
            "from",
            may=FINITE | {"minus one second"},
            right={"None"},
        )
    yield of("Scenario.fault.share", fault("dropout", "share"), "share", may=FINITE | TRUTHS)
    yield of("Scenario.fault.every", fault("dropout", "every", share=0.5), "every", right={"None"},
             may={"three", "two and a half", "numpy uint8", "10**18"})  # fmt: skip
    yield of("Scenario.fault.seed", fault("dropout", "seed", share=0.5), "seed",
             right={"None", "three"}, may={"zero", "numpy uint8", "10**18"})  # fmt: skip
    # Runs.
    progress = {"lambda of all", "builtin"}
    yield of("Scenario.run.progress", lambda x: b.base.run(progress=x), right={"None", *TRUTHS, *progress},
             skip={"builtin type method"})  # fmt: skip
    yield of("Run.why.best", lambda x: b.run.why(x), right={"None"})
    yield of("Run.metric.name", lambda x: b.run.metric(x), "metric")
    yield of("Run.metric.window", lambda x: b.run.metric("peak(sideslip)", x), "window", "the run lasts",
             right={"None"})  # fmt: skip
    within = {"zero"}
    yield of("Run.metric.window [0]", lambda x: b.run.metric("peak(sideslip)", (x, 0.04)), "window",
             "the run lasts", right=within)  # fmt: skip
    yield of("Run.metric.window [1]", lambda x: b.run.metric("peak(sideslip)", (0, x)), "window",
             "the run lasts", "at", may=within)  # fmt: skip
    yield of("Run.evaluate.test", lambda x: b.run.evaluate(x))
    angles = {"three", "two and a half"}
    yield of("Run.evaluate.angle", lambda x: b.run.evaluate("sine-with-dwell", angle=x),
             right={"None", *angles})  # fmt: skip
    yield of("Run.plot.panels", lambda x: b.run.plot(x), "panel")
    yield of("Run.plot.title", lambda x: b.run.plot("sideslip", title=x), right={"None", *PRINTABLE})
    yield of("Run.save.folder", lambda x: b.run.save(x), skip={"root", "path upwards"},
             right={"number as text", "path", "link to a folder", "point"},
             may={*PRINTABLE, "link to nothing", "link to itself", "device", *COLOURED})  # fmt: skip
    yield of("Run.save.format", lambda x: b.run.save("saved", format=x))
    yield of("within.limit", lambda x: yb.within(x, len, ()), "limit", may=FINITE)
    yield of("within.function", lambda x: yb.within(60, x), "function",
             skip={"type", "lambda of x", "builtin type method"},  # raise their own errors
             right={"class", "class of ours", "lambda", "lambda of all", "builtin"})  # fmt: skip
    yield of("within.arguments", lambda x: yb.within(60, id, x), right=set(WRONG))
    yield of("view.runs", lambda x: yb.view(x), "runs", "a viewer shows")
    yield of("view.runs [run]", lambda x: yb.view({"a": x}), "runs")
    yield of("view.panels", lambda x: yb.view(b.run, x), "panel")
    yield of("view.title", lambda x: yb.view(b.run, title=x), right={*PRINTABLE, *EMPTY}, may=COLOURED)
    yield of("view.height", lambda x: yb.view(b.run, height=x), right={"numpy uint8"})
    yield of("View.save.file", beside(lambda x: b.view.save(x)), "file", "page",
             skip={"root", "path upwards"}, right={"number as text", "path"},
             may={*PRINTABLE, *PATHS, *COLOURED, "point"})  # fmt: skip
    # Experiments.
    speeds = {"driver.amplitude": [0.02]}
    yield of("experiment.base", lambda x: yb.experiment(x, speeds))
    yield of("experiment.axes", lambda x: yb.experiment(b.base, x), "axes", "levels")
    yield of("experiment.axes [name]", lambda x: plan_all({x: [1.0]}), "axes", "has no instance",
             skip=_unhashable())  # fmt: skip
    yield of("experiment.axes [levels]", lambda x: plan_all({"driver.amplitude": x}), "driver.amplitude",
             right={"list", "array of 1 dimension"}, may={"tuple", "pair turned around"})  # fmt: skip
    yield of("experiment.axes [level]", lambda x: plan_all({"driver.amplitude": [x, 0.5]}),
             "driver.amplitude", may=FINITE)  # fmt: skip
    yield of("experiment.axes [units]", lambda x: plan_all({"controller": x}), "controller")
    yield of("experiment.axes [unit]", lambda x: plan_all({"controller": [x]}), "controller",
             may={"lambda", "builtin"})  # fmt: skip
    yield of("experiment.metrics", lambda x: yb.experiment(b.base, speeds, metrics=x), "metric",
             right=NO_ITEMS, may={"file"})  # fmt: skip
    yield of("experiment.metrics [0]", lambda x: yb.experiment(b.base, speeds, metrics=[x]), "metric")
    yield of("Experiment.run.workers", lambda x: b.experiment.run(workers=x), right={"None", "three",
             "numpy uint8"})  # fmt: skip
    yield of("Experiment.run.keep", lambda x: b.experiment.run(keep=x), right=TRUTHS)
    yield of("Experiment.run.progress", lambda x: b.experiment.run(progress=x), right={"None", *TRUTHS})
    yield of("Runs.plot.metric", lambda x: b.runs.plot(x, x="driver.amplitude", lines="controller"))
    yield of("Runs.plot.x", lambda x: b.runs.plot("peak(sideslip)", x=x, lines="controller"), "x", "axis")
    for name in ("y", "lines", "panels"):
        given = {"x": "driver.amplitude", "lines": "controller"} if name == "y" else {"x": "driver.amplitude"}
        yield of(f"Runs.plot.{name}", lambda x, n=name, g=given: b.runs.plot("peak(sideslip)", **{**g, n: x}),
                 name, "axis", right=EMPTY if name == "y" else set())  # fmt: skip
    for name, right, may in (
        ("title", PRINTABLE | EMPTY, set()), ("scale", set(), set()), ("only", {"None"}, set()),
        ("largest", {"None", "three"}, FINITE), ("mark", {"None", "three"}, FINITE),
    ):  # fmt: skip
        yield of(f"Runs.plot.{name}", lambda x, n=name: b.runs.plot("peak(sideslip)",
                 x="driver.amplitude", lines="controller", **{n: x}), name, right=right, may=may)  # fmt: skip
    yield of("Runs.plot.only [levels]", lambda x: b.runs.plot("peak(sideslip)", x="driver.amplitude",
             lines="controller", only={"driver.amplitude": x}), "only", "driver.amplitude")  # fmt: skip
    # Rankings.
    yield of("rank.controller", rank("controller"), right={"None"},
             may={"lambda", "builtin", "class", *PRINTABLE, *PATHS})  # fmt: skip
    yield of("rank.name", rank("name", controller="controller_off"), "name", right=PRINTABLE | EMPTY)
    yield of("rank.against", lambda x: yb.rank(against=x, conditions=[SENTINEL]), "against",
             right={"None", *PRINTABLE, *NO_ITEMS, "set of texts"},
             may={"pair of texts", "frame", "file"})  # fmt: skip
    yield of("rank.conditions", lambda x: yb.rank(conditions=x, against=[SENTINEL]), "condition",
             right=NO_ITEMS, may={"file"})  # fmt: skip
    yield of("rank.quick", rank("quick"), right=TRUTHS)
    yield of("rank.ranking", rank("ranking"))
    yield of("rank.out", rank("out"), right={"None", *PATHS, *PRINTABLE},
             may=COLOURED)  # fmt: skip
    yield of("rank.progress", rank("progress"), right={"None", *TRUTHS})
    yield of("rank.workers", rank("workers"), right={"None", "three", "numpy uint8"})
    yield of("Ranking.place.name", lambda x: b.places.place(x), "entry")
    yield of("Ranking.plot.kind", lambda x: b.places.plot(x), "kind", "picture")
    # Recordings, fits, linear models.
    yield of("measured.file", lambda x: yb.measured(x), "file", "measurement", "loop.yaml")
    yield of("measured.segment", lambda x: yb.measured(f"{SENTINEL}.yaml", x),
             right={"None", "three", "numpy uint8"}, may=INTEGERS)  # fmt: skip
    yield of("measured.start", lambda x: yb.measured(f"{SENTINEL}.yaml", start=x), may=FINITE)
    yield of("fit.path", lambda x: yb.fit(x), "path", "fit", "loop.yaml")
    yield of("fit.workers", lambda x: yb.fit(f"{SENTINEL}.yaml", workers=x),
             right={"None", "three", "numpy uint8"})  # fmt: skip
    yield of("fit.progress", lambda x: yb.fit(f"{SENTINEL}.yaml", progress=x), right={"None"},
             may={"lambda", "lambda of x", "lambda of all", "builtin", "builtin type method"})  # fmt: skip
    yield of("linearize.scenario", lambda x: yb.linearize(x, at=0.01, inputs=["a"], outputs=["b"]))
    yield of("linearize.at", lambda x: yb.linearize(b.base, at=x, inputs=[SENTINEL], outputs=["a.b"]),
             may=FINITE)  # fmt: skip
    for name in ("inputs", "outputs"):
        yield of(f"linearize.{name}", lambda x, n=name: yb.linearize(b.base, at=0.01,
                 **{"inputs": ["driver.steer_angle"], "outputs": ["plant.yaw_rate"], n: x}))  # fmt: skip
    yield of("linearize.discrete", lambda x: yb.linearize(b.base, at=0.01, inputs=[SENTINEL],
             outputs=["plant.yaw_rate"], discrete=x), right=TRUTHS)  # fmt: skip
    yield of("RecordedRuns.plot.panels", lambda x: b.recorded.plot(x), "panel")
    yield of("RecordedRuns.plot.title", lambda x: b.recorded.plot("yaw_rate", title=x),
             right=PRINTABLE | {"None"})  # fmt: skip
    yield of("validate.run", lambda x: yb.validate(x, f"{SENTINEL}.yaml"))
    yield of("validate.file", lambda x: yb.validate(b.run, x), "file", "measurement", "loop.yaml")
    yield of("validate.bands", lambda x: yb.validate(b.run, f"{SENTINEL}.yaml", bands=x), "bands",
             "loop.yaml")  # fmt: skip
    # Distributions.
    for name, given in (("uniform", {"low": 1.0, "high": 2.0}), ("normal", {"mean": 1.0, "deviation": 0.1}),
                        ("tabulated", {"values": [1.0, 2.0]})):  # fmt: skip
        make, numbers = getattr(yb, name), (*given, "low", "high") if name == "normal" else [*given]
        for one in dict.fromkeys(numbers):
            yield of(f"{name}.{one}", lambda x, n=one, m=make, g=given: m(**{**g, n: x}), one, "low", "high",
                     name, may={*FINITE, *NO_ITEMS, "file", "None", "list", "tuple",
                                "array of 1 dimension", "pair turned around"})  # fmt: skip
        yield of(f"{name}.unit", lambda x, m=make, g=given: m(**g, unit=x), "unit", name,
                 may=PRINTABLE | EMPTY | {"brackets"})  # fmt: skip
        yield of(f"{name}.whole", lambda x, m=make, g=given: m(**g, whole=x), "whole", name, right=TRUTHS)
    yield of("uniform.log", lambda x: yb.uniform(1.0, 2.0, log=x), "log", "uniform", right=TRUTHS)
    yield of("tabulated.shares", lambda x: yb.tabulated([1.0, 2.0], x), "shares", "tabulated",
             may={"None", "list", "tuple", "array of 1 dimension", "pair turned around"})  # fmt: skip
    drawn = {"driver.amplitude": yb.uniform(0.02, 0.03)}
    for name, right in (
        ("design", {"None"}), ("points", {"None", "three", "numpy uint8", "10**18"}),
        ("seed", {"None", "zero", "three", "numpy uint8", "10**18"}),
    ):  # fmt: skip
        yield of(f"experiment.{name}", lambda x, n=name: yb.experiment(
                 b.base, drawn, **{"points": 4, "seed": 1, n: x}), name, "design", "points", "axes",
                 may=right)  # fmt: skip
    bounds = ("below", "at_most", "above", "at_least")
    yield of("Runs.probability.metric", lambda x: b.draws.probability(x, below=1.0), "metric", "metrics")
    for name in bounds:
        yield of(f"Runs.probability.{name}", lambda x, n=name: b.draws.probability(
                 "peak(sideslip)", **{n: x}), *bounds, "bound", may=FINITE)  # fmt: skip
    yield of("Runs.to_latex.columns", lambda x: b.draws.to_latex(x), "columns", "column", right=NO_ITEMS,
             may={"file", "frame"})  # fmt: skip
    for name in ("caption", "label"):
        yield of(f"Runs.to_latex.{name}", lambda x, n=name: b.draws.to_latex(**{n: x}), name,
                 may={"None", *TEXTS})  # fmt: skip
    yield of("Runs.to_latex.of", lambda x: b.draws.to_latex(of=x), "of", "there are")
    # Steps.
    yield of("SteppedRun.__getitem__.name", lambda x: b.stepped(lambda run: run[x]), "name", "variable",
             "column")  # fmt: skip
    yield of("SteppedRun.set.name", lambda x: b.stepped(lambda run: run.set(x, 1.0)), "name", "variable",
             "set must be")  # fmt: skip
    yield of("SteppedRun.set.value", lambda x: b.stepped(lambda run: run.set("plant.mass", x)), "value",
             "mass", may=FINITE)  # fmt: skip
    yield of("SteppedRun.step.steps", lambda x: b.stepped(lambda run: run.step(x)), "steps",
             may={"three", "numpy uint8", "10**18", "zero"})  # fmt: skip
    yield of("SteppedRun.run_to.time", lambda x: b.stepped(lambda run: run.run_to(x)), "time", may=FINITE)
    yield of("SteppedRun.run_until.condition", lambda x: b.stepped(lambda run: run.run_until(x, 0.01)),
             "condition", may={"lambda", "builtin", "class", "lambda of x", "lambda of all",
                               "builtin type method"})  # fmt: skip
    yield of("SteppedRun.run_until.time", lambda x: b.stepped(lambda run: run.run_until(lambda: True, x)),
             "time", right={"None"}, may=FINITE)  # fmt: skip
    yield of("SteppedRun.restore.state", lambda x: b.stepped(lambda run: run.restore(x)), "state")
    # Tunings.
    search = {"base": b.base, "ranges": {"driver.amplitude": (0.02, 0.03)}, "objective": SENTINEL}
    for name, taken in (
        ("base", set()), ("ranges", set()), ("population", {"numpy uint8"}),
        ("generations", {"three", "numpy uint8"}), ("seed", {"zero", "three", "numpy uint8"}),
        ("workers", {"three", "numpy uint8", "None"}), ("progress", {"None", *TRUTHS}),
    ):  # fmt: skip
        yield of(f"tune.{name}", lambda x, n=name: yb.tune(**{**search, n: x}), right=taken)
    yield of("tune.ranges [range]", lambda x: yb.tune(b.base, {"driver.amplitude": x}, SENTINEL), "ranges")
    yield of("tune.ranges [lowest]", lambda x: yb.tune(b.base, {"driver.amplitude": (x, 1e300)}, SENTINEL),
             "ranges", may=FINITE)  # fmt: skip
    unknown = {f"driver.{SENTINEL}": (1, 2)}
    yield of("tune.objective", lambda x: yb.tune(b.base, unknown, x), "objective")
    yield of("tune.objective [weight]", lambda x: yb.tune(b.base, unknown, {"peak(sideslip)": x}),
             "objective", may=FINITE)  # fmt: skip
    # FMUs of plain Python.
    yield of("export_fmu.controller", lambda x: yb.export_fmu(x, "made.fmu"), "controller", "made",
             may={"lambda", "builtin"})  # fmt: skip
    yield of("export_fmu.file", lambda x: yb.export_fmu(Law(), x, role=SENTINEL))
    yield of("export_fmu.role", lambda x: yb.export_fmu(SENTINEL, "made.fmu", role=x))
    yield of("export_fmu.fmi", lambda x: yb.export_fmu(Law(), "made.fmu", role=SENTINEL, fmi=x),
             right={"three"})  # fmt: skip
    # Declarations.
    yield of("signal.name", lambda x: yb.signal(x), "signal")
    for name, right in (("unit", {"None"}), ("description", {"None"})):
        yield of(f"signal.{name}", lambda x, n=name: yb.signal("yaw_rate", **{n: x}), name, "unit",
                 right=right, may=set(TEXTS) - ODD_TEXTS if name == "description" else set())  # fmt: skip
    numbers = FINITE - {"array of no dimensions", "numpy int", "numpy uint8", "fraction"}
    for name in ("start", "minimum", "maximum"):
        yield of(f"signal.{name}", lambda x, n=name: yb.signal("yaw_rate", **{n: x}), name,
                 right=(numbers | {"None"} if name != "start" else numbers))  # fmt: skip
    yield of("signal.depends_on", lambda x: yb.signal("yaw_moment", depends_on=x), right={"pair of texts"})
    yield of("signal.optional", lambda x: yb.signal("yaw_moment", optional=x), right={"True", "False"})
    yield of("output.name", lambda x: yb.output(x), "signal")
    yield of("output.depends_on", lambda x: yb.output("yaw_moment", x), right=set(TEXTS) - ODD_TEXTS)
    yield of("output.unit", lambda x: yb.output("yaw_moment", unit=x), "unit", right={"None"})
    yield of("output.text", lambda x: yb.output("yaw_moment", text=x), "text", "description",
             right={"None"}, may=set(TEXTS) - ODD_TEXTS)  # fmt: skip
    default = FINITE | TRUTHS - {"numpy True"} | set(TEXTS) - ODD_TEXTS
    yield of("parameter.default", lambda x: yb.parameter(x, None, "text"),
             may=default | {"10**400", "-10**400", "10**5000"})  # fmt: skip
    yield of("parameter.unit", lambda x: yb.parameter(1.0, x, "text"), "unit",
             right={"None"}, may=set(TEXTS) - ODD_TEXTS)  # fmt: skip  # known or not is said of the class
    yield of("parameter.description", lambda x: yb.parameter(1.0, "1", x), right=set(TEXTS) - ODD_TEXTS)
    yield of("parameter.source", lambda x: yb.parameter(1.0, "1", "text", x), right=set(TEXTS) - ODD_TEXTS)
    for name in ("minimum", "maximum"):
        yield of(f"parameter.{name}", lambda x, n=name: yb.parameter(1.0, "1", "text", **{n: x}), name,
                 right=(numbers | {"None"}))  # fmt: skip
    yield of("parameter.choices", lambda x: yb.parameter("a", None, "text", choices=x),
             right={"None", "pair of texts"})  # fmt: skip
    yield of(
        "parameter.tunable", lambda x: yb.parameter(1.0, "1", "text", tunable=x), right={"True", "False"}
    )
    # Controllers in plain Python.
    numbers = (FINITE - {"1e308", "10**18"}) | {"list", "array of 1 dimension"}
    yield of("controller of a function, what it returns", lambda x: b.base.swap(
             controller=lambda yaw_rate: x).run(), "yaw_moment", right=numbers,
             may={"1e308", "10**18"})  # fmt: skip
    yield of("controller of an object, what it returns", lambda x: b.base.swap(
             controller=law(output=lambda self, t, u: x)).run(), "yaw_moment", right=numbers,
             may={"1e308", "10**18"})  # fmt: skip
    for name in ("inputs", "outputs", "step_size", "sampled", "output"):
        right = {"sampled": TRUTHS, "step_size": {"None"}, "inputs": NO_ITEMS}.get(name, set())
        may = {
            "step_size": {"three", "two and a half", "numpy uint8"},
            "inputs": {"file"},
            "output": {"lambda of all"},
        }.get(name, set())
        yield of(f"controller of an object, {name}", lambda x, n=name: b.base.swap(
                 controller=law(**{"output": lambda self, t, u: 0.0, n: x})).run(), name, "signal",
                 "controller: initialization failed", "controller: Law: ", "yaw_moment", right=right, may=may,
                 skip={"builtin type method"})  # fmt: skip


def law(**members: Any) -> Any:
    """Return a controller with some members in place of its own."""
    return type("Law", (Law,), members)()


def b_fault(kind: str, name: str, **more: Any) -> Callable[[Any], Any]:
    """Return what calls `Scenario.fault` with a value for one of its parameters."""
    return lambda x: BENCH.base.fault("plant.sideslip", kind=kind, **{**more, name: x}).plan()


def plan_all(axes: Mapping[Any, Any]) -> None:
    """Make an experiment, and plan its runs as `run` does before it makes them."""
    from yawbench._run_many import planner_of
    from yawbench.studies.experiment import plan_experiment

    made = yb.experiment(BENCH.base, axes, metrics="peak(sideslip)")
    plan_experiment(made._design, made.base.path.parent, planner=planner_of(made.base._programs))


def rank(name: str, **more: Any) -> Callable[[Any], Any]:
    """Return what calls `rank` with a value for one of its parameters, and with a condition there is not."""
    return lambda x: yb.rank(**{"conditions": [SENTINEL], **more, name: x})


def _is_key(value: Any) -> bool:
    """Return whether a value can be the key of a mapping."""
    try:
        return bool({value: 1})
    except Exception:
        return False


@cache
def _unhashable() -> set[str]:
    """Return the descriptions of values that cannot be keys."""
    return {label for label, make in WRONG.items() if not _is_key(make())}


NOT_CALLED = (
    yb.Controller, yb.Diagnostic, yb.Evaluation, yb.Location, yb.MetricValue, yb.Override, yb.Plan,
    yb.TestQuantity, yb.Validation, yb.Verdict,
)  # fmt: skip
"""Classes that users write, or only read."""


def described() -> dict[str, list[str]]:
    """Return every public function and method with its parameters, but for those of `NOT_CALLED`."""
    found = {}
    for name in yb.__all__:
        public = getattr(yb, name)
        if public in NOT_CALLED:
            continue
        if not isinstance(public, type):
            found[name] = list(inspect.signature(public).parameters)
        elif not issubclass(public, BaseException):
            for member, one in inspect.getmembers(public, inspect.isfunction):
                called = not member.startswith("_") or member in ("__getitem__", "__contains__")
                if called and one.__module__.startswith("yawbench"):
                    found[f"{name}.{member}"] = list(inspect.signature(one).parameters)[1:]
    return found


def outcome_of(parameter: Parameter, label: str) -> tuple[str, str]:
    """Make one call; return what became of it, and what was said. What does not hold is in capitals."""
    value = WRONG[label]()
    right, may = label in parameter.right, label in parameter.may
    try:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            parameter.call(value)
    except (TypeError, ValueError, yb.YawbenchError) as error:
        said = str(error)
        if SENTINEL in said:
            return (TAKEN, "") if right or may else ("ACCEPTED", "")
        if right:
            return "REFUSED WHAT IS RIGHT", said
        if len(said) > LONGEST or not said.strip() or unprintable(said):
            return "NO SENTENCE", ascii(said[:300])
        if not any(name in said for name in parameter.names) and not _quotes(said, value):
            return "NOT NAMED", said
        file = Path(traceback.extract_tb(error.__traceback__)[-1].filename)
        if not any(file.is_relative_to(folder) for folder in OURS):
            return "FROM INSIDE", "".join(traceback.format_exc().splitlines(keepends=True)[-8:])
        return REFUSED, said
    except BaseException:
        return "TRACEBACK", "".join(traceback.format_exc().splitlines(keepends=True)[-12:])
    return (TAKEN, "") if right or may else ("ACCEPTED", "")


def _quotes(said: str, value: Any) -> bool:
    """Return whether a message quotes a text that is wrong."""
    return type(value) is str and len(value) > 2 and repr(value)[1:20] in said


@dataclass
class Tally:
    """Counts of the outcomes of the calls."""

    counts: Counter[str] = field(default_factory=Counter)
    notes: list[str] = field(default_factory=list)

    @property
    def bad(self) -> int:
        """Number of calls that did not hold."""
        return sum(number for outcome, number in self.counts.items() if outcome.isupper())


def cases(only: str = "") -> list[tuple[Parameter, str]]:
    """Return all calls: each parameter with each value."""
    chosen = [one for one in _parameters() if only.lower() in one.name.lower()]
    return [(one, label) for one in chosen for label in WRONG if label not in one.skip]


def trial(given: list[tuple[Parameter, str]], folder: Path) -> Tally:
    """Make calls in a folder, an empty one, in one process after the other where one hangs or dies."""
    tally = Tally()
    plant_links(folder)
    BENCH.warm()
    first = 0
    while first < len(given):

        def act(tell: Callable[..., None], first: int = first) -> None:
            os.chdir(folder)
            warnings.simplefilter("ignore")
            sys.unraisablehook = lambda _: None
            resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
            for case in given[first:]:
                signal.setitimer(signal.ITIMER_REAL, LIMIT)
                tell(*outcome_of(*case))

        news, end = told_by(act)
        if len(news) < len(given) - first:
            news.append(("HANG", f"more than {LIMIT:g} s") if end == "SIGALRM" else ("DIED", end or "exits"))
        for case, (outcome, said) in zip(given[first:], news, strict=False):
            note(tally, case, outcome, said)
        first += len(news)
    return tally


def note(tally: Tally, case: tuple[Parameter, str], outcome: str, said: str) -> None:
    """Count an outcome; keep what was said where it does not hold."""
    tally.counts[outcome] += 1
    if outcome.isupper():
        tally.notes.append(f"{outcome}: {case[0].name} given {case[1]}\n    {said.strip()}")


def main() -> int:
    """Make all calls, print what did not hold and a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="", help="part of a parameter's name")
    chosen = cases(parser.parse_args().only)
    with tempfile.TemporaryDirectory() as folder:
        tally = trial(chosen, Path(folder))
    print("\n".join(tally.notes))
    for outcome, number in sorted(tally.counts.items()):
        print(f"{number:6} {outcome}")
    print(f"{len(chosen):6} calls, {len({one.name for one, _ in chosen})} parameters")
    return 1 if tally.bad else 0


if __name__ == "__main__":
    sys.exit(main())
