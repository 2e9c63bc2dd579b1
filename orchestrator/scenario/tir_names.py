"""What stands in tyre property files: kinds, coefficients, units, and the spellings that are met."""

from __future__ import annotations

from math import pi

KINDS = {
    5: "MF-Tyre 5",
    6: "MF-Tyre 5.2",
    21: "MF-Tyre 5.2",
    60: "MF-Tyre 6",
    61: "MF-Tyre 6.1",
    62: "MF-Tyre 6.2",
}
"""FITTYP -> what it means."""
FORMATS = {"PAC2002": 6, "MF52": 6, "MF_52": 6, "MF61": 61, "MF_61": 61, "MF62": 62, "MF_62": 62}
"""PROPERTY_FILE_FORMAT -> the FITTYP that it means where the file has none."""
OTHER_MODELS = (
    *("PAC89", "PAC94", "PAC96", "PAC_MC", "PAC-MC", "PAC_TIME", "PAC-TIME", "PAC_CT", "PAC-CT"),
    *("FIALA", "FTIRE", "UATIRE", "521_TIRE", "5.2.1"),
)
"""PROPERTY_FILE_FORMAT of models with other equations."""

SCALINGS = (  # noqa: SIM905 - names read better as lines of text
    "LFZO LCX LMUX LEX LKX LHX LVX LGAX LXAL LCY LMUY LEY LKY LHY LVY LGAY LKYC LYKA LVYKA LTR LRES LGAZ "
    "LKZC LS LMX LVMX LSGKP LSGAL"
).split()
COEFFICIENTS = (  # noqa: SIM905
    "PCX1 PDX1 PDX2 PDX3 PEX1 PEX2 PEX3 PEX4 PKX1 PKX2 PKX3 PHX1 PHX2 PVX1 PVX2 PPX1 PPX2 PPX3 PPX4 "
    "RBX1 RBX2 RBX3 RCX1 REX1 REX2 RHX1 "
    "PCY1 PDY1 PDY2 PDY3 PEY1 PEY2 PEY3 PEY4 PEY5 PKY1 PKY2 PKY3 PKY4 PKY5 PKY6 PKY7 PHY1 PHY2 PHY3 "
    "PVY1 PVY2 PVY3 PVY4 PPY1 PPY2 PPY3 PPY4 PPY5 "
    "RBY1 RBY2 RBY3 RBY4 RCY1 REY1 REY2 RHY1 RHY2 RVY1 RVY2 RVY3 RVY4 RVY5 RVY6 "
    "QBZ1 QBZ2 QBZ3 QBZ4 QBZ5 QBZ9 QBZ10 QCZ1 QDZ1 QDZ2 QDZ3 QDZ4 QDZ6 QDZ7 QDZ8 QDZ9 QDZ10 QDZ11 "
    "QEZ1 QEZ2 QEZ3 QEZ4 QEZ5 QHZ1 QHZ2 QHZ3 QHZ4 PPZ1 PPZ2 SSZ1 SSZ2 SSZ3 SSZ4 "
    "QSX1 QSX2 QSX3 QSX4 QSX5 QSX6 QSX7 QSX8 QSX9 QSX10 QSX11 QSX12 QSX13 QSX14 PPMX1 "
    "PCFX1 PCFX2 PCFX3 PCFY1 PCFY2 PCFY3 PTX1 PTX2 PTX3 PTY1 PTY2"
).split()
LENGTHS = ("UNLOADED_RADIUS", "RIM_RADIUS", "WIDTH")
STIFFNESSES = ("LONGITUDINAL_STIFFNESS", "LATERAL_STIFFNESS", "VERTICAL_STIFFNESS")
DIMENSIONS = {
    **{key: {"LENGTH": 1} for key in LENGTHS},
    **{key: {"FORCE": 1} for key in ("FNOMIN", "FZMAX")},
    **{key: {"PRESSURE": 1} for key in ("NOMPRES", "INFLPRES")},
    **{key: {"FORCE": 1, "LENGTH": -1} for key in STIFFNESSES},
    **{key: {"ANGLE": 1} for key in ("ALPMIN", "ALPMAX")},
}
"""Values with a dimension -> powers of the file's units."""
PLAIN = ("FITTYP", "KPUMIN", "KPUMAX", "ASPECT_RATIO", "BREFF", "DREFF", "FREFF", "Q_RE0", "LMUV")
READ = frozenset((*SCALINGS, *COEFFICIENTS, *DIMENSIONS, *PLAIN))
ALIASES = {
    **{"LFZ0": "LFZO", "LKYG": "LKYC", "LKG": "LKYC", "QPMX1": "PPMX1", "QPZ1": "PPZ1"},
    **{"IP_NOM": "NOMPRES", "IP": "INFLPRES"},
}
"""Other spellings that are met."""
NEEDED = ("FNOMIN", "PCX1", "PDX1", "PKX1", "PCY1", "PDY1", "PKY1", "PKY2")
"""Without these, or with zero, there is no force."""

UNITS = {
    "LENGTH": {
        **dict.fromkeys(("m", "meter", "metre"), 1.0),
        **dict.fromkeys(("mm", "millimeter", "millimetre"), 1e-3),
        **dict.fromkeys(("cm", "centimeter", "centimetre"), 1e-2),
        **dict.fromkeys(("in", "inch", "inche"), 0.0254),
        **dict.fromkeys(("ft", "foot", "feet"), 0.3048),
    },
    "FORCE": {
        **dict.fromkeys(("n", "newton"), 1.0),
        **dict.fromkeys(("kn", "knewton", "kilonewton"), 1e3),
        **dict.fromkeys(("kgf", "kg_force", "kilogram_force"), 9.80665),
        **dict.fromkeys(("lbf", "pound_force"), 4.4482216152605),
    },
    "ANGLE": {
        **dict.fromkeys(("rad", "radian"), 1.0),
        **dict.fromkeys(("deg", "degree"), pi / 180.0),
    },
    "PRESSURE": {
        **dict.fromkeys(("pa", "pascal"), 1.0),
        **dict.fromkeys(("kpa", "kpascal", "kilopascal"), 1e3),
        **dict.fromkeys(("mpa", "megapascal"), 1e6),
        "bar": 1e5,
        "psi": 6894.757293168,
    },
}
"""Dimension -> unit in lower case, without a plural's s -> factor to SI."""
