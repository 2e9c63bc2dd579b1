"""A wrong GUID, calls out of order, steps from a wrong time: refused by every FMU, native and in Python."""

from __future__ import annotations

import ctypes
import math
import random
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.fmus.bare import ERROR, OK, Fmu, Refused, Unit
from tests.fmus.plausible import plausible
from tests.fmus.programs import begun
from tests.refusals import each_mentions, mentions
from yawbench.fmus.build import build_component, find_components

IN_C = "a unit in C"
H = 0.002
LAST_SUCCESSFUL_TIME = 2

pytestmark = [
    pytest.mark.parametrize("runs_as", ["native", "python"]),
    pytest.mark.parametrize("name", [IN_C, *find_components()]),
    pytest.mark.sampled(7),
]


@pytest.fixture(scope="module")
def fmu_of(archive, unpack, tmp_path_factory) -> Callable[[str, str], Fmu]:
    """Return the FMU of a name, from a copy of its own for each way to run."""
    loaded: dict[tuple[str, str], Fmu] = {}

    def find(name: str, runs_as: str) -> Fmu:
        if name == IN_C and runs_as == "python":
            pytest.skip("it has no Python")
        if (name, runs_as) not in loaded:
            copy = tmp_path_factory.mktemp(runs_as) / "fmu"
            shutil.copytree(unpack(in_c(copy.parent) if name == IN_C else archive(name)), copy)
            loaded[name, runs_as] = fmu = Fmu(copy)
            with pytest.MonkeyPatch.context() as patch:
                patch.setenv("YAWBENCH_UNITS", runs_as)
                Unit(fmu).free()  # the launcher decides at the first instance
        return loaded[name, runs_as]

    return find


def in_c(folder: Path) -> Path:
    return build_component(begun(folder), folder / "out")


@pytest.fixture
def unit(fmu_of, name, runs_as):
    """An instance with plausible inputs, freed in the end."""
    fmu = fmu_of(name, runs_as)
    made = Unit(fmu, **plausible(fmu.names("input"), random.Random(fmu.name)))
    yield made
    made.free()


def set_up(unit: Unit, start: float, stop: float | None = None) -> int:
    times = ctypes.c_double(start), int(stop is not None), ctypes.c_double(stop or 0.0)
    return unit.call("fmi2SetupExperiment", 0, ctypes.c_double(0.0), *times)


def started(unit: Unit, start: float = 0.0, stop: float | None = None) -> None:
    assert set_up(unit, start, stop) == OK
    unit.do("fmi2EnterInitializationMode")
    unit.do("fmi2ExitInitializationMode")


def reached(unit: Unit) -> float:
    time = ctypes.c_double(math.nan)
    unit.do("fmi2GetRealStatus", LAST_SUCCESSFUL_TIME, ctypes.byref(time))
    return time.value


def refusal(unit: Unit, call: str, *arguments: object) -> str:
    """Make a call that must be refused with one sentence, and return that."""
    before = len(unit.log)
    assert unit.call(call, *arguments) == ERROR
    ((status, category, text),) = unit.log[before:]
    assert (status, category) == (ERROR, "logStatusError")
    return text


def step_refused(unit: Unit, t: float, h: float = H) -> str:
    return refusal(unit, "fmi2DoStep", ctypes.c_double(t), ctypes.c_double(h), 1)


def test_another_guid_is_refused_with_a_sentence(fmu_of, name, runs_as):
    fmu = fmu_of(name, runs_as)
    right = fmu.guid
    try:
        for fmu.guid in ("", "{00000000-0000-0000-0000-000000000000}", right[:-1], right + " "):
            with pytest.raises(Refused) as caught:
                Unit(fmu)
            assert mentions(caught.value, "fmi2Instantiate", "status 3", "GUID")
    finally:
        fmu.guid = right
    Unit(fmu).free()


def test_calls_out_of_order_are_refused_and_change_nothing(unit):
    zero = ctypes.c_double(0.0)
    step, set_up = (
        ("fmi2DoStep", zero, ctypes.c_double(H), 1),
        ("fmi2SetupExperiment", 0, zero, zero, 0, zero),
    )
    enter, leave, end = (
        f"fmi2{call}" for call in ("EnterInitializationMode", "ExitInitializationMode", "Terminate")
    )
    initialization = "initialization"
    for passed, refused in (
        ((), [(step, initialization), ((leave,), initialization)]),
        ((enter,), [(step, initialization), ((enter,), initialization), (set_up, initialization)]),
        ((leave,), [(set_up, initialization)]),
        (step, []),
        ((end,), [(step, "terminated"), ((end,), "")]),
    ):
        if passed:
            unit.do(*passed)
        for call, named in refused:
            assert mentions(refusal(unit, *call), call[0], named)
    unit.outputs()
    unit.do("fmi2Reset")
    started(unit)
    unit.step(0.0, H)


