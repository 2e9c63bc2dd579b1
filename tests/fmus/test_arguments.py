"""Calls of a host to an FMU: arguments, log, states."""

from __future__ import annotations

import ctypes

from tests.fmus.bare import ERROR, OK, Unit
from tests.refusals import each_mentions


def test_log_text_is_safe_to_print_and_warnings_are_no_errors(sample):
    unit = Unit(sample("controllers/talking.py"), logging_on=True)
    unit.start()
    assert each_mentions(
        unit.log,
        ("0", "logAll", "42"),
        ("0", "logAll", "100"),
        ("0", "logAll"),
        ("1", "logStatusWarning", "5 %", "grip"),
    )
    unit.free()


def test_without_debug_logging_only_warnings_and_errors_are_sent(sample):
    unit = Unit(sample("controllers/talking.py"))
    unit.start()
    assert each_mentions(unit.messages, ("5 %", "grip"))
    unit.free()


def test_log_categories_can_be_chosen(sample):
    unit = Unit(sample("controllers/failing.py"), where="configure")
    chosen = (ctypes.c_char_p * 1)(b"traceback")
    unit.do("fmi2SetDebugLogging", 1, ctypes.c_size_t(1), chosen)
    assert unit.call("fmi2EnterInitializationMode") == ERROR
    assert [category for _, category, _ in unit.log] == ["logStatusError", "traceback"]
    unit.free()


def test_missing_arguments_are_refused(sample):
    unit = Unit(sample("controllers/failing.py"))
    one, value = ctypes.c_size_t(1), (ctypes.c_double * 1)(0.0)
    reference = (ctypes.c_uint * 1)(0)
    for kind in ("Real", "Integer", "Boolean", "String"):
        for access in ("Get", "Set"):
            assert unit.call(f"fmi2{access}{kind}", None, one, value) == ERROR
            assert unit.call(f"fmi2{access}{kind}", reference, one, None) == ERROR
            assert unit.call(f"fmi2{access}{kind}", None, ctypes.c_size_t(0), None) == OK
    assert unit.call("fmi2SetString", reference, one, (ctypes.c_char_p * 1)(None)) == ERROR
    assert unit.call("fmi2SetString", reference, one, (ctypes.c_char_p * 1)(b"\xff\xfe")) == ERROR
    for call in ("fmi2GetFMUstate", "fmi2SetFMUstate"):
        assert unit.call(call, None) == ERROR
    assert unit.call("fmi2FreeFMUstate", None) == OK
    assert unit.call("fmi2SerializedFMUstateSize", None, None) == ERROR
    assert unit.call("fmi2SerializeFMUstate", None, None, one) == ERROR
    assert unit.call("fmi2DeSerializeFMUstate", None, one, None) == ERROR
    assert unit.call("fmi2SetDebugLogging", 1, one, None) == ERROR
    assert unit.call("fmi2GetRealStatus", 2, None) == ERROR
    unit.start()
    unit.step(0.0)
    assert unit.outputs() == [1.0]
    unit.free()


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
