"""From scenario to plan: parameters, wires, constants, records; and each sentence when it cannot be."""

from __future__ import annotations

import math
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

from tests.cars import load_scenario, make_plan
from tests.changed import changed
from tests.fmus.fake_fmus import Var, make_fmu, out
from tests.refusals import each_mentions, mentions, refused, texts_of, told
from yawbench.fmus import opener
from yawbench.foundation.errors import Diagnostic, ModelDescriptionError, WiringError, YawbenchError
from yawbench.orchestrator.plan import Instance, Override, Plan, ValueOrigin, Wire
from yawbench.planner import Planner
from yawbench.vocabulary.wheels import WHEELS

pytestmark = pytest.mark.usefixtures("common_cache")

UNITS = """\
  driver: {fmu: driver_sine}
  controller: {fmu: controller_fnn, step_size: 2 ms}
  plant: {fmu: plant_seven_dof}
  tyre: {fmu: tyre_dugoff}
"""
CONSTANTS = 'inputs: {"friction*": 0.65}\n'
TORQUES = "connections:\n  - {from: controller.torque_request_*, to: plant.wheel_torque_*}\n"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory with the FMUs of a small car."""
    monkeypatch.chdir(tmp_path)
    fmus = tmp_path / "fmus"
    make_fmu(
        fmus / "driver_sine.fmu",
        outputs=[out("steer_angle", unit="rad")],
        parameters=[
            Var("amplitude", "rad", start=0.05),
            Var("frequency", "Hz", start=0.2, minimum=0.0),
            Var("periods", type="Integer", start=1, minimum=1),
            Var("smooth", type="Boolean", start=False),
            Var("shape", type="String", start="sine", choices=("sine", "square")),
            Var("road", type="Enumeration", start=1, items=("dry", "wet")),
        ],
    )
    make_fmu(
        fmus / "controller_fnn.fmu",
        inputs=[Var("steer_angle", "rad"), Var("yaw_rate", "rad/s"), Var("friction")],
        outputs=[out("torque_request_*", "yaw_rate", unit="N.m", variability="discrete")],
        parameters=[Var("gain", start=1.0), Var("wheel_radius", "m", start=0.3), Var("rule_base", start=7.0)],
    )
    make_fmu(
        fmus / "controller_off.fmu",
        outputs=[out("torque_request_*", unit="N.m", variability="discrete")],
        parameters=[Var("gain", start=0.0)],
    )
    torque = Var("wheel_torque_*", "N.m")
    make_fmu(
        fmus / "plant_seven_dof.fmu",
        inputs=[Var("steer_angle", "rad"), *(Var(f"tyre_force_{axis}_*", "N") for axis in "xy"), torque],
        outputs=[
            out("yaw_rate", unit="rad/s"),
            out("acceleration_y", *(f"tyre_force_y_{w}" for w in WHEELS), unit="m/s2"),
            out("slip_angle_*", "steer_angle", unit="rad"),
            out("slip_ratio_*"),
            Var("status", type="String", start="", follows=()),
        ],
        parameters=[
            Var("mass", "kg", start=1500.0, minimum=1.0),
            Var("wheel_radius", "m", start=0.3, minimum=0.1, maximum=1.0),
            Var("initial_speed", "m/s", start=20.0),
        ],
    )
    make_fmu(
        fmus / "tyre_dugoff.fmu",
        inputs=[Var("slip_angle_*", "rad"), Var("slip_ratio_*"), Var("friction_*")],
        outputs=[
            out("tyre_force_x_*", "slip_ratio_*", "friction_*", unit="N"),
            out("tyre_force_y_*", "slip_angle_*", "friction_*", unit="N"),
        ],
    )
    return fmus


def scenario(units: str = UNITS, rest: str = CONSTANTS + TORQUES, *, head: str = "") -> Path:
    path = Path("a.yaml")
    path.write_text(f"{head}stop_time: 8\nstep_size: 1 ms\nunits:\n{units}{rest}", encoding="utf-8")
    return path


def plan(path: Path | None = None, *, fmus: Path | None = None, **options: Any) -> Plan:
    return make_plan(load_scenario(path or scenario(), changes=changed(**options)), fmus=fmus)


def problems(path: Path, kind: type[YawbenchError] = WiringError, **options: Any) -> list[Diagnostic]:
    with pytest.raises(kind) as caught:
        plan(path, **options)
    assert caught.value.exit_status == 2
    return caught.value.diagnostics


def unit(made: Plan, name: str) -> Instance:
    return next(u for u in made.instances if u.name == name)


def test_the_plan_holds_units_wires_and_the_time_grid_and_every_input_has_one_source() -> None:
    made = plan()
    assert [u.name for u in made.instances] == ["driver", "plant", "controller", "tyre"]
    assert [u.period for u in made.instances] == [1, 1, 2, 1]
    assert (made.step, made.n_steps, made.algorithm) == (Fraction(1, 1000), 8000, "extrapolated")
    assert Wire("driver", "steer_angle", "controller", "steer_angle") in made.wires
    assert Wire("controller", "torque_request_rl", "plant", "wheel_torque_rl") in made.wires
    assert unit(made, "tyre").constants == {f"friction_{w}": 0.65 for w in WHEELS}
    assert unit(made, "controller").constants == {"friction": 0.65}
    fed = [(w.target, w.input) for w in made.wires]
    fed += [(u.name, name) for u in made.instances for name in u.constants]
    assert sorted(fed) == sorted((u.name, v.name) for u in made.instances for v in u.fmu.of("input"))
    assert texts_of(made) == ()


VALUES = ["plant.mass=1600", "plant.mass=-1", "controller.gain=2", "friction=0.3", "speed=250"]
INPUTS = ["inputs.friction*=0.3", "inputs.plant.steer_angle=0.1", "inputs.tyre.friction_fl=0.2", "inputs.x=1"]
STEPS = ["controller.step_size=4 ms", "controller.step_size=1.5 ms", "stop_time=0.001", "stop_time=0.0015"]
OF_ONE_PLANNER: list[dict[str, Any]] = [
    {},
    *({"settings": [setting]} for setting in [*VALUES, *INPUTS, *STEPS]),
    {"swaps": ["controller=controller_off"]},
    {"swaps": ["controller=controller_off"], "settings": ["controller.gain=1"]},
    {"swaps": ["controller=controller_of"]},
    {"faults": ["controller.yaw_rate: offset 0.1 from 1 s"]},
    {"faults": ["plant.yaw_rate: freeze from 9 s; plant.yaw_rat: freeze"]},
]


def test_a_plan_is_the_same_whatever_its_planner_has_planned_before() -> None:
    path, planner = scenario(), Planner()

    def outcome(by: Planner, options: dict[str, Any]) -> str:
        try:
            return repr(by.plan(by.load(path, changed(**options))))
        except YawbenchError as error:
            return repr(error.diagnostics)

    fresh = [outcome(Planner(), options) for options in OF_ONE_PLANNER]
    assert len({*fresh}) == len(fresh)
    for _ in range(2):
        assert [outcome(planner, options) for options in OF_ONE_PLANNER] == fresh
    assert [outcome(planner, options) for options in reversed(OF_ONE_PLANNER)] == fresh[::-1]


# Where FMUs are


@pytest.mark.parametrize("place", ["below", "elsewhere", "home"])
def test_fmus_are_those_of_the_nearest_folder_else_of_the_working_directory_else_of_the_project(
    place: str, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, fmus = scenario(), folder
    if place == "home":
        fmus = folder.rename(tmp_path / "home")
        monkeypatch.setattr(opener, "HOME", fmus)
    else:
        deep = tmp_path / "Läufe 2" / "x" if place == "below" else tmp_path.parent / f"{tmp_path.name}_other"
        deep.mkdir(parents=True)
        (deep.parent / "fmus").mkdir(exist_ok=True)  # holds none, so it is passed over
        path = path.rename(deep / "a.yaml")
    assert {instance.fmu.path.parent for instance in plan(path).instances} == {fmus}


def test_fmus_that_are_not_built_anywhere_are_said(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder.rename(tmp_path / "elsewhere")
    monkeypatch.setattr(opener, "HOME", tmp_path / "home")
    found = problems(scenario(), ModelDescriptionError)
    assert {one.code for one in found} == {"fmu-missing"}
    names = "driver_sine", "controller_fnn", "plant_seven_dof", "tyre_dugoff"
    assert each_mentions(found, *((name, "yawbench build") for name in names))
    assert len(plan(fmus=tmp_path / "elsewhere").instances) == 4
    with refused(ModelDescriptionError, "folder-missing", names=("nowhere",)):
        plan(fmus=Path("nowhere"))


def test_an_fmu_can_be_a_path_relative_to_the_scenario(folder: Path, tmp_path: Path) -> None:
    other = tmp_path / "Meine Räder" / "tyre ä.fmu"
    other.parent.mkdir()
    (folder / "tyre_dugoff.fmu").rename(other)
    made = plan(scenario(UNITS.replace("tyre_dugoff", "Meine Räder/tyre ä.fmu")))
    assert unit(made, "tyre").fmu.path == other


def test_every_missing_fmu_is_said_with_those_there_are(folder: Path) -> None:
    path = scenario(UNITS.replace("controller_fnn", "controller_fn").replace("tyre_dugoff", "x/tyre.fmu"))
    assert told(
        problems(path, ModelDescriptionError),
        "fmu-missing | a.yaml:5: units.controller.fmu | 'controller_fn' | fmus | 'controller_fnn'\n"
        "fmu-missing | a.yaml:7: units.tyre.fmu | tyre.fmu",
    )
    assert each_mentions(
        problems(scenario(), ModelDescriptionError, swaps=["tyre=tyre_x"]),
        ("--swap tyre=tyre_x", "'tyre_x'", "fmus", "tyre_dugoff", "tyre_magic_formula_62_transient"),
    )


def test_a_corrupt_fmu_is_said_where_it_is_used(folder: Path) -> None:
    (folder / "tyre_dugoff.fmu").write_bytes(b"PK nonsense")
    assert each_mentions(
        problems(scenario(), ModelDescriptionError), ("a.yaml:7", "units.tyre.fmu", "tyre_dugoff.fmu", "File")
    )


def test_an_fmu_for_one_instance_is_not_used_twice(folder: Path) -> None:
    make_fmu(folder / "lonely.fmu", once=True)
    path = scenario(UNITS + "  one: {fmu: lonely}\n  two: {fmu: lonely}\n")
    assert each_mentions(problems(path), ("a.yaml:9", "units.two.fmu", "--isolate"))
    assert len(make_plan(load_scenario(path), isolated=True).instances) == 6


def test_units_that_would_run_each_others_code_are_refused(folder: Path) -> None:
    for name, text in (("one", b"x = 1"), ("two", b"x = 2"), ("three", b"x = 2")):
        files = {"resources/slavemodule.txt": b"model", "resources/model_of_mine.py": text}
        make_fmu(folder / f"{name}.fmu", files=files)
    make_fmu(folder / "four.fmu", files={"resources/slavemodule.txt": b"json", "resources/json.py": b""})
    assert len(plan(scenario(UNITS + "  a: {fmu: two}\n  b: {fmu: three}\n")).instances) == 6
    path = scenario(UNITS + "  a: {fmu: one}\n  b: {fmu: two}\n  c: {fmu: four}\n")
    assert each_mentions(problems(path), ("a.yaml", "'model_of_mine'", "--isolate"), ("a.yaml", "'json'"))


@pytest.mark.parametrize("module", ["fakes_xyz", "fakes_ns.m"])  # beside no __init__.py
def test_a_unit_whose_module_is_loaded_already_from_elsewhere_is_refused(
    module: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = module.replace(".", "/") + ".py"
    files = {"resources/slavemodule.txt": b"a_b", "resources/a_b.py": b"", f"resources/{file}": b"x = 1"}
    make_fmu(folder / "one.fmu", files=files)
    loaded = folder / file
    loaded.parent.mkdir(exist_ok=True)
    loaded.write_text("x = 1")
    monkeypatch.syspath_prepend(str(folder))
    __import__(module)
    path = scenario(UNITS + "  a: {fmu: one}\n")
    assert len(plan(path).instances) == 5  # the same code: no harm
    loaded.write_text("x = 2")
    assert each_mentions(problems(path), ("a.yaml", repr(module.partition(".")[0]), "module", "process"))


# Parameters


def test_parameters_are_converted_to_the_units_of_the_fmu() -> None:
    units = UNITS.replace("driver_sine", "driver_sine, parameters: {amplitude: 180 deg, frequency: 1}")
    units = units.replace(
        "plant_seven_dof", "plant_seven_dof, parameters: {initial_speed: 90 km/h, mass: 1.1 t}"
    )
    made = plan(scenario(units))
    assert unit(made, "driver").parameters == {"amplitude": 3.141592653589793, "frequency": 1.0}
    assert unit(made, "plant").parameters == {"initial_speed": 25.0, "mass": 1100.0}
    assert isinstance(unit(made, "driver").parameters["frequency"], float)


def test_each_unit_takes_the_vehicle_parameters_it_declares_and_its_own_win() -> None:
    Path("car.yaml").write_text("parameters: {mass: 1100 kg, wheel_radius: 31 cm}\n")
    units = UNITS.replace("step_size: 2 ms", "parameters: {wheel_radius: 0.33}")
    made = plan(scenario(units, head="vehicle: car.yaml\n"))
    assert unit(made, "plant").parameters == {"mass": 1100.0, "wheel_radius": 0.31}
    assert unit(made, "controller").parameters == {"wheel_radius": 0.33}
    assert unit(made, "tyre").parameters == {}


def test_every_type_of_parameter_is_taken() -> None:
    made = plan(settings=["driver.periods=3", "driver.smooth=true", "driver.shape=square", "driver.road=wet"])
    assert unit(made, "driver").parameters == {"periods": 3, "smooth": True, "shape": "square", "road": 2}
    assert unit(plan(settings=["driver.road=1"]), "driver").parameters == {"road": 1}


@pytest.mark.parametrize(
    ("setting", "lines"),
    [
        ("driver.amplitud=1", "parameter-unknown | driver_sine | 'amplitud' | 'amplitude'"),
        ("controller.k=1", "parameter-unknown | controller_fnn | 'k' | wheel_radius | rule_base | gain"),
        ("tyre.k=1", "parameter-unknown | tyre_dugoff | 'k'"),
        ("tyre.friction_fl=1", "parameter-unknown | 'friction_fl' | 'inputs'"),
        ("driver.amplitude=5 kg", "unit-mismatch | '5 kg' | rad | deg | mrad"),
        ("driver.amplitude=big", "value-invalid | 'big'"),
        ("driver.amplitude=true", "value-invalid | number"),
        ("driver.amplitude=1e999 deg", "value-invalid | '1e999 deg'"),
        ("driver.frequency=-1", "value-invalid | 0 Hz"),
        ("plant.wheel_radius=110 cm", "value-invalid | 1 m | '110 cm'"),
        ("driver.periods=1.5", "value-invalid | whole | number"),
        ("driver.periods=0", "value-invalid | 1"),
        ("driver.smooth=1", "value-invalid | true | false"),
        ("driver.shape=5", "value-invalid | text"),
        ("driver.shape=sin", "value-invalid | 'sin' | 'sine' | square"),
        ("driver.road=icy", "value-invalid | 'icy' | dry | wet"),
        ("driver.road=3", "value-invalid | dry | wet"),
        ("vehicle.mas=1", "parameter-unknown | 'mas' | 'mass'"),
        ("vehicle.xyz=1", "parameter-unknown | 'xyz'"),
        ("vehicle.wheel_radius=5 kg", "unit-mismatch | '5 kg' | m | mm | cm | km"),
        ("inputs.frction*=1", "variable-unknown | 'friction_*'"),
        ("inputs.friction_fl=5 m", "unit-mismatch | '5 m' | 1 | tyre.friction_fl"),
        (
            "inputs.steer_angle=0",
            "constant-overruled | controller.steer_angle | driver.steer_angle\n"
            "constant-overruled | plant.steer_angle | driver.steer_angle",
        ),
    ],
)
def test_a_wrong_value_is_said_in_one_sentence(setting: str, lines: str) -> None:
    placed = [line.replace(" | ", f" | --set {setting} | ", 1) for line in lines.splitlines()]
    assert told(problems(scenario(), settings=[setting]), "\n".join(placed))


def test_all_wrong_values_are_said_at_once_with_their_lines() -> None:
    Path("car.yaml").write_text("parameters:\n  wheel_radius: 5 kg\n  mass: 0\n")
    units = UNITS.replace("driver_sine", "driver_sine, parameters: {amplitude: x, frequency: -1}")
    assert each_mentions(
        problems(scenario(units, head="vehicle: car.yaml\n")),
        ("a.yaml:5", "units.driver.parameters.amplitude", "'x'"),
        ("a.yaml:5", "units.driver.parameters.frequency", "0 Hz", "-1"),
        ("car.yaml:2", "parameters.wheel_radius", "'5 kg'", "m", "mm", "cm", "km"),
        ("car.yaml:3", "parameters.mass", "1 kg", "0"),
    )


# Swapping


def test_what_was_meant_for_the_replaced_fmu_is_left_out_with_a_note() -> None:
    Path("car.yaml").write_text("parameters: {rule_base: 5}\n")
    units = UNITS.replace("step_size: 2 ms", "parameters: {gain: 2, wheel_radius: 0.33}")
    path = scenario(units, head="vehicle: car.yaml\n")
    made = plan(path, swaps=["controller=controller_off"])
    assert unit(made, "controller").parameters == {"gain": 2.0}
    assert unit(made, "tyre").constants == {f"friction_{w}": 0.65 for w in WHEELS}
    assert each_mentions(
        texts_of(made)[:2],
        ("vehicle.rule_base", "left", "instance"),
        ("controller.wheel_radius", "controller_off"),
    )


def test_a_mistake_stays_a_mistake_after_a_swap() -> None:
    units = UNITS.replace("step_size: 2 ms", "parameters: {gian: 2}")
    swap = ["controller=controller_off"]
    assert each_mentions(
        problems(scenario(units), swaps=swap),
        ("a.yaml:5", "units.controller.parameters.gian", "controller_off", "'gian'", "'gain'"),
    )
    assert each_mentions(
        problems(scenario(), swaps=swap, settings=["controller.rule_base=2"]),
        ("--set controller.rule_base=2", "controller_off", "'rule_base'"),
    )


def test_a_constant_and_a_connection_of_the_replaced_fmu_are_left_out_with_a_note(folder: Path) -> None:
    make_fmu(folder / "plant_two_dof.fmu", outputs=[out("yaw_rate", unit="rad/s")])
    units = "\n".join(line for line in UNITS.splitlines() if "tyre" not in line) + "\n"
    rest = 'inputs: {friction: 1, "tyre_force*": 0}\n' + TORQUES + "record: [plant.acceleration_y]\n"
    made = plan(scenario(units, rest), swaps=["plant=plant_two_dof"])
    assert each_mentions(
        texts_of(made),
        ("inputs.tyre_force*", "left", "instance"),
        ("connections[0]", "'wheel_torque_*'", "plant"),
        ("record[0]", "'acceleration_y'", "plant"),
    )
    assert made.record == ()


def test_a_friction_too_low_for_all_who_are_told_it_is_said_once_and_else_of_whom(folder: Path) -> None:
    inputs = [Var("friction", "1", minimum=0.0), Var("friction_*", "1", minimum=0.0)]
    base = [Var("base_friction", "1", minimum=0.0)]
    make_fmu(folder / "plant_one.fmu", inputs=inputs, outputs=["x"], parameters=base)
    make_fmu(folder / "reference_one.fmu", inputs=[Var("friction", "1", minimum=0.1)], outputs=["y"])
    one, two = "  plant: {fmu: plant_one}\n", "  reference: {fmu: reference_one}\n"
    for units, value, names in ((one, -1, ("0",)), (one + two, 0.05, ("0.1", "reference.friction"))):
        found = problems(scenario(units, "", head=f"friction: {value}\n"))
        assert told(found, " | ".join(["value-invalid", "a.yaml:1: friction", str(value), *names]))


def test_friction_and_speed_that_nobody_takes_after_a_swap_are_left_out_with_a_note(folder: Path) -> None:
    speed = [Var("initial_speed", "m/s")]
    make_fmu(folder / "plant_one.fmu", inputs=[Var("friction_fl", "1")], outputs=["x"], parameters=speed)
    make_fmu(folder / "plant_two.fmu", outputs=["x"])
    swaps, head = ["plant=plant_two"], "friction: 0.4\nspeed: 20\n"
    path = scenario("  plant: {fmu: plant_one}\n", "", head=head)
    notes = texts_of(plan(path, swaps=swaps))[:2]
    assert each_mentions(notes, ("speed", "left", "instance"), ("friction", "left", "instance"))
    for setting in ("friction=0.3", "speed=30"):
        assert len(problems(path, swaps=swaps, settings=[setting])) == 1
    assert each_mentions(
        problems(scenario("  plant: {fmu: plant_two}\n", "", head=head)),
        ("a.yaml:1", "instance", "friction"),
        ("a.yaml:2", "initial_speed", "target_speed"),
    )


def test_a_swap_works_though_the_replaced_fmu_is_not_there(folder: Path) -> None:
    units = UNITS.replace("controller_fnn, step_size: 2 ms", "gone, parameters: {secret: 1}")
    made = plan(scenario(units), swaps=["controller=controller_off"])
    assert each_mentions(texts_of(made), ("controller.secret", "controller_off"))


# Wires


def test_an_input_without_a_source_is_said_with_what_fits() -> None:
    assert each_mentions(
        problems(scenario(rest="inputs: {friction: 0.65}\n")),
        ("a.yaml:6", "units.plant", "plant.wheel_torque_*", "N.m", "controller.torque_request_*", "'inputs'"),
        ("a.yaml:7", "units.tyre", "tyre.friction_*", "1", "'inputs'"),
    )


def test_an_optional_input_keeps_its_start_value_where_nothing_drives_it(folder: Path) -> None:
    make_fmu(folder / "tyre_dugoff.fmu", inputs=[Var("heat", "1", start=0.5, optional=True)])
    units = "  tyre: {fmu: tyre_dugoff}\n"
    assert unit(plan(scenario(units, "")), "tyre").constants == {"heat": 0.5}
    assert unit(plan(scenario(units, "inputs: {heat: 0.7}\n")), "tyre").constants == {"heat": 0.7}
    make_fmu(folder / "road.fmu", outputs=[out("heat")])
    driven = plan(scenario(units + "  road: {fmu: road}\n", ""))
    assert unit(driven, "tyre").constants == {}
    assert Wire("road", "heat", "tyre", "heat") in driven.wires


def test_more_than_one_output_of_a_name_is_said_and_a_connection_settles_it() -> None:
    units = UNITS + "  second: {fmu: driver_sine}\n"
    assert told(
        problems(scenario(units)),
        "input-ambiguous | a.yaml:5: units.controller | controller.steer_angle | driver.steer_angle"
        " | second.steer_angle | 'connections'\n"
        "input-ambiguous | a.yaml:6: units.plant | plant.steer_angle | driver.steer_angle"
        " | second.steer_angle | 'connections'",
    )
    more = "  - {from: second.steer_angle, to: plant.steer_angle}\n  - {from: [driver], to: [controller]}\n"
    made = plan(scenario(units, CONSTANTS + TORQUES + more))
    assert sources(made, "steer_angle") == {"plant": "second", "controller": "driver"}


@pytest.mark.parametrize(
    ("connection", "expected"),
    [
        (
            "driver.steer_angel, to: plant.steer_angle",
            "variable-unknown .from | 'steer_angel' | 'steer_angle'",
        ),
        ("driver.steer_angle, to: plant.torque", "variable-unknown .to | 'torque' | wheel_torque_* | plant"),
        ("null, to: tyre.fricton_*", "variable-unknown .to | 'fricton_*' | 'friction_*'"),
        ("controller.yaw_rate, to: plant.steer_angle", "variable-wrong-kind .from | controller.yaw_rate"),
        ("[plnt], to: [tyre]", "instance-unknown .from | 'plnt' | 'plant'"),
        ("plant.slip_angle_*, to: tyre.slip_angle_fl", "connection-invalid | plant.slip_angle_* | *"),
        ("plant.yaw_rate, to: plant.steer_angle", "connection-invalid | plant"),
        ("[driver, plant], to: plant.*_angle", "connection-invalid | plant"),
        ("plant.slip_*, to: tyre.slip_angle_*", "connection-matches-nothing | angle_fl | ratio_rr | fl | rr"),
        ("[driver], to: tyre.friction_*", "connection-matches-nothing | steer_angle | fl | rr"),
        ("[tyre, driver], to: [tyre]", "connection-matches-nothing | tyre or driver | tyre"),
        ("driver.steer_angle, to: controller.yaw_rate", "wiring-unit-mismatch | controller.yaw_rate | rad/s"),
        ("plant.status, to: controller.yaw_rate", "wiring-type-mismatch | plant.status | String | Real"),
        ("driver.steer_angle, to: plant.wheel_torque_fl", "input-ambiguous | connections[0]"),
        ("[driver, driver], to: plant.*_angle", "name-duplicate .from | driver"),
        ("[driver, driver], to: [plant]", "name-duplicate .from | driver"),
        ("[plant], to: tyre.friction_fl", "value-invalid | 'to' | *"),
        ("plant.yaw_rate, to: [tyre]", "value-invalid | 'to' | instance.variable"),
        ("null, to: [tyre]", "value-invalid | 'from: null' | 'to' | instance.variable"),
        ("[plant], to: [tyre], gain: 2", "value-invalid | gain | offset | instance.variable"),
        ("[plant.x], to: [tyre]", "value-invalid .from | instances | ['plant.x']"),
    ],
)
def test_a_wrong_connection_is_said_in_one_sentence(connection: str, expected: str) -> None:
    path = scenario(rest=f"{CONSTANTS}{TORQUES}  - {{from: {connection}}}\n")
    head, _, names = expected.partition(" | ")
    code, _, part = head.partition(" ")
    found = [one for one in problems(path, YawbenchError) if one.code == code]
    assert told(found, f"{code} | a.yaml:11: connections[1]{part} | {names}")


def test_one_output_can_feed_four_wheels() -> None:
    rest = CONSTANTS + "connections:\n  - {from: controller.torque_request_fl, to: plant.wheel_torque_*}\n"
    made = plan(scenario(rest=rest))
    fed = {w.input: w.output for w in made.wires if w.input.startswith("wheel_torque")}
    assert fed == {f"wheel_torque_{w}": "torque_request_fl" for w in WHEELS}


def wire_to(made: Plan, target: str, name: str) -> Wire:
    return next(w for w in made.wires if (w.target, w.input) == (target, name))


@pytest.mark.parametrize(
    ("output", "code"),
    [
        ({"unit": "m"}, "wiring-unit-mismatch"),
        ({"unit": "radian"}, "wiring-unit-mismatch"),  # neither known nor defined
        ({"unit": None, "type": "String", "start": ""}, "wiring-type-mismatch"),
    ],
)
def test_units_and_types_that_differ_over_equal_names_are_said_with_the_target(folder, output, code) -> None:
    make_fmu(folder / "other.fmu", outputs=[out("steer_angle", **output)])
    assert told(
        problems(scenario(), swaps=["driver=other"]),
        f"{code} | a.yaml:5: units.controller | driver.steer_angle | controller.steer_angle\n"
        f"{code} | a.yaml:6: units.plant | driver.steer_angle | plant.steer_angle",
    )


@pytest.mark.parametrize(
    ("unit", "base", "gain", "offset"),
    [
        ("deg", None, math.pi / 180, 0.0),
        ("radian", 'rad="1"', 1.0, 0.0),
        ("turn", 'rad="1" factor="6.283185307179586"', 2 * math.pi, 0.0),
        ("deg", 'rad="1" factor="0.01745329"', math.pi / 180, 0.0),  # with few digits
        ("from_north", 'rad="1" factor="-1" offset="1.5"', -1.0, 1.5),
    ],
)
def test_a_wire_converts_between_units_which_are_known_or_defined_by_the_fmu(
    folder, unit, base, gain, offset
) -> None:
    definitions = {unit: base} if base else {}
    make_fmu(folder / "other.fmu", outputs=[out("steer_angle", unit=unit)], definitions=definitions)
    made = plan(swaps=["driver=other"])
    wire = wire_to(made, "plant", "steer_angle")
    assert (wire.gain, wire.offset) == (gain, offset)
    assert [w for w in made.wires if w.converts and w.source != "driver"] == []
    assert texts_of(made) == ()


def test_units_that_are_neither_known_nor_defined_fit_by_name_alone(folder: Path) -> None:
    make_fmu(folder / "other.fmu", outputs=[out("steer_angle", unit="radian")])
    make_fmu(folder / "taker.fmu", inputs=[Var("steer_angle", "radian")], outputs=["y"])
    path = scenario("  other: {fmu: other}\n  taker: {fmu: taker}\n", "")
    assert not wire_to(plan(path), "taker", "steer_angle").converts


def test_a_unit_that_contradicts_its_name_counts_as_defined_and_is_noted(folder: Path) -> None:
    make_fmu(folder / "other.fmu", outputs=[out("steer_angle", unit="deg")], definitions={"deg": 'rad="1"'})
    made = plan(swaps=["driver=other"])
    assert not wire_to(made, "plant", "steer_angle").converts
    assert each_mentions(texts_of(made), ("deg", "otherwise", "usual"))


def test_a_parameter_is_converted_into_a_unit_that_only_the_fmu_defines(folder: Path) -> None:
    make_fmu(
        folder / "other.fmu",
        outputs=[out("steer_angle", unit="rad")],
        parameters=[Var("amplitude", "radian")],
        definitions={"radian": 'rad="1"'},
    )
    made = plan(swaps=["driver=other"], settings=["driver.amplitude=180 deg"])
    assert unit(made, "driver").parameters == {"amplitude": math.pi}


@pytest.mark.parametrize(
    ("given", "scale"),
    [("gain: 0.5, offset: 2", (0.5, 2.0)), ("gain: 3", (3.0, 0.0)), ("offset: -1", (1.0, -1.0))],
)
def test_gain_and_offset_take_plain_numbers_whatever_the_units_are(folder, given, scale) -> None:
    ends = "".join(
        f"  - {{from: driver.steer_angle, to: {end}.steer_angle, {given}}}\n"
        for end in ("plant", "controller")
    )
    for unit, notes in (("m", 0), (None, 0), ("deg", 2)):  # which a gain replaces
        make_fmu(folder / "driver_m.fmu", outputs=[out("steer_angle", unit=unit)])
        made = plan(scenario(rest=CONSTANTS + TORQUES + ends), swaps=["driver=driver_m"])
        wire = wire_to(made, "plant", "steer_angle")
        assert (wire.gain, wire.offset) == scale
        assert [one.code for one in made.diagnostics] == ["conversion-replaced"] * notes


def test_text_has_no_gain_and_a_whole_number_a_whole_one(folder: Path) -> None:
    n, word = Var("n", type="Integer", start=0), Var("word", type="String", start="")
    make_fmu(folder / "giver.fmu", outputs=[n, word])
    make_fmu(folder / "taker.fmu", inputs=[n, word], outputs=["y"])
    units = "  a: {fmu: giver}\n  b: {fmu: taker}\n"
    text = "connections:\n  - {from: a.n, to: b.n, gain: 2}\n  - {from: a.word, to: b.word, gain: 2}\n"
    where = "value-wrong-type | a.yaml:{}: connections[{}] | Real | Integer"
    assert told(problems(scenario(units, text)), where.format(8, 1) + " | String")
    half = text.replace("n, gain: 2", "n, gain: 0.5").replace("word, gain: 2", "word")
    assert told(problems(scenario(units, half)), where.format(7, 0))


def test_an_fmu_without_units_is_connected_with_a_note(folder: Path) -> None:
    make_fmu(folder / "controller_bare.fmu", outputs=[out("torque_request_*", unit=None)])
    assert each_mentions(
        texts_of(plan(swaps=["controller=controller_bare"])), ("controller_bare", "torque_request_*")
    )


@pytest.mark.parametrize("kind", ["Integer", "Boolean"])
def test_an_output_of_whole_numbers_feeds_a_real_of_the_same_name(folder: Path, kind: str) -> None:
    make_fmu(folder / "driver_int.fmu", outputs=[out("steer_angle", unit=None, type=kind)])
    wires = plan(scenario(), swaps=["driver=driver_int"]).wires
    assert "plant" in [wire.target for wire in wires if wire.source == "driver"]


def test_a_constant_integer_and_an_enumeration_feed_an_enumeration_that_knows_their_items(
    folder: Path,
) -> None:
    mode: dict[str, Any] = {"type": "Enumeration", "start": 1, "variability": "discrete"}

    def feed(source: Var, *known: str) -> Path:
        make_fmu(folder / "sensor.fmu", outputs=[source])
        make_fmu(folder / "taker.fmu", inputs=[Var("road", items=known, **mode)], outputs=["y"])
        return scenario("  sensor: {fmu: sensor}\n  taker: {fmu: taker}\n", "")

    def number(n: int) -> Var:
        return Var("road", type="Integer", start=n, variability="constant")

    where = "wiring-enumeration-mismatch | a.yaml:5: units.taker | sensor.road | taker.road"
    assert len(plan(feed(number(2), "dry", "wet")).wires) == 1
    assert told(problems(feed(number(3), "dry", "wet")), f"{where} | 3 | dry 1 | wet 2")
    known = ("dry", "wet", "ice")
    assert len(plan(feed(out("road", items=("dry", "wet"), **mode), *known)).wires) == 1
    assert told(problems(feed(out("road", items=("dry", "ice"), **mode), *known)), f"{where} | ice 2 | ice 3")


# Constants


def test_a_constant_by_name_goes_before_one_by_pattern() -> None:
    rest = (
        'inputs: {"friction*": 80 %, friction_fl: 0.3, tyre.friction_fr: 0.4, "tyre.friction_r*": 0.5}\n'
        + TORQUES
    )
    made = plan(scenario(rest=rest))
    values = [unit(made, "tyre").constants[f"friction_{w}"] for w in WHEELS]
    assert values == [0.3, 0.4, 0.5, 0.5]
    assert unit(made, "controller").constants == {"friction": 0.8}


def test_two_constants_for_one_input_are_said() -> None:
    rest = 'inputs: {"friction*": 0.8, "friction_*": 0.3}\n' + TORQUES
    assert each_mentions(
        problems(scenario(rest=rest)),
        ("a.yaml:8", "inputs.friction_*", "tyre.friction_*", "inputs.friction*"),
    )


def test_a_constant_that_names_the_unit_goes_before_equal_names_with_a_note() -> None:
    rest = 'inputs: {"friction*": 1, tyre.slip_ratio_*: 0.1, plant.steer_angle: 1 deg}\n' + TORQUES
    made = plan(scenario(rest=rest))
    assert [unit(made, "tyre").constants[f"slip_ratio_{w}"] for w in WHEELS] == [0.1] * 4
    assert unit(made, "plant").constants == {"steer_angle": math.pi / 180}
    assert [w.target for w in made.wires if w.output == "steer_angle"] == ["controller"]
    assert not [w for w in made.wires if w.input.startswith("slip_ratio")]
    assert each_mentions(
        texts_of(made),
        ("plant.steer_angle", "driver.steer_angle"),
        ("tyre.slip_ratio_*", "plant.slip_ratio_*"),
    )


def test_a_constant_never_goes_before_a_connection() -> None:
    rest = 'inputs: {"friction*": 1, "plant.wheel_torque_*": 0}\n' + TORQUES
    assert each_mentions(
        problems(scenario(rest=rest)),
        ("a.yaml:8", "inputs.plant.wheel_torque_*", "plant.wheel_torque_*", "controller.torque_request_*"),
    )


# Which of several sources


def estimators(folder: Path) -> str:
    """Write an estimator and a road that both offer friction, and return all units."""
    for name, more in (("estimator", ["yaw_rate"]), ("road", [])):
        units = {"yaw_rate": "rad/s"}
        outputs = ["friction_*", "friction", *more]
        make_fmu(folder / f"{name}.fmu", outputs=[out(n, unit=units.get(n, "1")) for n in outputs])
    return UNITS + "  estimator: {fmu: estimator}\n  road: {fmu: road}\n"


def sources(made: Plan, name: str) -> dict[str, str]:
    return {w.target: w.source for w in made.wires if w.input == name}


def test_lists_of_units_choose_among_equal_names_in_an_order_that_all_of_them_allow(folder: Path) -> None:
    rest = TORQUES + "  - {from: [road, driver], to: [tyre, controller]}\n"
    rest += "  - {from: [estimator, road], to: [controller]}\n"
    made = plan(scenario(estimators(folder), rest))
    assert sources(made, "friction_fl") == {"tyre": "road"}
    assert sources(made, "friction") == {"controller": "estimator"}
    assert sources(made, "yaw_rate") == {"controller": "estimator"}
    assert sources(made, "steer_angle") == {"plant": "driver", "controller": "driver"}


def test_a_list_of_units_goes_after_connections_and_constants_that_name_the_input(folder: Path) -> None:
    rest = "inputs: {controller.friction: 0.5}\n" + TORQUES
    rest += (
        "  - {from: [estimator], to: [tyre, controller]}\n  - {from: road.friction_*, to: tyre.friction_*}\n"
    )
    made = plan(scenario(estimators(folder), rest))
    assert sources(made, "friction_rr") == {"tyre": "road"}
    assert unit(made, "controller").constants == {"friction": 0.5}
    assert sources(made, "yaw_rate") == {"controller": "estimator"}


def test_a_list_of_units_gives_what_a_star_names_from_the_first_that_has_it(folder: Path) -> None:
    true = ("yaw_rate", "steer_angle", "friction")
    inputs = [Var(f"{name}_true", measure) for name, measure in zip(true, ("rad/s", "rad", "1"), strict=True)]
    make_fmu(folder / "sensor.fmu", inputs=inputs)
    rest = TORQUES + "  - {from: [road, plant, driver, estimator], to: sensor.*_true}\n"
    rest += "  - {from: [road], to: [tyre, controller]}\n  - {from: [plant], to: [controller]}\n"
    made = plan(scenario(estimators(folder) + "  sensor: {fmu: sensor}\n", rest))
    seen = {w.input: f"{w.source}.{w.output}" for w in made.wires if w.target == "sensor"}
    assert seen == {
        "yaw_rate_true": "plant.yaw_rate",
        "steer_angle_true": "driver.steer_angle",
        "friction_true": "road.friction",
    }


def test_what_a_swap_leaves_without_equal_names_is_no_error_but_a_note() -> None:
    path = scenario(rest=CONSTANTS + TORQUES + "  - {from: [driver], to: [controller]}\n")
    made = plan(path, swaps=["controller=controller_off"])
    assert mentions(texts_of(made), "connections[1]", "left", "equal")


def test_lists_that_prefer_in_a_circle_are_an_error_that_names_it(folder: Path) -> None:
    rest = TORQUES + "  - {from: [estimator, road], to: [controller]}\n"
    rest += "  - {from: [road, driver], to: [tyre, controller]}\n"
    rest += "  - {from: [driver, estimator], to: [controller]}\n"
    found = problems(scenario(estimators(folder), rest))
    where = "a.yaml:14: connections[3] | connections[1] | connections[2] | controller"
    assert told(found, f"connection-circular | {where}")


def test_null_leaves_an_input_without_a_source(folder: Path) -> None:
    units = estimators(folder).replace("  road: {fmu: road}\n", "")
    left_alone = TORQUES + "  - {from: null, to: tyre.friction_*}\n"
    left_alone += "  - {from: [plant], to: [controller]}\n"
    assert told(
        problems(scenario(units, left_alone)),
        "input-undriven | a.yaml:7: units.tyre | tyre.friction_* | 1 | estimator.friction_*"
        " | estimator.friction | 'inputs'",
    )
    made = plan(scenario(units, 'inputs: {"friction_*": 0.3}\n' + left_alone))
    assert [unit(made, "tyre").constants[f"friction_{w}"] for w in WHEELS] == [0.3] * 4
    assert sources(made, "friction_fl") == {}


# Records


def test_all_outputs_but_text_are_recorded_unless_the_scenario_says_otherwise() -> None:
    made = plan()
    assert made.record[0] == ("driver", "steer_angle")
    assert len(made.record) == 1 + 4 + 10 + 8
    assert ("plant", "status") not in made.record


def test_a_record_of_nothing_is_said() -> None:
    rest = CONSTANTS + TORQUES + 'record: [plant.yawrate, "*.beta"]\n'
    assert told(
        problems(scenario(rest=rest)),
        "variable-unknown | a.yaml:11: record[0] | 'yawrate' | 'yaw_rate' | plant\n"
        "variable-unknown | a.yaml:11: record[1] | 'beta' | steer_angle | torque_request_* | yaw_rate"
        " | acceleration_y | slip_angle_*",
    )


def test_every_value_says_where_it_comes_from() -> None:
    Path("car.yaml").write_text("parameters: {mass: 1200}\n", encoding="utf-8")
    units = UNITS.replace("driver_sine}", "driver_sine, parameters: {amplitude: 0.05}}")
    made = plan(scenario(units, head="vehicle: car.yaml\n"), settings=["inputs.friction_fl=0.3"])
    origins = {
        ("plant", "mass"): "vehicle",
        ("driver", "amplitude"): "scenario",
        ("driver", "road"): "default",
        ("tyre", "friction_fl"): "--set",
        ("tyre", "friction_rr"): "scenario",
    }
    assert {key: unit(made, key[0]).origin(key[1]).kind for key in origins} == origins


def test_a_plan_names_what_is_other_than_in_the_scenario_file() -> None:
    made = plan(settings=["inputs.friction*=0.3", "driver.amplitude=0.05", "driver.amplitude=0.1"])
    changes = {"inputs.friction*": 0.3, "driver.amplitude": 0.1}
    assert made.changes == tuple(Override.of(name, value, "--set") for name, value in changes.items())
    same = plan(swaps=["controller=controller_fnn"], settings=["inputs.friction*=0.65", "stop_time=8.0"])
    assert same.changes == ()
    assert unit(same, "tyre").origin("friction_fl").kind == "--set"


def test_any_variable_is_recorded_by_its_name_once_in_order_and_patterns_mean_outputs_first() -> None:
    record = (
        'record: [plant.mass, plant.status, tyre.friction_*, "*.wheel_radius", "*.yaw_rate", driver.shape'
    )
    rest = f"{CONSTANTS}{TORQUES}{record}, tyre.friction_fl, plant.yaw_rate]\n"
    assert plan(scenario(rest=rest)).record == (
        ("plant", "mass"),
        ("plant", "status"),
        *(("tyre", f"friction_{w}") for w in WHEELS),
        ("controller", "wheel_radius"),
        ("plant", "wheel_radius"),
        ("plant", "yaw_rate"),  # and not the controller's input
        ("driver", "shape"),
    )


def test_an_input_without_a_source_is_not_sent_to_whatever_has_its_unit_of_measurement(folder):
    make_fmu(
        folder / "controller_fnn.fmu",
        inputs=[Var("steer_angle", "rad"), Var("roll_rate", "rad/s"), Var("friction"), Var("brake", "N")],
        outputs=[out("torque_request_*", unit="N.m"), out("roll_rate_ref", unit="rad/s")],
    )
    assert told(
        problems(scenario()),
        "input-undriven | a.yaml:5: units.controller | controller.roll_rate | rad/s | plant.yaw_rate\n"
        "input-undriven | a.yaml:5: units.controller | controller.brake | 'inputs'",
    )


def test_a_parameter_that_is_text_can_come_from_a_file(folder):
    texts = [Var(name, type="String", start="") for name in ("patches", "friction_table")]
    parameters = [*texts, Var("mu", start=0.9)]
    make_fmu(folder / "road.fmu", outputs=[out("heat")], parameters=parameters)
    Path("sub").mkdir()
    Path("sub/patches.txt").write_bytes("\ufeffy > 0\nx < 5 # Größe\n".encode())

    def with_road(given):
        return scenario(UNITS + f"  road: {{fmu: road, parameters: {{{given}}}}}\n")

    made = unit(plan(with_road("patches: {file: sub/patches.txt}")), "road")
    assert made.parameters["patches"] == "y > 0\nx < 5 # Größe\n"
    assert made.origin("patches") == ValueOrigin("file", "sub/patches.txt")
    for given, code, names in (
        ("patches: {file: none.txt}", "file-unreadable", "none.txt"),
        ("patches: {file: sub}", "file-unreadable", "sub | directory"),
        ("mu: {file: sub/patches.txt}", "value-wrong-type", "text"),
        ("friction_table: {file: sub/patches.txt}", "value-invalid", "sub/patches.txt | line 2 | 'x < 5'"),
        ("patches: '1e400: y > 0'", "value-invalid", "1e400 | '1e400: y > 0'"),
    ):
        where = f"a.yaml:8: units.road.parameters.{given.partition(':')[0]}"
        assert told(problems(with_road(given)), f"{code} | {where} | {names}")


def test_a_scenario_is_wired_anew_when_its_fmu_has_been_mended(folder):
    loaded = load_scenario(scenario())
    good = (folder / "tyre_dugoff.fmu").read_bytes()
    make_fmu(folder / "tyre_dugoff.fmu", inputs=[Var("slip_angle_*", "rad")], outputs=[out("grip", unit="N")])
    with refused(WiringError, "input-undriven"):
        make_plan(loaded)
    (folder / "tyre_dugoff.fmu").write_bytes(good)
    assert make_plan(loaded).wires == make_plan(load_scenario(scenario())).wires
