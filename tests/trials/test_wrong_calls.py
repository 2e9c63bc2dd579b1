"""The library called with wrong things, a sample; `python -m campaigns.wrong_calls` makes all calls."""

from __future__ import annotations

from pathlib import Path

from campaigns.wrong_calls import cases, described, trial

EACH = 113
"""Calls of which the sample makes one. Chosen: a prime, so that each parameter meets other values."""


def test_some_wrong_calls_of_every_function_are_answered_by_name(tmp_path: Path) -> None:
    chosen = cases()[::EACH]
    tally = trial(chosen, tmp_path)
    assert not tally.bad, "\n".join(tally.notes)
    assert sum(tally.counts.values()) == len(chosen)


def test_every_parameter_of_every_public_function_is_called_with_wrong_things() -> None:
    tried = {parameter.name.partition(" [")[0] for parameter, _ in cases()}
    wanted = {f"{name}.{one}" for name, parameters in described().items() for one in parameters}
    assert wanted - tried == set()
