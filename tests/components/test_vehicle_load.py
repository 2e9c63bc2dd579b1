"""A load in the car: mass, centre of mass and inertias against sums over point masses."""

from __future__ import annotations

from pathlib import Path

import pytest

import yawbench as yb
from tests.refusals import refused
from yawbench.orchestrator.scenario import yaml_lines
from yawbench.vehicles.derivations import car_of, contradictions, known_car
from yawbench.vehicles.load import Load, load_of, loaded

CARS = Path(__file__).parents[2] / "scenarios/vehicles"
UNITS = (
    "driver_sine", "reference_steady_state", "controller_fnn", "allocator_load_proportional",
    "wheel_control_direct", "plant_seven_dof", "tyre_dugoff",
)  # fmt: skip


def quantities(name):
    """Return what a vehicle file gives, in SI."""
    data = yaml_lines.read(CARS / f"{name}.yaml", what="vehicle file").data["parameters"]
    known = known_car(data).values
    return {key: known[key] for key in data if key in known}


@pytest.mark.parametrize("name", ["mid_size", "suv", "van", "small_car"])
@pytest.mark.parametrize("load", [Load(300.0, -0.8, 0.9), Load(75.0, 0.4, 0.5)], ids=str)
def test_it_adds_as_a_point_mass_on_the_springs(name, load):
    given = quantities(name)
    before, after = car_of(given).values, loaded(given, load)
    assert contradictions(after) == []  # masses, heights and inertias still agree with each other
    now = car_of(after).values
    mass = before["mass"] + load.mass
    assert now["mass"] == pytest.approx(mass)
    # moments about the front axle, and about the road
    assert now["mass"] * now["cg_to_front_axle"] == pytest.approx(
        before["mass"] * before["cg_to_front_axle"] + load.mass * (before["cg_to_front_axle"] - load.x)
    )
    assert mass * now["cg_height"] == pytest.approx(before["mass"] * before["cg_height"] + load.mass * load.z)
    for wheels in ("unsprung_mass", "wheelbase"):
        assert now[wheels] == pytest.approx(before[wheels])
    # the yaw inertia about the front axle adds without a theorem
    about = [c["yaw_inertia"] + c["mass"] * c["cg_to_front_axle"] ** 2 for c in (before, now)]
    assert about[1] - about[0] == pytest.approx(load.mass * (before["cg_to_front_axle"] - load.x) ** 2)
    roll = [c["sprung_roll_inertia"] + c["sprung_mass"] * c["sprung_cg_height"] ** 2 for c in (before, now)]
    assert roll[1] - roll[0] == pytest.approx(load.mass * load.z**2)  # about an axis on the road


def test_loads_add_in_any_order_and_none_changes_nothing():
    given = quantities("mid_size")
    assert loaded(given, Load(0.0, 1.0, 1.0)).items() >= given.items()
    one, other = Load(100.0, -0.5, 0.8), Load(200.0, 0.7, 0.4)

    def both(first, second):
        between = loaded(given, first)
        moved = between["cg_to_front_axle"] - given["cg_to_front_axle"]  # x counts from the new centre
        return loaded(between, Load(second.mass, second.x + moved, second.z))

    assert both(one, other) == pytest.approx(both(other, one))


def test_it_is_written_as_a_mass_at_a_place():
    assert load_of("300 kg at (-0.8 m, 0.9 m)") == load_of("300 at (-0.8, 0.9)") == Load(300.0, -0.8, 0.9)
    assert load_of("0.3 t at (-80 cm, 900 mm)") == load_of("300 kg at (-0.8 m, 0.9 m)")
    for wrong in ("300 kg", "300 kg at 0.5 m", "300 m at (0, 0)", "-1 kg at (0, 0)", 300):
        with pytest.raises(ValueError):
            load_of(wrong)


def test_a_scenario_takes_it_and_says_what_it_makes_of_the_car(fmus):
    base = yb.load("fnn_sideslip/25mps")
    plan = base.set({"vehicle.load": "300 kg at (-0.5 m, 0.8 m)"}).plan()
    plant = next(one for one in plan.instances if one.name == "plant").parameters
    assert plant["mass"] == 1400.0
    assert plant["cg_to_front_axle"] == pytest.approx((1100 * 1.256 + 300 * (1.256 + 0.5)) / 1400)
    assert any("vehicle.load = 300 kg" in str(note) and "1400" in str(note) for note in plan.diagnostics)
    with refused(yb.ScenarioError, names=("vehicle.load=300 kg", "at (x, z)")):
        base.set({"vehicle.load": "300 kg"})
