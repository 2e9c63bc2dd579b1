"""Axle of brush tyres (Fiala): side force from slip angle, its slope, and the slip angle for a force.

    F = -mu F_z (1 - (1 - |t| / t_s)^3) sgn(t),      t = tan(alpha),     t_s = 3 mu F_z / C

beyond t_s the whole contact patch slides and F = -mu F_z sgn(t). Source: E. Fiala, Seitenkraefte am rollenden
Luftreifen, VDI-Zeitschrift 96, 1954, in the form of H. B. Pacejka, Tyre and Vehicle Dynamics, 3rd edition,
section 3.2.1 (equations of the brush model with one friction coefficient).
"""

from dataclasses import dataclass
from math import atan, tan


@dataclass(frozen=True)
class BrushAxle:
    """Axle: cornering stiffness C [N/rad] and grip mu F_z [N], positive."""

    stiffness: float
    grip: float

    def sliding(self) -> float:
        """Return the slip angle [rad] from which the axle slides."""
        return atan(3.0 * self.grip / self.stiffness)

    def force(self, alpha: float) -> float:
        """Return the side force [N] at a slip angle [rad]."""
        part = self._part(alpha)
        size = self.grip * (1.0 - part * part * part)
        return -size if alpha > 0.0 else size

    def slope(self, alpha: float) -> float:
        """Return -dF/dalpha [N/rad], not negative."""
        part = self._part(alpha)
        t = tan(alpha)
        return self.stiffness * part * part * (1.0 + t * t)

    def slip_for(self, force: float) -> float:
        """Return the smallest slip angle [rad] that gives a side force [N] of at most the grip."""
        used = min(abs(force) / self.grip, 1.0)
        size = atan(3.0 * self.grip / self.stiffness * (1.0 - (1.0 - used) ** (1.0 / 3.0)))
        return -size if force > 0.0 else size

    def _part(self, alpha: float) -> float:
        """Return the share of the contact patch that sticks [1]."""
        if abs(alpha) > 1.5:
            return 0.0
        return max(1.0 - abs(tan(alpha)) * self.stiffness / (3.0 * self.grip), 0.0)
