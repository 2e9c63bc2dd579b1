"""A library that differs from Python in a bit, a status or a sentence is refused."""

from __future__ import annotations

import math
import struct
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.refusals import mentions
from yawbench.fmus.native import build, compare_with_python, postponed
from yawbench.fmus.native.compare_with_python import SEARCH, Compared, Native, differences
from yawbench.fmus.native.emit import emit
from yawbench.fmus.native.ir import ALONE, INEXACT
from yawbench.fmus.native.specialise import specialise

from .small import compiled, component_of, fewer_steps, source
from .together import comparisons

pytestmark = pytest.mark.usefixtures("quick")

LAW = """
def output(self, t, u):
    if u[0] > 0.99:
        raise ValueError("a is too large")
    return (self.p.gain * u[0] + u[1],)
"""
BROKEN = {
    "a bit": ("y[0] = n0;", "y[0] = nextafter(n0, 1e9);", "y is "),
    "a sentence": ("a is too large", "a is too big", "native says"),
    "a status": ("return 1;\n    }\n    ", "}\n    ", "Python does not"),
    "a life": ("y[0] = n0;", "abort();", "it dies of signal"),
}


@pytest.fixture
def quick(monkeypatch):
    """Fewer steps, and libraries for Linux that are compiled fast."""
    build.toolchain()  # the real one is kept for the whole process
    monkeypatch.setattr(build, "LINUX", ("-O0", "-fPIC"))
    with fewer_steps():
        yield


def broken(text: str, what: str) -> str:
    """Return C text in which the function of the outputs is wrong."""
    before, after, _ = BROKEN[what]
    head, _, rest = text.partition("static int output(")
    if what == "a status":
        before, after = "return 1;", "problem->kind = NULL;"
    assert before in rest
    return head + "static int output(" + rest.replace(before, after, 1)


class Translated:
    """A law, its C text, and what is found of libraries made of such texts."""

    def __init__(self, component, home: Path, folder: Path) -> None:
        self.component, self.home, self.folder = component, home, folder
        self.program = specialise(component, home)
        self.text = emit(self.program, "small.py", "{a}")

    def compared(self, text: str = "", *more, **limits) -> Compared:
        library = compiled(text or self.text, self.folder)
        return differences(library, "{a}", self.component, self.home.parent, *more, **limits)

    def built(self, **options) -> build.Native:
        given = {"source": "small.py", "guid": "{a}", "resources": self.home.parent}
        return build.native(self.component, self.home, **given, **options)


@pytest.fixture
def translated(tmp_path):
    """Return a law, translated."""
    with ExitStack() as stack:

        def do(body: str = LAW, before: str = "") -> Translated:
            return Translated(*stack.enter_context(component_of(source(body, before), tmp_path)), tmp_path)

        yield do


@pytest.mark.sampled(2)
@pytest.mark.parametrize("what", BROKEN)
def test_a_translation_that_is_wrong_is_found_out(what, translated):
    law = translated()
    assert BROKEN[what][2] in law.compared(broken(law.text, what)).difference


HUGE = {
    "a product": """
def start(self, t, u):
    self.n = 12345
def advance(self, t, h, u):
    self.n = (self.n * 1103515245 + 12345) % 2**31
def output(self, t, u):
    return (self.n / 2**31,)
""",
    "a rest": """
def output(self, t, u):
    return (-1 % int(1e16 + 2.0 * abs(u[0])) % 1000,)
""",
}


LEFT = {
    "count": "def configure(self):\n    self.n = 0\ndef start(self, t, u):\n    self.n += 1\n",
    "attribute": "n = 0\ndef start(self, t, u):\n    self.n += 1\n",
    "list": "def configure(self):\n    self.a = [0.0]\ndef start(self, t, u):\n    self.a[0] += 1\n"
    "    self.n = self.a[0]\n",
    "branch": "def start(self, t, u):\n    self.n = getattr(self, 'n', 0.0) + 1.0\n",
}
"""Laws whose start leaves something to the next start."""


@pytest.fixture(scope="module")
def compare(tmp_path_factory):
    left = {
        name: f"{law}def output(self, t, u):\n    return (u[0] + self.n,)\n" for name, law in LEFT.items()
    }
    with comparisons(HUGE | left, "", tmp_path_factory.mktemp("laws")) as compare:
        yield compare


@pytest.mark.sampled(2)
@pytest.mark.parametrize("law", HUGE)
def test_an_integer_of_2_to_53_is_an_error_and_no_wrong_number(law, compare):
    assert INEXACT in compare(law, differences).difference


def test_a_translation_that_loops_for_ever_is_given_up(translated):
    law = translated()
    with pytest.raises(TimeoutError):
        law.compared(law.text.replace("y[0] = n0;", "for (;;) {}"), limit=1)


