"""Runs over axes and time as an xarray Dataset."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from yawbench.foundation.errors import ResultsError

from ._run import Run

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr


def dataset(title: str, table: pd.DataFrame, axes: Sequence[str], runs: Sequence[Run | None]) -> xr.Dataset:
    """Return all columns of runs over axes and time; `attrs["units"]` of each has its unit.

    Missing runs, and columns that a run did not record, are NaN.

    Args:
        title: of the runs.
        table: a row per run; `attrs["units"]` holds the units.
        axes: columns of the table.
        runs: in the order of the rows.

    Raises:
        ResultsError: no results were kept, or the runs have different times.
    """
    import xarray as xr

    made = [run for run in runs if run is not None]
    if not made or any(not np.array_equal(run.time, made[0].time) for run in made):
        why = "the runs have different times" if made else "no results were kept"
        raise ResultsError(f"{title}: {why}", code="signal-unknown")
    levels = {name: list(dict.fromkeys(table[name])) for name in axes}
    units = table.attrs["units"]
    coordinates = {name: (name, values, _unit(units.get(name))) for name, values in levels.items()}
    shape = [*map(len, levels.values()), made[0].time.size]
    columns = {name: run.unit_of(name) for run in made for name in run}
    variables = {}
    for name, unit in columns.items():
        values = np.full(shape, np.nan)
        for run, row in zip(runs, table[list(axes)].itertuples(index=False), strict=True):
            if run is not None and name in run:
                values[tuple(levels[axis].index(x) for axis, x in zip(axes, row, strict=True))] = run[name]
        variables[name] = ((*axes, "time"), values, _unit(unit))
    time = ("time", made[0].time, _unit("s"))
    return xr.Dataset(variables, {**coordinates, "time": time}, {"title": title})


def _unit(unit: str | None) -> dict[str, str]:
    return {"units": unit} if unit else {}
