"""Files like another one: `like: mid_size` takes everything of that file, and the file's own keys change it.

Mappings are merged key by key, at any depth; any other value, a list among them, takes the place of the
other one, and `null` takes a key away. A file can be like one that is like a third. Every value keeps the
file and line in which it stands, and paths are relative to that file.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from yawbench.foundation.errors import ScenarioError
from yawbench.foundation.messages import listed, short

from . import yaml_lines
from .catalogue import YAML, beside, find
from .schema_validation import KINDS
from .yaml_lines import Document, KeyPath

LIKE = "like"
_KINDS = {
    "vehicle file": ("a vehicle file",),
    "scenario file": ("a scenario",),
    "experiment file": ("a study file", "a sweep file", "a tuning file"),
}
"""Kind of file, as messages have it -> the kinds of `KINDS` that it may be like."""


def read(path: Path, *, what: str, above: tuple[Path, ...] = ()) -> Document:
    """Read a YAML file with everything of the file that it is like; errors are added to the document.

    Args:
        path: the file.
        what: kind of the file, for messages: "scenario file", "vehicle file" or "experiment file".
        above: the files that are like this one, for messages about circles.
    """
    document = yaml_lines.read(path, what=what)
    name = yaml_lines.at(document.data, (LIKE,))
    if not isinstance(name, str) or not name:
        return document
    chain = (*above, path)
    try:
        other = _found(path, name, what)
        if os.path.realpath(other) in map(os.path.realpath, chain):
            files = listed([str(one) for one in (*chain[1:], other)], last="which is like")
            raise ScenarioError(f"{chain[0]} would be like itself, by way of {files}", code="value-invalid")
        base = read(other, what=what, above=chain)
        _check_kind(base, what)
    except ScenarioError as error:
        for one in error.diagnostics:
            document.report((LIKE,), str(one), one.code)
        document.data = None  # what it lacks is not its mistake
        return document
    document.errors |= base.errors
    if base.errors:
        document.data = None
        return document
    own = {key: value for key, value in document.data.items() if key != LIKE}
    here, there = (os.path.abspath(one.parent) for one in (path, other))
    taken = base.data if here == there else _moved(base.data, there, here)
    replaced: list[KeyPath] = []
    document.data = _merged(own, taken, (), replaced)
    base.data = taken
    for key in replaced:  # what stood there is not in the file any more
        base.lines = {
            at: line for at, line in base.lines.items() if len(at) <= len(key) or at[: len(key)] != key
        }
    document.like = base
    return document


def _found(path: Path, name: str, what: str) -> Path:
    """Return the file that another one is like.

    Raises:
        ScenarioError: there is none, or it is no YAML file.
    """
    kind = _KINDS[what][0]
    other = beside(path, name, kind)
    if not os.path.isfile(other) and Path(name).suffix not in YAML:
        other = find(name, kind)  # tells what there is
    if other.suffix not in YAML:
        raise ScenarioError(f"{short(name)} is no YAML file: like names a {what}", code="file-wrong-kind")
    if not os.path.isfile(other):
        raise ScenarioError(list(yaml_lines.read(other, what=what).errors))
    return other


def _check_kind(base: Document, what: str) -> None:
    """Raise a ScenarioError if a file is obviously of another kind than a file that is like it."""
    data = base.data if isinstance(base.data, dict) else {}
    kind = next((name for key, (name, form, _) in KINDS.items() if isinstance(data.get(key), form)), None)
    if not base.errors and not isinstance(base.data, dict):
        raise ScenarioError(f"{base.path} is no {what}", code="file-wrong-kind")
    if kind is not None and kind not in _KINDS[what]:
        raise ScenarioError(f"{base.path} is {kind}, not a {what}", code="file-wrong-kind")


def _merged(own: Any, base: Any, key: KeyPath, replaced: list[KeyPath]) -> Any:
    """Return what a value becomes when a file changes it; keys of replaced values are added to a list."""
    if not (isinstance(own, dict) and isinstance(base, dict)):
        replaced.append(key)
        return own
    merged = dict(base)
    for name, value in own.items():
        if name not in base:
            merged[name] = value
        elif value is None:
            del merged[name]
            replaced.append((*key, name))
        else:
            merged[name] = _merged(value, base[name], (*key, name), replaced)
    return merged


def _moved(data: Any, there: str, here: str) -> Any:
    """Return data of a file in one folder with its relative paths as a file in another folder has them."""
    if isinstance(data, dict):
        return {_moved(key, there, here): _moved(value, there, here) for key, value in data.items()}
    if isinstance(data, list):
        return [_moved(value, there, here) for value in data]
    if not isinstance(data, str) or os.path.isabs(data) or not Path(data).suffix or "\n" in data:
        return data
    pattern = "{" in data and Path(data).suffix in YAML  # of the scenarios of named runs
    return os.path.relpath(os.path.join(there, data), here) if pattern or _is_file(there, data) else data


def _is_file(folder: str, name: str) -> bool:
    try:
        return os.path.isfile(os.path.join(folder, name))
    except ValueError:
        return False
