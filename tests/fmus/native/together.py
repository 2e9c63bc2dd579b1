"""One C file for many translated programs: what they have in common takes most of the compiler's time."""

from __future__ import annotations

import ctypes
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

from yawbench.fmus.native import compare_with_python
from yawbench.fmus.native.emit import emit
from yawbench.fmus.native.specialise import specialise

from .small import compiled, component_of, fewer_steps, source

CHOSEN = "chosen"
"""Variable of a library that holds the number of the program that it is."""
_READ = "Problem *problem, const Variables *v, const Configured *c"
HOOKS = {
    "configure": "Problem *problem, const Variables *v, Configured *c",
    "start": f"{_READ}, State *s, List *lists, double t",
    "advance": f"{_READ}, State *s, List *lists, double t, double h",
    "output": f"{_READ}, const State *s, const List *lists, double *y, double t",
}
"""Functions of a program, and their parameters."""
MEMBERS = {"c": "&c->of_{k}", "s": "&s->of_{k}"}


def parts_of(text: str) -> tuple[str, str]:
    """Return the declarations of a program's variables, and its functions."""
    head, guid, rest = text.partition('#define GUID "{a}"\n')
    return head + guid, rest.partition('#include "fmi_unit.h"')[0]


def together(programs: Sequence[str]) -> str:
    """Return the C text of one library for programs of the same variables."""
    heads, rests = zip(*map(parts_of, programs), strict=True)
    if len(set(heads)) != 1:
        raise ValueError("programs of different variables")
    lines = [heads[0]]
    counts = []
    for k, rest in enumerate(rests):
        names = ["Configured", "State", "N_LISTS", "WIDTHS", "N_BRANCHES", "BRANCHES", "branches"]
        names += ["yawbench_branches", *re.findall(r"(?m)^static int (\w+)\(", rest)]
        lines += [f"#define {name} {name}_of_{k}" for name in names]
        lines += [rest, *(f"#undef {name}" for name in names)]
        counts.append([int(x) for x in re.findall(r"WIDTHS\[\] = \{(.*)\};", rest)[0].split(",")])
    most = max(map(len, counts))
    for name in ("Configured", "State"):
        lines.append("typedef union {")
        lines += [f"    {name}_of_{k} of_{k};" for k in range(len(rests))]
        lines.append(f"}} {name};")
    lines += [
        f"enum {{ N_LISTS = {most} }};",
        "static const int EVERY_WIDTHS[][N_LISTS] = {"
        + ", ".join(
            "{" + ", ".join(str(max(x, 1)) for x in [*row, *[1] * (most - len(row))]) + "}" for row in counts
        )
        + "};",
        f'__attribute__((visibility("default"))) int {CHOSEN};',
        f"#define WIDTHS (EVERY_WIDTHS[{CHOSEN}])",
    ]
    for hook, parameters in HOOKS.items():
        names = [x.rpartition("*")[2].split()[-1] for x in parameters.split(",")]
        lines += [f"static int {hook}({parameters})", "{", f"    switch ({CHOSEN}) {{"]
        for k in range(len(rests)):
            passed = ", ".join(MEMBERS[x].format(k=k) if x in MEMBERS else x for x in names)
            lines.append(f"    case {k}: return {hook}_of_{k}({passed});")
        lines += ["    }", "    return 1;", "}"]
    return "\n".join([*lines, '#include "fmi_unit.h"', ""])


def library_of(programs: Sequence[str], folder: Path, optimization: str) -> Path:
    """Compile programs to one library."""
    return compiled(together(programs), folder, optimization)


def choose(library: Path, number: int) -> None:
    """Make a library the program of this number, until another is chosen."""
    ctypes.c_int.in_dll(ctypes.CDLL(str(library)), CHOSEN).value = number


@contextmanager
def comparisons(laws: Mapping[str, str], before: str, folder: Path) -> Iterator[Callable[..., Any]]:
    """Translate and compile laws; yield a function that drives the one of a name beside Python.

    The function may be given another comparison than `compare`, as `differences`. What is wrong with the
    translation of a law is raised when it is to be driven.
    """
    made = {}
    failed = {}
    with component_of(source("def output(self, t, u):\n    return u[:1]\n"), folder) as (_, home):
        for k, (name, law) in enumerate(laws.items()):
            (home / "controllers" / f"small_{k}.py").write_text(source(law, before))
            component = import_module(f"{home.name}.controllers.small_{k}").Unit
            try:
                made[name] = component, emit(specialise(component, home), "small.py", "{a}")
            except Exception as error:
                failed[name] = error
        library = library_of([text for _, text in made.values()], folder, "-O0")

        def compare(name: str, how: Callable[..., Any] | None = None) -> Any:
            if name in failed:
                raise failed[name]
            choose(library, list(made).index(name))
            with fewer_steps():
                compared = how or compare_with_python.compare
                return compared(library, "{a}", made[name][0], home.parent)

        yield compare
