"""Components in plain Python, run in the process of the run without an FMU.

A function, an object or a component class is wrapped in a component with the model description of an
equivalent FMU, so that wiring, master and results treat it like an FMU.
"""

from __future__ import annotations

import copy
import functools
import hashlib
import inspect
import math
import sys
import uuid
from collections import namedtuple
from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any, Protocol
from urllib.parse import quote
from xml.etree import ElementTree

import numpy as np

from yawbench.components.fmi.component import Component
from yawbench.components.fmi.variables import VariableSpec, output, parameter, signal
from yawbench.fmus.description import describe
from yawbench.fmus.fmu import Fmu, Value, ValueRef
from yawbench.foundation.errors import ScenarioError
from yawbench.foundation.messages import counted, listed
from yawbench.orchestrator.master.instance import Buffers, ExperimentSetup, Status, StepCalls, nothing_to_do
from yawbench.orchestrator.master.log import ERROR, OK, Log
from yawbench.orchestrator.plan import Instance
from yawbench.vocabulary.roles import ROLES
from yawbench.vocabulary.wheels import wheels

from . import _parameters, arguments
from ._native import in_native_code, of_function, of_object, zipped
from ._parameters import ProgramParameters

__all__ = ["Controller", "ControllerLike", "PythonComponent", "output", "parameter", "signal"]

HOME = Path("/python")
"""Folder in the virtual paths of Python components, for messages and records; it does not exist."""


class Controller(Protocol):
    """Object in plain Python that replaces the FMU of an instance, usually of the controller.

        >>> class Gain:
        ...     inputs = ("yaw_rate_ref", "yaw_rate")
        ...     outputs = ("yaw_moment",)
        ...
        ...     def output(self, t, u):
        ...         return 2e4 * (u.yaw_rate_ref - u.yaw_rate)
        >>> controller: yb.Controller = Gain()
        >>> base.swap(controller=controller).run().metric("rms_error(yaw_rate)") < 0.1
        True

    It may also have `start(t, u)`, called once before the first step, `advance(t, h, u)`, called for every
    step of `h` [s], `step_size`, the time between two samples [s], and `sampled`, False if its outputs are
    continuous in time.
    """

    @property
    def inputs(self) -> Sequence[str | VariableSpec]:
        """Names of the inputs, or results of `signal`."""

    @property
    def outputs(self) -> Sequence[str | VariableSpec]:
        """Names of the outputs, or results of `output`."""

    def output(self, t: float, u: Any, /) -> Numbers:
        """Return the values of the outputs in SI, in order.

        Args:
            t: time [s].
            u: a named tuple with the values of the inputs in SI.
        """


Numbers = float | Sequence[float] | np.ndarray
"""Return value of a program: the value of its only output, or a value for each, shape (outputs,)."""

ControllerLike = str | Path | Callable[..., Numbers] | Controller | type[Component]
"""Replacement for the FMU of an instance: the name or path of an FMU, or plain Python."""


class PythonComponent:
    """Component in plain Python, used in a plan like an FMU.

    Args:
        program: a function, an object with `output`, or a component class.
        instance: the instance whose FMU it replaces, for messages.
        role: role of that instance (controller, driver, ...); it determines the outputs of a function.
        label: replaces its name, to distinguish objects of a class.

    Attributes:
        step_size: sampling time [s]; None if the program declares none.
        parameters: name -> value in a function or an object.

    Raises:
        ScenarioError: the program is none of these, or its declarations are invalid.
    """

    def __init__(self, program: object, *, instance: str, role: str, label: str = "") -> None:
        self.program = program
        try:
            self.component, self._translated = _component(program, role)
            self.step_size = _step_size(program)
            self._xml = _described(self._made(instance).to_xml())
            self.parameters = _parameters.brought_along(program, self.component)
        except ScenarioError as error:
            raise ScenarioError(f"{instance}: {error}", code="controller-invalid") from None
        except Exception as error:  # the user's code may raise anything while its declarations are read
            kind = "" if isinstance(error, (TypeError, ValueError)) else f"{type(error).__name__}: "
            raise ScenarioError(
                f"{instance}: {_name(program)}: {kind}{error}", code="controller-invalid"
            ) from error
        name = self.component.fmu_name
        self.path = HOME / instance / f"{quote(label, safe=' ') or name}.fmu"
        digest = hashlib.sha256(self._xml + _parameters.text_of(program)).hexdigest()
        files = {"modelDescription.xml": self._xml}
        described = describe(files, zipped(files), self.path)
        self.fmu: Fmu = replace(described, sha256=digest, generation_tool="Python, no FMU", role=role)

    def as_now(self) -> Fmu:
        """Return its FMU in its current state, with a native library or the reason why there is none."""
        return in_native_code(self.program, self.component, self._translated, self.fmu, self._xml)

    def open(self, instance: Instance, log: Log) -> PythonInstance:
        """Return an instance of the component for a run, in Python."""
        return PythonInstance(instance, self._made(instance.name), log)

    def _made(self, instance: str) -> Component:
        return self.component(instance_name=instance, resources="")


