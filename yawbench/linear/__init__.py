"""Linear models of a scenario around an operating point."""

PLUGINS = {
    "library": {
        "LinearModel": "yawbench.linear.linear_model:LinearModel",
        "linearize": "yawbench.linear.linear_model:linearize",
    }
}