def test_what_does_not_get_through_is_not_packed(translated, tmp_path, monkeypatch):
    monkeypatch.setenv("YAWBENCH_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(build, "emit", lambda *args: broken(emit(*args), "a bit"))
    law = translated()
    made, again = law.built(), law.built()
    assert made.files == {} and made == again
    assert mentions(made.why_not, "0.001 s", "2", "5e-324", "0.0", "y")


@pytest.mark.parametrize("law", LEFT)
def test_what_a_start_leaves_to_the_next_start_is_found_out(law, compare):
    found = compare(law, differences).difference
    assert "outputs read before" in found


@pytest.mark.sampled(1)
@pytest.mark.parametrize("slow", ["by its length", "by its comparison"])
def test_a_run_waits_neither_for_a_long_translation_nor_for_a_long_comparison(
    slow, translated, tmp_path, monkeypatch
):
    monkeypatch.setenv("YAWBENCH_CACHE", str(tmp_path / "cache"))
    asked = []

    def too_long(*args):
        asked.append(args[-1])
        raise TimeoutError("it takes long")

    if slow == "by its length":
        monkeypatch.setattr(postponed, "MOST_TEXT", 1000)
    else:
        monkeypatch.setattr(build.compare_with_python, "differences", too_long)
    law = translated()
    assert law.built(hurry=True).why_not == postponed.LATER
    assert asked == ([] if slow == "by its length" else [int(postponed.LONGEST)])
    assert law.built(hurry=True).why_not == postponed.LATER  # by now its effort is known, or still expected
    later = law.built(hurry=False)
    assert later.why_not == ("" if slow == "by its length" else "it takes long")


LATE = """
def start(self, t, u):
    self.n = 0
    self.x = 0.0
def advance(self, t, h, u):
    self.n += 1
    if self.n == 2500:
        self.x = 7.0
    if u[0] > 5000.0 and h < 1e-6:
        self.x = 3.0
    if t > 90.0 and self.p.gain > 60.0:
        self.x = 9.0
def output(self, t, u):
    if math.sin(u[0]) > 2.0:
        return (5.0,)
    return (self.x + u[1],)
"""
"""A law with branches that are reached late, by rare inputs, with other parameters, and never."""


def test_branches_that_usual_inputs_miss_are_searched_and_compared(translated, monkeypatch):
    monkeypatch.setattr(compare_with_python, "SEARCH", SEARCH)
    law = translated(LATE)
    thresholds = build._thresholds(law.program)
    found = law.compared(law.text, thresholds)
    for right, wrong in (("= 7.0;", "= 7.5;"), ("= 3.0;", "= 3.5;"), ("= 9.0;", "= 9.5;")):
        assert "found by s" in law.compared(law.text.replace(right, wrong), thresholds).difference
    never = source(LATE).splitlines().index("        if math.sin(u[0]) > 2.0:") + 1
    assert found.difference == "" and f"controllers/small.py:{never}" in found.untried
    assert {int(place.rpartition(":")[2]) for place in found.untried} <= {never, never + 1}


NOTHING = """
def start(self, t, u):
    self.x = 0.0
def advance(self, t, h, u):
    if h <= 0.0:
        return
    self.x += u[0] / h
def output(self, t, u):
    return (self.x,)
"""
"""A law with a branch for steps of no length, which units refuse."""


def test_a_branch_for_steps_that_units_refuse_is_not_compiled(translated):
    assert translated(NOTHING).compared() == Compared()


SIX = """
@dataclass(frozen=True)
class Parameters:
    \"\"\"Six numbers.\"\"\"

    one: float = parameter(1.0, "1", "A number", "chosen: a test", minimum=0.0)
    two: float = parameter(2.0, "1", "A number", "chosen: a test", minimum=0.0)
    three: float = parameter(3.0, "1", "A number", "chosen: a test")
    four: float = parameter(4.0, "1", "A number", "chosen: a test")
    five: float = parameter(5.0, "1", "A number", "chosen: a test")
    six: float = parameter(6.0, "1", "A number", "chosen: a test")
"""
OFF = """
def output(self, t, u):
    p = self.p
    if max(map(abs, (p.one, p.two, p.three, p.four, p.five, p.six))) == 0.0:
        return (7.0,)
    return (u[0],)
"""
"""A law with a branch that is reached where all parameters are zero."""


def test_a_branch_that_is_reached_with_all_parameters_off_is_compared(translated, monkeypatch):
    monkeypatch.setattr(compare_with_python, "SEARCH", SEARCH)
    law = translated(OFF, SIX)
    assert law.compared().untried == ()
    assert "7.0 in Python" in law.compared(law.text.replace("= 7.0;", "= 7.5;")).difference


NARROW = """
def advance(self, t, h, u):
    pass
def output(self, t, u):
    if abs(math.sin(1234.5 * u[0]) - 0.77) < 1e-9:
        return (5.0,)
    return (u[1],)
"""


def test_a_branch_that_was_never_compared_is_told_and_ends_the_call_where_python_can_go_on(
    translated, tmp_path, monkeypatch
):
    monkeypatch.setenv("YAWBENCH_CACHE", str(tmp_path / "cache"))
    law = translated(NARROW)
    made, again, computing = law.built(closed=True), law.built(closed=True), law.built()
    line = source(NARROW).splitlines().index("        if abs(math.sin(1234.5 * u[0]) - 0.77) < 1e-9:") + 1
    assert made == again and f"controllers/small.py:{line}" in made.untried
    assert computing.untried == made.untried

    def answers(built: build.Native, *inputs: float):
        """Return whether a step succeeds, what is said, and the output, after each of these inputs."""
        library = tmp_path / f"{'closed' if built is made else 'computing'}.so"
        library.write_bytes(built.files["binaries/linux64/native.so"])
        unit = Native(library, "{a}")
        unit.set("Real", [0, 1], [inputs[0], 0.25])
        assert unit.begin(0.0)[0] and unit.end_initialization()[0]
        for k, one in enumerate(inputs):
            unit.set("Real", [0, 1], [one, 0.25])
            done, said, _ = unit.step(0.01 * k, 0.01)
            yield done, said, struct.unpack("d", unit.get([2])[2]) if done else ()

    rare = math.asin(0.77) / 1234.5
    usual, (done, (said,), _) = answers(made, 0.5, rare)
    assert usual == (True, usual[1], (0.25,))
    assert not done and ALONE in said and f"(controllers/small.py:{line})" in said
    assert next(answers(computing, rare))[::2] == (True, (5.0,))
