"""Magic Formula tyre of MF-Tyre 6.1, 6.2 and 5.2 with relaxation lengths.

Forces and moments are those of `tyres/magic_formula_62.py`, at the slips of the contact patch instead of
those of the wheel. The slips of the contact patch follow over the relaxation lengths sigma_x and sigma_y of
F_x and F_y (`tyre_models/relaxation.py`):

    du_x/dt = s_x - V_x u_x / sigma_x    s_x = w R - v,      V_x = max(|w R|, |v|),    kappa' = u_x / sigma_x
    du_y/dt = s_y - V_y u_y / sigma_y    s_y lateral speed,  V_y = sqrt(v^2 + s_y^2),
                                                                               sin(alpha') = u_y / sigma_y

solved exactly over a step. In steady motion kappa' and alpha' are the wheel's own slips. At rest both
deflections are springs, on which a stopped car would oscillate without end: below `damping_speed` a parallel
damper fades in, kappa' + k s_x / K_x, sin(alpha') - k s_y / K_y. The grip of the sliding contact limits the
deflections to hypot(K_x kappa', K_y sin(alpha')) = 3 mu F_z, or to the value for the wheel's own slips in
their direction if that is larger. Otherwise a car that slides to rest on locked wheels, kappa' = -1, would be
thrown back by a whole relaxation length.

Slip speeds are computed from wheel_speed, wheel_velocity and slip_angle; the latter refers to `low_speed` for
slower wheels. wheel_radius and low_speed must therefore be those of the plant, as with a vehicle file.

slip_stiffness is the derivative of the force at the end of a step by the slip held over the step,
dF_x/dkappa' (1 - exp(-V_x h / sigma_x)) plus the part of the damper, which the plant needs to integrate the
wheel spin.

Source: H. B. Pacejka, Tyre and Vehicle Dynamics, 3rd ed. 2012, sections 7.2 and 8.6; I. J. M. Besselink,
A. J. C. Schmeitz, H. B. Pacejka, Vehicle System Dynamics 48 (2010), for the relaxation lengths. Ours differs:
V_x and V_y bound the deflections when a wheel spins or slides sideways, which |v| would not.
"""

from dataclasses import dataclass
from math import asin, cos, hypot, pi, sin, tan

from ..cars.car import StartParameters
from ..cars.published_cars import PaperB
from ..fmi.variables import like, output, parameter, parameter_class, signal
from ..tyre_models.pacejka_2002 import SMALLEST_LOAD
from ..tyre_models.pacejka_2012 import longitudinal_curve, side_force, wheel_forces, whole_set
from ..tyre_models.pacejka_2012_set import RELAXATION, Pacejka2012Parameters, of_axles
from ..tyre_models.relaxation import SLIDES, deflected, gripped, part, relaxation_lengths, relaxation_set
from ..tyre_models.tyre import INPUTS, Tyre
from .magic_formula_62 import WHEELS

AT_ONCE = ("vertical_load_*", "friction_*", "inclination_angle_*")
OF_SIDE = ("vertical_load_*", "inclination_angle_*")
FIRST_STEP = 0.001
"""Step [s] for the slip stiffness before the first step; chosen: the usual communication step."""

_Relaxation = parameter_class(__name__, "_Relaxation", of_axles(RELAXATION), bases=(Pacejka2012Parameters,))


@dataclass(frozen=True)
class TransientParameters(_Relaxation):  # type: ignore[misc, valid-type]  # made by make_dataclass
    """Coefficients of both axles, and parameters of slip speeds and standstill."""

    relaxation_length: float = parameter(
        0.5, "m", "Relaxation length of a set without one", "chosen: a passenger car tyre's", minimum=0.02
    )
    damping: float = parameter(
        3000.0,
        "N.s/m",
        "Damping k parallel to the deflection at rest",
        "chosen: a stopping car oscillates for less than a second",
        minimum=0.0,
    )
    damping_speed: float = parameter(
        2.5, "m/s", "Speed above which this damping is zero", "chosen: walking pace", minimum=0.001
    )
    wheel_radius: float = like(PaperB, "wheel_radius")
    low_speed: float = like(StartParameters, "low_speed")


