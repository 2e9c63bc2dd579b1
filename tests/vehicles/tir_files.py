"""A tyre property file, written for tests from the coefficients of the second implementation's test."""

from __future__ import annotations

UNITS = {"LENGTH": "'meter'", "FORCE": "'newton'", "ANGLE": "'radians'", "MASS": "'kg'", "TIME": "'second'"}
HEAD = {"FITTYP": "62", "TYRESIDE": "'LEFT'"}
REST = {
    **{"FNOMIN": "4000", "UNLOADED_RADIUS": "0.313", "VERTICAL_STIFFNESS": "210000"},
    **{"NOMPRES": "220000", "INFLPRES": "230000", "FZMIN": "100", "FZMAX": "9000"},
    **{"KPUMIN": "-1", "KPUMAX": "1", "ALPMIN": "-0.26", "ALPMAX": "0.26"},
    **{"BREFF": "8.4", "DREFF": "0.27", "FREFF": "0.07"},
    **{"LONGITUDINAL_STIFFNESS": "358000", "LATERAL_STIFFNESS": "102700"},
    **{"PCX1": "1.6", "PDX1": "1.1", "PDX2": "-0.04", "PKX1": "20.5", "PKX2": "-0.2", "PEX1": "0.3"},
    **{"RBX1": "12.0", "RBX2": "-10.0", "RCX1": "1.1"},
    **{"PCY1": "1.2", "PDY1": "-0.95", "PDY2": "0.15", "PKY1": "-15.0", "PKY2": "2.1", "PKY4": "2.0"},
    **{"PKY6": "-0.9", "PVY1": "0.04", "PPY1": "-0.4", "LMUY": "0.98"},
    **{"RBY1": "6.5", "RBY2": "4.2", "RCY1": "1.08", "QCZ1": "1.2", "QDZ1": "0.1", "QBZ1": "9.0"},
}


def text_of(changed=None, *, without=(), units=None, more=""):
    """Return a file of MF-Tyre 6.2 with other values for some keys, and without some."""
    given = HEAD | REST | (changed or {})
    lines = ["[MDI_HEADER]", "FILE_TYPE ='tir'", "$ a comment", "[UNITS]"]
    lines += [f"{key} = {value}" for key, value in (UNITS if units is None else units).items()]
    lines += [
        "[MODEL]",
        *(f"{key:<24}= {value}  $ what it is" for key, value in given.items() if key not in without),
    ]
    return "\n".join([*lines, more, ""])


def write(path, *arguments, **options):
    path.write_text(text_of(*arguments, **options), encoding="utf-8")
    return path
