"""No control: the yaw moment is always zero."""

from ..fmi.component import Component


class Off(Component):
    """No control: zero yaw moment."""

    outputs = ("yaw_moment",)
    sampled = True

    def output(self, t: float, u: list[float]) -> tuple[float, ...] | list[float]:
        return (0.0,)
