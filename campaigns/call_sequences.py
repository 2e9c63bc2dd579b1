"""Random sequences of FMI 2.0 calls to a unit: most are right where they stand, so that they come deep."""

from __future__ import annotations

import math
import random
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

from tests.fmus.bare import Fmu
from tests.fmus.plausible import plausible

from . import fmi_calls as fmi

BEFORE, DURING, AFTER, ENDED = "before initialization", "during initialization", "after it", "ended"
LEADS_TO = {
    (BEFORE, "EnterInitializationMode"): DURING,
    (DURING, "ExitInitializationMode"): AFTER,
    (AFTER, "Terminate"): ENDED,
    (ENDED, "Reset"): BEFORE,
}
"""Phase and function that is right in it -> the next phase."""
FUNCTIONS = ("EnterInitializationMode", "ExitInitializationMode", "Terminate", "Reset", "CancelStep")
SHARES_OF_WRONG = (0.01, 0.05, 0.2)
"""Shares of wrong calls in a sequence: after an error, all steps are refused until a reset."""
NUMBERS = (math.nan, math.inf, -math.inf, 1e300, -0.0, 0.0)
TIMES = (math.nan, math.inf, -1.0, 1e300)
STARTS = (math.nan, math.inf, -math.inf, -1.0, 1e6, 1e12, 1e300)
STEPS = (0.0, -0.001, math.nan, math.inf, -math.inf, 1e-320, 5.0, 1e300)
STATES = (0, 1, 2)
INTEGERS = (0, 1, 2, 5, -1, 2**31 - 1, -(2**31))
TEXTS = (
    b"", b"none", b"\xc3\xa4", b"\xff", b"a'b", b'a"b\n', b"x" * 255, b"50%", None,
    "\u00fc\U0001f600\u0301".encode(),
)  # fmt: skip
NAMES = (None, b"", b"fahr\xc3\xa4\xf0\x9f\x98\x80", b"\xff\xfe", b"%s%n%d", b"x" * 5000)
GUIDS = (fmi.OURS, None, b"", b"{x}", b"g" * 5000, b"\xff")
PLACES = (
    *fmi.LOCATIONS,
    None,
    b"",
    b"file:///nowhere",
    b"http://x/y",
    b"file:",
    b"\xff",
    b"file:///" + b"a" * 6000,
)
MOST = 40
"""References of a call. Chosen: sentences that list more, and all inputs, are cut natively."""
REFERENCES = (0, 1, 10**6, 2**31 - 1, 2**31, 2**32 - 1)
CATEGORIES = ((), (b"logAll",), (b"unknown",), (b"logStatusError", None), (b"\xff",))


@dataclass(frozen=True)
class Progress:
    """Phase and time of an instance, as far as they can be told without its answers.

    Attributes:
        doubtful: a wrong call has been made, or one with an unusual value: it may have failed.
    """

    phase: str = BEFORE
    t: float = 0.0
    doubtful: bool = False


