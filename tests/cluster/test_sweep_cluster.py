"""Sweeps on a Dask cluster whose workers are processes of this machine."""

from __future__ import annotations

import contextlib
import logging
import os
import pickle
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.command_line import status_of
from tests.refusals import mentions
from tests.studies.test_sweep import UNITS, moods, rows, yawbench  # noqa: F401
from yawbench.studies.executor import left_to_do
from yawbench.studies.experiment import plan_experiment
from yawbench.studies.jobs import Job, Outcome
from yawbench.studies.load_experiment import load_experiment


@pytest.fixture(scope="module", autouse=True)
def cluster_module():
    """The module of clusters; imported late, as Dask takes a second of all who collect the tests."""
    pytest.importorskip("distributed")
    from yawbench.cluster import cluster

    return cluster


def _of_two(**options):
    """A scheduler and two workers."""
    import distributed

    return distributed.LocalCluster(n_workers=2, threads_per_worker=1, silence_logs=50, **options)


@pytest.fixture(scope="module")
def cluster():
    """Workers that are processes."""
    with _of_two(processes=True, dashboard_address=":0") as made:
        yield made


@pytest.fixture(scope="module")
def cluster_of_threads():
    """Workers in this process, which talk over the network all the same."""
    with _of_two(processes=False, protocol="tcp", host="127.0.0.1", dashboard_address=None) as made:
        yield made


@pytest.mark.parametrize("kind", ["threads", pytest.param("processes", marks=pytest.mark.exhaustive)])
def test_a_cluster_gives_the_table_of_this_machine_to_the_byte(kind, moods, yawbench, tmp_path, request):  # noqa: F811
    made = request.getfixturevalue("cluster_of_threads" if kind == "threads" else "cluster")
    file = moods(5, 20, 60, count=2)
    yawbench(file, "here", "--jobs", "2")
    status, _, err = yawbench(file, "there", "--scheduler", made.scheduler_address)
    assert status == 1, err  # level 20 fails
    assert ": 6 runs\n" in err
    here, there = ((tmp_path / folder / "table.parquet").read_bytes() for folder in ("here", "there"))
    assert here == there
    assert "all finished already" in yawbench(file, "there", "--scheduler", made.scheduler_address)[2]


def test_runs_travel_in_batches_as_long_as_workers_stay_busy_alike():
    from yawbench.cluster.cluster import AHEAD, BATCH_TIME, _Batches

    jobs = [Job(str(number), Path("made_up.yaml"), Path()) for number in range(1000)]
    batches = _Batches(jobs, threads=2)
    first = batches.next()
    assert first == jobs[:1]  # nothing is known yet
    batches.note([Outcome(first[0], seconds=BATCH_TIME / 50)])
    assert batches.next() == jobs[1:51]
    batches.note([Outcome(jobs[0], seconds=BATCH_TIME * 100)])
    assert len(batches.next()) == 1
    batches.divide(jobs[1:4])  # one of them has killed its worker: which?
    assert [batches.next() for _ in range(3)] == [[job] for job in jobs[1:4]]
    quick = _Batches(jobs, threads=2)
    quick.note([Outcome(first[0], seconds=BATCH_TIME / 1000)])
    sizes = []
    while batch := quick.next():
        sizes.append(len(batch))
    assert sum(sizes) == len(jobs)
    assert sizes[0] == len(jobs) // (AHEAD * 2)
    assert sizes[-1] == 1


def test_runs_in_a_batch_share_what_is_common(moods, fmus, cluster_module, tmp_path, monkeypatch):  # noqa: F811
    experiment = load_experiment(moods(*range(20), count=2))
    jobs = [*plan_experiment(experiment, tmp_path, fmus=fmus, keep=False).jobs]
    parcels = cluster_module._Parcels(jobs)
    monkeypatch.setattr(cluster_module, "_UNPACKED", parcels.fmus)
    one, every = parcels.pack(jobs[:1]), parcels.pack(jobs)
    assert cluster_module._unpack(every) == jobs
    whole = len(pickle.dumps(jobs[0]))
    assert len(one) < whole / 4
    assert (len(every) - len(one)) / (len(jobs) - 1) < whole / 40


def test_as_many_batches_are_submitted_as_keep_the_workers_busy(
    moods,  # noqa: F811
    fmus,
    cluster_of_threads,
    cluster_module,
    tmp_path,
    monkeypatch,
):
    from distributed import Client

    experiment = load_experiment(moods(1, 2, 3, 4, count=2))
    jobs, _ = left_to_do(plan_experiment(experiment, tmp_path, fmus=fmus, keep=False).jobs, {})
    submitted, finished, ahead = [], [], []
    submit = Client.submit

    def counting(client, make, parcel, **options):
        submitted.append(parcel)
        ahead.append(len(submitted) - len(finished))
        return submit(client, make, parcel, **options)

    monkeypatch.setattr(Client, "submit", counting)
    monkeypatch.setattr(cluster_module, "LARGEST_BATCH", 1)
    cluster_module.run_on_cluster(jobs, finished.append, scheduler=cluster_of_threads.scheduler_address)
    assert len(submitted) == len(finished) == len(jobs) == 8
    assert max(ahead) == 2 * cluster_module.AHEAD
    assert all(type(parcel) is bytes for parcel in submitted)


@pytest.mark.exhaustive
def test_a_run_that_kills_its_process_leaves_the_workers_alone(moods, yawbench, cluster, tmp_path):  # noqa: F811
    from distributed import Client

    client = Client(cluster)
    before = client.run(os.getpid)
    status, _, err = yawbench(moods(10, 30, 40), "out", "--scheduler", cluster.scheduler_address)
    assert status == 1, err
    assert [row["status"] for row in rows(tmp_path / "out")] == ["completed"] * 2 + ["failed"] * 2 + [
        "completed"
    ] * 2
    assert client.run(os.getpid) == before
    client.close()


