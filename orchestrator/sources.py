"""A hash of this program's own code: its version tells releases apart, not what was changed since."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

OF_RESULTS = ("plan.py", "scenario", "fmu", "wiring", "master", "results", "tyres")
"""Modules and stages that have a say in what a run records; units have hashes of their own."""
OF_METRICS = (*OF_RESULTS, "metrics")
"""And in the numbers made of it."""
OF_TESTS = (*OF_METRICS, "evaluation")
"""And in what a standard test makes of it."""

_HERE = Path(__file__).parent


@cache
def sources_hash(parts: tuple[str, ...]) -> str:
    """Return the first twelve digits of the SHA-256 of the code of modules and folders."""
    digest = hashlib.sha256()
    for part in parts:
        place = _HERE / part
        for file in sorted(place.rglob("*.py")) if place.is_dir() else [place]:
            digest.update(f"{file.relative_to(_HERE).as_posix()}\0".encode())
            digest.update(file.read_bytes())
    return digest.hexdigest()[:12]
