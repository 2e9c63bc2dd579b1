"""What a master is asked to run, and what it gives back."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np


@dataclass(frozen=True)
class Request:
    """An SSP archive to be run with a fixed communication step."""

    archive: str
    step: float  # communication step [s]
    n_steps: int
    columns: list[tuple[str, str]]  # unit and output, of type Real
    core: int | None = None  # the only processor core the master may use

    def write(self, path: Path) -> None:
        """Write the request as JSON."""
        path.write_text(json.dumps(asdict(self)), encoding="utf-8")

    @classmethod
    def read(cls, path: Path) -> Request:
        """Read what `write` has written."""
        content = json.loads(path.read_text(encoding="utf-8"))
        content["columns"] = [tuple(column) for column in content["columns"]]
        return cls(**content)


@dataclass(frozen=True)
class Recording:
    """Values after 0, 1, ... n communication steps, and what a step took.

    `values` has a row per point and a column per requested one; NaN where a master has no value.
    """

    values: np.ndarray
    seconds: float  # in the master's own step, per communication step

    def write(self, path: Path) -> None:
        """Write the recording as .npz."""
        np.savez(path, values=self.values, seconds=self.seconds)

    @classmethod
    def read(cls, path: Path) -> Recording:
        """Read what `write` has written."""
        with np.load(path) as content:
            return cls(content["values"], float(content["seconds"]))
