"""What the FMUs of a scenario tell of an override before it runs, where they are built and up to date."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from yawbench.fmus.fmu import Fmu, is_path
from yawbench.fmus.opener import Opener, find_fmu, find_folder, packaged
from yawbench.foundation.errors import InvalidValueError, Location, ModelDescriptionError, YawbenchError
from yawbench.foundation.messages import fold, hint
from yawbench.orchestrator.fault_kinds import FaultList
from yawbench.orchestrator.plan import Override
from yawbench.orchestrator.scenario.schema import LoadedScenario
from yawbench.orchestrator.signal_names import SignalName
from yawbench.orchestrator.wiring.parameters import is_parameter, unknown_parameter, value_for
from yawbench.vehicles.derivations import quantity_of
from yawbench.vehicles.load import LOAD, load_of
from yawbench.vocabulary.vehicle import CAR


class KnownFmus:
    """The FMUs that a scenario file finds; nothing is built."""

    def __init__(self, scenario: Path) -> None:
        self._scenario = scenario
        self._opener = Opener()

    def find(self, change: Override) -> None:
        """Check that there is the FMU of a swap, or a component from which it can be built.

        Raises:
            ModelDescriptionError: there is neither.
        """
        fmu, folder = str(change.value), find_folder(self._scenario, opener=self._opener)
        try:
            if not is_path(fmu):
                find_fmu(fmu, scenario=self._scenario, fmus=folder, opener=self._opener, build=False)
        except ModelDescriptionError as error:
            if packaged(fmu) is None and fmu not in Opener(build=True).names(folder):
                where = Location(target=str(change))
                located = [replace(diagnostic, location=where) for diagnostic in error.diagnostics]
                raise ModelDescriptionError(located) from None

    def check(self, change: Override, scenario: LoadedScenario) -> None:
        """Check the name and the value of an override of a parameter, an input or a quantity of the car.

        Raises:
            ValueError: an FMU has no such variable, or the value is not allowed.
        """
        target, value = change.target, change.value
        assert not isinstance(value, FaultList)  # only faults have them
        if target.kind == "vehicle_parameter" and target.variable in CAR:
            value_for(quantity_of(target.variable), value)
        elif target.kind == "vehicle_parameter" and target.variable == LOAD:
            load_of(value)
        elif target.kind == "parameter":
            fmu = self._fmu(scenario, target.instance)
            if fmu is None:
                return
            if not is_parameter(fmu, target.variable):
                sentence = unknown_parameter(target.instance, fmu, target.variable)
                raise InvalidValueError(sentence, "parameter-unknown")
            value_for(fmu.variables[target.variable], value)
        elif target.kind == "input":
            fmus = {instance: self._fmu(scenario, instance) for instance in scenario.units}
            pattern = SignalName.parse_input(target.variable, fmus)
            having = [
                variable
                for instance, fmu in fmus.items()
                for variable in (fmu.variables.values() if fmu else ())  # also other names of an input
                if variable.causality == "input" and pattern.matches(instance, variable.name)
            ]
            if not having and None not in fmus.values():
                known = (v.name for fmu in fmus.values() if fmu for v in fmu.of("input"))
                names = fold(list(dict.fromkeys(known)))
                sentence = f"no input matches{hint(pattern.variable, names, lead='there are')}"
                raise InvalidValueError(sentence, "variable-unknown")
            for variable in having:
                value_for(variable, value)

    def _fmu(self, scenario: LoadedScenario, instance: str) -> Fmu | None:
        """Return the FMU of an instance, None if it is not there, not up to date or no FMU at all."""
        opener = self._opener
        try:
            folder = find_folder(self._scenario, opener=opener)
            named = scenario.units[instance].fmu
            archive = find_fmu(named, scenario=self._scenario, fmus=folder, opener=opener, build=False)
            fmu = opener.open(archive, validate=False)
        except (YawbenchError, OSError):
            return None
        return None if fmu.built is not None and not fmu.built.current else fmu
