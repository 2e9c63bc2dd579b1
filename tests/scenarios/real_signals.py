"""A paper's scenario with sensors put between the car and its control."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ruamel.yaml import YAML

SCENARIOS = Path(__file__).parents[2] / "scenarios"
CONTROL = ("reference", "controller", "allocator", "wheel_control")
ROAD = ("driver", "plant", "tyre", "actuator")


def with_units(name: str, folder: Path, *, seen: tuple[str, ...] = ("sensor",), **units: Any) -> Path:
    """Write a scenario with more units, the units `seen` giving the control side what it sees; return it."""
    file = SCENARIOS / f"{name}.yaml"
    scenario = YAML(typ="safe").load(file)
    scenario["vehicle"] = str((file.parent / scenario["vehicle"]).resolve())
    scenario["units"] |= units
    scenario["connections"] = [
        *scenario.get("connections", ()),
        {"from": ["plant", "driver"], "to": "sensor.*_true"},
        {"from": ["driver", "plant"], "to": [u for u in ROAD if u in scenario["units"]]},
        {"from": list(seen), "to": [u for u in CONTROL if u in scenario["units"]]},
    ]
    made = folder / f"{file.stem}.yaml"
    YAML(typ="safe").dump(scenario, made)
    return made
