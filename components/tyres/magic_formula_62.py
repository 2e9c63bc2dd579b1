"""Magic Formula tyre of MF-Tyre 6.1, 6.2 and 5.2 (PAC2002), with the coefficients of a tyre property file.

With F_z0' = LFZO FNOMIN, df = F_z / F_z0' - 1, dp = INFLPRES / NOMPRES - 1, lambda = mu / reference_friction,
MF(x; B, C, D, E) = D sin(C atan(B x - E (B x - atan(B x)))), MG the same with cos for sin and D = 1, E <= 1:

    F_x  = G_xa F_x0        F_x0 = MF(kappa + S_Hx; ...) + S_Vx                              (4.E9-4.E18)
      D   = F_z (PDX1 + PDX2 df) (1 + PPX3 dp + PPX4 dp^2) (1 - PDX3 gamma^2) LMUX lambda
      BCD = K_x = F_z (PKX1 + PKX2 df) exp(PKX3 df) (1 + PPX1 dp + PPX2 dp^2) LKX
      E   = (PEX1 + PEX2 df + PEX3 df^2) (1 - PEX4 sgn(kappa + S_Hx)) LEX
      S_Hx = (PHX1 + PHX2 df) LHX           S_Vx = F_z (PVX1 + PVX2 df) LVX LMUX lambda
    G_xa = MG(alpha + RHX1) / MG(RHX1)                                                       (4.E50-4.E57)
      B   = (RBX1 + RBX3 gamma^2) cos(atan(RBX2 kappa)) LXAL,  C = RCX1,  E = REX1 + REX2 df

    F_y  = G_yk F_y0 + S_Vyk        F_y0 = MF(alpha + S_Hy; ...) + S_Vy                      (4.E19-4.E30)
      D   = F_z (PDY1 + PDY2 df) (1 + PPY3 dp + PPY4 dp^2) (1 - PDY3 gamma^2) LMUY lambda
      BCD = K_y = PKY1 F_z0' (1 + PPY1 dp) (1 - PKY3 |gamma|)
                  sin(PKY4 atan(F_z / F_z0' / ((PKY2 + PKY5 gamma^2) (1 + PPY2 dp)))) LKY
      E   = (PEY1 + PEY2 df) (1 + PEY5 gamma^2 - (PEY3 + PEY4 gamma) sgn(alpha + S_Hy)) LEY
      S_Vg = F_z (PVY3 + PVY4 df) gamma LKYC LMUY lambda
      S_Vy = F_z (PVY1 + PVY2 df) LVY LMUY lambda + S_Vg
      S_Hy = (PHY1 + PHY2 df) LHY + (K_g gamma - S_Vg) / K_y,  K_g = F_z (PKY6 + PKY7 df) (1 + PPY5 dp) LKYC
    G_yk = MG(kappa + S_Hyk) / MG(S_Hyk),  S_Hyk = RHY1 + RHY2 df                            (4.E58-4.E67)
      B   = (RBY1 + RBY4 gamma^2) cos(atan(RBY2 (alpha - RBY3))) LYKA,  C = RCY1,  E = REY1 + REY2 df
    S_Vyk = D (RVY1 + RVY2 df + RVY3 gamma) cos(atan(RVY4 alpha)) sin(RVY5 atan(RVY6 kappa)) LVYKA

    M_z  = -t F_y' + M_zr + s F_x                                                            (4.E71-4.E78)
      t   = D_t MG(a_t; B_t, QCZ1, E_t) cos(alpha)
      a_t = atan(sqrt(tan(alpha + S_Ht)^2 + (kappa K_x / K_y)^2))
      D_t = F_z R_0 / FNOMIN (QDZ1 + QDZ2 df) (1 - PPZ1 dp) (1 + QDZ3 gamma + QDZ4 gamma^2) LTR
      B_t = (QBZ1 + QBZ2 df + QBZ3 df^2) (1 + QBZ4 gamma + QBZ5 |gamma|) LKY / (LMUY lambda)
      E_t = (QEZ1 + QEZ2 df + QEZ3 df^2) (1 + (QEZ4 + QEZ5 gamma) 2/pi atan(B_t C_t (alpha + S_Ht)))
      S_Ht = QHZ1 + QHZ2 df + (QHZ3 + QHZ4 df) gamma
      M_zr = D_r cos(atan(B_r a_r)),  B_r = QBZ9 LKY / (LMUY lambda) + QBZ10 B C of F_y
      a_r = as a_t, of alpha + S_Hy + S_Vy / K_y
      D_r = F_z R_0 ((QDZ6 + QDZ7 df) LRES + ((QDZ8 + QDZ9 df) (1 + PPZ2 dp)
            + (QDZ10 + QDZ11 df) |gamma|) gamma LKZC) LMUY lambda cos(alpha)
      s   = R_0 (SSZ1 + SSZ2 F_y / FNOMIN + (SSZ3 + SSZ4 df) gamma) LS
      F_y' = G_yk F_y0 with F_y0 at gamma = 0

    M_x  = R_0 F_z LMX (QSX1 LVMX - QSX2 gamma (1 + PPMX1 dp) + QSX3 f + QSX10 atan(QSX11 z) gamma
            + QSX4 cos(QSX5 atan((QSX6 z)^2)) sin(QSX7 gamma + QSX8 atan(QSX9 f)) - QSX12 gamma |gamma|)
            + R_0 F_y LMX (QSX13 + QSX14 |gamma|),   f = F_y / FNOMIN, z = F_z / FNOMIN      (4.E69)

Sets of MF-Tyre 5.2 (fittyp below 60) have S_Hy = (PHY1 + PHY2 df) LHY + PHY3 gamma, gamma times LGAX, LGAY or
LGAZ in place of LKYC and LKZC, and F_y' = F_y - S_Vyk.

Source: H. B. Pacejka, Tyre and Vehicle Dynamics, 3rd ed. 2012, section 4.3.2; I. J. M. Besselink, A. J. C.
Schmeitz, H. B. Pacejka, An improved Magic Formula/Swift tyre model that can handle inflation pressure
changes, Vehicle System Dynamics 48 (2010). Where these differ, or programs that fit and use such sets differ
from the book, this model follows the programs: alpha and gamma instead of tan(alpha) and sin(gamma)
(`slip_angle_as_tangent` selects the book's form, with a_t = sqrt((tan(alpha) + S_Ht)^2 + ...)); A_mu = 1
in (4.E8); QBZ4 gamma for QBZ6 gamma^2 in (4.E40); gamma for |gamma| beside QDZ3 in (4.E43); tangents in
(4.E77) and (4.E78); FNOMIN for F_z0' in (4.E42) and (4.E76); in (4.E74) G_yk with camber. The book's small
epsilons are omitted, because no division by zero occurs.

Neglected: turn slip; the rolling resistance M_y, which plants have; decay of friction with speed. Negative G,
which the book excludes, is set to 0. Above fzmax all outputs are proportional to load, with constant
coefficients; other ranges are not enforced. kappa is converted from the interface's
(w R - v) / max(|w R|, |v|).

Friction: with `file_low_friction` = scale, lambda is the book's lambda_mu: it lowers the peaks, but combined
slip keeps the weights of the dry tyre, so that on ice the resultant force exceeds the friction. With
similarity, forces and M_z are lambda times those of the set at lambda = 1 and the slips kappa / lambda and
alpha / lambda; for pure slip without shifts both are the same. Camber is not scaled.

tyreside is the side of the car for which the set was measured. Wheels on the other side are its mirror image,
so a car with equal sets drives straight ahead, whatever conicity and plysteer the set has. A wheel that rolls
backward is the reflection fore and aft of a forward-rolling wheel.
"""

