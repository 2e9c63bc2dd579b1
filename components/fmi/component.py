"""Base class of all components: the FMI 2.0 interface of an FMU written in Python.

A component declares parameters, inputs and outputs on its class and overrides up to four methods:

    configure()         derives values from the parameters `self.p`; called after every change of them
    start(t, u)         sets the state at start time from the inputs u; may be called repeatedly
    advance(t, h, u)    advances the state from t to t + h [s]
    output(t, u)        returns all outputs at t in declared order, without side effects

`u` is the list of all inputs in declared order, `*` expanded to fl, fr, rl, rr; `self.by_signal(u)`
has one item per declared signal instead, a list of four for a `*`. All attributes that a component
sets on `self` in these methods are its state: they are saved and restored with the FMU state, bit
for bit, without being declared.

PythonFMU 0.7.0 requires the following, which this class does for all components:

* No exception leaves a component: PythonFMU would release the instance twice and crash the process.
  Every entry point catches everything and logs one sentence and the traceback; all later steps of
  the instance return False.
* Log text is used as a printf format and as UTF-8, so `%` is doubled and characters that cannot be
  encoded are escaped.
* `get_real` and `set_real` look all values up in one list; per-variable getters cost three times
  as much. Setting all inputs, or reading all outputs, is a single slice.
* Until initialization ends, state and outputs are computed when they are read, so inputs
  may be set in any order before that.
* The resource folder is removed from `sys.path` again, so that the path does not grow with every
  instance of a process.
"""

import copy
import os
import pickle
import sys
import traceback
from collections.abc import Callable, Sequence
from operator import itemgetter
from typing import Any, ClassVar
from xml.etree.ElementTree import Element

from pythonfmu.enums import Fmi2Status
from pythonfmu.fmi2slave import Fmi2Slave

from yawbench.vocabulary.roles import ROLES
from yawbench.vocabulary.wheels import wheels

from . import model_description
from .variables import (
    NoParameters,
    VariableSpec,
    check_parameter,
    input_variables,
    output_variables,
    parameter_variables,
)

_CATEGORY = {
    Fmi2Status.ok: "logAll",
    Fmi2Status.warning: "logStatusWarning",
    Fmi2Status.discard: "logAll",
    Fmi2Status.error: "logStatusError",
    Fmi2Status.fatal: "logStatusFatal",
}


def _picker(inputs: Sequence[str | VariableSpec]) -> Callable[[list[float]], tuple[Any, ...]]:
    """Return a function that groups the list of all inputs into one item per declared signal."""
    places: list[int | slice] = []
    end = 0
    for item in inputs:
        begin = end
        end += len(wheels(item if isinstance(item, str) else item.name))
        places.append(begin if end == begin + 1 else slice(begin, end))
    if len(places) > 1:
        return itemgetter(*places)
    return lambda u: tuple([u[place] for place in places])


def _unsigned(references: Sequence[int]) -> list[int]:
    """Return value references as the host passed them; PythonFMU's library makes those from 2^31 negative."""
    return [reference % 2**32 for reference in references]


def _to_host(variable: VariableSpec, value: Any) -> Any:
    """Return a value as hosts see it: of an Enumeration, the number of the choice, from 1."""
    choices = variable.choices
    return choices.index(value) + 1 if choices is not None and value in choices else value


def _from_host(variable: VariableSpec, value: Any) -> Any:
    """Return what a host has set, of an Enumeration the choice; wrong numbers are refused later."""
    choices = variable.choices
    return choices[value - 1] if choices is not None and 1 <= value <= len(choices) else value


