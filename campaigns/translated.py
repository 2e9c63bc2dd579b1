"""Random programs, translated to C and driven beside Python: the same bytes, or a refusal with its line.

python -m campaigns.translated --programs 2000 --seed 1
python -m campaigns.translated --classes --programs 3000 --seed 1    # laws made of classes
"""

from __future__ import annotations

import argparse
import ast
import importlib.util
import math
import os
import random
import re
import signal
import struct
import sys
import tempfile
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import yawbench._native
from tests.fmus.native.small import HEAD, component_of, source
from tests.fmus.native.together import choose, library_of, parts_of
from yawbench._controller import PythonComponent
from yawbench._native import folders_of
from yawbench.fmus.native.compare_with_python import Native, Twin
from yawbench.fmus.native.emit import emit
from yawbench.fmus.native.ir import ALONE
from yawbench.fmus.native.specialise import Program, specialise
from yawbench.fmus.native.values import Refused

from . import class_programs
from .child import told_by
from .grammar import BEFORE
from .random_programs import CALLED, COMPONENT, FUNCTION, OBJECT, program

SAME, REFUSED, WRONG = "the same", "refused", "wrong"
SECONDS = 20
"""Processor time [s] that a program may take, and the compiler for many."""
TOGETHER = 20
"""Programs that are compiled together."""
KEPT = ("start", "advance", "output", "law", "__call__", "__init__", "Law")
"""Functions and classes that a smaller program has, too."""
LITERAL = 'from typing import Literal\n\nMode = Literal["first", "second", "third"]\n'
"""Type of the text parameter of laws."""
VALUES = (
    0.0, -0.0, 1.0, -1.0, 0.5, -0.5, 1.5, 2.5, 2.0, 3.0, -7.0, 1e-300, 5e-324, 1e17, 2.0**53, -1e300,
    math.inf, math.nan,
)  # fmt: skip
"""Inputs that meet limits, among those that are drawn."""


@dataclass(frozen=True)
class Tried:
    """A program, and the seed of what it is driven with."""

    text: str
    seed: int
    kind: str = COMPONENT


@dataclass
class Tally:
    """Programs, counted by outcome."""

    counts: Counter[str] = field(default_factory=Counter)
    reasons: Counter[str] = field(default_factory=Counter)
    bad: list[tuple[Tried, str]] = field(default_factory=list)


def _same(a: Any, b: Any) -> bool:
    if a[:2] != b[:2]:
        return False
    if a[2] == b[2]:
        return True
    count = len(a[2]) // 8
    pairs = zip(struct.unpack(f"{count}d", a[2]), struct.unpack(f"{count}d", b[2]), strict=True)
    return all(
        struct.pack("d", x) == struct.pack("d", y) or (math.isnan(x) and math.isnan(y)) for x, y in pairs
    )


def _shown(answer: Any) -> str:
    values = struct.unpack(f"{len(answer[2]) // 8}d", answer[2]) if len(answer[2]) % 8 == 0 else ()
    return f"{'succeeds' if answer[0] else 'fails'}, says {answer[1]}, gives {values}"


class _Pair:
    def __init__(self, native: Native, twin: Twin) -> None:
        self.native, self.twin = native, twin
        self.trace: list[str] = []

    def call(self, what: str, *args: Any) -> bool:
        """Call both; return whether both succeeded."""
        self.trace.append(f"{what}{args}")
        native, python = getattr(self.native, what)(*args), getattr(self.twin, what)(*args)
        if any(ALONE in text for text in native[1]):
            return False
        if not _same(native, python):
            raise AssertionError(f"native {_shown(native)}\npython {_shown(python)}\nafter {self.trace[-4:]}")
        return bool(native[0])


def _inputs(chance: random.Random) -> list[float]:
    return [
        chance.choice(VALUES) if chance.random() < 0.15 else
        float(chance.randint(-4, 4)) if chance.random() < 0.2 else chance.uniform(-3.0, 3.0)
        for _ in range(2)
    ]  # fmt: skip


