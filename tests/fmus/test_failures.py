"""Whatever a component or its host does wrong ends in a sentence and a status, never in a dead process."""

from __future__ import annotations

import ctypes
import inspect
import math

import pytest

from tests.fmus.bare import ERROR, FATAL, OK, Refused, Unit
from tests.fmus.samples.controllers.failing import Failing
from tests.refusals import each_mentions, mentions, refused


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


def test_the_traceback_is_logged_for_those_who_ask(failing):
    quiet, curious = failing(where="configure"), failing(where="configure", logging_on=True)
    choosy = failing(where="configure")
    chosen = (ctypes.c_char_p * 1)(b"traceback")
    choosy.do("fmi2SetDebugLogging", 1, ctypes.c_size_t(1), chosen)
    for unit in (quiet, curious, choosy):
        assert unit.call("fmi2EnterInitializationMode") == ERROR
        traceback = [] if unit is quiet else ["traceback"]
        assert [category for _, category, _ in unit.log] == ["logStatusError", *traceback]
    traceback = curious.messages[1]
    assert traceback.startswith("Traceback")
    assert mentions(traceback, "failing.py", "line 71", "configure")
    assert mentions(traceback.splitlines()[-1], "ValueError", "50 %")


@pytest.mark.parametrize(
    ("how", "what", "told_of_output"),
    [
        ("interrupt", ("KeyboardInterrupt",), False),
        ("exit", ("SystemExit: 3",), False),
        ("recursion", ("RecursionError",), False),
        ("surrogate", ("0", "half", "character"), False),
        ("unprintable", ("ValueError", "step"), False),
        ("none", ("TypeError", "returned", "output"), True),
        ("count", ("TypeError", "2 values", "1 outputs"), True),
        ("text", ("ValueError", "'far'"), True),
    ],
)
def test_any_other_failure_of_a_step_is_an_error_with_a_sentence(failing, how, what, told_of_output):
    unit = failing(where="output", how=how)
    unit.start()
    assert unit.try_step(0.0) == ERROR
    assert mentions(unit.messages[0], *what)
    assert unit.get("yaw_moment") == [0.0]  # the last good value
    if told_of_output:
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


@pytest.mark.parametrize("how", ["reset", "state"])
def test_a_reset_or_a_state_from_before_the_failure_makes_a_unit_work_again(failing, how):
    unit = failing(where="advance", when=0.0015)
    unit.start()
    unit.step(0.0)
    state = unit.save()
    unit.step(0.001)
    assert unit.try_step(0.002) == ERROR
    if how == "reset":
        unit.do("fmi2Reset")
        unit.start()
        unit.step(0.0)
    else:
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


def test_after_a_fatal_error_nothing_is_released_twice(sample):
    fmu = sample("controllers/hostile.py")
    for _ in range(10):
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


@pytest.mark.parametrize("logging_on", [True, False])
def test_log_text_is_safe_to_print_and_only_warnings_are_sent_unasked(sample, logging_on):
    unit = Unit(sample("controllers/talking.py"), logging_on=logging_on)
    unit.start()
    notes = ("0", "logAll", "42"), ("0", "logAll", "100"), ("0", "logAll")
    assert each_mentions(unit.log, *(notes if logging_on else ()), ("1", "logStatusWarning", "5 %", "grip"))
    unit.free()


def test_missing_arguments_are_refused(failing):
    unit = failing()
    one, value = ctypes.c_size_t(1), (ctypes.c_double * 1)(0.0)
    reference = (ctypes.c_uint * 1)(0)
    for kind in ("Real", "Integer", "Boolean", "String"):
        for access in ("Get", "Set"):
            assert unit.call(f"fmi2{access}{kind}", None, one, value) == ERROR
            assert unit.call(f"fmi2{access}{kind}", reference, one, None) == ERROR
            assert unit.call(f"fmi2{access}{kind}", None, ctypes.c_size_t(0), None) == OK
    assert unit.call("fmi2SetString", reference, one, (ctypes.c_char_p * 1)(None)) == ERROR
    assert unit.call("fmi2SetString", reference, one, (ctypes.c_char_p * 1)(b"\xff\xfe")) == ERROR
    unit.start()
    unit.step(0.0)
    assert unit.outputs() == [1.0]


def test_the_number_of_no_choice_is_told(load):
    unit = Unit(load("wheel_control_slip"), low_friction=99)
    assert unit.call("fmi2EnterInitializationMode") == ERROR
    assert "low_friction must be one of" in unit.messages[0]
    assert "(got 99)" in unit.messages[0]


def test_no_instance_is_refused(sample):
    library = sample("controllers/failing.py").library
    for call in ("fmi2EnterInitializationMode", "fmi2Reset", "fmi2Terminate", "fmi2CancelStep"):
        assert getattr(library, call)(None) == ERROR
    assert library.fmi2DoStep(None, ctypes.c_double(0.0), ctypes.c_double(0.1), 1) == ERROR
    assert library.fmi2GetReal(None, None, ctypes.c_size_t(0), None) == ERROR
    library.fmi2FreeInstance(None)
