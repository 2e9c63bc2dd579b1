"""Observer of sideslip and friction: a Kalman filter on a single track whose axles saturate.

The filter stands in `estimation.single_track_filter`, with its equations and its guards; zero points, roll
compensation, speed, slips and loads in `estimation.estimator`. Friction begins at `initial_friction`, best
low: upwards it is learned at once, from the acceleration that there is; it stays where tyres are not used.

Tuned once, the same for all cars: the spread of a_y stands for what a single track leaves out (load transfer,
combined slip, another tyre law), not for the sensor's noise. Limits and what it reaches: docs/estimators.md.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..estimation.estimator import OUTPUTS, Estimator, EstimatorParameters
from ..estimation.single_track_filter import SingleTrackFilter
from ..fmi.variables import parameter, signal

_TUNED = "chosen: on runs of four cars, see docs/estimators.md"


@dataclass(frozen=True)
class ObserverParameters(EstimatorParameters):
    """Of the filter."""

    cornering_stiffness_front: float = parameter(
        91600.0, "N/rad", "Stiffness C_f of the front axle", "chosen: that of the tyres of set 1", minimum=1.0
    )
    cornering_stiffness_rear: float = parameter(
        67800.0, "N/rad", "Stiffness C_r of the rear axle", "chosen: that of the tyres of set 1", minimum=1.0
    )
    initial_friction: float = parameter(
        0.6, "1", "Friction to begin with", "chosen: low, since upwards is learned at once", minimum=0.05
    )
    initial_friction_deviation: float = parameter(
        0.3, "1", "How far that may be wrong", "chosen: from ice to dry roads within two of it", minimum=0.0
    )
    largest_friction: float = parameter(
        1.2, "1", "Largest friction that is believed", "chosen: beyond tyres of cars", minimum=0.1
    )
    friction_memory: float = parameter(
        2.0, "s", "Time after which a used friction is forgotten", "chosen: a lane change", minimum=0.01
    )
    used_share: float = parameter(
        0.95, "1", "Friction is at least this part of what is used", "chosen: for noise in a_y", minimum=0.0
    )
    measured_share: float = parameter(
        0.5, "1", "Share of the measured a_y in the prediction", _TUNED, minimum=0.0, maximum=1.0
    )
    velocity_wander: float = parameter(
        0.2, "m/s2", "Random walk of v_y, m/s per root of a second", _TUNED, minimum=0.0
    )
    friction_wander: float = parameter(
        0.5, "1", "Random walk of friction, per root of a second", _TUNED, minimum=0.0
    )
    acceleration_deviation: float = parameter(
        0.5, "m/s2", "How far the model's a_y is from the measured one", _TUNED, minimum=0.001
    )
    straight_fade: float = parameter(
        0.1, "s", "Time constant with which v_y fades straight ahead", "chosen: fast", minimum=0.001
    )


class Observer(Estimator):
    """Observer of sideslip and friction on a single track with saturating axles; speed, slips, loads."""

    Parameters = ObserverParameters
    outputs = (*OUTPUTS, signal("friction", depends_on=OUTPUTS[0].depends_on))

    def begin(self) -> None:
        self.filter = SingleTrackFilter(self.p)

    def lateral(
        self, h: float, *, r: float, delta: float, a_x: float, a_y: float, straight: float
    ) -> tuple[float, float]:
        self.filter.see(h, v_x=self.speed.v, r=r, delta=delta, a_x=a_x, a_y=a_y, straight=straight)
        return self.filter.v_y, self.filter.rate

    def output(self, t: float, u: list[float]) -> list[float]:
        return [*self.known, self.filter.mu]
