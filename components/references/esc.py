"""Driver's intent as a production stability control takes it: single-track model, limited by what a_y shows.

    model of cars.single_track_car, dynamic, characteristic speed v_ch = 1 / sqrt(K)
    |delta| <= share mu_s g / (v r/delta)       |r_ref| <= share mu_s g / v       |beta_ref| <= atan(c mu_s)

No friction is told. mu_s is what the measured lateral acceleration shows, from above:

    mu_y = max(|a_y| / g, last mu_y exp(-h / T_hold))                    the largest use of grip a while ago
    the driver wants more, v |r_ref| / g > mu_y + margin:   T_fall dmu_s/dt = mu_y + margin - mu_s
    otherwise:                                              T_rise dmu_s/dt = mu_0 - mu_s
    always:                                                 mu_s >= mu_y + margin, at most mu_0

A car that follows its driver thus keeps the friction of a dry road; one that is asked for more than it gives
has shown its limit. In a turn on a bank the accelerometer shows less than the tyres give; the margin covers
0.15 g, a bank of 8 degrees.

Source: that the intended yaw rate is limited by the measured lateral acceleration: A. T. van Zanten, R.
Erhardt, G. Pfaff, VDC, the vehicle dynamics control system of Bosch, SAE 950759, 1995, and the Automotive
Handbook of Bosch (from memory, without numbers); the share: R. Rajamani, Vehicle Dynamics and Control, 2nd
edition, chapter 8 (from memory). Chosen: the filter, its margin and times, by runs on friction 0.2 to 0.9 and
by sines of 1 to 5 m/s2.
"""

from dataclasses import dataclass
from math import exp

from yawbench.vocabulary.gravity import G

from ..control_laws.reference import SHOWN
from ..fmi.variables import like, output, parameter
from .single_track import SingleTrack, SingleTrackParameters

SEEN = ("steer_angle", "velocity_x", "acceleration_y")


@dataclass(frozen=True)
class EscReferenceParameters(SingleTrackParameters):
    """Parameters of the car, of the limits, and of the friction that the lateral acceleration shows."""

    mode: str = like(SingleTrackParameters, "mode", "dynamic", "chosen: the car answers with a delay")
    limit_steer_angle: bool = like(
        SingleTrackParameters, "limit_steer_angle", True, "chosen: the model does not run away from the car"
    )
    friction_share: float = like(
        SingleTrackParameters, "friction_share", 0.85, "Rajamani, section 8.2: 0.85 mu g / v"
    )
    dry_friction: float = parameter(
        1.0, "1", "Largest friction mu_0, assumed until the car shows less", "chosen: a dry road", minimum=0.1
    )
    friction_margin: float = parameter(
        0.15,
        "1",
        "Friction beyond that in use which the driver may ask for",
        "chosen: model error, bank",
        minimum=0.0,
    )
    friction_hold: float = parameter(
        0.5,
        "s",
        "Time constant T_hold of the friction in use",
        "chosen: a change of direction",
        minimum=0.001,
    )
    friction_fall: float = parameter(
        0.3,
        "s",
        "Time constant T_fall of falling friction",
        "chosen: longer than a car's a_y lags",
        minimum=0.001,
    )
    friction_rise: float = parameter(
        2.0, "s", "Time constant T_rise of rising friction", "chosen: one manoeuvre", minimum=0.001
    )


class EscReference(SingleTrack):
    """Driver's intent from the single-track model, limited by what the lateral acceleration shows."""

    Parameters = EscReferenceParameters
    inputs = SEEN
    outputs = (
        *(output(name, *SEEN) for name in SHOWN),
        output(
            "friction_shown",
            "velocity_x",
            "acceleration_y",
            unit="1",
            text="Friction coefficient mu_s that a_y shows, from above",
        ),
    )

    def begin(self, u: list[float]) -> tuple[float, float]:
        self.in_use = abs(u[2]) / G
        self.shown = self.p.dry_friction
        return super().begin([u[0], u[1], self.shown])

    def follow(self, h: float, u: list[float]) -> tuple[float, float]:
        p = self.p
        self.in_use = max(abs(u[2]) / G, self.in_use * exp(-h / p.friction_hold))
        least = min(self.in_use + p.friction_margin, p.dry_friction)
        wanted = abs(self.model[1]) * max(u[1], 0.0) / G
        if wanted > least:
            self.shown = least + (self.shown - least) * exp(-h / p.friction_fall)
        else:
            self.shown = p.dry_friction + (self.shown - p.dry_friction) * exp(-h / p.friction_rise)
        self.shown = max(self.shown, least)
        return super().follow(h, [u[0], u[1], self.shown])

    def output(self, t: float, u: list[float]) -> tuple[float, ...]:
        return *super().output(t, u), self.shown
