"""Observer of sideslip and friction: a Kalman filter on a single track whose axles saturate.

The filter is in `estimation.single_track_filter`, with its equations and its guards; zero points, roll
compensation, speed, slips and loads in `estimation.estimator`. Friction begins at `initial_friction`, best
low: upwards it is learned at once, from the acceleration that there is; it stays where tyres are not used.

Tuned once, the same for all cars: the spread of a_y stands for what a single track leaves out (load transfer,
combined slip, another tyre law), not for the sensor's noise. Limits and what it reaches: docs/estimators.md.
"""

from ..estimation.estimator import OUTPUTS, Estimator
from ..estimation.single_track_filter import FilterParameters, SingleTrackFilter
from ..fmi.variables import signal


class Observer(Estimator):
    """Observer of sideslip and friction on a single track with saturating axles; speed, slips, loads."""

    Parameters = FilterParameters
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