class PythonInstance:
    """Instance of a Python component, with the interface of `orchestrator.master.instance.FmuInstance`."""

    def __init__(self, instance: Instance, component: Component, log: Log) -> None:
        self.name = instance.name
        self.component = component
        self._log = log

    @property
    def error(self) -> BaseException | None:
        """Exception raised by the program, if any."""
        return getattr(self.component, "error", None)

    def connect(self, buffers: Buffers) -> StepCalls:
        inputs, input_refs, outputs, output_refs, time, step = buffers
        component, status = self.component, self._status
        into, of = ([ref.reference for ref in refs] for refs in (input_refs, output_refs))

        def set_inputs() -> Status:
            component.set_real(into, inputs.tolist())
            return status()

        def do_step() -> Status:
            return status(component.do_step(time.value, step.value))

        def get_outputs() -> Status:
            outputs[:] = component.get_real(of)
            return status()

        return StepCalls(set_inputs if into else nothing_to_do, do_step, get_outputs if of else nothing_to_do)

    def part(self, kind: str) -> str:
        return kind

    def put(self, refs: Sequence[ValueRef], values: Sequence[Value]) -> Status:
        set_values = getattr(self.component, f"set_{refs[0].type.lower()}")
        set_values([ref.reference for ref in refs], list(values))
        return self._status()

    def fetch(self, refs: Sequence[ValueRef]) -> tuple[Status, list[Value]]:
        get_values = getattr(self.component, f"get_{refs[0].type.lower()}")
        values = get_values([ref.reference for ref in refs])
        return self._status(), values

    def setup(self, experiment: ExperimentSetup) -> Status:
        self.component.setup_experiment(experiment.start, experiment.stop, experiment.tolerance)
        return self._status()

    def enter(self) -> Status:
        self.component.enter_initialization_mode()
        return self._status()

    def save_state(self) -> dict[str, Any] | None:
        return self.component._get_fmu_state() if self._status() == OK else None

    def restore_state(self, state: dict[str, Any]) -> bool:
        self.component._set_fmu_state(state)
        return self._status() == OK

    def exit(self) -> Status:
        self.component.exit_initialization_mode()
        return self._status()

    def note(self, status: Status) -> Status:
        return status

    def free(self) -> None:
        pass

    def _status(self, stepped: bool = True) -> Status:
        """Forward the component's messages; return its status."""
        queue = self.component.log_queue
        if queue:
            for message in queue:
                self._log.add(
                    self.name, int(message.status), message.category, message.msg.replace("%%", "%")
                )
            queue.clear()
        return OK if stepped and not self.component._failed else ERROR


def _described(description: ElementTree.Element) -> bytes:
    """Return a model description as text, without date, and with a GUID derived from the rest."""
    description.attrib.pop("generationDateAndTime", None)
    description.set("guid", "")
    digest = hashlib.sha256(ElementTree.tostring(description)).digest()
    description.set("guid", f"{{{uuid.UUID(bytes=digest[:16])}}}")
    return ElementTree.tostring(description)


def _component(program: Any, role: str) -> tuple[type[Component], type[Component]]:
    """Return the component class made from a function, an object or a class.

    The second item is the class for the translator.
    """
    if isinstance(program, type):
        if issubclass(program, Component):
            return _reporting(program), program
        raise ScenarioError(
            f"{_name(program)} is a class; give an object of it, {_name(program)}()",
            code="controller-invalid",
        )
    if hasattr(program, "output") or callable(program):
        try:
            copy.deepcopy(program)
        except Exception as error:
            text = f"{_name(program)} cannot be copied for a run: {error}"
            raise ScenarioError(text, code="controller-invalid") from error
        return _of_object(program) if hasattr(program, "output") else _of_function(program, role)
    raise ScenarioError(
        f"{_name(program)} is not a controller: give the name or path of an FMU, a function of signals, "
        "an object with inputs, outputs and a method output(t, u), or a component class",
        code="controller-invalid",
    )


