"""Roll camber: inclination of the wheels against the road when the body rolls.

    gamma_f = e_f phi        gamma_r = e_r phi

phi is the body's roll against the road, positive with the left side up, gamma the inclination of a wheel,
positive with its top to the right (ISO 8855), the same for both wheels of an axle. The roll camber e
[1] is what the suspension leaves of the roll: 1 for trailing arms, near 0 for a rigid axle, less than 0 for
wheels that lean into the turn. So in a turn wheels lean outward, and their camber thrust points outward, too.

The coefficient is SAE J670's roll camber, with the roll of the whole car on its tyres, as on a test rig that
lifts one side. Left out: camber by heave, by steering (caster, kingpin), by forces, and what wheels have at
rest.
"""

from dataclasses import dataclass

from vocabulary.wheels import Four

from ..fmi.variables import of_car

_TAKEN_BACK = "chosen: independent suspension that takes back three tenths of the roll"


@dataclass(frozen=True)
class RollCamberParameters:
    """Roll camber of both axles."""

    roll_camber_front: float = of_car(0.7, _TAKEN_BACK, minimum=-2.0, maximum=2.0)
    roll_camber_rear: float = of_car(0.7, _TAKEN_BACK, minimum=-2.0, maximum=2.0)


def inclinations(phi: float, p: RollCamberParameters) -> Four:
    """Return gamma [rad] of fl, fr, rl, rr at a roll angle [rad]."""
    front, rear = p.roll_camber_front * phi, p.roll_camber_rear * phi
    return front, front, rear, rear
