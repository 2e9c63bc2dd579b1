"""`yawbench check`: validate a scenario; show its instances, values and wires."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

from yawbench.commands import json_and_latex
from yawbench.foundation.errors import Diagnostic, YawbenchError
from yawbench.foundation.messages import counted, cut, fold, fold_wires, printable, star
from yawbench.orchestrator.plan import DEFAULT, ValueOrigin
from yawbench.vocabulary.wheels import WHEELS, wheels

from .json_and_latex import tabular
from .options import CHANGES, RunOptions, ScenarioFile, plan_of_scenario, takes
from .output import print_tables
from .terminal_progress import say

if TYPE_CHECKING:
    from yawbench.fmus.fmu import Value
    from yawbench.orchestrator.plan import Instance, Plan, Wire

All = Annotated[bool, typer.Option("--all", help="Show every value, including the FMUs' defaults.")]
K = TypeVar("K")
V = TypeVar("V")
CAMBER = wheels("inclination_angle_*")
"""Inclination angles, which plants output from their roll camber."""


@tabular
@takes(*CHANGES, "fmus", "no_build", "no_validate")
def check(scenario: ScenarioFile, options: RunOptions, all_: All = False) -> None:
    """Validate a scenario; show its instances, values and wires.

    Shows the origin of every value, the reason for the evaluation order, and whether the control side
    receives true, measured or estimated signals.
    """
    plan = plan_of_scenario(scenario, options)
    show(plan, scenario, defaults=all_)
    notes = [*plan.diagnostics, *_hidden(plan)]
    json_and_latex.note(notes)
    json_and_latex.answer(plan=_data_of(plan))
    for diagnostic in notes:
        say(f"note: {diagnostic}")
    for instance in plan.instances:
        for violation in instance.fmu.violations:
            say(f"{violation.severity}: {instance.name}: {violation}")


def _hidden(plan: Plan) -> list[Diagnostic]:
    """Return warnings of FMUs of packages that others hide, which a run does not look for."""
    from yawbench.fmus.opener import hidden

    warnings = [
        warning
        for instance in plan.instances
        for warning in hidden([instance.fmu.path.stem], instance.fmu.path.parent, packages=True)
    ]
    return [warning for warning in dict.fromkeys(warnings) if warning not in plan.diagnostics]


PLANNED = (
    "title", "algorithm", "step_size", "start_time", "stop_time", "evaluation_order", "units", "fmus",
    "connections", "faults", "changes", "scenario",
)  # fmt: skip
"""Keys of run.json that describe the plan; others describe the run."""


def _data_of(plan: Plan) -> dict[str, object]:
    """Return a plan as run.json describes it."""
    from datetime import datetime, timezone

    from yawbench.orchestrator.results.record_of_plan import run_record
    from yawbench.orchestrator.results.run_record import RunStatus

    record = run_record(plan, status=RunStatus.PLANNED, started=datetime.now(timezone.utc)).content()
    return {key: record[key] for key in PLANNED if key in record}


def show(plan: Plan, scenario: Path, *, defaults: bool = False) -> None:
    """Print the plan of a scenario file, for the width of the terminal."""
    from yawbench.orchestrator.scenario.overrides import changed
    from yawbench.orchestrator.wiring.order import evaluate

    warned = sum(
        entry.severity == "warning" and entry.location.signal is not None for entry in plan.diagnostics
    )
    doubtful = f"No errors, but {counted(warned, 'suspicious value')}: see the notes."
    _tell(f"{scenario}: {plan.title}" if plan.title else f"{scenario}")
    if plan.changes:
        _tell(f"changed: {changed(plan.changes)}")
    _tell(
        f"{_number(plan.n_steps * plan.step)} s in {plan.n_steps} steps of {_number(1000 * plan.step)} ms, "
        f"{plan.algorithm}; {len(plan.wires)} wires, {len(plan.record)} outputs recorded"
    )
    _show("Instances in evaluation order", ("instance", "FMU", "step"), _unit_rows(plan))
    values, hidden = _values(plan, defaults)
    columns = ("name", "value", "origin", "instances", *(["source of the default"] if defaults else []))
    also = " or come from tyre files" if plan.scenario.get("tyre_files") else ""
    _show(
        "Values",
        columns,
        values,
        f"{hidden} more are left at the FMUs' defaults{also}: --all shows them" if hidden else "",
    )
    _show("Derived from the vehicle file", ("name", "formula", "instances"), _derived(plan))
    of_stiffness = ("name", "given", "tyres at static loads", "difference", "instances")
    _show("Given, although the tyres determine it", of_stiffness, _beside_tyres(plan))
    if idle := _idle(plan):
        _tell(f"\nin the vehicle file, but used by no instance: {', '.join(idle)}")
    wires = list(_wire_rows(plan))
    seen = any(kind for _, _, kind, _ in wires)
    headings = ("from", "to", "signal", "variables") if seen else ("from", "to", "variables")
    _show("Wires", headings, wires if seen else [(source, to, names) for source, to, _, names in wires])
    _show("Delayed by one step", ("from", "to", "value at the start"), _delayed_rows(plan))
    _show("Faults", ("target", "fault", "signals"), _fault_rows(plan))
    direct = evaluate({instance.name: instance.fmu for instance in plan.instances}, plan.wires).direct
    _show("Why this order", ("instance", "after", "direct feedthrough of"), _order_rows(plan, direct))
    _show("Against the order", ("from", "to", "uses earlier values of"), _backward_rows(plan, direct))
    _tell(f"\n{doubtful if warned else 'No errors.'}")


def _tell(text: str) -> None:
    if json_and_latex.form() == "text":
        print(printable(text))


def _show(title: str, columns: Sequence[str], rows: Iterable[Sequence[str]], note: str = "") -> None:
    from yawbench.studies.tables import Table

    table = Table(title, columns, map(tuple, rows), [note] if note else [])
    print_tables([table] if table.rows else [])


def _number(value: object) -> str:
    return f"{float(value):.12g}"  # type: ignore[arg-type]


def _unit_rows(plan: Plan) -> Iterable[Sequence[str]]:
    for instance in plan.instances:
        yield instance.name, instance.fmu.name, f"{_number(1000 * instance.period * plan.step)} ms"


def _values(plan: Plan, defaults: bool) -> tuple[Sequence[Sequence[str]], int]:
    """Return a row for every value with its origin, and the number of defaults not shown."""
    files = plan.scenario.get("tyre_files", {})
    of_tyres = {axle: ValueOrigin("file", Path(file["file"]).name) for axle, file in files.items()}
    sources: dict[tuple[str, str, str], str] = {}
    takers: list[tuple[tuple[str, str, str], str]] = []
    hidden = 0
    cambered = {wire.source for wire in plan.wires if wire.output in CAMBER}
    for instance in plan.instances:
        own = {v.name: instance.parameter(v.name) for v in instance.fmu.of("parameter")}
        constants = {name: value for name, value in instance.constants.items() if name not in instance.series}
        shown: list[tuple[tuple[str, str], str]] = []
        for name, value in {**own, **constants}.items():
            source = instance.origin(name)
            matters = _matters(instance, name) or (
                instance.name in cambered and name.startswith("roll_camber")
            )
            if not defaults and (source in of_tyres.values() or (source == DEFAULT and not matters)):
                hidden += 1
                continue
            origin = source.detail if source.kind == "file" else source.kind
            shown.append(((_shown(value, instance.fmu.variables[name].unit), origin), name))
        for (text, origin), names in _grouped(shown).items():
            for name in fold(names):
                takers.append(((name, text, origin), instance.name))
                if defaults and origin == "default" and name in own:
                    sources.setdefault((name, text, origin), instance.fmu.variables[name].source)
    rows: list[tuple[str, str, str, str]] = [*_run_rows(plan)]
    for axle, origin_of_file in of_tyres.items():
        takes = [u.name for u in plan.instances if any(g.origin == origin_of_file for g in u.given.values())]
        what = f"{files[axle]['kind']}, {files[axle]['side']}"
        rows.append((f"tyres, {axle}", what, str(origin_of_file), ", ".join(takes)))
    for key, instances in _grouped(takers).items():
        rows.append((*key, ", ".join(instances)))
    for instance in plan.instances:
        for name, series in instance.series.items():
            how = "held" if series.held else "linear"
            rows.append(
                (name, f"{series.file}: {series.column}, {how}", str(instance.origin(name)), instance.name)
            )
    return [(*row, sources.get(row[:3], "")) if defaults else row for row in rows], hidden


def _run_rows(plan: Plan) -> Iterable[tuple[str, str, str, str]]:
    """Yield the rows of values that apply to the whole run."""
    origins = {str(change.target): change.origin for change in plan.changes}
    run = {
        **({"start_time": f"{_number(plan.start)} s"} if plan.start else {}),
        "stop_time": f"{_number(plan.time(plan.n_steps))} s",
        "step_size": f"{_number(plan.step)} s",
        "algorithm": plan.algorithm,
    }
    for name, value in run.items():
        yield name, value, origins.get(name, "scenario" if name in plan.scenario else "default"), "all"


def _derived(plan: Plan) -> Iterable[Sequence[str]]:
    """Return the rows of derived vehicle values, each with its formula."""
    takers = _grouped(
        ((name, given.origin.detail), instance.name)
        for instance in plan.instances
        for name, given in instance.given.items()
        if given.origin.kind == "derived"
    )
    return [(*key, ", ".join(instances)) for key, instances in takers.items()]


def _beside_tyres(plan: Plan) -> Iterable[Sequence[str]]:
    """Yield the deviation of stiffnesses stated for the axles from those of the scenario's tyres."""
    from yawbench.tyre_stand import cornering_stiffness
    from yawbench.vehicles.car import TYRE_FORCES
    from yawbench.vehicles.derivations import STATIC_LOADS, STIFFNESSES, known_car

    takers = _grouped(
        ((name, float(instance.parameters[name])), instance.name)
        for instance in plan.instances
        for name in STIFFNESSES
        if name in instance.parameters and instance.origin(name).kind not in ("derived", "default")
    )
    tyres = [u for u in plan.instances if {v.name for v in u.fmu.of("output")} >= {*TYRE_FORCES}]
    car = known_car(plan.scenario.get("vehicle_parameters", {})) if takers and len(tyres) == 1 else None
    if car is None or not car.values.keys() >= {*STATIC_LOADS}:
        return
    loads = {wheel: car.values[name] for wheel, name in zip(WHEELS[::2], STATIC_LOADS, strict=True)}
    try:
        of_tyres = dict(zip(STIFFNESSES, cornering_stiffness(tyres[0], loads).values(), strict=True))
    except (ValueError, YawbenchError):
        return  # the tyre model does not provide it
    for (name, stated), instances in takers.items():
        of_axle = 2.0 * of_tyres[name]
        difference = f"{round(100.0 * (stated / of_axle - 1.0), 1) + 0.0:+g} %" if of_axle else ""
        yield name, _shown(stated, "N/rad"), _shown(of_axle, "N/rad"), difference, ", ".join(instances)


