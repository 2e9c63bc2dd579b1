"""Artefacts of the tool, as text without anything that differs between two runs of the same program.

Times, versions, paths, and hashes of code and FMUs are taken out. What remains says what was computed: every
signal of a results file, the cells of tables, the verdicts of a page, the variables of an FMU.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
import re
import zipfile
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.csv
import pyarrow.parquet
from lxml import etree, html

VOLATILE = re.compile(
    r"id|key|guid|started|versions|built|generation_?tool|generation_?date.*|program|platform"
    r"|(wall|step)_time.*|time_per_step.*|.*(sha256|checksum|hash).*",
    re.IGNORECASE,
)
"""Keys of JSON, columns of tables and attributes of XML that tell when, where and by what a file was made."""
MASKED = (
    (re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d(\.\d+)?)?(Z|[+-]\d\d:\d\d)?"), "TIME"),
    (re.compile(r"(?<![.\w])(?=\d*[a-f])[0-9a-f]{12,}(?![-+.\w])"), "HASH"),
    (re.compile(r"(?<=\()[0-9a-f]{8}(?=\))"), "HASH"),  # the beginning of one
    (re.compile(r"\b(yawbench|pythonfmu|python|fmpy|numpy) \d+(\.\w+)+", re.IGNORECASE), r"\1 VERSION"),
    (re.compile(r"\d+(\.\d+)? ?[µμ]s\b"), "DURATION"),
    (re.compile(r"(?<= in )\d+(\.\d+)? s$", re.MULTILINE), "DURATION"),
    (re.compile(r"\d+(\.\d+)? MB\b"), "SIZE"),
)
"""The same within a text."""
KEYED = re.compile(r"[0-9a-f]{12,}")
"""Folders named by a hash that covers the program's code; what they hold is collected under `*`."""
NUMBER = re.compile(r"\b[0-9a-f]{64}\b|(?<![\w.])[-+\u2212]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
"""A number, or a hash that stands for many."""
DRAWN_FROM_TIMES = ("figures/pareto.svg",)


def sha256(text: str | bytes) -> str:
    """Return the SHA-256 of a text or of bytes, in hexadecimal."""
    return hashlib.sha256(text.encode() if isinstance(text, str) else text).hexdigest()


def numbers_in(text: str) -> list[str]:
    """Return all numbers in a text, in order: what has to stay the same where only the wording changes."""
    return NUMBER.findall(text)


def masked(text: str, root: Path | None = None) -> str:
    """Return a text without times, versions, hashes, and the path of the folder `root`."""
    if root:
        text = text.replace(str(root.resolve()), ".").replace(str(root), ".")
    for pattern, instead in MASKED:
        text = pattern.sub(instead, text)
    return text


def artefacts_in(folder: Path, root: Path) -> dict[str, str]:
    """Return name -> text of everything in a folder.

    Args:
        folder: with results, pages, FMUs.
        root: what paths in the texts are relative to.
    """
    found: dict[str, list[str]] = defaultdict(list)
    for file in sorted(path for path in folder.rglob("*") if path.is_file()):
        inside = file.relative_to(folder)
        name = "/".join("*" if KEYED.fullmatch(part) else part for part in inside.parts)
        for part, text in texts_of(file, root).items():
            found[name + part].append(text)
    return {
        name: "".join(f"{line}\n" for line in sorted(map(sha256, texts))) if "*" in name else texts[0]
        for name, texts in found.items()
    }


def texts_of(file: Path, root: Path | None = None) -> dict[str, str]:
    """Return the texts that a file comes to, by the part that each tells of: "" or, say, ":status".

    Args:
        file: to read.
        root: what paths in the texts are relative to.
    """
    if file.as_posix().endswith(DRAWN_FROM_TIMES):
        return {}
    if file.suffix == ".csv" and file.stem == "results":
        return _results(file)
    if file.suffix in OF_VALUES:
        return OF_VALUES[file.suffix](file)
    if file.suffix in OF_WORDS:
        return {part: masked(text, root) for part, text in OF_WORDS[file.suffix](file).items()}
    return {"": sha256(file.read_bytes())}


def _json(file: Path) -> dict[str, str]:
    content = _without_volatile(json.loads(file.read_text(encoding="utf-8")))
    if not isinstance(content, dict):
        return {"": _dumped(content)}
    return {f":{key}": _dumped(value) for key, value in content.items()}


def _json_lines(file: Path) -> dict[str, str]:
    lines = [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]
    return {"": "".join(sorted(f"{json.dumps(_without_volatile(line), sort_keys=True)}\n" for line in lines))}


def _results(file: Path) -> dict[str, str]:
    return {"": _columns(pyarrow.csv.read_csv(file)), "#bytes": sha256(file.read_bytes())}


def _csv(file: Path) -> dict[str, str]:
    rows = list(csv.reader(io.StringIO(file.read_text(encoding="utf-8"))))
    kept = [k for k, heading in enumerate(rows[0]) if not _is_volatile(heading)] if rows else []
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([row[k] for k in kept if k < len(row)] for row in rows)
    return {"": text.getvalue()}


def _parquet(file: Path) -> dict[str, str]:
    read = pyarrow.parquet.read_table(file)
    units = {
        field.name: (field.metadata or {}).get(b"unit", b"").decode()
        for field in read.schema
        if not _is_volatile(field.name)
    }
    return {"": _columns(read), "#units": _dumped(units)}


def _page(file: Path) -> dict[str, str]:
    tree = html.parse(str(file), html.HTMLParser(encoding="utf-8"))
    rows = [[_squeezed(cell.itertext()) for cell in row.iterchildren("td", "th")] for row in tree.iter("tr")]
    lines = [" | ".join(cells) for cells in rows]
    outside = (one for one in tree.iterfind(".//*[@class]") if next(one.iterancestors("table"), None) is None)
    lines += [_squeezed(one.itertext()) for one in outside if "verdict" in one.get("class").split()]
    return {"": "".join(f"{line}\n" for line in lines)}


def _figure(file: Path) -> dict[str, str]:
    tree = etree.parse(str(file))
    lines = []
    for element in tree.iter():
        if element.tag is etree.Comment:  # matplotlib draws text as paths, and tells the text here
            lines.append(f"text {element.text.strip()}\n")
        elif path := element.get("d"):
            lines.append(f"path {_squeezed([path])}\n")
    return {"": "".join(lines)}


def _fmu(file: Path) -> dict[str, str]:
    with zipfile.ZipFile(file) as archive:
        return {"": _xml(archive.read("modelDescription.xml"))}


def _ssp(file: Path) -> dict[str, str]:
    with zipfile.ZipFile(file) as archive:
        members = sorted(archive.namelist())
        parts = {f":{name}": _xml(archive.read(name)) for name in members if not name.endswith(".fmu")}
    return {":members": "".join(f"{name}\n" for name in members)} | parts


def _text(file: Path) -> dict[str, str]:
    return {"": file.read_text(encoding="utf-8")}


def _nothing(file: Path) -> dict[str, str]:
    return {}


Reader = Callable[[Path], dict[str, str]]
OF_WORDS: dict[str, Reader] = {
    ".json": _json, ".jsonl": _json_lines, ".csv": _csv, ".html": _page, ".fmu": _fmu, ".ssp": _ssp,
    ".yaml": _text, ".txt": _text,
}  # fmt: skip
"""Kinds of files whose texts are masked."""
OF_VALUES: dict[str, Reader] = {
    ".parquet": _parquet, ".svg": _figure,
    ".png": _nothing,  # the figure that is also there as SVG
}  # fmt: skip
"""Kinds whose texts are made of values, or hold hashes of them."""


def _columns(read: Any) -> str:
    columns = {name: read[name].to_numpy() for name in read.column_names if not _is_volatile(name)}
    return _table(columns)


def _table(columns: Mapping[str, np.ndarray]) -> str:
    return "".join(f"{_described(name, values)}\n" for name, values in columns.items())


def _described(name: str, values: np.ndarray) -> str:
    if not np.issubdtype(values.dtype, np.number):
        return f"{name}: {len(values)} texts, {sha256(json.dumps([str(value) for value in values]))}"
    numbers = np.ascontiguousarray(values, dtype="<f8") + 0.0  # a CSV file tells no integers from floats
    known = numbers[np.isfinite(numbers)]
    span = f"{known.min()!s} to {known.max()!s}, finally {known[-1]!s}" if known.size else "nothing finite"
    return f"{name}: {len(numbers)} values, {span}, {sha256(numbers.tobytes())}"


def _xml(content: bytes) -> str:
    tree = etree.fromstring(content, etree.XMLParser(remove_blank_text=True))
    for element in tree.iter():
        for attribute in [name for name in element.attrib if _is_volatile(name)]:
            del element.attrib[attribute]
    return re.sub(r"(?<=>)(?=<)", "\n", etree.tostring(tree, method="c14n").decode())


def _without_volatile(content: Any) -> Any:
    if isinstance(content, dict):
        return {key: _without_volatile(value) for key, value in content.items() if not _is_volatile(key)}
    return [_without_volatile(value) for value in content] if isinstance(content, list) else content


def _is_volatile(name: str) -> bool:
    return VOLATILE.fullmatch(name.partition(" [")[0]) is not None  # without the unit of a heading


def _dumped(content: Any) -> str:
    return json.dumps(content, indent=1, sort_keys=True, ensure_ascii=False) + "\n"


def _squeezed(texts: Iterable[str]) -> str:
    return " ".join("".join(texts).split())
