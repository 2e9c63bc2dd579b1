"""Reads YAML 1.2 files into plain values, with the line of every key for messages."""

from __future__ import annotations

import re
import warnings
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from types import NoneType
from typing import Any

from yawbench.foundation.errors import Diagnostic, Location, ScenarioError
from yawbench.foundation.messages import closest, listed, short, unprintable
from yawbench.foundation.safe_files import TEXT, read_bytes, reason

from ..plan import Override

MOST_ERRORS = 200
"""Maximum number of reported errors of a file. Chosen: users check again before correcting more."""
DEEPEST = 40
"""Maximum nesting depth. Chosen: four times that of the schemas."""
LARGEST_WHOLE = 2**64
"""Whole numbers must be smaller. Chosen: the range that other programs accept."""
ALIASED = 100_000
"""Maximum number of values repeated by aliases: nested aliases multiply, and a few lines could exhaust the
memory. Chosen: a hundred times what a study of a hundred runs needs."""

LARGEST_KEPT, KEPT = 30_000, 16
"""Length of texts that are kept when parsed, and their number. Chosen: all of a scenario and its vehicle, in
some megabytes."""

KeyPath = tuple[str | int, ...]
"""Path of a value in a file: ('connections', 3, 'from')."""


@dataclass
class Document:
    """The content of a YAML file as dicts, lists and scalars, with its lines, overrides and diagnostics."""

    path: Path
    data: Any = None
    lines: dict[KeyPath, int] = field(default_factory=dict)
    overrides: dict[KeyPath, Override] = field(default_factory=dict)
    """Key of an overridden value -> its override."""
    errors: dict[Diagnostic, None] = field(default_factory=dict)
    """An ordered set."""
    comments: dict[int, str] = field(default_factory=dict)
    """Line -> the comment at its end."""
    comment_lines: dict[int, str] = field(default_factory=dict)
    """Line that holds nothing else -> its comment."""
    notes: list[Diagnostic] = field(default_factory=list)
    """Diagnostics that are not errors, for the plan."""
    accepted: dict[type, tuple[Any, Any]] = field(default_factory=dict)
    """Schema -> the data that it has accepted last, and their content."""
    like: Document | None = None
    """The file that this one is like (`like`), with the lines of what is taken from it."""

    def fresh(self) -> Document:
        """Return a document with the same content, and overrides, errors and notes of its own."""
        return replace(
            self, lines={**self.lines}, overrides={**self.overrides}, errors={**self.errors},
            notes=[*self.notes],
        )  # fmt: skip

    def report(self, key: KeyPath, sentence: str, code: str = ScenarioError.default_code) -> None:
        """Add an error about the value (or the missing value) at `key`."""
        self.add(Diagnostic(code, sentence, location=self.location(key)))

    def add(self, error: Diagnostic) -> None:
        """Add an error.

        Raises:
            ScenarioError: with all errors, if there are too many to continue.
        """
        self.errors[error] = None
        if len(self.errors) >= MOST_ERRORS:
            more = f"there may be more; these are the first {MOST_ERRORS} problems"
            where = Location(file=self.path)
            raise ScenarioError([*self.sorted_errors(), Diagnostic("errors-omitted", more, location=where)])

    def location(self, key: KeyPath) -> Location:
        """Return where the value at `key` comes from: its line, or its override."""
        change = self.override(key)
        if change is not None:
            return Location(target=str(change))
        holder, line = self.holder(key)
        return Location(file=holder.path, line=line, target=dotted(key))

    def holder(self, key: KeyPath) -> tuple[Document, int]:
        """Return the file, this or one that it is like, and the line of a value, or of what holds it."""
        holder, length = self._holder(key)
        return holder, holder.lines.get(key[:length], 1)

    def _holder(self, key: KeyPath) -> tuple[Document, int]:
        """Return the file that holds the most of a key, and how much."""
        length = next((n for n in range(len(key), -1, -1) if key[:n] in self.lines), 0)
        of_other = self.like._holder(key) if self.like is not None else (self, 0)
        return of_other if of_other[1] > length else (self, length)

    def origin(self) -> Document:
        """Return the file that this one is like in the end; itself if it is like none."""
        return self if self.like is None else self.like.origin()

    def override(self, key: KeyPath) -> Override | None:
        """Return the override that set the value at `key`, None if it is from the file."""
        for n in range(len(key), 0, -1):
            if key[:n] in self.overrides:
                return self.overrides[key[:n]]
        return None

    def comment(self, key: KeyPath) -> str:
        """Return the comment on the line of a key, "" if there is none."""
        holder, _ = self.holder(key)
        return holder.comments.get(holder.lines.get(key, 0), "")

    def comment_above(self, key: KeyPath) -> str:
        """Return the comment lines right above a key."""
        holder, _ = self.holder(key)
        line = holder.lines.get(key, 0) - 1
        lines: list[str] = []
        while line in holder.comment_lines:
            lines.insert(0, holder.comment_lines[line])
            line -= 1
        return " ".join(lines)

    def sorted_errors(self) -> list[Diagnostic]:
        """Return all errors, first those of overrides, then those of the file in the order of lines."""
        return sorted(self.errors, key=lambda error: error.location.line or 0)

    def raise_errors(self) -> None:
        """Raise all errors, if there are any, as one ScenarioError."""
        if self.errors:
            raise ScenarioError(self.sorted_errors())


