"""A controller that fails where and how its parameters say."""

from __future__ import annotations

import sys
import threading
from dataclasses import dataclass

from yawbench.components.fmi.component import Component
from yawbench.components.fmi.variables import parameter

PLACES = ("nowhere", "configure", "start", "advance", "output")
WAYS = (
    "exception",
    "interrupt",
    "exit",
    "recursion",
    "surrogate",
    "unprintable",
    "none",
    "count",
    "nan",
    "text",
)


@dataclass(frozen=True)
class FailingParameters:
    """Place and kind of the failure."""

    where: str = parameter("nowhere", None, "Method that fails", choices=PLACES)
    how: str = parameter("exception", None, "How it fails", choices=WAYS)
    when: float = parameter(0.0, "s", "From when on it fails", minimum=0.0)
    unsavable: bool = parameter(False, None, "Keep something that cannot be saved")


class Unprintable(Exception):
    """An exception that cannot even be shown."""

    def __str__(self) -> str:
        raise ValueError("no text")


def fail(how: str) -> object:
    if how == "exception":
        raise ValueError("50 % of the wheels (100%s, %n) are in the Gräben: größer als 1 µm")
    if how == "interrupt":
        raise KeyboardInterrupt
    if how == "exit":
        sys.exit(3)
    if how == "recursion":
        return fail(how)
    if how == "surrogate":
        raise ValueError("half a character: \ud800, and a \0 in between")
    if how == "unprintable":
        raise Unprintable
    return {"none": None, "count": (1.0, 2.0), "nan": (float("nan"),), "text": ("far",)}[how]


class Failing(Component):
    """A controller that fails on purpose."""

    Parameters = FailingParameters
    inputs = ("yaw_rate",)
    outputs = ("yaw_moment",)
    sampled = True

    def configure(self):
        if self.p.unsavable:
            self.lock = threading.Lock()
        self._fail_in("configure")

    def start(self, t, u):
        self.steps = 0
        self._fail_in("start")

    def advance(self, t, h, u):
        self.steps += 1
        if t >= self.p.when:
            self._fail_in("advance")

    def output(self, t, u):
        if self.p.where == "output" and t > self.p.when:
            return fail(self.p.how)
        return (float(self.steps),)

    def _fail_in(self, place):
        if self.p.where == place:
            fail(self.p.how)
