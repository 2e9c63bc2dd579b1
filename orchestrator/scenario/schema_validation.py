"""Strict validation of YAML files with pydantic; errors have line, key and allowed values."""

from __future__ import annotations

import types
import typing
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

from pydantic import BaseModel, ConfigDict, PlainSerializer, PlainValidator, ValidationError, WithJsonSchema
from pydantic_core.core_schema import no_info_after_validator_function

from yawbench.foundation.errors import Location, ScenarioError, code_of
from yawbench.foundation.messages import closest, listed, short

from ..plan import Given
from .quantities import instant, quantity_pattern, seconds
from .yaml_lines import Document, KeyPath

if TYPE_CHECKING:
    from typing_extensions import Self

JsonSchema = dict[str, Any]


def in_unit(unit: str, **number: float) -> JsonSchema:
    """Return the JSON Schema of a number, or text with a unit of a dimension; `number`: limits of numbers."""
    return {"anyOf": [{"type": "number", **number}, text_in_unit(unit)]}


def text_in_unit(unit: str) -> JsonSchema:
    """Return the JSON Schema of text with a unit of a dimension."""
    return {"type": "string", "pattern": quantity_pattern(unit)}


def quantities_in(units: Mapping[str, str]) -> JsonSchema:
    """Return the JSON Schema of a mapping of quantities; `units`: name -> unit."""
    properties = {name: in_unit(unit) for name, unit in units.items()}
    return {"type": "object", "properties": properties, "additionalProperties": False}


def _time(sign: str, **number: float) -> WithJsonSchema:
    patterns = [quantity_pattern("s").replace("[+-]", sign), rf"^\s*{sign}?\d+/0*[1-9]\d*\s*$"]
    texts = [{"type": "string", "pattern": pattern} for pattern in patterns]
    return WithJsonSchema({"anyOf": [{"type": "number", **number}, *texts]})


Instant = Annotated[Fraction, PlainValidator(instant), PlainSerializer(float), _time("[+-]")]
Time = Annotated[Fraction, PlainValidator(seconds), PlainSerializer(float), _time("[+]", exclusiveMinimum=0)]
"""Above zero."""


@dataclass(frozen=True, eq=False)
class OneOf:
    """Validator of a text that must be one of some names, which may become more."""

    names: Collection[str]

    def __call__(self, name: str) -> str:
        """Return the name.

        Raises:
            ValueError: it is not one of the names.
        """
        if name not in self.names:
            raise ValueError(f"must be {listed(map(repr, self.names), last='or')} (got {short(name)})")
        return name

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        """Validate with this after the type itself."""
        return no_info_after_validator_function(self, handler(source))

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> JsonSchema:
        """List the names."""
        return {**handler(schema), "enum": sorted(self.names)}


def exactly_one(*keys: str) -> JsonSchema:
    """Return the JSON Schema of mappings with exactly one of some keys."""
    return {"oneOf": [{"required": [key]} for key in keys]}


class StrictModel(BaseModel):
    """Base of all schemas: no unknown keys, no silent conversions."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)

    def placed(self, document: Document) -> Self:
        """Return the content with what only its document knows: the origins and places of values."""
        return self


Model = TypeVar("Model", bound=StrictModel)
KINDS: dict[str, tuple[str, type, str]] = {
    "tuning": ("a tuning file", dict, "; it is for `yawbench tune`"),
    "runs": ("a study file", list, "; it is for `yawbench study` and `report`"),
    "axes": ("a sweep file", dict, "; it is for `yawbench sweep`"),
    "conditions": ("a ranking file", dict, "; it is for `yawbench rank`"),
    "threats": ("a threat file", dict, "; it is for `yawbench rank`"),
    "entries": ("a file of entries", dict, "; a ranking names it under 'more_entries'"),
    "bands": ("a file of bands", dict, "; it is for `yawbench validate --bands`"),
    "signals": ("a measurement file", dict, "; it is for `yawbench measured show`"),
    "units": ("a scenario", dict, "; it is for `yawbench run`"),
    "parameters": ("a vehicle file", dict, "; a scenario names it under 'vehicle'"),
}
"""Key that identifies a kind of file -> the kind, type of the key's value, hint at the intended use."""


def validate(model: type[Model], document: Document) -> Model | None:
    """Return the validated content; if it is invalid, add the errors to the document and return None."""
    data = document.data
    if data is None:
        return None
    accepted = document.accepted.get(model)
    if accepted is not None and accepted[0] is data:
        content: Model = accepted[1]
        return content
    if another := _another_kind(model, data):
        document.report((), another, "file-wrong-kind")
        return None
    try:
        content = model.model_validate(data).placed(document)
    except ValidationError as errors:
        for error in errors.errors(include_url=False):
            _report(model, document, _place(data, error["loc"]), error)
        return None
    document.accepted[model] = data, content
    return content