def at(holder: Any, key: Sequence[str | int]) -> Any:
    """Return the value at a key of nested mappings and models, None if there is none."""
    for part in key:
        holder = holder.get(part) if isinstance(holder, dict) else getattr(holder, str(part), None)
    return holder


def mapping(holder: Any, *key: str | int) -> dict[str, Any]:
    """Return the mapping at a key; an empty one if something else is there: the schema reports it."""
    found = at(holder, key)
    return found if isinstance(found, dict) else {}


def put(holder: Any, key: Sequence[str | int], value: Any) -> Any:
    """Return nested mappings and models with another value at a key; what holds it is copied.

    Something else, in place of a mapping, is returned as it is: the schema reports it.
    """
    part, *rest = key
    inner = put(at(holder, [part]), rest, value) if rest else value
    if isinstance(holder, (dict, NoneType)):
        return {**(holder or {}), part: inner}
    return holder.model_copy(update={str(part): inner}) if hasattr(holder, "model_copy") else holder


def dotted(key: KeyPath) -> str:
    """Return 'connections[3].from' for ('connections', 3, 'from')."""
    text = ""
    for part in key:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else part
    return text


def read(path: Path, *, what: str) -> Document:
    """Read the YAML file `path`; its errors are added to the document.

    Args:
        path: the file.
        what: kind of the file, for messages: "scenario file".
    """
    document = Document(path)

    def fail(line: int | None, sentence: str, code: str = "file-unreadable") -> Document:
        document.add(Diagnostic(code, sentence, location=Location(path, line)))
        return document

    try:
        text = read_bytes(path, largest=TEXT).decode("utf-8-sig")
    except FileNotFoundError:
        return fail(None, f"no such {what}{_neighbours(path)}", "file-missing")
    except UnicodeDecodeError:
        return fail(None, f"this {what} is not UTF-8 text")
    except (OSError, ValueError) as error:
        return fail(None, f"cannot read this {what}: {reason(error)}")
    try:
        node, constructor = _composed(text)
    except _NotYamlError as error:
        return fail(error.line, f"not valid YAML: {error}", "file-not-yaml")
    except RecursionError:
        return fail(None, f"cannot read this {what}: it is nested too deeply", "file-too-large")
    document.lines[()] = 1
    if node is not None:
        reader = _Reader(document, constructor)
        try:
            document.data = reader.value(node, (), ())
            _keep_comments(document, text, reader.scalars)
        except _TooMuchError as error:
            document.report(error.key[:1], str(error), "file-too-large")
            return document
    if document.data is None and not document.errors:
        return fail(None, f"this {what} is empty", "file-empty")
    return document


_COMMENT = re.compile(r"(?:^|(?<=[ \t]))#")


