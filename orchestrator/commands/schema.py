"""`yawbench schema`: JSON Schemas of the YAML files, for editors and pipelines."""

from __future__ import annotations

import importlib
import json
from pathlib import Path
from typing import Annotated, Any, Literal

import typer
from pydantic import BaseModel
from pydantic.json_schema import GenerateJsonSchema

MODELS = {
    "scenario": "scenario.schema:ScenarioSpec",
    "vehicle": "scenario.schema:Vehicle",
    "experiment": "experiments.schema:ExperimentSpec",
    "ranking": "experiments.ranking:RankingSpec",
    "entries": "experiments.ranking:EntriesSpec",
    "threats": "experiments.threats:ThreatsSpec",
    "measurement": "measured.measurement:MeasurementSpec",
    "bands": "evaluation.validation:BandsSpec",
    "fit": "experiments.fit:FitSpec",
}
"""Kind of file -> module and class of the model that reads it."""
ALSO = {"study": "experiment", "sweep": "experiment", "tuning": "experiment"}
"""Names of commands and documents -> kind."""
DIALECT = "http://json-schema.org/draft-07/schema#"
"""Chosen: the latest draft that editors implement in full."""
FOLDER = Path(__file__).resolve().parents[2] / "scenarios" / "schemas"
"""Folder of the schemas in this package, a file per kind."""


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
    module, _, name = MODELS[kind].partition(":")
    model: type[BaseModel] = getattr(importlib.import_module(f"..{module}", __package__), name)
    return model


def schema_of(kind: str) -> dict[str, Any]:
    """Return the JSON Schema of files of a kind."""
    made = model_of(kind).model_json_schema(schema_generator=_Generator)
    return {"$schema": DIALECT, **made, "title": f"yawbench {kind} file"}


def schema_text(kind: str) -> str:
    """Return the JSON Schema of files of a kind as text."""
    return json.dumps(schema_of(kind), indent=1, ensure_ascii=False) + "\n"


KindName = Literal[tuple(MODELS | ALSO)]  # type: ignore[valid-type]
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
    print("\n".join(MODELS) if kind is None else schema_text(ALSO.get(kind, kind)), end="\n" * (kind is None))


def main() -> None:
    """Write all schemas into this package."""
    FOLDER.mkdir(exist_ok=True)
    for kind in MODELS:
        (FOLDER / f"{kind}.json").write_text(schema_text(kind), encoding="utf-8")


if __name__ == "__main__":
    main()
