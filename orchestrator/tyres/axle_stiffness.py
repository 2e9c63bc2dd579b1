"""The cornering stiffness of a scenario's own tyres at given loads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction

from ..plan import Plan, Unit, Value


def cornering_stiffness(tyres: Unit, loads: Mapping[str, float]) -> dict[str, float]:
    """Return the cornering stiffness [N/rad] of one tyre on some wheels, each under its load [N].

    The road is what the unit is told of it; where a wire tells that, and of the motion, the tyre rolls
    straight ahead on a dry road, friction 1.

    Raises:
        SimulationError: the FMU failed.
        ValueError: it cannot be stepped beside the run.
    """
    from .stand import Stand, stiffnesses  # needs numpy, which most plans can do without

    if tyres.fmu.once_per_process:
        raise ValueError(f"{tyres.fmu.name} can be instantiated only once per process")
    inputs: dict[str, Value] = {
        v.name: 1.0 if v.name.startswith("friction") else 0.0 for v in tyres.fmu.of("input")
    }
    unit = replace(tyres, constants=inputs | tyres.constants, series={}, period=1)
    record = tuple((unit.name, v.name) for v in unit.fmu.of("output"))
    plan = Plan((unit,), (), record, Fraction(1), 1, "jacobi", title=unit.name)
    return {wheel: float(stiffnesses(Stand(plan, wheel), [load])[1][0]) for wheel, load in loads.items()}
