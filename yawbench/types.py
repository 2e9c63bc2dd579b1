"""Types of arguments and results of the library, for annotations and `isinstance`; users create few of them.

import yawbench as yb
from yawbench.types import Instance

plan = yb.load("fnn_sideslip/25mps").plan()
sensors: list[Instance] = [instance for instance in plan.instances if instance.role == "sensor"]
"""

from components.fmi.variables import VariableSpec
from orchestrator.errors import Messages, Severity
from orchestrator.evaluation.standard_tests import TestName
from orchestrator.evaluation.validation import ComparedTest, CrossPlot
from orchestrator.fault_kinds import Fault, FaultList, FaultLocation, FaultName, FaultySignal
from orchestrator.fmu.fmu import (
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
from orchestrator.metrics.verdict import Relation, Status
from orchestrator.plan import (
    InputSeries,
    Instance,
    OriginKind,
    OverrideOrigin,
    SourceKind,
    ValueOrigin,
    ValueSource,
    Wire,
)
from orchestrator.results.reader import Results
from orchestrator.results.run_record import RunRecord
from orchestrator.signal_names import SignalName, Target, TargetKind

from ._controller import ControllerLike, Numbers

__all__ = [
    "BuildInfo",
    "Causality",
    "ComparedTest",
    "ControllerLike",
    "CrossPlot",
    "Fault",
    "FaultList",
    "FaultLocation",
    "FaultName",
    "FaultySignal",
    "Fmu",
    "InputSeries",
    "Instance",
    "Messages",
    "Numbers",
    "OriginKind",
    "OverrideOrigin",
    "Relation",
    "Results",
    "RunRecord",
    "RunsAs",
    "Severity",
    "SignalName",
    "SourceKind",
    "Status",
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
