"""A controller that logs whatever may go wrong in a log."""

from __future__ import annotations

from yawbench.components.fmi.component import Component


class Talking(Component):
    """A controller that warns, notes and reports."""

    outputs = ("yaw_moment",)
    sampled = True

    def start(self, t, u):
        self.log(42)
        self.log("100 %s of nothing")
        self.log("a \ud800 and a \0")
        self.warn("grip is 5 % short")

    def output(self, t, u):
        return (0.0,)
