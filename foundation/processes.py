"""Child processes: a copy of a fork server or of this process, two pipes, a deadline, an end.

`Process` is this process's side of a child. A `Worker` is a child of the fork server that calls functions:
those of pools (`workers`), and those with isolated instances (`master.isolation`). A run in a child process
(`master.child_run`) is a copy of this one, as is the child of `call_in_copy`. docs/processes.md tells which
code runs where, and how each ends.

The fork server imports the modules that its children need, and copies itself in milliseconds. That of
multiprocessing, on which pebble and loky are built, would run the user's script in every child, give it the
output and environment of the moment at which the server was started, need semaphores and a folder for
sockets, and refuse to work in daemonic processes. Children search for modules where this process does, and
run nothing of the working folder.
"""

from __future__ import annotations

import atexit
import contextlib
import copyreg
import ctypes
import gc
import io
import math
import os
import pickle
import select
import signal
import socket
import subprocess
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import fields
from functools import partial
from importlib import import_module
from multiprocessing.connection import Connection
from typing import Any, ClassVar

from .errors import hide_library_warnings
from .sent_once import SentOnce

GRACE = 5.0
"""Time that a process has to end by itself after it was asked to [s]; chosen: enough to write its results."""
CLOSING = 1.0
"""Time that a process has to end after it has closed its pipe [s]."""
LOOK_EVERY = 100
"""Interval between looks at the time limit while an answer is awaited [ms]."""
TEXT = 1 << 32
"""Largest record of a process that runs FMUs [B]; chosen: text in its place passes for a longer one."""
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
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(1, number, 0, 0, 0)  # PR_SET_PDEATHSIG of linux/prctl.h


def end_copy_of(process: int) -> None:
    """End this process if it is a copy of that one: an FMU has called `fork` and let the copy return, too."""
    if os.getpid() != process:
        os._exit(1)


def flush_output() -> None:
    """Flush the standard output streams of Python and C."""
    for stream in filter(None, (sys.stdout, sys.stderr)):
        with contextlib.suppress(OSError, ValueError):  # the reader has closed the pipe
            stream.flush()
    ctypes.CDLL(None).fflush(None)


def fork(run: Callable[[], None], keep: Iterable[int], *, ends_by: int = signal.SIGKILL) -> int:
    """Copy this process; the copy calls `run` and ends. Return its process id.

    It leads a process group: Ctrl-C, and signals that an FMU sends to its group, do not reach both.

    Args:
        keep: descriptors that stay open in the copy, besides those of standard input and output.
        ends_by: signal that the copy gets when this process ends.
    """
    flush_output()
    parent, child = os.getpid(), os.fork()
    if child:
        with contextlib.suppress(OSError):  # the copy was quicker
            os.setpgid(child, child)
        return child
    code = 1
    try:
        os.setpgid(0, 0)
        die_with_parent(ends_by)
        if os.getppid() == parent:
            for descriptor in {int(name) for name in os.listdir("/dev/fd")} - {0, 1, 2, *keep}:
                with contextlib.suppress(OSError):  # that of the listing
                    os.close(descriptor)
            run()
            flush_output()
            code = 0
    except (BrokenPipeError, EOFError):
        pass  # the process that asked is gone
    except BaseException:
        sys.excepthook(*sys.exc_info())
    finally:
        os._exit(code)


class Child:
    """A running child process.

    Args:
        pid: its process id.
        status: where the fork server reports its return code; None: `fork` has made it here.
    """

    def __init__(self, pid: int, status: Connection | None = None) -> None:
        self.pid = pid
        self.status = status
        self._code: int | None = None

    def ended(self, within: float = 0.0) -> bool:
        """Wait up to a time [s] for the process to end; return whether it has."""
        end = time.monotonic() + within
        while self._code is None:
            left = end - time.monotonic()
            if self.status is not None:
                if self.status.poll(min(max(left, 0.0), 60.0)):
                    try:
                        self._code = self.status.recv()
                    except EOFError:
                        self._code = -signal.SIGKILL  # the server was killed, and its children with it
            elif os.waitid(os.P_PID, self.pid, os.WEXITED | os.WNOHANG | os.WNOWAIT):
                self.kill()
                self._code = os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])
            elif left > 0:
                time.sleep(0.001)
            if left <= 0:
                break
        return self._code is not None

    def collect(self) -> int:
        """Wait for the process to end; return its return code as `subprocess` gives it."""
        self.ended(math.inf)
        assert self._code is not None
        return self._code

    def kill(self, number: int = signal.SIGKILL) -> None:
        """Send a signal to the process and its group, unless it is known to have ended."""
        if self._code is None:
            with contextlib.suppress(OSError):
                os.killpg(self.pid, number)


