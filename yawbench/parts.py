"""The parts of yawbench: those that register themselves (see `foundation.plugins`), and wings."""

CORE = (
    "yawbench.commands",
    "yawbench.measurements",
    "yawbench.orchestrator",
    "yawbench.studies",
    "yawbench.vehicles",
)
WINGS = (
    "yawbench.bench",
    "yawbench.cluster",
    "yawbench.export",
    "yawbench.interop",
    "yawbench.linear",
    "yawbench.measured_cars",
    "yawbench.packing",
    "yawbench.ranking",
)
"""Nothing outside a wing imports it: without its line and its folder the rest works."""
PARTS = (*CORE, *WINGS)
IMPORTED = ("yawbench.gym",)
"""Wings that add nothing to the program and need packages of their own: users import them."""
