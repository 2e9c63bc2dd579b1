"""Whether a car answers the steering to the side it is steered to.

Measured columns often have signs other than those of ISO 8855. A yaw rate or a lateral acceleration that
opposes the hand wheel is a mistake in the data, not a property of the car, and nothing can be judged by it.
"""

from __future__ import annotations

import numpy as np

from .judgement import NotJudged


def likeness(hand: np.ndarray, answer: np.ndarray) -> float:
    """Return the normalized product of two signals over the same samples, from -1 to 1; 0 if one is zero."""
    size = float(np.sqrt(np.sum(hand**2) * np.sum(answer**2)))
    return float(np.sum(hand * answer)) / size if size else 0.0


def refuse_opposed(hand: np.ndarray, answer: np.ndarray, name: str) -> None:
    """Raise NotJudged if an answer is on the whole to the other side than the hand wheel.

    Args:
        hand: hand-wheel angle over the samples in question; zero straight ahead.
        answer: over the same samples.
        name: of the answer, in words.
    """
    if likeness(hand, answer) < 0.0:
        raise opposed(name)


def opposed(name: str) -> NotJudged:
    """Return the reason not to judge a run whose answer opposes the steering."""
    return NotJudged(
        f"the {name} opposes the steering: both are positive to the left, so one of them has the wrong sign "
        "('sign: -1' in the mapping of measured columns turns it)"
    )