Request = tuple[tuple[str, ...], list[str], str, dict[str, str]]
"""Request to a fork server: modules that it keeps imported, search path, working folder, environment."""
_PASSED = 5
"""Descriptors of a request: for the end of the child, its two outputs, its ends of the two pipes."""


class ForkServer:
    """A process that imports modules and then copies itself on request; it is started when needed."""

    def __init__(self) -> None:
        self._asking = threading.Lock()  # threads of a cluster's worker start runs
        self._socket: socket.socket | None = None
        self.process: subprocess.Popen[bytes] | None = None

    def start(self, preload: Iterable[str], commands: int, answers: int) -> Child:
        """Start a process that makes the calls asked for in the pipe `commands` (see `Worker`)."""
        try:
            folder = os.getcwd()
        except OSError:  # it has been removed
            folder = os.path.sep
        request = tuple(preload), sys.path, folder, dict(os.environ)
        with self._asking:
            if self._socket is not None:
                with contextlib.suppress(OSError, EOFError):
                    return self._ask(self._socket, request, commands, answers)
                self.close()  # somebody has killed it
            return self._ask(self._begin(), request, commands, answers)

    def _begin(self) -> socket.socket:
        self._socket, theirs = socket.socketpair()
        with theirs:
            self.process = subprocess.Popen(
                python(__name__, theirs.fileno()),
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                start_new_session=True,  # Ctrl-C on the terminal is for this process, which ends its children
            )
        return self._socket

    def _ask(self, server: socket.socket, request: Request, *pipes: int) -> Child:
        reading, status = os.pipe()
        shared = [status, _copy_of(1), _copy_of(2)]
        told = Connection(reading, writable=False)
        try:
            socket.send_fds(server, [b"?"], [*shared, *pipes])
            with Connection(os.dup(server.fileno())) as asking:
                asking.send(request)
        finally:
            for descriptor in shared:
                os.close(descriptor)
        return Child(told.recv(), told)

    def close(self) -> None:
        """End the server, and with it all its children."""
        if self._socket is not None and self.process is not None:
            self._socket.close()
            self.process.wait()
            self._socket = self.process = None

    def forget(self) -> None:
        """Leave the server to the process of which this one is a copy."""
        if self._socket is not None and self.process is not None:
            self._socket.close()
            self.process.returncode = 0  # only its parent can wait for it
        self.__init__()  # type: ignore[misc]


def _copy_of(output: int) -> int:
    """Return a copy of the descriptor of an output, or one of the null device if it is closed."""
    try:
        return os.dup(output)
    except OSError:
        return os.open(os.devnull, os.O_WRONLY)


server = ForkServer()
"""The fork server of this process."""
atexit.register(server.close)
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=server.forget)


def main(descriptor: str) -> None:
    """Serve the process at the other end of a socket until it ends; then end all children."""
    children: dict[int, Connection] = {}  # process id -> where its return code is told
    ends, woken = os.pipe()  # a handler alone may run after a call that then waits for ever
    for end_of_pipe in (ends, woken):
        os.set_blocking(end_of_pipe, False)
    signal.set_wakeup_fd(woken, warn_on_full_buffer=False)
    signal.signal(signal.SIGCHLD, lambda number, frame: None)
    gc.set_threshold(GARBAGE, 20, 20)
    with contextlib.suppress(KeyboardInterrupt, OSError, EOFError):
        asking = socket.socket(fileno=int(descriptor))
        requests = Connection(os.dup(asking.fileno()))
        waiting = select.poll()
        waiting.register(asking, select.POLLIN)
        waiting.register(ends, select.POLLIN)
        while True:
            ready = {number for number, _ in waiting.poll()}
            if ends in ready:
                os.read(ends, _PART)
                _tell_ends(children)
            if asking.fileno() in ready:
                if not (shared := socket.recv_fds(asking, 1, _PASSED)[1]):
                    break
                _serve(children, requests.recv(), shared)
    for number, within in ((signal.SIGTERM, GRACE), (signal.SIGKILL, CLOSING)):
        for child in [*children]:
            with contextlib.suppress(OSError):
                os.killpg(child, number)
        end = time.monotonic() + within
        while children and time.monotonic() < end:
            time.sleep(0.001)
            _tell_ends(children)
    os._exit(0)


