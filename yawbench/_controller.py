"""Components in plain Python, run in the process of the run without an FMU.

A function, an object or a component class becomes a component with the model description that its FMU would
have, so that wiring, master and results treat it as they treat an FMU.
"""

from __future__ import annotations

import copy
import functools
import hashlib
import inspect
import io
import math
import sys
import zipfile
from collections import namedtuple
from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any, Protocol
from xml.etree import ElementTree

import numpy as np

from components.fmi.component import Component
from components.fmi.variables import VariableSpec, output, parameter, signal
from orchestrator.errors import ScenarioError
from orchestrator.fmu.description import describe
from orchestrator.master.instance import Buffers, ExperimentSetup, Status, StepCalls, nothing_to_do
from orchestrator.master.log import ERROR, OK, Log
from orchestrator.messages import counted, listed, short
from orchestrator.plan import Fmu, Instance, Value, ValueRef
from vocabulary.roles import ROLES
from vocabulary.wheels import wheels

from . import arguments

__all__ = ["Controller", "ControllerLike", "PythonComponent", "output", "parameter", "signal"]

HOME = Path("/python")
"""Folder in the made-up paths of Python components, used in messages and records; it does not exist."""


class Controller(Protocol):
    """An object in plain Python that replaces the FMU of an instance, usually of the controller.

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
        """Names of the inputs, or what `signal` returns."""

    @property
    def outputs(self) -> Sequence[str | VariableSpec]:
        """Names of the outputs, or what `output` returns."""

    def output(self, t: float, u: Any, /) -> Numbers:
        """Return the values of the outputs in SI, in order.

        Args:
            t: time [s].
            u: a named tuple with the values of the inputs in SI.
        """


Controller.__module__ = "yawbench"  # set here because a protocol has no other attributes than its members

Numbers = float | Sequence[float] | np.ndarray
"""What a program returns: the value of its only output, or one value for each, shape (outputs,)."""

ControllerLike = str | Path | Callable[..., Numbers] | Controller | type[Component]
"""What can replace the FMU of an instance: the name or path of an FMU, or plain Python."""


class PythonComponent:
    """What stands in for an FMU: a component class, and where in a plan it belongs.

    Args:
        given: a function, an object with `output`, or a component class.
        unit: the unit whose FMU it replaces, for messages.
        role: of that unit (controller, driver, ...); its signals are the outputs of a function.

    Attributes:
        step_size: time between two samples [s], None where the program does not say.

    Raises:
        ScenarioError: it is none of these, or declares what cannot be.
    """

    def __init__(self, given: object, *, unit: str, role: str) -> None:
        self.given = given
        try:
            self.component = _component(given, role)
            self.step_size = _step_size(given)
            xml = ElementTree.tostring(self._made(unit).to_xml())
        except ScenarioError as error:
            raise ScenarioError(f"{unit}: {error}", code="controller-invalid") from None
        except (TypeError, ValueError) as error:
            raise ScenarioError(f"{unit}: {_name(given)}: {error}", code="controller-invalid") from error
        except Exception as error:  # the user's code may raise anything while its declarations are read
            raise ScenarioError(
                f"{unit}: {_name(given)}: {arguments.said(error)}", code="controller-invalid"
            ) from error
        name = self.component.fmu_name
        self.path = HOME / f"{name}.fmu"
        digest = hashlib.sha256(xml + _source(given)).hexdigest()
        described = describe({"modelDescription.xml": xml}, _archived(xml), self.path)
        self.fmu: Fmu = replace(described, sha256=digest, generation_tool="Python, no FMU", role=role)

    def open(self, unit: Instance, log: Log) -> PythonInstance:
        """Return an instance of the component for a run."""
        return PythonInstance(unit, self._made(unit.name), log)

    def _made(self, unit: str) -> Component:
        return self.component(instance_name=unit, resources="")


class PythonInstance:
    """An instance of a program with the interface of `orchestrator.master.instance.FmuInstance`."""

    def __init__(self, unit: Instance, component: Component, log: Log) -> None:
        self.name = unit.name
        self._component = component
        self._log = log

    @property
    def error(self) -> BaseException | None:
        """The exception that the program has raised, None if there is none."""
        return getattr(self._component, "error", None)

    def connect(self, buffers: Buffers) -> StepCalls:
        inputs, input_places, outputs, output_places, time, step = buffers
        component, status = self._component, self._status
        into, of = ([place.reference for place in places] for places in (input_places, output_places))

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

    def put(self, places: Sequence[ValueRef], values: Sequence[Value]) -> Status:
        set_values = getattr(self._component, f"set_{places[0].type.lower()}")
        set_values([place.reference for place in places], list(values))
        return self._status()

    def fetch(self, places: Sequence[ValueRef]) -> tuple[Status, list[Value]]:
        get_values = getattr(self._component, f"get_{places[0].type.lower()}")
        values = get_values([place.reference for place in places])
        return self._status(), values

    def setup(self, experiment: ExperimentSetup) -> Status:
        self._component.setup_experiment(experiment.start, experiment.stop, experiment.tolerance)
        return self._status()

    def enter(self) -> Status:
        self._component.enter_initialization_mode()
        return self._status()

    def exit(self) -> Status:
        self._component.exit_initialization_mode()
        return self._status()

    def note(self, status: Status) -> Status:
        return status

    def free(self) -> None:
        pass

    def _status(self, stepped: bool = True) -> Status:
        """Pass on the component's messages; return its status."""
        queue = self._component.log_queue
        if queue:
            for message in queue:
                self._log.add(
                    self.name, int(message.status), message.category, message.msg.replace("%%", "%")
                )
            queue.clear()
        return OK if stepped and not self._component._failed else ERROR


