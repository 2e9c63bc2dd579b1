"""One vehicle file for every plant: what follows from it, what units take of it, what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest
from ruamel.yaml import YAML

from tests.cars import load_scenario, make_plan
from tests.changed import changed
from tests.fmus.fake_fmus import Var, make_fmu, out
from tests.refusals import each_mentions, mentions, refused, texts_of
from yawbench.commands.check import show
from yawbench.components.cars.sprung_car import FourteenDofParameters, ride_of
from yawbench.foundation.errors import WiringError
from yawbench.orchestrator.plan import ValueOrigin
from yawbench.vehicles.derivations import DERIVATIONS, adapted, car_of, contradictions
from yawbench.vocabulary.gravity import G

SALOON = Path(__file__).parents[2] / "scenarios" / "vehicles" / "large_saloon.yaml"


@pytest.fixture(scope="module")
def saloon():
    """The file of the large saloon, with unequal wheels."""
    given = YAML(typ="safe").load(SALOON.read_text(encoding="utf-8"))["parameters"]
    return {name: float(value) for name, value in given.items()} | {"front_unsprung_share": 0.4}


# Derivations


def test_whatever_is_known_of_a_car_all_formulas_agree(saloon):
    whole = car_of(saloon).values
    for one in DERIVATIONS:
        if one.name in whole and all(name in whole for name in one.inputs):
            found = one.value(*(whole[name] for name in one.inputs))
            assert found == pytest.approx(whole[one.name], rel=1e-12), one
    assert contradictions(whole) == []


@pytest.mark.parametrize(
    ("instead", "of"),
    [
        (("unsprung_mass",), "mass"),
        (("unsprung_mass",), "sprung_mass"),
        (("wheelbase",), "cg_to_rear_axle"),
        (("wheelbase",), "cg_to_front_axle"),
        (("sprung_cg_height",), "cg_height"),
        (("sprung_cg_height", "roll_arm"), "cg_height"),
        (("roll_inertia",), "sprung_roll_inertia"),
    ],
)
def test_what_another_data_sheet_gives_leads_to_the_same_car(saloon, instead, of):
    whole = car_of(saloon).values
    other = {**saloon, **{name: whole[name] for name in instead}}
    del other[of]
    assert car_of(other).values[of] == pytest.approx(saloon[of], rel=1e-12)


@pytest.mark.parametrize(("axle", "mass"), [("front", 72.0), ("rear", 108.0)])
def test_the_unsprung_mass_of_either_axle_tells_how_all_of_it_is_shared(saloon, axle, mass):
    by_axle = {name: value for name, value in saloon.items() if name != "front_unsprung_share"}
    whole = car_of(by_axle | {f"unsprung_mass_{axle}": mass}).values
    assert whole["front_unsprung_share"] == pytest.approx(0.4, rel=1e-12)
    assert whole["sprung_cg_offset"] == pytest.approx(car_of(saloon).values["sprung_cg_offset"], rel=1e-12)


def test_the_derived_car_is_that_of_the_equations_of_motion(saloon):
    known = {name: value for name, value in saloon.items() if name in FourteenDofParameters.__annotations__}
    p = FourteenDofParameters(**known)
    ride, car = ride_of(p), car_of(saloon).values
    assert 2.0 * ride.load_f + 2.0 * ride.load_r == pytest.approx(p.mass * G, rel=1e-12)
    assert [car["static_load_front"], car["static_load_rear"]] == pytest.approx([ride.load_f, ride.load_r])
    centres = [p.roll_centre_height_front] * 2 + [p.roll_centre_height_rear] * 2
    wheels = [ride.m_f, ride.m_f, ride.m_r, ride.m_r]
    leaning = sum(m * G * (p.unsprung_height - h) for m, h in zip(wheels, centres, strict=True))
    sprung = car["sprung_mass"] * G * car["roll_arm"]  # eight degrees of freedom: its wheels do not lean
    assert sprung + leaning == pytest.approx(ride.gravity_roll, rel=1e-12)
    assert car["sprung_cg_offset"] != 0.0
    given = {name: value for name, value in saloon.items() if name != "yaw_inertia"}
    whole = car_of(given | {"sprung_yaw_inertia": ride.yaw_sprung}).values
    assert whole["yaw_inertia"] == pytest.approx(p.yaw_inertia, rel=1e-12)


def test_springs_in_series_with_stiff_tyres_are_the_springs(saloon):
    car = car_of(saloon | {"tyre_vertical_stiffness": 1e12}).values
    d = saloon["track_width"]
    for axle in ("front", "rear"):
        at_wheel = saloon[f"spring_stiffness_{axle}"] + 2.0 * saloon[f"anti_roll_stiffness_{axle}"]
        assert car[f"roll_stiffness_{axle}"] == pytest.approx(0.5 * d * d * at_wheel, rel=1e-6)
        assert car[f"roll_damping_{axle}"] == pytest.approx(0.5 * d * d * saloon[f"damping_{axle}"], rel=1e-6)


def test_values_that_contradict_each_other_are_named():
    ((name, sentence),) = contradictions({"mass": 1900.0, "sprung_mass": 1650.0, "unsprung_mass": 180.0})
    assert name == "mass"
    assert mentions(sentence, "1900 kg", "sprung_mass", "unsprung_mass", "1830 kg")
    assert contradictions({"mass": 1831.0, "sprung_mass": 1650.0, "unsprung_mass": 180.0}) == []
    by_axle = {"sprung_mass": 1650.0, "unsprung_mass_front": 90.0, "unsprung_mass_rear": 90.0}
    assert [name for name, _ in contradictions({"mass": 1900.0, **by_axle})] == ["mass"]


def test_a_car_that_weighs_nothing_gives_no_numbers():
    weightless = {"unsprung_mass_front": 0.0, "unsprung_mass_rear": 0.0}
    assert "front_unsprung_share" not in car_of(weightless).values


# Units


CAR_TEXT = (
    "sprung_mass: 1650, unsprung_mass: 180 kg, wheelbase: 3.05, cg_to_front_axle: 1.4, track_width: 1.6"
)


@pytest.fixture
def plan(tmp_path, monkeypatch):
    """Return the plan of a car's file, with fake units that declare parts of a car."""
    monkeypatch.chdir(tmp_path)
    mass = Var("mass", "kg", start=1100.0)
    for fmu, output, parameters in (
        ("plant_x", "yaw_rate", [mass, Var("cg_to_rear_axle", "m", start=1.3)]),
        ("plant_high", "yaw_rate", [mass, Var("cg_height", "m", start=0.7)]),
        ("reference_x", "r", [mass, Var("cornering_stiffness_front", "N/rad", start=1e5)]),
        ("tyre_x", "tyre_force_y_*", [Var("cornering_stiffness", "N/rad", start=5e4)]),
    ):
        make_fmu(tmp_path / "fmus" / f"{fmu}.fmu", outputs=[out(output)], parameters=parameters)

    def made(car=CAR_TEXT, fmu="plant_x", settings=(), more="", measure=None):
        Path("car.yaml").write_text(f"parameters: {{{car}}}\n")
        units = f"units:\n  plant: {{fmu: {fmu}}}\n{more}"
        Path("a.yaml").write_text(f"vehicle: car.yaml\nstop_time: 1\nstep_size: 0.01\n{units}")
        return make_plan(load_scenario("a.yaml", changes=changed(settings=settings)), measure=measure)

    return made


