"""Quantities of vehicle files: those that components know (`vocabulary.vehicle`), and the size of the body.

Components that are judged by a car's size have it as parameters of their own, from its centre of mass.
"""

from yawbench.vocabulary.vehicle import CAR as OF_COMPONENTS
from yawbench.vocabulary.vehicle import VehicleQuantity

BODY = {
    "vehicle_length": VehicleQuantity("m", "Length of the body", minimum=0.1, plausible=(2, 7.5)),
    "vehicle_height": VehicleQuantity(
        "m", "Height of the body above the road", minimum=0.1, plausible=(1, 3)
    ),
    "front_overhang": VehicleQuantity(
        "m", "Distance of the front end from the front axle", minimum=0.0, plausible=(0.2, 2)
    ),
    "rear_overhang": VehicleQuantity(
        "m", "Distance of the rear end from the rear axle", minimum=0.0, plausible=(0.2, 2.5)
    ),
}
"""Quantities that scenes alone need."""
CAR = OF_COMPONENTS | BODY
