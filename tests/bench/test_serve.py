"""`yawbench serve`: what it serves, to whom, and the bench."""

from __future__ import annotations

import http.client
import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.orchestrator.recorded import noted, write
from tests.refusals import each_mentions, refused
from tests.reports.browser import Browser
from tests.reports.flaws import inaccessible
from tests.reports.made_up import data_in, whole_car
from tests.reports.test_viewer import labelled
from yawbench.bench.server import ResultsServer
from yawbench.bench.sliders import Bench, Superseded, Wanted, knobs_of, shown_first
from yawbench.orchestrator.scenario import catalogue
from yawbench.orchestrator.scenario.catalogue import find
from yawbench.orchestrator.scenario.overrides import read_changes
from yawbench.orchestrator.scenario.quantities import convert
from yawbench.planner import Planner
from yawbench.reports.viewer import page
from yawbench.studies.jobs import Job, planned
from yawbench.vocabulary.vehicle import CAR

SCENARIO = "fnn_sideslip/25mps"
BRIEF = "stop_time=0.5"


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Results of two runs with a page, and links that lead out of the folder."""
    outside = tmp_path_factory.mktemp("outside")
    (outside / "secret.txt").write_text("secret")
    write(whole_car(), outside / "run")
    place = tmp_path_factory.mktemp("results")
    for name, gain in (("one", 1.0), ("two", 2.0)):
        run, peaks = whole_car(gain), {}
        for end, of in (("smallest", np.min), ("largest", np.max)):
            peaks[end] = {"plant.sideslip": float(of(run["plant.sideslip"]))}
        title = f"friction = {0.3 if gain == 1.0 else 0.35}"
        write(noted(run, units=run.units, title=title, **peaks), place / "runs" / name)
    (place / "runs/both.html").write_text(page(labelled(whole_car(), whole_car(2.0))), "utf-8")
    (place / "link.html").symlink_to(outside / "secret.txt")
    (place / "out").symlink_to(outside, target_is_directory=True)
    write(whole_car(), place / "linked")
    (place / "linked/results.csv").unlink()
    (place / "linked/results.csv").symlink_to(outside / "run/results.csv")
    os.mkfifo(place / "pipe.csv")
    return place


@pytest.fixture(scope="module")
def planner() -> Planner:
    return Planner()


@contextmanager
def serving(folder: Path) -> Iterator[ResultsServer]:
    """Serve the results below a folder."""
    bench = Bench()
    with ResultsServer(folder, bench) as made:
        thread = threading.Thread(target=made.serve_forever)
        thread.start()
        yield made
        made.shutdown()
        thread.join()
    bench.close()


@pytest.fixture(scope="module")
def server(folder) -> Iterator[ResultsServer]:
    with serving(folder) as made:
        yield made


def ask(server, path, *, method="GET", body=None, token=None, **headers) -> tuple[int, dict[str, str], bytes]:
    """Return status, headers and content of the answer to a request; None leaves a header out."""
    host = f"127.0.0.1:{server.server_port}"
    connection = http.client.HTTPConnection(host, timeout=60)
    address = path if token == "" else f"/{token or server.token}/{path}"
    connection.putrequest(method, address, skip_host=True)
    for name, value in {"Host": host, **headers}.items():
        if value is not None:
            connection.putheader(name, value)
    content = None if body is None else json.dumps(body).encode()
    if content is not None:
        connection.putheader("Content-Length", str(len(content)))
    connection.endheaders(content)
    answer = connection.getresponse()
    found = answer.status, dict(answer.getheaders()), answer.read()
    connection.close()
    return found


def raw(server, text: str) -> str:
    """Return the answer to a request as it is sent."""
    with socket.create_connection(("127.0.0.1", server.server_port), timeout=30) as connection:
        connection.sendall(text.encode())
        connection.shutdown(socket.SHUT_WR)
        return b"".join(iter(lambda: connection.recv(65536), b"")).decode()


def own(server) -> str:
    return f"http://127.0.0.1:{server.server_port}"


def request_of(*settings: str, **changes) -> dict:
    return {
        "page": "p", "label": "now", "scenario": SCENARIO, "settings": [BRIEF, *settings], "swaps": [],
        "faults": [], "earlier": [], **changes,
    }  # fmt: skip


def run(server, *settings: str, **changes) -> tuple[int, bytes]:
    status, _, content = ask(
        server, "run", method="POST", body=request_of(*settings, **changes), Origin=own(server)
    )
    return status, content


# ---- to whom ----


def test_servers_listen_on_this_machine_alone_and_have_different_tokens(server, folder):
    with ResultsServer(folder, server.bench) as other:
        assert other.token != server.token and len(other.token) >= 32
        assert other.server_address[0] == "127.0.0.1"


@pytest.mark.parametrize("address", ["/", "/files/runs/both.html", "/x/", "//", "/TOKEN"])
def test_without_the_token_everything_is_refused(server, address):
    assert ask(server, address.replace("TOKEN", server.token[:-1]), token="")[0] == 403


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1", "evil.example:PORT", "", None])
def test_another_host_is_refused(server, host):
    host = host and host.replace("PORT", str(server.server_port))
    assert ask(server, "", Host=host)[0] == 403
    assert ask(server, "", Host=f"localhost:{server.server_port}")[0] == 200


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", "http://127.0.0.1", "https://127.0.0.1:PORT"]
)
def test_another_origin_is_refused(server, origin):
    origin = origin.replace("PORT", str(server.server_port))
    assert ask(server, "", Origin=origin)[0] == 403
    assert ask(server, "run", method="POST", body=request_of(), Origin=origin)[0] == 403


def test_a_run_is_refused_without_origin_or_by_get(server):
    assert ask(server, "run", method="POST", body=request_of())[0] == 403
    assert ask(server, "run")[0] == 404


# ---- below the folder ----


@pytest.mark.parametrize(
    "path",
    [
        "../outside0/secret.txt", "%2e%2e/outside0/secret.txt", "/etc/passwd", "%2Fetc/passwd",
        "runs//one/run.json", "./runs/both.html", "runs/../link.html", "runs%5C..%5Clink.html",
        "runs/both.html%00", "", "runs",
        "link.html", "out/secret.txt", "linked/results.csv", "pipe.csv",
    ],
)  # fmt: skip
def test_no_path_leaves_the_folder_and_no_link_or_pipe_is_opened(server, path):
    assert ask(server, f"files/{path}")[0] == 404


@pytest.mark.parametrize("path", ["out/run", "linked", "../outside0/run", "runs", "", "nowhere"])
def test_runs_outside_the_folder_are_not_viewed(server, path):
    status, _, content = ask(server, f"view?run={path}")
    assert status == 422 and b"<html" not in content


# ---- what ----


def test_the_first_page_lists_pages_and_runs_that_are_no_links(server):
    status, _, content = ask(server, "")
    text = content.decode()
    assert status == 200
    assert re.findall(r'href="files/([^"]+)"', text) == ["runs/both.html"]
    assert sorted(re.findall(r'name="run" value="([^"]+)"', text)) == ["runs/one", "runs/two"]
    assert "1 page, 2 runs" in text
    assert f"<option>{SCENARIO}</option>" in text


def test_runs_are_found_by_what_was_changed_sorted_and_folded(server, chromium: Browser):
    chromium.driver.get(server.address)
    chromium.wait_for("document.querySelector('.found').textContent")
    names = (
        "return [...document.querySelectorAll('.results tbody tr:not(.group)')].filter((row) => !row.hidden)"
        ".map((row) => row.querySelector('input').value)"
    )
    press = "document.querySelectorAll('.results thead button')[2].click()"
    chromium.run(press)  # peak sideslip
    assert chromium.run(names) == ["runs/one", "runs/two"]
    chromium.run(press)
    assert chromium.run(names) == ["runs/two", "runs/one"]
    for text, found in (
        ("RUNS/two", ["two"]),
        ("friction=0.3", ["one"]),
        ("friction = 0.35", ["two"]),
        ("0.", ["two", "one"]),
    ):
        chromium.run(
            "const field = document.querySelector('.filter'); field.value = arguments[0];"
            "field.dispatchEvent(new Event('input'))",
            text,
        )
        assert chromium.run(names) == [f"runs/{name}" for name in found]
        assert chromium.run("return document.querySelector('.found').textContent") == f"{len(found)} of 2"
    assert chromium.console() == []


@pytest.mark.parametrize("path", ["runs/both.html", "runs/one/results.csv"])
def test_files_are_served_as_they_are_and_sandboxed(server, folder, path):
    status, headers, content = ask(server, f"files/{path}")
    assert status == 200 and content == (folder / path).read_bytes()
    policy = headers["Content-Security-Policy"]
    assert policy.startswith("sandbox") and "allow-same-origin" not in policy
    assert headers["Referrer-Policy"] == "no-referrer"


def test_runs_are_viewed_together(server):
    status, headers, content = ask(server, "view?run=runs/one&run=runs/two")
    assert status == 200 and "sandbox" not in headers["Content-Security-Policy"]
    assert content.count(b'<script type="text/plain"') == 2


# ---- the bench ----


def kept_ahead(bench: Bench) -> str:
    """Return the key of the run that is made before its page asks for it, when it is kept."""
    while not (bench._key_ahead and bench._key_ahead in bench._kept):
        time.sleep(0.01)
    return bench._key_ahead


def test_the_first_run_of_a_page_is_made_before_the_page_asks_for_it():
    bench = Bench()
    bench.page(SCENARIO, [SCENARIO])
    made = bench._kept[kept_ahead(bench)]
    key, _ = bench.run(Wanted("p", "", SCENARIO))
    bench.close()
    assert bench._kept[key] is made


def test_a_run_ahead_makes_way_for_another_that_is_asked_for():
    bench = Bench()
    long = Job("long", find(SCENARIO, "a scenario"), Path(), read_changes((), ("stop_time=2000",), ()))
    with ThreadPoolExecutor() as threads:
        ahead = threads.submit(bench._make_ahead, replace(long, plan=planned(long)[1]))
        while not (bench._turn.locked() or ahead.done()):
            time.sleep(0.01)
        key, _ = bench.run(Wanted("p", "", SCENARIO, (BRIEF,)))
        bench.close()
    assert list(bench._kept) == [key]


def test_a_run_has_the_samples_that_the_command_records(server):
    import yawbench as yb

    status, content = run(server, "vehicle.mass=1300")
    answer = json.loads(content)
    assert status == 200
    assert answer["command"] == f"yawbench run {SCENARIO} --set {BRIEF} --set vehicle.mass=1300"
    results = server.bench._kept[answer["key"]][0]
    same = yb.load(SCENARIO).set({"stop_time": 0.5, "vehicle.mass": 1300}).run().results
    for name in same.columns:
        np.testing.assert_array_equal(results.columns[name], same.columns[name])
    assert ask(server, f"block/{answer['key']}")[2] == server.bench.block(answer["key"])
    assert f'data-address="block/{answer["key"]}"' in answer["html"]


def test_a_run_is_made_once_and_ghosts_come_with_it(server):
    first = json.loads(run(server)[1])["key"]
    made = server.bench._kept[first]
    second = json.loads(run(server, "friction=0.5", earlier=[[first, "before"], ["nothing", "lost"]])[1])
    assert json.loads(run(server)[1])["key"] == first and server.bench._kept[first] is made
    data = data_in(second["html"])
    assert [(one["label"], one["ghost"]) for one in data["runs"]] == [("now", False), ("before", True)]


def test_mistakes_are_one_sentence(server):
    for changes, names in (
        ({"settings": ["plant.weight=3"]}, ("--set plant.weight=3", "'weight'", "'cg_height'")),
        ({"faults": ["plant.yaw_rate: breaks"]}, ("--fault plant.yaw_rate: breaks", "'bias'", "'stuck'")),
        ({"scenario": "fnn_sideslip/26mps"}, ("'fnn_sideslip/26mps'", "'fnn_sideslip/25mps'")),
        ({"scenario": "./fnn_sideslip/25mps"}, ("'./fnn_sideslip/25mps'", "'fnn_sideslip/25mps'")),
        ({"swaps": ["controller=/tmp/x.fmu"]}, ("--swap controller=/tmp/x.fmu", "files")),
        ({"settings": ["tyres=/etc/passwd"]}, ("--set tyres=/etc/passwd", "files")),
        ({"settings": "x"}, ("request",)),
    ):
        status, content = run(server, **{"settings": [BRIEF], **changes})
        assert status == 422
        assert each_mentions(content.decode(), names)


@pytest.mark.parametrize(
    ("content", "length", "status"),
    [
        ("{", None, 422),
        ("[" * 100_000, None, 422),
        ("[]", None, 422),
        ("{}", "x", 413),
        ("{}", "-1", 413),
        ("{}", "9" * 30, 413),
    ],
)
def test_a_malformed_request_is_refused(server, content, length, status):
    """JSON that is cut, too deep or of another form; a length that is none."""
    lines = [
        f"POST /{server.token}/run HTTP/1.1", f"Host: 127.0.0.1:{server.server_port}",
        f"Origin: {own(server)}", f"Content-Length: {length or len(content)}", "", content,
    ]  # fmt: skip
    answer = raw(server, "\r\n".join(lines))
    assert answer.startswith(f"HTTP/1.1 {status} "), answer
    assert "Traceback" not in answer


def test_an_address_that_cannot_be_read_is_refused(server):
    answer = raw(
        server,
        f"GET http://[/x HTTP/1.1\r\nHost: 127.0.0.1:{server.server_port}\r\nConnection: close\r\n\r\n",
    )
    assert answer.startswith("HTTP/1.1 400 ")
    assert answer.endswith("\r\n\r\nthe address cannot be read\n")


def test_a_running_run_makes_way():
    bench = Bench()
    with ThreadPoolExecutor() as threads:
        long = threads.submit(bench.run, Wanted("p", "", SCENARIO, ("stop_time=2000",)))
        while not (bench._latest or long.done()):
            time.sleep(0.01)
        key, _ = bench.run(Wanted("p", "", SCENARIO, (BRIEF,)))
    bench.close()
    with refused(Superseded, "run-superseded"):
        long.result()
    assert bench.block(key)


def test_sliders_have_units_and_the_vocabularys_ranges(server):
    content = ask(server, f"bench?scenario={SCENARIO}")[2]
    facts = json.loads(re.search(r'class="facts">(.*?)</script>', content.decode(), re.DOTALL)[1])
    mass = facts["knobs"]["vehicle.mass"]
    assert (mass["unit"], mass["value"], (mass["low"], mass["high"])) == ("kg", 1100, CAR["mass"].plausible)
    assert facts["shown"][:2] == ["friction", "speed"] and "vehicle.mass" in facts["shown"]
    for knob in facts["knobs"].values():
        assert knob["low"] <= knob["value"] <= knob["high"] and knob["low"] < knob["high"]
    options = re.search(r'data-instance="controller">(.*?)</select>', content.decode())[1]
    assert "<option selected>controller_fnn</option>" in options and "controller_off" in options


@pytest.mark.sampled(8)
@pytest.mark.parametrize("name", catalogue.names("a scenario"))
def test_every_slider_of_a_shipped_scenario_begins_where_its_run_does(planner, name):
    loaded, plan = planned(Job(name, catalogue.named(name), Path()), planner)
    knobs = {knob.target: knob for knob in knobs_of(loaded, plan)}
    for fact, unit in (("friction", "1"), ("speed", "m/s")):
        if fact in knobs:
            stated = getattr(loaded, fact).value
            si = float(convert(stated, unit) if isinstance(stated, str) else stated)
            assert knobs[fact].value == pytest.approx(knobs[fact].factor * si, rel=1e-11)
    assert {"rad", "rad/s", "m/s"}.isdisjoint(knob.unit for knob in knobs.values())
    shown = shown_first([*knobs.values()], plan)
    settings = [f"{t}={knobs[t].value!r} {knobs[t].unit}".strip() for t in shown if t != "friction"]
    again = planned(Job(name, catalogue.named(name), Path(), read_changes((), settings, ())), planner)[1]
    for one, other in zip(plan.instances, again.instances, strict=True):
        for variable in one.fmu.of("parameter"):
            value = one.parameter(variable.name)
            if isinstance(value, float):
                value = pytest.approx(value, rel=1e-11)
            assert other.parameter(variable.name) == value


def test_a_slider_runs_the_car_and_the_link_opens_the_same(server, chromium: Browser):
    chromium.driver.get(f"{server.address}bench?scenario={SCENARIO}")
    ready = "document.querySelector('form.bench')?.dataset.shown"
    chromium.wait_for(ready)
    turn = (
        "document.querySelector('form.bench').dataset.shown = '';"
        "const number = document.querySelectorAll('.knob input[type=number]')[arguments[0]];"
        "number.value = arguments[1]; number.dispatchEvent(new Event('change'));"
    )
    chromium.run(turn, 0, 0.4)
    chromium.wait_for(ready)
    labels = "return document.querySelector('.yv').viewer.runs.map((run) => run.label)"
    assert chromium.run(labels) == ["friction=0.4", "before: the scenario"]
    command = "return document.querySelector('.command').textContent"
    assert chromium.run(command) == f"yawbench run {SCENARIO} --set friction=0.4"
    link = chromium.run("return location.href")
    chromium.driver.get("about:blank")
    chromium.driver.get(link)
    chromium.wait_for(ready)
    assert chromium.run(labels) == ["friction=0.4"]
    chromium.run(turn, 1, 72)
    chromium.wait_for(ready)
    assert chromium.run(command) == f"yawbench run {SCENARIO} --set friction=0.4 --set 'speed=72 km/h'"
    assert chromium.console() == []


def test_samples_that_could_not_be_fetched_are_asked_for_again(server, chromium: Browser):
    chromium.driver.get(f"{server.address}bench?scenario={SCENARIO}")
    chromium.wait_for("document.querySelector('form.bench')?.dataset.shown")
    chromium.run(
        "const {bench} = document.querySelector('form.bench'); let failed = 0;"
        "window.plain = fetch;"
        "window.fetch = (address, ...all) => (address === 'run' || failed++ ? plain(address, ...all)"
        "  : Promise.resolve(new Response('no room', {status: 503})));"
        "bench.set('friction', 0.37);"
    )
    status = "document.querySelector('form.bench .status').textContent"
    chromium.wait_for(f"{status} === 'no room'")
    chromium.run("document.querySelector('form.bench').bench.ask()")
    chromium.wait_for(f"{status}.startsWith('Run in')")
    assert chromium.run("return document.querySelectorAll('.yv').length") == 1


@pytest.mark.parametrize(
    ("address", "colours"),
    [
        ("", "dark"),
        pytest.param("", "light", marks=pytest.mark.exhaustive),
        pytest.param(f"bench?scenario={SCENARIO}", "light", marks=pytest.mark.exhaustive),  # see above
        pytest.param("view?run=runs/one&run=runs/two", "dark", marks=pytest.mark.exhaustive),
        ("view?run=runs/one&run=runs/two", "light"),
    ],
)
def test_every_page_of_the_server_can_be_read_by_everyone(server, chromium: Browser, address, colours):
    chromium.open(Path("/"))
    chromium.driver.get(f"{server.address}{address}")
    chromium.wait_for("document.querySelectorAll('.yv:not(.yv-ready)').length === 0")
    assert chromium.run("return document.querySelectorAll('*').length") <= 2000
    assert inaccessible(chromium, colours) == []


def test_ctrl_c_ends_the_command_and_its_processes(folder):
    command = [sys.executable, "-m", "yawbench", "serve", "--no-browser", str(folder)]
    process = subprocess.Popen(
        command,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # a shell may have it ignored
    )
    assert process.stderr
    address = re.search(r"http://127\.0\.0\.1:\d+/\S+/", process.stderr.readline())
    assert address
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
    while not (below := children.read_text().split()):
        pass
    process.send_signal(signal.SIGINT)
    assert process.wait(30) == 130
    assert not [pid for pid in below if Path(f"/proc/{pid}").exists()]