def _serve(children: dict[int, Connection], request: Request, shared: Sequence[int]) -> None:
    """Make a child, and tell its process id."""
    for module in request[0]:
        with contextlib.suppress(ImportError):
            import_module(module)
    gc.freeze()  # modules stay: no copy searches them for garbage, or writes to their memory
    for descriptor in shared:
        os.set_inheritable(descriptor, False)
    status, *passed = shared
    child = fork(partial(_become, request, passed), passed, ends_by=signal.SIGTERM)
    children[child] = Connection(status, readable=False)
    with contextlib.suppress(BrokenPipeError):
        children[child].send(child)
    for descriptor in passed:
        os.close(descriptor)


def _tell_ends(children: dict[int, Connection]) -> None:
    """Tell how children have ended, and kill what is left of their process groups."""
    for child in [*children]:
        pid, code = os.waitpid(child, os.WNOHANG)  # no others: an import may start programs
        if pid:
            with contextlib.suppress(OSError):
                os.killpg(child, signal.SIGKILL)
            with children.pop(child) as status, contextlib.suppress(BrokenPipeError):
                status.send(os.waitstatus_to_exitcode(code))


def _become(request: Request, shared: Sequence[int]) -> None:
    """Answer calls in a copy of the server, with what belongs to the process that asked for it."""
    signal.set_wakeup_fd(-1)
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # for the process that asked, which ends this one
    *output, commands, answers = shared
    for place, descriptor in zip((1, 2), output, strict=True):
        os.dup2(descriptor, place)
        os.close(descriptor)
    _, sys.path[:], folder, environment = request
    os.environ.clear()
    os.environ.update(environment)
    with contextlib.suppress(OSError):
        os.chdir(folder)
    hide_library_warnings()
    _answer_calls(Channel(commands, answers))


class Channel:
    """One process's ends of the two pipes, for records: a kind, and a content that can be pickled.

    A `Connection` of multiprocessing does the same in twice the time, which isolated instances would pay in
    every step.

    Args:
        longest: largest record that is accepted [B].
    """

    def __init__(self, reading: int, writing: int, longest: float = math.inf) -> None:
        self.reading = reading
        self.writing = writing
        self._longest = longest
        self._read = bytearray()  # of the next record: most records come whole, and with one call
        self._alone = threading.Lock()  # an FMU may log from another thread

    def send(self, kind: str, content: Any = None, dumps: Callable[[Any], bytes] = pickle.dumps) -> None:
        """Write a record."""
        data = dumps((kind, content))
        rest = memoryview(len(data).to_bytes(_HEAD, "little") + data)
        with self._alone:
            while rest:
                rest = rest[os.write(self.writing, rest) :]

    def receive(self, ready: Callable[[], None] = lambda: None) -> tuple[str, Any]:
        """Return kind and content of the next record.

        Args:
            ready: called before each part is read; returns when there is something to read.

        Raises:
            EOFError: the other side is gone.
        """
        read = self._read
        while len(read) < (end := self._end()):
            ready()
            data = os.read(self.reading, _PART)
            if not data:
                raise EOFError
            read += data
        kind, content = pickle.loads(read[_HEAD:end])
        del read[:end]
        return kind, content

    def _end(self) -> int:
        """Return where the next record ends; where its head ends as long as that is not there."""
        if len(self._read) < _HEAD:
            return _HEAD
        size = int.from_bytes(self._read[:_HEAD], "little")
        if size > self._longest:
            raise ValueError(f"a record of {size} bytes")
        return _HEAD + size

    def close(self) -> None:
        for descriptor in (self.reading, self.writing):
            with contextlib.suppress(OSError):
                os.close(descriptor)


_HEAD = 8  # bytes of the size of a record
_PART = 1 << 16  # bytes read at a time, as many as a pipe holds


