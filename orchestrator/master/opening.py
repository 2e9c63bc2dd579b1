"""The instance of a unit in this process, of the version of FMI that its FMU follows."""

from __future__ import annotations

from pathlib import Path

from ..plan import Unit
from .fmi2 import Fmi2Slave
from .fmi3 import Fmi3Slave
from .log import Log
from .surroundings import Surroundings
from .unit import FmuSlave

SLAVES: dict[int, type[FmuSlave]] = {2: Fmi2Slave, 3: Fmi3Slave}
"""Major version of FMI -> its instances."""


def open_unit(unit: Unit, log: Log, corrupted: set[Path]) -> FmuSlave:
    """Return the instance of a unit; arguments and errors are those of `FmuSlave`."""
    surroundings = Surroundings()
    try:
        return SLAVES[unit.fmu.fmi](unit, log, corrupted)
    finally:
        surroundings.restore(unit.name, log)
