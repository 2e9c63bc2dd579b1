"""Units without FMUs: behaviours in plain Python that answer the master's few calls."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

from yawbench.fmus.fmu import Fmu, ValueRef, Variable
from yawbench.orchestrator.fault_kinds import FaultySignal
from yawbench.orchestrator.master.instance import ExperimentSetup, FmuInstance, StepCalls
from yawbench.orchestrator.master.log import ERROR, OK, Log
from yawbench.orchestrator.plan import Instance, Plan, Wire
from yawbench.orchestrator.signal_names import SignalName


class Behaviour:
    """Behaviour of a fake instance. `u` maps input names to values; outputs map names to values."""

    inputs: Sequence[str] = ()
    outputs: Mapping[str, Sequence[str] | None] = {}  # output -> inputs it depends on directly
    types: Mapping[str, str] = {}  # of variables that are no Reals
    parameters: Mapping[str, float] = {}
    discrete = False

    def start(self, u: dict[str, Any]) -> None:
        """Set the state at t = 0."""

    def advance(self, t: float, h: float, u: dict[str, Any]) -> None:
        """Step from t to t + h."""

    def output(self, t: float, u: dict[str, Any]) -> dict[str, Any]:
        raise NotImplementedError


class FakeSlave:
    """A slave that runs a behaviour and writes down in `calls` what it was asked to do."""

    def __init__(self, unit: Instance, behaviour: Behaviour, log: Log) -> None:
        self.name = unit.name
        self.behaviour = behaviour
        self.log = log
        self.calls: list[tuple[Any, ...]] = []
        self.worst = OK
        self.freed = 0
        self.names = {v.reference: v.name for v in unit.fmu.variables.values()}
        self.values: dict[str, Any] = {
            v.name: (v.start if v.start is not None else 0.0) for v in unit.fmu.variables.values()
        }
        self.time = 0.0
        self.started = False

    def connect(self, buffers) -> StepCalls:
        inputs, input_places, outputs, output_places, time, step = buffers
        input_names = self._named(input_places)
        output_names = self._named(output_places)

        def set_inputs() -> int:
            self.calls.append(("set", *inputs.tolist()))
            self.values.update(zip(input_names, inputs.tolist(), strict=True))
            return OK

        def take_step() -> int:
            self.calls.append(("step", time.value, step.value))
            try:
                self.behaviour.advance(time.value, step.value, self.values)
            except Exception as error:
                self.log.add(self.name, ERROR, "", f"{type(error).__name__}: {error}")
                return ERROR
            self.time = time.value + step.value
            return OK

        def get_outputs() -> int:
            self._refresh()
            outputs[:] = [self.values[name] for name in output_names]
            return OK

        return StepCalls(set_inputs, take_step, get_outputs)

    def _refresh(self) -> None:
        if not self.started:
            self.behaviour.start(self.values)
        self.values.update(self.behaviour.output(self.time, self.values))

    def part(self, kind: str) -> str:
        return kind

    def _named(self, places: Sequence[ValueRef]) -> list[str]:
        return [self.names[place.reference] for place in places]

    def put(self, places: Sequence[ValueRef], values: Sequence[Any]) -> int:
        names = self._named(places)
        self.calls.append(("put", places[0].type, tuple(names), tuple(values)))
        self.values.update(zip(names, values, strict=True))
        return OK

    def fetch(self, places: Sequence[ValueRef]) -> tuple[int, list[Any]]:
        self._refresh()
        return OK, [self.values[name] for name in self._named(places)]

    def setup(self, experiment: ExperimentSetup) -> int:
        self.calls.append(("setup", experiment.start, experiment.stop))
        return OK

    def enter(self) -> int:
        self.calls.append(("enter",))
        return OK

    def exit(self) -> int:
        self.calls.append(("exit",))
        self._refresh()
        self.started = True
        return OK

    def ended(self) -> float | None:
        return None

    def note(self, status: int) -> int:
        self.worst = max(self.worst, status)
        return status

    def free(self) -> None:
        self.freed += 1


def make_fmu(name: str, behaviour: Behaviour) -> Fmu:
    """Return the description of a fake unit."""
    variables = {}
    names = [*behaviour.inputs, *behaviour.outputs, *behaviour.parameters]
    for reference, variable in enumerate(names):
        causality = "input" if variable in behaviour.inputs else "parameter"
        depends_on: tuple[str, ...] | None = None
        if variable in behaviour.outputs:
            causality = "output"
            listed = behaviour.outputs[variable]
            depends_on = None if listed is None else tuple(listed)
        variability = "discrete" if behaviour.discrete and causality == "output" else "continuous"
        kind = behaviour.types.get(variable, "Real")
        variables[variable] = Variable(
            variable, 10 * reference + 7, kind, causality, variability, "1" if kind == "Real" else None,
            behaviour.parameters.get(variable), None, None, "", depends_on,
        )  # fmt: skip
    path = Path(f"{name}.fmu")
    return Fmu(name, path, path, "0" * 64, "{0}", name, "fake", variables)


def make_plan(
    units: Mapping[str, Behaviour],
    wires: Iterable[str] = (),
    *,
    step: Fraction | str = "1/10",
    n_steps: int = 10,
    algorithm: str = "extrapolated",
    periods: Mapping[str, int] | None = None,
    constants: Mapping[str, Mapping[str, Any]] | None = None,
    parameters: Mapping[str, Mapping[str, Any]] | None = None,
    record: Iterable[str] | None = None,
    faults: Iterable[FaultySignal] = (),
) -> Plan:
    """Return a plan of fake units in the order given; wires are written `a.x -> b.y [gain offset]`."""
    made = tuple(
        Instance(
            name, make_fmu(name, b), (periods or {}).get(name, 1),
            dict((parameters or {}).get(name, {})), dict((constants or {}).get(name, {})),
        )
        for name, b in units.items()
    )  # fmt: skip
    pairs = [_wire(text) for text in wires]
    recorded = record if record is not None else [f"{n}.{o}" for n, b in units.items() for o in b.outputs]
    return Plan(
        made,
        tuple(pairs),
        tuple(map(SignalName.parse, recorded)),
        Fraction(step),
        n_steps,
        algorithm,
        title="fake",
        scenario={"title": "fake"},
        faults=tuple(faults),
    )


def _wire(text: str) -> Wire:
    source, _, target, *scale = text.split()
    return Wire(*source.split("."), *target.split("."), *(float(number) for number in scale))


class Stage:
    """An opener for `simulate` that keeps the slaves it made; `kinds`: what makes those of some units."""

    def __init__(self, units: Mapping[str, Behaviour], **kinds: Callable[..., FakeSlave]) -> None:
        self.units, self.kinds = units, kinds
        self.slaves: dict[str, FakeSlave] = {}

    def __call__(self, unit: Instance, log: Log, corrupted: set[Path]) -> FmuInstance:
        slave = self.kinds.get(unit.name, FakeSlave)(unit, self.units[unit.name], log)
        self.slaves[unit.name] = slave
        return slave


class Function(Behaviour):
    """Outputs that are functions of the inputs at the same instant: `lambda t, u: {...}`."""

    def __init__(
        self,
        function: Callable[[float, dict[str, Any]], dict[str, Any]],
        inputs: Sequence[str],
        outputs: Sequence[str],
    ) -> None:
        self.inputs = inputs
        self.outputs = {name: list(inputs) for name in outputs}
        self.output = function  # type: ignore[method-assign]


class Mass(Behaviour):
    """x'' = force, exact for a force that is constant over the step."""

    inputs = ("force",)
    outputs: Mapping[str, Sequence[str] | None] = {"x": (), "v": ()}

    def start(self, u: dict[str, Any]) -> None:
        self.x, self.v = 1.0, 0.0

    def advance(self, t: float, h: float, u: dict[str, Any]) -> None:
        self.x += h * self.v + h * h / 2 * u["force"]
        self.v += h * u["force"]

    def output(self, t: float, u: dict[str, Any]) -> dict[str, Any]:
        return {"x": self.x, "v": self.v}


class Integrator(Behaviour):
    """x' = rate, from x(0) = 1."""

    inputs = ("rate",)
    outputs: Mapping[str, Sequence[str] | None] = {"x": ()}

    def start(self, u: dict[str, Any]) -> None:
        self.x = 1.0

    def advance(self, t: float, h: float, u: dict[str, Any]) -> None:
        self.x += h * u["rate"]

    def output(self, t: float, u: dict[str, Any]) -> dict[str, Any]:
        return {"x": self.x}


