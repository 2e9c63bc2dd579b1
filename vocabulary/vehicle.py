"""Quantities of vehicle files: name, unit of measurement and meaning.

FMU parameters with these names have the same meaning and unit.
"""

from typing import NamedTuple


class VehicleQuantity(NamedTuple):
    """Properties of a quantity."""

    unit: str
    text: str
    needed: bool = False
    """Whether a vehicle file must contain it, because an FMU's default only applies to the FMU's own car."""
    minimum: float | None = None
    plausible: tuple[float, float] | None = None
    """Smallest and largest plausible value; 0 may mean that a feature is off. Chosen: wider than for road
    vehicles from a light quadricycle, about 400 kg, to the heaviest of FMVSS 126, 4536 kg, so that only
    mistakes are outside."""


CAR: dict[str, VehicleQuantity] = {
    "mass": VehicleQuantity("kg", "Mass m of the car as it drives", True, 1.0, plausible=(300, 5000)),
    "sprung_mass": VehicleQuantity(
        "kg", "Mass m_s supported by the springs", True, 0.0, plausible=(200, 5000)
    ),
    "unsprung_mass": VehicleQuantity(
        "kg", "Mass m_u of all wheels and the parts that move with them", minimum=0.0, plausible=(30, 800)
    ),
    "unsprung_mass_front": VehicleQuantity(
        "kg", "Unsprung mass of both front wheels", minimum=0.0, plausible=(15, 400)
    ),
    "unsprung_mass_rear": VehicleQuantity(
        "kg", "Unsprung mass of both rear wheels", minimum=0.0, plausible=(15, 400)
    ),
    "front_unsprung_share": VehicleQuantity(
        "1", "Front share of the unsprung mass", minimum=0.0, plausible=(0.2, 0.8)
    ),
    "front_load_share": VehicleQuantity(
        "1", "Share of the weight on the front axle at rest", minimum=0.0, plausible=(0.2, 0.8)
    ),
    "yaw_inertia": VehicleQuantity(
        "kg.m2", "Yaw inertia I_z of the whole car", True, 1.0, plausible=(150, 15000)
    ),
    "sprung_yaw_inertia": VehicleQuantity(
        "kg.m2", "Yaw inertia of the sprung mass about its own centre", minimum=1.0, plausible=(100, 15000)
    ),
    "roll_inertia": VehicleQuantity(
        "kg.m2", "Roll inertia I_x of the sprung mass about the roll axis", True, 1.0, plausible=(30, 5000)
    ),
    "sprung_roll_inertia": VehicleQuantity(
        "kg.m2", "Roll inertia of the sprung mass about its own centre", True, 1.0, plausible=(20, 5000)
    ),
    "sprung_pitch_inertia": VehicleQuantity(
        "kg.m2", "Pitch inertia of the sprung mass about its own centre", True, 1.0, plausible=(100, 15000)
    ),
    "sprung_roll_yaw_product": VehicleQuantity(
        "kg.m2",
        "Product of inertia I_xz of the sprung mass about its own centre, positive where its front is heavy "
        "on top",
    ),
    "wheelbase": VehicleQuantity("m", "Distance L between the axles", minimum=0.1, plausible=(1.4, 5)),
    "cg_to_front_axle": VehicleQuantity(
        "m", "Distance a of the centre of mass from the front axle", True, 0.1, plausible=(0.4, 3.5)
    ),
    "cg_to_rear_axle": VehicleQuantity(
        "m", "Distance b of the centre of mass from the rear axle", True, 0.1, plausible=(0.4, 3.5)
    ),
    "cg_to_front_end": VehicleQuantity(
        "m", "Distance of the centre of mass from the front end", minimum=0.0, plausible=(0.5, 5)
    ),
    "cg_to_rear_end": VehicleQuantity(
        "m", "Distance of the centre of mass from the rear end", minimum=0.0, plausible=(0.5, 5)
    ),
    "sprung_cg_offset": VehicleQuantity(
        "m", "Distance of the centre of the sprung mass ahead of that of the car"
    ),
    "track_width": VehicleQuantity("m", "Track d, the same for both axles", True, 0.1, plausible=(0.7, 2.3)),
    "track_width_front": VehicleQuantity("m", "Track of the front axle", minimum=0.1, plausible=(0.7, 2.3)),
    "track_width_rear": VehicleQuantity("m", "Track of the rear axle", minimum=0.1, plausible=(0.7, 2.3)),
    "vehicle_width": VehicleQuantity(
        "m", "Width of the body without mirrors", minimum=0.1, plausible=(0.9, 2.7)
    ),
    "cg_height": VehicleQuantity("m", "Height h of the centre of mass", True, 0.0, plausible=(0.2, 1.5)),
    "sprung_cg_height": VehicleQuantity(
        "m", "Height of the centre of the sprung mass", minimum=0.0, plausible=(0.2, 1.8)
    ),
    "unsprung_height": VehicleQuantity(
        "m", "Height of the wheels' centres", True, 0.0, plausible=(0.15, 0.6)
    ),
    "roll_centre_height_front": VehicleQuantity("m", "Front roll centre", True, plausible=(-0.5, 1)),
    "roll_centre_height_rear": VehicleQuantity("m", "Rear roll centre", True, plausible=(-0.5, 1)),
    "roll_axis_height": VehicleQuantity("m", "Distance of the roll axis below the centre of the sprung mass"),
    "roll_arm": VehicleQuantity(
        "m", "Height h_s of the sprung mass above the roll axis", True, 0.0, plausible=(0, 1.5)
    ),
    "spring_stiffness_front": VehicleQuantity(
        "N/m", "Front spring, at the wheel", True, 0.0, plausible=(3e3, 5e5)
    ),
    "spring_stiffness_rear": VehicleQuantity(
        "N/m", "Rear spring, at the wheel", True, 0.0, plausible=(3e3, 5e5)
    ),
    "damping_front": VehicleQuantity("N.s/m", "Front damper, at the wheel", True, 0.0, plausible=(100, 5e4)),
    "damping_rear": VehicleQuantity("N.s/m", "Rear damper, at the wheel", True, 0.0, plausible=(100, 5e4)),
    "anti_roll_stiffness_front": VehicleQuantity(
        "N/m",
        "Front anti-roll bar, force at each wheel per difference of travel, negative for a bar that stiffens "
        "heave",
        True,
    ),
    "anti_roll_stiffness_rear": VehicleQuantity(
        "N/m",
        "Rear anti-roll bar, force at each wheel per difference of travel, negative for a bar that stiffens "
        "heave",
        True,
    ),
    "roll_stiffness": VehicleQuantity(
        "N.m/rad", "Roll stiffness K of the car on its tyres", True, 0.0, plausible=(5e3, 2e6)
    ),
    "roll_stiffness_front": VehicleQuantity("N.m/rad", "Roll stiffness of the front axle", minimum=0.0),
    "roll_stiffness_rear": VehicleQuantity("N.m/rad", "Roll stiffness of the rear axle", minimum=0.0),
    "front_roll_share": VehicleQuantity("1", "Front share of the roll stiffness", True, 0.0),
    "roll_damping": VehicleQuantity("N.m.s/rad", "Roll damping C of the car on its tyres", True, 0.0),
    "roll_damping_front": VehicleQuantity("N.m.s/rad", "Roll damping of the front axle", minimum=0.0),
    "roll_damping_rear": VehicleQuantity("N.m.s/rad", "Roll damping of the rear axle", minimum=0.0),
    "roll_camber_front": VehicleQuantity(
        "1", "Roll camber of the front axle: inclination of its wheels over the body's roll angle"
    ),
    "roll_camber_rear": VehicleQuantity(
        "1", "Roll camber of the rear axle: inclination of its wheels over the body's roll angle"
    ),
    "roll_steer_front": VehicleQuantity(
        "1",
        "Roll steer of the front axle, positive out of the turn: steer of its wheels over the body's roll angle",
    ),
    "roll_steer_rear": VehicleQuantity(
        "1",
        "Roll steer of the rear axle, positive into the turn: steer of its wheels over the body's roll angle",
    ),
    "steer_compliance_front": VehicleQuantity(
        "rad/N", "Steer by which the front wheels yield to the side force of their axle", minimum=0.0
    ),
    "steer_compliance_rear": VehicleQuantity(
        "rad/N", "Steer by which the rear wheels yield to the side force of their axle", minimum=0.0
    ),
    "tyre_relaxation_length": VehicleQuantity(
        "m", "Distance over which the slip angle of the tyres' side force lags; 0: none", minimum=0.0
    ),
    "steering_ratio": VehicleQuantity(
        "1", "Hand-wheel angle over road-wheel angle", minimum=0.1, plausible=(1, 40)
    ),
    "wheel_radius": VehicleQuantity("m", "Rolling radius R of the wheels", True, 0.05, plausible=(0.15, 0.6)),
    "wheel_inertia": VehicleQuantity("kg.m2", "Inertia J of a wheel", True, 0.01, plausible=(0.1, 10)),
    "tyre_vertical_stiffness": VehicleQuantity("N/m", "Tyre spring k_t", True, 1.0, plausible=(3e4, 1e6)),
    "static_load_front": VehicleQuantity(
        "N", "Load of a front wheel at rest", minimum=0.0, plausible=(500, 3e4)
    ),
    "static_load_rear": VehicleQuantity(
        "N", "Load of a rear wheel at rest", minimum=0.0, plausible=(500, 3e4)
    ),
    "nominal_load": VehicleQuantity("N", "Nominal load F_z0 of the tyres", minimum=1.0, plausible=(500, 3e4)),
    "unloaded_radius": VehicleQuantity(
        "m", "Radius R_0 of the tyres without load", minimum=0.05, plausible=(0.15, 0.6)
    ),
    "cornering_stiffness": VehicleQuantity(
        "N/rad",
        "Cornering stiffness of a tyre, for load-independent tyre models",
        minimum=0.0,
        plausible=(3e3, 5e5),
    ),
    "longitudinal_stiffness": VehicleQuantity(
        "N", "Slip stiffness of a tyre, for load-independent tyre models", minimum=0.0
    ),
    "cornering_stiffness_scale_front": VehicleQuantity(
        "1", "Scales the front tyres' cornering stiffness", minimum=0.0
    ),
    "cornering_stiffness_scale_rear": VehicleQuantity(
        "1", "Scales the rear tyres' cornering stiffness", minimum=0.0
    ),
    "cornering_stiffness_front": VehicleQuantity(
        "N/rad", "Cornering stiffness C_f of the front axle", minimum=1.0, plausible=(5e3, 1e6)
    ),
    "cornering_stiffness_rear": VehicleQuantity(
        "N/rad", "Cornering stiffness C_r of the rear axle", minimum=1.0, plausible=(5e3, 1e6)
    ),
    "drag_coefficient": VehicleQuantity("1", "Drag coefficient C_D", minimum=0.0, plausible=(0, 2)),
    "frontal_area": VehicleQuantity("m2", "Frontal area A", minimum=0.0, plausible=(0, 10)),
    "air_density": VehicleQuantity("kg/m3", "Air density rho", minimum=0.0, plausible=(0, 2)),
    "rolling_resistance": VehicleQuantity("1", "Rolling resistance f", minimum=0.0, plausible=(0, 0.5)),
    "torque_limit": VehicleQuantity("N.m", "Largest motor torque at a wheel", minimum=0.0),
    "drive_front_share": VehicleQuantity("1", "Share of the drive force on the front axle", minimum=0.0),
    "brake_factor_front": VehicleQuantity("m3", "Torque of a front brake per pressure", minimum=0.0),
    "brake_factor_rear": VehicleQuantity("m3", "Torque of a rear brake per pressure", minimum=0.0),
    "brake_torque_limit": VehicleQuantity("N.m", "Largest brake torque of a wheel", minimum=0.0),
}