def _archived(xml: bytes) -> bytes:
    """Return an FMU archive that contains only a model description."""
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as members:
        members.writestr("modelDescription.xml", xml)
    return archive.getvalue()


def _component(given: Any, role: str) -> type[Component]:
    """Return the component class made from a function, an object or a class."""
    if arguments.is_a(given, type):
        if issubclass(given, Component):
            return _reporting(given)
        raise ScenarioError(
            f"{_name(given)} is a class; give an object of it, {_name(given)}()", code="controller-invalid"
        )
    if hasattr(given, "output"):
        return _of_object(given)
    if callable(given):
        return _of_function(given, role)
    raise ScenarioError(
        f"{_name(given)} is no controller: give the name or path of an FMU, a function of signals, "
        "an object with inputs, outputs and a method output(t, u), or a component class",
        code="controller-invalid",
    )


def _of_function(function: Callable[..., Any], role: str) -> type[Component]:
    """Return a component class that calls a function of signals; its outputs are those of the role."""
    known = {one.name: one.outputs for one in ROLES.values()}
    if role not in known:
        raise ScenarioError(
            f"{_name(function)}: what it returns is not known for a unit that is none of {', '.join(known)}; "
            "give an object with outputs",
            code="controller-invalid",
        )
    parameters = inspect.signature(function).parameters.values()
    plain = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    if unnamed := [str(p) for p in parameters if p.kind not in plain]:
        raise ScenarioError(
            f"{_name(function)}: {unnamed[0]} names no signal: name each, as in (yaw_rate, t)",
            code="controller-invalid",
        )
    names = [p.name for p in parameters if p.default is p.empty]
    inputs = [name for name in names if name != "t"]
    outputs = [one for pattern in known[role] for one in wheels(pattern)]

    def compute(self: Component, t: float, u: Sequence[float]) -> Any:
        given = dict(zip(inputs, u, strict=True))
        result = function(**given, t=t) if "t" in names else function(**given)
        return _numbers(result, outputs)

    return _class(function, inputs, known[role], {"output": compute})


def _of_object(given: Any) -> type[Component]:
    """Return a component whose instances each work with a copy of an object."""
    for wanted in ("inputs", "outputs"):
        if not hasattr(given, wanted):
            raise ScenarioError(
                f"{_name(given)} has no {wanted}: name its signals, as in ('yaw_rate',)",
                code="controller-invalid",
            )

    def __init__(self: Any, **kwargs: Any) -> None:
        super(component, self).__init__(**kwargs)
        try:
            self._given = copy.deepcopy(given)  # so that a run does not affect the next one
        except Exception as error:
            raise ScenarioError(
                f"{_name(given)} cannot be copied for a run: {error}", code="controller-invalid"
            ) from error

    members = {"__init__": __init__}
    for method in ("output", "advance", "start"):
        if hasattr(given, method):
            if not callable(getattr(given, method)):
                arguments.refuse(method, "a method", getattr(given, method))
            members[method] = _passing_on(method)
    component = _class(given, given.inputs, given.outputs, members)
    return component


def _passing_on(method: str) -> Callable[..., Any]:
    def call(self: Any, t: float, *rest: Any) -> Any:
        *step, u = rest
        result = getattr(self._given, method)(t, *step, self._named(*u))
        if method != "output":
            return None
        return _numbers(result, [one.name for one in self.variables[self._n_in : self._n_io]])

    return call


