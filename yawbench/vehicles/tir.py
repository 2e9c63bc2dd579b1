"""Reads tyre property files (`.tir`): the coefficients of MF-Tyre 5.2 (PAC2002), 6.1 or 6.2, in SI units.

A file declares its kind (FITTYP, else PROPERTY_FILE_FORMAT) and its units. Missing values are neutral:
scalings are one, other coefficients zero, so that no value of another tyre is used. Unusable files are
refused; unusual ones are read with a warning.

Files may have any line ends and any order of sections, in UTF-8, UTF-16 or cp1252. `$` and `!` begin a
comment. Tables (`{pen fz}`) are ignored, and so are lines without `=`: mostly the rest of a comment that an
editor has wrapped.
"""

from __future__ import annotations

import codecs
import hashlib
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from math import atan, inf, isfinite, nan, pi, prod, sin, tan
from pathlib import Path
from typing import Literal, NamedTuple

from yawbench.foundation.errors import Diagnostic, Location, ScenarioError, Severity
from yawbench.foundation.messages import listed, short
from yawbench.foundation.safe_files import TEXT, read_bytes, reads, reason
from yawbench.orchestrator.scenario.schema import PropertyFile

Side = Literal["LEFT", "RIGHT"]
SIDES: tuple[Side, ...] = ("LEFT", "RIGHT")

_LINE_END = re.compile(r"\r\n|\r|\n")
_ENTRY = re.compile(r"(?P<key>[A-Za-z]\w*)\s*=\s*(?P<value>'[^']*'?|\"[^\"]*\"?|[^$!]*)", re.ASCII)
_SECTION = re.compile(r"\[\s*([^\]]*?)\s*\]")


class TirEntry(NamedTuple):
    """A key with its value as text (None if empty); key and section are in upper case."""

    line: int
    section: str
    key: str
    text: str | None


def read_entries(raw: bytes) -> Iterator[TirEntry]:
    """Yield the entries of a file from top to bottom."""
    section = ""
    for number, line in enumerate(_LINE_END.split(_decoded(raw)), start=1):
        line = line.strip()
        if match := _SECTION.match(line):
            section = match[1].upper()
        elif match := _ENTRY.match(line):
            text = match["value"].strip().strip("'\"").strip()
            yield TirEntry(number, section, match["key"].upper(), text or None)


def _decoded(raw: bytes) -> str:
    if raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return raw.decode("utf-16", "replace")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        return raw.decode("cp1252", "replace")


KINDS = {
    5: "MF-Tyre 5",
    6: "MF-Tyre 5.2",
    21: "MF-Tyre 5.2",
    60: "MF-Tyre 6",
    61: "MF-Tyre 6.1",
    62: "MF-Tyre 6.2",
}
"""FITTYP -> model."""
FORMATS = {"PAC2002": 6, "MF52": 6, "MF_52": 6, "MF61": 61, "MF_61": 61, "MF62": 62, "MF_62": 62}
"""PROPERTY_FILE_FORMAT -> FITTYP, for files without FITTYP."""
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
"""Alternative spelling -> key."""
OF_SIX = {"LKYC": "LGAY", "LKZC": "LGAZ"}
"""Scaling of camber in sets of MF-Tyre 6 -> that of 5.2 in its place."""
NEEDED = ("FNOMIN", "PCX1", "PDX1", "PKX1", "PCY1", "PDY1", "PKY1", "PKY2")
"""Required keys: if they are missing or zero, there is no force."""

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


@dataclass(frozen=True)
class TyreFile(PropertyFile):
    """The content of a tyre property file; its parameters have names without axle, such as pcx1."""

    kind: str  # "MF-Tyre 6.2"
    side: Side
    rolling_radius: float | None
    """Effective rolling radius at nominal load [m], None if the file does not determine it."""

    def record(self) -> dict[str, object]:
        """Return its entry in the run record."""
        return {
            "file": str(self.path),
            "sha256": self.sha256,
            "kind": self.kind,
            "side": self.side,
            "warnings": list(map(str, self.warnings)),
        }


