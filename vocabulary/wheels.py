"""The four wheels of a car: names, order, and `*` in signal names."""

Four = tuple[float, float, float, float]
"""Number per wheel, in the order of `WHEELS`."""

WHEEL_NAMES = {"fl": "front left", "fr": "front right", "rl": "rear left", "rr": "rear right"}
"""Abbreviation -> wheel in words, in the order used everywhere."""

WHEELS = tuple(WHEEL_NAMES)
"""Suffixes of the wheels in signal names: `fl`, `fr`, `rl`, `rr`."""


def wheels(pattern: str) -> tuple[str, ...]:
    """Return the names that match `pattern`: four if it contains a `*`, else itself."""
    if "*" not in pattern:
        return (pattern,)
    return tuple(pattern.replace("*", wheel) for wheel in WHEELS)
