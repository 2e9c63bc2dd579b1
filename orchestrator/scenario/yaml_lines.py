"""Plain values from a YAML 1.2 file, with the line of every key kept aside for messages."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..plan import Change
from ..wording import closest, listed

ALIASED = 100_000
"""Values that the aliases of a file may repeat: aliases of aliases multiply, and a few lines could fill
the memory. Chosen: a hundred times what a study of a hundred runs needs."""

Key = tuple[str | int, ...]
"""Where a value stands: ('connections', 3, 'from')."""


@dataclass
class Document:
    """A YAML file's content as dicts, lists and scalars; where everything stands; what is wrong with it."""

    path: Path
    data: Any = None
    lines: dict[Key, int] = field(default_factory=dict)
    overrides: dict[Key, Change] = field(default_factory=dict)
    """Values that do not come from the file -> what gave them."""
    problems: list[tuple[int, str]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    """Remarks on what is no mistake, for the plan."""

    def report(self, key: Key, sentence: str) -> None:
        """Note a problem with the value (or the missing value) at `key`."""
        line, place = self._place(key)
        problem = (line, f"{place}: {sentence}")
        if problem not in self.problems:
            self.problems.append(problem)

    def place(self, key: Key) -> str:
        """Return 'file:line: dotted.key', or the change that the value came from."""
        return self._place(key)[1]

    def override(self, key: Key) -> Change | None:
        """Return the change that gave the value at `key`, None if the file did."""
        for n in range(len(key), 0, -1):
            if key[:n] in self.overrides:
                return self.overrides[key[:n]]
        return None

    def _place(self, key: Key) -> tuple[int, str]:
        change = self.override(key)
        if change is not None:
            return 0, str(change)
        line = next((self.lines[key[:n]] for n in range(len(key), -1, -1) if key[:n] in self.lines), 1)
        name = dotted(key)
        return line, f"{self.path}:{line}: {name}" if name else f"{self.path}:{line}"

    def sentences(self) -> list[str]:
        """Return all problems, first those of changes, then the file's from top to bottom."""
        return [sentence for _, sentence in sorted(self.problems, key=lambda p: p[0])]


def dotted(key: Key) -> str:
    """Return 'connections[3].from' for ('connections', 3, 'from')."""
    text = ""
    for part in key:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else part
    return text


def read(path: Path, *, what: str) -> Document:
    """Read the YAML file `path`; whatever is wrong with it stands in the document's problems.

    Args:
        path: the file.
        what: what the file is, for messages: "scenario file".
    """
    document = Document(path)

    def fail(line: int, sentence: str) -> Document:
        document.problems.append((line, f"{path}:{line}: {sentence}" if line else f"{path}: {sentence}"))
        return document

    try:
        text = path.read_bytes().decode("utf-8-sig")
    except FileNotFoundError:
        return fail(0, f"no such {what}{_neighbours(path)}")
    except OSError as error:
        return fail(0, f"cannot read this {what}: {error.strerror}")
    except UnicodeDecodeError:
        return fail(0, f"this {what} is not UTF-8 text")
    except ValueError as error:
        return fail(0, f"cannot read this {what}: {error}")

    from ruamel.yaml import YAML
    from ruamel.yaml.error import MarkedYAMLError, YAMLError

    yaml = YAML(typ="safe", pure=True)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # an anchor that is given again is no mistake
            node = yaml.compose(text)
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        reason = " ".join(f"{error.context or ''} {error.problem or ''}".split())
        return fail(mark.line + 1 if mark else 1, f"not valid YAML: {reason}")
    except YAMLError as error:
        return fail(0, f"not valid YAML: {' '.join(str(error).split())}")
    except RecursionError:
        return fail(0, f"cannot read this {what}: it is nested too deeply")
    document.lines[()] = 1
    if node is not None:
        try:
            document.data = _Reader(document, yaml.constructor).value(node, (), ())
        except _TooManyAliasesError as error:
            document.report(error.key[:1], f"aliases repeat more than {ALIASED} values")
            return document
        except RecursionError:  # aliases of aliases are deeper than the text
            return fail(0, f"cannot read this {what}: it is nested too deeply")
    if document.data is None and not document.problems:
        return fail(0, f"this {what} is empty")
    return document


def scalar(text: str) -> Any:
    """Return the value that `text` would have as a scalar in a YAML file."""
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    yaml = YAML(typ="safe", pure=True)
    try:
        node = yaml.compose(text)
    except YAMLError:
        return text
    if node is None or not isinstance(node.value, str):
        return text
    return _Reader(Document(Path(text)), yaml.constructor).value(node, (), ())


class _TooManyAliasesError(Exception):
    def __init__(self, key: Key) -> None:
        self.key = key


@dataclass
class _Reader:
    """Turns YAML nodes into plain values, noting lines and problems on the way."""

    document: Document
    constructor: Any
    seen: set[int] = field(default_factory=set)
    repeated: int = 0

    def value(self, node: Any, key: Key, above: tuple[int, ...]) -> Any:
        if id(node) in above:
            self.document.report(key, "this alias contains itself")
            return None
        if id(node) in self.seen:
            self.repeated += 1
            if self.repeated > ALIASED:
                raise _TooManyAliasesError(key)
        self.seen.add(id(node))
        above = (*above, id(node))
        if isinstance(node.value, str):
            return self._scalar(node, key)
        if node.tag.endswith(":seq"):
            return self._sequence(node, key, above)
        return self._mapping(node, key, above)

    def _scalar(self, node: Any, key: Key) -> Any:
        kind = node.tag.rpartition(":")[2]
        if kind not in ("int", "float", "bool", "null"):
            return node.value
        try:
            return self.constructor.construct_object(node)
        except (ValueError, LookupError, ArithmeticError):
            self.document.report(key, f"{node.value!r} is not of type {kind}")
            return None

    def _sequence(self, node: Any, key: Key, above: tuple[int, ...]) -> list[Any]:
        items = []
        for i, item in enumerate(node.value):
            below = (*key, i)
            self.document.lines[below] = item.start_mark.line + 1
            items.append(self.value(item, below, above))
        return items

    def _mapping(self, node: Any, key: Key, above: tuple[int, ...]) -> dict[str, Any]:
        path, lines, problems = self.document.path, self.document.lines, self.document.problems
        mapping: dict[str, Any] = {}
        for name, item in node.value:
            if name.tag.endswith(":merge"):
                for other in reversed(self._merged(name, item)):  # of several, the first one counts
                    mapping.update(self.value(other, key, above) or {})
        own: dict[str, int] = {}
        for name, item in node.value:
            line = name.start_mark.line + 1
            if not isinstance(name.value, str):
                problems.append((line, f"{path}:{line}: a key must be text, not a collection"))
                continue
            if name.tag.endswith(":merge"):
                continue
            below = (*key, name.value)
            if name.value in own:
                first = own[name.value]
                problems.append(
                    (line, f"{path}:{line}: {dotted(below)} is given twice, first in line {first}")
                )
                continue
            own[name.value] = lines[below] = line
            mapping[name.value] = self.value(item, below, above)
        return mapping

    def _merged(self, name: Any, item: Any) -> list[Any]:
        """Return the mappings that a merge key takes in: one, or several in a list."""
        nodes = item.value if item.tag.endswith(":seq") else [item]
        if all(one.tag.endswith(":map") for one in nodes):
            return list(nodes)
        line = name.start_mark.line + 1
        sentence = "<<: write an alias of a mapping, or a list of such aliases"
        self.document.problems.append((line, f"{self.document.path}:{line}: {sentence}"))
        return []


def _neighbours(path: Path) -> str:
    """Return what the folder of a missing file holds in its place."""
    if not path.parent.is_dir():
        return ""
    names = {p.stem: p.name for p in sorted(path.parent.iterdir()) if p.suffix in (".yaml", ".yml")}
    close = closest(path.stem, names)
    if close is not None:
        return f"; did you mean {str(path.parent / names[close])!r}?"
    return f"; {path.parent.absolute()} holds {listed(names.values())}" if names else ""
