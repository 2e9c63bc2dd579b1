"""Road with patches of friction, slope, bank, and a gust of side wind.

    mu_i     = friction of the last patch with x_i, y_i, else of the table there, else the base friction
    x_i, y_i = x + a_i cos(psi) - d_i sin(psi),  y + a_i sin(psi) + d_i cos(psi)        wheel i at a_i, d_i
    friction = (mu_fl + mu_fr + mu_rl + mu_rr) / 4

Split friction, jumps and chequerboards are patches (`vocabulary.patches`): "y > 0", "60 < x < 80",
"x % 10 < 5, y % 3 < 1.5; x % 10 > 5, y % 3 > 1.5". Friction measured on a grid is a table
(`vocabulary.friction_table`). A tyre touches the road in a point.

`friction_delayed` is `friction` delayed by `friction_delay`, like that of an estimator. The connections of a
scenario decide whether reference and controller get the true friction, the delayed friction or a constant.

The road is a plane that rises by the angle sigma along its x axis and by epsilon along its y axis. Along the
vehicle's axes it rises by

    sin(slope) = sin(sigma) cos(psi) + sin(epsilon) sin(psi)
    sin(bank)  = sin(epsilon) cos(psi) - sin(sigma) sin(psi)

x, y, psi are measured in that plane. Between `incline_start` and `incline_end` sigma and epsilon are
constant; over `incline_run` at either end they change linearly with x. The same applies to the wind, with the
force F along the vehicle's y axis and the moment F `wind_arm` about its z axis.

Neglected: road height under single wheels, curvature of crests and dips, and the influence of the car's
motion on the wind.
"""

from dataclasses import dataclass
from math import asin, cos, pi, sin

from yawbench.vocabulary.friction_table import table_of
from yawbench.vocabulary.patches import friction_at, patches_of
from yawbench.vocabulary.wheels import Four

from ..cars.published_cars import PaperA
from ..fmi.component import Component
from ..fmi.variables import like, output, parameter
from ..mathematics.first_order_lag import Stage

EVERYWHERE = 1e6


@dataclass(frozen=True)
class PatchworkParameters:
    """Parameters of road and wind, and the positions of the car's wheels."""

    base_friction: float = parameter(
        0.9, "1", "Friction coefficient outside patches", "chosen: dry asphalt", minimum=0.0
    )
    patch_friction: float = parameter(
        0.2,
        "1",
        "Friction coefficient of patches without a value of their own",
        "chosen: packed snow",
        minimum=0.0,
    )
    patches: str = parameter(
        "", None, "Patches of other friction, such as 'y > 0' or '0.3: 60 < x < 80'", "chosen: none"
    )
    friction_table: str = parameter(
        "", None, "Friction over x and y, a row of x, then rows of y and friction", "chosen: none"
    )
    friction_delay: float = parameter(
        0.3, "s", "Delay of friction_delayed", "chosen: as of an estimator", minimum=0.0
    )
    cg_to_front_axle: float = like(PaperA, "cg_to_front_axle")
    cg_to_rear_axle: float = like(PaperA, "cg_to_rear_axle")
    track_width: float = like(PaperA, "track_width")
    road_slope: float = parameter(
        0.0, "rad", "Angle sigma by which the road rises along x", "chosen: level", minimum=-0.7, maximum=0.7
    )
    road_bank: float = parameter(
        0.0,
        "rad",
        "Angle epsilon by which the road rises along y",
        "chosen: level",
        minimum=-0.7,
        maximum=0.7,
    )
    incline_start: float = parameter(
        -EVERYWHERE, "m", "x from which slope and bank hold", "chosen: everywhere"
    )
    incline_end: float = parameter(EVERYWHERE, "m", "x up to which slope and bank hold", "chosen: everywhere")
    incline_run: float = parameter(
        10.0, "m", "Distance over which slope and bank come and go", "chosen: two car lengths", minimum=0.0
    )
    wind_force: float = parameter(0.0, "N", "Side force F of the wind, to the left", "chosen: calm")
    wind_arm: float = parameter(
        0.3, "m", "Distance of the wind force ahead of the centre of mass", "chosen: a saloon's", minimum=-3.0
    )
    wind_start: float = parameter(-EVERYWHERE, "m", "x from which the wind blows", "chosen: everywhere")
    wind_end: float = parameter(EVERYWHERE, "m", "x up to which the wind blows", "chosen: everywhere")
    wind_run: float = parameter(
        5.0, "m", "Distance over which the wind comes and goes", "chosen: the length of a car", minimum=0.0
    )