def drive(library: Path, component: type[Any], folder: Path, seed: int, starts: int = 30) -> None:
    """Take both through starts, steps, and states that are saved and restored.

    Raises:
        AssertionError: they differ.
    """
    chance = random.Random(seed)
    pair = _Pair(Native(library, "{a}"), Twin(component, folder))
    variables = component.variables
    inputs, outputs = ([i for i, v in enumerate(variables) if v.causality == x] for x in ("input", "output"))
    reals = [i for i, v in enumerate(variables) if v.causality == "parameter" and v.type == "Real"]
    others = [i for i, v in enumerate(variables) if v.causality == "parameter" and v.type != "Real"]
    for k in range(starts):
        pair.call("reset")
        if k % 2:
            pair.call(
                "set",
                "Real",
                reals,
                [chance.choice((0.0, -0.0, 1.0, -3.0, chance.uniform(-9.0, 9.0))) for _ in reals],
            )
            for i in others:
                v = variables[i]
                value: Any = chance.randint(-3, 9) if v.type == "Integer" else chance.choice((True, False))
                kind, own = (
                    ("Enumeration", chance.randint(1, len(v.choices))) if v.choices else (v.type, value)
                )
                pair.call("set", kind, [i], [own])
        pair.call("set", "Real", inputs, _inputs(chance)[: len(inputs)])
        if not (
            pair.call("begin", 0.25 * k) and pair.call("end_initialization") and pair.call("get", outputs)
        ):
            continue
        t, kept = 0.25 * k, None
        for i in range(12):
            pair.call("set", "Real", inputs, _inputs(chance)[: len(inputs)])
            h = chance.choice((0.001, 0.01, 1.0))
            if not pair.call("step", t, h) or not pair.call("get", outputs):
                break
            t += h
            if i == 4:
                kept = t, pair.native.save(), pair.twin.save()
            if i == 9 and kept and kept[2]:  # the state of some laws cannot be saved in Python
                t = kept[0]
                pair.trace.append("restore")
                if pair.native.restore(kept[1])[0] != pair.twin.restore(kept[2])[0]:
                    raise AssertionError("a saved state is not restored")
                pair.call("get", outputs)


class _Translating:
    """Translation of programs, all in one staged package."""

    def __init__(self, home: Path, folder: Path) -> None:
        self.home, self.folder = home, folder
        self.count = 0

    def made(self, tried: Tried) -> tuple[type[Any], Callable[[], Program]]:
        """Return the component class of a program, and what translates it."""
        self.count += 1
        name = f"trial_{self.count}"
        if tried.kind == COMPONENT:
            (self.home / "controllers" / f"{name}.py").write_text(source(tried.text, BEFORE))
            module = importlib.import_module(f"{self.home.name}.controllers.{name}")
            return module.Unit, lambda: specialise(module.Unit, self.home)
        file = self.folder / f"{name}.py"
        file.write_text(HEAD.partition("from ..fmi")[0] + LITERAL + BEFORE + tried.text)
        spec = importlib.util.spec_from_file_location(name, file)
        assert spec is not None and spec.loader is not None
        module = sys.modules[name] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        law = module.law if tried.kind == FUNCTION else module.Law()
        made = PythonComponent(law, instance="law", role="controller")
        homes, unnamed = folders_of(law, made._translated), Path(yawbench._native.__file__)
        return made.component, lambda: specialise(made._translated, *homes, unnamed=unnamed)


def _translated(translating: _Translating, tried: Tried) -> tuple[str, Any]:
    """Return `SAME` with class and text, or how and why a program is not translated."""
    try:
        component, translate = translating.made(tried)
    except Exception as error:
        return REFUSED, f"no component is made: {type(error).__name__}"
    try:
        return SAME, (component, emit(translate(), "small.py", "{a}"))
    except Refused as refused:
        if not re.search(r"\(.+:\d+\)$", str(refused)):
            return WRONG, f"refused without file and line: {refused}"
        if refused.text.startswith("not translated"):
            return WRONG, str(refused)
        return REFUSED, refused.text
    except Exception as error:
        return WRONG, f"{type(error).__name__}: {error}"


