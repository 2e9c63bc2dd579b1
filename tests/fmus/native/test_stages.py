"""The stages of a translation, each by itself: read, evaluate, emit."""

from __future__ import annotations

import math
import subprocess
from pathlib import Path

import pytest

from tests.refusals import refused
from yawbench.fmus.compiler import compiler_command
from yawbench.fmus.native import ir
from yawbench.fmus.native.built_in import FUNCTIONS
from yawbench.fmus.native.emit import constant, quoted
from yawbench.fmus.native.read import Sources
from yawbench.fmus.native.specialise import specialise
from yawbench.fmus.native.values import Refused

from .small import component_of, source

# ---- read ---------------------------------------------------------------------------------------


one, other = lambda x: x, lambda x: -x


def test_read_refuses_what_it_cannot_tell_from_its_neighbour():
    with refused(Refused, names=("test_stages.py", "lambda", "function")):
        Sources(Path(__file__).parent).of(other)


# ---- evaluate -----------------------------------------------------------------------------------


def output_of(body: str, folder: Path) -> ir.Function:
    with component_of(source(body), folder) as (component, home):
        return specialise(component, home).functions["output"]


KNOWN = """def output(self, t, u):
    square, named = (lambda x: x * x), {"a": 1.0}
    first, *rest = (3.0, 1.0)
    total = named["a"] + len((1, 2)) - abs(-1) + sum(rest)
    for k in range(4):
        total += k if f"{k}" != "2" else sum([square(x) for x in (1.0, 2.0, 3.0) if x < 3.0])
    return (total if first > 2 else u[0],)
"""


def test_what_is_known_at_build_time_is_evaluated_then(tmp_path):
    function = output_of(KNOWN, tmp_path)
    assert list(function.body) == []
    assert [value for _, value in function.stores] == [12.0]


FOLLOWED = {
    "a branch on an input": ("x = 0.0\n    if u[0] > 1.0:\n        x = u[1]\n    return (x,)", {ir.If: 1}),
    "a branch known at build time": ("return (u[0] if 2 > 1 else u[1] / 0.0,)", {}),
    "a loop over few items": (
        "x = 0.0\n    for y in u:\n        x += y\n    return (x,)",
        {ir.Loop: 0, ir.Let: 2},
    ),
    "a loop over many": (
        "x = u[0]\n    for k in range(99):\n        x *= 0.5\n    return (x,)",
        {ir.Loop: 1, ir.Leave: 1},
    ),
    "a loop of unknown length": (
        "x = u[0]\n    while abs(x) > 1.0:\n        x *= 0.5\n    return (x,)",
        {ir.Loop: 1, ir.Leave: 1},
    ),
    "a table at an unknown index": ("return ((1.0, 2.0, 4.0)[int(abs(u[0])) % 3],)", {ir.Load: 1}),
    "an exception": (
        "if u[0] > 1.0:\n        raise ValueError('no')\n    return (u[0],)",
        {ir.If: 1, ir.Raise: 1},
    ),
}


@pytest.mark.parametrize("construct", FOLLOWED)
def test_what_hangs_on_an_input_becomes_a_statement(construct, tmp_path):
    body, expected = FOLLOWED[construct]
    function = output_of(f"def output(self, t, u):\n    {body}", tmp_path)
    kinds = [type(statement) for statement in ir.every(function.body)]
    assert {kind: kinds.count(kind) for kind in expected} == expected
    assert kinds if expected else not kinds


def test_an_entry_of_a_table_is_all_that_a_construct_needs(tmp_path, monkeypatch):
    erf = "def output(self, t, u):\n    return (math.erf(u[0]),)"
    with refused(Refused, names=("small.py", "math.erf")):
        output_of(erf, tmp_path)
    monkeypatch.setitem(FUNCTIONS, math.erf, lambda e, x: e.lower.let(ir.REAL, "erf", x))
    (statement,) = output_of(erf, tmp_path).body
    assert isinstance(statement, ir.Let) and statement.op == "erf"


# ---- emit ---------------------------------------------------------------------------------------

NUMBERS = (0.0, -0.0, 0.1, -1e-310, 5e-324, 1.7976931348623157e308, 2.0**53, math.inf, -math.inf)
TEXTS = ("plain", 'a "quote" and a \\', "100 %d ??/ trigraph", "Größe µ", "new\nline\ttab", "")


def test_constants_and_texts_in_c_are_those_of_python(tmp_path):
    """Compiled and printed: numbers to the last bit, texts byte by byte."""
    lines = [f'printf("%a\\n", {constant(x)});' for x in NUMBERS]
    lines += [
        f'for (const char *c = {quoted(text)}; *c; c++) printf("%02x", *c & 255); puts("");' for text in TEXTS
    ]
    head = "#include <math.h>\n#include <stdio.h>\nint main(void)\n{\n"
    (tmp_path / "numbers.c").write_text(head + "\n".join(lines) + "\nreturn 0;\n}\n")
    subprocess.run([*compiler_command(), "-std=c11", "numbers.c", "-o", "numbers"], cwd=tmp_path, check=True)
    said = subprocess.run([tmp_path / "numbers"], capture_output=True, text=True, check=True).stdout.split(
        "\n"
    )
    assert [float.fromhex(word).hex() for word in said[: len(NUMBERS)]] == [x.hex() for x in NUMBERS]
    assert [bytes.fromhex(word).decode() for word in said[len(NUMBERS) : -1]] == list(TEXTS)