class Writer:
    """Writes one sequence."""

    def __init__(self, fmu: Fmu, seed: str) -> None:
        self.fmu = fmu
        self.chance = random.Random(seed)
        self.share = self.chance.choice(SHARES_OF_WRONG)
        self.calls: list[fmi.Call] = []
        self.at: dict[int, Progress] = {}
        self.saved: dict[int, tuple[int, Progress]] = {}  # with the instance that it is of
        self.serialized: dict[int, Progress] = {}
        self.name_of = {reference: name for name, reference in fmu.reference.items()}
        self.inputs, self.outputs = (
            [fmu.reference[name] for name in fmu.names(causality)] for causality in ("input", "output")
        )
        self.kinds = {
            self._step: 30, self._set: 16, self._get: 14, self._pass_on: 8, self._setup: 3, self._save: 5,
            self._restore: 4, self._forget: 1, self._serialize: 3, self._deserialize: 3, self._status: 2,
            self._debug: 1, self._not_supported: 1, self._free: 1,
        }  # fmt: skip

    def sequence(self, count: int) -> list[fmi.Call]:
        """Return a sequence of this many calls."""
        self._begin(0)
        self._begin(1)
        while len(self.calls) < count:
            instance = self.chance.choice((0, 0, 0, 1, 2))
            if instance not in self.at:
                self._new(instance)
            elif self.at[instance].doubtful and self.chance.random() < 0.15:
                self._begin(instance)
            else:
                (kind,) = self.chance.choices(list(self.kinds), list(self.kinds.values()))
                kind(instance)
        return self.calls[:count]

    def _wrong(self, instance: int) -> bool:
        """Return whether the next call is to be wrong, and note it."""
        wrong = self.chance.random() < self.share
        if wrong and instance in self.at:
            self._note(instance, doubtful=True)
        return wrong

    def _note(self, instance: int, **changes: Any) -> None:
        self.at[instance] = replace(self.at[instance], **changes)

    def _begin(self, instance: int) -> None:
        """Bring an instance to its first step."""
        self.calls.append(fmi.Plain(instance, "Reset") if instance in self.at else fmi.New(instance))
        self.at[instance] = Progress()
        values = plausible(self.fmu.names("input"), self.chance)
        self.calls.append(fmi.Set(instance, "Real", (*self.inputs,), (*values.values(),), len(values)))
        for _ in range(self.chance.choice((0, 1, 3))):
            self._set(instance)
        self._setup(instance)
        self._pass_on(instance)
        if self.chance.random() < 0.5:
            self._get(instance)
        self._pass_on(instance)

    def _new(self, instance: int) -> None:
        pick, number = self.chance.choice, len(self.calls)
        new = fmi.New(instance, pick(PLACES), visible=pick((0, 1)), logging_on=pick((0, 1)))
        if self.chance.random() < 0.15:
            changes = {"name": pick(NAMES), "guid": pick(GUIDS), "kind": pick((0, 7))}
            some = self.chance.sample(sorted(changes), number % 2 + 1)
            new = replace(
                new, callbacks=pick(("log", "silent", "none")), **{name: changes[name] for name in some}
            )
        self.calls.append(new)
        self.at[instance] = Progress()

    def _free(self, instance: int) -> None:
        self.calls.append(fmi.Free(instance))
        del self.at[instance]
        self.saved = {state: kept for state, kept in self.saved.items() if kept[0] != instance}

    def _step(self, instance: int) -> None:
        pick, at = self.chance.choice, self.at[instance]
        t, h = at.t, pick((0.001, 0.001, 0.005, 0.02))
        if self._wrong(instance):
            t, h = pick(((t, pick(STEPS)), (pick((*TIMES, t + h, t - h)), h)))
        elif at.phase != AFTER:
            self._pass_on(instance)
            return
        else:
            self._note(instance, t=t + h)
        self.calls.append(fmi.Step(instance, t, h, pick((0, 1))))

    def _setup(self, instance: int) -> None:
        pick = self.chance.choice
        start = pick(STARTS) if self._wrong(instance) else pick((0.0, 0.0, 1.5, -3.0))
        stop = pick((10.0, -1.0, math.nan, 0.004)) if self._wrong(instance) else None
        before = self.at[instance].phase == BEFORE
        if before or self._wrong(instance):
            self.calls.append(fmi.Setup(instance, start, stop, pick((0, 1))))
        if before:
            self._note(instance, t=start)

    def _pass_on(self, instance: int) -> None:
        """Take an instance to the next phase, seldom to the end."""
        phase = self.at[instance].phase
        (right,) = (function for at, function in LEADS_TO if at == phase)
        if self._wrong(instance) or (phase == AFTER and self.chance.random() < 0.05):
            right = self.chance.choice(FUNCTIONS)
        elif phase == AFTER:
            return
        self.calls.append(fmi.Plain(instance, right))
        if right == "Reset":
            self.at[instance] = Progress()
        else:
            self._note(instance, phase=LEADS_TO.get((phase, right), phase))

    def _references(self, instance: int, some: list[int]) -> tuple[str, tuple[int, ...]]:
        """Return a type and references of some variables of it, or wrong ones."""
        chance = self.chance
        if self._wrong(instance) or not some:
            every = [*self.name_of, len(self.name_of), *REFERENCES]
            kind = chance.choice(("Real", "Integer", "Boolean", "String"))
            return kind, tuple(chance.choices(every, k=chance.randint(1, 4)))
        # FMI 2.0 has no function of its own for an Enumeration.
        kinds = {each: self.fmu.type[self.name_of[each]].replace("Enumeration", "Integer") for each in some}
        kind = chance.choice(sorted(set(kinds.values())))
        own = [each for each in some if kinds[each] == kind]
        count = len(own) if chance.random() < 0.3 else chance.randint(1, len(own))
        return kind, tuple(chance.sample(own, min(count, MOST)))

    def _get(self, instance: int) -> None:
        some = self.outputs if self.chance.random() < 0.5 else list(self.name_of)
        kind, references = self._references(instance, some)
        right = fmi.Get(instance, kind, references, len(references))
        changes: list[dict[str, Any]] = [{"references": None}, {"count": 0}, {"into_nothing": True}]
        self.calls.append(replace(right, **self.chance.choice(changes)) if self._wrong(instance) else right)

    def _set(self, instance: int) -> None:
        before = self.at[instance].phase == BEFORE and self.chance.random() < 0.5
        some = [self.fmu.reference[name] for name in self.fmu.names("parameter")] if before else self.inputs
        kind, references = self._references(instance, some)
        share = 0.5 if self._wrong(instance) else 0.0
        values = tuple(
            self._value(kind, self.name_of.get(reference), wrong=self.chance.random() < share)
            for reference in references
        )
        right = fmi.Set(instance, kind, references, values, len(references))
        changes: list[dict[str, Any]] = [{"references": None}, {"count": 0}, {"values": None}]
        self.calls.append(replace(right, **self.chance.choice(changes)) if self._wrong(instance) else right)

    def _value(self, kind: str, name: str | None, *, wrong: bool) -> Any:
        pick = self.chance.choice
        start = (self.fmu.start.get(name) if name else None) or ""
        if kind == "Boolean":
            return pick((2, -1) if wrong else (0, 1))
        if kind == "Integer":
            return int(start) if start.isdigit() and not wrong else pick(INTEGERS)
        if kind == "String":
            return pick(TEXTS) if wrong else start.encode()
        if wrong:
            return pick(NUMBERS)
        if name in self.fmu.names("input"):
            return plausible([name], self.chance)[name]
        with suppress(ValueError):
            return float(start) * self.chance.uniform(0.8, 1.2)
        return self.chance.uniform(-5.0, 5.0)

    def _state(self, instance: int) -> int:
        """Return the number of a state that has been saved, or any."""
        return self.chance.choice(STATES if self._wrong(instance) or not self.saved else list(self.saved))

    def _place(self, instance: int) -> int | None:
        """Return a number for a state of an instance, None if all are those of others."""
        own = [state for state in STATES if self.saved.get(state, (instance,))[0] == instance]
        return self.chance.choice(own) if own else None

    def _save(self, instance: int) -> None:
        state = self._place(instance)
        if state is not None:
            wrong = self._wrong(instance)
            self.calls.append(fmi.Save(instance, state, into_nothing=wrong))
            if not wrong:
                self.saved[state] = instance, self.at[instance]

    def _restore(self, instance: int) -> None:
        state = self._state(instance)
        self.calls.append(fmi.Restore(instance, state))
        if state in self.saved:
            self.at[instance] = self.saved[state][1]

    def _forget(self, instance: int) -> None:
        state = self._state(instance)
        self.calls.append(fmi.Forget(instance, state))
        if self.saved.get(state, (None,))[0] == instance:
            del self.saved[state]

    def _serialize(self, instance: int) -> None:
        state, key, wrong = self._state(instance), self.chance.choice(STATES), self._wrong(instance)
        self.calls.append(fmi.Serialize(instance, state, key, too_few=int(wrong)))
        if state in self.saved and not wrong:
            self.serialized[key] = self.saved[state][1]

    def _deserialize(self, instance: int) -> None:
        state, wrong = self._place(instance), self._wrong(instance)
        key = self.chance.choice(list(self.serialized or STATES))
        if state is not None and (wrong or self.serialized):
            altered = self.chance.choice(fmi.ALTERED) if wrong else ""
            self.calls.append(fmi.Deserialize(instance, state, key, altered, self.chance.randrange(10**6)))
            self.saved[state] = instance, self.serialized.get(key, Progress())

    def _status(self, instance: int) -> None:
        right = fmi.Status(instance, "Real", 2)
        kind, number = (
            self.chance.choice(("", "Integer", "Boolean", "String")),
            self.chance.choice((0, 1, 2, 3, 9)),
        )
        self.calls.append(fmi.Status(instance, kind, number) if self._wrong(instance) else right)

    def _debug(self, instance: int) -> None:
        categories = None if self._wrong(instance) else self.chance.choice(CATEGORIES)
        count = 1 if categories is None else len(categories)
        self.calls.append(fmi.DebugLogging(instance, self.chance.choice((0, 1)), categories, count))

    def _not_supported(self, instance: int) -> None:
        function = self.chance.choice(("SetRealInputDerivatives", "GetRealOutputDerivatives"))
        count, nothing = self.chance.choice((0, 1)), self.chance.random() < 0.2
        derivatives = fmi.Derivatives(instance, function, count, nothing)
        if self._wrong(instance):
            self.calls.append(self.chance.choice((derivatives, fmi.Directional(instance))))
