"""Random calls of FMI 2.0 to a unit, native and in Python: `python -m campaigns.random_calls`.

    python -m campaigns.random_calls --sequences 10 --seed 1                # of every FMU in fmus/
    python -m campaigns.random_calls --sequences 100 --only controller_pid  # of one

What must hold: both libraries answer each call with the same status, sentences in the log and values, to the
last bit; any two NaN are the same. Neither dies, and no sequence takes more than `SECONDS`. A sequence ends
where the native library says that Python alone computes what is asked. Prints what differs, with as few calls
as still do and the seed that gives all of them, and a table of the outcomes. Sequences are made in a process
that is watched; those behind one that dies are made in the next.
"""

from __future__ import annotations

import argparse
import os
import resource
import signal
import tempfile
import zipfile
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.fmus.bare import Fmu
from yawbench.fmus.archive import WANTED
from yawbench.fmus.build import HERE as FMUS
from yawbench.fmus.native.ir import ALONE

from .call_sequences import Writer
from .child import told_by
from .fmi_calls import Call, Host

SAME, LEFT = "the same", "the same, then left to Python"
DIFFERENT, DEAD, SLOW = "different", "dead", "too slow"
WAYS = ("native", "python")
SECONDS = 120
"""Processor time [s] that a sequence may take; most take less than one."""
MEMORY = 3_000_000_000
"""Bytes that the process of both libraries may take."""
CALLS = 150
"""Calls of a sequence."""


@dataclass(frozen=True)
class Outcome:
    """Outcome of a sequence.

    Attributes:
        made: calls that were made, with the last.
        why: both answers if they differ, or how a process ended.
    """

    how: str
    made: int
    why: str = ""


def both_answer(hosts: Sequence[Host], calls: Sequence[Call], tell: Any) -> Outcome:
    """Make a sequence with both libraries, call by call; `tell` hears of each before it is made."""
    try:
        for k, call in enumerate(calls, 1):
            answers = []
            for way, host in zip(WAYS, hosts, strict=True):
                tell(k, way)
                answers.append(host.answer(call))
            if ALONE in answers[0]:
                return Outcome(LEFT, k)
            if answers[0] != answers[1]:
                return Outcome(DIFFERENT, k, "\n".join(map(" ".join, zip(WAYS, answers, strict=True))))
        return Outcome(SAME, len(calls))
    finally:
        for host in hosts:
            host.free_all()


def _in_a_process(unit: Path, every: Sequence[Sequence[Call]]) -> list[Outcome]:
    """Return what sequences come to, as far as one process makes them: at least the first."""

    def act(tell: Any) -> None:
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        hosts = []
        for way in WAYS:
            os.environ[WANTED] = way
            tell(0, way)
            hosts.append(Host(unit / way))
        for calls in every:
            signal.setitimer(signal.ITIMER_PROF, SECONDS)
            outcome = both_answer(hosts, calls, tell)
            tell(outcome.how, outcome.made, outcome.why)

    news, end = told_by(act)
    outcomes = [Outcome(*one) for one in news if isinstance(one[0], str)]
    if len(outcomes) < len(every):
        number, way = next((one for one in reversed(news) if not isinstance(one[0], str)), (0, ""))
        outcomes.append(Outcome(SLOW if end == "SIGPROF" else DEAD, number, f"{way} ends by {end}"))
    return outcomes


def compared(unit: Path, every: Sequence[Sequence[Call]]) -> list[Outcome]:
    """Return what sequences come to; `unit` holds an unpacked FMU for each way to run."""
    outcomes: list[Outcome] = []
    while len(outcomes) < len(every):
        outcomes += _in_a_process(unit, every[len(outcomes) :])
    return outcomes


def shortened(unit: Path, calls: Sequence[Call], outcome: Outcome) -> list[Call]:
    """Return the fewest calls found of which the last one comes to the same."""
    calls = list(calls[: outcome.made])
    size = len(calls) // 2
    while size:
        fewer = [calls[:k] + calls[k + size :] for k in range(0, len(calls) - size, size)]
        found = (
            some
            for some, now in zip(fewer, compared(unit, fewer), strict=True)
            if now.how == outcome.how and now.made == len(some)
        )
        shorter = next(found, None)
        if shorter is None:
            size //= 2
        else:
            calls = shorter
    return calls


@dataclass
class Tally:
    """Sequences by outcome, the calls made in all, and what is to be told of those that do not hold."""

    counts: Counter[str]
    calls: int
    notes: list[str]


def trial(archive: Path, seeds: Sequence[int], count: int = CALLS) -> Tally:
    """Compare the libraries of an FMU in the sequences of some seeds."""
    with tempfile.TemporaryDirectory() as folder:
        unit = Path(folder)
        for way in WAYS:
            with zipfile.ZipFile(archive) as content:
                content.extractall(unit / way)
        fmu = Fmu(unit / WAYS[0])
        every = [Writer(fmu, f"{archive.stem} {seed}").sequence(count) for seed in seeds]
        outcomes = compared(unit, every)
        notes = []
        for seed, calls, outcome in zip(seeds, every, outcomes, strict=True):
            if outcome.how in (DIFFERENT, DEAD, SLOW):
                few = calls[: outcome.made] if outcome.how == SLOW else shortened(unit, calls, outcome)
                told = "\n".join(map(str, few))
                notes.append(f"{archive.stem}, seed {seed}: {outcome.how}\n{told}\n{outcome.why}")
    return Tally(Counter(x.how for x in outcomes), sum(x.made for x in outcomes), notes)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--sequences", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1, help="of the first; the others follow")
    parser.add_argument("--calls", type=int, default=CALLS, help="of a sequence")
    parser.add_argument("--only", nargs="*", metavar="UNIT", help="units, in place of all")
    args = parser.parse_args()
    total, began = Tally(Counter(), 0, []), sum(os.times()[:4])
    for archive in sorted(FMUS.glob("*.fmu")):
        if args.only and archive.stem not in args.only:
            continue
        tally = trial(archive, range(args.seed, args.seed + args.sequences), args.calls)
        total.counts += tally.counts
        total.calls += tally.calls
        for note in tally.notes:
            print(note, end="\n\n", flush=True)
        print(f"{archive.stem:36}", dict(tally.counts), flush=True)
    print(f"{total.calls} calls in {sum(os.times()[:4]) - began:.0f} s of processor time")
    for how, number in total.counts.most_common():
        print(f"{number:6d} {how}")


if __name__ == "__main__":
    main()