class MagicFormula62Transient(Tyre):
    """Magic Formula tyres (MF-Tyre 6.2, 6.1, 5.2) with relaxation lengths."""

    Parameters = TransientParameters
    inputs = (
        *INPUTS,
        signal("inclination_angle_*", optional=True),
        "wheel_velocity_*",
        "wheel_speed_*",
    )
    outputs = (
        output("tyre_force_x_*", *AT_ONCE),
        output("tyre_force_y_*", *AT_ONCE),
        output("aligning_moment_*", *AT_ONCE),
        output("overturning_moment_*", *AT_ONCE),
        output("slip_stiffness_*", *AT_ONCE),
        output("tyre_slip_ratio_*"),
        output("patch_slip_ratio_*", "vertical_load_*", unit="1", text="Slip kappa' of the contact patch"),
        output("patch_slip_angle_*", *OF_SIDE, unit="rad", text="Slip angle alpha' of the contact patch"),
        output("relaxation_length_x_*", "vertical_load_*", unit="m", text="Relaxation length of F_x"),
        output("relaxation_length_y_*", *OF_SIDE, unit="m", text="Relaxation length of F_y"),
    )

    def configure(self) -> None:
        self.sets = [whole_set(self.p, axle, left=left) for axle, left in WHEELS]
        self.lags = [relaxation_set(self.p, axle) for axle, _ in WHEELS]

    def start(self, t: float, u: list[float]) -> None:
        self.step_size = FIRST_STEP
        self._see(u)
        self.lengths = self._stiffnesses(u)
        self.deflections = [
            (s_x * sigma_x / v_x if v_x else 0.0, s_y * sigma_y / v_y if v_y else 0.0)
            for (s_x, v_x, s_y, v_y, _), (sigma_x, sigma_y, *_) in zip(self.speeds, self.lengths, strict=True)
        ]

    def advance(self, t: float, h: float, u: list[float]) -> None:
        before, self.lengths = self.lengths, self._stiffnesses(u)
        if h <= 0.0:
            return
        self.step_size = h
        self._see(u)
        _, _, loads, frictions, *_ = self.by_signal(u)
        low, slow = self.p.low_speed, self.p.damping_speed
        for i, ((x, y), (s_x, v_x, s_y, v_y, _), old, new) in enumerate(
            zip(self.deflections, self.speeds, before, self.lengths, strict=True)
        ):  # loads are those of the step's end; lengths at its middle are means
            x = deflected(x, s_x, v_x, 0.5 * (old[0] + new[0]), h)
            y = deflected(y, s_y, v_y, 0.5 * (old[1] + new[1]), h)
            if v_x < slow and v_y < slow:
                sigma_x, sigma_y, k_x, k_y = new
                of_wheel = k_x * s_x / max(v_x, low), k_y * s_y / max(v_y, low)
                of_patch = k_x * x / sigma_x, k_y * y / sigma_y
                kept = gripped(of_patch, of_wheel, SLIDES * frictions[i] * loads[i])
                x, y = kept * x, kept * y
            self.deflections[i] = x, y

    def output(self, t: float, u: list[float]) -> list[float]:
        p, h = self.p, self.step_size
        _, _, loads, frictions, cambers, _, _ = self.by_signal(u)
        rows = []
        for i, ((x, y), (s_x, v_x, s_y, v_y, forward)) in enumerate(
            zip(self.deflections, self.speeds, strict=True)
        ):
            sigma_x, sigma_y, k_x, k_y = self.lengths[i]
            damper_x = self._damping(v_x) / k_x if k_x > 0.0 else 0.0
            damper_y = self._damping(v_y) / -k_y if k_y < 0.0 else 0.0
            kappa = min(max(x / sigma_x + damper_x * s_x, -2.0), 2.0)
            alpha = asin(min(max(y / sigma_y + damper_y * s_y, -1.0), 1.0))
            if not forward:
                alpha = pi - alpha if alpha >= 0.0 else -pi - alpha
            *forces, slope = wheel_forces(kappa, alpha, cambers[i], loads[i], frictions[i], self.sets[i])
            passed = max(v_x, p.low_speed) * (h * part(v_x * h / sigma_x) / sigma_x + damper_x)
            rows.append((*forces, slope * min(passed, 1.0), self.slips[i], kappa, alpha, sigma_x, sigma_y))
        return [value for of_wheels in zip(*rows, strict=True) for value in of_wheels]

    def _see(self, u: list[float]) -> None:
        """Store slip speeds, rolling speeds and direction of travel from the inputs."""
        angles, self.slips, _, _, _, velocities, spins = self.by_signal(u)
        radius, low = self.p.wheel_radius, self.p.low_speed
        self.speeds = []
        for alpha, v, w in zip(angles, velocities, spins, strict=True):
            rolling, along = w * radius, cos(alpha)
            s_y = v * tan(alpha) if abs(v) >= low * abs(along) else low * sin(alpha)
            forward = along >= 0.0
            self.speeds.append((rolling - v, max(abs(rolling), abs(v)), s_y, hypot(v, s_y), forward))

    def _stiffnesses(self, u: list[float]) -> list[tuple[float, float, float, float]]:
        """Return sigma_x, sigma_y [m], K_x [N] and K_y [N/rad] of each wheel at the load of the inputs."""
        _, _, loads, _, cambers, _, _ = self.by_signal(u)
        rows = []
        for load, gamma, (common, longitudinal, lateral, *_), lag in zip(
            loads, cambers, self.sets, self.lags, strict=True
        ):
            mirror, _, top, load_scale, *_ = common
            load = min(max(load, SMALLEST_LOAD), top)
            df, gamma = load * load_scale - 1.0, mirror * gamma
            k_x = longitudinal_curve(0.0, gamma, load, df, 1.0, longitudinal)[7]
            k_y = side_force(0.0, gamma, load, df, 1.0, lateral)[2]
            rows.append((*relaxation_lengths(load, gamma, k_x, k_y, lag), k_x, k_y))
        return rows

    def _damping(self, v: float) -> float:
        """Return the damping k [N.s/m] at a rolling speed."""
        p = self.p
        return p.damping * 0.5 * (1.0 + cos(pi * v / p.damping_speed)) if v < p.damping_speed else 0.0
