"""Random programs, translated to C and driven beside Python: the same bytes, or a refusal with its line.

python -m tests.trials.translated --programs 2000 --seed 1
"""

from __future__ import annotations

import argparse
import ast
import math
import os
import random
import re
import resource
import signal
import struct
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fmus.native.compare_with_python import Native, Twin
from fmus.native.emit import emit
from fmus.native.ir import ALONE
from fmus.native.specialise import specialise
from fmus.native.values import Refused

from ..fmus.native.small import compiled, component_of, source
from .random_programs import BEFORE, program

SAME, REFUSED, WRONG = "the same", "refused", "wrong"
SECONDS = 20
"""Processor time [s] that a program may take."""
VALUES = (0.0, -0.0, 1.0, -1.0, 0.5, -0.5, 1.5, 2.5, 2.0, 3.0, -7.0, 1e-300, 1e17, -1e300, math.inf, math.nan)
"""Inputs that meet limits, among those that are drawn."""


@dataclass
class Tally:
    """Programs, counted by outcome."""

    counts: Counter[str] = field(default_factory=Counter)
    reasons: Counter[str] = field(default_factory=Counter)
    bad: list[tuple[int, str]] = field(default_factory=list)


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


def drive(library: Path, component: type[Any], folder: Path, seed: int, starts: int = 40) -> None:
    """Take both through starts, steps, and states that are saved and restored.

    Raises:
        AssertionError: they differ.
    """
    chance = random.Random(seed)
    pair = _Pair(Native(library, "{a}"), Twin(component, folder))
    variables = component.variables
    reals = [i for i, v in enumerate(variables) if v.causality == "parameter" and v.type == "Real"]
    others = [i for i, v in enumerate(variables) if v.causality == "parameter" and v.type != "Real"]
    for k in range(starts):
        pair.call("reset")
        if k % 2:
            pair.call(
                "set", "Real", reals, [chance.choice((0.0, -0.0, 1.0, -3.0, chance.uniform(-9.0, 9.0)))]
            )
            for i in others:
                v = variables[i]
                value: Any = chance.randint(-3, 9) if v.type == "Integer" else chance.choice((True, False))
                pair.call("set", v.type, [i], [chance.choice(v.choices) if v.type == "String" else value])
        pair.call("set", "Real", [0, 1], _inputs(chance))
        if not (pair.call("begin", 0.25 * k) and pair.call("end_initialization") and pair.call("get", [2])):
            continue
        t, kept = 0.25 * k, None
        for i in range(12):
            pair.call("set", "Real", [0, 1], _inputs(chance))
            h = chance.choice((0.001, 0.01, 1.0))
            if not pair.call("step", t, h) or not pair.call("get", [2]):
                break
            t += h
            if i == 4:
                kept = t, pair.native.save(), pair.twin.save()
            if i == 9 and kept:
                t = kept[0]
                pair.trace.append("restore")
                if pair.native.restore(kept[1])[0] != pair.twin.restore(kept[2])[0]:
                    raise AssertionError("a saved state is not restored")
                pair.call("get", [2])


def came_to(body: str, seed: int, folder: Path) -> tuple[str, str]:
    """Translate and drive a program; return what came of it, and why."""
    with component_of(source(body, BEFORE), folder) as (component, home):
        try:
            text = emit(specialise(component, home), "small.py", "{a}")
        except Refused as refused:
            if not re.search(r"\(.+:\d+\)$", str(refused)):
                return WRONG, f"refused without file and line: {refused}"
            if refused.text.startswith("not translated"):
                return WRONG, str(refused)
            return REFUSED, refused.text
        drive(compiled(text, folder), component, home.parent, seed)
    return SAME, ""


def tried(body: str, seed: int) -> tuple[str, str]:
    """Return what comes of a program in a process of its own, which may take `SECONDS`."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        how = WRONG, "it ends"
        try:
            os.close(reading)
            resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS + 1))
            with tempfile.TemporaryDirectory() as folder:
                how = came_to(body, seed, Path(folder))
        except BaseException as error:
            how = WRONG, f"{type(error).__name__}: {error}"
        finally:
            os.write(writing, "\0".join(how).encode()[:4000])
            os._exit(0)
    os.close(writing)
    with open(reading, "rb") as answers:
        content = answers.read().decode("utf-8", "replace")
    _, status = os.waitpid(child, 0)
    if not content:
        return WRONG, f"it dies of {signal.Signals(os.WTERMSIG(status)).name}"
    how, _, why = content.partition("\0")
    return how, why


def trial(seeds: Iterator[int] | range) -> Tally:
    """Try programs."""
    tally = Tally()
    for seed in seeds:
        how, why = tried(program(seed), seed)
        tally.counts[how] += 1
        if how == REFUSED:
            tally.reasons[why] += 1
        elif how == WRONG:
            tally.bad.append((seed, why))
    return tally


def shrunk(body: str, seed: int, why: str) -> str:
    """Return a program with fewer statements that is wrong in the same way."""
    kind = why.split(":")[0][:30]
    best = body
    progress = True
    while progress:
        progress = False
        count = sum(isinstance(x, ast.stmt) for x in ast.walk(ast.parse(best)))
        for k in reversed(range(count)):
            tree = ast.parse(best)
            if not _drop(tree, k):
                continue
            shorter = ast.unparse(tree) + "\n"
            how, reason = tried(shorter, seed)
            if how == WRONG and reason.split(":")[0][:30] == kind and "NameError" not in reason:
                best, progress = shorter, True
                break
    return best


def _drop(tree: ast.Module, k: int) -> bool:
    n = 0
    for node in ast.walk(tree):
        for name in ("body", "orelse"):
            block = getattr(node, name, None)
            if not isinstance(block, list):
                continue
            for i, statement in enumerate(block):
                if n == k:
                    if (
                        isinstance(statement, (ast.Return, ast.FunctionDef))
                        and name == "body"
                        and len(block) == 1
                    ):
                        return False
                    inner = getattr(statement, "body", [])
                    block[i : i + 1] = (
                        inner if isinstance(statement, (ast.If, ast.For, ast.While)) and False else []
                    )
                    if not block and name == "body":
                        block.append(ast.Pass())
                    return True
                n += 1
    return False


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--programs", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--shrink", action="store_true", help="show wrong programs with fewest statements")
    parser.add_argument("--until", type=int, default=10**9, help="wrong programs after which it ends")
    args = parser.parse_args()
    began, total = time.monotonic(), Tally()
    first = args.seed * 1_000_000
    for seed in range(first, first + args.programs):
        one = trial(range(seed, seed + 1))
        total.counts += one.counts
        total.reasons += one.reasons
        total.bad += one.bad
        for number, why in one.bad:
            text = program(number)
            if args.shrink:
                text = shrunk(text, number, why)
                why = tried(text, number)[1]
            print(f"==== {number}\n{text}\n{why}\n", flush=True)
        if len(total.bad) >= args.until:
            break
    print(dict(total.counts), f"in {time.monotonic() - began:.0f} s")
    for reason, count in total.reasons.most_common(25):
        print(f"{count:6d} {reason}")


if __name__ == "__main__":
    main()
