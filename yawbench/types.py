"""Types of arguments and results of the library, for annotations and `isinstance`; users create few of them.

import yawbench as yb
from yawbench.types import Instance

plan = yb.load("fnn_sideslip/25mps").plan()
sensors: list[Instance] = [instance for instance in plan.instances if instance.role == "sensor"]
"""

from yawbench.components.fmi.variables import VariableSpec
from yawbench.fmus.fmu import (
    BuildInfo,
    Causality,
    Fmu,
    RunsAs,
    UnitDefinition,
    Value,
    ValueRef,
    Variability,
    Variable,
    VariableType,
)
from yawbench.foundation.errors import Messages, Severity
from yawbench.metrics.verdict import Relation, Status
from yawbench.orchestrator.fault_kinds import Fault, FaultList, FaultLocation, FaultName, FaultySignal
from yawbench.orchestrator.plan import (
    Given,
    InputSeries,
    Instance,
    OriginKind,
    OverrideOrigin,
    SourceKind,
    ValueOrigin,
    ValueSource,
    Wire,
)
from yawbench.orchestrator.results.reader import Results
from yawbench.orchestrator.results.run_record import EventRecord, RunRecord
from yawbench.orchestrator.signal_names import SignalName, Target, TargetKind
from yawbench.proving_ground.standard_tests import TestName
from yawbench.scene.ground import FrictionPatch
from yawbench.scene.outline import CarOutline, Places
from yawbench.scene.scene import Scene
from yawbench.studies.tables import Cell, Column, Kind, Table
from yawbench.vocabulary.lane_change import Lane

from ._controller import ControllerLike, Numbers

__all__ = [
    "BuildInfo",
    "CarOutline",
    "Causality",
    "Cell",
    "Column",
    "ControllerLike",
    "EventRecord",
    "Fault",
    "FaultList",
    "FaultLocation",
    "FaultName",
    "FaultySignal",
    "Fmu",
    "FrictionPatch",
    "Given",
    "InputSeries",
    "Instance",
    "Kind",
    "Lane",
    "Messages",
    "Numbers",
    "OriginKind",
    "OverrideOrigin",
    "Places",
    "Relation",
    "Results",
    "RunRecord",
    "RunsAs",
    "Scene",
    "Severity",
    "SignalName",
    "SourceKind",
    "Status",
    "Table",
    "Target",
    "TargetKind",
    "TestName",
    "UnitDefinition",
    "Value",
    "ValueOrigin",
    "ValueRef",
    "ValueSource",
    "Variability",
    "Variable",
    "VariableSpec",
    "VariableType",
    "Wire",
]
