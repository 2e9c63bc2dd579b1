"""Distributions of what an experiment draws."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from . import arguments


@dataclass(frozen=True)
class Drawn:
    """What the values of an axis are drawn from; made by `uniform`, `normal` and `tabulated`.

    >>> isinstance(yb.uniform(0.3, 1.0), yb.Drawn)
    True
    """

    keys: dict[str, Any]
    """As in an experiment file."""


def _number(value: Any, name: str) -> float:
    with arguments.as_scenario_errors():
        return arguments.number(value, name)


def _drawn(unit: str, whole: bool, **keys: Any) -> Drawn:
    given = {name: value for name, value in keys.items() if value is not None}
    with arguments.as_scenario_errors():
        named = arguments.text(unit, "unit", empty=True)
    more = {"unit": named} if named else {}
    return Drawn(given | more | ({"whole": True} if arguments.flag(whole, "whole") else {}))


def uniform(low: float, high: float, *, log: bool = False, unit: str = "", whole: bool = False) -> Drawn:
    """Return the distribution whose values between two ends are equally likely.

        >>> yb.experiment(base, {"friction": yb.uniform(0.3, 1.0)}, metrics="peak(sideslip)", points=4)
        <Experiment 'Sideslip tracking at 25 m/s, mu 0.65': 4 runs over friction>

    Args:
        low, high: ends, in SI or in `unit`.
        log: whether the logarithm of the values is equally likely.
        unit: of the numbers; default: SI.
        whole: round to whole numbers, as for seeds.
    """
    spacing = "log" if arguments.flag(log, "log") else None
    ends = {"from": _number(low, "low"), "to": _number(high, "high")}
    return _drawn(unit, whole, spacing=spacing, **ends)


def normal(
    mean: float,
    deviation: float,
    *,
    low: float | None = None,
    high: float | None = None,
    unit: str = "",
    whole: bool = False,
) -> Drawn:
    """Return a normal distribution, truncated to ends if these are given.

        >>> mass = yb.normal(1100, 60, low=950)
        >>> len(yb.experiment(base, {"vehicle.mass": mass}, metrics="peak(sideslip)", points=4))
        4

    Args:
        mean, deviation: before it is truncated, in SI or in `unit`; the deviation is above 0.
        low, high: ends.
        unit, whole: as for `uniform`.
    """
    ends = {"from": (low, "low"), "to": (high, "high")}
    given = {key: None if end is None else _number(end, name) for key, (end, name) in ends.items()}
    numbers = {"mean": _number(mean, "mean"), "deviation": _number(deviation, "deviation")}
    return _drawn(unit, whole, normal=numbers, **given)


def tabulated(
    values: Iterable[float], shares: Iterable[float] | None = None, *, unit: str = "", whole: bool = False
) -> Drawn:
    """Return a distribution from a table.

        >>> speed = yb.tabulated([60, 80, 120], [0, 0.7, 1], unit="km/h")
        >>> len(yb.experiment(base, {"plant.initial_speed": speed}, metrics="peak(sideslip)", points=4))
        4

    Args:
        values: measured values, each as likely; or, with `shares`, values that rise.
        shares: of the values up to each of these, from 0 to 1; straight between them.
        unit, whole: as for `uniform`.
    """
    with arguments.as_scenario_errors():
        table: list[Any] = [
            arguments.number(x, f"values[{k}]")
            for k, x in enumerate(arguments.items(values, "values", "a list of numbers"))
        ]
        if shares is not None:
            listed = arguments.items(shares, "shares", "a list of numbers")
            upto = [arguments.number(x, f"shares[{k}]") for k, x in enumerate(listed)]
            if len(upto) != len(table):
                raise ValueError(f"shares: must be as many as values ({len(table)}, got {len(upto)})")
            table = [[value, share] for value, share in zip(table, upto, strict=True)]
    return _drawn(unit, whole, table=table)
