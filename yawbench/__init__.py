"""Vehicle yaw-stability control on a test bench of FMI units.

    import yawbench as yb

    run = yb.load("fnn_sideslip/25mps").swap(controller="controller_off").run()
    run["plant.sideslip"], run.time      # numpy arrays, in SI units
    run.metric("peak(sideslip)")         # 0.0548 rad
    run.plot("sideslip", "yaw_rate")     # a matplotlib figure

A controller may be plain Python, run in this process; `yawbench build` makes an FMU of one that has
proved itself:

    def proportional(yaw_rate_ref, yaw_rate):
        return 20000 * (yaw_rate_ref - yaw_rate)

    yb.load("fnn_sideslip/25mps").swap(controller=proportional).run().metric("peak(sideslip)")

Scenarios never change: `swap` and `set` give new ones. Nothing is written, and nothing is printed,
unless asked for. Errors are of one tree; each has `problems`, sentences that know their `file` and `line`,
and is itself at those of the first:

    YawbenchError
    ├── ScenarioError             the scenario or a change of it is wrong
    ├── ModelDescriptionError     an FMU is missing, corrupt or not supported
    ├── WiringError               units cannot be connected as asked
    ├── ResultsError              recorded results are missing or unreadable
    ├── BuildError                a component cannot be made into an FMU
    └── SimulationError           a run failed; knows `unit` and `time`

What is no failure but hardly meant, such as a car that spins, is a `YawbenchWarning`: once per run.
"""

from orchestrator.errors import (
    BuildError,
    ModelDescriptionError,
    RecordWarning,
    ResultsError,
    ScenarioError,
    SimulationError,
    WiringError,
    YawbenchError,
    YawbenchWarning,
)

from ._controller import output, parameter, signal
from ._experiment import Experiment, Runs, experiment
from ._ranking import Ranking, rank
from ._run import Run, open
from ._scenario import Scenario, load

__all__ = [
    "BuildError",
    "Experiment",
    "ModelDescriptionError",
    "Ranking",
    "RecordWarning",
    "ResultsError",
    "Run",
    "Runs",
    "Scenario",
    "ScenarioError",
    "SimulationError",
    "WiringError",
    "YawbenchError",
    "YawbenchWarning",
    "experiment",
    "load",
    "open",
    "output",
    "parameter",
    "rank",
    "signal",
]
