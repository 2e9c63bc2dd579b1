"""The four wheels of a car: their names, their order, and `*` in names of signals."""

Four = tuple[float, float, float, float]
"""A number per wheel, in the order of `WHEELS`."""

WHEEL_NAMES = {"fl": "front left", "fr": "front right", "rl": "rear left", "rr": "rear right"}
"""The wheels in words, always in this order."""

WHEELS = tuple(WHEEL_NAMES)
"""The wheels as signals name them: `fl`, `fr`, `rl`, `rr`."""


def wheels(pattern: str) -> tuple[str, ...]:
    """Return the names that `pattern` stands for: four if it holds a `*`, else itself."""
    if "*" not in pattern:
        return (pattern,)
    return tuple(pattern.replace("*", wheel) for wheel in WHEELS)