def _keep_comments(document: Document, text: str, scalars: Sequence[tuple[int, int]]) -> None:
    """Add the comments of a text to a document; `scalars`: begin and end of those that have a #."""
    inside = {at for begin, end in scalars for at in range(begin, end)}
    begin = 0
    for number, line in enumerate(text.split("\n"), start=1):
        for comment in _COMMENT.finditer(line):
            if begin + comment.start() not in inside:
                alone = not line[: comment.start()].strip()
                of_kind = document.comment_lines if alone else document.comments
                of_kind[number] = line[comment.end() :].strip()
                break
        begin += len(line) + 1


@lru_cache(1024)
def scalar(text: str) -> Any:
    """Return the value that `text` would have as a scalar in a YAML file."""
    try:
        node, constructor = _composed(text)
    except (_NotYamlError, RecursionError):
        return text
    if node is None or not isinstance(node.value, str):
        return text
    document = Document(Path())
    value = _Reader(document, constructor).value(node, (), ())  # one scalar cannot be too much
    return text if document.errors else value


class _NotYamlError(Exception):
    def __init__(self, line: int, sentence: str) -> None:
        super().__init__(
            " ".join(sentence.split()) + "; indent with spaces, not tabs" * (r"'\t'" in sentence)
        )
        self.line = line


def _composed(text: str) -> tuple[Any, Any]:
    """Return the root node of a text (None if it is empty), and a constructor of scalars of its own.

    Raises:
        _NotYamlError: with the line, 0 if unknown.
        RecursionError: the text is nested too deeply.
    """
    node, constructor = (_kept if len(text) <= LARGEST_KEPT else _parsed)(text)
    own = copy(constructor)
    own.constructed_objects, own.recursive_objects = {}, {}  # what it knows of nodes read before
    return node, own


def _parsed(text: str) -> tuple[Any, Any]:
    from ruamel.yaml import YAML
    from ruamel.yaml.docinfo import DocInfo
    from ruamel.yaml.error import MarkedYAMLError, YAMLError

    yaml = YAML(typ="safe", pure=True)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # redefined anchors are legal
            yaml.doc_infos.append(DocInfo())  # where a %YAML line goes
            constructor, _ = yaml.get_constructor_parser(text)
            _limit_depth(yaml)
            return constructor.composer.get_single_node(), constructor
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        raise _NotYamlError(
            mark.line + 1 if mark else 1, f"{error.context or ''} {error.problem or ''}"
        ) from None
    except YAMLError as error:
        raise _NotYamlError(0, str(error)) from None
    except (ValueError, OverflowError) as error:  # such as an escape beyond Unicode
        raise _NotYamlError(yaml.reader.line + 1, str(error)) from None


_kept = lru_cache(KEPT)(_parsed)
"""The same from memory: one vehicle file is read for every run, and parsing takes longer than short runs."""


def _limit_depth(yaml: Any) -> None:
    """Make a scanner refuse deeply nested brackets, for which its time grows quadratically."""
    scanner, begin = yaml.scanner, yaml.scanner.fetch_flow_collection_start

    def fetch(*arguments: Any, **options: Any) -> Any:
        if len(scanner.flow_context) > DEEPEST:
            raise _NotYamlError(yaml.reader.line + 1, f"more than {DEEPEST} brackets in each other")
        return begin(*arguments, **options)

    scanner.fetch_flow_collection_start = fetch


class _TooMuchError(Exception):
    def __init__(self, key: KeyPath, sentence: str) -> None:
        super().__init__(sentence)
        self.key = key


_TAGS = {
    "scalar": {"str", "int", "float", "bool", "null", "timestamp", "merge", "value"},
    "sequence": {"seq"},
    "mapping": {"map"},
}
"""Kind of a node -> its allowed tags; timestamps are read as text."""


