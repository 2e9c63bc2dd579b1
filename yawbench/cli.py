"""The command `yawbench`: subcommands, exit status, error messages."""

from __future__ import annotations

import atexit
import contextlib
import gc
import io
import os
import sys
import threading
import traceback
import warnings
from collections.abc import Iterator, Sequence
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from yawbench.foundation import plugins
from yawbench.foundation.errors import (
    Diagnostic,
    Interrupted,
    YawbenchError,
    hide_library_warnings,
)
from yawbench.foundation.interrupts import terminable
from yawbench.foundation.messages import cut, printable

from . import command_help
from .commands import json_and_latex

COMPLETION = "_YAWBENCH_COMPLETE"
"""Environment variable by which a shell asks for completions; the name is click's."""


class _Commands(TyperGroup):
    """The command group. It reports interruptions itself, because typer treats SIGTERM like Ctrl-C."""

    def make_context(self, *args: Any, **options: Any) -> Any:
        with _interruptible(), _usage_noted():
            return super().make_context(*args, **options)

    def invoke(self, context: Any) -> Any:
        with _interruptible(), _usage_noted():
            return super().invoke(context)


@contextlib.contextmanager
def _interruptible() -> Iterator[None]:
    """Turn Ctrl-C and SIGTERM into a message and an exit status of their own (130, 143)."""
    try:
        yield
    except typer.BadParameter as error:
        error.message = error.message.replace("Value error, ", "")  # as pydantic, in typer, begins it
        raise
    except (Exception, KeyboardInterrupt) as error:
        cause = _interruption_in(error)
        if cause is None:
            raise
        interrupted = Interrupted.of(cause)
        _print_traceback(error)
        _print_errors(interrupted.diagnostics)
        raise SystemExit(interrupted.exit_status) from None


@contextlib.contextmanager
def _usage_noted() -> Iterator[None]:
    """Note errors of usage, which typer prints itself."""
    try:
        yield
    except Exception as error:
        if message := getattr(error, "format_message", None):
            json_and_latex.note([Diagnostic("option-invalid", message())])
        raise


def _interruption_in(error: BaseException | None) -> KeyboardInterrupt | None:
    """Return the KeyboardInterrupt behind an error; Python wraps it if it occurs during class creation."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error


def _application(arguments: Sequence[str] = (), *, whole: bool = False) -> typer.Typer:
    """Return the application with the called command, which starts faster than with all.

    Where it is not known yet (a shell completes a line, which is in the environment then) or misspelt, the
    others are there by their names alone; `whole`: all are there.
    """
    completing = COMPLETION in os.environ
    line = os.environ.get("COMP_WORDS") or os.environ.get("_TYPER_COMPLETE_ARGS") or ""
    called = (line.split()[1:] if completing else [*arguments])[:1]
    begun = not completing or len(line.split()) > 2 or line.endswith(" ")
    alone = not whole and begun and bool(called and plugins.place("command", called[0]))
    app = typer.Typer(
        name="yawbench",
        cls=_Commands,
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
        context_settings={"help_option_names": [*command_help.HELP]},
    )
    app.callback()(_options)
    for name in called if alone else plugins.names("command"):
        if whole or name in called:
            command = plugins.find("command", name)
            app.command(name)(json_and_latex.with_forms(command) if hasattr(command, "tabular") else command)
        else:
            app.command(name, help=command_help.first_line(name))(_nothing)
    return app


def _nothing() -> None:
    """Stand for a command whose name alone is needed."""


def _print_version(requested: bool) -> None:
    if requested:
        typer.echo(command_help.answer(["--version"]))
        raise typer.Exit


def _options(
    _: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version."),
    ] = False,
) -> None:
    pass


_options.__doc__ = command_help.ABOUT


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit with 0, 1 (the run failed) or 2 (the input is wrong).

    The exit status is 130 after Ctrl-C and 143 after SIGTERM. Without arguments, those of `sys.argv` are
    used, and the process exits without shutting the interpreter down.
    """
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")  # searching for plugins takes time
    if arguments is None:
        gc.set_threshold(100_000, 20, 20)  # imports and plans stay: searching for garbage finds little
    _make_printable()
    if not os.environ.get(TRACEBACK):  # ignore errors raised in destructors of libraries
        sys.unraisablehook = lambda _: None
    with terminable(), json_and_latex.printing(sys.argv[1:] if arguments is None else arguments) as printed:
        status = _status(sys.argv[1:] if arguments is None else arguments)
    status = _status_of_printing(printed, status)
    if arguments is None and threading.active_count() == 1:
        # Interpreter shutdown costs as much as a short command: skip it.
        atexit._run_exitfuncs()
        sys.stderr.flush()
        os._exit(status)
    sys.exit(status)


