"""fmpy's simulation of SSP archives, made to exchange values before the first step as others do.

To be run in a process of its own: fmpy is changed in place.
"""

from __future__ import annotations

from typing import Any

from fmpy.fmi2 import FMU2Slave
from fmpy.ssp import simulation as ssp

from yawbench.interop.second_opinion import Recording, Request, run_fmpy_ssp

_leave_initialization = FMU2Slave.exitInitializationMode
_instantiate, _connections_of, _step = ssp.instantiate_fmu, ssp.get_connections, ssp.do_step
_components: list[Any] = []
_connections: list[Any] = []


def drive(request: Request) -> Recording:
    """Run the archive in fmpy, its units initialized together."""
    FMU2Slave.exitInitializationMode = lambda self: None
    ssp.instantiate_fmu = _remember_component
    ssp.get_connections = _remember_connections
    ssp.do_step = _step_after_exchange
    return run_fmpy_ssp(request)


def _remember_component(component: Any, *given: Any) -> None:
    _instantiate(component, *given)
    _components.append(component)


def _remember_connections(system: Any) -> list[Any]:
    _connections[:] = _connections_of(system)
    return _connections


def _step_after_exchange(component: Any, time: float, step_size: float) -> None:
    if time == 0 and component is _components[0]:
        for _ in _components:  # no chain of values through the units is longer
            _exchange()
            for one in _components:
                for connector in _of(one, "input"):
                    ssp.set_value(one, connector.name, connector.value)
        for one in _components:
            _leave_initialization(one.fmu)
        _exchange()
    _step(component, time, step_size)


def _exchange() -> None:
    for one in _components:
        for connector in _of(one, "output"):
            connector.value = ssp.get_value(one, connector.name)
    for start, end in _connections:
        end.value = start.value


def _of(component: Any, kind: str) -> list[Any]:
    return [connector for connector in component.connectors if connector.kind == kind]
