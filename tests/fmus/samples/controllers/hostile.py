"""A controller that goes round the base class and lets exceptions out."""

from __future__ import annotations

from yawbench.components.fmi.component import Component


class Hostile(Component):
    """A controller that lets exceptions out."""

    outputs = ("yaw_moment",)
    sampled = True

    def output(self, t, u):
        return (1.0,)

    def do_step(self, current_time, step_size):
        raise RuntimeError("100 % hostile")
