"""Names of signals, targets of overrides, and patterns of names: each is parsed here and nowhere else.

A signal is named `instance.variable`. Names of instances have no dots, so the first dot separates; brackets
and further dots belong to the variable, as in `plant.x[1]` or `plant.body.w`. In a pattern, `*` matches any
characters and every other character matches itself.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, NamedTuple

from yawbench.foundation.messages import short
from yawbench.vocabulary.facts import FACTS

TIMES = ("start_time", "stop_time", "step_size")
OF_RUN = (*TIMES, "algorithm")
"""Override targets that concern the whole run, not an instance."""
VEHICLE = "vehicle"
"""Override target of the vehicle file, and prefix of its parameters."""
INPUTS = "inputs"
"""Prefix of override targets that set constants."""
TYRES = "tyres"
"""Override target of the tyre property files: of both axles, or `tyres.front`, `tyres.rear` of one."""
FAULTS = "faults"
"""Prefix of override targets that set the faults of a signal: `faults.sensor.yaw_rate`."""
SETTINGS = ("step_size", "validate")
"""Settings of an instance that are not parameters of its FMU."""
RESERVED = (VEHICLE, INPUTS, *FACTS, TYRES, FAULTS)
"""Names that no instance may have."""


@lru_cache(maxsize=4096)
def _expression(pattern: str) -> re.Pattern[str]:
    return re.compile("(.*)".join(map(re.escape, pattern.split("*"))), re.DOTALL)


def match(pattern: str, name: str) -> str | None:
    """Return the part of a name that the `*` of a pattern matches ("" without `*`), None without a match."""
    groups = _expression(pattern).fullmatch(name)
    return None if groups is None else "".join(groups.groups())


def matching(pattern: str, names: Collection[str]) -> dict[str, str]:
    """Return the names that match a pattern, as part matched by `*` -> name."""
    if "*" not in pattern:
        return {"": pattern} if pattern in names else {}
    return {part: name for name in names if (part := match(pattern, name)) is not None}


VARIABLE = r"(?:der\([^()]*\)|\[[^\[\]]*\]|[\w.*])+"
"""Regular expression of a signal's name, with or without its instance, within other text."""


class SignalName(NamedTuple):
    """The name of a variable of an instance; a pattern of such names may have `*`."""

    instance: str  # "" if the name has none
    variable: str

    @classmethod
    def parse(cls, text: str) -> SignalName:
        """Split a name at its first dot; without a dot, all of it is the variable."""
        instance, dot, variable = text.partition(".")
        return cls(instance, variable) if dot else cls("", text)

    @classmethod
    def parse_input(cls, pattern: str, instances: Collection[str]) -> SignalName:
        """Split a key of `inputs`, which is for all instances (`*`) unless it begins with the name of one."""
        name = cls.parse(pattern)
        return name if name.instance in instances else cls("*", pattern)

    def matches(self, instance: str, variable: str) -> bool:
        """Return whether this pattern matches a variable of an instance."""
        return match(self.instance, instance) is not None and match(self.variable, variable) is not None

    def __str__(self) -> str:
        return f"{self.instance}.{self.variable}" if self.instance else self.variable


def alike(output: str, name: str, symbols: Mapping[str, str]) -> int:
    """Return how many words the names of an output and of an input share: 0 if it should not be suggested.

    A reference value does not match an actual value.

    Args:
        output, name: the names.
        symbols: symbol -> the words that it stands for.
    """
    words = words_of(output, symbols), words_of(name, symbols)
    return len(words[0] & words[1]) if ("ref" in words[0]) == ("ref" in words[1]) else 0


def words_of(name: str, symbols: Mapping[str, str]) -> frozenset[str]:
    """Return the words of a signal's name, symbols translated: of `PsiDot` and `yaw_rate` yaw and rate.

    Words of up to two letters do not count.
    """
    words = [name, *re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", name)]
    translated = "_".join(symbols.get(word.lower(), word.lower()) for word in words)
    return frozenset(word for word in translated.split("_") if len(word) > 2)


TargetKind = Literal[
    "run", "fact", "vehicle_file", "vehicle_parameter", "tyres", "input", "faults", "fmu", "setting",
    "parameter",
]  # fmt: skip
"""Kind of the value that an override addresses."""
_PREFIXES: dict[str, TargetKind] = {
    VEHICLE: "vehicle_parameter", INPUTS: "input", TYRES: "tyres", FAULTS: "faults",
}  # fmt: skip


@dataclass(frozen=True)
class Target:
    """The target of an override.

    | text | kind | instance | variable |
    |---|---|---|---|
    | `stop_time` | run | | stop_time |
    | `friction` | fact | | friction |
    | `vehicle` | vehicle_file | | |
    | `vehicle.mass` | vehicle_parameter | | mass |
    | `tyres`, `tyres.front` | tyres | | the axle, if one |
    | `inputs.friction*` | input | | the pattern |
    | `faults.plant.yaw_rate` | faults | | the location |
    | `plant` | fmu | plant | |
    | `plant.step_size` | setting | plant | step_size |
    | `plant.mass` | parameter | plant | mass |
    """

    kind: TargetKind
    instance: str = ""
    variable: str = ""

    @classmethod
    def parse(cls, text: str) -> Target:
        """Parse a target.

        Raises:
            ValueError: a part of it is missing.
        """
        if text in OF_RUN:
            return cls("run", variable=text)
        if text in FACTS:
            return cls("fact", variable=text)
        if text in (VEHICLE, TYRES):
            return cls("vehicle_file" if text == VEHICLE else "tyres")
        holder, dot, name = text.partition(".")
        if not holder or (dot and not name):
            wanted = "instance.parameter, vehicle.parameter, inputs.pattern or an instance"
            raise ValueError(f"must be {wanted} (got {short(text)})")
        if dot and holder in _PREFIXES:
            return cls(_PREFIXES[holder], variable=name)
        return cls.of_instance(holder, name)

    @classmethod
    def of_instance(cls, instance: str, variable: str = "") -> Target:
        """Return the target of a parameter or setting of an instance, by default of its FMU."""
        if not variable:
            return cls("fmu", instance)
        return cls("setting" if variable in SETTINGS else "parameter", instance, variable)

    @property
    def is_time(self) -> bool:
        """Whether its value is a time [s]."""
        return self.kind in ("run", "setting") and self.variable in TIMES

    @property
    def names_file(self) -> bool:
        """Whether its value names a file: an FMU, a vehicle file or tyre property files."""
        return self.kind in ("fmu", "vehicle_file", "tyres")

    def __str__(self) -> str:
        holder = next((word for word, kind in _PREFIXES.items() if kind == self.kind), self.instance)
        if self.kind == "vehicle_file":
            holder = VEHICLE
        return ".".join(filter(None, (holder, self.variable)))
