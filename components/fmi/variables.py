"""How a component declares what it shows to the outside.

Parameters are the fields of a frozen dataclass (`parameter`), inputs and outputs are names from
the signal dictionary, or signals of the component's own (`signal`), outputs say in `output` on
which inputs they depend directly at the same instant. `*` in a name stands for the four wheels.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from vocabulary.signals import SIGNALS
from vocabulary.units import UNITS
from vocabulary.wheels import WHEEL_NAMES, WHEELS, wheels

_FMI_TYPES = {"float": "Real", "int": "Integer", "bool": "Boolean", "str": "String"}


class DeclarationError(TypeError):
    """A component declares something that cannot be: found when its class is read."""


@dataclass(frozen=True)
class Variable:
    """One scalar variable of an FMU, ready for the model description."""

    name: str
    causality: str  # "input", "output" or "parameter"
    type: str  # "Real", "Integer", "Boolean" or "String"
    unit: str | None
    description: str
    variability: str
    start: Any = None
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[str, ...] | None = None
    depends_on: tuple[str, ...] = ()
    optional: bool = False
    source: str = ""


@dataclass(frozen=True)
class Signal:
    """A declared input or output before `*` is expanded."""

    name: str
    unit: str
    description: str
    start: float = 0.0
    minimum: float | None = None
    maximum: float | None = None
    depends_on: tuple[str, ...] = ()
    optional: bool = False


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
) -> Signal:
    """Declare an input or output, from the signal dictionary unless unit and text are given.

        >>> signal("roll_angle", optional=True).unit
        'rad'
        >>> signal("tyre_pressure_*", "Pa", "Inflation pressure", start=2.2e5).start
        220000.0

    Args:
        name: spelled-out snake_case; `*` stands for the four wheels.
        unit: one of `units.UNITS`; must agree with the dictionary for a name that is in it.
        description: one line; the dictionary's text if left out.
        start: value of an input before anybody sets it.
        minimum, maximum: limits written into the model description; the dictionary's if left out.
        depends_on: of an output, the inputs it depends on directly at the same instant. A `*`
            there means the same wheel if the output's own name has one, else all four.
        optional: of an input, that the unit does its work at the start value if nothing drives it.

    Raises:
        DeclarationError: unknown name without unit and text, a name that is no lower-case
            identifier, unknown unit, or a unit that contradicts the dictionary.
    """
    plain = name.replace("*", "x")
    if not (plain.isidentifier() and plain.isascii() and plain == plain.lower()):
        raise DeclarationError(f"signal {name!r}: a name is made of lower-case letters, digits and _")
    entry = name
    if name not in SIGNALS:
        for wheel in WHEELS:  # a single wheel of a four-wheel signal
            if name.endswith("_" + wheel):
                entry = name[: -len(wheel)] + "*"
    known = SIGNALS.get(entry)
    if known is None and (unit is None or description is None):
        raise DeclarationError(
            f"signal {name!r} is not in the signal dictionary: give its unit and description"
        )
    if known is not None and unit is not None and unit != known.unit:
        raise DeclarationError(f"signal {name!r} has the unit {known.unit}, not {unit}")
    unit = unit or known.unit  # type: ignore[union-attr]
    if unit not in UNITS:
        raise DeclarationError(f"signal {name!r}: unknown unit {unit!r}; known: {', '.join(UNITS)}")
    text = description or known.text  # type: ignore[union-attr]
    if minimum is None and known is not None:
        minimum = known.minimum
    return Signal(name, unit, text, start, minimum, maximum, tuple(depends_on), optional)


def output(name: str, *depends_on: str, unit: str | None = None, text: str | None = None) -> Signal:
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
) -> Any:
    """Declare a parameter as a dataclass field: default, unit, description, source and allowed values.

        >>> @dataclass(frozen=True)
        ... class Parameters:
        ...     gain: float = parameter(20000.0, "N.m.s/rad", "Moment per yaw-rate error", "chosen: example")
        >>> Parameters().gain
        20000.0

    The FMI type follows from the default's type. `unit` is None for everything but Real.
    `source` says where the default comes from, and its first word of what kind that is: "paper A, table 1",
    "chosen: why", "erratum: what is printed", or anything else for other literature.
    """
    options = None if choices is None else tuple(choices)
    metadata = {
        "type": _FMI_TYPES[type(default).__name__],
        "unit": unit,
        "description": description,
        "minimum": minimum,
        "maximum": maximum,
        "choices": options,
        "source": source,
    }
    return field(default=default, metadata=metadata)


def like(parameters: type, name: str, default: float | int | bool | str | None = None) -> Any:
    """Declare anew a field that a dataclass of parameters has, with another default value if given."""
    (original,) = (f for f in dataclasses.fields(parameters) if f.name == name)
    if default is None or default == original.default:
        return field(default=original.default, metadata=original.metadata)
    return field(default=default, metadata={**original.metadata, "source": "chosen: for this FMU"})


@dataclass(frozen=True)
class NoParameters:
    """For a component that has none."""


def parameter_variables(parameters: type) -> list[Variable]:
    """Return the parameters declared by a dataclass, in order.

    Raises:
        DeclarationError: a field not made by `parameter`, or an unknown unit.
    """
    variables = []
    for f in dataclasses.fields(parameters):
        m = f.metadata
        if "type" not in m:
            raise DeclarationError(f"{parameters.__name__}.{f.name} is not made by parameter(...)")
        if m["type"] == "Real" and m["unit"] not in UNITS:
            raise DeclarationError(
                f"{parameters.__name__}.{f.name}: unknown unit {m['unit']!r}; known: {', '.join(UNITS)}"
            )
        variables.append(
            Variable(
                f.name,
                "parameter",
                m["type"],
                m["unit"],
                m["description"],
                "fixed",
                f.default,
                m["minimum"],
                m["maximum"],
                m["choices"],
                source=m["source"],
            )
        )
    return variables


def check_parameter(variable: Variable, value: Any) -> None:
    """Raise ValueError, naming the allowed values, if `value` is none of them."""
    if variable.choices is not None and value not in variable.choices:
        raise ValueError(f"{variable.name} must be one of {', '.join(variable.choices)} (got {value!r})")
    if variable.type == "Real" and not -1e308 <= value <= 1e308:
        raise ValueError(f"{variable.name} must be a finite number (got {value!r})")
    if variable.minimum is not None and value < variable.minimum:
        raise ValueError(f"{variable.name} must be at least {variable.minimum:g} (got {value!r})")
    if variable.maximum is not None and value > variable.maximum:
        raise ValueError(f"{variable.name} must be at most {variable.maximum:g} (got {value!r})")


def input_variables(declared: Iterable[str | Signal]) -> list[Variable]:
    """Return the scalar inputs of a declaration, `*` expanded, in order."""
    variables = []
    for item in declared:
        s = signal(item) if isinstance(item, str) else item
        variables += [
            Variable(
                name, "input", "Real", s.unit, _on_wheel(s, name), "continuous",
                float(s.start), s.minimum, s.maximum, optional=s.optional,
            )
            for name in wheels(s.name)
        ]  # fmt: skip
    return variables


def output_variables(
    declared: Iterable[str | Signal], inputs: Iterable[str], *, discrete: bool
) -> list[Variable]:
    """Return the scalar outputs of a declaration with their direct dependencies, in order.

    Raises:
        DeclarationError: an output depends on something that is no input.
    """
    names = list(inputs)
    variability = "discrete" if discrete else "continuous"
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
                raise DeclarationError(f"output {name} depends on {unknown[0]!r}, which is no input")
            ordered = tuple(n for n in names if n in sources)
            variables.append(
                Variable(
                    name, "output", "Real", s.unit, _on_wheel(s, name), variability,
                    None, s.minimum, s.maximum, None, ordered,
                )
            )  # fmt: skip
    return variables


def _on_wheel(s: Signal, name: str) -> str:
    """Return the description of one scalar, naming the wheel where there is one."""
    of_wheel = name.removesuffix("_true")
    wheel = WHEEL_NAMES.get(of_wheel[-2:]) if of_wheel[-3:-2] == "_" else None
    return s.description if wheel is None else f"{s.description}, {wheel}"