def _status(arguments: Sequence[str]) -> int:
    """Run a command, report its errors, and return the exit status."""
    try:
        os.getcwd()
    except OSError:
        print("the working folder is not there any more; change to another", file=sys.stderr)
        return 2
    try:
        try:
            with _interruptible(), warnings.catch_warnings():
                hide_library_warnings()
                if COMPLETION not in os.environ and (text := command_help.answer(arguments)) is not None:
                    print(text)
                    return 0
                _application(arguments)(arguments)
        except SystemExit as ended:
            return ended.code if isinstance(ended.code, int) else int(ended.code is not None)
        finally:
            sys.stdout.flush()
    except YawbenchError as error:
        _print_traceback(error)
        _print_errors(error.diagnostics)
        return error.exit_status
    except BrokenPipeError:  # the reader closed the pipe
        pass
    except OSError as error:  # a figure or table that cannot be written, most likely
        _print_traceback(error)
        where = f"{error.filename}: " if error.filename else ""
        _print_errors([Diagnostic("results-unwritable", f"{where}{error.strerror or error}")])
    except MemoryError as error:
        _print_traceback(error)
        _print_errors([Diagnostic("memory-exhausted", "the memory of this computer does not suffice")])
    except Exception as error:
        shown = _print_traceback(error)
        _print_errors([Diagnostic(YawbenchError.default_code, _own_error(error, shown))])
    else:
        return 0
    return 1


def _status_of_printing(printed: json_and_latex.Output, status: int) -> int:
    """Print a command's output; return the exit status."""
    try:
        printed.print(status)
    except BrokenPipeError:
        return 1
    except OSError as error:
        _print_errors([Diagnostic("results-unwritable", error.strerror or str(error))])
        return 1
    return status


LONGEST_MESSAGE = 5000
"""Characters of a message on the terminal. Chosen: twice the longest list of names."""
TRACEBACK = "YAWBENCH_TRACEBACK"
"""Environment variable; if it is set, errors are printed with their tracebacks."""


def _print_errors(diagnostics: Sequence[Diagnostic]) -> None:
    json_and_latex.note(diagnostics)
    for diagnostic in diagnostics:
        print(cut(str(diagnostic), LONGEST_MESSAGE), file=sys.stderr)


def _print_traceback(error: BaseException) -> bool:
    """Print the traceback of an error and its causes if `TRACEBACK` is set; return whether it is."""
    requested = bool(os.environ.get(TRACEBACK))
    if requested:
        print(printable("".join(traceback.format_exception(error))), end="", file=sys.stderr)
    return requested


def _own_error(error: Exception, shown: bool) -> str:
    """Return the message for an unexpected error: a bug in this program."""
    frame = traceback.extract_tb(error.__traceback__)[-1]
    what = printable(" ".join(f"{type(error).__name__}: {error}".split()))
    hint = "" if shown else f"; {TRACEBACK}=1 shows more"
    return (
        f"this is an error in yawbench itself, please report it: {what} "
        f"({os.path.basename(frame.filename)}:{frame.lineno}{hint})"
    )


def _make_printable() -> None:
    """Escape characters that the terminal cannot encode, and replace closed streams by the null device."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:  # closed by the caller, as by `>&-`
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


if __name__ == "__main__":
    main()
