"""Coefficients of a tyre property file as parameters, for the front and the rear axle.

Names are those of the file in lower case with the axle as suffix: PCX1 (p_Cx1 of the book) is pcx1_front and
pcx1_rear. A parameter that is not set keeps its default, so the reader of a file sets all of them.

Defaults: H. B. Pacejka, Tyre and Vehicle Dynamics, 3rd ed. 2012, table A3.1, 205/60R15 91V at 2.2 bar.
Coefficients that the table does not list are zero, scaling factors are 1.

Omitted: turn slip (PDXP*, PKYP*, PDYP*, PHYP*, PECP*, QDTP1, QCRP*, QBRP1, QDRP*), the moment M_y of rolling
resistance (QSY*: plants have their own), the decay of friction with speed (LMUV), and ranges except FZMAX.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

from ..fmi.variables import parameter, parameter_class

_BOOK = "Pacejka 2012, table A3.1"


class _Row(NamedTuple):
    default: float
    text: str
    source: str
    unit: str = "1"
    minimum: float | None = None
    maximum: float | None = None

    def declared(self, text: str) -> Any:
        """Declare the coefficient as a parameter with a description."""
        return parameter(
            self.default, self.unit, text, self.source, minimum=self.minimum, maximum=self.maximum
        )


def _scale(of: str) -> _Row:
    return _Row(1.0, f"Scaling of {of}", "chosen: the set as measured")


COMMON = {
    "tyreside": _Row(
        1.0,
        "Side of the car for which the set is valid: 1 left, -1 right; the other side is mirrored",
        "chosen: left",
        minimum=-1.0,
        maximum=1.0,
    ),
    "fnomin": _Row(4000.0, "Nominal load F_z0", _BOOK, "N", 1.0),
    "fzmax": _Row(
        12000.0,
        "Load above which forces are proportional to load, with constant coefficients",
        "chosen: three times nominal",
        "N",
        1.0,
    ),
    "nompres": _Row(220000.0, "Nominal inflation pressure p_i0", _BOOK, "Pa", 1e-3),
    "inflpres": _Row(220000.0, "Inflation pressure p_i", _BOOK, "Pa", 1e-3),
    "lfzo": _Row(1.0, "Scaling of the nominal load", "chosen: the set as measured", "1", 0.01),
}
"""Parameters used in all forces and moments."""

LONGITUDINAL = {
    "lcx": _scale("the shape factor C of F_x"),
    "lmux": _scale("the friction mu_x"),
    "lex": _scale("the curvature E of F_x"),
    "lkx": _scale("the slip stiffness K_x"),
    "lhx": _scale("the horizontal shift of F_x"),
    "lvx": _scale("the vertical shift of F_x"),
    "lgax": _scale("camber in F_x (5.2)"),
    "lxal": _scale("the reduction of F_x by slip angle"),
    "pcx1": _Row(1.685, "Shape factor C of F_x", _BOOK, "1", 0.01),
    "pdx1": _Row(1.210, "Friction mu_x at nominal load", _BOOK),
    "pdx2": _Row(-0.037, "Variation of mu_x with load", _BOOK),
    "pdx3": _Row(0.0, "Variation of mu_x with camber squared", _BOOK),
    "pex1": _Row(0.344, "Curvature E of F_x at nominal load", _BOOK),
    "pex2": _Row(0.095, "Variation of E of F_x with load", _BOOK),
    "pex3": _Row(-0.020, "Variation of E of F_x with load squared", _BOOK),
    "pex4": _Row(0.0, "Difference of E of F_x between driving and braking", _BOOK),
    "pkx1": _Row(21.51, "Slip stiffness K_x / F_z at nominal load", _BOOK),
    "pkx2": _Row(-0.163, "Variation of K_x / F_z with load", _BOOK),
    "pkx3": _Row(0.245, "Exponent of K_x / F_z with load", _BOOK),
    "phx1": _Row(-0.002, "Horizontal shift of F_x at nominal load", _BOOK),
    "phx2": _Row(0.002, "Variation of the horizontal shift of F_x with load", _BOOK),
    "pvx1": _Row(0.0, "Vertical shift of F_x / F_z at nominal load", _BOOK),
    "pvx2": _Row(0.0, "Variation of the vertical shift of F_x / F_z with load", _BOOK),
    "ppx1": _Row(0.0, "Variation of K_x with pressure", "chosen: not known of this tyre"),
    "ppx2": _Row(0.0, "Variation of K_x with pressure squared", "chosen: likewise"),
    "ppx3": _Row(0.0, "Variation of mu_x with pressure", "chosen: likewise"),
    "ppx4": _Row(0.0, "Variation of mu_x with pressure squared", "chosen: likewise"),
    "rbx1": _Row(12.35, "Slope of the reduction of F_x by slip angle", _BOOK),
    "rbx2": _Row(-10.77, "Variation of that slope with kappa", _BOOK),
    "rbx3": _Row(0.0, "Variation of that slope with camber squared", _BOOK),
    "rcx1": _Row(1.092, "Shape factor of the reduction of F_x by slip angle", _BOOK),
    "rex1": _Row(0.0, "Curvature of the reduction of F_x by slip angle", _BOOK),
    "rex2": _Row(0.0, "Variation of that curvature with load", _BOOK),
    "rhx1": _Row(0.007, "Shift of the reduction of F_x by slip angle", _BOOK),
}
"""Further parameters of F_x."""

REST = {
    "fittyp": _Row(62.0, "Kind of the set: 5 to 52 MF-Tyre 5.2 (PAC2002), 60 to 62 MF-Tyre 6", "chosen: 6.2"),
    "unloaded_radius": _Row(0.313, "Unloaded radius R_0", _BOOK, "m", 0.01),
    "lcy": _scale("the shape factor C of F_y"),
    "lmuy": _scale("the friction mu_y"),
    "ley": _scale("the curvature E of F_y"),
    "lky": _scale("the cornering stiffness K_y"),
    "lhy": _scale("the horizontal shift of F_y"),
    "lvy": _scale("the vertical shift of F_y"),
    "lgay": _scale("camber in F_y (5.2)"),
    "lkyc": _scale("the camber stiffness (6)"),
    "lyka": _scale("the reduction of F_y by kappa"),
    "lvyka": _scale("the side force induced by kappa"),
    "pcy1": _Row(1.193, "Shape factor C of F_y", _BOOK, "1", 0.01),
    "pdy1": _Row(-0.990, "Friction mu_y at nominal load", _BOOK),
    "pdy2": _Row(0.145, "Variation of mu_y with load", _BOOK),
    "pdy3": _Row(-11.23, "Variation of mu_y with camber squared", _BOOK),
    "pey1": _Row(-1.003, "Curvature E of F_y at nominal load", _BOOK),
    "pey2": _Row(-0.537, "Variation of E of F_y with load", _BOOK),
    "pey3": _Row(-0.083, "Difference of E of F_y between left and right", _BOOK),
    "pey4": _Row(-4.787, "Variation of that difference with camber", _BOOK),
    "pey5": _Row(0.0, "Variation of E of F_y with camber squared", _BOOK),
    "pky1": _Row(-14.95, "Largest cornering stiffness K_y / F_z0", _BOOK),
    "pky2": _Row(2.130, "Load over nominal load at which K_y is largest", _BOOK),
    "pky3": _Row(-0.028, "Variation of K_y with camber", _BOOK),
    "pky4": _Row(2.0, "Shape of K_y over load", _BOOK),
    "pky5": _Row(0.0, "Variation of pky2 with camber squared", _BOOK),
    "pky6": _Row(-0.92, "Camber stiffness / F_z at nominal load", _BOOK),
    "pky7": _Row(-0.24, "Variation of the camber stiffness with load", _BOOK),
    "phy1": _Row(0.003, "Horizontal shift of F_y at nominal load", _BOOK),
    "phy2": _Row(-0.001, "Variation of the horizontal shift of F_y with load", _BOOK),
    "phy3": _Row(0.0, "Variation of the horizontal shift of F_y with camber (5.2)", "chosen: a set of 6.2"),
    "pvy1": _Row(0.045, "Vertical shift of F_y / F_z at nominal load", _BOOK),
    "pvy2": _Row(-0.024, "Variation of the vertical shift of F_y / F_z with load", _BOOK),
    "pvy3": _Row(-0.532, "Variation of the vertical shift of F_y / F_z with camber", _BOOK),
    "pvy4": _Row(0.039, "Variation of that with load", _BOOK),
    "ppy1": _Row(0.0, "Variation of K_y with pressure", "chosen: not known of this tyre"),
    "ppy2": _Row(0.0, "Variation of pky2 with pressure", "chosen: likewise"),
    "ppy3": _Row(0.0, "Variation of mu_y with pressure", "chosen: likewise"),
    "ppy4": _Row(0.0, "Variation of mu_y with pressure squared", "chosen: likewise"),
    "ppy5": _Row(0.0, "Variation of the camber stiffness with pressure", "chosen: likewise"),
    "rby1": _Row(6.461, "Slope of the reduction of F_y by kappa", _BOOK),
    "rby2": _Row(4.196, "Variation of that slope with slip angle", _BOOK),
    "rby3": _Row(-0.015, "Shift of the slip angle in rby2", _BOOK),
    "rby4": _Row(0.0, "Variation of that slope with camber squared", _BOOK),
    "rcy1": _Row(1.081, "Shape factor of the reduction of F_y by kappa", _BOOK),
    "rey1": _Row(0.0, "Curvature of the reduction of F_y by kappa", _BOOK),
    "rey2": _Row(0.0, "Variation of that curvature with load", _BOOK),
    "rhy1": _Row(0.009, "Shift of the reduction of F_y by kappa", _BOOK),
    "rhy2": _Row(0.0, "Variation of that shift with load", _BOOK),
    "rvy1": _Row(0.053, "Side force induced by kappa, over mu_y F_z, at nominal load", _BOOK),
    "rvy2": _Row(-0.073, "Variation of the side force induced by kappa with load", _BOOK),
    "rvy3": _Row(0.517, "Variation of the side force induced by kappa with camber", _BOOK),
    "rvy4": _Row(35.44, "Decay of the side force induced by kappa with slip angle", _BOOK),
    "rvy5": _Row(1.9, "Shape of the side force induced by kappa", _BOOK),
    "rvy6": _Row(-10.71, "Slope of the side force induced by kappa", _BOOK),
    "ltr": _scale("the pneumatic trail"),
    "lres": _scale("the residual moment"),
    "lgaz": _scale("camber in M_z (5.2)"),
    "lkzc": _scale("camber in the residual moment (6)"),
    "ls": _scale("the lever arm of F_x"),
    "qbz1": _Row(8.964, "Slope of the trail at nominal load", _BOOK),
    "qbz2": _Row(-1.106, "Variation of the slope of the trail with load", _BOOK),
    "qbz3": _Row(-0.842, "Variation of the slope of the trail with load squared", _BOOK),
    "qbz4": _Row(0.0, "Variation of the slope of the trail with camber", _BOOK),
    "qbz5": _Row(-0.227, "Variation of the slope of the trail with the size of camber", _BOOK),
    "qbz9": _Row(18.47, "Slope of the residual moment", _BOOK),
    "qbz10": _Row(0.0, "Slope of the residual moment with B C of F_y", _BOOK),
    "qcz1": _Row(1.180, "Shape factor of the trail", _BOOK),
    "qdz1": _Row(0.100, "Largest trail over R_0 at nominal load", _BOOK),
    "qdz2": _Row(-0.001, "Variation of the largest trail with load", _BOOK),
    "qdz3": _Row(0.007, "Variation of the largest trail with camber", _BOOK),
    "qdz4": _Row(13.05, "Variation of the largest trail with camber squared", _BOOK),
    "qdz6": _Row(-0.008, "Largest residual moment over F_z R_0", _BOOK),
    "qdz7": _Row(0.0, "Variation of the residual moment with load", _BOOK),
    "qdz8": _Row(-0.296, "Variation of the residual moment with camber", _BOOK),
    "qdz9": _Row(-0.009, "Variation of that with load", _BOOK),
    "qdz10": _Row(0.0, "Variation of the residual moment with camber times its size", _BOOK),
    "qdz11": _Row(0.0, "Variation of that with load", _BOOK),
    "qez1": _Row(-1.609, "Curvature of the trail at nominal load", _BOOK),
    "qez2": _Row(-0.359, "Variation of the curvature of the trail with load", _BOOK),
    "qez3": _Row(0.0, "Variation of the curvature of the trail with load squared", _BOOK),
    "qez4": _Row(0.174, "Difference of the curvature of the trail between left and right", _BOOK),
    "qez5": _Row(-0.896, "Variation of that difference with camber", _BOOK),
    "qhz1": _Row(0.007, "Horizontal shift of the trail at nominal load", _BOOK),
    "qhz2": _Row(-0.002, "Variation of the horizontal shift of the trail with load", _BOOK),
    "qhz3": _Row(0.147, "Variation of the horizontal shift of the trail with camber", _BOOK),
    "qhz4": _Row(0.004, "Variation of that with load", _BOOK),
    "ppz1": _Row(0.0, "Variation of the trail with pressure", "chosen: not known of this tyre"),
    "ppz2": _Row(0.0, "Variation of the residual moment with pressure", "chosen: likewise"),
    "ssz1": _Row(0.043, "Lever arm of F_x over R_0", _BOOK),
    "ssz2": _Row(0.001, "Variation of the lever arm of F_x with F_y / F_z0", _BOOK),
    "ssz3": _Row(0.731, "Variation of the lever arm of F_x with camber", _BOOK),
    "ssz4": _Row(-0.238, "Variation of that with load", _BOOK),
    "lmx": _scale("the overturning moment"),
    "lvmx": _scale("its shift"),
    "qsx1": _Row(0.0, "Shift of the overturning moment over F_z R_0", "chosen: not known of this tyre"),
    "qsx2": _Row(0.0, "Overturning moment by camber", "chosen: likewise"),
    "qsx3": _Row(0.0, "Overturning moment by F_y", "chosen: likewise"),
    "qsx4": _Row(0.0, "Peak of its part with the sine", "chosen: likewise"),
    "qsx5": _Row(0.0, "Shape of that part over load", "chosen: likewise"),
    "qsx6": _Row(0.0, "Slope of that part over load", "chosen: likewise"),
    "qsx7": _Row(0.0, "Camber in that part", "chosen: likewise"),
    "qsx8": _Row(0.0, "Size of F_y in that part", "chosen: likewise"),
    "qsx9": _Row(0.0, "Slope of F_y in that part", "chosen: likewise"),
    "qsx10": _Row(0.0, "Overturning moment by camber and load", "chosen: likewise"),
    "qsx11": _Row(0.0, "Slope over load of that part", "chosen: likewise"),
    "qsx12": _Row(0.0, "Overturning moment by camber times its size", "chosen: likewise"),
    "qsx13": _Row(0.0, "Overturning moment by F_y, without load", "chosen: likewise"),
    "qsx14": _Row(0.0, "Variation of that with the size of camber", "chosen: likewise"),
    "ppmx1": _Row(0.0, "Variation of qsx2 with pressure", "chosen: likewise"),
}
"""Further parameters of F_y, M_z and M_x."""

RELAXATION = {
    "longitudinal_stiffness": _Row(
        358000.0,
        "Longitudinal stiffness C_x of the tyre at rest (6)",
        "chosen: relaxation over 0.24 m at nominal load",
        "N/m",
        0.0,
    ),
    "lateral_stiffness": _Row(
        102700.0,
        "Lateral stiffness C_y of the tyre at rest (6)",
        "chosen: relaxation over 0.45 m at nominal load",
        "N/m",
        0.0,
    ),
    "pcfx1": _Row(0.0, "Variation of C_x with load", "chosen: not known of this tyre"),
    "pcfx2": _Row(0.0, "Variation of C_x with load squared", "chosen: likewise"),
    "pcfx3": _Row(0.0, "Variation of C_x with pressure", "chosen: likewise"),
    "pcfy1": _Row(0.0, "Variation of C_y with load", "chosen: likewise"),
    "pcfy2": _Row(0.0, "Variation of C_y with load squared", "chosen: likewise"),
    "pcfy3": _Row(0.0, "Variation of C_y with pressure", "chosen: likewise"),
    "ptx1": _Row(0.0, "Relaxation length of F_x over R_0 F_z / F_z0 (5.2)", "chosen: a set of 6.2"),
    "ptx2": _Row(0.0, "Variation of that with load (5.2)", "chosen: likewise"),
    "ptx3": _Row(0.0, "Exponent of that with load (5.2)", "chosen: likewise"),
    "pty1": _Row(0.0, "Largest relaxation length of F_y over R_0 (5.2)", "chosen: likewise"),
    "pty2": _Row(1.0, "Load over nominal load at which that is (5.2)", "chosen: likewise"),
    "lsgkp": _scale("the relaxation length of F_x (5.2)"),
    "lsgal": _scale("the relaxation length of F_y (5.2)"),
}
"""Further parameters of tyre relaxation."""


def of_axles(rows: dict[str, _Row]) -> dict[str, Any]:
    """Declare every row as parameters of the front and the rear axle."""
    return {
        f"{key}_{axle}": row.declared(f"{row.text}, {axle} tyres")
        for axle in ("front", "rear")
        for key, row in rows.items()
    }


def of_axle(p: Any, axle: str) -> Callable[[str], float]:
    """Return a getter of the coefficients of the axle "front" or "rear" by their names without suffix."""
    return lambda name: float(getattr(p, f"{name}_{axle}"))


@dataclass(frozen=True)
class _General:
    """Parameters that are not coefficients of a tyre."""

    reference_friction: float = parameter(
        1.0,
        "1",
        "Friction coefficient of the road on which the set was measured; lambda_mu is friction over it",
        "chosen: the set is unchanged at the papers' mu = 1",
        minimum=0.01,
    )
    slip_angle_as_tangent: bool = parameter(
        False,
        None,
        "Use tan(alpha) and sin(gamma) for alpha and gamma, as printed in the book",
        "chosen: off, as in programs that fit and use such sets",
    )
    file_low_friction: str = parameter(
        "scale",
        None,
        "low_friction of tyres from a property file: scale keeps the weights of the dry tyre in "
        "combined slip, similarity also scales the slips in them",
        "chosen: scale, as in programs that fit and use such sets",
        choices=("scale", "similarity"),
    )


LongitudinalParameters = parameter_class(
    __name__, "LongitudinalParameters", of_axles(COMMON | LONGITUDINAL), bases=(_General,)
)
"""Parameters of F_x(kappa)."""

Pacejka2012Parameters = parameter_class(
    __name__, "Pacejka2012Parameters", of_axles(REST), bases=(LongitudinalParameters,)
)
"""Parameters of all forces and moments."""
