"""Files made wrong at random: bytes, tokens of YAML and XML, values in their structure."""

from __future__ import annotations

import io
import json
import random
import re
import zipfile
from collections.abc import Callable, Iterable
from typing import Any

from ruamel.yaml import YAML as RUAMEL

from yawbench.orchestrator.scenario import yaml_lines

NASTY = (
    "", "~", "null", "true", "yes", "no", "off", "0", "-1", "1", "1e999", "-1e999", "1e-999", ".nan",
    ".inf", "-.inf", "nan", "inf", "0x1F", "0o17", "010", "1_000", "190:20:30", "1,5", "0,0325", "5 kmh",
    "90 km/h", "5 %", "1" * 19, "1" * 25, "1" * 400, "1" * 5000, "-" + "9" * 400, "1e400 km",
    "5 " + "(" * 500, "(" * 5000, "[" * 30, "[" * 3000, "{" * 300, "[]", "{}", "[[]]", "[1, 2]", "{a: 1}",
    "{a: {b: {c: 1}}}", "!own [a]", "!own {a: b}", "!!seq {a: b}", "!!map [a]", "!!set {a}",
    "!!omap [a: 1]", "!!binary aGk=", "!!int x", "!!float x", "!!bool x", "!!null x", "!!timestamp x",
    "!<%ff> a", "!%zz a", "!<tag:%41> a", "! a", "!!str 5", "!!python/object:os.x {}", '"\\e[31m"',
    '"\\U00FFFFFF"', '"\\ud800"', '"\\0"', '"\\u202e"', '"\\x9b31m"', '"\\N"', "'", '"', "&a", "*a",
    "&a *a", "*unknown", "<<", "<<: 1", "? a", "- ", ": ", "#", "|", ">", "|9", "%", "@", "`", "---", "...",
    "%YAML 1.1\n---\n", "2020-13-45", "2020-01-01", "2020-01-01T00:00:00Z", "../../../../etc/passwd",
    "/dev/zero", "/dev/stdin", "/", ".", "..", "a/../b", "n" * 300, "n" * 5000, "a\\0b", "con", "*", "**",
    "*.*", "?", "[a-", "x*y*z", "plant.*", "*.yaw_rate", "a.b.c", ".", "a.", ".a", "plant", "controller.",
    "inputs", "vehicle", "inputs.friction*", "{speed}", "{", "}", "{}", "{a b}", "{" * 2000,
    "peak(sideslip)", "peak(", "peak()", "peak(peak(sideslip))", "final(nothing)", "a + " * 3000 + "a",
    "-" * 300 + "a", "a / 0", "(a", "1 if a else b", "lambda: 1", "a" * 300, "1e5000", "10" + "**9" * 30,
    "\u00e9\u00df\u6f22", "\U0001f697", "\u202e", "<script>alert(1)</script>", "$\\frac{$",
    "file:///etc/passwd", "http://[", "\t", "a\tb",
)  # fmt: skip
"""Texts that have been, or could be, too much for a reader of values."""

Mutation = Callable[[bytes, random.Random], bytes]


def _flip(data: bytes, r: random.Random) -> bytes:
    changed = bytearray(data)
    for _ in range(r.choice((1, 1, 2, 8, 64))):
        if changed:
            changed[r.randrange(len(changed))] = r.randrange(256)
    return bytes(changed)


def _cut(data: bytes, r: random.Random) -> bytes:
    return data[: r.randrange(len(data) + 1)]


def _remove(data: bytes, r: random.Random) -> bytes:
    a, b = sorted(r.randrange(len(data) + 1) for _ in range(2))
    return data[:a] + data[min(b, a + 200) :]


def _repeat(data: bytes, r: random.Random) -> bytes:
    a, b = sorted(r.randrange(len(data) + 1) for _ in range(2))
    return data[:b] + data[a:b][:500] * r.choice((1, 1, 3, 50)) + data[b:]


def _insert(data: bytes, r: random.Random) -> bytes:
    at = r.randrange(len(data) + 1)
    some = r.choice(
        (b"\0", b"\xff", b"\t", b"\r", b"\n", b"\xef\xbb\xbf", b"\x1b[31m", bytes(r.randbytes(8)))
    )
    return data[:at] + some + data[at:]


def _insert_nasty(data: bytes, r: random.Random) -> bytes:
    at = r.randrange(len(data) + 1)
    return data[:at] + _nasty(r) + data[at:]


def _encode(data: bytes, r: random.Random) -> bytes:
    text = data.decode("utf-8", "replace")
    kind = r.choice(("utf-16", "utf-32", "latin-1", "cr", "crlf", "bom", "tabs", "one line"))
    if kind in ("cr", "crlf"):
        return text.replace("\n", "\r" if kind == "cr" else "\r\n").encode()
    if kind == "tabs":
        return text.replace("  ", "\t").encode()
    if kind == "one line":
        return text.replace("\n", " ").encode()
    return b"\xef\xbb\xbf" * 2 + data if kind == "bom" else text.encode(kind, "replace")


def _nasty(r: random.Random) -> bytes:
    return r.choice(NASTY).encode("utf-8", "surrogatepass")


