"""Measured cars: flaws of recordings, fits of parameters, validation of runs.

`yawbench measured`, `fit` and `validate`, their files, pages and public names.

Not here: reading recordings (`yawbench.orchestrator.recordings`).
"""

PLUGINS = {
    "command": {
        "measured": "yawbench.measured_cars.command:measured",
        "fit": "yawbench.measured_cars.command:fit",
        "validate": "yawbench.measured_cars.command:validate",
    },
    "kind of file": {
        "bands": "yawbench.measured_cars.validation:BandsSpec",
        "fit": "yawbench.measured_cars.fit_file:FitSpec",
    },
    "section of a study": {"validations": "yawbench.measured_cars.of_studies:VALIDATIONS"},
    "library": {
        "Fit": "yawbench.measured_cars.library_fit:Fit",
        "fit": "yawbench.measured_cars.library_fit:fit",
        "Validation": "yawbench.measured_cars.validation:Validation",
        "validate": "yawbench.measured_cars.library_validate:validate",
    },
}
