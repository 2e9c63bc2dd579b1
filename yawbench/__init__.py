"""Vehicle yaw-stability control on a test bench of FMI units.

    import yawbench as yb

    run = yb.load("fnn_sideslip/25mps").swap(controller="controller_off").run()
    run["plant.sideslip"], run.time      # numpy arrays, in SI units
    run.metric("peak(sideslip)")         # 0.0548 rad
    run.plot("sideslip", "yaw_rate")     # a matplotlib figure

A controller may be plain Python, run in this process; `export_fmu` turns it into an FMU:

    def proportional(yaw_rate_ref, yaw_rate):
        return 20000 * (yaw_rate_ref - yaw_rate)

    yb.load("fnn_sideslip/25mps").swap(controller=proportional).run().metric("peak(sideslip)")

Scenarios are immutable: `swap`, `set` and `fault` return new scenarios. Nothing is written or printed unless
requested. All errors derive from YawbenchError; `diagnostics` lists all problems; `code`, `file` and `line`
are those of the first:

    YawbenchError
    ├── ScenarioError             the scenario or an override of it is wrong
    ├── ModelDescriptionError     an FMU is missing, corrupt or not supported
    ├── WiringError               instances cannot be connected as requested
    ├── ResultsError              recorded results are missing or unreadable
    ├── BuildError                a component cannot be made into an FMU
    └── SimulationError           a run failed; has `instance` and `time`

A run that succeeds but is probably not as intended (the car spins) issues one `YawbenchWarning`.
"""

import sys
from importlib import import_module
from importlib.machinery import PathFinder
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from components.fmi.variables import output, parameter, signal
    from orchestrator.errors import (
        BuildError,
        Diagnostic,
        Location,
        ModelDescriptionError,
        RecordWarning,
        ResultsError,
        ScenarioError,
        SimulationError,
        WiringError,
        YawbenchError,
        YawbenchWarning,
    )
    from orchestrator.evaluation.standard_tests import Evaluation, TestQuantity
    from orchestrator.evaluation.validation import Validation
    from orchestrator.metrics.expressions import MetricValue
    from orchestrator.metrics.verdict import Verdict
    from orchestrator.plan import Override, Plan

    from ._controller import Controller
    from ._experiment import Experiment, Runs, experiment
    from ._export import export_fmu
    from ._fit import Fit, fit
    from ._linear import LinearModel, linearize
    from ._open import RecordedRuns, open
    from ._ranking import Ranking, rank
    from ._run import Run, measured
    from ._scenario import Scenario, load
    from ._tuning import Tuning, tune
    from ._validate import validate
    from ._view import View, view

__all__ = [
    "BuildError",
    "Controller",
    "Diagnostic",
    "Evaluation",
    "Experiment",
    "Fit",
    "LinearModel",
    "Location",
    "MetricValue",
    "ModelDescriptionError",
    "Override",
    "Plan",
    "Ranking",
    "RecordWarning",
    "RecordedRuns",
    "ResultsError",
    "Run",
    "Runs",
    "Scenario",
    "ScenarioError",
    "SimulationError",
    "TestQuantity",
    "Tuning",
    "Validation",
    "Verdict",
    "View",
    "WiringError",
    "YawbenchError",
    "YawbenchWarning",
    "experiment",
    "export_fmu",
    "fit",
    "linearize",
    "load",
    "measured",
    "open",
    "output",
    "parameter",
    "rank",
    "signal",
    "tune",
    "validate",
    "view",
]

_PACKAGES = ("components", "fmus", "orchestrator", "scenarios", "vocabulary")
_MODULES = {
    "components.fmi.variables": ("output", "parameter", "signal"),
    "orchestrator.evaluation.standard_tests": ("Evaluation", "TestQuantity"),
    "orchestrator.evaluation.validation": ("Validation",),
    "orchestrator.metrics.expressions": ("MetricValue",),
    "orchestrator.metrics.verdict": ("Verdict",),
    "orchestrator.plan": ("Override", "Plan"),
    "yawbench._controller": ("Controller",),
    "yawbench._experiment": ("Experiment", "Runs", "experiment"),
    "yawbench._export": ("export_fmu",),
    "yawbench._fit": ("Fit", "fit"),
    "yawbench._linear": ("LinearModel", "linearize"),
    "yawbench._ranking": ("Ranking", "rank"),
    "yawbench._open": ("RecordedRuns", "open"),
    "yawbench._run": ("Run", "measured"),
    "yawbench._scenario": ("Scenario", "load"),
    "yawbench._tuning": ("Tuning", "tune"),
    "yawbench._validate": ("validate",),
    "yawbench._view": ("View", "view"),
}
_MODULE_OF = {name: module for module, names in _MODULES.items() for name in names}
"""Public name -> module; names not listed are in `orchestrator.errors`."""


def _refuse_foreign_packages() -> None:
    """Raise ImportError if a package of another project hides a package of yawbench."""
    home = Path(__file__).resolve().parents[1]
    for name in _PACKAGES:
        loaded = sys.modules.get(name)
        spec = loaded.__spec__ if loaded else PathFinder.find_spec(name)
        folders = [Path(folder) for folder in (spec and spec.submodule_search_locations) or ()]
        if spec and home / name not in [folder.resolve() for folder in folders]:
            where = folders[0] if folders else spec.origin
            raise ImportError(
                f"yawbench needs its own package {name!r}, but {where} hides it; "
                "rename that, or start Python in another folder",
                name="yawbench",
            )


_refuse_foreign_packages()


def __getattr__(name: str) -> object:
    """Import a public name at its first use, so that `import yawbench` itself is fast."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(_MODULE_OF.get(name, "orchestrator.errors")), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return list(__all__)
