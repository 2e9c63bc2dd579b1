"""The planner: from a scenario file and overrides to a plan, for commands, experiments and the library."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from yawbench.fmus.fmu import Fmu
from yawbench.fmus.opener import Building, Opener, report_to_stderr
from yawbench.foundation.errors import ScenarioError
from yawbench.foundation.messages import hint
from yawbench.orchestrator.plan import Instance, Override, Plan
from yawbench.orchestrator.scenario import like
from yawbench.orchestrator.scenario.loader import LoadedScenario, load_scenario
from yawbench.orchestrator.scenario.yaml_lines import Document
from yawbench.orchestrator.signal_names import match
from yawbench.orchestrator.wiring.make_plan import Network, make_plan
from yawbench.vehicles.car import cars
from yawbench.vehicles.tir import read_tir


class Planner:
    """Makes plans; reads every file, opens every FMU and measures every tyre once for all of them.

    Args:
        build: as of the `Opener`.
        report: as of the `Opener`.
        opened: as of the `Opener`.
    """

    def __init__(
        self,
        *,
        build: Building = False,
        report: Callable[[str], None] = report_to_stderr,
        opened: Mapping[Path, Fmu] | None = None,
    ) -> None:
        self._documents: dict[Path, Document] = {}
        self._networks: dict[Hashable, Network] = {}
        self._stiffnesses: dict[Hashable, dict[str, float]] = {}
        self.opener = Opener(build=build, report=report, opened=opened)

    def load(
        self,
        path: Path,
        changes: Sequence[Override] = (),
        *,
        data: dict[str, Any] | None = None,
        validate: bool = True,
    ) -> LoadedScenario:
        """Load a scenario; arguments as of `load_scenario`.

        Raises:
            ScenarioError: with all problems of its files and the overrides.
        """
        return load_scenario(
            path, changes=changes, data=data, read=self._read, read_tyre=read_tir, validate=validate
        )

    def plan(
        self,
        scenario: LoadedScenario,
        *,
        fmus: Path | None = None,
        isolated: bool = False,
        record: Sequence[str] = (),
    ) -> Plan:
        """Return the plan of a scenario.

        Args:
            scenario: as loaded.
            fmus: folder of the FMUs given by name; None: the nearest `fmus/` that contains any.
            isolated: whether each instance will run in its own process.
            record: signals that are recorded, or patterns of names; default: those the scenario records.

        Raises:
            YawbenchError: an FMU is missing or cannot be built, the instances cannot be connected, or a
                signal is not recorded.
        """
        plan = make_plan(
            scenario, fmus=fmus, opener=self.opener, isolated=isolated, domain=cars(self._measure),
            networks=self._networks,
        )  # fmt: skip
        if not record:
            return plan
        recorded = {str(name): name for name in plan.record}
        known = {*recorded, *(name.variable for name in plan.record)}
        unknown = [name for name in record if name not in known and "*" not in name]
        if unknown:
            guess = hint(unknown[0], recorded, lead="recorded are")
            raise ScenarioError(
                f"{scenario.path}: {unknown[0]!r} is not recorded{guess}", code="signal-unknown"
            )
        chosen = [
            name
            for text, name in recorded.items()
            if any(match(pattern, own) is not None for pattern in record for own in (text, name.variable))
        ]
        return replace(plan, record=tuple(chosen))

    def _measure(self, tyres: Instance, loads: Mapping[str, float]) -> dict[str, float]:
        """Return what `cornering_stiffness` returns, measured once for equal tyres."""
        parts = tyres.parameters, tyres.constants, loads
        key = (tyres.fmu.sha256, *(tuple(sorted(part.items())) for part in parts))
        if key not in self._stiffnesses:
            from .tyre_stand import cornering_stiffness

            self._stiffnesses[key] = cornering_stiffness(tyres, loads)
        return self._stiffnesses[key]

    def _read(self, path: Path, *, what: str) -> Document:
        """Return what `like.read` returns, for changes of its own."""
        if path not in self._documents:
            self._documents[path] = like.read(path, what=what)
        return self._documents[path].fresh()
