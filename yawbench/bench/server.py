"""Server of the results below a folder, for one user on this machine.

    /TOKEN/                     pages and runs below the folder
    /TOKEN/files/PATH           leads to /OTHER/files/PATH, with a token of that file's own
    /TOKEN/view?run=PATH&...    the viewer of runs
    /TOKEN/bench?scenario=NAME  the bench (see `bench`); it posts to /TOKEN/run and gets /TOKEN/block/KEY
    /OTHER/files/PATH           a page from the folder, or a file in `data/` beside it

The server listens on 127.0.0.1. Every address begins with a random token, which other users and other pages
do not know. `Host` must be the server's own, against names that other sites have pointed here; `Origin`, if
sent, too, and must be sent with a request for a run; `Sec-Fetch-Site`, if sent, may not be another site's.
Paths are opened part by part below the folder, and no link is followed.

Pages from the folder may be somebody else's. They run in a sandbox, with an origin that no other page has,
and the token in their address opens nothing but themselves and their `data/`: their scripts cannot ask for
runs or other files, and load nothing from elsewhere.
"""

from __future__ import annotations

import errno
import hmac
import json
import os
import secrets
import stat
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from functools import partial
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from mimetypes import guess_type
from pathlib import Path
from typing import NamedTuple
from urllib.parse import parse_qs, quote, unquote_to_bytes, urlsplit

from yawbench.events.why import why
from yawbench.figures.display import LabelledRun, shown
from yawbench.foundation.errors import ResultsError, YawbenchError
from yawbench.foundation.messages import printable
from yawbench.foundation.safe_files import NO_FOLLOW
from yawbench.metrics.measures import words
from yawbench.metrics.verdict import Status, VerdictText, worded
from yawbench.orchestrator.results.file_formats import FILES
from yawbench.orchestrator.results.reader import FoundRun, found_runs, load_results
from yawbench.orchestrator.results.run_record import RUN_FILE, RunRecord
from yawbench.orchestrator.scenario import catalogue
from yawbench.orchestrator.scenario.overrides import changed, with_changes
from yawbench.reports.page_parts import Assets, Page, render, static
from yawbench.reports.viewer import page

from .sliders import Bench, Superseded, wanted_of

LARGEST = 500_000_000
"""Largest file that is served [bytes]. Chosen: far more than a page or its side files have."""
REQUEST = 100_000
"""Largest request for a run [bytes]. Chosen: a hundred changes take a tenth of it."""
DATA = "data/"
"""Folder beside a page with the files that it loads."""
INLINE = (
    "default-src 'none'; style-src 'unsafe-inline'; img-src data: blob:; font-src data:; base-uri 'none'; "
    "frame-ancestors 'none'; script-src 'unsafe-inline'"
)
OWN = f"{INLINE}; connect-src 'self'; form-action 'self'"
SANDBOX = f"sandbox allow-scripts allow-downloads; form-action 'none'; {INLINE}"
"""Content security policies: what all pages may do, of the server's own, and of pages from the folder; the
last ends with what scripts it may load."""


def open_below(folder: Path, path: str) -> int:
    """Open a regular file below a folder for reading, without following links; return its descriptor.

    Raises:
        OSError: there is no such file, a part of the path is a link or leaves the folder.
    """
    parts = path.split("/")
    if not all(part and part not in (".", "..") and "\0" not in part and "\\" not in part for part in parts):
        raise OSError(errno.ENOENT, "not below the folder", path)
    with ExitStack() as opened:
        place = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        for part in parts[:-1]:
            opened.callback(os.close, place)
            place = os.open(part, os.O_RDONLY | os.O_DIRECTORY | NO_FOLLOW, dir_fd=place)
        opened.callback(os.close, place)
        file = os.open(parts[-1], os.O_RDONLY | os.O_NONBLOCK | NO_FOLLOW, dir_fd=place)
    status = os.fstat(file)
    if not stat.S_ISREG(status.st_mode) or status.st_size > LARGEST:
        os.close(file)
        raise OSError(errno.EINVAL, "not a regular file, or too large to serve", path)
    return file


def run_folder(folder: Path, path: str) -> Path:
    """Return a run's folder below a folder, none of whose files is a link.

    Raises:
        ResultsError: there is no run, or a part of the path or a file is a link or leaves the folder.
    """
    place = folder / path
    try:
        os.close(open_below(folder, f"{path}/{RUN_FILE}" if path != "." else RUN_FILE))
        links = [name for name in FILES.values() if (place / name).is_symlink()]
    except OSError:
        links = [RUN_FILE]
    if links:
        raise ResultsError(
            f"{path}: holds no results below the folder that is served", code="results-missing"
        )
    return place


