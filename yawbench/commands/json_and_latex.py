"""The forms of a command's output: text, one JSON object (`--json`), tables for LaTeX (`--latex`).

With an option, any other output, also of libraries and FMUs, goes to standard error. Commands print their
tables with `output.print_tables` and pass data for programs to `answer` and `note`, whatever the form.
"""

from __future__ import annotations

import contextlib
import functools
import inspect
import json
import math
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from yawbench.foundation.errors import Diagnostic, ScenarioError

if TYPE_CHECKING:
    from yawbench.studies.tables import Table


VERSION = 1
"""Version of the JSON object; increased when a field changes its meaning or is removed."""
Form = Literal["text", "json", "latex"]


@dataclass
class Output:
    """The output of a command in one form."""

    form: Form = "text"
    command: str = ""
    fields: dict[str, Any] = field(default_factory=dict)
    tables: list[Table] = field(default_factory=list)
    diagnostics: dict[Diagnostic, None] = field(default_factory=dict)

    def print(self, status: int) -> None:
        """Print the collected output; `status`: the exit status."""
        if self.form != "text":
            print(self._text(status), end="", flush=True)

    def _text(self, status: int) -> str:
        from yawbench.studies.tables import to_latex

        if self.form == "latex":
            return "\n".join(map(to_latex, self.tables))
        whole = {
            "schema": VERSION,
            "command": self.command,
            "status": status,
            **self.fields,
            "tables": [*map(_data_of, self.tables)],
            "diagnostics": [diagnostic.record() for diagnostic in self.diagnostics],
        }
        return json.dumps(_plain(whole), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


_OUTPUT: ContextVar[Output] = ContextVar("_OUTPUT", default=Output())  # noqa: B039 - nothing collects in text


def form() -> Form:
    """Return the form of the output of the current command."""
    return _OUTPUT.get().form


def answer(**fields: Any) -> None:
    """Add fields to the JSON object; in other forms, do nothing."""
    if form() == "json":
        _OUTPUT.get().fields |= fields


def note(diagnostics: Iterable[Diagnostic]) -> None:
    """Add errors, warnings and infos to the JSON object; in other forms, do nothing."""
    if form() == "json":
        _OUTPUT.get().diagnostics |= dict.fromkeys(diagnostics)


def collect(tables: Iterable[Table]) -> None:
    """Add tables to output that is not text."""
    _OUTPUT.get().tables.extend(tables)


@contextlib.contextmanager
def printing(arguments: Sequence[str]) -> Iterator[Output]:
    """Collect the output of a command line in the form that it asks for; help is text."""
    own = [*arguments[: arguments.index("--")]] if "--" in arguments else [*arguments]
    wanted: Form = "json" if "--json" in own else "latex" if "--latex" in own else "text"
    if wanted == "text" or {"-h", "--help"} & {*own}:
        yield Output()
        return
    output = Output(wanted, own[0])
    token = _OUTPUT.set(output)
    try:
        with _stdout_to_stderr():
            yield output
    finally:
        _OUTPUT.reset(token)


@contextlib.contextmanager
def _stdout_to_stderr() -> Iterator[None]:
    """Redirect standard output to standard error, also that of C code and of child processes."""
    try:
        place, target = sys.stdout.fileno(), sys.stderr.fileno()
        sys.stdout.flush()
        kept = os.dup(place)
    except (OSError, ValueError):  # a stream without a file
        with contextlib.redirect_stdout(sys.stderr):
            yield
        return
    try:
        os.dup2(target, place)
        with contextlib.redirect_stdout(sys.stderr):
            yield
    finally:
        os.dup2(kept, place)
        os.close(kept)


Json = Annotated[
    bool, typer.Option("--json", help="Print one JSON object to standard output, see docs/editors.md.")
]
Latex = Annotated[bool, typer.Option("--latex", help="Print tables for LaTeX, with the package booktabs.")]


def tabular(command: Callable[..., None]) -> Callable[..., None]:
    """Mark a command that prints tables, and so takes `--json` and `--latex`."""
    command.tabular = True  # type: ignore[attr-defined]
    return command


def with_options(
    command: Callable[..., None],
    called: Callable[..., None],
    *,
    without: str = "",
    **options: tuple[Any, Any],
) -> Callable[..., None]:
    """Return what is called for a command, with the command's signature and further options.

    Args:
        command: has parameters of its own.
        called: takes them and the options by name.
        without: a parameter of the command that `called` makes itself.
        options: name -> default and annotation.
    """
    kind = inspect.Parameter.KEYWORD_ONLY
    own = inspect.signature(command, eval_str=True).parameters.values()
    more = (
        inspect.Parameter(name, kind, default=default, annotation=annotation)
        for name, (default, annotation) in options.items()
    )
    every = [*(parameter.replace(kind=kind) for parameter in own if parameter.name != without), *more]
    called.__signature__ = inspect.Signature(every)  # type: ignore[attr-defined]
    return called


def with_forms(command: Callable[..., None]) -> Callable[..., None]:
    """Return a command that also takes `--json` and `--latex`."""

    @functools.wraps(command)
    def called(*, json: bool, latex: bool, **arguments: Any) -> None:
        if json and latex:
            raise ScenarioError("--json and --latex are mutually exclusive", code="option-invalid")
        command(**arguments)

    return with_options(command, called, json=(False, Json), latex=(False, Latex))


def _data_of(table: Table) -> dict[str, Any]:
    """Return a table as data: numbers in SI units where all of a column have the same."""
    columns = [{"heading": heading, "unit": table.unit(k)} for k, heading in enumerate(table.headings)]
    cells = [table.values(k) for k in range(len(table.columns))]
    return {
        "title": table.title,
        "columns": columns,
        "rows": [[*row] for row in zip(*cells, strict=True)],
        "notes": table.notes,
    }


def _plain(value: Any) -> Any:
    """Return a value as JSON-ready data; infinite numbers and NaN become null."""
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [*map(_plain, value)]
    if isinstance(value, (bool, int, str)) or value is None:
        return value
    if isinstance(value, Path):
        return str(value)
    number = float(value)  # also of NumPy, and fractions
    return number if math.isfinite(number) else None
