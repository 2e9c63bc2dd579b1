"""Whatever a component does wrong ends in a sentence and a status, never in a dead process."""

from __future__ import annotations

import ctypes
import inspect
import math

import pytest

from tests.fmus.bare import ERROR, FATAL, OK, Refused, Unit
from tests.fmus.samples.controllers.failing import Failing
from tests.refusals import mentions, refused

DITCH = "ValueError: 50 % of the wheels (100%s, %n) are in the Gräben: größer als 1 µm"


@pytest.fixture
def failing(sample):
    fmu = sample("controllers/failing.py")
    units = []

    def make(**parameters):
        unit = Unit(fmu, **parameters)
        units.append(unit)
        return unit

    yield make
    for unit in units:
        unit.free()


def says_what_where_and_with_which_inputs(unit, *more):
    return mentions(
        unit.messages[0], "ValueError", "50 %", "100", "1", "controllers/failing.py:46", "yaw_rate", *more
    )


@pytest.mark.parametrize(("where", "call"), [("configure", "Enter"), ("start", "Exit")])
def test_an_exception_at_the_start_is_an_error_of_the_call_that_needs_it(failing, where, call):
    unit = failing(where=where, yaw_rate=0.25)
    answers = [unit.call(f"fmi2{one}InitializationMode") for one in ("Enter", "Exit")]
    assert answers[0] == (ERROR if call == "Enter" else OK)
    assert answers[1] == ERROR
    assert says_what_where_and_with_which_inputs(unit, "0 s", "0.25")


def test_an_exception_in_start_makes_reading_an_output_during_initialization_an_error(failing):
    unit = failing(where="start")
    assert unit.call("fmi2EnterInitializationMode") == OK
    with pytest.raises(Refused, match="initialization failed"):
        unit.get("yaw_moment")


@pytest.mark.parametrize("where", ["advance", "output"])
def test_an_exception_in_a_step_names_time_place_and_inputs(failing, where):
    unit = failing(where=where, when=0.0015)
    unit.start()
    unit.set(yaw_rate=0.5)
    steps = [unit.try_step(k * 0.001) for k in range(4)]
    first = 2 if where == "advance" else 1
    assert steps == [OK] * first + [ERROR] * (4 - first)
    assert says_what_where_and_with_which_inputs(unit, "0.5", f"0.00{first:g} s")


def test_the_traceback_is_logged_for_those_who_ask(failing, sample):
    quiet, curious = failing(where="configure"), failing(where="configure", logging_on=True)
    for unit in (quiet, curious):
        assert unit.call("fmi2EnterInitializationMode") == ERROR
    assert [category for _, category, _ in quiet.log] == ["logStatusError"]
    assert [category for _, category, _ in curious.log] == ["logStatusError", "traceback"]
    traceback = curious.messages[1]
    assert traceback.startswith("Traceback")
    assert mentions(traceback, "failing.py", "line 71", "configure")
    assert mentions(traceback.splitlines()[-1], "ValueError", "50 %")


@pytest.mark.parametrize(
    ("how", "what"),
    [
        ("interrupt", ("KeyboardInterrupt",)),
        ("exit", ("SystemExit: 3",)),
        ("recursion", ("RecursionError",)),
        ("surrogate", ("0", "half", "character")),
        ("unprintable", ("ValueError", "step")),
        ("none", ("TypeError", "returned", "output")),
        ("count", ("TypeError", "2 values", "1 outputs")),
        ("text", ("ValueError", "'far'")),
    ],
)
def test_any_other_failure_of_a_step_is_an_error_with_a_sentence(failing, how, what):
    unit = failing(where="output", how=how)
    unit.start()
    assert unit.try_step(0.0) == ERROR
    assert mentions(unit.messages[0], *what)
    assert unit.get("yaw_moment") == [0.0]  # the last good value


@pytest.mark.parametrize("how", ["none", "count", "text"])
def test_what_output_returns_wrongly_is_told_with_the_line_of_output(failing, how):
    unit = failing(where="output", how=how)
    unit.start()
    assert unit.try_step(0.0) == ERROR
    line = inspect.getsourcelines(Failing.output)[1]
    assert unit.messages[0].endswith(f" (controllers/failing.py:{line}); inputs: yaw_rate = 0.0")


def test_a_nan_is_handed_to_the_host_as_it_is(failing):
    unit = failing(where="output", how="nan")
    unit.start()
    assert unit.try_step(0.0) == OK
    assert math.isnan(unit.get("yaw_moment")[0])