def _come_to(every: Sequence[Tried], optimization: str, folder: Path, tell: Callable[..., None]) -> None:
    """Translate and drive programs; tell what comes of each."""
    with component_of(source("def output(self, t, u):\n    return u[:1]\n"), folder) as (_, home):
        translating = _Translating(home, folder)
        groups: dict[str, list[tuple[int, type[Any], str]]] = {}
        for k, tried in enumerate(every):
            tell(k)
            how, made = _translated(translating, tried)
            if how == SAME:
                groups.setdefault(parts_of(made[1])[0], []).append((k, *made))
            else:
                tell(k, how, made)
        for number, group in enumerate(groups.values()):
            tell(-1)
            place = folder / str(number)
            place.mkdir()
            library = library_of([text for _, _, text in group], place, optimization)
            for place_in, (k, component, _) in enumerate(group):
                tell(k)
                choose(library, place_in)
                try:
                    drive(library, component, home.parent, every[k].seed)
                except AssertionError as error:
                    tell(k, WRONG, str(error))
                except Exception as error:
                    tell(k, WRONG, f"{type(error).__name__}: {error}")
                else:
                    tell(k, SAME, "")


def _in_a_process(every: Sequence[Tried], optimization: str) -> tuple[dict[int, tuple[str, str]], int, str]:
    """Return what comes of programs in a process, until one takes more than `SECONDS` or kills it.

    The others are the number of the program that was tried last, -1 for the compiler, and how it ended.
    """

    def act(tell: Callable[..., None]) -> None:
        warnings.simplefilter("ignore")  # of literals in random programs

        def in_time(*news: Any) -> None:
            signal.setitimer(signal.ITIMER_PROF, SECONDS)
            tell(*news)

        with tempfile.TemporaryDirectory() as folder:
            _come_to(every, optimization, Path(folder), in_time)

    news, end = told_by(act)
    results = {one[0]: (one[1], one[2]) for one in news if len(one) > 1}
    return results, next((one[0] for one in reversed(news) if len(one) == 1), -1), end


def tried_all(every: Sequence[Tried], optimization: str = "-O0") -> list[tuple[str, str]]:
    """Return what comes of programs, and why."""
    results: dict[int, tuple[str, str]] = {}
    waiting = list(range(len(every)))
    while waiting:
        made, last, end = _in_a_process([every[k] for k in waiting], optimization)
        results |= {waiting[k]: result for k, result in made.items()}
        if last >= 0 and last not in made:
            results[waiting[last]] = WRONG, end
        rest = [k for k in waiting if k not in results]
        if len(rest) == len(waiting) or (last == -1 and len(rest) == 1):
            if len(waiting) == 1:
                return [*[results[k] for k in results], (WRONG, end)]
            return [
                result
                for k in range(len(every))
                for result in ([results[k]] if k in results else tried_all([every[k]], optimization))
            ]
        waiting = rest
    return [results[k] for k in range(len(every))]


def tried(body: str, seed: int, kind: str = COMPONENT) -> tuple[str, str]:
    """Return what comes of a program, and why."""
    return tried_all([Tried(body, seed, kind)])[0]