def _token(pattern: bytes) -> Mutation:
    def mutate(data: bytes, r: random.Random) -> bytes:
        found = list(re.finditer(pattern, data))
        if not found:
            return _insert_nasty(data, r)
        one = r.choice(found)
        return data[: one.start(1)] + _nasty(r) + data[one.end(1) :]

    return mutate


def _lines(data: bytes, r: random.Random) -> bytes:
    lines = data.splitlines(keepends=True) or [b""]
    i, k = r.randrange(len(lines)), r.randrange(len(lines))
    what = r.choice(("drop", "double", "swap", "indent", "outdent", "many"))
    if what == "drop":
        del lines[i]
    elif what == "double":
        lines.insert(k, lines[i])
    elif what == "swap":
        lines[i], lines[k] = lines[k], lines[i]
    elif what == "many":
        lines[i] *= 300
    else:
        lines[i] = b"  " + lines[i] if what == "indent" else lines[i].removeprefix(b"  ")
    return b"".join(lines)


def places_in(content: Any) -> list[tuple[Any, Any]]:
    """Return all (container, key) below a value."""
    if not isinstance(content, (dict, list)):
        return []
    keys: Iterable[Any] = list(content) if isinstance(content, dict) else range(len(content))
    return [place for key in keys for place in ((content, key), *places_in(content[key]))]


def _structure(data: bytes, r: random.Random) -> bytes:
    """Replace, move, drop or repeat a part of what a YAML file holds; the result is JSON, so YAML too."""
    content = RUAMEL(typ="safe").load(data)
    places = places_in(content)
    for _ in range(r.choice((1, 1, 1, 2, 5))):
        part, key = r.choice(places)
        other, its_key = r.choice(places)
        what = r.choice(("value", "value", "move", "drop", "wrap", "number", "name"))
        try:
            if what == "value":
                text = r.choice(NASTY)
                part[key] = yaml_lines.scalar(text) if r.random() < 0.7 else text
            elif what == "number":
                part[key] = r.choice((0, -1, 1, 2**31, 2**63, 10**30, 0.1, 1e308, 5e-324, True, None, [], {}))
            elif what == "move":
                part[key] = other[its_key]
            elif what == "wrap":
                part[key] = r.choice(([part[key]], {"a": part[key]}, [part[key]] * 50))
            elif what == "name" and isinstance(part, dict):
                part[r.choice(NASTY)] = part.pop(key)
            elif what == "drop":
                del part[key]
        except (KeyError, IndexError):  # a part that is there no more
            continue
    try:
        return json.dumps(content, ensure_ascii=r.random() < 0.5).encode("utf-8", "surrogatepass")
    except (ValueError, RecursionError):  # moved into itself
        return _flip(data, r)


ANY: tuple[Mutation, ...] = (_flip, _cut, _remove, _repeat, _insert, _insert_nasty)
YAML = (
    *ANY, _encode, _lines, _lines, _structure, _structure, _structure, _structure,
    *[_token(rb":[ \t]+([^\s{}\[\],#][^\n{}\[\],#]*)")] * 4, _token(rb"(?m)^\s*-?\s*([\w.*\"]+):"),
    _token(rb"[{,\[] *([^{}\[\],:]+)"),
)  # fmt: skip
XML = (
    *ANY, _lines, *[_token(rb'="([^"]*)"')] * 6, *[_token(rb"(<[^>]*>)")] * 2, _token(rb"</?([\w:]+)"),
    _token(rb' ([\w:]+)="'),
)  # fmt: skip
JSON = (*ANY, _lines, *[_token(rb'": ([^\n{}\[\],]+)')] * 4, _token(rb'"([^"]*)":'), _structure, _structure)
CSV = (*ANY, _encode, _lines, *[_token(rb"([^,\n]+)")] * 4)


def mutated(data: bytes, mutations: tuple[Mutation, ...], r: random.Random) -> bytes:
    """Return data after one to three mutations."""
    for _ in range(r.choice((1, 1, 1, 2, 3))):
        mutation = r.choice(mutations)
        try:
            data = mutation(data, r)
        except Exception:
            data = _flip(data, r)
    return data


def mutated_archive(data: bytes, r: random.Random) -> bytes:
    """Return an archive with a member mutated, left out or added, or with its own bytes mutated."""
    if r.random() < 0.2:
        return mutated(data, ANY, r)
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {info.filename: archive.read(info) for info in archive.infolist()}
    texts = [name for name in members if name.endswith((".ssd", ".ssv", ".ssm", ".xml"))]
    name = r.choice(texts) if r.random() < 0.9 else r.choice(list(members))
    what = r.random()
    if what < 0.85:
        members[name] = mutated(members[name], XML if name in texts else ANY, r)
    elif what < 0.9:
        del members[name]
    else:
        members[r.choice(("../up", "/etc/x", "a" * 300, "\x1b[31m", "resources/../../x", "C:\\x"))] = b"x"
    target = io.BytesIO()
    with zipfile.ZipFile(target, "w", r.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED))) as archive:
        for member, content in members.items():
            archive.writestr(member, content)
    return target.getvalue()