def _class(
    given: Any, inputs: Sequence[Any], outputs: Sequence[Any], members: dict[str, Any]
) -> type[Component]:
    """Return a component class; outputs without declared dependencies depend on all inputs."""
    inputs, outputs = _signals(inputs, "inputs"), _signals(outputs, "outputs")
    names = [one if isinstance(one, str) else one.name for one in inputs]
    declared = tuple(output(one, *names) if isinstance(one, str) else one for one in outputs)
    scalars = [name for pattern in names for name in wheels(pattern)]
    members |= {
        "inputs": tuple(inputs),
        "outputs": declared,
        "sampled": arguments.flag(getattr(given, "sampled", True), "sampled"),
        "fmu_name": _name(given),
        "__doc__": inspect.getdoc(given) or f"{_name(given)}, plain Python.",
        "_named": staticmethod(namedtuple("Inputs", scalars)),
        "_fail": _fail,
    }
    return type(_name(given), (Component,), members)


def _reporting(component: type[Component]) -> type[Component]:
    """Return a subclass that keeps the exceptions of its code, otherwise unchanged."""
    same = {name: getattr(component, name) for name in ("__doc__", "__module__", "fmu_name")}
    return type(component.__name__, (component,), {**same, "_fail": _fail})


def _signals(given: Any, name: str) -> tuple[str | VariableSpec, ...]:
    """Return declared signals: names, or the results of `signal` and `output`."""
    wanted = "a tuple of names, ('yaw_rate',)"
    found = arguments.items(given, name, wanted)
    for k, one in enumerate(found):
        if not arguments.is_a(one, VariableSpec):
            found[k] = arguments.text(one, f"{name}[{k}]")
    return tuple(found)


def _step_size(given: Any) -> float | None:
    """Return the sampling time that a program declares [s], None if it declares none."""
    wanted = getattr(given, "step_size", None)
    if wanted is None:
        return None
    found = arguments.number(wanted, "step_size")
    if found <= 0.0:
        raise ValueError(f"step_size: must be a time above 0 s (got {found:g})")
    return found


def _numbers(given: Any, outputs: Sequence[str]) -> tuple[float, ...]:
    """Return the values that a program has returned, one number for each output.

    Raises:
        TypeError, ValueError: the value is something else; names the output.
    """
    if type(given) is float and len(outputs) == 1:
        return (given,)
    if given is None:
        raise TypeError(f"nothing was returned; return {listed(outputs)}")
    shape = given.shape if arguments.is_a(given, np.ndarray, np.generic) else None
    if len(outputs) == 1 and (shape == () or not arguments.is_a(given, list, tuple, np.ndarray)):
        values = [given]
    elif shape is not None and len(shape) != 1:
        raise ValueError(
            f"an array of shape {shape} was returned for {listed(outputs)}: give numbers in order"
        )
    else:
        values = arguments.items(given, listed(outputs), "numbers in order")
    if len(values) != len(outputs):
        raise ValueError(
            f"output() gave {len(values)} values for {counted(len(outputs), 'output')}: {listed(outputs)}"
        )
    return tuple(_number(one, name) for one, name in zip(values, outputs, strict=True))


def _number(given: Any, output: str) -> float:
    """Return one output as a number; the master checks that it is finite."""
    found = arguments.plain(given)
    if arguments.is_a(found, bool) or not arguments.is_a(found, int, float, Fraction):
        arguments.refuse(output, "a number", given)
    try:
        return float(found)
    except OverflowError:
        return math.inf if found > 0 else -math.inf


def _fail(self: Any, what: str, t: float) -> None:
    """Keep the exception for the caller of the run, then fail like any component.

    Exceptions that are not errors (Ctrl-C, exit) pass through to the caller.
    """
    error = sys.exc_info()[1]
    if error is not None and not isinstance(error, Exception):
        raise error
    self.error = self.__dict__.get("error") or error
    Component._fail(self, what, t)


def _name(given: Any) -> str:
    """Return the name of a program."""
    if arguments.is_a(given, functools.partial):
        return _name(given.func)
    try:
        name = getattr(given, "__name__", None)
    except Exception:
        name = None
    if name == "<lambda>":
        return "function"
    return name if type(name) is str and name.isidentifier() else type(given).__name__


def _source(given: Any) -> bytes:
    """Return the program's source text if Python knows it, to tell different programs apart."""
    try:
        return inspect.getsource(
            given if callable(given) and not hasattr(given, "output") else type(given)
        ).encode()
    except Exception:  # there is no source, or inspecting the user's object fails
        return short(given).encode()
