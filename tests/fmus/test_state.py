"""A step undone and repeated gives the same bits, whatever the unit keeps to itself."""

from __future__ import annotations

import ctypes
import random
import struct

import pytest

from tests.fmus.bare import Unit
from tests.fmus.plausible import plausible
from yawbench.fmus.build import find_components


def bits(values):
    return struct.pack(f"{len(values)}d", *values)


class Drive:
    """A unit driven by the same random inputs however often it is asked."""

    def __init__(self, fmu):
        self.unit = Unit(fmu)
        source = random.Random(fmu.name)
        self.inputs = [plausible(fmu.names("input"), source) for _ in range(30)]
        self.begin()

    def begin(self):
        self.unit.set(**self.inputs[0])
        self.unit.start()

    def run(self, first, last):
        """Take the steps first to last - 1 of 2 ms and return all outputs on the way."""
        rows = []
        for k in range(first, last):
            self.unit.set(**self.inputs[k])
            self.unit.step(0.002 * k, 0.002)
            rows.append(bits(self.unit.outputs()))
        return rows


@pytest.mark.sampled(4)
@pytest.mark.parametrize("name", list(find_components()))
def test_steps_undone_and_repeated_and_those_after_a_reset_give_the_same_bits(load, name):
    """The build compares saved and restored states and resets of every native unit with Python's, and
    tests/components/test_conformance.py those with themselves."""
    drive, other = Drive(load(name)), Drive(load(name))
    before = drive.run(0, 12)
    at_twelve = bits(drive.unit.outputs())
    saved = drive.unit.save()
    content = drive.unit.to_bytes(saved)
    expected = drive.run(12, 30)
    for _ in range(2):  # a state may be restored more than once
        drive.unit.restore(saved)
        assert bits(drive.unit.outputs()) == at_twelve
        assert drive.run(12, 30) == expected
    other.unit.restore(other.unit.from_bytes(content))
    assert bits(other.unit.outputs()) == at_twelve
    assert other.run(12, 30) == expected
    drive.unit.do("fmi2Reset")
    drive.begin()
    assert drive.run(0, 12) == before
    drive.unit.forget(saved)
    drive.unit.free()
    other.unit.free()


def test_saving_into_the_same_place_again_frees_what_was_there(load):
    unit = Unit(load("driver_sine"))
    unit.start()
    state = unit.save()
    unit.step(0.0)
    unit.do("fmi2GetFMUstate", ctypes.byref(state))
    unit.forget(state)
    unit.do("fmi2FreeFMUstate", ctypes.byref(ctypes.c_void_p()))
    unit.save()  # freed with the instance
    unit.free()
