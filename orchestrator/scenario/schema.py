"""The schema of scenario files, with their faults, and of vehicle files.

Paths (`vehicle`, an `fmu` that is a path) are relative to the scenario file. Values may be given with a unit
('90 km/h'). The unit of a parameter is known only when its FMU has been opened, so values are converted
during wiring.

    faults:
      - {on: sensor.yaw_rate, kind: freeze, from: 1.5, until: 3.0}
      - {on: plant.yaw_rate -> sensor, kind: bias, value: 0.5 deg/s}

A fault's location is `instance.output`, which affects everything that the output feeds and the results;
`instance.output -> instance` or `-> instance.input`, a wire to one target; or `instance.input`. A `*` matches
several variables, such as those of four wheels. In one line, as for `--fault` and in experiments, the
location is followed by `KIND VALUE share N every T seed N from T until T`, of which only the kind is needed;
several faults at one location are separated by `;` and act in this order.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args

from pydantic import (
    AfterValidator,
    ConfigDict,
    Discriminator,
    Field,
    InstanceOf,
    PlainValidator,
    Tag,
    WithJsonSchema,
    model_validator,
)
from pydantic_core.core_schema import no_info_after_validator_function

from yawbench.fmus.fmu import Value
from yawbench.foundation.errors import Diagnostic
from yawbench.foundation.messages import listed, short
from yawbench.vocabulary.facts import FACTS

from ..coupling_algorithms import ALGORITHMS
from ..plan import Given, Override, ValueOrigin, ValueSource
from ..signal_names import FAULTS, INPUTS, RESERVED, SignalName, Target, TargetKind
from .fault_schema import FaultSpec, location_of
from .quantities import parse_unit
from .schema_validation import Instant, OneOf, StrictModel, Time, in_unit
from .yaml_lines import Document, KeyPath, at, put

if TYPE_CHECKING:
    from typing_extensions import Self

AXLES = ("front", "rear")
PARAMETERS = "parameters"
LIKE_SAYS = "File of which everything is taken that this one does not change: its name or relative path"
AlgorithmName = Annotated[str, OneOf(ALGORITHMS)]


def endpoint(value: object) -> SignalName:
    """Return the variable of an instance, or several with a `*`, named by 'instance.variable'.

    Raises:
        ValueError: not of that form.
    """
    name = SignalName.parse(value) if isinstance(value, str) else None
    if name is None or not (name.instance and name.variable) or name.variable.count("*") > 1:
        raise ValueError(f"must be instance.variable, with at most one * in variable (got {value!r})")
    return name


def _unit_name(name: str) -> str:
    if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", name):
        raise ValueError(f"{name!r} cannot name an instance: use letters, digits and _")
    if name in RESERVED:
        raise ValueError(f"an instance cannot be named {name!r}: --set {name}.NAME means something else")
    return name


def plain_value(value: object) -> Value:
    """Return a value for a parameter or an input, unconverted.

    Raises:
        ValueError: it is neither a finite number nor true or false nor text.
    """
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f"must be a finite number (got {value!r})")
    if isinstance(value, (bool, int, float, str)):
        return value
    raise ValueError("has no value" if value is None else f"must be one value (got {short(value)})")


def array_value(value: object) -> list[Any]:
    """Return the values of an array: a list, row by row, or a list for every row.

    Raises:
        ValueError: one of them is not a value.
    """
    assert isinstance(value, list)
    if not value:
        raise ValueError("has no values")
    return [array_value(item) if isinstance(item, list) else plain_value(item) for item in value]


def _end(value: object) -> SignalName | list[str]:
    if not isinstance(value, list):
        return endpoint(value)
    if not value or not all(isinstance(name, str) and name and "." not in name for name in value):
        raise ValueError(f"must be names of instances (got {short(value)})")
    return value


def _source(value: object) -> SignalName | list[str] | None:
    return None if value is None else _end(value)


def _tyres(value: object) -> dict[str, str]:
    if isinstance(value, str) and value:
        return dict.fromkeys(AXLES, value)
    texts = value.values() if isinstance(value, dict) else ()
    if (
        isinstance(value, dict)
        and sorted(value) == sorted(AXLES)
        and all(t and isinstance(t, str) for t in texts)
    ):
        return value
    raise ValueError(f"must be a tyre property file, or one each for front and rear (got {short(value)})")


def _tolerance(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 < value < 1:
        raise ValueError(f"must be a number between 0 and 1 (got {short(value)})")
    return float(value)


_VARIABLES = {"type": "string", "pattern": r"^[^.]+\.(?=.)[^*]*\*?[^*]*$"}
_ENDS = [_VARIABLES, {"type": "array", "items": {"type": "string", "pattern": r"^[^.]+$"}, "minItems": 1}]
_TEXT = {"type": "string", "minLength": 1}
_OF_AXLES = {
    "type": "object",
    "properties": dict.fromkeys(AXLES, _TEXT),
    "required": [*AXLES],
    "additionalProperties": False,
}

Scalar = Annotated[
    Value, PlainValidator(plain_value), WithJsonSchema({"type": ["number", "string", "boolean"]})
]
Tolerance = Annotated[
    float,
    PlainValidator(_tolerance),
    WithJsonSchema({"type": "number", "exclusiveMinimum": 0, "exclusiveMaximum": 1}),
]
Tyres = Annotated[dict[str, str], PlainValidator(_tyres), WithJsonSchema({"anyOf": [_TEXT, _OF_AXLES]})]
Variables = Annotated[SignalName, PlainValidator(endpoint), WithJsonSchema(_VARIABLES)]
SourceEndpoint = Annotated[
    SignalName | list[str] | None,
    PlainValidator(_source),
    WithJsonSchema({"anyOf": [*_ENDS, {"type": "null"}]}),
]
TargetEndpoint = Annotated[SignalName | list[str], PlainValidator(_end), WithJsonSchema({"anyOf": _ENDS})]
InstanceName = Annotated[
    str,
    AfterValidator(_unit_name),
    WithJsonSchema({"type": "string", "pattern": rf"^(?!({'|'.join(RESERVED)})$)[A-Za-z_][A-Za-z0-9_]*$"}),
]


class _AsGiven:
    """Validates `Given[T]` as T; `placed` adds its origin and place, which only the document knows."""

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        return no_info_after_validator_function(Given, handler.generate_schema(get_args(source)[0]))


def _placed(given: Given[Any], document: Document, of_file: str, *key: str | int) -> Given[Any]:
    """Return a value of a scenario or vehicle file with its place, and with its origin.

    The source of a value is in the comment on it, else in that above its instance, else that of the file.
    """
    of_vehicle = key[0] == PARAMETERS
    holder, _ = document.holder(key)
    if holder is not document:
        of_file = str(at(holder.data, ("source",)) or "")
    of_others = (document.comment_above(key[:2]) if key[0] == "units" else "") or of_file
    comment = document.comment(key) or ("" if of_vehicle else of_others)
    about = comment, of_file, str(holder.path), holder.lines.get(key, 0)
    return replace(given, origin=_origin(of_vehicle, *about), where=document.location(key))


@lru_cache(maxsize=10_000)
def _origin(of_vehicle: bool, comment: str, of_file: str, path: str, line: int) -> ValueOrigin:
    begin = re.match(r"([^\s,;]+)[,;]?\s*", comment) if of_vehicle else None
    with suppress(ValueError):  # a vehicle file's comment may begin with the unit
        comment = comment[begin.end() :] if begin and parse_unit(begin[1]) else comment
    source = replace(ValueSource.of_comment(comment, of_file), file=path, line=line)
    return ValueOrigin("vehicle" if of_vehicle else "scenario", source=source)


class TextSpec(StrictModel):
    """The text of a file (UTF-8) as the value of a text parameter, such as the patches of a road."""

    file: str = Field(description="Path, relative to the scenario", min_length=1)


def _form(value: object) -> str:
    return "of file" if isinstance(value, dict) else "array" if isinstance(value, list) else "value"


Array = Annotated[
    list[Any],
    PlainValidator(array_value),
    WithJsonSchema({"type": "array", "minItems": 1, "description": "Values of an array, row by row"}),
]
ParameterValue = Annotated[
    Annotated[Scalar, Tag("value")] | Annotated[Array, Tag("array")] | Annotated[TextSpec, Tag("of file")],
    Discriminator(_form),
]
GivenParameter = Annotated[Given[ParameterValue], _AsGiven()]


class InstanceSpec(StrictModel):
    """An instance of an FMU."""

    fmu: str = Field(description="Name of an FMU in fmus/, or the path of any .fmu", min_length=1)
    step_size: Time | None = Field(None, description="s, an integer multiple of the communication step")
    parameters: dict[str, GivenParameter] = Field({}, description="Values of the instance's parameters")
    tolerance: Tolerance | None = Field(
        None,
        description="Relative tolerance of the FMU's own solver; default: that of its default experiment",
    )
    validate_: bool = Field(
        True, alias="validate", description="Refuse an FMU whose description is formally wrong; false: warn"
    )


class SeriesSpec(StrictModel):
    """A time series for an input: a signal of a measurement file, or a column of CSV, Parquet or ASAM MDF 4.

    Headers may name units (`delta [deg]`), and values are converted to the unit of the input. With the
    algorithm `extrapolated`, an integrated input uses the value in the middle of the step, so that linear
    interpolation is accurate to second order; `jacobi` uses the value at its beginning.
    """

    file: str = Field(description="Path, relative to the scenario", min_length=1)
    column: str | None = Field(
        None,
        description="Name of the column; `*` matches as in the key; default: the input's name",
    )
    time: str = Field("time", description="Column of times, in s if it names no unit; not of MDF")
    interpolation: Literal["linear", "held"] = Field(
        "linear", description="Between two values; values that are not Real are held"
    )
    extrapolate: Literal["refuse", "hold"] = Field(
        "refuse", description="What to do in a run beyond the file's times"
    )
    segment: int | None = Field(None, description="Of a measurement, counted from 1", ge=1)
    begin: Instant | None = Field(
        None, alias="from", description="s, the file's time at the start of the run; default: the run's"
    )


InputValue = Annotated[
    Annotated[Scalar, Tag("value")] | Annotated[Array, Tag("array")] | Annotated[SeriesSpec, Tag("of file")],
    Discriminator(_form),
]
GivenInput = Annotated[Given[InputValue], _AsGiven()]


class Connection(StrictModel):
    """Connections in addition to equal names; a `*` in both ends connects all matching pairs.

    Numbers are converted from the unit of the output to that of the input, those of differences
    (`relativeQuantity` of FMI) without the offset of a unit: a rise of 7 degC is one of 7 K. With `gain` or
    `offset`, units are ignored: the input is gain times the output plus offset, in plain numbers.

    Lists of instances choose among equal names: with
    `{from: [estimator, sensor], to: [controller, reference]}`, each input of the latter takes the output of
    the same name from the first of the former that has it, in preference to any other instance; inputs for
    which none of them has an output are connected as usual. Several lists for one instance must agree on an
    order. With a list of instances and a pattern, `{from: [plant, driver], to: sensor.*_true}`, each input
    takes the output matched by the `*` from the first instance that has it. `from: null` leaves inputs
    without a source, whatever outputs there are.

    With `delay: 1 step`, which breaks an algebraic loop, an input takes the value of one communication step
    earlier, at the start its start value.
    """

    source: SourceEndpoint = Field(
        alias="from", description="instance.output, or a list of instances in order, or null"
    )
    target: TargetEndpoint = Field(alias="to", description="instance.input, or a list of instances")
    gain: float | None = Field(None, description="Factor in place of the conversion of units")
    offset: float | None = Field(None, description="Added after the factor")
    delay: Literal["1 step"] | None = Field(None, description="Breaks an algebraic loop")

    @model_validator(mode="after")
    def _check_ends(self) -> Connection:
        listed = isinstance(self.source, list), isinstance(self.target, list)
        if listed == (True, False) and "*" not in self.target[1]:
            raise ValueError(
                "from a list of instances, 'to' must be a list, too, or instance.variable with a *"
            )
        if listed == (False, True) and self.source is not None:
            raise ValueError("from instance.variable, 'to' must be instance.variable")
        if self.source is None and isinstance(self.target, list):
            raise ValueError("with 'from: null', 'to' must be instance.variable")
        if self.scale is not None and not isinstance(self.source, SignalName):
            raise ValueError("gain and offset are for a connection of instance.variable to instance.variable")
        if self.delay is not None and not isinstance(self.source, SignalName):
            raise ValueError("a delay is for a connection of instance.variable to instance.variable")
        return self

    @property
    def scale(self) -> tuple[float, float] | None:
        """Gain and offset, None if the connection gives neither."""
        if self.gain is None and self.offset is None:
            return None
        return (1.0 if self.gain is None else self.gain, 0.0 if self.offset is None else self.offset)


Friction = Annotated[Given[Scalar], _AsGiven(), WithJsonSchema(in_unit("1"))]
Speed = Annotated[Given[Scalar], _AsGiven(), WithJsonSchema(in_unit("m/s"))]
GivenScalar = Annotated[Given[Scalar], _AsGiven()]


class Vehicle(StrictModel):
    """A vehicle file: parameters for every instance that declares them."""

    like: str = Field("", description=LIKE_SAYS, min_length=1)
    title: str = ""
    source: str = ""
    tyres: Tyres | None = Field(
        None, description="Tyre property file (.tir), or front: and rear: of one each, relative to this file"
    )
    parameters: dict[str, GivenScalar] = Field({}, description="Parameter name -> value")

    def placed(self, document: Document) -> Self:
        """Return the vehicle with the origins and places of its values."""
        placed = {
            name: _placed(given, document, self.source, PARAMETERS, name)
            for name, given in self.parameters.items()
        }
        first = document.origin()
        for name in placed if first is not document else ():
            if document.holder((PARAMETERS, name))[0] is not first:  # a change, as an override is one
                placed[name] = replace(placed[name], replaces=Given(at(first.data, (PARAMETERS, name))))
        return self.model_copy(update={PARAMETERS: placed})

    @property
    def values(self) -> dict[str, Value]:
        """The parameters as written."""
        return {name: given.value for name, given in self.parameters.items()}


class ScenarioSpec(StrictModel):
    """A scenario file with all overrides applied.

    Every input has one source: a connection; else a constant whose key names the instance
    (`tyre.friction_*`); else the output of the same name; else a constant by name or pattern alone
    (`friction*`), which is an error if an output drives the input; else, if its FMU declares it as
    optional, its start value.

    A pattern under `record` matches outputs. If it matches no numeric output, it matches any variable:
    inputs, parameters, local variables, text.
    """

    like: str = Field("", description=LIKE_SAYS, min_length=1)
    title: str = ""
    source: str = Field("", description="Where the scenario comes from: paper, section, figure")
    vehicle: str | None = Field(None, description="Path of a vehicle file")
    tyres: Tyres | None = Field(None, description="As in the vehicle file, which it replaces")
    start_time: Instant = Field(Fraction(0), description="s")
    stop_time: Time = Field(description="s, an integer multiple of the communication step")
    step_size: Time = Field(description="s, communication step")
    algorithm: AlgorithmName = Field(
        "extrapolated", description=f"How instances are coupled: {listed(ALGORITHMS, last='or')}"
    )
    friction: Friction | None = Field(None, description="Friction of the road, for all instances that use it")
    speed: Speed | None = Field(None, description="m/s, initial speed, and target of the driver")
    inputs: dict[str, GivenInput] = Field({}, description="[instance.]pattern -> constant or time series")
    units: dict[InstanceName, InstanceSpec] = Field(description="Name -> instance", min_length=1)
    connections: list[Connection] = Field([], description="Connections beyond equal names")
    record: list[Variables] | None = Field(
        None, description="instance.pattern, *.pattern for all instances; default: all outputs but text"
    )

    faults: list[Annotated[Given[FaultSpec], _AsGiven()]] = Field([], description="Disturbances of signals")

    def placed(self, document: Document) -> Self:
        """Return the scenario with the origins and places of its values."""

        def place(given: Given[Any], *key: str | int) -> Given[Any]:
            return _placed(given, document, self.source, *key)

        def all_at(values: Mapping[str, Given[Any]], *key: str) -> dict[str, Given[Any]]:
            return {name: place(given, *key, name) for name, given in values.items()}

        units = {
            name: put(unit, [PARAMETERS], all_at(unit.parameters, "units", name, PARAMETERS))
            for name, unit in self.units.items()
        }
        facts = {name: place(given, name) for name in FACTS if (given := getattr(self, name)) is not None}
        faults = [place(given, FAULTS, i) for i, given in enumerate(self.faults)]
        inputs = all_at(self.inputs, INPUTS)
        return self.model_copy(update={**facts, "units": units, INPUTS: inputs, FAULTS: faults})


@dataclass(frozen=True)
class PropertyFile:
    """A file with the parameters of a part of a car, such as a tyre."""

    path: Path
    sha256: str
    values: Mapping[str, float]
    """Parameter name -> its value in SI units."""
    warnings: tuple[Diagnostic, ...]

    def record(self) -> dict[str, object]:
        """Return its entry in the run record."""
        return {"file": str(self.path), "sha256": self.sha256, "warnings": list(map(str, self.warnings))}


def key_of(target: Target) -> tuple[str, ...]:
    """Return the key of the value that a target addresses, in a scenario or in its vehicle file.

    Returns:
        () if it addresses something else: an FMU, a file, times, faults.
    """
    keys: dict[TargetKind, tuple[str, ...]] = {
        "fact": (target.variable,),
        "input": (INPUTS, target.variable),
        "parameter": ("units", target.instance, PARAMETERS, target.variable),
        "vehicle_parameter": (PARAMETERS, target.variable),
    }
    return keys.get(target.kind, ())


class LoadedScenario(ScenarioSpec):
    """A loaded scenario with its vehicle and tyre files, overrides, and the lines of all values."""

    model_config = ConfigDict(arbitrary_types_allowed=True)

    document: InstanceOf[Document]
    vehicle_document: InstanceOf[Document]
    vehicle_file: Vehicle
    """Parameters for every instance that declares them; empty if there is no vehicle file."""
    tyre_files: dict[str, InstanceOf[PropertyFile]]
    """Axle -> its tyre property file, for every instance that declares the parameters; may be empty."""
    replaced: dict[str, str]
    """Swapped instance -> its FMU in the file."""
    changes: tuple[InstanceOf[Override], ...]
    """The overrides that make a difference."""
    explicit: bool
    """Whether only `connections` connects inputs, and other inputs keep their start values.

    True for SSP archives, except for their swapped instances.
    """

    @property
    def path(self) -> Path:
        """The scenario file."""
        return self.document.path

    @property
    def tyres_place(self) -> tuple[Document, KeyPath]:
        """Document and key that name the tyre property files, for messages."""
        return (self.vehicle_document if self.tyres is None else self.document), ("tyres",)

    def as_run(self) -> dict[str, Any]:
        """Return the scenario with vehicle file and overrides applied, as JSON-ready data."""
        data = dict(self.document.data)
        for change in self.changes:
            if change.faulty:
                before = data.get(FAULTS) or ()
                data[FAULTS] = [raw for raw in before if str(location_of(raw["on"])) != change.faulty]
                data[FAULTS] += [{"on": change.faulty, **fault.item} for fault in change.faults]
                if not data[FAULTS]:
                    del data[FAULTS]
            elif (key := key_of(change.target)) and key[0] != PARAMETERS:
                data = put(data, key, change.value)
        times = {"stop_time": float(self.stop_time), "step_size": float(self.step_size)}
        if self.start_time:
            times["start_time"] = float(self.start_time)
        tyres = {axle: file.record() for axle, file in self.tyre_files.items()}
        vehicle = {"vehicle_title": self.vehicle_file.title, "vehicle_source": self.vehicle_file.source}
        return {
            **{"file": str(self.path), **data, **times, "vehicle_parameters": self.vehicle_file.values},
            **(vehicle if self.vehicle else {}),
            **({"tyre_files": tyres} if tyres else {}),
        }
