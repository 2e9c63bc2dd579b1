"""Observer of sideslip and friction: extended Kalman filter on a single-track model with saturating axles.

`estimation.single_track_filter` has the equations and safeguards of the filter, `estimation.estimator` zero
points, roll compensation, speed, slips and loads. `initial_friction` should be low: an increase is learned at
once, from the present acceleration, whereas friction is constant while the tyres are not used.

The tuning is the same for all cars: the standard deviation of a_y covers the effects that a single-track
model neglects (load transfer, combined slip, another tyre model), not sensor noise. Limits and accuracy:
docs/estimators.md.
"""

from ..estimation.estimator import OUTPUTS, Estimator
from ..estimation.single_track_filter import FilterParameters, SingleTrackFilter
from ..fmi.variables import signal


class Observer(Estimator):
    """Kalman filter for sideslip and friction on a saturating single-track model; speed, slips, loads."""

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
