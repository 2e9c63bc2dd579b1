"""Parameters of a car with a sprung body, and the constants of `cars.ride` derived from them."""

from dataclasses import dataclass

from yawbench.vocabulary.gravity import G

from ..fmi.variables import like, of_car, parameter
from .car import DrivenCarParameters, StartParameters
from .published_cars import PaperA, PaperC
from .resistance import ResistanceParameters
from .ride import Ride
from .roll_camber import RollCamberParameters
from .wheel_steer import RollSteerParameters


@dataclass(frozen=True)
class FourteenDofParameters(
    StartParameters, RollCamberParameters, RollSteerParameters, ResistanceParameters, PaperC
):
    """Large saloon; values from paper C, table 1, where it has them."""

    sprung_mass: float = of_car(1650.0, "paper C, table 1", text="Sprung mass m_s", minimum=1.0)
    front_unsprung_share: float = of_car(0.5, "chosen: equal wheels", minimum=0.01, maximum=0.99)
    yaw_inertia: float = like(PaperA, "yaw_inertia", 3234.0, "paper C, table 1")
    sprung_roll_inertia: float = of_car(928.0, "chosen: a large saloon")
    sprung_pitch_inertia: float = of_car(2790.0, "chosen: a large saloon")
    sprung_roll_yaw_product: float = of_car(0.0, "chosen: principal axes along the car")
    cg_height: float = of_car(0.5093, "chosen: 0.53 for the sprung mass")
    unsprung_height: float = of_car(0.32, "chosen: tyre of 0.34, loaded")
    spring_stiffness_front: float = of_car(34000.0, "chosen: body modes at 1.3 to 1.7 Hz")
    spring_stiffness_rear: float = of_car(32000.0, "chosen: body modes at 1.3 to 1.7 Hz")
    damping_front: float = of_car(3000.0, "chosen: 0.3 to 0.4 of critical")
    damping_rear: float = of_car(2800.0, "chosen: 0.3 to 0.4 of critical")
    anti_roll_stiffness_front: float = of_car(14000.0, "chosen: 4.5 deg/g")
    anti_roll_stiffness_rear: float = of_car(6000.0, "chosen: 4.5 deg/g")
    roll_centre_height_front: float = of_car(0.06, "chosen: a strut axle")
    roll_centre_height_rear: float = of_car(0.11, "chosen: a multi-link axle")
    tyre_vertical_stiffness: float = of_car(230000.0, "chosen: a passenger car's, wheel hop at 12 Hz")
    wheel_inertia: float = of_car(1.5, "chosen: a passenger car's")
    drag_coefficient: float = of_car(0.3, "chosen: a saloon's")
    frontal_area: float = of_car(2.2, "chosen: a saloon's")
    rolling_resistance: float = of_car(0.012, "chosen: a passenger car tyre's")
    initial_speed: float = parameter(25.0, "m/s", "Speed at the start", "paper C: 90 km/h")
    initial_heave: float = parameter(
        0.0, "m", "Height of body and wheels above rest at the start", "chosen: on the road"
    )
    slip_stiffness_per_load: float = like(DrivenCarParameters, "slip_stiffness_per_load")


def ride_of(p: FourteenDofParameters) -> Ride:
    """Return the constants of body, suspension and tyre springs.

    Raises:
        ValueError: inconsistent masses or inertias, or springs too soft to support the body.
    """
    m_s = p.sprung_mass
    unsprung = p.mass - m_s
    if unsprung <= 0.0:
        raise ValueError(f"sprung_mass must be less than mass = {p.mass:g} kg (got {m_s:g})")
    m_f = 0.5 * p.front_unsprung_share * unsprung
    m_r = 0.5 * unsprung - m_f
    h, h_u, t = p.cg_height, p.unsprung_height, 0.5 * p.track_width
    h_s = (p.mass * h - unsprung * h_u) / m_s
    offset = 2.0 * (m_r * p.cg_to_rear_axle - m_f * p.cg_to_front_axle) / m_s  # of the sprung mass, forward
    a, b = p.cg_to_front_axle - offset, p.cg_to_rear_axle + offset
    if min(a, b) <= 0.0:
        raise ValueError(
            "the centre of the sprung mass must lie between the axles: correct front_unsprung_share or mass"
        )
    arms = m_s * (h_s - h) ** 2 + unsprung * (h - h_u) ** 2
    wheels = (
        2.0 * m_f * (p.cg_to_front_axle**2 + t * t)
        + 2.0 * m_r * (p.cg_to_rear_axle**2 + t * t)
        + m_s * offset * offset
    )
    if p.yaw_inertia <= wheels:
        raise ValueError(
            f"yaw_inertia is that of the whole car with its wheels: it must exceed {wheels:g} kg.m2 "
            f"(got {p.yaw_inertia:g})"
        )
    share = m_s * G / (2.0 * (a + b))
    load_f, load_r = share * b + m_f * G, share * a + m_r * G
    gravity_roll = 2.0 * (
        load_f * (h - p.roll_centre_height_front) + load_r * (h - p.roll_centre_height_rear)
    )
    gravity_pitch = p.mass * G * h
    k_f, k_r = p.spring_stiffness_front, p.spring_stiffness_rear
    s_f, s_r = p.anti_roll_stiffness_front, p.anti_roll_stiffness_rear
    against_roll = 2.0 * t * t * (k_f + k_r + 2.0 * (s_f + s_r))
    against_pitch = 2.0 * (k_f * a * a + k_r * b * b)
    if against_roll <= gravity_roll or against_pitch <= gravity_pitch or k_f + k_r <= 0.0:
        raise ValueError(
            f"springs and anti-roll bars must give more than {gravity_roll:g} N.m/rad in roll and "
            f"{gravity_pitch:g} in pitch, or the body falls over (got {against_roll:g} and {against_pitch:g})"
        )
    roll = p.sprung_roll_inertia + arms
    product = p.sprung_roll_yaw_product + m_s * offset * (h_s - h_u)
    return Ride(
        m_s=m_s,
        m_f=m_f,
        m_r=m_r,
        a=a,
        b=b,
        half_track=t,
        h=h,
        k_f=k_f,
        k_r=k_r,
        d_f=p.damping_front,
        d_r=p.damping_rear,
        s_f=s_f,
        s_r=s_r,
        p_f=p.roll_centre_height_front / t,
        p_r=p.roll_centre_height_rear / t,
        k_t=p.tyre_vertical_stiffness,
        load_f=load_f,
        load_r=load_r,
        gravity_roll=gravity_roll,
        gravity_pitch=gravity_pitch,
        roll=roll,
        pitch=p.sprung_pitch_inertia + arms,
        yaw_sprung=p.yaw_inertia - wheels,
        yaw=p.yaw_inertia - product * product / roll,
        tilt=product / roll,
    )
