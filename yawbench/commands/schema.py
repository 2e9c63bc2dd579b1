"""`yawbench schema`: JSON Schemas of YAML files, for editors."""

from __future__ import annotations

import json
from typing import Annotated, Any, Literal

import typer
from pydantic import BaseModel
from pydantic.json_schema import GenerateJsonSchema

from yawbench.foundation import plugins

KIND_OF_FILE = "kind of file"
"""Kind of plug-ins: models that read YAML files."""
ALSO = {"study": "experiment", "sweep": "experiment", "tuning": "experiment"}
"""Names of commands and documents -> kind."""
DIALECT = "http://json-schema.org/draft-07/schema#"
"""Chosen: the latest draft that editors implement in full."""


class _Generator(GenerateJsonSchema):
    """Writes patterns of keys so that other keys are refused, and no titles of fields."""

    def dict_schema(self, schema: Any) -> dict[str, Any]:
        made = super().dict_schema(schema)
        for pattern, values in made.pop("patternProperties", {}).items():
            made |= {"propertyNames": {"pattern": pattern}, "additionalProperties": values}
        return made

    def field_title_should_be_set(self, schema: Any) -> bool:
        return False


def model_of(kind: str) -> type[BaseModel]:
    """Return the model that reads files of a kind."""
    model: type[BaseModel] = plugins.find(KIND_OF_FILE, kind)
    return model


def kinds() -> list[str]:
    """Return the kinds of files that have a schema."""
    return plugins.names(KIND_OF_FILE)


def schema_of(kind: str) -> dict[str, Any]:
    """Return the JSON Schema of files of a kind."""
    from yawbench.orchestrator.scenario.like import LIKE

    made = model_of(kind).model_json_schema(schema_generator=_Generator)
    if LIKE in made["properties"]:  # what such a file lacks may be in the other one
        whole: dict[str, Any] = {key: made.pop(key) for key in ("required", "oneOf") if key in made}
        if (instance := made.get("$defs", {}).get("InstanceSpec")) is not None:
            needed = {"additionalProperties": {"required": instance.pop("required")}}
            whole["properties"] = {"units": needed}
        made |= {"if": {"required": [LIKE]}, "else": whole}
    return {"$schema": DIALECT, **made, "title": f"yawbench {kind} file"}


def schema_text(kind: str) -> str:
    """Return the JSON Schema of files of a kind as text."""
    return json.dumps(schema_of(kind), indent=1, ensure_ascii=False) + "\n"


KindName = Literal[tuple([*kinds(), *ALSO])]  # type: ignore[valid-type]
Kind = Annotated[
    KindName | None,  # type: ignore[valid-type]
    typer.Argument(help="Kind of file; without it, all kinds are listed.", metavar="KIND"),
]


def schema(kind: Kind = None) -> None:
    """Print the JSON Schema of a kind of YAML file.

    An editor with a YAML language server checks and completes files whose first line is
    `# yaml-language-server: $schema=PATH`; `yawbench new` writes it. Studies, sweeps and tunings are
    experiments.
    """
    print(
        "\n".join(kinds()) if kind is None else schema_text(ALSO.get(kind, kind)), end="\n" * (kind is None)
    )
