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

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from yawbench.components.fmi.variables import output, parameter, signal
    from yawbench.foundation.errors import (
        BuildError,
        Diagnostic,
        Location,
        ModelDescriptionError,
        ResultsError,
        ScenarioError,
        SimulationError,
        WiringError,
        YawbenchError,
        YawbenchWarning,
    )
    from yawbench.linear.linear_model import LinearModel, linearize
    from yawbench.measured_cars.library_fit import Fit, fit
    from yawbench.measured_cars.library_validate import validate
    from yawbench.measured_cars.validation import Validation
    from yawbench.metrics.expressions import MetricValue
    from yawbench.metrics.verdict import Verdict
    from yawbench.orchestrator.plan import Override, Plan
    from yawbench.proving_ground.standard_tests import Evaluation, TestQuantity
    from yawbench.ranking.library import Ranking, rank

    from ._controller import Controller
    from ._distributions import Drawn, normal, tabulated, uniform
    from ._experiment import Experiment, Runs, experiment
    from ._export import export_fmu
    from ._open import RecordedRuns, open
    from ._run import Run, measured
    from ._scenario import Scenario, load
    from ._stepping import SteppedRun
    from ._tuning import Tuning, tune
    from ._view import View, view
    from ._within import within

__all__ = [
    "BuildError",
    "Controller",
    "Diagnostic",
    "Drawn",
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
    "RecordedRuns",
    "ResultsError",
    "Run",
    "Runs",
    "Scenario",
    "ScenarioError",
    "SimulationError",
    "SteppedRun",
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
    "normal",
    "open",
    "output",
    "parameter",
    "rank",
    "signal",
    "tabulated",
    "tune",
    "uniform",
    "validate",
    "view",
    "within",
]

_MODULES = {
    "yawbench.foundation.errors": (
        "BuildError",
        "Diagnostic",
        "Location",
        "ModelDescriptionError",
        "ResultsError",
        "ScenarioError",
        "SimulationError",
        "WiringError",
        "YawbenchError",
        "YawbenchWarning",
    ),
    "yawbench.components.fmi.variables": ("output", "parameter", "signal"),
    "yawbench.proving_ground.standard_tests": ("Evaluation", "TestQuantity"),
    "yawbench.metrics.expressions": ("MetricValue",),
    "yawbench.metrics.verdict": ("Verdict",),
    "yawbench.orchestrator.plan": ("Override", "Plan"),
    "yawbench._controller": ("Controller",),
    "yawbench._distributions": ("Drawn", "normal", "tabulated", "uniform"),
    "yawbench._experiment": ("Experiment", "Runs", "experiment"),
    "yawbench._export": ("export_fmu",),
    "yawbench._open": ("RecordedRuns", "open"),
    "yawbench._run": ("Run", "measured"),
    "yawbench._scenario": ("Scenario", "load"),
    "yawbench._stepping": ("SteppedRun",),
    "yawbench._tuning": ("Tuning", "tune"),
    "yawbench._view": ("View", "view"),
    "yawbench._within": ("within",),
}
_MODULE_OF = {name: module for module, names in _MODULES.items() for name in names}
"""Public name -> module; the others are registered by wings, see `parts`."""


def __getattr__(name: str) -> object:
    """Import a public name at its first use, so that `import yawbench` itself is fast."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    if name in _MODULE_OF:
        value = getattr(import_module(_MODULE_OF[name]), name)
    else:
        value = import_module("yawbench.foundation.plugins").find("library", name)
        if value is None:
            raise AttributeError(f"yawbench.{name} is in a part of yawbench that is not installed")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return list(__all__)