def _idle(plan: Plan) -> list[str]:
    """Return the values of the vehicle file that neither an instance nor the scene uses."""
    from yawbench.vehicles.quantities import BODY

    names = [name for name in plan.scenario.get("vehicle_parameters", {}) if name not in BODY]
    return [
        name for name in names if not any(instance.fmu.variables.get(name) for instance in plan.instances)
    ]


def _matters(instance: Instance, name: str) -> bool:
    """Return whether a default is worth showing: it concerns the car, its speed or the road."""
    from yawbench.vehicles.suspicious_values import OF_CAR
    from yawbench.vocabulary.facts import FACTS

    return name in OF_CAR or any(
        name in fact.inputs or fact.counts(instance, name) for fact in FACTS.values()
    )


def _shown(value: Value | None, measure: str | None) -> str:
    text = f"{value:.6g}" if isinstance(value, float) else f"{value}"
    if isinstance(value, str):  # of many lines, perhaps
        text = cut("; ".join(filter(None, map(str.strip, value.splitlines()))), 60)
    return f"{text}{f' {measure}' if measure and measure != '1' else ''}"


def _wire_rows(plan: Plan) -> Iterable[tuple[str, str, str, str]]:
    """Yield source, target, the control side's view of the source (truth, measured, estimated), variables."""
    from yawbench.orchestrator.wiring.control_side import seen_as

    instances = {instance.name: instance.fmu.variables for instance in plan.instances}
    for (source, target), wires in _grouped(((w.source, w.target), w) for w in plan.wires).items():
        shown = []
        examples = {name: w for w in reversed(wires) for name in (w.input, star(w.input))}
        for end, name in fold_wires([(w.output, w.input) for w in wires]):
            example = examples[name]
            of, measure = instances[source][example.output].unit, instances[target][example.input].unit
            ends = end if end == name else f"{end} → {name}"
            if example.converts:
                measure = f"{of or '?'} → {measure or '?'}: {_scaled(example)}"
            shown.append(f"{ends} [{measure}]" if measure else ends)
        yield source, target, seen_as(wires[0], plan.instances), ", ".join(shown)