class Component(Fmi2Slave):
    """A component of the test bench. The first line of a subclass's docstring describes its FMU."""

    Parameters: ClassVar[type] = NoParameters
    inputs: ClassVar[tuple[str | VariableSpec, ...]] = ()
    outputs: ClassVar[tuple[str | VariableSpec, ...]] = ()
    sampled: ClassVar[bool] = False
    """True for a component that samples (controller, allocator): its outputs are discrete."""

    author: ClassVar[str] = ""
    copyright: ClassVar[str] = ""
    license: ClassVar[str] = ""
    host_packages: ClassVar[tuple[str, ...]] = ()
    """Packages outside the standard library that the Python of every host must have, such as "numpy"."""

    by_signal: ClassVar[Any]
    """Getter of the inputs `u`, one item per declared signal: a number, or a list of four for a `*`."""

    variables: ClassVar[tuple[VariableSpec, ...]] = ()
    fmu_name: ClassVar[str] = ""
    """Name of the FMU: `<role>_<file>`, unless the class sets another."""

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        folder, _, file = cls.__module__.rpartition(".")
        role = ROLES.get(folder.rpartition(".")[2])
        if "fmu_name" not in cls.__dict__:
            cls.fmu_name = f"{role.name}_{file}" if role else file
        ins = input_variables(cls.inputs)
        outs = output_variables(cls.outputs, [v.name for v in ins], discrete=cls.sampled)
        pars = parameter_variables(cls.Parameters)
        pars.sort(key=lambda v: v.type != "Real")  # stable sort: Reals get the lowest references
        cls.variables = (*ins, *outs, *pars)
        cls.by_signal = staticmethod(_picker(cls.inputs))
        cls._n_in = len(ins)
        cls._n_io = len(ins) + len(outs)
        cls._n_real = sum(v.type == "Real" for v in cls.variables)
        cls._tunable = frozenset(i for i, v in enumerate(cls.variables) if v.variability == "tunable")
        cls._in_refs = list(range(cls._n_in))
        cls._out_refs = list(range(cls._n_in, cls._n_io))
        names = [v.name for v in cls.variables]
        repeated = {name for name in names if names.count(name) > 1}
        if repeated:
            raise TypeError(f"{cls.__name__} declares {', '.join(sorted(repeated))} twice")

    _n_in: ClassVar[int] = 0
    _n_io: ClassVar[int] = 0
    _n_real: ClassVar[int] = 0
    _tunable: ClassVar[frozenset[int]] = frozenset()
    _in_refs: ClassVar[list[int]] = []
    _out_refs: ClassVar[list[int]] = []

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.modelName = self.fmu_name
        self.description = (type(self).__doc__ or self.fmu_name).strip().splitlines()[0]
        if "logger" in kwargs:  # created by PythonFMU's library; its builder restores sys.path itself
            sys.path[:] = [entry for entry in sys.path if entry != self.resources]
        self._not_state = frozenset((*self.__dict__, "_not_state"))
        # All attributes set below, and those that the subclass adds, are the FMU state.
        self._values: list[Any] = [
            0.0 if v.start is None else float(v.start) for v in self.variables[: self._n_real]
        ]
        self._others: list[Any] = [v.start for v in self.variables[self._n_real :]]
        self._start_time = 0.0
        self._initializing = True  # until initialization ends, outputs follow inputs at once
        self._stale = True
        self._configured = False
        self._failed = False
        self.p: Any = None

    # ---- for the subclass -------------------------------------------------------------------

    def configure(self) -> None:
        """Derive values from the parameters `self.p`."""

    def start(self, t: float, u: list[float]) -> None:
        """Set the state at start time `t` [s] from the inputs `u`."""

    def advance(self, t: float, h: float, u: list[float]) -> None:
        """Advance the state from `t` to `t + h` [s] with the inputs `u`."""

    def output(self, t: float, u: list[float]) -> tuple[float, ...] | list[float]:
        """Return all outputs at `t` [s], in declared order, without side effects."""
        raise NotImplementedError

    def warn(self, message: str) -> None:
        """Send a warning to the simulation's log."""
        self.log(message, Fmi2Status.warning)

    def log(
        self,
        msg: str,
        status: Fmi2Status = Fmi2Status.ok,
        category: str | None = None,
        debug: object = None,
    ) -> None:
        """Send `msg` to the simulation's log, safe for a host that prints it with printf."""
        text = str(msg).replace("\0", "\\0").encode("utf-8", "backslashreplace").decode()
        super().log(text.replace("%", "%%"), Fmi2Status(status), category or _CATEGORY[status])

    # ---- FMI: life cycle --------------------------------------------------------------------

    def setup_experiment(
        self, start_time: float, stop_time: float | None = None, tolerance: float | None = None
    ) -> None:
        self._start_time = start_time
        self._stale = True

    def enter_initialization_mode(self) -> None:
        try:
            self._configure()
        except BaseException:
            self._fail("initialization failed", self._start_time)

    def exit_initialization_mode(self) -> None:
        try:
            if self._stale:
                self._refresh()
            self._initializing = False
        except BaseException:
            self._fail("initialization failed", self._start_time)

    def do_step(self, current_time: float, step_size: float) -> bool:
        if self._failed:
            return False
        try:
            if not self._configured:
                self._configure()
            values = self._values
            n = self._n_in
            u = values[:n]
            self.advance(current_time, step_size, u)
            values[n : self._n_io] = self._checked_output(current_time + step_size, u)
            return True
        except BaseException:
            self._fail("step failed", current_time)
            return False

    def _configure(self) -> None:
        """Update the parameters from the values that have been set."""
        if self._configured:
            return
        values = {}
        for variable, value in zip(
            self.variables[self._n_io :], self._values[self._n_io :] + self._others, strict=True
        ):
            check_parameter(variable, value)
            values[variable.name] = value
        self.p = self.Parameters(**values)
        self.configure()
        self._configured = True

    def _refresh(self) -> None:
        """Update parameters, state and outputs from the values that have been set."""
        self._configure()
        values = self._values
        n = self._n_in
        u = values[:n]
        self.start(self._start_time, u)
        values[n : self._n_io] = self._checked_output(self._start_time, u)
        self._stale = False

    def _checked_output(self, t: float, u: list[float]) -> list[float]:
        """Return the outputs, with their number checked."""
        outputs: Any = self.output(t, u)
        if outputs is None:
            raise TypeError("output() returned nothing; it must return all outputs in declared order")
        y = list(map(float, outputs))
        if len(y) != self._n_io - self._n_in:
            raise TypeError(f"output() gave {len(y)} values for {self._n_io - self._n_in} outputs")
        return y

    def _fail(self, what: str, t: float) -> None:
        """Log the current exception, as a sentence and as a traceback, and mark the instance as failed."""
        self._failed = True
        try:
            kind, error, trace = sys.exc_info()
            room = os.path.dirname(os.path.abspath(__file__))
            home = os.path.dirname(room)
            machinery = [os.path.join(room, name) for name in ("component.py", "variables.py")]
            lines = [(frame.filename, frame.lineno, frame.name) for frame in traceback.extract_tb(trace)]
            if lines and lines[-1][2] == "_checked_output":  # `output` returned a bad value: point to it
                code = type(self).output.__code__
                lines.append((code.co_filename, code.co_firstlineno, code.co_name))
            where = ""
            for file, line, _ in lines:
                path = os.path.abspath(file)
                if path.startswith(home + os.sep) and path not in machinery:
                    relative = path[len(home) + 1 :].replace(os.sep, "/")
                    where = f" ({relative}:{line})"
            inputs = ", ".join(
                f"{v.name} = {x!r}" for v, x in zip(self.variables[: self._n_in], self._values, strict=False)
            )
            name = kind.__name__ if kind else "error"
            text = f"{what} at t = {t:.9g} s: {name}: {error}{where}"
            if inputs:
                text += f"; inputs: {inputs}"
            self.log(text, Fmi2Status.error)
            full = "".join(traceback.format_exception(kind, error, trace))
            self.log(full, Fmi2Status.error, "traceback")
        except BaseException as e:
            self.log(f"{what} ({type(e).__name__} while reporting it)", Fmi2Status.error)

    # ---- FMI: values ------------------------------------------------------------------------

    def get_real(self, vrs: list[int]) -> list[float]:
        if self._stale and self._initializing and not self._failed:
            try:
                if any(self._n_in <= vr < self._n_io for vr in vrs):
                    self._refresh()
            except BaseException:
                self._fail("initialization failed", self._start_time)
        try:
            if vrs == self._out_refs:
                return self._values[self._n_in : self._n_io]
            if vrs and not 0 <= min(vrs) <= max(vrs) < self._n_real:
                wrong = next(vr for vr in vrs if not 0 <= vr < self._n_real)
                raise TypeError(f"{self._name_of(wrong)} is not of type Real")
            values = self._values
            return [values[vr] for vr in vrs]
        except BaseException:
            self._fail(f"reading Real {_unsigned(vrs)} failed", self._start_time)
            return [float("nan")] * len(vrs)

    def set_real(self, vrs: list[int], values: list[float]) -> None:
        try:
            if self._initializing:
                self._set_before_start(self._values, vrs, values, 0, self._n_real)
            elif vrs == self._in_refs:
                self._values[: self._n_in] = values
            else:
                stored = self._values
                for vr, value in zip(vrs, values, strict=True):
                    if vr in self._tunable:
                        self._configured = False
                    elif not 0 <= vr < self._n_in:
                        raise ValueError(f"{self._name_of(vr)} cannot be set after initialization")
                    stored[vr] = value
        except BaseException:
            self._fail(f"setting Real {_unsigned(vrs)} failed", self._start_time)

    def _set_before_start(
        self, store: list[Any], vrs: list[int], values: list[Any], first: int, end: int
    ) -> None:
        for vr, value in zip(vrs, values, strict=True):
            if not first <= vr < end or self._n_in <= vr < self._n_io:
                raise ValueError(f"{self._name_of(vr)} cannot be set")
            store[vr - first] = value
            if vr >= self._n_io:
                self._configured = False
        self._stale = True

    def _name_of(self, vr: int) -> str:
        known = 0 <= vr < len(self.variables)
        return self.variables[vr].name if known else f"value reference {vr % 2**32}"

    def _get_other(self, vrs: list[int], kind: str, blank: Any) -> list[Any]:
        try:
            self._check_kind(vrs, kind)
            return [_to_host(self.variables[vr], self._others[vr - self._n_real]) for vr in vrs]
        except BaseException:
            self._fail(f"reading {kind} {_unsigned(vrs)} failed", self._start_time)
            return [blank] * len(vrs)

    def _set_other(self, vrs: list[int], values: list[Any], kind: str) -> None:
        try:
            if not self._initializing:
                raise ValueError(f"{self._name_of(vrs[0])} cannot be set after initialization")
            self._check_kind(vrs, kind)
            end = len(self.variables)
            stored = [_from_host(self.variables[vr], x) for vr, x in zip(vrs, values, strict=True)]
            self._set_before_start(self._others, vrs, stored, self._n_real, end)
        except BaseException:
            self._fail(f"setting {kind} {_unsigned(vrs)} failed", self._start_time)

    def _check_kind(self, vrs: list[int], kind: str) -> None:
        """Raise TypeError if a variable is set and read as another type, an Enumeration as Integer."""
        for vr in vrs:
            known = 0 <= vr < len(self.variables)
            type = self.variables[vr].fmi_type.replace("Enumeration", "Integer") if known else ""
            if type != kind:
                raise TypeError(f"{self._name_of(vr)} is not of type {kind}")

    def get_integer(self, vrs: list[int]) -> list[int]:
        return self._get_other(vrs, "Integer", 0)

    def get_boolean(self, vrs: list[int]) -> list[bool]:
        return self._get_other(vrs, "Boolean", False)

    def get_string(self, vrs: list[int]) -> list[str]:
        return self._get_other(vrs, "String", "")

    def set_integer(self, vrs: list[int], values: list[int]) -> None:
        self._set_other(vrs, values, "Integer")

    def set_boolean(self, vrs: list[int], values: list[bool]) -> None:
        self._set_other(vrs, [bool(value) for value in values], "Boolean")

    def set_string(self, vrs: list[int], values: list[str]) -> None:
        self._set_other(vrs, ["" if value is None else value for value in values], "String")

    # ---- FMI: state -------------------------------------------------------------------------

    def _get_fmu_state(self) -> dict[str, Any]:
        try:
            kept = {k: v for k, v in self.__dict__.items() if k not in self._not_state}
            return copy.deepcopy(kept)
        except BaseException:
            self._fail("saving the state failed", self._start_time)
            return {}

    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        try:
            if not isinstance(state, dict) or "_values" not in state:
                raise ValueError("not a state of this FMU")
            fresh = copy.deepcopy(state)
            for name in [k for k in self.__dict__ if k not in self._not_state]:
                del self.__dict__[name]
            self.__dict__.update(fresh)
        except BaseException:
            self._fail("restoring the state failed", self._start_time)

    @staticmethod
    def _fmu_state_to_bytes(state: dict[str, Any]) -> bytes:
        try:
            return pickle.dumps(state, protocol=4)
        except BaseException:
            return b""

    @staticmethod
    def _fmu_state_from_bytes(state: bytes) -> dict[str, Any]:
        try:
            restored = pickle.loads(state)
            return restored if isinstance(restored, dict) else {}
        except BaseException:
            return {}

    # ---- FMI: model description -------------------------------------------------------------

    def to_xml(self, model_options: dict[str, str] | None = None) -> Element:
        """Return the complete model description; `model_options` is not used."""
        return model_description.to_xml(
            name=self.fmu_name,
            description=self.description or "",
            variables=self.variables,
            credits={key: getattr(type(self), key) for key in ("author", "copyright", "license")},
            host_packages=self.host_packages,
        )
