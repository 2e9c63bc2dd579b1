"""An FMU written in C, run by the master: data types, statuses and failures that PythonFMU never makes."""

import ctypes
import sys
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import fmpy
import pytest

from tests.refusals import each_mentions, mentions, refused
from yawbench.fmus.fmu import Fmu, Variable
from yawbench.foundation.errors import ModelDescriptionError, SimulationError
from yawbench.orchestrator.master.fmi import open_instance
from yawbench.orchestrator.master.isolation import Isolation
from yawbench.orchestrator.master.simulate import simulate
from yawbench.orchestrator.plan import Instance, Plan, Wire
from yawbench.orchestrator.results.reader import load_results
from yawbench.orchestrator.signal_names import SignalName

TYPES = ("Real", "Integer", "Boolean", "String")
DISCARD, ERROR, FATAL = 2, 3, 4
AT_THE_END = 100

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="compiles for Linux")


@pytest.fixture
def fmu(library, tmp_path):
    """The unpacked FMU, with a copy of the library for this test alone."""
    binaries = tmp_path / "fmu" / "binaries" / fmpy.platform
    binaries.mkdir(parents=True)
    (binaries / "foreign.so").write_bytes(library.read_bytes())
    (tmp_path / "fmu" / "resources").mkdir()
    variables = [variable("answer", 7, "Integer", "parameter")]
    for kind in TYPES:
        variables.append(variable(f"{kind}_in", 1000001, kind, "input"))
        variables.append(variable(f"{kind}_out", 4000000000, kind, "output", (f"{kind}_in",)))
    return Fmu(
        "foreign", tmp_path / "foreign.fmu", tmp_path / "fmu", "", "{good}", "foreign", "hand",
        {v.name: v for v in variables},
    )  # fmt: skip


def variable(name, reference, kind, causality, follows=None):
    return Variable(name, reference, kind, causality, "continuous" if kind == "Real" else "discrete",
                    None, None, None, None, "", follows)  # fmt: skip


CONSTANTS = {"Real_in": 0.75, "Integer_in": -21, "Boolean_in": True, "String_in": "größer"}


def chain(fmu, answer=0, algorithm="extrapolated"):
    """Two instances of an FMU, the first wired to the second."""
    instances = (
        Instance("a", fmu, 1, {"answer": 0}, dict(CONSTANTS)),
        Instance("b", fmu, 1, {"answer": answer}, {}),
    )
    wires = tuple(Wire("a", f"{kind}_out", "b", f"{kind}_in") for kind in TYPES)
    record = tuple(SignalName(instance, f"{kind}_out") for instance in "ab" for kind in TYPES)
    return Plan(instances, wires, record, Fraction(1, 20), 10, algorithm)


def counters(fmu):
    """Return how often the library was asked to instantiate, terminate and free."""
    library = ctypes.CDLL(str(fmu.directory / "binaries" / fmpy.platform / "foreign.so"))
    return list((ctypes.c_int * 3).in_dll(library, "counters"))


@pytest.fixture
def held(fmu):
    """Keeps the library in memory, so that its counters outlive the run."""
    return ctypes.CDLL(str(fmu.directory / "binaries" / fmpy.platform / "foreign.so"))


@pytest.mark.parametrize("algorithm", ["jacobi", "gauss_seidel", "extrapolated"])
def test_values_of_every_type_pass_through_a_foreign_fmu(fmu, held, algorithm, tmp_path):
    simulate(chain(fmu, algorithm=algorithm), tmp_path / "out")
    results = load_results(tmp_path / "out")
    last = {name: column[-1] for name, column in results.columns.items()}
    assert last == {
        "a.Real_out": 1.5, "a.Integer_out": -42, "a.Boolean_out": 0, "a.String_out": "<größer>",
        "b.Real_out": 3.0, "b.Integer_out": -84, "b.Boolean_out": 1, "b.String_out": "<<größer>>",
    }  # fmt: skip
    assert all(len(set(column.tolist())) == 1 for column in results.columns.values())
    assert counters(fmu) == [2, 2, 2]


@pytest.mark.parametrize(("answer", "ended"), [(DISCARD, [2, 2, 2]), (ERROR, [2, 1, 2]), (FATAL, [2, 0, 0])])
def test_a_failed_instance_is_ended_as_the_standard_allows(fmu, held, answer, ended, tmp_path):
    with pytest.raises(SimulationError) as caught:
        simulate(chain(fmu, answer), tmp_path / "out")
    assert caught.value.code == "fmu-call-failed"
    assert mentions(str(caught.value), "b:", "0.25 s", "3", "99.5%")
    assert counters(fmu) == ended
    results = load_results(tmp_path / "out")
    assert results.time[-1] == 0.25
    assert results.record.error.inputs == {
        "Real_in": 1.5, "Integer_in": -42, "Boolean_in": False, "String_in": "<größer>",
    }  # fmt: skip


@pytest.mark.parametrize("isolated", [False, True], ids=["together", "apart"])
@pytest.mark.parametrize("answer", [-1, 42])
def test_an_invalid_status_ends_the_run(fmu, answer, isolated, tmp_path):
    plan = chain(fmu, answer)
    with Isolation(plan.instances) as isolation, pytest.raises(SimulationError) as caught:
        simulate(plan, tmp_path / "out", opener=isolation if isolated else open_instance)
    assert caught.value.code == "fmu-call-failed"
    assert mentions(str(caught.value), "b:", "0.25 s")
    assert load_results(tmp_path / "out").time[-1] == 0.25


@pytest.mark.parametrize(
    ("answer", "word", "ended"), [(ERROR, "Error", [2, 2, 2]), (FATAL, "Fatal", [2, 1, 0])]
)
def test_an_instance_that_cannot_be_ended_is_reported(fmu, held, answer, word, ended, tmp_path):
    info = simulate(chain(fmu, AT_THE_END + answer), tmp_path / "out")
    assert each_mentions([(m.instance, m.text) for m in info.warnings], ("fmi2Terminate", word))
    assert counters(fmu) == ended  # after Fatal no function of any instance may be called
    assert load_results(tmp_path / "out").record.status == "completed"


def test_an_fmu_that_refuses_to_be_instantiated_says_why(fmu, held, tmp_path):
    plan = chain(fmu)
    refusing = replace(plan.instances[1], fmu=replace(fmu, guid="{refuse}"))
    with refused(SimulationError, "fmu-not-loadable", names=("b:", "foreign.fmu")):
        simulate(replace(plan, instances=(plan.instances[0], refusing)), tmp_path / "out")
    assert counters(fmu) == [1, 0, 1]


def test_an_fmu_for_other_platforms_only_is_refused(fmu, tmp_path):
    binaries = fmu.directory / "binaries"
    (binaries / fmpy.platform).rename(binaries / "win16")
    with refused(
        ModelDescriptionError, "fmu-not-loadable", names=("a:", "foreign.fmu", "binaries/linux64/foreign.so")
    ):
        simulate(chain(fmu), tmp_path / "out")


def test_a_file_other_than_a_library_is_refused(fmu, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (fmu.directory / "binaries" / fmpy.platform / "foreign.so").write_bytes(b"no library")
    with refused(ModelDescriptionError, "fmu-not-loadable", names=("a:", "foreign.fmu", "foreign.so")):
        simulate(chain(fmu), "out")
    assert Path.cwd() == tmp_path
    assert load_results("out").record.status == "failed"