def _delayed_rows(plan: Plan) -> Iterable[Sequence[str]]:
    instances = {instance.name: instance.fmu for instance in plan.instances}
    for wire in plan.wires:
        if wire.delayed:
            variable = instances[wire.target].variables[wire.input]
            ends = f"{wire.source}.{wire.output}", f"{wire.target}.{wire.input}"
            yield *ends, f"{variable.start:g} {variable.unit or ''}".rstrip()


def _fault_rows(plan: Plan) -> Iterable[Sequence[str]]:
    from yawbench.orchestrator.results.record_of_plan import faults_of

    for fault in faults_of(plan):
        yield fault.on, fault.fault, ", ".join(fold(fault.at))


def _scaled(wire: Wire) -> str:
    """Return the conversion of a wire in words."""
    offset = f" {'-' if wire.offset < 0 else '+'} {abs(wire.offset):.6g}" if wire.offset else ""
    return f"x {wire.gain:.6g}{offset}"


def _grouped(pairs: Iterable[tuple[K, V]]) -> dict[K, list[V]]:
    """Group pairs by key, keeping the order of keys and values."""
    groups: dict[K, list[V]] = {}
    for key, value in pairs:
        groups.setdefault(key, []).append(value)
    return groups


def _order_rows(plan: Plan, direct: Iterable[Wire]) -> Iterable[Sequence[str]]:
    before = _grouped((w.target, w) for w in direct if not _is_backward(w, plan))
    for instance in plan.instances:
        if wires := before.get(instance.name):
            sources = dict.fromkeys(wire.source for wire in wires)
            yield instance.name, ", ".join(sources), ", ".join(fold([wire.input for wire in wires]))


def _backward_rows(plan: Plan, direct: Iterable[Wire]) -> Iterable[Sequence[str]]:
    backward = _grouped(((w.source, w.target), w) for w in direct if _is_backward(w, plan))
    for (source, target), wires in backward.items():
        yield source, target, ", ".join(fold([w.output for w in wires]))


def _is_backward(wire: Wire, plan: Plan) -> bool:
    """Return whether a wire leads to its source itself or to an instance that is evaluated before it."""
    order = [instance.name for instance in plan.instances]
    return order.index(wire.source) >= order.index(wire.target)