def kind_of(seed: int) -> str:
    """Return the kind of the program of a seed: two of five are laws."""
    return (COMPONENT, COMPONENT, FUNCTION, COMPONENT, (CALLED, OBJECT)[seed // 5 % 2])[seed % 5]


def program_of(seed: int) -> Tried:
    """Return the program of a seed in the first grammar."""
    return Tried(program(seed, kind_of(seed)), seed, kind_of(seed))


def law_of_classes(seed: int) -> Tried:
    """Return the law of a seed in the second grammar."""
    return Tried(class_programs.program(seed), seed, OBJECT)


def trial(seeds: Sequence[int], made: Callable[[int], Tried] = program_of) -> Tally:
    """Try programs, `TOGETHER` at a time, one time in four as optimized as units are."""
    tally = Tally()
    for first in range(0, len(seeds), TOGETHER):
        some = [made(seed) for seed in seeds[first : first + TOGETHER]]
        optimization = "-O2" if first // TOGETHER % 4 == 3 else "-O0"
        for one, (how, why) in zip(some, tried_all(some, optimization), strict=True):
            tally.counts[how] += 1
            if how == REFUSED:
                tally.reasons[why] += 1
            elif how == WRONG:
                tally.bad.append((one, why))
    return tally


def alike(one: str, other: str) -> bool:
    """Return whether two programs are wrong in the same way."""
    one, other = (re.sub(r"[\d.]+", "", x)[:24] for x in (one, other))
    return one == other


def shrunk(one: Tried, why: str) -> tuple[str, str]:
    """Return a program with fewer statements and expressions that is wrong in the same way, and how."""
    text = one.text
    while True:
        queue = sorted({x for x in _shorter(text) if len(x) < len(text)}, key=len)
        found = None
        for first in range(0, len(queue), TOGETHER):
            some = queue[first : first + TOGETHER]
            results = tried_all([replace(one, text=x) for x in some])
            found = next(
                (
                    x
                    for x, (how, reason) in zip(some, results, strict=True)
                    if how == WRONG and alike(reason, why)
                ),
                None,
            )
            if found:
                break
        if not found:
            return text, tried(text, one.seed, one.kind)[1]
        text = found


def _shorter(text: str) -> Iterator[str]:
    """Yield programs with a statement less, or with a part of an expression instead of it."""
    nodes = list(ast.walk(ast.parse(text)))
    for k in range(len(nodes)):
        tree = ast.parse(text)
        node = list(ast.walk(tree))[k]
        for name, held in ast.iter_fields(node):
            if isinstance(held, list):
                for i, part in enumerate(held):
                    for instead in _parts(part, at_most=len(held) - 1):
                        held[i : i + 1] = instead
                        yield ast.unparse(ast.fix_missing_locations(tree)) + "\n"
                        held[i : i + len(instead)] = [part]
            elif isinstance(held, ast.expr):
                for (part,) in filter(None, _parts(held)):
                    setattr(node, name, part)
                    yield ast.unparse(ast.fix_missing_locations(tree)) + "\n"
                setattr(node, name, held)


def _parts(node: Any, at_most: int = 0) -> Iterator[list[Any]]:
    """Yield what may stand for a node: nothing, its blocks, or its parts."""
    if isinstance(node, ast.stmt) and not (
        isinstance(node, (ast.FunctionDef, ast.ClassDef)) and node.name in KEPT
    ):
        yield [] if at_most else [ast.Pass()]
        for name in ("body", "orelse"):
            if getattr(node, name, None) and not isinstance(node, (ast.FunctionDef, ast.ClassDef)):
                yield getattr(node, name)
    elif isinstance(node, ast.expr) and isinstance(getattr(node, "ctx", ast.Load()), ast.Load):
        yield from ([x] for x in ast.iter_child_nodes(node) if isinstance(x, ast.expr))
        if not isinstance(node, (ast.Constant, ast.Name)):
            yield [ast.Constant(1.5)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--programs", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--classes", action="store_true", help="laws made of classes")
    parser.add_argument("--shrink", action="store_true", help="show wrong programs with fewest statements")
    parser.add_argument("--until", type=int, default=10**9, help="wrong programs after which it ends")
    args = parser.parse_args()
    began, total = sum(os.times()[:4]), Tally()
    seeds = range(args.seed * 1_000_000, args.seed * 1_000_000 + args.programs)
    for first in range(0, len(seeds), 4 * TOGETHER):
        some = trial(seeds[first : first + 4 * TOGETHER], law_of_classes if args.classes else program_of)
        total.counts += some.counts
        total.reasons += some.reasons
        total.bad += some.bad
        for one, why in some.bad:
            text, why = shrunk(one, why) if args.shrink else (one.text, why)
            print(f"==== {one.seed}, {one.kind}\n{text}\n{why}\n", flush=True)
        if len(total.bad) >= args.until:
            break
    print(dict(total.counts), f"in {sum(os.times()[:4]) - began:.0f} s of processor time")
    for reason, count in total.reasons.most_common(25):
        print(f"{count:6d} {reason}")


if __name__ == "__main__":
    main()