def _of_function(function: Callable[..., Any], role: str) -> tuple[type[Component], type[Component]]:
    """Return component classes that call a function of signals; its outputs are those of the role."""
    known = {item.name: item.outputs for item in ROLES.values()}
    if role not in known:
        raise ScenarioError(
            f"{_name(function)}: the outputs of a function are known for {', '.join(known)} only; "
            "give an object with outputs",
            code="controller-invalid",
        )
    parameters = inspect.signature(function).parameters.values()
    plain = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    if unnamed := [str(p) for p in parameters if p.kind not in plain]:
        raise ScenarioError(
            f"{_name(function)}: {unnamed[0]} is not the name of a signal: name each, as in (yaw_rate, t)",
            code="controller-invalid",
        )
    names = [p.name for p in parameters if p.default is p.empty]
    inputs = [name for name in names if name != "t"]
    outputs = [item for pattern in known[role] for item in wheels(pattern)]
    called = _parameters.of_function(function)
    made = _parameters.of_object(function, [*names, *called.values])
    own = called | made

    def result(self: Any, t: float, u: Sequence[float]) -> tuple[float, ...]:
        values = dict(zip(inputs, u, strict=True)) | self._passed
        returned = self._program(**values, t=t) if "t" in names else self._program(**values)
        return _numbers(returned, outputs)

    def start(self: Any, t: float, u: Sequence[float]) -> None:
        self._passed = called.chosen(self.p)
        self._program = _parameters.fresh(function, made, self.p)
        self._returned = result(self, t, u)

    def advance(self: Any, t: float, h: float, u: Sequence[float]) -> None:
        self._returned = result(self, t + h, u)

    def compute(self: Any, t: float, u: Sequence[float]) -> tuple[float, ...]:
        return self._returned  # type: ignore[no-any-return]

    checks = {"start": start, "advance": advance, "output": compute, "_fail": _fail}
    both = checks, of_function(function, inputs, outputs, "t" in names, list(called.values), made)
    checked, bare = (_class(function, inputs, known[role], members, own) for members in both)
    return checked, bare


def _of_object(program: Any) -> tuple[type[Component], type[Component]]:
    """Return component classes; each instance of the first uses a copy of the object."""
    for wanted in ("inputs", "outputs"):
        if not hasattr(program, wanted):
            text = f"{_name(program)} has no {wanted}: name its signals, as in ('yaw_rate',)"
            raise ScenarioError(text, code="controller-invalid")
    own = _parameters.of_object(program, _names(program))

    def configure(self: Any) -> None:
        self._program = _parameters.fresh(program, own, self.p)

    members = {"configure": configure, "_fail": _fail}
    for method in ("output", "advance", "start"):
        if hasattr(program, method):
            if not callable(getattr(program, method)):
                arguments.refuse(method, "a method", getattr(program, method))
            members[method] = _passing_on(method)
    outputs = _names_of(program.outputs, "outputs")
    both = members, of_object(program, outputs, own)
    checked, bare = (_class(program, program.inputs, program.outputs, each, own) for each in both)
    return checked, bare


def _passing_on(method: str) -> Callable[..., Any]:
    def call(self: Any, t: float, *rest: Any) -> Any:
        *step, u = rest
        if method == "start":
            self.configure()  # each object is started once, also if outputs are read before the first step
        result = getattr(self._program, method)(t, *step, self._named(*u))
        if method == "output":
            return _numbers(result, [variable.name for variable in self.variables[self._n_in : self._n_io]])
        return None

    return call