@pytest.mark.skipif(sys.platform == "win32", reason="needs signals")
@pytest.mark.exhaustive
def test_a_worker_that_is_killed_costs_no_run(moods, fmus, cluster, cluster_module, tmp_path):  # noqa: F811
    from distributed import Client

    experiment = load_experiment(moods(1, 2, 3, 4, 5, 6))
    planned = plan_experiment(experiment, tmp_path, fmus=fmus, keep=False)
    told = []

    def done(outcome):
        if not told:
            client = Client(cluster, set_as_default=False)
            os.kill(min(client.run(os.getpid).values()), signal.SIGKILL)
            client.close()
        told.append(outcome)

    left, _ = left_to_do(planned.jobs, {})
    cluster_module.run_on_cluster(left, done, scheduler=cluster.scheduler_address)
    assert sorted(outcome.job.key for outcome in told) == sorted(job.key for job in left)
    assert all(outcome.ok for outcome in told)


@pytest.mark.exhaustive
def test_a_cluster_that_dies_is_one_sentence_and_keeps_what_is_finished(moods, fmus, capfd, tmp_path):  # noqa: F811
    from distributed import Client

    from yawbench.cluster.cluster import run_on_cluster
    from yawbench.foundation.errors import ResultsError

    experiment = load_experiment(moods(1, 2, 3, 4, 5, 6))
    planned = plan_experiment(experiment, tmp_path, fmus=fmus, keep=False)
    told, file = [], str(tmp_path / "scheduler.json")
    with _dask("scheduler", file, "--host", "127.0.0.1", "--port", "0") as scheduler, _dask("worker", file):
        with Client(scheduler_file=file, set_as_default=False) as client:
            client.wait_for_workers(1)
            address = client.scheduler.address

        def done(outcome):
            scheduler.kill()
            told.append(logging.getLogger("distributed.client").isEnabledFor(logging.ERROR))

        with pytest.raises(ResultsError, match="connection"):
            run_on_cluster(left_to_do(planned.jobs, {})[0], done, scheduler=address)
    assert 1 <= len(told) < len(planned.jobs)
    assert not any(told)  # Dask would log tracebacks
    assert "Traceback" not in capfd.readouterr().err


@contextlib.contextmanager
def _dask(what, file, *options):
    """A scheduler or a worker in a process of its own."""
    command = [
        sys.executable,
        "-m",
        f"distributed.cli.dask_{what}",
        "--scheduler-file",
        file,
        "--no-dashboard",
    ]
    with subprocess.Popen([*command, *options], stderr=subprocess.DEVNULL) as process:
        yield process
        process.kill()


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "nonsense"])
def test_a_scheduler_that_does_not_answer_is_one_sentence(address, moods, yawbench, tmp_path, monkeypatch):  # noqa: F811
    monkeypatch.setattr("yawbench.cluster.cluster.TIMEOUT", 0.5)
    status, _, err = yawbench(moods(10), "out", "--scheduler", address)
    assert status == 2
    assert mentions(err.splitlines()[-1], "--scheduler", "Dask", "0.5 s", f"--scheduler {address}")
    assert "Traceback" not in err


@pytest.mark.exhaustive
def test_a_scheduler_without_workers_is_one_sentence(moods, yawbench, tmp_path):  # noqa: F811
    from distributed import LocalCluster

    with LocalCluster(n_workers=0, dashboard_address=":0", silence_logs=50) as empty:
        status, _, err = yawbench(moods(10), "out", "--scheduler", empty.scheduler_address)
    assert status == 2
    assert mentions(err.splitlines()[-1], "scheduler", "workers")


def test_workers_of_another_version_are_refused(moods, yawbench, cluster_of_threads, monkeypatch):  # noqa: F811
    from distributed import Client

    from yawbench.cluster.cluster import versions

    there = {**versions(), "yawbench": "99.0"}
    monkeypatch.setattr(Client, "run", lambda client, function, **options: {"tcp://other": there})
    status, _, err = yawbench(moods(10), "out", "--scheduler", cluster_of_threads.scheduler_address)
    assert status == 2
    assert f"{versions()['yawbench']} here" in err.splitlines()[-1]
    assert "99.0 there" in err.splitlines()[-1]
    assert mentions(err.splitlines()[-1], "fit", "yawbench")


class _Restarting:
    """A client of a scheduler one of whose workers has just been killed."""

    def nthreads(self):
        return {"tcp://a": 1, "tcp://b": 1}

    def run(self, function, *, on_error):
        from distributed.comm import CommClosedError

        assert on_error == "return"
        return {"tcp://a": CommClosedError("in <TCP>"), "tcp://b": function()}


def test_a_worker_that_begins_anew_is_not_taken_for_one_without_this_program():
    from yawbench.cluster.cluster import _check_workers

    assert _check_workers(_Restarting(), "tcp://c") == 2


def test_without_its_package_the_option_says_how_to_get_it(moods, fmus, capsys, tmp_path, monkeypatch):  # noqa: F811
    monkeypatch.setitem(sys.modules, "distributed", None)
    monkeypatch.delitem(sys.modules, "yawbench.cluster.cluster", raising=False)
    arguments = ["--fmus", str(fmus), "--out", str(tmp_path / "out"), "--scheduler", "tcp://127.0.0.1:9"]
    assert status_of("sweep", moods(10), *arguments) == 2
    assert mentions(
        capsys.readouterr().err.splitlines()[-1], "--scheduler", "'yawbench[cluster]'", "distributed"
    )