pytestmark = pytest.mark.usefixtures("common_cache")


def unit(plan, name):
    return next(one for one in plan.instances if one.name == name)


def test_a_unit_takes_what_it_declares_and_what_follows_and_check_shows_it(plan, capsys):
    made = plan()
    plant = unit(made, "plant")
    assert plant.parameters == {"mass": 1830.0, "cg_to_rear_axle": pytest.approx(1.65)}
    assert {name: str(given.origin) for name, given in plant.given.items()} == {
        "mass": "derived: sprung_mass + unsprung_mass",
        "cg_to_rear_axle": "derived: wheelbase - cg_to_front_axle",
    }
    show(made, Path("a.yaml"))
    said = " ".join(capsys.readouterr().out.split())
    assert mentions(
        said, "1830 kg", "plant", "sprung_mass", "unsprung_mass", "cg_to_front_axle", "track_width"
    )


def test_a_change_of_what_others_follow_from_reaches_the_unit_and_one_that_reaches_none_is_told(plan):
    made = plan(settings=["vehicle.sprung_mass=1.7 t"])
    assert unit(made, "plant").parameters["mass"] == 1880.0
    assert texts_of(made) == ()
    without = plan(settings=["vehicle.track_width=1.5"])
    assert each_mentions(texts_of(without), ("vehicle.track_width", "changes", "instance"))


@pytest.mark.parametrize(
    ("car", "fmu", "names"),
    [
        (CAR_TEXT, "plant_high", ("plant_high", "cg_height")),
        (f"{CAR_TEXT}, mass: 1900", "plant_x", ("parameters.mass", "1900 kg", "sprung_mass")),
        (f"{CAR_TEXT}, wheel_radius: 31 kg", "plant_x", ("wheel_radius", "'31 kg'")),
        (f"{CAR_TEXT}, trak_width: 1.5", "plant_x", ("'trak_width'", "instance", "parameter")),
        ("sprung_mass: -5, unsprung_mass: 180", "plant_x", ("sprung_mass", "0 kg", "-5")),
    ],
)
def test_what_is_wrong_with_a_car_is_said_in_one_sentence(plan, car, fmu, names):
    with refused(WiringError, names=names) as caught:
        plan(car, fmu)
    assert len(caught.value.diagnostics) == 1


