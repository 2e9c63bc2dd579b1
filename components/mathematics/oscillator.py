"""Damped oscillator, solved exactly over a step.

    x'' + 2 s x' + q x = 0        =>        (x, x') after h  =  Phi(h) (x, x')

for any damping, so a stiff oscillator needs no small step. With a constant force, x is measured from the
equilibrium under that force.
"""

from math import cos, exp, sin, sinh, sqrt


def transition(s: float, q: float, h: float) -> tuple[float, float, float, float]:
    """Return the rows of Phi(h) for s [1/s], q [1/s2] and the time `h` [s]."""
    discriminant = s * s - q
    if discriminant < 0.0:
        rate = sqrt(-discriminant)
        decay = exp(-s * h)
        even = decay * cos(rate * h)
        odd = decay * sin(rate * h) / rate
    elif discriminant == 0.0:
        even = exp(-s * h)
        odd = h * even
    else:
        rate = sqrt(discriminant)
        slow, fast = exp((rate - s) * h), exp(-(rate + s) * h)
        even = 0.5 * (slow + fast)
        odd = 0.5 * (slow - fast) / rate if rate * h > 1.0 else exp(-s * h) * sinh(rate * h) / rate
    return even + s * odd, odd, -q * odd, even - s * odd
