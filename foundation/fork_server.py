"""Start of child processes: programs of their own, and quick copies from a fork server.

They search for modules where this process does, and run nothing of the working folder.

`python` is the command line of a program of its own, which imports everything anew. `start` has a fork
server, which has imported the modules already, copy itself in milliseconds. That of multiprocessing would run
the user's script in every child, give it the output and environment of the moment at which the server was
started, need semaphores and a folder for sockets, and refuse to work in daemonic processes. No child outlives
the process that asked for it, even if that is killed: the server sees its socket close, and ends its
children.
"""

from __future__ import annotations

import atexit
import contextlib
import ctypes
import gc
import os
import pickle
import select
import signal
import socket
import subprocess
import sys
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from importlib import import_module
from typing import Any, NamedTuple

GARBAGE = 50_000
"""New objects after which copies of the fork server search for garbage. Chosen: a figure makes more."""
_PROGRAM = (
    "import sys; sys.path[:] = sys.argv[2].split('\\n'); from importlib import import_module; "
    "import_module(sys.argv[1]).main(*sys.argv[3:])"
)


def python(module: str, *arguments: object) -> list[str]:
    """Return the command line that calls `main` of a module with the arguments as strings."""
    return [sys.executable, "-c", _PROGRAM, module, "\n".join(sys.path), *map(str, arguments)]


def how_it_ended(code: int) -> str:
    """Describe how a process ended, by its return code as `subprocess` gives it."""
    if code >= 0:
        return f"ended with exit status {code}"
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = f"signal {-code}"
    return f"died of {name}" + (" (sent by another process, or out of memory)" if name == "SIGKILL" else "")


def die_with_parent(number: int = signal.SIGKILL) -> None:
    """Have this process receive a signal when its parent ends (Linux)."""
    prctl(1, number)  # PR_SET_PDEATHSIG of linux/prctl.h