def _class(
    program: Any,
    inputs: Sequence[Any],
    outputs: Sequence[Any],
    members: dict[str, Any],
    own: ProgramParameters,
) -> type[Component]:
    """Return a component class; outputs without declared dependencies depend on all inputs."""
    inputs, outputs = _signals(inputs, "inputs"), _signals(outputs, "outputs")
    names = [item if isinstance(item, str) else item.name for item in inputs]
    declared = tuple(output(item, *names) if isinstance(item, str) else item for item in outputs)
    scalars = [name for pattern in names for name in wheels(pattern)]
    members |= {
        "inputs": tuple(inputs),
        "outputs": declared,
        "sampled": arguments.flag(getattr(program, "sampled", True), "sampled"),
        "fmu_name": _name(program),
        "__doc__": inspect.getdoc(program) or f"{_name(program)}, plain Python.",
        "_named": staticmethod(namedtuple("Inputs", scalars)),
    }
    return own.without_units(type(_name(program), (Component,), members | own.members(_name(program))))


def _names(program: Any) -> list[str]:
    """Return the names of an object's inputs and outputs."""
    return [*_names_of(program.inputs, "inputs"), *_names_of(program.outputs, "outputs")]


def _names_of(signals: Any, name: str) -> list[str]:
    declared = _signals(signals, name)
    return [x for item in declared for x in wheels(item if isinstance(item, str) else item.name)]


def _reporting(component: type[Component]) -> type[Component]:
    """Return a subclass that stores the exceptions of its code, otherwise unchanged."""
    same = {name: getattr(component, name) for name in ("__doc__", "__module__", "fmu_name")}
    return type(component.__name__, (component,), {**same, "_fail": _fail})


def _signals(signals: Any, name: str) -> tuple[str | VariableSpec, ...]:
    """Return the declared signals: names, or results of `signal` and `output`."""
    wanted = "a tuple of names, ('yaw_rate',)"
    declared = arguments.items(signals, name, wanted)
    for k, item in enumerate(declared):
        if not isinstance(item, VariableSpec):
            declared[k] = arguments.text(item, f"{name}[{k}]")
    return tuple(declared)


def _step_size(program: Any) -> float | None:
    """Return the declared sampling time of a program [s]; None if it declares none."""
    wanted = getattr(program, "step_size", None)
    if wanted is None:
        return None
    step_size = arguments.number(wanted, "step_size")
    if step_size <= 0.0:
        raise ValueError(f"step_size: must be a time above 0 s (got {step_size:g})")
    return step_size


def _numbers(returned: Any, outputs: Sequence[str]) -> tuple[float, ...]:
    """Return the outputs computed by a program as numbers.

    Raises:
        TypeError, ValueError: the value is not valid; the message names the output.
    """
    if type(returned) is float and len(outputs) == 1:
        return (returned,)
    if returned is None:
        raise TypeError(f"nothing was returned; return {listed(outputs)}")
    shape = returned.shape if isinstance(returned, (np.ndarray, np.generic)) else None
    if len(outputs) == 1 and (shape == () or not isinstance(returned, (list, tuple, np.ndarray))):
        values = [returned]
    elif shape is not None and len(shape) != 1:
        raise ValueError(
            f"an array of shape {shape} was returned for {listed(outputs)}: give numbers in order"
        )
    else:
        values = arguments.items(returned, listed(outputs), "numbers in order")
    if len(values) != len(outputs):
        raise ValueError(
            f"output() returned {len(values)} values for {counted(len(outputs), 'output')}: {listed(outputs)}"
        )
    return tuple(_number(value, name) for value, name in zip(values, outputs, strict=True))


def _number(value: Any, output: str) -> float:
    """Return an output as a number; the master checks that it is finite."""
    converted = arguments.plain(value)
    if isinstance(converted, bool) or not isinstance(converted, (int, float, Fraction)):
        arguments.refuse(output, "a number", value)
    try:
        return float(converted)
    except OverflowError:
        return math.inf if converted > 0 else -math.inf


def _fail(self: Any, what: str, t: float) -> None:
    """Store the exception for the caller of the run, then fail like any component.

    Exceptions that are not errors (Ctrl-C, exit) pass through to the caller.
    """
    error = sys.exc_info()[1]
    if error is not None and not isinstance(error, Exception):
        raise error
    self.error = self.__dict__.get("error") or error
    Component._fail(self, what, t)


def _name(program: Any) -> str:
    """Return the name of a program."""
    if isinstance(program, functools.partial):
        return _name(program.func)
    name = getattr(program, "__name__", None)
    if name == "<lambda>":
        return "function"
    return name if type(name) is str and name.isidentifier() else type(program).__name__
