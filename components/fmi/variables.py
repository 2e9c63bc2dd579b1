"""Declarations of a component's parameters, inputs and outputs.

Parameters are fields of a frozen dataclass (`parameter`). Inputs and outputs are names from the
signal dictionary, or the component's own signals (`signal`); `output` also lists the inputs on which
an output depends directly (feedthrough). `*` in a name means the four wheels.
"""

import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, make_dataclass, replace
from typing import Any

from yawbench.vocabulary.signals import SIGNALS
from yawbench.vocabulary.units import UNITS
from yawbench.vocabulary.vehicle import CAR
from yawbench.vocabulary.wheels import WHEEL_NAMES, WHEELS, wheels

_FMI_TYPES: dict[type, str] = {float: "Real", int: "Integer", bool: "Boolean", str: "String"}


class DeclarationError(TypeError):
    """Invalid declaration of a component, raised when its class is defined."""


@dataclass(frozen=True)
class VariableSpec:
    """Declaration of an FMU variable; a `*` in its name is not expanded yet."""

    name: str
    unit: str | None
    description: str
    causality: str = ""  # "input", "output" or "parameter"
    type: str = "Real"  # or "Integer", "Boolean" or "String"
    variability: str = "continuous"
    start: Any = None
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[str, ...] | None = None
    depends_on: tuple[str, ...] = ()
    optional: bool = False
    source: str = ""

    @property
    def fmi_type(self) -> str:
        """Its type in the FMU: a text with choices is an Enumeration, which more hosts can set."""
        return self.type if self.choices is None else "Enumeration"


def signal(
    name: str,
    unit: str | None = None,
    description: str | None = None,
    *,
    start: float = 0.0,
    minimum: float | None = None,
    maximum: float | None = None,
    depends_on: Iterable[str] = (),
    optional: bool = False,
) -> VariableSpec:
    """Declare an input or output; unit and text default to those of the signal dictionary.

        >>> signal("roll_angle", optional=True).unit
        'rad'
        >>> signal("tyre_pressure_*", "Pa", "Inflation pressure", start=2.2e5).start
        220000.0

    Args:
        name: spelled-out snake_case; `*` means the four wheels.
        unit: one of `units.UNITS`; must agree with the dictionary for a name that is in it.
        description: a single line; default: the dictionary's text.
        start: value of an input until it is set.
        minimum, maximum: limits written into the model description; default: the dictionary's.
        depends_on: for an output, the inputs on which it depends directly at the same instant. A `*`
            there means the same wheel if the output's own name has a `*`, else all four.
        optional: for an input, whether the component works at the start value if no wire drives it.

    Raises:
        DeclarationError: unknown name without unit and text, a name that is not a lower-case
            identifier, unknown unit, or a unit that contradicts the dictionary.
    """
    _check("signal", "name", name, str)
    what = f"signal {_shown(name)}"
    _check(what, "unit", unit, str, optional=True)
    _check(what, "description", description, str, optional=True)
    _check(what, "start", start, float)
    _check(what, "minimum", minimum, float, optional=True)
    _check(what, "maximum", maximum, float, optional=True)
    _check(what, "optional", optional, bool)
    sources = _names(what, "depends_on", depends_on)
    plain = name.replace("*", "x")
    if not (plain.isidentifier() and plain.isascii() and plain == plain.lower()):
        raise DeclarationError(f"{what}: a name is made of lower-case letters, digits and _")
    entry = name
    if name not in SIGNALS:
        for wheel in WHEELS:  # a single wheel of a four-wheel signal
            if name.endswith("_" + wheel):
                entry = name[: -len(wheel)] + "*"
    known = SIGNALS.get(entry)
    if known is None and (unit is None or description is None):
        raise DeclarationError(
            f"{what} is not in the signal dictionary: give its unit and description{_guess(name)}"
        )
    if known is not None and unit is not None and unit != known.unit:
        raise DeclarationError(f"{what} has the unit {known.unit}, not {_shown(unit)}")
    unit = unit or known.unit  # type: ignore[union-attr]
    if unit not in UNITS:
        raise DeclarationError(f"{what}: unknown unit {_shown(unit)}; known: {', '.join(UNITS)}")
    text = description or known.text  # type: ignore[union-attr]
    if minimum is None and known is not None:
        minimum = known.minimum
    return VariableSpec(
        name,
        unit,
        text,
        start=float(start),
        minimum=minimum,
        maximum=maximum,
        depends_on=sources,
        optional=optional,
    )


