"""Commands on a disk that is full, and called again: `python -m campaigns.full_disk --each 20`.

No file that a command writes may exceed a size drawn between nothing and its largest file, as on a disk that
fills up. The command must fail with a sentence or have done all of its work; what it leaves may not pass for
whole; called again with room, it must give the same as if nothing had happened.
"""

from __future__ import annotations

import random
import shutil
from collections import Counter
from pathlib import Path

from .kills import NOISE, Trial, campaign


def trial(command: str, each: int, seed: int, folder: Path, fmus: Path) -> tuple[Counter[str], list[str]]:
    """Call a command `each` times without enough room.

    Returns:
        how many trials had which outcome ("held", or what went wrong); sentences on what went wrong.
    """
    r = random.Random(f"{seed} {command}")
    undisturbed = Trial(folder / f"{command} undisturbed", fmus)
    status, said, _ = undisturbed.call(command)
    assert status == 0, said
    whole = undisturbed.numbers()
    assert whole
    largest = max(path.stat().st_size for path in undisturbed.place.rglob("out/**/*") if path.is_file())
    counts: Counter[str] = Counter()
    notes: list[str] = []
    for number in range(each):
        one = Trial(folder / f"{command} {number}", fmus)
        if command != "sweep" and r.random() < 0.5:  # with results of an earlier call, which a sweep keeps
            shutil.copytree(undisturbed.place / "out", one.place / "out")
        room = round(largest * r.random() ** 3)  # most files are small
        status, said, _ = one.call(command, room)
        found = [f"{word!r} on the terminal: {said.strip()[-300:]}" for word in NOISE if word in said]
        if status == 0 and one.numbers() != whole:
            found.append("exit status 0 with other numbers than undisturbed")
        if status not in (0, 1, 2):
            found.append(f"exit status {status}")
        if status and not said.strip():
            found.append("no word on what went wrong")
        found += [*one.halves(whole), *one.litter()]
        counts["had room" if status == 0 else "failed"] += 1
        status, said, _ = one.call(command)
        found += [f"called again, exit status {status}: {said.strip().splitlines()[-1:]}"] if status else []
        found += [*one.litter()]
        if one.numbers() != whole:
            found.append("called again, other numbers than undisturbed")
        counts["held" if not found else "did not hold"] += 1
        notes += [f"{command} {number}, {room} bytes: {sentence}" for sentence in found]
        shutil.rmtree(one.place.parent)
    return counts, notes


if __name__ == "__main__":
    outcomes = {"failed": "failed", "had room": "had room", "held": "held"}
    campaign(__doc__.partition("\n")[0], trial, "calls", outcomes)