def validated(model: type[Model], document: Document) -> Model:
    """Return the validated content.

    Raises:
        ScenarioError: it is invalid, or the document has other errors; lists all.
    """
    content = validate(model, document)
    document.raise_errors()
    assert content is not None, "without content there is an error"
    return content


def made(model: type[Model], argument: str = "", /, **fields: Any) -> Model:
    """Create a specification in Python.

    Args:
        model: the schema.
        argument: what it is made of, named by errors.
        fields: by the keys of a file; parts may be specifications that are made already.

    Raises:
        ScenarioError: it is invalid; lists all errors.
    """
    document = Document(Path(), fields)
    content = validate(model, document)
    if content is None:
        located = ((one, ".".join(filter(None, (argument, one.location.target)))) for one in document.errors)
        errors = [replace(one, location=Location(target=place)) for one, place in located]
        raise ScenarioError(errors, code="argument-invalid")
    return content


def _another_kind(model: type[BaseModel], data: Any) -> str | None:
    """Return a message if a file is obviously of another kind than expected, else None."""
    own = [key for key in KINDS if key in model.model_fields]
    if not own or not isinstance(data, dict) or any(key in data for key in own):
        return None
    other = next((key for key, (_, form, _) in KINDS.items() if isinstance(data.get(key), form)), None)
    wanted = listed((KINDS[key][0] for key in own), last="or")
    return f"{KINDS[other][0]}, not {wanted}{KINDS[other][2]}" if other else None


def _place(data: Any, location: KeyPath) -> KeyPath:
    """Convert pydantic's location of an error to the key in the file, without parts of the schema."""
    key: KeyPath = ()
    for i, part in enumerate(location):
        in_list = isinstance(data, list) and isinstance(part, int)
        if in_list or (isinstance(data, dict) and part in data):
            data = data[part]
        elif i < len(location) - 1 or part == "[key]" or not isinstance(data, dict):
            continue
        key = (*key, part)
    return key


def _report(model: type[BaseModel], document: Document, key: KeyPath, error: Any) -> None:
    kind, value = error["type"], error["input"]
    if kind == "missing":
        document.report(key[:-1], f"{str(key[-1])!r} is missing", "key-missing")
    elif kind == "extra_forbidden":
        allowed = _keys(model, key[:-1])
        likely = closest(str(key[-1]), allowed)
        guess = f"did you mean {likely!r}? " if likely else ""
        document.report(key, f"unknown key; {guess}allowed here: {listed(allowed)}", "key-unknown")
    elif kind == "literal_error":
        document.report(key, f"must be {error['ctx']['expected']} (got {short(value)})")
    elif kind == "value_error":
        raised = error["ctx"]["error"]
        document.report(key, str(raised), code_of(raised))
    elif kind in _MUST_BE:
        document.report(key, f"must be {_MUST_BE[kind]} (got {short(value)})", "value-wrong-type")
    else:
        document.report(key, f"{error['msg']} (got {short(value)})")


_MUST_BE = {
    "string_type": "text",
    "string_too_short": "text",
    "dict_type": "a mapping",
    "model_type": "a mapping",
    "list_type": "a list",
    "too_short": "not empty",
    "float_type": "a number",
    "finite_number": "a finite number",
    "bool_type": "true or false",
}


def _keys(model: type[BaseModel], key: KeyPath) -> list[str]:
    """Return the keys allowed in the mapping at `key`."""
    inner: Any = model
    for part in key:
        if isinstance(inner, type) and issubclass(inner, BaseModel):
            named = {field.alias or name: field for name, field in inner.model_fields.items()}
            inner = _plain(named[str(part)].annotation)
        else:
            inner = _plain(typing.get_args(inner)[-1])
    return [field.alias or name for name, field in inner.model_fields.items()]


def _plain(annotation: Any) -> Any:
    """Return an annotation without `| None`, without `Given`, and without the metadata of Annotated."""
    if typing.get_origin(annotation) in (typing.Annotated, Given):
        return _plain(typing.get_args(annotation)[0])
    if typing.get_origin(annotation) in (types.UnionType, typing.Union):
        arms = [arm for arm in typing.get_args(annotation) if arm is not types.NoneType]
        return _plain(arms[-1])
    return annotation
