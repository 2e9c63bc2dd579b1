"""Linear models of a scenario around an operating point (`Scenario.linearize`)."""

PLUGINS = {
    "library": {
        "LinearModel": "yawbench.linear.linear_model:LinearModel",
        "linearize": "yawbench.linear.linear_model:linearize",
    }
}
