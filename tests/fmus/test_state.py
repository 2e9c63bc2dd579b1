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
        self.fmu = fmu
        self.unit = Unit(fmu)
        inputs = fmu.names("input")
        source = random.Random(fmu.name)
        self.inputs = [plausible(inputs, source) for _ in range(30)]
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


some_units = pytest.mark.sampled(8)
"""The build compares saved and restored states and resets of every native unit with Python's, and
tests/components/test_conformance.py those with themselves."""


@some_units
@pytest.mark.parametrize("name", list(find_components()))
def test_steps_undone_and_repeated_give_the_same_bits(load, name):
    drive, other = Drive(load(name)), Drive(load(name))
    drive.run(0, 12)
    at_twelve = bits(drive.unit.outputs())
    saved = drive.unit.save()
    content = drive.unit.to_bytes(saved)
    expected = drive.run(12, 30)
    drive.unit.restore(saved)
    assert bits(drive.unit.outputs()) == at_twelve
    assert drive.run(12, 30) == expected
    drive.unit.restore(saved)  # a state may be restored more than once
    assert drive.run(12, 30) == expected
    other.unit.restore(other.unit.from_bytes(content))
    assert bits(other.unit.outputs()) == at_twelve
    assert other.run(12, 30) == expected
    drive.unit.forget(saved)
    drive.unit.free()
    other.unit.free()


@some_units
@pytest.mark.parametrize("name", list(find_components()))
def test_a_reset_unit_is_as_new(load, name):
    drive = Drive(load(name))
    expected = drive.run(0, 10)
    drive.unit.do("fmi2Reset")
    drive.unit.set(**drive.inputs[0])
    drive.unit.start()
    assert drive.run(0, 10) == expected
    drive.unit.free()


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
