"""`fit` of the Python library: parameters of scenarios fitted to measurements."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from yawbench import arguments
from yawbench.foundation.progress import bar
from yawbench.planner import Planner

from .fit_file import load_fit
from .fit_result import FitResult, FittedModel, make_fit

if TYPE_CHECKING:
    import pandas as pd


def fit(
    path: str | Path, *, workers: int | None = None, progress: Callable[[str], None] | None = None
) -> Fit:
    """Fit parameters of a scenario to a measurement, as `yawbench fit` does; nothing is written.

        >>> fitted = yb.fit("fit.yaml")  # doctest: +SKIP

    Args:
        path: a fit file.
        workers: number of processes; default: the number of cores.
        progress: called with a line after every few simulations.

    Raises:
        ScenarioError: the file is invalid, or the parameters cannot be identified.
    """
    file = arguments.path(path, "path")
    workers = None if workers is None else arguments.count(workers, "workers")
    if progress is not None:
        arguments.function(progress, "progress", "line")
    loaded = load_fit(file)
    planner = Planner(build=True, report=lambda text: None)
    with bar(f"Fit {path}", wanted=False if progress else None):
        return Fit(make_fit(loaded, planner=planner, workers=workers, say=progress or (lambda text: None)))


@dataclass(frozen=True)
class Fit:
    """Parameters fitted to a measurement; created by `fit`.

    >>> yb.fit("fit.yaml").parameters  # doctest: +SKIP
    """

    _result: FitResult

    @property
    def verdict(self) -> str:
        """Verdict in words: whether the scenario's car is better than a fitted single-track model."""
        return self._result.verdict

    @property
    def values(self) -> dict[str, float]:
        """Free parameter -> fitted value in SI."""
        return self._result.scenario.estimate.values

    @property
    def parameters(self) -> pd.DataFrame:
        """Parameters of both models: value, 95 % interval (low, high), start, unit."""
        import pandas as pd

        rows = [row for model in self._result.models for row in _rows(model)]
        return pd.DataFrame(rows).set_index(["model", "parameter"])

    @property
    def scores(self) -> pd.DataFrame:
        """Differences of both models on training and held-out windows: rms, largest, fit in per cent."""
        import pandas as pd

        keys = ["model", "part", "signal"]
        rows = [dict(zip(keys, key, strict=True)) | vars(score) for key, score in self._result.scores.items()]
        return pd.DataFrame(rows).set_index(keys)

    @property
    def data(self) -> dict[str, Any]:
        """All numbers, as in fit.json."""
        return self._result.data

    def __repr__(self) -> str:
        return f"<Fit of {len(self.values)} parameters: {self.verdict}>"


def _rows(model: FittedModel) -> list[dict[str, Any]]:
    intervals = model.estimate.intervals()
    rows = []
    for parameter in model.parameters:
        low, high = intervals[parameter.name] or (None, None)
        value = model.estimate.values[parameter.name]
        rows.append({
            "model": model.title, "parameter": parameter.name, "value": value, "low": low, "high": high,
            "start": parameter.start, "unit": parameter.unit,
        })  # fmt: skip
    return rows