class ResultsServer(ThreadingHTTPServer):
    """Serves the results below a folder until it is closed.

    Args:
        folder: it may not exist yet.
        bench: makes the runs.
        port: 0: any free port.

    Attributes:
        address: of the first page, with the token.
    """

    daemon_threads = True

    def __init__(self, folder: Path, bench: Bench, port: int = 0) -> None:
        super().__init__(("127.0.0.1", port), Request)
        self.folder, self.bench = folder, bench
        self.token = secrets.token_urlsafe(24)
        self._tokens: dict[str, str] = {}  # path of a file -> the token that opens it
        self._paths: dict[str, str] = {}
        self.hosts = {f"{name}:{self.server_port}" for name in ("127.0.0.1", "localhost")}
        self.address = f"http://127.0.0.1:{self.server_port}/{self.token}/"

    def place_of(self, path: str) -> str:
        """Return the address of a file below the folder, with the token that opens it alone."""
        token = self._tokens.setdefault(path, secrets.token_urlsafe(24))
        self._paths[token] = path
        return f"/{token}/files/{_quoted(path)}"

    def opened_by(self, token: str) -> str | None:
        """Return the path of the file that a token opens; "" for the server's own, which opens all.

        None if it is no token.
        """
        return "" if hmac.compare_digest(token.encode(), self.token.encode()) else self._paths.get(token)


class ListedRun(NamedTuple):
    """A run in the table of runs: peaks are texts with the number they are sorted by, None: not recorded."""

    path: str
    name: str  # within its folder
    title: str
    changed: str
    peaks: Sequence[tuple[str, float] | None]
    verdict: VerdictText | str  # whether the car was lost; "" if its events were not looked for
    why: str
    status: str
    started: str


PEAKS = {"sideslip": "rad", "yaw_rate": "rad/s", "acceleration_y": "m/s2"}
"""Signals whose peak is listed, as far as the record of a run tells, with their units in SI."""


def listed_run(path: str, run: FoundRun) -> ListedRun:
    """Return a run as the table shows it, by its record alone: no signals are read."""
    record = run.record
    reasons = why(record.events)
    status = Status.FAILED if reasons else Status.PASSED
    return ListedRun(
        path=path,
        name=path.rpartition("/")[2],
        title=with_changes(record.title or path, record.overrides),
        changed=changed(record.overrides) if record.overrides else "",
        peaks=[_peak(record, signal, unit) for signal, unit in PEAKS.items()],
        verdict=worded(status, "cars") if "events" in record.model_fields_set else "",
        why="; ".join(map(str, reasons)),
        status=run.status.value,
        started=(record.started or "–")[:16].replace("T", " "),
    )


def _peak(record: RunRecord, signal: str, unit: str) -> tuple[str, float] | None:
    """Return the largest absolute value of a signal of the first instance that has it."""
    columns = (name for name in record.largest if name.rpartition(".")[2] == signal)
    for column in columns:
        if record.units.get(column) != unit:
            continue
        ends = [record.smallest.get(column), record.largest[column]]
        numbers = [abs(end) for end in ends if isinstance(end, float)]
        if len(numbers) == 2:
            return shown(max(numbers), unit), max(numbers)
    return None


@dataclass(frozen=True, kw_only=True)
class ResultsPage(Page):
    """The first page: paths and addresses of pages, paths of runs, names of scenarios for the bench."""

    template = "results.html.j2"
    pages: Sequence[tuple[str, str]]
    groups: Mapping[str, Sequence[ListedRun]]  # folder -> its runs
    peaks: Sequence[str]  # headings of the columns of peaks
    count: int  # of all runs
    scenarios: Sequence[str]


class Refused(Exception):
    """A request that is answered with a status and a sentence."""

    def __init__(self, status: HTTPStatus, sentence: str) -> None:
        super().__init__(sentence)
        self.status = status


Query = dict[str, list[str]]


