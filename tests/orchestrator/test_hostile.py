"""FMUs that do harm: a sample of `campaigns.hostile_fmus`, and what comes through the pipe of one."""

from __future__ import annotations

import os
import pickle
import random
import shutil
import signal
import subprocess
import sys

import numpy as np
import pytest

from campaigns.hostile_fmus import VALUES_OF, Case, attack, make_files
from tests.refusals import mentions
from yawbench.foundation import supervised_process
from yawbench.foundation.fork_server import Child
from yawbench.foundation.supervised_process import FAILED, LOG, REPLY, PipeChannel, ProcessLost, ProtocolError
from yawbench.orchestrator.master import isolation
from yawbench.orchestrator.master.isolation import InstanceProcess
from yawbench.orchestrator.master.process_state import Log
from yawbench.orchestrator.results.reader import load_results

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="compiles for Linux"),
    pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler"),
]
TOGETHER = (
    "load:exit", "enter:segfault", "step:exit", "step:_exit", "step:kill", "step:execute", "step:hang",
    "step:deaf", "step:leave_thread", "step:fork", "step:garbage", "step:close", "step:rounding",
    "leave:trap", "enter:flush", "load:folder", "step:signals", "set:flood", "terminate:segfault",
    "free:_exit", "free:thread", "free:log_after", "value:nan", "value:huge_text",
)  # fmt: skip
OF_EACH_KIND = (
    "step:_exit",
    "step:garbage",
    "step:close",
    "step:rounding",
    "step:escape",
    "free:thread",
    "value:nan",
)
"""A few of them, for the first tier; one that does not come back is in test_run.py, copies are below."""
APART = (
    "load:exit", "enter:segfault", "step:_exit", "step:hang", "step:daemon", "step:child_crash", "step:fork",
    "step:garbage", "step:zeros", "step:endless", "step:pickle", "step:close", "get:stop", "set:flood",
    "terminate:kill", "free:hang", "value:nan", "value:huge_text", "step:status_minus", "leave:long",
)  # fmt: skip


@pytest.mark.parametrize(
    ("isolated", "harm"),
    [
        pytest.param(False, OF_EACH_KIND, id="some"),
        pytest.param(False, TOGETHER, id="together", marks=pytest.mark.exhaustive),
        pytest.param(True, APART, id="apart", marks=pytest.mark.exhaustive),
    ],
)
def test_a_unit_that_does_harm_ends_its_run_with_a_sentence_and_the_results_so_far(isolated, harm, tmp_path):
    cases = [Case(does, isolated) for does in harm]
    assert attack(cases, tmp_path) == {case: [] for case in cases}


class _Pretender(Child):
    """In place of a unit's process: has written `said` into the pipe, and waits or is gone."""

    said = b""
    stays = False

    def __init__(self, module, reading, writing, memory, preload):
        super().__init__(0)
        self.descriptor = os.dup(writing)
        os.write(self.descriptor, self.said)
        self.gone = False
        if not self.stays:
            self.kill()

    def ended(self, within=0.0):
        return self.gone

    def _collect(self):
        self.kill()
        return 0

    def kill(self, number=signal.SIGKILL, *, group=False):
        if not self.gone:
            os.close(self.descriptor)
            self.gone = True


@pytest.fixture
def pretend(monkeypatch):
    """Ask a process that has said something else; return the sentence on how it was lost."""
    monkeypatch.setattr(isolation, "start", _Pretender)

    def ask(said, *, stays=False, ask="ready"):
        monkeypatch.setattr(_Pretender, "said", said)
        monkeypatch.setattr(_Pretender, "stays", stays)
        monkeypatch.setattr(supervised_process, "LOOK_EVERY", 1)
        unit = InstanceProcess(3, limit=0.01)
        unit.log = Log()
        with pytest.raises(ProcessLost) as lost:
            unit.answer(0.01, REPLY)
        return lost.value.in_("fmi2DoStep")

    return ask


class _Malicious:
    def __reduce__(self):
        return os._exit, (3,)


@pytest.mark.parametrize(
    "said",
    [
        bytes([REPLY]) + b"\xff\xff\xff\x7f{",
        bytes([REPLY]) + (26).to_bytes(4, "little") + b"\x80\x04garbage that is no record",
        bytes([REPLY]) + (2_000_000).to_bytes(4, "little") + b"[" * 60_000,
        bytes([REPLY]) + (3).to_bytes(4, "little") + b"\xff\xfe\xfd",
        bytes([FAILED]) + b"\x05\x00",
        bytes([LOG]) + b"\x02\x00\x00\x00{}" + b"\x00",
        b"\x00",
        b"hello",
        b"",
    ],
)
@pytest.mark.parametrize("stays", [True, False])
def test_what_comes_through_the_pipe_and_is_no_answer_is_a_sentence(said, stays, pretend):
    sentence = pretend(said, stays=stays)
    assert any(
        words in sentence
        for words in (
            "wrote into the pipe",
            "did not respond",
            "did not return",
            "exit status 0",
            "pipe to the",
        )
    )


def test_nothing_that_comes_from_a_unit_is_unpickled(pretend):
    data = pickle.dumps(_Malicious())
    for kind in (REPLY, LOG, FAILED):
        assert mentions(pretend(bytes([kind]) + len(data).to_bytes(4, "little") + data), "wrote", "pipe")


def test_random_bytes_in_the_pipe_never_pass_for_an_answer(pretend):
    chance = random.Random(7)
    for _ in range(300):
        kind = chance.choice([REPLY, LOG, FAILED, chance.randrange(256)])
        length = chance.choice([chance.randrange(1 << 32), chance.randrange(40)])
        said = bytes([kind]) + length.to_bytes(4, "little") + chance.randbytes(chance.randrange(40))
        assert pretend(said[: chance.randrange(1, 50)])


def test_a_record_that_is_too_long_or_cannot_be_written_is_refused():
    reading, writing = os.pipe()
    channel = PipeChannel(reading, writing)
    for content in ("x" * (1 << 26), {1, 2}):
        with pytest.raises(ProtocolError):
            channel.send(REPLY, content)
    channel.close()


@pytest.mark.parametrize(
    "does", ["step:fork", pytest.param("instantiate:fork", marks=pytest.mark.exhaustive)]
)
def test_a_unit_that_copies_the_process_of_its_run_ends_it_before_there_are_many(does, tmp_path):
    scenario = make_files(tmp_path)
    command = ["run", str(scenario), "--out", "out", "--set", "stop_time=0.3"]
    done = subprocess.run(
        [sys.executable, "-m", "yawbench", *command],
        cwd=tmp_path, env=os.environ | {"HOSTILE": does}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 1
    assert mentions(done.stderr, "good", "bad", "process")
    assert "Traceback" not in done.stderr
    results = load_results(tmp_path / "out")
    assert results.record.status == "failed"
    assert np.array_equal(results["good.y"], np.full(len(results.time), VALUES_OF["good.y"]))
