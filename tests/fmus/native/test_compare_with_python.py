"""A library that differs from Python in a bit, a status or a sentence is refused."""

from __future__ import annotations

import math
import struct

import pytest

from tests.refusals import mentions
from yawbench.fmus.native import build, compare_with_python
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


@pytest.mark.sampled(2)
@pytest.mark.parametrize("what", BROKEN)
def test_a_translation_that_is_wrong_is_found_out(what, tmp_path):
    with component_of(source(LAW), tmp_path) as (component, home):
        text = emit(specialise(component, home), "small.py", "{a}")
        library = compiled(broken(text, what), tmp_path)
        found = differences(library, "{a}", component, home.parent).difference
    assert BROKEN[what][2] in found


HUGE = {
    "a product": """
def start(self, t, u):
    self.n = 12345
def advance(self, t, h, u):
    self.n = (self.n * 1103515245 + 12345) % 2**31
def output(self, t, u):
    return (self.n / 2**31,)
""",
    "a quotient": """
def output(self, t, u):
    return (int(1e16 * u[0]) // 3 % 1000,)
""",
    "a sum that is rounded to 2^53": """
def output(self, t, u):
    return ((2**52 + 1 + int(2.0**52 * abs(u[0] / u[0]))) % 1000,)
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


def test_a_translation_that_loops_for_ever_is_given_up(tmp_path):
    with component_of(source(LAW), tmp_path) as (component, home):
        text = emit(specialise(component, home), "small.py", "{a}")
        library = compiled(text.replace("y[0] = n0;", "for (;;) {}"), tmp_path)
        with pytest.raises(TimeoutError):
            differences(library, "{a}", component, home.parent, limit=1)


def test_a_translation_that_is_right_gets_through(tmp_path):
    with component_of(source(LAW), tmp_path) as (component, home):
        library = compiled(emit(specialise(component, home), "small.py", "{a}"), tmp_path)
        assert differences(library, "{a}", component, home.parent).difference == ""


def test_what_does_not_get_through_is_not_packed(tmp_path, monkeypatch):
    monkeypatch.setenv("YAWBENCH_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(build, "emit", lambda *args: broken(emit(*args), "a bit"))
    with component_of(source(LAW), tmp_path) as (component, home):
        made = build.native(component, home, source="small.py", guid="{a}", resources=home.parent)
        again = build.native(component, home, source="small.py", guid="{a}", resources=home.parent)
    assert made.files == {} and made == again
    assert mentions(made.why_not, "0.001 s", "2", "5e-324", "0.0", "y")


@pytest.mark.parametrize("law", LEFT)
def test_what_a_start_leaves_to_the_next_start_is_found_out(law, compare):
    found = compare(law, differences).difference
    assert "outputs read before" in found


@pytest.mark.sampled(1)
@pytest.mark.parametrize("slow", ["by its length", "by its comparison"])
def test_a_run_waits_neither_for_a_long_translation_nor_for_a_long_comparison(slow, tmp_path, monkeypatch):
    monkeypatch.setenv("YAWBENCH_CACHE", str(tmp_path / "cache"))
    asked = []

    def too_long(*args):
        asked.append(args[-1])
        raise TimeoutError("it takes long")

    if slow == "by its length":
        monkeypatch.setattr(build, "MOST_IN_HURRY", 1000)
    else:
        monkeypatch.setattr(build.compare_with_python, "differences", too_long)
    with component_of(source(LAW), tmp_path) as (component, home):

        def made(hurry: bool) -> build.Native:
            given = {"source": "small.py", "guid": "{a}", "resources": home.parent}
            return build.native(component, home, hurry=hurry, **given)

        assert made(hurry=True).why_not == build.LATER
        assert asked == ([] if slow == "by its length" else [int(build.LONGEST)])
        assert made(hurry=True).why_not == build.LATER  # by now its effort is known, or still expected
        later = made(hurry=False)
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


def test_branches_that_usual_inputs_miss_are_searched_and_compared(tmp_path, monkeypatch):
    monkeypatch.setattr(compare_with_python, "SEARCH", SEARCH)
    with component_of(source(LATE), tmp_path) as (component, home):
        program = specialise(component, home)
        text = emit(program, "small.py", "{a}")

        def compared(text):
            return differences(
                compiled(text, tmp_path), "{a}", component, home.parent, build._thresholds(program)
            )

        found = compared(text)
        for right, wrong in (("= 7.0;", "= 7.5;"), ("= 3.0;", "= 3.5;"), ("= 9.0;", "= 9.5;")):
            assert "found by s" in compared(text.replace(right, wrong)).difference
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


def test_a_branch_for_steps_that_units_refuse_is_not_compiled(tmp_path):
    with component_of(source(NOTHING), tmp_path) as (component, home):
        library = compiled(emit(specialise(component, home), "small.py", "{a}"), tmp_path)
        assert differences(library, "{a}", component, home.parent) == Compared()


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


def test_a_branch_that_is_reached_with_all_parameters_off_is_compared(tmp_path, monkeypatch):
    monkeypatch.setattr(compare_with_python, "SEARCH", SEARCH)
    with component_of(source(OFF, SIX), tmp_path) as (component, home):
        text = emit(specialise(component, home), "small.py", "{a}")
        right, wrong = (
            differences(compiled(x, tmp_path), "{a}", component, home.parent)
            for x in (text, text.replace("= 7.0;", "= 7.5;"))
        )
    assert right.untried == ()
    assert "7.0 in Python" in wrong.difference


NARROW = """
def advance(self, t, h, u):
    pass
def output(self, t, u):
    if abs(math.sin(1234.5 * u[0]) - 0.77) < 1e-9:
        return (5.0,)
    return (u[1],)
"""


def test_a_branch_that_was_never_compared_is_told_and_ends_the_call_where_python_can_go_on(
    tmp_path, monkeypatch
):
    monkeypatch.setenv("YAWBENCH_CACHE", str(tmp_path / "cache"))
    with component_of(source(NARROW), tmp_path) as (component, home):
        given = {"source": "small.py", "guid": "{a}", "resources": home.parent}
        made, again = (build.native(component, home, closed=True, **given) for _ in range(2))
        computing = build.native(component, home, **given)
    line = source(NARROW).splitlines().index("        if abs(math.sin(1234.5 * u[0]) - 0.77) < 1e-9:") + 1
    assert made == again and f"controllers/small.py:{line}" in made.untried
    library = tmp_path / "closed.so"
    library.write_bytes(made.files["binaries/linux64/native.so"])
    unit = Native(library, "{a}")
    unit.set("Real", [0, 1], [0.5, 0.25])
    assert unit.begin(0.0)[0] and unit.end_initialization()[0] and unit.step(0.0, 0.01)[0]
    assert struct.unpack("d", unit.get([2])[2]) == (0.25,)
    unit.set("Real", [0, 1], [math.asin(0.77) / 1234.5, 0.25])
    done, (said,), _ = unit.step(0.01, 0.01)
    assert not done and ALONE in said and f"(controllers/small.py:{line})" in said
    assert computing.untried == made.untried
    library = tmp_path / "computing.so"
    library.write_bytes(computing.files["binaries/linux64/native.so"])
    unit = Native(library, "{a}")
    unit.set("Real", [0, 1], [math.asin(0.77) / 1234.5, 0.25])
    assert unit.begin(0.0)[0] and unit.end_initialization()[0] and unit.step(0.0, 0.01)[0]
    assert struct.unpack("d", unit.get([2])[2]) == (5.0,)