def _check(what: str, argument: str, value: Any, kind: type, *, optional: bool = False) -> None:
    """Raise DeclarationError if a value has the wrong type or is not finite; `optional` allows None."""
    if optional and value is None:
        return
    wanted = {str: "text", float: "a finite number", bool: "True or False"}[kind]
    if kind is not float:
        fits = type(value) is kind
    else:
        number = issubclass(type(value), (int, float)) and type(value) is not bool
        fits = number and abs(value) <= sys.float_info.max
    if not fits:
        raise DeclarationError(f"{what}: {argument} must be {wanted} (got {type(value).__name__})")


def _names(what: str, argument: str, value: Iterable[str]) -> tuple[str, ...]:
    """Return a tuple or list of strings as a tuple.

    Raises:
        DeclarationError: another type.
    """
    if type(value) not in (tuple, list):
        raise DeclarationError(f"{what}: {argument} must be a tuple of texts (got {type(value).__name__})")
    for item in value:
        _check(what, f"every item of {argument}", item, str)
    return tuple(value)


def _shown(text: str | None) -> str:
    """Return a text quoted for a message, shortened if long."""
    return repr(text if text is None or len(text) <= 60 else f"{text[:57]}...")


def _guess(name: str) -> str:
    """Return "; did you mean 'x'?" for a name similar to a name of the dictionary."""
    from difflib import get_close_matches  # slow to import, and not needed in FMUs

    likely = get_close_matches(name, SIGNALS, n=1, cutoff=0.65)
    return f"; did you mean {likely[0]!r}?" if likely else ""


def output(name: str, *depends_on: str, unit: str | None = None, text: str | None = None) -> VariableSpec:
    """Declare an output and the inputs on which it depends directly (see `signal`).

    >>> output("yaw_moment", "yaw_rate_ref", "yaw_rate").depends_on
    ('yaw_rate_ref', 'yaw_rate')
    """
    return signal(name, unit, text, depends_on=depends_on)


def parameter(
    default: float | int | bool | str,
    unit: str | None,
    description: str,
    source: str = "",
    *,
    minimum: float | None = None,
    maximum: float | None = None,
    choices: Iterable[str] | None = None,
    tunable: bool = False,
) -> Any:
    """Declare a parameter as a dataclass field: default, unit, description, source and allowed values.

        >>> @dataclass(frozen=True)
        ... class Parameters:
        ...     gain: float = parameter(20000.0, "N.m.s/rad", "Moment per yaw-rate error", "chosen: example")
        >>> Parameters().gain
        20000.0

    The FMI type follows from the default's type; a text with choices is an Enumeration. `unit` is None
    for all types but Real. A `tunable` Real, such as a gain, may be set between steps: `configure` is called
    before the next.
    `source` says where the default comes from; its first word is the kind of source: "paper A, table 1",
    "chosen: why", "erratum: what is printed", or any other text for other literature.
    """
    kind = _FMI_TYPES.get(type(default))
    if kind is None:
        known = ", ".join(kind.__name__ for kind in _FMI_TYPES)
        raise DeclarationError(f"parameter: default must be one of {known} (got {type(default).__name__})")
    _check("parameter", "tunable", tunable, bool)
    if kind == "Real":
        _check("parameter", "default", default, float)
    elif tunable:
        raise DeclarationError(f"parameter: only a float can be tunable (got {type(default).__name__})")
    _check("parameter", "unit", unit, str, optional=True)
    _check("parameter", "description", description, str)
    _check("parameter", "source", source, str)
    _check("parameter", "minimum", minimum, float, optional=True)
    _check("parameter", "maximum", maximum, float, optional=True)
    declared = VariableSpec(
        "",
        unit,
        description,
        causality="parameter",
        type=kind,
        variability="tunable" if tunable else "fixed",
        start=default,
        minimum=minimum,
        maximum=maximum,
        choices=None if choices is None else _names("parameter", "choices", choices),
        source=source,
    )
    return field(default=default, metadata={"declared": declared})


def of_car(
    default: float,
    source: str,
    *,
    text: str = "",
    minimum: float | None = None,
    maximum: float | None = None,
) -> Any:
    """Declare a parameter whose unit, description and minimum are in `vocabulary.vehicle`.

        >>> @dataclass(frozen=True)
        ... class Parameters:
        ...     frontal_area: float = of_car(1.8, "paper B, table 1")
        >>> parameter_variables(Parameters)[0].unit
        'm2'

    Args:
        default, source: as in `parameter`.
        text: replaces the dictionary's description.
        minimum: replaces the dictionary's.
        maximum: largest value.
    """
    return parameter(default, None, text, source, minimum=minimum, maximum=maximum)


