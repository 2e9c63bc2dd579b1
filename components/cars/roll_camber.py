"""Roll camber: inclination angle of the wheels due to body roll.

    gamma_f = e_f phi        gamma_r = e_r phi

phi is the body's roll relative to the road, positive with the left side up, gamma the inclination angle of a
wheel, positive with its top to the right (ISO 8855), the same for both wheels of an axle. The roll camber
coefficient e [1] depends on the suspension: 1 for trailing arms, near 0 for a rigid axle, negative for wheels
that lean into the turn. With e > 0 wheels lean outward in a turn, and their camber thrust points outward,
too.

The coefficient is SAE J670's roll camber, with the roll of the whole car on its tyres, as on a test rig that
lifts one side. Neglected: static camber, and camber due to heave, steering (caster, kingpin) and forces.
"""

from dataclasses import dataclass

from yawbench.vocabulary.wheels import Four

from ..fmi.variables import of_car

_TAKEN_BACK = "chosen: independent suspension that compensates three tenths of the roll"


@dataclass(frozen=True)
class RollCamberParameters:
    """Roll camber coefficients of both axles."""

    roll_camber_front: float = of_car(0.7, _TAKEN_BACK, minimum=-2.0, maximum=2.0)
    roll_camber_rear: float = of_car(0.7, _TAKEN_BACK, minimum=-2.0, maximum=2.0)


def inclinations(phi: float, p: RollCamberParameters) -> Four:
    """Return gamma [rad] of fl, fr, rl, rr at a roll angle [rad]."""
    front, rear = p.roll_camber_front * phi, p.roll_camber_rear * phi
    return front, front, rear, rear