class ProcessLost(Exception):
    """A child gave no answer: it has died, or was killed because of that.

    Args:
        did: what happened to it, such as "died of SIGSEGV".
        late: the cause is the FMI function being called, which did not return in time.
        killed: by SIGKILL, which the system sends if memory runs out.
    """

    def __init__(self, did: str, *, late: bool = False, killed: bool = False) -> None:
        super().__init__(did)
        self.late = late
        self.killed = killed


class Process:
    """This process's side of a child. Calls that wait for the child raise `ProcessLost` if it is lost.

    Args:
        start: starts the child with its ends of the pipes, for reading and for writing.
        unasked: kind of a record that the child may send at any time -> what is called with its content.
    """

    longest: ClassVar[float] = TEXT
    """Largest record that it may send [B]."""

    def __init__(
        self, start: Callable[[int, int], Child], unasked: Mapping[str, Callable[..., object]] | None = None
    ) -> None:
        self._unasked = unasked or {}
        self._deadline = math.inf
        """Time by which an answer is late, of `time.monotonic` [s]."""
        self._closed = False
        commands, writing = os.pipe()
        reading, answers = os.pipe()
        self._channel = Channel(reading, writing, self.longest)
        try:
            self.child = start(commands, answers)
        except BaseException:
            self._channel.close()
            raise
        finally:
            os.close(commands)
            os.close(answers)
        self._poll = select.poll()
        self._poll.register(reading, select.POLLIN)

    def check_time(self) -> None:
        """Raise `ProcessLost` if the answer is late; called several times a second during a wait."""
        if time.monotonic() > self._deadline:
            raise self.lost("did not respond")

    def lost(self, did: str, *, late: bool = False) -> ProcessLost:
        """Kill the process; return the exception to raise."""
        self.close(kill=True)
        return ProcessLost(did, late=late)

    def hear(self, wanted: str) -> Any:
        """Handle incoming records until one of the wanted kind arrives, and return its content."""
        while True:
            try:
                kind, content = self._channel.receive(self._await)
                handle = None if kind == wanted else self._unasked[kind]
            except ProcessLost:
                raise
            except Exception as error:
                raise self._gone(f"{type(error).__name__}: {error}") from None
            if handle is None:
                return content
            handle(*content)
            self.check_time()

    def _await(self) -> None:
        """Wait for something to read; an FMU may write half a record and no more."""
        while not self._poll.poll(LOOK_EVERY):
            self.check_time()
            if self.child.ended() and not self._poll.poll(0):
                raise self._gone("")  # a process started by an FMU keeps the pipe open

    def _gone(self, error: str) -> ProcessLost:
        """Return the exception for a process that has ended, or has sent something that is not an answer."""
        if not self.child.ended(CLOSING):
            return self.lost(f"closed the pipe to the master, or wrote something else there ({error})")
        code = self.close(kill=True)
        return ProcessLost(how_it_ended(code), killed=code == -signal.SIGKILL)

    def close(self, *, kill: bool = False) -> int:
        """End the process; return its return code. Later calls do nothing more.

        It ends by itself when it finds its pipes closed, or is killed after `GRACE`.

        Args:
            kill: do not wait for that.
        """
        if not self._closed:
            self._closed = True
            if kill:
                self.child.kill()
            self._channel.close()
            if not self.child.ended(GRACE):
                self.child.kill()
        return self.child.collect()


class Worker(Process):
    """A child of the fork server that calls functions, one at a time.

    Args:
        preload: modules to keep imported in the server.
        unasked: see `Process`; a function sends such records through `asking`.
    """

    longest: ClassVar[float] = math.inf

    def __init__(
        self, preload: Iterable[str], unasked: Mapping[str, Callable[..., object]] | None = None
    ) -> None:
        super().__init__(partial(server.start, tuple(preload)), unasked)
        self.calls = 0
        self.retires = False  # see `retire`
        self._sent: dict[int, SentOnce] = {}

    def give(self, function: Callable[..., Any], arguments: Sequence[Any]) -> None:
        """Have it call a function, importable by name."""
        self.calls += 1
        with contextlib.suppress(BrokenPipeError):  # the cause is found when the answer is read
            self._channel.send("call", (function, arguments), partial(pickled, reduce=self._once))

    def answer(self) -> tuple[Any, Exception | None]:
        """Wait for the answer; return the value of the call, and the exception that it raised."""
        value, error, self.retires = self.hear("answer")
        return value, error

    def telling(self) -> set[Connection | int]:
        """Return what can be read when it has answered or died."""
        return {self._channel.reading, *filter(None, [self.child.status])}

    def _once(self, item: SentOnce) -> tuple[Any, ...]:
        """Reduce an object to a number after the first time."""
        number = id(item)
        if number in self._sent:
            return _kept, (number,)
        self._sent[number] = item  # refers to it, so that no other object gets its number
        of_item = {field.name: getattr(item, field.name) for field in fields(item)}  # type: ignore[arg-type]
        return _keep, (number, type(item), of_item)