def prctl(option: int, value: int) -> None:
    """Change a property of this process on Linux; elsewhere do nothing."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(option, value, 0, 0, 0)


class Child(ABC):
    """A running child process, by its process id."""

    def __init__(self, pid: int) -> None:
        self.pid = pid
        self._code: int | None = None

    @abstractmethod
    def ended(self, within: float = 0.0) -> bool:
        """Wait up to a time [s] for the process to end; return whether it has."""

    @abstractmethod
    def _collect(self) -> int:
        """Wait for the process to end; return its return code as `subprocess` gives it. Called once."""

    def collect(self) -> int:
        """Wait for the process to end; return its return code as `subprocess` gives it."""
        if self._code is None:
            self._code = self._collect()
        return self._code

    def kill(self, number: int = signal.SIGKILL, *, group: bool = False) -> None:
        """Send a signal to the process, or to its process group, unless its end has been collected."""
        if self._code is None:
            with contextlib.suppress(OSError):
                (os.killpg if group else os.kill)(self.pid, number)


class ForkedChild(Child):
    """A copy of this process, made by `os.fork`."""

    def ended(self, within: float = 0.0) -> bool:
        end = time.monotonic() + within
        while (
            self._code is None and os.waitid(os.P_PID, self.pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is None
        ):
            if time.monotonic() >= end:
                return False
            time.sleep(0.001)
        return True

    def _collect(self) -> int:
        return os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])


class ServedChild(Child):
    """A process started by the fork server, which reports its end through a pipe."""

    def __init__(self, pid: int, status: int) -> None:
        super().__init__(pid)
        self.status = status

    def ended(self, within: float = 0.0) -> bool:
        if self._code is not None:
            return True
        waiting = select.poll()
        waiting.register(self.status, select.POLLIN)
        return bool(waiting.poll(1000 * within))

    def _collect(self) -> int:
        with open(self.status, "rb") as status:
            code = status.read()
        return _number(code) if code else -signal.SIGKILL  # the server was killed, and its children with it


class ForkRequest(NamedTuple):
    """Request to the fork server: a child that calls `main` of a module."""

    module: str
    preload: tuple[str, ...]  # modules that the server keeps imported
    path: list[str]
    folder: str
    environment: dict[str, str]


_OUTPUT = (1, 2)
"""Descriptors that a child shares with the process that asks for it, besides those for `main`."""
_SIZE = 4  # bytes of a number
_MOST = 16
"""Largest number of descriptors of a request."""


class ForkServer:
    """A process that imports modules and then copies itself on request; see `start`."""

    def __init__(self) -> None:
        self._socket, theirs = socket.socketpair()
        with theirs:
            self._process = subprocess.Popen(
                python(__name__, theirs.fileno()),
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                start_new_session=True,  # Ctrl-C on the terminal is for this process, which ends its children
            )

    def start(self, module: str, *descriptors: int, preload: Iterable[str] = ()) -> ServedChild:
        """Start a process that calls `main` of a module with descriptors, which are its copies of these.

        Raises:
            OSError: the server is gone.
        """
        try:
            folder = os.getcwd()
        except OSError:  # it has been removed
            folder = os.path.sep
        request = pickle.dumps(ForkRequest(module, tuple(preload), sys.path, folder, dict(os.environ)))
        reading, status = os.pipe()
        try:
            with _open_output() as output:
                shared = [status, *output, *descriptors]
                socket.send_fds(self._socket, [len(request).to_bytes(_SIZE, "little")], shared)
                self._socket.sendall(request)
        except OSError:
            os.close(reading)
            raise
        finally:
            os.close(status)
        pid = os.read(reading, _SIZE)
        if len(pid) < _SIZE:
            os.close(reading)
            raise BrokenPipeError("the fork server has ended")
        return ServedChild(_number(pid), reading)

    def forget(self) -> None:
        """Leave the server to the process of which this one is a copy."""
        self._socket.close()
        self._process.returncode = 0  # only its parent can wait for it

    def close(self) -> None:
        """End the server, and with it all its children."""
        self._socket.close()
        self._process.wait()


@contextlib.contextmanager
def _open_output() -> Iterator[list[int]]:
    """Yield the descriptors of standard output and error, of the null device where they are closed."""
    with open(os.devnull, "wb") as nothing:
        shared = []
        for descriptor in _OUTPUT:
            try:
                os.fstat(descriptor)
            except OSError:
                descriptor = nothing.fileno()
            shared.append(descriptor)
        yield shared


_server: ForkServer | None = None
_asking = threading.Lock()  # threads of a cluster's worker start runs


def start(module: str, *descriptors: int, preload: Iterable[str] = ()) -> ServedChild:
    """Start a process by the fork server of this process, which starts when needed: `ForkServer.start`."""
    global _server
    with _asking:
        for again in (False, True):
            if _server is None:
                _server = ForkServer()
            try:
                return _server.start(module, *descriptors, preload=preload)
            except OSError:
                if again:
                    raise
                _end_server(ForkServer.close)
    raise AssertionError


def _end_server(end: Callable[[ForkServer], None]) -> None:
    global _server
    if _server is not None:
        end(_server)
        _server = None


def _forget_server() -> None:
    global _asking
    _asking = threading.Lock()
    _end_server(ForkServer.forget)


atexit.register(_end_server, ForkServer.close)
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget_server)


def main(descriptor: str) -> None:
    """Serve the process at the other end of a socket until it ends; then end all children."""
    with contextlib.suppress(KeyboardInterrupt, OSError):
        _serve(socket.socket(fileno=int(descriptor)))
    os._exit(0)


def _serve(asking: socket.socket) -> None:
    waking, woken = os.pipe()
    os.set_blocking(woken, False)
    signal.signal(signal.SIGCHLD, lambda number, frame: None)
    signal.set_wakeup_fd(woken, warn_on_full_buffer=False)
    gc.set_threshold(GARBAGE, 20, 20)
    children: dict[int, int] = {}  # process id -> pipe for its return code
    events = select.poll()
    events.register(asking, select.POLLIN)
    events.register(waking, select.POLLIN)
    try:
        while True:
            ready = [descriptor for descriptor, _ in events.poll()]
            if waking in ready:
                os.read(waking, 512)
                _report(children)
            if asking.fileno() in ready:
                received = _received(asking)
                if received is None:
                    return
                request, (status, *shared) = received
                for module in request.preload:
                    with contextlib.suppress(ImportError):
                        import_module(module)
                gc.freeze()  # modules stay: no copy searches them for garbage, or writes to their memory
                child = os.fork()
                if not child:
                    for descriptor in (asking.detach(), waking, woken, status, *children.values()):
                        os.close(descriptor)
                    _become(request, shared)
                children[child] = status
                with contextlib.suppress(BrokenPipeError):
                    os.write(status, child.to_bytes(_SIZE, "little"))
                for descriptor in shared:
                    os.close(descriptor)
    finally:
        for child in children:
            os.kill(child, signal.SIGTERM)


def _received(asking: socket.socket) -> tuple[ForkRequest, list[int]] | None:
    """Return a request and its descriptors; None if the other side has closed the socket."""
    length, descriptors, _, _ = socket.recv_fds(asking, _SIZE, _MOST)
    data = b""
    while length and len(data) < _number(length):
        more = asking.recv(_number(length) - len(data))
        if not more:
            return None
        data += more
    for descriptor in descriptors:
        os.set_inheritable(descriptor, False)
    return (pickle.loads(data), descriptors) if length else None


def _report(children: dict[int, int]) -> None:
    """Report the ends of children."""
    with contextlib.suppress(ChildProcessError):
        while (ended := os.waitpid(-1, os.WNOHANG))[0]:
            status = children.pop(ended[0])
            with contextlib.suppress(BrokenPipeError):
                os.write(status, os.waitstatus_to_exitcode(ended[1]).to_bytes(_SIZE, "little", signed=True))
            os.close(status)


def _become(request: ForkRequest, shared: Sequence[int]) -> None:
    """Call `main` in a copy of the server. Never returns."""
    server = os.getppid()
    signal.set_wakeup_fd(-1)
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # for the process that asked, which ends this one
    die_with_parent(signal.SIGTERM)
    try:
        if os.getppid() != server:
            os._exit(1)
        os.setpgid(0, 0)
        for place, descriptor in zip(_OUTPUT, shared, strict=False):
            os.dup2(descriptor, place)
            os.close(descriptor)
        sys.path[:] = request.path
        os.environ.clear()
        os.environ.update(request.environment)
        with contextlib.suppress(OSError):
            os.chdir(request.folder)
        from .errors import hide_library_warnings

        hide_library_warnings()
        run: Callable[..., Any] = import_module(request.module).main
        run(*map(str, shared[len(_OUTPUT) :]))
        sys.stdout.flush()
    except (BrokenPipeError, EOFError):
        os._exit(1)  # the process that asked is gone
    except BaseException:
        sys.excepthook(*sys.exc_info())
        os._exit(1)
    os._exit(0)


def _number(data: bytes) -> int:
    return int.from_bytes(data, "little", signed=True)
