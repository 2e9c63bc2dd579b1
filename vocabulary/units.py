"""Units of measurement of variables, with their SI base exponents, and displayed units.

FMI 2.0.4, section 2.2.2: a unit is a product of powers of kg, m, s, A, K, mol, cd and rad.
Only the spellings below are accepted, so that a typo in a unit is found when the class is created, not when
a wire is checked.
"""

import math

UNITS: dict[str, dict[str, int]] = {
    "1": {},
    "s": {"s": 1},
    "1/s": {"s": -1},
    "m": {"m": 1},
    "1/m": {"m": -1},
    "m/s": {"m": 1, "s": -1},
    "m/s2": {"m": 1, "s": -2},
    "m/s3": {"m": 1, "s": -3},
    "m2": {"m": 2},
    "m3": {"m": 3},
    "m3/s": {"m": 3, "s": -1},
    "rad": {"rad": 1},
    "1/rad": {"rad": -1},
    "s/rad": {"s": 1, "rad": -1},
    "s2/rad": {"s": 2, "rad": -1},
    "rad/s": {"rad": 1, "s": -1},
    "rad/s2": {"rad": 1, "s": -2},
    "rad/s3": {"rad": 1, "s": -3},
    "Hz": {"s": -1},
    "kg": {"kg": 1},
    "kg.m2": {"kg": 1, "m": 2},
    "kg/m3": {"kg": 1, "m": -3},
    "N": {"kg": 1, "m": 1, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2},
    "N/s": {"kg": 1, "m": 1, "s": -3},
    "N.m": {"kg": 1, "m": 2, "s": -2},
    "N.m/s": {"kg": 1, "m": 2, "s": -3},
    "N/rad": {"kg": 1, "m": 1, "s": -2, "rad": -1},
    "N/m": {"kg": 1, "s": -2},
    "N.s/m": {"kg": 1, "s": -1},
    "N.m/rad": {"kg": 1, "m": 2, "s": -2, "rad": -1},
    "N.m.s": {"kg": 1, "m": 2, "s": -1},
    "N.m.s/rad": {"kg": 1, "m": 2, "s": -1, "rad": -1},
    "N.m.s2/rad": {"kg": 1, "m": 2, "rad": -1},
    "N.m/(rad.s)": {"kg": 1, "m": 2, "s": -3, "rad": -1},
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "Pa/s": {"kg": 1, "m": -1, "s": -3},
}

SHOWN: dict[str, tuple[str, float]] = {
    "rad": ("°", 180 / math.pi),
    "rad/s": ("°/s", 180 / math.pi),
    "rad/s2": ("°/s²", 180 / math.pi),
    "rad/s3": ("°/s³", 180 / math.pi),
    "m/s": ("km/h", 3.6),
    "m/s2": ("m/s²", 1.0),
    "m/s3": ("m/s³", 1.0),
    "N.m": ("N·m", 1.0),
    "N.m/s": ("kN·m/s", 1e-3),
    "N.m.s": ("N·m·s", 1.0),
    "Pa": ("bar", 1e-5),
    "Pa/s": ("bar/s", 1e-5),
    "1": ("", 1.0),
    "%": ("%", 100.0),
}
"""Unit -> displayed unit and conversion factor; `%` marks a ratio in per cent."""

DISPLAYED: dict[str, tuple[str, float]] = {
    "rad": ("deg", 180 / math.pi),
    "rad/s": ("deg/s", 180 / math.pi),
    "rad/s2": ("deg/s2", 180 / math.pi),
    "m/s": ("km/h", 3.6),
    "Pa": ("bar", 1e-5),
}
"""Unit -> displayed unit and conversion factor in model descriptions, whose readers may know ASCII only."""