class Clock(Behaviour):
    """Puts out functions of time alone."""

    def __init__(self, **functions: Callable[[float], float]) -> None:
        self.functions = functions
        self.outputs = dict.fromkeys(functions, ())

    def output(self, t: float, u: dict[str, Any]) -> dict[str, Any]:
        return {name: function(t) for name, function in self.functions.items()}


class Witness(Behaviour):
    """Writes down when and what it gets: `middle` is integrated, `end` passed through."""

    inputs = ("middle", "end")
    outputs = {"y": ("end",)}

    def __init__(self) -> None:
        self.seen: list[tuple[float, float, float, float]] = []

    def advance(self, t: float, h: float, u: Mapping[str, float]) -> None:
        self.seen.append((t, h, u["middle"], u["end"]))

    def output(self, t: float, u: Mapping[str, float]) -> dict[str, float]:
        return {"y": u["end"]}


class Mixed(Behaviour):
    """One output of every type there is beside Real."""

    outputs: Mapping[str, Sequence[str] | None] = {"count": (), "flag": (), "word": (), "mode": (), "x": ()}
    types: Mapping[str, str] = {
        "count": "Integer",
        "flag": "Boolean",
        "word": "String",
        "mode": "Enumeration",
    }

    def output(self, t, u):
        k = round(10 * t)
        return {"count": k, "flag": k % 2 == 1, "word": f'"{k}", {k}', "mode": k % 3, "x": t}


class Echo(Mixed):
    """Puts out what comes in."""

    inputs = tuple(f"{name}_in" for name in Mixed.outputs)
    outputs = {name: (f"{name}_in",) for name in Mixed.outputs}
    types = {**Mixed.types, **{f"{name}_in": kind for name, kind in Mixed.types.items()}}

    def output(self, t, u):
        return {name: u[f"{name}_in"] for name in Mixed.outputs}