def test_a_reference_is_told_what_the_tyres_have_at_their_static_loads(plan):
    asked = {}

    def measure(tyres, loads):
        asked.update(loads)
        return {"fl": 30e3, "rl": 40e3}

    more = "  reference: {fmu: reference_x}\n  tyre: {fmu: tyre_x}\n"
    reference = unit(plan(more=more, measure=measure), "reference")
    assert reference.parameters["cornering_stiffness_front"] == 60e3
    load = 0.5 * 1830.0 * G * 1.65 / 3.05
    assert asked == {"fl": pytest.approx(load), "rl": pytest.approx(0.5 * 1830.0 * G - load)}
    formula = f"two of tyre_x at {load:.6g} N each"
    assert reference.origin("cornering_stiffness_front") == ValueOrigin("derived", formula)


def test_a_reference_without_tyres_to_ask_is_refused(plan):
    names = "a.yaml:6", "units.reference", "cornering_stiffness_front"
    with refused(WiringError, "vehicle-incomplete", names=names):
        plan(more="  reference: {fmu: reference_x}\n", measure=lambda tyres, loads: {})


# Changes of one quantity where others that are given would contradict it


@pytest.mark.parametrize("given", [(), ("unsprung_mass",)])
@pytest.mark.parametrize(("name", "value", "follows"), [("mass", 2000.0, "sprung_mass"),
                                                        ("sprung_mass", 1800.0, "mass")])  # fmt: skip
def test_a_heavier_car_keeps_its_wheels(saloon, given, name, value, follows):
    whole = car_of(saloon).values
    before = saloon | {each: whole[each] for each in given}
    after, notes = adapted(before | {name: value}, before, {name})
    now = car_of(after).values
    assert contradictions(after) == []
    assert now["mass"] - now["sprung_mass"] == pytest.approx(whole["mass"] - whole["sprung_mass"])
    assert now[follows] == pytest.approx(whole[follows] + value - whole[name])
    assert each_mentions(notes, (name, follows, f"{now[follows]:.6g} kg", f"{whole[follows]:.6g} kg"))


@pytest.mark.parametrize("given", [{"mass": 2000.0, "sprung_mass": 1700.0}, {}])
def test_what_is_changed_together_or_set_to_what_it_was_is_taken_as_it_is(saloon, given):
    after, notes = adapted(saloon | given, saloon, given or {"mass"})
    assert car_of(after).values["sprung_mass"] == pytest.approx({**saloon, **given}["sprung_mass"])
    assert given.items() <= after.items()
    assert notes == []


def test_a_higher_centre_of_mass_lifts_a_given_roll_arm_and_a_longer_front_is_a_longer_car(saloon):
    whole = car_of(saloon).values
    before = saloon | {"roll_arm": whole["roll_arm"]}
    after, _ = adapted(before | {"cg_height": 0.6}, before, {"cg_height"})
    assert after["roll_arm"] == pytest.approx(car_of(saloon | {"cg_height": 0.6}).values["roll_arm"])
    front = saloon["cg_to_front_axle"] + 0.1
    _, (note,) = adapted(saloon | {"cg_to_front_axle": front}, saloon, {"cg_to_front_axle"})
    assert f"wheelbase becomes {whole['wheelbase'] + 0.1:.6g} m" in note


@pytest.mark.parametrize("target", ["vehicle.mass", "plant.mass"])
def test_a_change_of_mass_reaches_the_sprung_mass_of_the_plant_with_a_note(plan, target):
    masses = [Var("mass", "kg", start=1100.0), Var("sprung_mass", "kg", start=900.0, minimum=1.0)]
    make_fmu(Path("fmus/plant_sprung.fmu"), outputs=[out("yaw_rate")], parameters=masses)

    def planned(*settings):
        return plan("mass: 1500, sprung_mass: 1320", "plant_sprung", settings)

    made = planned(f"{target}=1.6 t")
    assert unit(made, "plant").parameters == {"mass": 1600.0, "sprung_mass": 1420.0}
    (note,) = [one for one in made.diagnostics if one.code == "quantity-follows"]
    assert "sprung_mass becomes 1420 kg (1320 kg before)" in note.message
    both = planned(f"{target}=1.6 t", target.replace("mass", "sprung_mass") + "=1300")
    assert unit(both, "plant").parameters == {"mass": 1600.0, "sprung_mass": 1300.0}
    with pytest.raises(WiringError, match=r"sprung_mass.*got -80"):
        planned(f"{target}=100")
