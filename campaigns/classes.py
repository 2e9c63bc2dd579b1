"""Random laws made of classes, translated to C and driven beside Python: the same bytes, or a refusal.

python -m campaigns.classes --programs 3000 --seed 1
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence

from .class_programs import program
from .random_programs import OBJECT
from .translated import REFUSED, WRONG, Tally, Tried, shrunk, tried, tried_all

TOGETHER = 50
"""Programs that are compiled together."""


def trial(seeds: Sequence[int]) -> Tally:
    """Try programs, one group in four as optimized as units are."""
    tally = Tally()
    for first in range(0, len(seeds), TOGETHER):
        some = seeds[first : first + TOGETHER]
        optimization = "-O2" if first // TOGETHER % 4 == 3 else "-O0"
        results = tried_all([Tried(program(seed), seed, OBJECT) for seed in some], optimization)
        for seed, (how, why) in zip(some, results, strict=True):
            tally.counts[how] += 1
            if how == REFUSED:
                tally.reasons[why] += 1
            elif how == WRONG:
                tally.bad.append((seed, why))
    return tally


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--programs", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--shrink", action="store_true", help="show wrong programs with fewest statements")
    args = parser.parse_args()
    began, total = sum(os.times()[:4]), Tally()
    seeds = range(args.seed * 1_000_000, args.seed * 1_000_000 + args.programs)
    for first in range(0, len(seeds), 2 * TOGETHER):
        some = trial(seeds[first : first + 2 * TOGETHER])
        total.counts += some.counts
        total.reasons += some.reasons
        for seed, why in some.bad:
            text = program(seed)
            if args.shrink:
                text = shrunk(text, seed, OBJECT, why)
                why = tried(text, seed, OBJECT)[1]
            print(f"==== {seed}\n{text}\n{why}\n", flush=True)
        print(f"{min(first + 2 * TOGETHER, len(seeds))} programs: {dict(total.counts)}", flush=True)
    print(f"in {sum(os.times()[:4]) - began:.0f} s of processor time")
    for reason, count in total.reasons.most_common(40):
        print(f"{count:6d} {reason}")


if __name__ == "__main__":
    main()