def section(x: float, start: float, end: float, run: float) -> float:
    """Return the factor at `x` [m]: 1 from `start` to `end`, falling to 0 over `run` [m] on either side."""
    outside = max(start - x, x - end)
    if outside <= 0.0:
        return 1.0
    return 0.0 if outside >= run else 1.0 - outside / run


def inclination(sigma: float, epsilon: float, psi: float) -> tuple[float, float]:
    """Return slope and bank [rad] in the axes of a vehicle at the yaw angle `psi` [rad].

    Args:
        sigma, epsilon: angles by which the road rises along its own axes x and y [rad].
    """
    along, across = sin(sigma), sin(epsilon)
    c, s = cos(psi), sin(psi)
    return asin(along * c + across * s), asin(across * c - along * s)


class Patchwork(Component):
    """Road with patches of friction, slope, bank, and a gust of side wind."""

    Parameters = PatchworkParameters
    inputs = ("position_x", "position_y", "yaw_angle")
    outputs = (
        output("friction_*", *inputs),
        output("friction", *inputs),
        "friction_delayed",
        output("slope", "position_x", "yaw_angle"),
        output("bank", "position_x", "yaw_angle"),
        output("wind_force_y", "position_x"),
        output("wind_moment_z", "position_x"),
    )

    def configure(self) -> None:
        p = self.p
        place = "patches"
        try:
            self.patches = patches_of(p.patches)
            place = "friction_table"
            self.table = table_of(p.friction_table)
        except ValueError as error:
            raise ValueError(f"{place}: {error}") from None
        steepest = sin(p.road_slope) ** 2 + sin(p.road_bank) ** 2
        if steepest > sin(0.25 * pi) ** 2:
            raise ValueError("road_slope and road_bank together are steeper than 45 degrees")

    def start(self, t: float, u: list[float]) -> None:
        self.friction = mean(self._frictions(u))
        self.late = Stage(tau=0.0, delay=self.p.friction_delay, value=self.friction)

    def advance(self, t: float, h: float, u: list[float]) -> None:
        self.late.advance(t, h, self.friction)
        self.friction = mean(self._frictions(u))

    def output(self, t: float, u: list[float]) -> tuple[float, ...]:
        p = self.p
        x, _, psi = u
        frictions = self._frictions(u)
        level = p.road_slope == 0.0 and p.road_bank == 0.0
        slope, bank = 0.0, 0.0
        if not level and (share := section(x, p.incline_start, p.incline_end, p.incline_run)):
            slope, bank = inclination(share * p.road_slope, share * p.road_bank, psi)
        wind = p.wind_force * section(x, p.wind_start, p.wind_end, p.wind_run)
        return (*frictions, mean(frictions), self.late.value, slope, bank, wind, wind * p.wind_arm)

    def _frictions(self, u: list[float]) -> Four:
        """Return the friction [1] under fl, fr, rl, rr."""
        p = self.p
        base, table = p.base_friction, self.table
        if not self.patches and table is None:
            return base, base, base, base
        x, y, psi = u
        c, s = cos(psi), sin(psi)
        half = 0.5 * p.track_width

        def under(along: float, across: float) -> float:
            point = x + (along * c - across * s), y + (along * s + across * c)
            measured = table.at(point) if table is not None else None
            beneath = base if measured is None else measured
            return friction_at(point, self.patches, base=beneath, patch=p.patch_friction)

        a, b = p.cg_to_front_axle, -p.cg_to_rear_axle
        return under(a, half), under(a, -half), under(b, half), under(b, -half)


def mean(frictions: Four) -> float:
    """Return the mean over four wheels, in an order that is symmetric in left and right."""
    fl, fr, rl, rr = frictions
    return 0.25 * ((fl + fr) + (rl + rr))