@reads("tyre property file", ScenarioError)
def read_tir(path: Path | str) -> TyreFile:
    """Read a tyre property file.

    Raises:
        ScenarioError: with all reasons why the file cannot be used.
    """
    path = Path(path)
    try:
        raw = read_bytes(path, largest=TEXT)
    except FileNotFoundError:
        raise ScenarioError(f"{path}: no such tyre property file", code="file-missing") from None
    except (OSError, ValueError) as error:
        raise ScenarioError(
            f"{path}: cannot read this tyre property file: {reason(error)}", code="file-unreadable"
        ) from None
    reading = _Reading(path)
    reading.take(read_entries(raw))
    file = reading.finish(hashlib.sha256(raw).hexdigest())
    if file is None:
        raise ScenarioError(reading.errors)
    return file


@dataclass
class _Reading:
    """State while a file is read."""

    path: Path
    entries: dict[str, TirEntry] = field(default_factory=dict)
    units: dict[str, TirEntry] = field(default_factory=dict)
    texts: dict[str, TirEntry] = field(default_factory=dict)
    values: dict[str, float] = field(default_factory=dict)
    errors: list[Diagnostic] = field(default_factory=list)
    warnings: list[Diagnostic] = field(default_factory=list)

    def take(self, entries: Iterable[TirEntry]) -> None:
        """Store the known entries; of a key that is given twice, the last."""
        for entry in entries:
            key = ALIASES.get(entry.key, entry.key)
            if entry.section == "UNITS":
                self.units[entry.key] = entry
            elif key in ("PROPERTY_FILE_FORMAT", "TYRESIDE"):
                self.texts[key] = entry
            elif key in READ and (entry.text is not None or key in NEEDED):
                if (before := self.entries.get(key)) is not None:
                    self._warn(entry, f"is given twice, first in line {before.line}; this one counts")
                self.entries[key] = entry

    def finish(self, sha256: str) -> TyreFile | None:
        """Return the file, None if there are errors."""
        if not self.entries:
            self._say(None, "not a tyre property file: it contains no coefficients", "error")
            return None
        kind = self._kind()
        factors = self._factors()
        for key, entry in self.entries.items():
            if key != "FITTYP" and (value := self._number(entry)) is not None:
                self.values[key] = value * factors(DIMENSIONS.get(key, {}))
        self._check_needed()
        if self.errors or kind is None:
            return None
        self._check_stiffness()
        side = self._side()
        self._remark(kind)
        values = self._complete(kind, side)
        if self.errors:
            return None
        warnings = tuple(self.warnings)
        return TyreFile(self.path, sha256, values, warnings, KINDS[kind], side, self._rolling_radius())

    # ---- the file's own description -----------------------------------------------------------------

    def _kind(self) -> int | None:
        form = self.texts.get("PROPERTY_FILE_FORMAT")
        name = (form.text or "").upper() if form else ""
        if form and name in OTHER_MODELS:
            self._refuse(form, f"{form.text} is another tyre model; supported: {_known()}")
            return None
        entry = self.entries.get("FITTYP")
        if entry is None or entry.text is None:
            if name in FORMATS:
                return FORMATS[name]
            self._say(None, f"FITTYP, the kind, is missing; supported: {_known()}", "error")
            return None
        value = self._number(entry)
        if value is None:
            return None
        if value in KINDS:
            return int(value)
        self._refuse(entry, f"{entry.text} is not a supported kind; supported: {_known()}")
        return None

    def _factors(self) -> Callable[[dict[str, int]], float]:
        """Return a function from powers of the file's units to the factor to SI."""
        factors = {}
        for name, known in UNITS.items():
            entry = self.units.get(name)
            if entry is None or entry.text is None:
                continue
            text = entry.text.lower()
            factor = known.get(text, known.get(text.removesuffix("s")))
            if factor is None:
                self._refuse(entry, f"{entry.text} is not a known unit of {name.lower()}")
            else:
                factors[name] = factor
        if "ANGLE" in factors and factors["ANGLE"] != 1.0:
            self._warn(
                self.units["ANGLE"], "degrees are taken for ranges only: coefficients are read as in radians"
            )
        return lambda powers: prod(factors.get(name, 1.0) ** power for name, power in powers.items())

    def _side(self) -> Side:
        entry = self.texts.get("TYRESIDE")
        for side in SIDES:
            if entry and (entry.text or "").upper() == side:
                return side
        if entry is None:
            self._say(None, "TYRESIDE is missing: read as LEFT", "warning")
        else:
            self._warn(entry, f"{entry.text or 'no value'}: read as LEFT")
        return "LEFT"

    # ---- impossible and unusual values ----------------------------------------------------------

    def _check_needed(self) -> None:
        for key in NEEDED:
            if key in self.entries and key not in self.values:
                continue  # has been reported
            value = self.values.get(key, 0.0)
            if value == 0.0 or (key == "FNOMIN" and value < 0.0):
                must = "must be above 0" if key == "FNOMIN" else "must not be 0"
                if key in self.entries:
                    self._refuse(self.entries[key], f"{must} (got {self.entries[key].text})")
                else:
                    self._say(None, f"{key} is missing", "error")

    def _check_stiffness(self) -> None:
        k_x = self._at("PKX1") * self._at("LKX", 1.0)
        k_y = (
            self._at("PKY1")
            * self._at("LKY", 1.0)
            * sin(self._at("PKY4", 2.0) * atan(1.0 / self._at("PKY2")))
        )
        if k_y >= 0.0:
            self._refuse(
                self.entries["PKY1"],
                "the cornering stiffness, with PKY2, PKY4 and LKY, is not negative at nominal load: "
                "a positive slip angle must give a negative lateral force",
            )
        if k_x <= 0.0:
            self._refuse(self.entries["PKX1"], "the slip stiffness must be positive at nominal load")

    def _remark(self, kind: int) -> None:
        if self._at("RBX1") == 0.0 and self._at("RBY1") == 0.0:
            self._say(None, "no combined slip: RBX1 and RBY1 are missing or zero", "warning")
        for low, high in (("KPUMIN", "KPUMAX"), ("ALPMIN", "ALPMAX")):
            least, most = self.values.get(low), self.values.get(high)
            if least is not None and most is not None and least * most >= 0.0 and least != most:
                self._warn(self.entries[high], f"with {low} = {least:g} a range of one side; no range limits")
        relaxation = ("LONGITUDINAL_STIFFNESS", "LATERAL_STIFFNESS") if kind >= 60 else ("PTX1", "PTY1")
        absent = [key for key in relaxation if self._at(key) == 0.0]
        if absent:
            self._say(None, f"no relaxation lengths: {listed(absent)} missing or zero", "warning")
        for key, instead in OF_SIX.items() if kind < 60 else ():
            if self._at(key, 1.0) != 1.0:
                self._warn(
                    self.entries[key], f"does nothing in sets of {KINDS[kind]}, where {instead} scales camber"
                )
        if self._at("LMUV") != 0.0:
            self._warn(self.entries["LMUV"], "friction that decays with speed is left out")
        if "UNLOADED_RADIUS" not in self.values:
            known = self._radius() is not None
            how = (
                "taken from RIM_RADIUS, WIDTH and ASPECT_RATIO" if known else "as the tyre has it by default"
            )
            self._say(None, f"UNLOADED_RADIUS is missing: {how}", "warning")

    # ---- values ---------------------------------------------------------------------------------------

    def _complete(self, kind: int, side: Side) -> dict[str, float]:
        """Return all parameters, with neutral values for missing ones."""
        values = {key: self._at(key, 1.0) for key in SCALINGS}
        values |= {key: self._at(key) for key in COEFFICIENTS}
        values["PKY4"] = self._at("PKY4", 2.0)
        values |= {"FITTYP": float(kind), "TYRESIDE": 1.0 if side == "LEFT" else -1.0}
        values["FNOMIN"] = self.values["FNOMIN"]
        if self._at("LFZO", 1.0) <= 0.0:
            self._refuse(self.entries["LFZO"], f"must be above 0 (got {self.entries['LFZO'].text})")
        pressure = self._at("NOMPRES") or self._at("INFLPRES")
        if pressure > 0.0:
            inflated = self._at("INFLPRES") or pressure
            if not 0.1 < inflated / pressure < 10.0:
                self._refuse(self.entries["INFLPRES"], "must be in the unit of NOMPRES, and of its size")
            values |= {"NOMPRES": pressure, "INFLPRES": inflated}
        values["FZMAX"] = self._largest_load(values)
        radius = self._at("UNLOADED_RADIUS") or self._radius()
        if radius:
            values["UNLOADED_RADIUS"] = radius
        values |= {key: self._at(key) for key in ("LONGITUDINAL_STIFFNESS", "LATERAL_STIFFNESS")}
        return {key.lower(): value for key, value in values.items()}

    def _largest_load(self, values: dict[str, float]) -> float:
        """Return FZMAX, by default three times the nominal load, or less if a stiffness vanishes below."""
        load = values["FNOMIN"] * values["LFZO"]
        turn, bend = abs(values["PKY4"]), abs(values["PKY2"])
        sound = load * bend * tan(pi / turn) if turn > 2.0 else inf
        if values["PKX2"] * values["PKX1"] < 0.0:
            sound = min(sound, load * (1.0 - values["PKX1"] / values["PKX2"]))
        stated = self._at("FZMAX")
        if stated <= 0.0:
            return min(3.0 * load, 0.9 * sound)
        if stated > sound:
            self._warn(self.entries["FZMAX"], f"above {sound:.0f} N a stiffness has changed its sign")
        return stated

    def _radius(self) -> float | None:
        rim, width, ratio = (self._at(key) for key in ("RIM_RADIUS", "WIDTH", "ASPECT_RATIO"))
        return rim + width * ratio if min(rim, width, ratio) > 0.0 else None

    def _rolling_radius(self) -> float | None:
        """Return the effective rolling radius at nominal load: R_0 less (D atan(B) + F) F_z0 / C_z."""
        radius, stiffness = self._at("UNLOADED_RADIUS"), self._at("VERTICAL_STIFFNESS")
        b, d, f = (self._at(key) for key in ("BREFF", "DREFF", "FREFF"))
        if not (radius > 0.0 and stiffness > 0.0 and (d or f)):
            return None
        return radius * self._at("Q_RE0", 1.0) - self.values["FNOMIN"] / stiffness * (d * atan(b) + f)

    def _at(self, key: str, default: float = 0.0) -> float:
        return self.values.get(key, default)

    def _number(self, entry: TirEntry) -> float | None:
        """Return the number of an entry; if it is not a number, report an error and return None."""
        try:
            value = float((entry.text or "").upper().replace("D", "E"))
        except ValueError:
            value = nan
        if isfinite(value):
            return value
        self._refuse(entry, f"must be a number (got {short(entry.text)})")
        return None

    def _refuse(self, entry: TirEntry, sentence: str) -> None:
        self._say(entry, sentence, "error")

    def _warn(self, entry: TirEntry, sentence: str) -> None:
        self._say(entry, sentence, "warning")

    def _say(self, entry: TirEntry | None, sentence: str, severity: Severity) -> None:
        where = Location(self.path, entry.line, entry.key) if entry else Location(self.path)
        code = "tyre-file-invalid" if severity == "error" else "tyre-file-unusual"
        into = self.errors if severity == "error" else self.warnings
        into.append(Diagnostic(code, sentence, severity, where))


def _known() -> str:
    return listed([f"{number} ({name})" for number, name in KINDS.items()])