class Request(BaseHTTPRequestHandler):
    """A request of a browser."""

    server: ResultsServer
    protocol_version = "HTTP/1.1"
    server_version, sys_version = "yawbench", ""
    timeout = 60  # of an idle connection [s]; chosen: the browser opens another
    disable_nagle_algorithm = True  # an answer's content would wait 40 ms for its header to be acknowledged

    def do_GET(self) -> None:
        """Answer a request for a page or a file."""
        self._answer(
            {
                "": self._index,
                "files": self._file,
                "view": self._view,
                "bench": self._bench,
                "block": self._block,
            }
        )

    def do_POST(self) -> None:
        """Answer a request for a run."""
        self._answer({"run": self._run})

    def _answer(self, answers: dict[str, Callable[[str, Query], None]]) -> None:
        """Answer by the first part of the path below the token, or say why not."""
        try:
            page, path, query = self._checked()
            kind, _, rest = path.partition("/")
            if page:
                answers = {"files": partial(self._file_of, page)}
            if kind not in answers:
                raise Refused(HTTPStatus.NOT_FOUND, "there is no such page")
            answers[kind](rest, query)
        except Refused as why:
            self._send_text(why.status, str(why))
        except Superseded as why:
            self._send_text(HTTPStatus.CONFLICT, str(why))
        except YawbenchError as error:
            self._send_text(HTTPStatus.UNPROCESSABLE_ENTITY, str(error))
        except ConnectionError:
            self.close_connection = True
        except OSError:
            self._send_text(HTTPStatus.NOT_FOUND, "there is no such file below the folder")

    def _checked(self) -> tuple[str, str, Query]:
        """Return what the token opens, the path below it and the query, after the checks of all of them."""
        hosts = self.server.hosts
        if self.headers.get("Host") not in hosts:
            raise Refused(HTTPStatus.FORBIDDEN, "the request is for another host")
        origin = self.headers.get("Origin")
        if (origin is not None or self.command == "POST") and origin not in {
            f"http://{host}" for host in hosts
        }:
            raise Refused(HTTPStatus.FORBIDDEN, "the request comes from another site")
        try:
            parts = urlsplit(self.path)
        except ValueError as error:
            raise Refused(HTTPStatus.BAD_REQUEST, "the address cannot be read") from error
        token, _, rest = parts.path.removeprefix("/").partition("/")
        page = self.server.opened_by(token)
        if page is None:
            raise Refused(
                HTTPStatus.FORBIDDEN, "the address lacks the token that 'yawbench serve' has printed"
            )
        if not page and self.headers.get("Sec-Fetch-Site", "none") not in ("none", "same-origin"):
            raise Refused(
                HTTPStatus.FORBIDDEN,
                "another site leads here; open the address that 'yawbench serve' has printed",
            )
        return page, os.fsdecode(unquote_to_bytes(rest)), parse_qs(parts.query)

    def _index(self, rest: str, query: Query) -> None:
        """Send the list of pages and runs below the folder."""
        folder = self.server.folder
        pages = [(printable(path), f"files/{_quoted(path)}") for path in pages_below(folder)]
        runs = [listed_run(path, run) for path, run in runs_below(folder)]
        groups: dict[str, list[ListedRun]] = {}
        for run in runs:
            groups.setdefault(run.path.rpartition("/")[0], []).append(run)
        view = ResultsPage(
            title=f"Results in {folder}", pages=pages, groups=groups, count=len(runs),
            peaks=[words(signal).lower() for signal in PEAKS], scenarios=catalogue.names("a scenario"),
            assets=Assets(static("bench.css", __package__), static("results.js", __package__)),
        )  # fmt: skip
        self._send_own(render(view))

    def _file(self, path: str, query: Query) -> None:
        """Send a file from the folder; lead a browser, in which scripts learn the address, to its own."""
        if "Mozilla" not in self.headers.get("User-Agent", "") and "Sec-Fetch-Mode" not in self.headers:
            self._send_file(path)
            return
        os.close(open_below(self.server.folder, path))
        self._send(HTTPStatus.SEE_OTHER, b"", "text/plain", OWN, Location=self.server.place_of(path))

    def _file_of(self, page: str, path: str, query: Query) -> None:
        """Send a page from the folder, or what is in `data/` beside it; lead to another page.

        A page cannot see where it has led.
        """
        leads = {"Sec-Fetch-Mode": "navigate", "Sec-Fetch-Dest": "document"}
        if path != page and not path.startswith(f"{page[: page.rfind('/') + 1]}{DATA}"):
            if not path.endswith(".html") or any(self.headers.get(k) != v for k, v in leads.items()):
                raise Refused(HTTPStatus.FORBIDDEN, "a page opens nothing but itself and its data")
            self._file(path, query)
            return
        place = self.server.place_of(page).removesuffix(_quoted(page))
        self._send_file(path, f" http://{self.headers['Host']}{place}")

    def _send_file(self, path: str, scripts: str = "") -> None:
        """Send a file from the folder, which may load scripts that are below an address."""
        with open(open_below(self.server.folder, path), "rb") as file:
            content = file.read()
        kind = guess_type(path)[0] or "application/octet-stream"
        text = f"{kind}; charset=utf-8" if kind.startswith("text/") else kind
        self._send(HTTPStatus.OK, content, text, f"{SANDBOX}{scripts}")

    def _view(self, rest: str, query: Query) -> None:
        """Send the viewer of recorded runs."""
        paths = query.get("run", [])
        if not paths:
            raise Refused(HTTPStatus.UNPROCESSABLE_ENTITY, "choose a run")
        runs = [LabelledRun(path, load_results(run_folder(self.server.folder, path))) for path in paths]
        self._send_own(page(runs))

    def _bench(self, rest: str, query: Query) -> None:
        """Send the bench of a scenario."""
        names = catalogue.names("a scenario")
        scenario = query.get("scenario", names)[0]
        self._send_own(self.server.bench.page(scenario, names))

    def _block(self, key: str, query: Query) -> None:
        """Send the samples of a run of the bench."""
        data = self.server.bench.block(key)
        if data is None:
            raise Refused(HTTPStatus.NOT_FOUND, "this run is not kept any more")
        self._send(HTTPStatus.OK, data, "application/octet-stream", OWN)

    def _run(self, rest: str, query: Query) -> None:
        """Make a run of the bench, and send its key and the viewer with it and the earlier ones."""
        began = time.perf_counter()
        length = self.headers.get("Content-Length", "")
        if not length.isdecimal() or int(length) > REQUEST:
            self.close_connection = True
            raise Refused(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, "the request is too large")
        wanted = wanted_of(self.rfile.read(int(length)))
        key, made = self.server.bench.run(wanted)
        html = self.server.bench.viewer([(key, wanted.label), *wanted.earlier])
        answer = {
            "key": key, "html": html, "command": wanted.command, "warnings": made,
            "milliseconds": round(1000 * (time.perf_counter() - began)),
        }  # fmt: skip
        self._send(HTTPStatus.OK, json.dumps(answer).encode(), "application/json", OWN)

    def _send_own(self, text: str) -> None:
        content = text.encode(errors="backslashreplace")
        self._send(HTTPStatus.OK, content, "text/html; charset=utf-8", OWN)

    def _send_text(self, status: HTTPStatus, sentence: str) -> None:
        content = f"{printable(sentence)}\n".encode(errors="backslashreplace")
        self._send(status, content, "text/plain; charset=utf-8", OWN)

    def _send(self, status: HTTPStatus, content: bytes, kind: str, policy: str, **more: str) -> None:
        if self.command == "POST" and status is not HTTPStatus.OK:
            self.close_connection = True  # its content may not have been read
        self.send_response(status)
        headers = {
            "Content-Type": kind, "Content-Length": str(len(content)), "Content-Security-Policy": policy,
            "X-Content-Type-Options": "nosniff", "Referrer-Policy": "no-referrer",
            "Cache-Control": "no-store", "X-Frame-Options": "DENY", **more,
        }  # fmt: skip
        if policy is OWN:  # to a sandboxed page, the files beside it are of another origin
            headers["Cross-Origin-Resource-Policy"] = headers["Cross-Origin-Opener-Policy"] = "same-origin"
        for name, value in headers.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, format: str, *arguments: object) -> None:
        """Print nothing: the address in each line has the token."""


def _quoted(path: str) -> str:
    return quote(os.fsencode(path))


def pages_below(folder: Path) -> Iterator[str]:
    """Yield the paths of the HTML pages below a folder in alphabetical order, without links."""
    pages = [
        path.relative_to(folder).as_posix()
        for place, _, files in os.walk(folder)
        for path in (Path(place, name) for name in files if name.endswith(".html"))
        if not path.is_symlink()
    ]
    yield from sorted(pages)


def runs_below(folder: Path) -> Iterator[tuple[str, FoundRun]]:
    """Yield path and run of the results below a folder, the latest first; none whose files are links."""
    try:
        runs = found_runs(folder)
    except ResultsError:
        return
    for run in reversed(runs):
        path = run.folder.relative_to(folder).as_posix()
        with suppress(ResultsError):
            run_folder(folder, path)
            yield path, run
