"""Scenarios as SSP archives: valid, complete, and the same numbers when they are read back."""

from __future__ import annotations

import zipfile
from pathlib import Path

import fmpy.ssp
import pytest
from lxml import etree

from fmus.build import build_all
from orchestrator.cli import main
from orchestrator.errors import YawbenchError
from orchestrator.interop.ssp_write import write_ssp
from orchestrator.master.simulate import simulate
from orchestrator.scenario.load import load_scenario
from orchestrator.scenario.ssp_names import DESCRIPTION_FILE, SSD, SSM, SSV
from orchestrator.wiring.make_plan import make_plan

SCENARIOS = Path(__file__).parents[2] / "scenarios"
PAPERS = (
    "fnn_sideslip/25mps.yaml",
    "fuzzy_sliding_mode/high_friction.yaml",
    "fuzzy_pid/sine.yaml",
    "fuzzy_feedback/single_sine.yaml",
)
SCHEMAS = Path(fmpy.ssp.__file__).parent / "schema"


@pytest.fixture(scope="module")
def fmus(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fmus")
    build_all(folder)
    return folder


@pytest.fixture(scope="module")
def feedback(fmus, tmp_path_factory):
    """An archive of the smallest scenario."""
    path = tmp_path_factory.mktemp("ssp") / "feedback.ssp"
    write_ssp(plan_of(SCENARIOS / PAPERS[3], fmus), path)
    return path


def plan_of(path, fmus, **options):
    return make_plan(load_scenario(path, stop_time=0.6, **options), fmus=fmus)


def results_of(plan, folder):
    simulate(plan, folder)
    return (folder / "results.csv").read_bytes()


def rewritten(archive, target, *changes, without=()):
    """Copy an archive with pieces of its description replaced."""
    with zipfile.ZipFile(archive) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            if name == DESCRIPTION_FILE:
                for before, after in changes:
                    assert before.encode() in content
                    content = content.replace(before.encode(), after.encode())
            if name not in without:
                new.writestr(name, content)
    return target


def problem(archive, fmus):
    with pytest.raises(YawbenchError) as error:
        make_plan(load_scenario(archive), fmus=fmus)
    (sentence,) = error.value.problems
    return sentence


@pytest.mark.parametrize("scenario", PAPERS)
def test_a_round_trip_gives_the_same_numbers_to_the_last_bit(scenario, fmus, tmp_path):
    plan = plan_of(SCENARIOS / scenario, fmus)
    write_ssp(plan, tmp_path / "system.ssp")
    back = make_plan(load_scenario(tmp_path / "system.ssp"))
    assert back.n_steps == plan.n_steps
    assert back.algorithm == plan.algorithm == "extrapolated"
    assert [unit.constants for unit in back.units] == [unit.constants for unit in plan.units]
    assert [unit.period for unit in back.units] == [unit.period for unit in plan.units]
    assert results_of(back, tmp_path / "back") == results_of(plan, tmp_path / "plan")


@pytest.mark.parametrize("scenario", PAPERS)
def test_an_archive_is_valid_against_the_schemas_of_ssp(scenario, fmus, tmp_path):
    write_ssp(plan_of(SCENARIOS / scenario, fmus), tmp_path / "system.ssp")
    with zipfile.ZipFile(tmp_path / "system.ssp") as archive:
        description = etree.fromstring(archive.read(DESCRIPTION_FILE))
        held = set(archive.namelist())
    etree.XMLSchema(file=str(SCHEMAS / "SystemStructureDescription.xsd")).assertValid(description)
    values = etree.XMLSchema(file=str(SCHEMAS / "SystemStructureParameterValues.xsd"))
    sets = description.findall(".//{*}ParameterSet")
    assert sets
    for one in sets:
        values.assertValid(etree.fromstring(etree.tostring(one)))
    sources = {one.get("source") for one in description.iter(f"{{{SSD}}}Component")}
    assert sources <= held


def test_equal_plans_give_equal_bytes(fmus, tmp_path):
    for name in ("one.ssp", "two.ssp"):
        write_ssp(plan_of(SCENARIOS / PAPERS[0], fmus), tmp_path / name)
    assert (tmp_path / "one.ssp").read_bytes() == (tmp_path / "two.ssp").read_bytes()


def test_the_command_exports_and_run_runs_what_it_exports(fmus, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scenario, folder = str(SCENARIOS / PAPERS[3]), str(fmus)
    for arguments in (
        ["export-ssp", scenario, "--fmus", folder, "--swap", "controller=controller_off"],
        ["run", "single_sine.ssp", "--out", "from_ssp"],
        ["run", scenario, "--fmus", folder, "--swap", "controller=controller_off", "--out", "from_yaml"],
    ):
        with pytest.raises(SystemExit) as exit_:
            main(arguments)
        assert not exit_.value.code
    numbers = [(tmp_path / name / "results.csv").read_bytes() for name in ("from_ssp", "from_yaml")]
    assert numbers[0] == numbers[1]


def test_units_of_an_archive_are_swapped_and_set_as_those_of_a_scenario(feedback, fmus, tmp_path):
    swapped = plan_of(
        feedback, fmus, swaps=["controller=controller_off"], settings=["plant.initial_speed=80 km/h"]
    )
    same = plan_of(
        SCENARIOS / PAPERS[3],
        fmus,
        swaps=["controller=controller_off"],
        settings=["plant.initial_speed=80 km/h"],
    )
    assert results_of(swapped, tmp_path / "a") == results_of(same, tmp_path / "b")


def test_an_input_that_an_archive_leaves_alone_keeps_its_start_value(feedback, fmus, tmp_path):
    with zipfile.ZipFile(feedback) as archive:
        root = etree.fromstring(archive.read(DESCRIPTION_FILE))
    for connection in root.findall(".//{*}Connection"):
        if connection.get("endConnector") == "yaw_moment":
            connection.getparent().remove(connection)
    target = tmp_path / "open.ssp"
    with zipfile.ZipFile(feedback) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            new.writestr(name, etree.tostring(root) if name == DESCRIPTION_FILE else old.read(name))
    plan = make_plan(load_scenario(target), fmus=fmus)
    plant = next(unit for unit in plan.units if unit.name == "plant")
    assert plant.constants["yaw_moment"] == 0.0


def test_a_parameter_in_another_unit_is_converted(feedback, fmus, tmp_path):
    other = rewritten(
        feedback,
        tmp_path / "kmh.ssp",
        ('<ssv:Real value="25.0" unit="m/s"/>', '<ssv:Real value="90" unit="km/h"/>'),
    )
    plan = make_plan(load_scenario(other), fmus=fmus)
    assert next(u for u in plan.units if u.name == "plant").parameters["initial_speed"] == 25.0


def test_values_may_stand_at_the_system_with_a_prefix_in_a_file_of_their_own_under_mapped_names(
    feedback, fmus, tmp_path
):
    binding = (
        '<ssd:ParameterBindings><ssd:ParameterBinding source="values.ssv" prefix="plant.">'
        '<ssd:ParameterMapping source="names.ssm"/></ssd:ParameterBinding></ssd:ParameterBindings>'
    )
    target = rewritten(
        feedback,
        tmp_path / "mapped.ssp",
        ('<ssd:System name="system">', f'<ssd:System name="system">{binding}'),
        ('<ssv:Parameter name="initial_speed">', '<ssv:Parameter name="mass">'),
    )
    with zipfile.ZipFile(target, "a") as archive:
        archive.writestr(
            "values.ssv",
            f'<ssv:ParameterSet xmlns:ssv="{SSV}" version="1.0" name="v">'
            '<ssv:Parameters><ssv:Parameter name="speed"><ssv:Real value="20" unit="m/s"/>'
            "</ssv:Parameter></ssv:Parameters></ssv:ParameterSet>",
        )
        archive.writestr(
            "names.ssm",
            f'<ssm:ParameterMapping xmlns:ssm="{SSM}" version="1.0">'
            '<ssm:MappingEntry source="speed" target="initial_speed"/></ssm:ParameterMapping>',
        )
    plan = make_plan(load_scenario(target, settings=["plant.mass=1500"]), fmus=fmus)
    assert next(u for u in plan.units if u.name == "plant").parameters["initial_speed"] == 20.0


@pytest.mark.parametrize(
    ("before", "after", "says"),
    [
        ("resources/plant_two_dof.fmu", "../plant_two_dof.fmu", "is not in the archive"),
        ("resources/plant_two_dof.fmu", "http://host/plant.fmu", "is not in the archive"),
        ("resources/plant_two_dof.fmu", "resources/nothing.fmu", "there is no resources/nothing.fmu"),
        ("resources/plant_two_dof.fmu", "plant.ssd", "only FMUs are supported"),
        ('implementation="CoSimulation"', 'implementation="ModelExchange"', "only CoSimulation is supported"),
        ("<ssd:Elements>", '<ssd:Elements><ssd:System name="inner"/>', "a system in the system (inner)"),
        (
            "<ssd:Elements>",
            '<ssd:Elements><ssd:SignalDictionaryReference name="bus" dictionary="d"/>',
            "a signal dictionary (bus)",
        ),
        ('startElement="driver"', 'startElement="nobody"', "'nobody': there is no such component"),
        ('startElement="driver"', "", "the system's own connector"),
        ('startTime="0.0"', 'startTime="1.0"', "runs begin at 0 s"),
        ('value="25.0"', 'value="fast"', "'fast' is not of type Real"),
        ("</ssd:System>", "", "not well-formed"),
        ('name="initial_speed"', 'name="speed"', "no parameter 'speed'"),
    ],
)
def test_what_an_archive_cannot_mean_here_is_said_in_one_sentence(
    feedback, fmus, tmp_path, before, after, says
):
    archive = rewritten(feedback, tmp_path / "changed.ssp", (before, after))
    sentence = problem(archive, fmus)
    assert sentence.startswith(str(archive))
    assert says in sentence


def test_a_transformation_is_refused(feedback, fmus, tmp_path):
    with zipfile.ZipFile(feedback) as archive:
        description = archive.read(DESCRIPTION_FILE).decode()
    first = description[description.index("<ssd:Connection ") :]
    first = first[: first.index("/>") + 2]
    changed = first[:-2] + '><ssc:LinearTransformation factor="2"/></ssd:Connection>'
    archive = rewritten(feedback, tmp_path / "changed.ssp", (first, changed))
    assert "LinearTransformation is not supported" in problem(archive, fmus)


def test_an_archive_without_a_step_says_so_and_takes_one(feedback, fmus, tmp_path):
    archive = rewritten(
        feedback,
        tmp_path / "no_step.ssp",
        ("osp:FixedStepAlgorithm", "osp:Other"),
        ("yawbench:Scenario", "ssc:Other"),
    )
    assert "step_size" in problem(archive, fmus)
    assert make_plan(load_scenario(archive, step_size=0.0025), fmus=fmus).n_steps == 240


@pytest.mark.parametrize("content", [b"", b"no zip", b"PK\x03\x04 cut off"])
def test_what_is_no_archive_is_said_in_one_sentence(tmp_path, fmus, content):
    archive = tmp_path / "broken.ssp"
    archive.write_bytes(content)
    assert problem(archive, fmus).startswith(f"{archive}: ")
    assert problem(tmp_path / "missing.ssp", fmus) == f"{tmp_path / 'missing.ssp'}: no such SSP archive"


def test_an_archive_that_lacks_its_description_is_refused(feedback, fmus, tmp_path):
    archive = rewritten(feedback, tmp_path / "empty.ssp", without=(DESCRIPTION_FILE,))
    assert f"there is no {DESCRIPTION_FILE}" in problem(archive, fmus)