@dataclass
class _Reader:
    """Converts YAML nodes to plain values, and collects lines and errors."""

    document: Document
    constructor: Any
    seen: set[int] = field(default_factory=set)
    repeated: int = 0
    scalars: list[tuple[int, int]] = field(default_factory=list)
    """Begin and end in the text of the scalars that have a #."""

    def value(self, node: Any, key: KeyPath, above: tuple[int, ...]) -> Any:
        if id(node) in above:
            self.document.report(key, "this alias contains itself")
            return None
        if id(node) in self.seen:
            self.repeated += 1
            if self.repeated > ALIASED:
                raise _TooMuchError(key, f"aliases repeat more than {ALIASED} values")
        self.seen.add(id(node))
        above = (*above, id(node))
        if len(above) > DEEPEST:
            raise _TooMuchError(key, f"is nested too deeply: at most {DEEPEST} collections in each other")
        kind = node.tag.removeprefix("tag:yaml.org,2002:")
        if kind not in _TAGS[node.id]:
            self.document.report(key, f"the tag {short(node.tag)} means nothing here")
            return None
        if node.id == "scalar":
            return self._scalar(node, kind, key)
        return (self._sequence if node.id == "sequence" else self._mapping)(node, key, above)

    def _scalar(self, node: Any, kind: str, key: KeyPath) -> Any:
        self._note_place(node)
        if kind not in ("int", "float", "bool", "null"):
            self._check_text(node.value, key)
            return node.value
        try:
            value = self.constructor.construct_object(node)
        except (ValueError, LookupError, ArithmeticError):
            self.document.report(key, f"{short(node.value)} is not of type {kind}", "value-wrong-type")
            return None
        if isinstance(value, int) and abs(value) >= LARGEST_WHOLE:
            self.document.report(key, f"{short(node.value)} is too large a whole number")
            return None
        return value

    def _note_place(self, node: Any) -> None:
        if "#" in node.value:
            self.scalars.append((node.start_mark.index, node.end_mark.index))

    def _check_text(self, text: str, key: KeyPath) -> None:
        if (character := unprintable(text)) is not None:
            self.document.report(key, f"contains the control character {character}")

    def _sequence(self, node: Any, key: KeyPath, above: tuple[int, ...]) -> list[Any]:
        items = []
        for i, item in enumerate(node.value):
            below = (*key, i)
            self.document.lines[below] = item.start_mark.line + 1
            items.append(self.value(item, below, above))
        return items

    def _mapping(self, node: Any, key: KeyPath, above: tuple[int, ...]) -> dict[str, Any]:
        path, lines, add = self.document.path, self.document.lines, self.document.add
        mapping: dict[str, Any] = {}
        for name, item in node.value:
            if name.tag.endswith(":merge"):
                for other in reversed(self._merged(name, item)):  # of several, the first one counts
                    mapping.update(self.value(other, key, above) or {})
        own: dict[str, int] = {}
        for name, item in node.value:
            line = name.start_mark.line + 1
            if not isinstance(name.value, str):
                sentence = "a key must be text, not a collection"
                add(Diagnostic("key-invalid", sentence, location=Location(path, line)))
                continue
            if name.tag.endswith(":merge"):
                continue
            below = (*key, name.value)
            if name.value in own:
                sentence = f"{dotted(below)} is given twice, first in line {own[name.value]}"
                add(Diagnostic("key-duplicate", sentence, location=Location(path, line)))
                continue
            own[name.value] = lines[below] = line
            self._note_place(name)
            self._check_text(name.value, below)
            mapping[name.value] = self.value(item, below, above)
        return mapping

    def _merged(self, name: Any, item: Any) -> list[Any]:
        """Return the mappings that a merge key includes: one, or a list of several."""
        nodes = item.value if item.id == "sequence" else [item]
        if all(node.id == "mapping" for node in nodes):
            return list(nodes)
        sentence = "<<: write an alias of a mapping, or a list of such aliases"
        where = Location(self.document.path, name.start_mark.line + 1)
        self.document.add(Diagnostic("value-wrong-type", sentence, location=where))
        return []


def _neighbours(path: Path) -> str:
    """Return a hint at the YAML files in the folder of a missing one."""
    try:
        names = {p.stem: p.name for p in sorted(path.parent.iterdir()) if p.suffix in (".yaml", ".yml")}
    except (OSError, ValueError):
        return ""
    close = closest(path.stem, names)
    if close is not None:
        return f"; did you mean {str(path.parent / names[close])!r}?"
    return f"; {path.parent.absolute()} contains {listed(names.values())}" if names else ""
