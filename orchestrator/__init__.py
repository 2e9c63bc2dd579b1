"""Scenario files become plans, plans become runs, runs become results: instances, wires and time.

`Scenario`, `Plan` and `Results` are the types that the rest of the program knows. The rooms, in the order of
a run: `scenario`, `recordings`, `wiring`, `master`, `results`. Beside them `plan` (the type), `signal_names`,
`coupling_algorithms` (with their theory) and `fault_kinds` (what can go wrong with a signal).

The wiring is told of cars by a `Domain`.

Not here: measurements, cars, statistics, figures, HTML (`yawbench`).
"""

PLUGINS = {
    "kind of file": {
        "scenario": "yawbench.orchestrator.scenario.schema:ScenarioSpec",
    }
}