def test_a_step_that_is_not_positive_or_longer_than_a_day_is_refused(unit):
    started(unit)
    unit.step(0.0, H)
    before = unit.outputs()
    for h in (0.0, -H, math.nan, math.inf, -math.inf, 1e300):
        assert mentions(step_refused(unit, H, h), "fmi2DoStep", "86400 s", f"{h:g} s")
        assert (reached(unit), unit.outputs()) == (H, before)
    unit.step(H, H)


def test_a_step_from_another_time_than_the_one_reached_is_refused(unit):
    started(unit, 0.5)
    for t in (0.0, 0.5 - H, 0.5 + H, math.nan, math.inf):
        assert mentions(step_refused(unit, t), "fmi2DoStep", f"{t:g} s", "0.5 s")
    unit.step(0.5, H)
    assert mentions(step_refused(unit, 0.5), "fmi2DoStep", "0.5 s", "0.502 s")
    unit.step(0.5 + H, H)


def test_the_time_reached_is_that_of_the_last_step_that_succeeded(unit):
    assert set_up(unit, 0.25) == OK
    assert reached(unit) == 0.25
    started(unit, 0.25)
    unit.step(0.25, H)
    step_refused(unit, 0.25)
    assert reached(unit) == 0.25 + H
    with pytest.raises(Refused):
        unit.do("fmi2GetRealStatus", 0, ctypes.byref(ctypes.c_double()))
    unit.do("fmi2Reset")
    assert reached(unit) == 0.0


def test_no_step_leads_beyond_the_stop_time(unit):
    started(unit, 0.0, 3 * H)
    for k in range(3):
        unit.step(k * H, H)
    assert mentions(step_refused(unit, 3 * H), "fmi2DoStep", "0.008 s", "0.006 s")
    assert reached(unit) == 3 * H


def test_the_time_reached_is_saved_and_restored_with_the_state(unit):
    started(unit, 0.0, 5 * H)
    unit.step(0.0, H)
    saved = unit.save()
    content = unit.to_bytes(saved)
    unit.step(H, H)
    unit.step(2 * H, H)
    for state in (saved, unit.from_bytes(content)):
        unit.restore(state)
        assert reached(unit) == H
        step_refused(unit, 2 * H)
        unit.step(H, H)
    unit.do("fmi2Reset")
    unit.restore(saved)
    unit.step(H, H)
    assert mentions(step_refused(unit, 2 * H, 4 * H), "fmi2DoStep", "0.012 s", "0.01 s")


UNSUPPORTED = {
    "fmi2GetDirectionalDerivative": (None, ctypes.c_size_t(0), None, ctypes.c_size_t(0), None, None),
    "fmi2SetRealInputDerivatives": (None, ctypes.c_size_t(0), None, None),
    "fmi2GetRealOutputDerivatives": (None, ctypes.c_size_t(0), None, None),
    "fmi2CancelStep": (),
    "fmi2GetStatus": (0, None),
    "fmi2GetIntegerStatus": (0, None),
    "fmi2GetBooleanStatus": (3, None),
    "fmi2GetStringStatus": (1, None),
}


def test_functions_that_are_not_supported_are_answered_alike_and_change_nothing(unit):
    for name, arguments in UNSUPPORTED.items():
        assert mentions(refusal(unit, name, *arguments), name, "supported")
    # still, as no call so far counts as a failure of the instance
    assert mentions(step_refused(unit, 0.0), "fmi2DoStep", "initialization")
    started(unit)
    refusal(unit, "fmi2CancelStep")
    said = step_refused(unit, 0.5)
    assert said.startswith("fmi2DoStep at t = 0.5 s")
    unit.step(0.0, H)


