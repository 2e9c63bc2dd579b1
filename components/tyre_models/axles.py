"""Cornering stiffness and grip of each axle, for tyres with load-independent stiffness.

The parameters that are first identified for a measured car are the cornering stiffnesses C_f and C_r of its
axles, for both tyres together: F_y = -C alpha of the axle. They include the compliance of suspension and
steering.
"""

from dataclasses import dataclass

from ..fmi.variables import parameter


@dataclass(frozen=True)
class AxleParameters:
    """Parameters of both axles."""

    cornering_stiffness_front: float = parameter(
        0.0, "N/rad", "Cornering stiffness C_f of the front axle; 0: that of two tyres",
        "chosen: all tyres are equal, as in paper A", minimum=0.0,
    )  # fmt: skip
    cornering_stiffness_rear: float = parameter(
        0.0, "N/rad", "Cornering stiffness C_r of the rear axle; 0: that of two tyres",
        "chosen: all tyres are equal, as in paper A", minimum=0.0,
    )  # fmt: skip
    grip_front: float = parameter(
        1.0, "1", "Friction of the front tyres over that of the road", "chosen: that of the road", minimum=0.0
    )
    grip_rear: float = parameter(
        1.0, "1", "Friction of the rear tyres over that of the road", "chosen: that of the road", minimum=0.0
    )


def of_axle(p: AxleParameters, name: str, of_tyre: float) -> tuple[float, float]:
    """Return the cornering stiffness of a tyre [N/rad] and the grip [1] of the axle "front" or "rear".

    Args:
        p: parameters of both axles.
        name: name of the axle.
        of_tyre: cornering stiffness of a tyre if the axle's is not given [N/rad].
    """
    of_both = getattr(p, f"cornering_stiffness_{name}")
    return (0.5 * of_both if of_both > 0.0 else of_tyre), getattr(p, f"grip_{name}")
