"""Results that are in memory written to a folder, as a run would have written them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .formats import recorder_of
from .read import Results
from .recorder import BLOCK


def write_results(results: Results, folder: Path, *, format: str = "csv") -> None:
    """Write columns and record into a folder; results that stand there are replaced as a whole.

    Raises:
        ScenarioError: there is no such format.
        ResultsError: they cannot be written.
    """
    names = list(results)
    real = [np.issubdtype(results[name].dtype, np.number) for name in names]
    recorder = recorder_of(format)(folder, names, real, results.units)
    numbers = np.column_stack([results.time, *(results[n] for n, r in zip(names, real, strict=True) if r)])
    others = [*zip(*(results[n].tolist() for n, r in zip(names, real, strict=True) if not r), strict=True)]
    try:
        for first in range(0, len(numbers), BLOCK):
            block = numbers[first : first + BLOCK]
            recorder.lay(block)
            recorder.others += [list(row) for row in others[first : first + len(block)]]
            recorder.write(len(block))
        recorder.finish(results.run)
    finally:
        recorder.close()