def test_a_start_time_that_is_not_finite_or_far_from_zero_is_refused(unit):
    for t in (math.nan, math.inf, -math.inf, 1e300):
        times = ctypes.c_double(0), ctypes.c_double(t), 0, ctypes.c_double(0.0)
        said = refusal(unit, "fmi2SetupExperiment", 0, *times)
        assert mentions(said, "fmi2SetupExperiment", "1e+12 s", "0", f"{t:g} s")
    started(unit)


def test_a_saved_failure_is_restored_as_one(unit, name):
    if name == IN_C:
        pytest.skip("components in C do not fail")
    started(unit)
    unit.step(0.0, H)
    sound = unit.save()
    assert unit.call("fmi2GetReal", (ctypes.c_uint * 1)(10**6), ctypes.c_size_t(1), (ctypes.c_double * 1)())
    assert unit.try_step(H, H) == ERROR
    broken = unit.save()
    for state in (broken, unit.from_bytes(unit.to_bytes(broken))):
        unit.restore(sound)
        unit.step(H, H)
        unit.restore(state)
        assert unit.try_step(H, H) == ERROR
    unit.restore(sound)
    unit.step(H, H)


def test_only_whole_states_of_the_same_fmu_are_deserialized(unit, fmu_of, name, runs_as):
    started(unit)
    content = unit.to_bytes(unit.save())
    other = Unit(fmu_of("driver_sine" if name != "driver_sine" else "driver_ramp", runs_as))
    foreign = other.to_bytes(other.save())
    other.free()
    middle = len(content) // 2
    flipped = content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :]
    said = set()
    for wrong in (b"", content[:-1], content + b"x", content[8:], flipped, foreign, bytes(len(content))):
        place, size = ctypes.c_void_p(), ctypes.c_size_t(len(wrong))
        said.add(refusal(unit, "fmi2DeSerializeFMUstate", wrong, size, ctypes.byref(place)))
        assert not place
    assert each_mentions(said, ("fmi2DeSerializeFMUstate", "state"))
    unit.restore(unit.from_bytes(content))
    unit.step(0.0, H)


def test_pointers_that_are_null_are_refused_with_a_sentence(unit):
    refs, n = (ctypes.c_uint * 1)(0), ctypes.c_size_t(1)
    real, byte, place = (ctypes.c_double * 1)(), (ctypes.c_char * 1)(), ctypes.byref(ctypes.c_void_p())
    state = unit.save()
    calls = [
        (("fmi2GetReal", None, n, real), ("references", "values")),
        (("fmi2GetReal", refs, n, None), ("references", "values")),
        (("fmi2SetReal", None, n, real), ("references", "values")),
        (("fmi2SetReal", refs, n, None), ("references", "values")),
        (("fmi2GetFMUstate", None), ("place", "state")),
        (("fmi2SetFMUstate", None), ("state",)),
        (("fmi2SerializedFMUstateSize", state, None), ("state", "place")),
        (("fmi2SerializedFMUstateSize", None, ctypes.byref(ctypes.c_size_t())), ("state", "place")),
        (("fmi2SerializeFMUstate", state, None, n), ("place", "bytes")),
        (("fmi2SerializeFMUstate", None, byte, n), ("state", "place")),
        (("fmi2SerializeFMUstate", state, byte, n), ("place", "bytes")),
        (("fmi2DeSerializeFMUstate", None, n, place), ("bytes", "place")),
        (("fmi2DeSerializeFMUstate", byte, n, None), ("bytes", "place")),
        (("fmi2GetRealStatus", LAST_SUCCESSFUL_TIME, None), ("place", "value")),
        (("fmi2SetDebugLogging", 1, n, None), ("categories",)),
    ]
    for call, names in calls:
        said = refusal(unit, *call)
        assert said.startswith(call[0][:13])  # without a state, it is the size that is asked for first
        assert mentions(said, *names)
    assert unit.call("fmi2FreeFMUstate", None) == OK
    unit.forget(state)
    started(unit)
    unit.step(0.0, H)


def test_times_that_hosts_round_are_taken(unit):
    third, n = 0.001 / 3, 400
    for points in (
        lambda k: sum([third] * k, 7.0),
        lambda k: 7.0 + k * third,
        lambda k: round((7.0 + k * third) * 1e9) * 1e-9,  # whole nanoseconds
        lambda k: ctypes.c_float(7.0 + k * third).value,
    ):
        started(unit, 7.0, points(n))
        for k in range(n):
            unit.step(points(k), third)
        unit.do("fmi2Reset")