@pytest.mark.parametrize(("name", "value"), [("when", -1.0), ("how", 99), ("when", math.nan)])
def test_a_parameter_out_of_range_is_named(failing, name, value):
    unit = failing(**{name: value})  # 99 is the number of no choice
    names = ("fmi2EnterInitializationMode", "status 3", "0 s", "ValueError", "yaw_rate", "0.0", name, value)
    with refused(Refused, names=names):
        unit.start()


@pytest.mark.parametrize(
    ("started", "name", "value", "kind", "reference"),
    [
        (False, "yaw_moment", 1.0, "Real", 1),
        (True, "when", 1.0, "Real", 2),
        (True, "how", "exit", "Integer", 4),
    ],
)
def test_what_cannot_be_set_is_refused_by_name(failing, started, name, value, kind, reference):
    unit = failing()
    if started:
        unit.start()
    names = (f"fmi2Set{kind}", "status 3", kind, reference, "0 s", "ValueError", "yaw_rate", "0.0")
    with refused(Refused, names=names):
        unit.set(**{name: value})


@pytest.mark.parametrize("kind", ["Real", "Integer", "Boolean", "String"])
@pytest.mark.parametrize("access", ["Get", "Set"])
def test_an_unknown_value_reference_or_one_of_another_type_is_an_error(failing, kind, access):
    other = failing().fmu.reference["when" if kind == "Boolean" else "unsavable"]
    if kind == "Real":
        other = len(failing().fmu.reference)
    for reference in (other, 99, 0x7FFFFFFF, 0xFFFFFFFF):
        unit = failing()
        values = (ctypes.c_char_p * 1)(b"x") if kind == "String" else (ctypes.c_double * 1)(0.0)
        status = unit.call(f"fmi2{access}{kind}", (ctypes.c_uint * 1)(reference), ctypes.c_size_t(1), values)
        assert status == ERROR
        assert mentions(unit.messages[0], "0 s", "yaw_rate", "0.0", kind)


def test_a_reset_makes_a_failed_unit_work_again(failing):
    unit = failing(where="advance")
    unit.start()
    assert unit.try_step(0.0) == ERROR
    unit.do("fmi2Reset")
    unit.start()
    assert [unit.try_step(k * 0.001) for k in range(3)] == [OK] * 3
    assert unit.get("yaw_moment") == [3.0]


def test_a_state_from_before_the_failure_makes_the_unit_work_again(failing):
    unit = failing(where="advance", when=0.0015)
    unit.start()
    unit.step(0.0)
    state = unit.save()
    unit.step(0.001)
    assert unit.try_step(0.002) == ERROR
    unit.restore(state)
    assert unit.try_step(0.001) == OK
    assert unit.get("yaw_moment") == [2.0]


def test_a_state_that_cannot_be_saved_is_an_error(failing):
    unit = failing(unsavable=True)
    unit.start()
    with refused(
        Refused,
        names=("fmi2GetFMUstate", "status 3", "0 s", "TypeError", "'_thread.lock'", "yaw_rate", "0.0"),
    ):
        unit.save()


@pytest.mark.parametrize("content", [b"", b"\0", b"rubbish", b"\x80\x04K\x01.", b"\x80\x04}."])
def test_bytes_that_are_no_state_are_refused(failing, content):
    unit = failing()
    unit.start()
    with refused(Refused, names=("fmi2DeSerializeFMUstate", "status 3")):
        unit.from_bytes(content)
    unit.step(0.0)


def test_a_hundred_failures_leave_the_process_alive(sample):
    fmu = sample("controllers/failing.py")
    for i in range(100):
        unit = Unit(fmu, where=["configure", "start", "advance", "output"][i % 4])
        with pytest.raises(Refused):
            unit.start()
            unit.step(0.001)
        unit.free()
    unit = Unit(fmu)
    unit.start()
    unit.step(0.0)
    assert unit.outputs() == [1.0]
    unit.free()


def test_after_a_fatal_error_nothing_is_released_twice(sample):
    fmu = sample("controllers/hostile.py")
    for _ in range(30):
        unit = Unit(fmu)
        unit.start()
        state = unit.save()
        assert unit.try_step(0.0) == FATAL
        assert unit.log[0][1] == "logStatusFatal"
        assert "RuntimeError('100 % hostile')" in unit.messages[0]
        assert unit.try_step(0.0) == FATAL
        assert unit.call("fmi2Reset") == FATAL
        unit.forget(state)
        unit.free()
    unit = Unit(fmu)
    unit.start()
    assert unit.outputs() == [1.0]
    unit.free()