def call_in_copy(function: Callable[..., Any], arguments: Sequence[Any], limit: float) -> Any:
    """Call a function in a copy of this process and return its value.

    Args:
        function: anything that can be called; its value must be possible to pickle.
        arguments: of the function.
        limit: time after which the copy is killed [s].

    Raises:
        ProcessLost: it did not return in time (`late`), or ended its process.
        Exception: raised by the function.
    """
    copy = _Copy(partial(_answer_call, function, arguments), limit)
    try:
        answer, said = copy.hear("answer")
    finally:
        copy.close(kill=True)
    try:
        value, error = pickle.loads(answer)
    except Exception as unknown:  # of a class that only the copy has, such as of a module imported there
        raise RuntimeError(said) if said else unknown from None
    if error is not None:
        raise error
    return value


class _Copy(Process):
    """A copy of this process that answers once.

    Args:
        run: answers, in the copy, through its ends of the pipes.
        limit: time that it has [s].
    """

    longest: ClassVar[float] = math.inf

    def __init__(self, run: Callable[[int, int], None], limit: float) -> None:
        super().__init__(lambda *pipes: Child(fork(partial(run, *pipes), pipes)))
        self._deadline = time.monotonic() + limit

    def check_time(self) -> None:
        if time.monotonic() > self._deadline:
            raise self.lost("did not return", late=True)


def _answer_call(function: Callable[..., Any], arguments: Sequence[Any], commands: int, answers: int) -> None:
    """Call a function in this process, which has been forked for it, and send its value."""
    said = ""
    try:
        answer = pickle.dumps((function(*arguments), None))
    except Exception as error:
        said = "".join(traceback.format_exception(error))
        answer = pickle.dumps((None, _portable(error)))
    Channel(commands, answers).send("answer", (answer, said))


def pickled(content: Any, reduce: Callable[[SentOnce], tuple[Any, ...]]) -> bytes:
    """Return a pickle in which `reduce` says how what is sent once is restored, as `__reduce__` does."""
    buffer = io.BytesIO()
    pickler = pickle.Pickler(buffer)
    pickler.dispatch_table = copyreg.dispatch_table | dict.fromkeys(SentOnce.__subclasses__(), reduce)
    pickler.dump(content)
    return buffer.getvalue()


_received: dict[int, SentOnce] = {}
"""In a worker: number -> object that it was sent; see `Worker._once`."""


def _keep(number: int, kind: type[SentOnce], fields: dict[str, Any]) -> SentOnce:
    _received[number] = kind(**fields)
    return _received[number]


def _kept(number: int) -> SentOnce:
    return _received[number]


asking: Channel
"""In a worker: the channel to the process that asks."""
answering: dict[str, Callable[..., Any]] = {}
"""In a worker: kind of a record -> function to call with its content; one of kind "call" brings its own."""
_retires = False


def retire() -> None:
    """Have the worker that calls this function be replaced by a fresh process after the current call."""
    global _retires
    _retires = True


def _answer_calls(channel: Channel) -> None:
    """Call functions until the pipe is closed."""
    global asking
    asking = channel
    while True:
        kind, content = channel.receive()
        function, arguments = content if kind == "call" else (answering[kind], content)
        answer: tuple[Any, Exception | None]
        try:
            answer = function(*arguments), None
        except Exception as error:
            answer = None, _portable(error)
        channel.send("answer", (*answer, _retires))


def _portable(error: Exception) -> Exception:
    """Return an exception, or if it cannot be pickled, a RuntimeError with its traceback."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError("".join(traceback.format_exception(error)))
    return error
