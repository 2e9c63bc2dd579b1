"""The parts of yawbench that register themselves (see `foundation.plugins`): the core, and wings."""

PARTS = (
    "yawbench.commands",
    "yawbench.orchestrator",
    "yawbench.studies",
    # Wings: nothing outside them imports them. Without its line and its folder the rest works.
    "yawbench.bench",
    "yawbench.cluster",
    "yawbench.interop",
    "yawbench.linear",
    "yawbench.measured_cars",
    "yawbench.ranking",
)