from itertools import chain
from typing import Any

from ..fmi.variables import signal
from ..tyre_models.pacejka_2002 import SMALLEST_FRICTION, SMALLEST_LOAD
from ..tyre_models.pacejka_2012 import (
    forward_slip,
    longitudinal_curve,
    longitudinal_force,
    longitudinal_set,
    practical_slip,
    wheel_forces,
    whole_set,
)
from ..tyre_models.pacejka_2012_set import LongitudinalParameters, Pacejka2012Parameters
from ..tyre_models.tyre import INPUTS, Curve, Tyre, law_outputs, no_force

WHEELS = (("front", True), ("front", False), ("rear", True), ("rear", False))
"""Axle of fl, fr, rl, rr, and whether the wheel is on the left."""


class MagicFormula62(Tyre):
    """Magic Formula tyres (MF-Tyre 6.2, 6.1, 5.2) on four wheels: combined slip, camber, pressure."""

    Parameters = Pacejka2012Parameters
    CurveParameters = LongitudinalParameters
    inputs = (*INPUTS, signal("inclination_angle_*", optional=True))
    outputs = law_outputs(
        *(
            "tyre_force_x_*",
            "tyre_force_y_*",
            "aligning_moment_*",
            "overturning_moment_*",
            "slip_stiffness_*",
        ),
        inputs=(*INPUTS, "inclination_angle_*"),
    )

    @classmethod
    def for_curve(cls, p: Any) -> tuple[Any, Any, Any, Any]:
        fl, fr, rl, rr = (longitudinal_set(p, axle, left=left) for axle, left in WHEELS)
        return fl, fr, rl, rr

    @classmethod
    def curve(cls, alpha: float, f_z: float, mu: float, axle: Any) -> Curve:
        """Return F_x [N] as a function of kappa without camber; arguments as in `Tyre.curve`."""
        (mirror, per_reference, f_top, load_scale, book, similar), longitudinal = axle
        friction = mu * per_reference
        if not (f_z > SMALLEST_LOAD and friction > SMALLEST_FRICTION):
            return no_force, 1.0
        load, share = (f_z, 1.0) if f_z < f_top else (f_top, f_z / f_top)
        slip, forward = forward_slip(alpha, mirror, book)
        scale = 1.0
        if similar:
            scale, friction = friction, 1.0
            slip /= scale
        curve = longitudinal_curve(slip, 0.0, load, load * load_scale - 1.0, friction, longitudinal)
        way = 1.0 if forward else -1.0

        def force(kappa: float) -> float:
            return way * share * scale * longitudinal_force(practical_slip(way * kappa)[0] / scale, curve)[0]

        return force, scale * curve[1] / curve[7]

    def configure(self) -> None:
        self.sets = [whole_set(self.p, axle, left=left) for axle, left in WHEELS]

    def output(self, t: float, u: list[float]) -> list[float]:
        alpha, kappa, load, friction, camber = self.by_signal(u)
        by_wheel = zip(*map(wheel_forces, kappa, alpha, camber, load, friction, self.sets), strict=True)
        return [*chain.from_iterable(by_wheel), *kappa]
