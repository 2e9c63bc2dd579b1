"""Scenario files become plans, plans become runs, runs become results: instances, wires and time."""

PLUGINS = {
    "kind of file": {
        "scenario": "yawbench.orchestrator.scenario.schema:ScenarioSpec",
        "vehicle": "yawbench.orchestrator.scenario.schema:Vehicle",
        "measurement": "yawbench.orchestrator.recordings.measurement:MeasurementSpec",
    }
}
