"""Sequences that memory need not hold: of items made whenever they are asked for, or read from a file."""

from __future__ import annotations

import pickle
import tempfile
import weakref
from array import array
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import is_dataclass
from fractions import Fraction
from math import copysign
from typing import Any, Generic, TypeVar, overload

from yawbench.foundation.errors import ResultsError
from yawbench.foundation.safe_files import reason
from yawbench.orchestrator.plan import Plan

T = TypeVar("T")


class OnDemand(Sequence[T], Generic[T]):
    """A sequence whose items are made from numbers, anew whenever they are asked for.

    >>> squares = OnDemand(range(5), lambda number: number**2)
    >>> squares[3], list(squares[1:3])
    (9, [1, 4])
    """

    def __init__(self, numbers: Sequence[int], make: Callable[[int], T]) -> None:
        self._numbers = numbers
        self._make = make

    def __len__(self) -> int:
        return len(self._numbers)

    @overload
    def __getitem__(self, place: int) -> T: ...

    @overload
    def __getitem__(self, place: slice) -> OnDemand[T]: ...

    def __getitem__(self, place: int | slice) -> T | OnDemand[T]:
        if isinstance(place, slice):
            return OnDemand(self._numbers[place], self._make)
        return self._make(self._numbers[place])

    def __iter__(self) -> Iterator[T]:
        return map(self._make, self._numbers)


IN_MEMORY = 1_000_000
"""Bytes up to which no file is written. Chosen: the plans of some thousand runs."""


class StoredPlans:
    """Plans in a temporary file, stored one after the other and read by their numbers, from 0.

    All runs are planned before the first is made. A plan is stored as its difference from the first of its
    kind, and made from that again when it is read.
    """

    def __init__(self) -> None:
        self._first: dict[Hashable, tuple[int, Plan]] = {}
        self.kinds: list[Plan] = []
        """The first plan with the same FMUs, recorded signals and inputs that no wire drives."""
        self._file = tempfile.SpooledTemporaryFile(IN_MEMORY)  # noqa: SIM115 - `finalize` closes it
        self._ends = array("Q", [0])
        weakref.finalize(self, self._file.close)

    def add(self, plan: Plan) -> None:
        """Store a plan.

        Raises:
            ResultsError: the temporary file cannot be written.
        """
        fmus = [id(instance.fmu) for instance in plan.instances]
        inputs = [tuple(instance.constants) for instance in plan.instances]
        number, first = self._first.setdefault((*fmus, *inputs, plan.record), (len(self.kinds), plan))
        if first is plan:
            self.kinds.append(plan)
        stored = pickle.dumps((number, _difference(plan, first)), pickle.HIGHEST_PROTOCOL)
        try:
            self._file.seek(self._ends[-1])
            self._file.write(stored)
        except OSError as error:
            raise ResultsError(
                f"{tempfile.gettempdir()}: plans cannot be stored here: {reason(error)}; "
                "TMPDIR names another folder.",
                code="results-unwritable",
            ) from None
        self._ends.append(self._ends[-1] + len(stored))

    def __len__(self) -> int:
        return len(self._ends) - 1

    def __getitem__(self, number: int) -> Plan:
        self._file.seek(self._ends[number])
        kind, difference = pickle.loads(self._file.read(self._ends[number + 1] - self._ends[number]))
        plan: Plan = _changed(self.kinds[kind], difference)
        return plan


def _difference(new: Any, old: Any) -> dict[Any, Any] | tuple[Any] | None:
    """Return what `_changed` needs to make `new` of `old`: differences of parts by their names, or (new,).

    None if both have the same content.
    """
    kind = type(new)
    if new is old:
        return None
    if kind is type(old):
        if kind in (str, int, bool, Fraction) and new == old:
            return None
        if kind is float and new == old and copysign(1.0, new) == copysign(1.0, old):
            return None
        parts, before = _parts(new), _parts(old)
        if parts is not None and before is not None and list(parts) == list(before):
            return {
                name: difference
                for name, part in parts.items()
                if part is not before[name] and (difference := _difference(part, before[name])) is not None
            } or None
    return (new,)


def _parts(whole: Any) -> Mapping[Any, Any] | None:
    """Return the parts of a whole by their names or numbers; None if it has none."""
    if isinstance(whole, dict):
        return whole
    if isinstance(whole, (tuple, list)):
        return dict(enumerate(whole))
    return vars(whole) if is_dataclass(whole) else None


def _changed(old: Any, difference: dict[Any, Any] | tuple[Any] | None) -> Any:
    """Return an object with a difference from another, of which it shares all other parts."""
    if difference is None:
        return old
    if isinstance(difference, tuple):
        return difference[0]
    parts = {**(_parts(old) or {})}
    for name, part in difference.items():
        parts[name] = _changed(parts[name], part)
    kind = type(old)
    if kind is dict:
        return parts
    if isinstance(old, (tuple, list)):
        return kind(*parts.values()) if hasattr(kind, "_make") else kind(parts.values())
    whole = object.__new__(kind)
    vars(whole).update(parts)
    return whole
