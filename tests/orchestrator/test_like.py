"""Files like another one: what they come to, where their values stand, and what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.refusals import mentions, refused, texts_of
from yawbench.foundation.errors import ScenarioError
from yawbench.orchestrator.scenario import catalogue, like
from yawbench.orchestrator.scenario.loader import load_scenario
from yawbench.planner import Planner
from yawbench.studies.load_experiment import load_experiment

UNITS = [
    "driver_sine", "reference_steady_state", "controller_fnn", "allocator_load_proportional",
    "wheel_control_direct", "plant_seven_dof", "tyre_dugoff",
]  # fmt: skip
SCENARIOS = Path(__file__).parents[2] / "scenarios"
PAPER_A = SCENARIOS / "fnn_sideslip/25mps.yaml"


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def written(name: str, text: str) -> Path:
    path = Path(name)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def read(name: str, what: str = "scenario file"):
    return like.read(Path(name), what=what)


def test_a_scenario_takes_everything_of_another_and_changes_some():
    own = "friction: 0.3\nunits: {driver: {parameters: {frequency: 0.5}}}\n"
    mine, other = load_scenario(written("mine.yaml", f"like: {PAPER_A}\n{own}")), load_scenario(PAPER_A)
    assert mine.friction.value == 0.3
    given = {name: given.value for name, given in mine.units["driver"].parameters.items()}
    assert given == {"amplitude": 0.0325, "frequency": 0.5, "start_time": 1.0}
    assert mine.vehicle_file.values == other.vehicle_file.values
    assert (mine.title, list(mine.units)) == (other.title, list(other.units))
    assert mine.connections == other.connections
    assert "like" not in mine.as_run()


def test_a_value_keeps_the_file_line_and_source_in_which_it_stands():
    written("a.yaml", "source: paper A\nparameters:\n  mass: 1000   # kg; chosen: light\n  wheelbase: 2.5\n")
    path = written("b.yaml", "like: a.yaml\nparameters:\n\n  mass: 1100   # kg; from a scale\n")
    document = read("b.yaml", "vehicle file")
    assert str(document.location(("parameters", "mass"))) == "b.yaml:4: parameters.mass"
    assert str(document.location(("parameters", "wheelbase"))) == "a.yaml:4: parameters.wheelbase"
    scenario = written("s.yaml", f"like: {PAPER_A}\nvehicle: {path}\n")
    of_car = load_scenario(scenario).vehicle_file.parameters
    assert of_car["wheelbase"].origin.source.says == ""
    assert of_car["wheelbase"].origin.source.kind == "paper"
    assert (of_car["mass"].origin.source.file, of_car["mass"].origin.source.line) == ("b.yaml", 4)
    written("a.yaml", "parameters:\n  mass: heavy\n  wheelbase: [2]\n")
    with refused(ScenarioError, names=("a.yaml:3", "wheelbase")):
        load_scenario(scenario)


def test_lists_are_replaced_and_null_takes_away():
    written(
        "a.yaml",
        "connections:\n- {from: x.y, to: z.y}\n- {from: x.q, to: z.q}\nspeed: 20\nunits: {z: {fmu: z}}\n",
    )
    written("b.yaml", "like: a\nconnections: [{from: x.r, to: z.r}]\nspeed: null\n")
    made = read("b.yaml")
    assert made.data == {"connections": [{"from": "x.r", "to": "z.r"}], "units": {"z": {"fmu": "z"}}}
    assert str(made.location(("connections", 0, "delay"))) == "b.yaml:2: connections[0].delay"
    assert str(made.location(("units", "z"))) == "a.yaml:5: units.z"


def test_paths_stay_relative_to_the_file_in_which_they_stand(tmp_path):
    written("cars/car.yaml", "parameters: {mass: 1}\n")
    written("one/a.yaml", "vehicle: ../cars/car.yaml\nunits: {z: {fmu: z}}\n")
    written("two/deep/b.yaml", "like: ../../one/a\n")
    assert read("two/deep/b.yaml").data["vehicle"] == "../../cars/car.yaml"
    written("c.yaml", "like: two/deep/b.yaml\n")
    assert read("c.yaml").data["vehicle"] == "cars/car.yaml"


def test_a_study_is_like_another_one():
    path = written("mine.yaml", f"like: {SCENARIOS / 'fnn_sideslip/sweep.yaml'}\ntitle: Mine\n")
    mine, other = load_experiment(path), load_experiment(SCENARIOS / "fnn_sideslip/sweep.yaml")
    (own,), (its,) = ([run.scenario.resolve() for run in one.runs.values()] for one in (mine, other))
    assert (mine.spec.title, mine.spec.axes, own) == ("Mine", other.spec.axes, its)
    assert catalogue.kind_of(path) == "a sweep file"


def test_a_file_without_keys_of_its_own_has_kind_and_title_of_the_other():
    path = written("mine.yaml", "like: mid_size   # of the library\n")
    assert catalogue.kind_of(path) == "a vehicle file"
    assert catalogue.title_of(path) == "Mid-size saloon, rear-wheel drive"
    assert catalogue.kind_of(written("round.yaml", "like: round.yaml\n")) == ""


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("like: mid_sise\n", ("car.yaml:1", "like", "mid_sise", "mid_size")),
        ("like: mid_sise.yaml\n", ("car.yaml:1", "like", "mid_sise.yaml")),
        ("like: fnn_sideslip/25mps\n", ("car.yaml:1", "like", "a scenario", "vehicle file")),
        ("like: x.ssp\n", ("car.yaml:1", "like", "x.ssp", "YAML")),
        ("like: car\n", ("car.yaml:1", "like", "car.yaml", "itself")),
        ("like: second.yaml\n", ("second.yaml:1", "like", "car.yaml", "itself")),
        ("like: [a]\n", ("car.yaml:1", "like", "text")),
    ],
)
def test_a_mistake_is_one_sentence_at_the_key(text, names):
    written("second.yaml", "like: car.yaml\nparameters: {mass: 1}\n")
    written("car.yaml", text + "parameters: {}\n")
    scenario = written("s.yaml", f"like: {PAPER_A}\nvehicle: car.yaml\n")
    with refused(ScenarioError, names=names) as caught:
        load_scenario(scenario)
    assert len(str(caught.value).splitlines()) == 1


def plan(fmus, car: str):
    written("car.yaml", car)
    planner = Planner()
    loaded = planner.load(written("s.yaml", f"like: {PAPER_A}\nvehicle: car.yaml\n"))
    made = planner.plan(loaded, fmus=fmus)
    return made, next(one for one in made.instances if one.name == "plant").parameters["mass"]


def test_a_changed_mass_keeps_the_wheels_as_an_override_does(fmus):
    made, mass = plan(fmus, "like: large_saloon\nparameters: {mass: 2 t}\n")
    assert mass == 2000.0
    assert mentions(texts_of(made), "vehicle.mass", "1820 kg", "1650 kg")
    assert plan(fmus, "like: large_saloon\n")[1] == 1830.0


def test_values_for_a_unit_that_is_another_one_here_are_left_out():
    gone = ", ".join(f"{unit}: null" for unit in ("controller", "allocator", "wheel_control", "reference"))
    written("base.yaml", f"like: {PAPER_A}\nunits: {{{gone}}}\nconnections: []\n")
    written("s.yaml", "like: base\nunits: {plant: {fmu: plant_two_dof}}\n")
    assert load_scenario(Path("s.yaml")).replaced == {"plant": "plant_seven_dof"}
