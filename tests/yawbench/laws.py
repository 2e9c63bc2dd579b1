"""Laws in plain Python, for tests that run, export and set them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import yawbench as yb


def half(x):
    return 0.5 * x


def proportional(yaw_rate_ref, yaw_rate):
    return 20000 * (yaw_rate_ref - yaw_rate)


def powers(yaw_rate, count=3):
    return sum(10.0**k for k in range(count))


class Law:
    """Controller whose constructor derives a value from its argument; `bias` is an attribute of the class."""

    inputs = ("yaw_rate_ref", "yaw_rate")
    outputs = ("yaw_moment",)
    bias = 0.0

    def __init__(self, gain=2e4):
        self.gain = gain
        self.half = half(gain)

    def output(self, t, u):
        return 2 * self.half * (u.yaw_rate_ref - u.yaw_rate) + self.bias


class Derived(Law):
    """A law whose constructor derives something from an attribute of the class."""

    gain = 1e4

    def __init__(self, scale=1.0):
        self.scale, self.half = scale, half(scale * self.gain)


@dataclass
class Data:
    """A law of the yaw rate."""

    inputs = ("yaw_rate_ref", "yaw_rate")
    outputs = ("yaw_moment",)
    gain: float = yb.parameter(2e4, "N.m.s/rad", "Moment per yaw-rate error", minimum=0.0)
    kind: Literal["whole", "half"] = "whole"

    def __post_init__(self):
        self.half = half(self.gain)

    def start(self, t, u):
        self.integral = 0.0

    def advance(self, t, h, u):
        self.integral += h * (u.yaw_rate_ref - u.yaw_rate)

    def output(self, t, u):
        gain = 2 * self.half if self.kind == "whole" else self.half
        return gain * (u.yaw_rate_ref - u.yaw_rate) + 1e3 * self.integral