def like(
    parameters: type, name: str, default: float | int | bool | str | None = None, source: str = ""
) -> Any:
    """Declare a copy of a parameter of another class, optionally with another default value."""
    (declared,) = (variable for variable in parameter_variables(parameters) if variable.name == name)
    if default is not None and (source or default != declared.start):
        declared = replace(declared, start=default, source=source or "chosen: for this FMU")
    return field(default=declared.start, metadata={"declared": declared})


def parameter_class(module: str, name: str, declared: Mapping[str, Any], bases: tuple[type, ...] = ()) -> Any:
    """Create a dataclass from a table of parameters.

    Args:
        module, name: of the class, so that its instances can be pickled with an FMU's state.
        declared: name -> result of `parameter`.
        bases: base dataclasses.
    """
    made = [(key, type(variable.default), variable) for key, variable in declared.items()]
    return make_dataclass(name, made, bases=bases, frozen=True, namespace={"__module__": module})


@dataclass(frozen=True)
class NoParameters:
    """Empty set of parameters."""


def parameter_variables(parameters: type) -> list[VariableSpec]:
    """Return the parameters declared by a dataclass, in order.

    Raises:
        DeclarationError: a field not made by `parameter`, or an unknown unit.
    """
    variables = []
    for f in fields(parameters):
        declared = f.metadata.get("declared")
        if declared is None:
            raise DeclarationError(f"{parameters.__name__}.{f.name} is not made by parameter(...)")
        variable = replace(declared, name=f.name)
        if variable.type == "Real" and variable.unit is None and f.name in CAR:
            known = CAR[f.name]
            least = known.minimum if variable.minimum is None else variable.minimum
            text = variable.description or known.text
            variable = replace(variable, unit=known.unit, description=text, minimum=least)
        if variable.type == "Real" and variable.unit not in UNITS:
            raise DeclarationError(
                f"{parameters.__name__}.{f.name}: unknown unit {variable.unit!r}; known: {', '.join(UNITS)}"
            )
        variables.append(variable)
    return variables


def check_parameter(variable: VariableSpec, value: Any) -> None:
    """Raise ValueError, naming the allowed values, if `value` is not allowed."""
    if variable.choices is not None and value not in variable.choices:
        raise ValueError(f"{variable.name} must be one of {', '.join(variable.choices)} (got {value!r})")
    if variable.type == "Real" and not -1e308 <= value <= 1e308:
        raise ValueError(f"{variable.name} must be a finite number (got {value!r})")
    if variable.minimum is not None and value < variable.minimum:
        raise ValueError(f"{variable.name} must be at least {variable.minimum:g} (got {value!r})")
    if variable.maximum is not None and value > variable.maximum:
        raise ValueError(f"{variable.name} must be at most {variable.maximum:g} (got {value!r})")


def input_variables(declared: Iterable[str | VariableSpec]) -> list[VariableSpec]:
    """Return the scalar inputs of a declaration, `*` expanded, in order."""
    variables = []
    for item in declared:
        s = signal(item) if isinstance(item, str) else item
        variables += [
            replace(s, name=name, description=_on_wheel(s, name), causality="input")
            for name in wheels(s.name)
        ]
    return variables


def output_variables(
    declared: Iterable[str | VariableSpec], inputs: Iterable[str], *, discrete: bool
) -> list[VariableSpec]:
    """Return the scalar outputs of a declaration with their direct dependencies, in order.

    Raises:
        DeclarationError: an output depends on a variable that is not an input.
    """
    names = list(inputs)
    variables = []
    for item in declared:
        s = signal(item) if isinstance(item, str) else item
        per_wheel = "*" in s.name
        for i, name in enumerate(wheels(s.name)):
            sources: list[str] = []
            for pattern in s.depends_on:
                expanded = wheels(pattern)
                sources += [expanded[i]] if per_wheel and len(expanded) == 4 else expanded
            unknown = [source for source in sources if source not in names]
            if unknown:
                raise DeclarationError(f"output {name} depends on {unknown[0]!r}, which is not an input")
            variable = replace(
                s,
                name=name,
                description=_on_wheel(s, name),
                causality="output",
                variability="discrete" if discrete else "continuous",
                start=None,
                depends_on=tuple(n for n in names if n in sources),
            )
            variables.append(variable)
    return variables


def _on_wheel(s: VariableSpec, name: str) -> str:
    """Return the description of a scalar, with the name of its wheel if it has one."""
    of_wheel = name.removesuffix("_true")
    wheel = WHEEL_NAMES.get(of_wheel[-2:]) if of_wheel[-3:-2] == "_" else None
    return s.description if wheel is None else f"{s.description}, {wheel}"
