"""Scenarios as SSP archives: valid, complete, and the same numbers when they are read back."""

from __future__ import annotations

import re
import shutil
import zipfile
from copy import deepcopy
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import fmpy.ssp
import pytest
from lxml import etree

from tests.cars import load_scenario, make_plan
from tests.changed import changed
from tests.command_line import status_of
from tests.fmus.fake_fmus import make_fmu
from tests.refusals import mentions, refused, texts_of
from yawbench.foundation.errors import ResultsError, YawbenchError
from yawbench.interop.ssp_write import for_omsimulator, write_ssp
from yawbench.orchestrator.master.simulate import simulate
from yawbench.orchestrator.scenario.catalogue import files
from yawbench.orchestrator.scenario.ssp_archive import DESCRIPTION_FILE, SSD

SCENARIOS = Path(__file__).parents[2] / "scenarios"
PAPERS = (
    "fnn_sideslip/25mps.yaml",
    "fuzzy_sliding_mode/high_friction.yaml",
    "fuzzy_pid/sine.yaml",
    "fuzzy_feedback/single_sine.yaml",
)
SCHEMAS = Path(fmpy.ssp.__file__).parent / "schema"


@pytest.fixture(scope="module")
def feedback(fmus, tmp_path_factory):
    """An archive of the smallest scenario."""
    path = tmp_path_factory.mktemp("ssp") / "feedback.ssp"
    write_ssp(plan_of(SCENARIOS / PAPERS[3], fmus), path)
    return path


def plan_of(path, fmus, **options):
    return make_plan(load_scenario(path, changes=changed(stop_time=0.6, **options)), fmus=fmus)


def results_of(plan, folder):
    simulate(plan, folder)
    return (folder / "results.csv").read_bytes()


class Archive:
    """A copy of the archive of the smallest scenario, to be edited and planned."""

    def __init__(self, path, fmus):
        self.path, self.fmus = path, fmus

    def write(self, description, members=None):
        """Put in another description, a text or a tree, and other members; return the archive."""
        content = description if isinstance(description, bytes) else etree.tostring(description)
        with zipfile.ZipFile(self.path) as old:
            every = {name: old.read(name) for name in old.namelist()}
        with zipfile.ZipFile(self.path, "w") as new:
            for name, held in (every | {DESCRIPTION_FILE: content, **(members or {})}).items():
                new.writestr(name, held)
        return self

    def replace(self, *changes):
        """Replace pieces of the description; return the archive."""
        content = etree.tostring(described(self.path)).decode()
        for before, after in changes:
            assert before in content
            content = content.replace(before, after)
        return self.write(content.encode())

    def plan(self, **changes):
        return make_plan(load_scenario(self.path, changes=changed(**changes)), fmus=self.fmus)

    def problem(self):
        with pytest.raises(YawbenchError) as error:
            self.plan()
        (sentence,) = texts_of(error.value)
        return sentence


@pytest.fixture
def archive(feedback, fmus, tmp_path):
    return Archive(Path(shutil.copy(feedback, tmp_path / "copy.ssp")), fmus)


def described(archive):
    with zipfile.ZipFile(archive) as held:
        return etree.fromstring(held.read(DESCRIPTION_FILE))


def unit_of(plan, name):
    return next(unit for unit in plan.instances if unit.name == name)


def every_scenario():
    """Return the names of the scenarios, those of the papers first."""
    known = (path.relative_to(SCENARIOS).as_posix() for path, _ in files(SCENARIOS, ["a scenario"]))
    return list(dict.fromkeys([*PAPERS, *known]))


@pytest.mark.parametrize("scenario", every_scenario())
@pytest.mark.parametrize("standard", ["1.0", "2.0"])
@pytest.mark.sampled(2)
def test_a_round_trip_gives_the_same_numbers_to_the_last_bit(scenario, standard, fmus, tmp_path):
    plan = plan_of(SCENARIOS / scenario, fmus)
    write_ssp(plan, tmp_path / "system.ssp", standard)
    back = make_plan(load_scenario(tmp_path / "system.ssp"))
    assert back.n_steps == plan.n_steps
    assert back.algorithm == plan.algorithm
    assert set(back.wires) == set(plan.wires)
    assert [unit.constants for unit in back.instances] == [unit.constants for unit in plan.instances]
    assert [unit.period for unit in back.instances] == [unit.period for unit in plan.instances]
    assert results_of(back, tmp_path / "back") == results_of(plan, tmp_path / "plan")
    write_ssp(back, tmp_path / "again.ssp", standard)
    assert (tmp_path / "again.ssp").read_bytes() == (tmp_path / "system.ssp").read_bytes()


@pytest.mark.parametrize("scenario", PAPERS)
@pytest.mark.parametrize("standard", ["1.0", "2.0"])
@pytest.mark.parametrize("adapted", [False, True], ids=["all", "omsimulator"])
@pytest.mark.sampled(2)
def test_an_archive_is_valid_against_the_schemas_of_ssp(scenario, standard, adapted, fmus, tmp_path):
    """Version 2.0 differs here from 1.0 by the number alone."""
    plan = plan_of(SCENARIOS / scenario, fmus)
    write_ssp(for_omsimulator(plan)[0] if adapted else plan, tmp_path / "system.ssp", standard)
    with zipfile.ZipFile(tmp_path / "system.ssp") as archive:
        description = etree.fromstring(archive.read(DESCRIPTION_FILE))
        held = set(archive.namelist())
    assert re.fullmatch(r"[A-Za-z_]\w*", description.get("name"), re.ASCII)
    for one in (description, *description.iterfind(".//{*}ParameterSet")):
        assert one.get("version") == standard
        one.set("version", "1.0")
    etree.XMLSchema(file=str(SCHEMAS / "SystemStructureDescription.xsd")).assertValid(description)
    values = etree.XMLSchema(file=str(SCHEMAS / "SystemStructureParameterValues.xsd"))
    sets = description.findall(".//{*}ParameterSet")
    assert sets
    for one in sets:
        values.assertValid(etree.fromstring(etree.tostring(one)))
    sources = {one.get("source") for one in description.iter(f"{{{SSD}}}Component")}
    assert sources <= held


def test_the_command_exports_for_libcosim_with_choices_as_numbers_and_the_same_bits(
    fmus, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    scenario, swap = SCENARIOS / PAPERS[3], "controller=controller_off"
    options = ("--fmus", fmus, "--for", "libcosim", "--swap", swap)
    assert status_of("export-ssp", scenario, *options, "--set", "stop_time=0.6") == 0
    again = make_plan(load_scenario("single_sine.ssp"))
    assert unit_of(again, "reference").parameters["mode"] == 2
    assert unit_of(again, "reference").fmu.variables["mode"].type == "Integer"
    assert not described("single_sine.ssp").findall(".//{*}Enumeration")
    own = results_of(plan_of(scenario, fmus, swaps=[swap]), tmp_path / "own")
    assert results_of(again, tmp_path / "again") == own


def test_units_of_an_archive_are_swapped_and_set_as_those_of_a_scenario(feedback, fmus, tmp_path):
    changes = {"swaps": ["controller=controller_off"], "settings": ["plant.initial_speed=80 km/h"]}
    swapped, same = (plan_of(file, fmus, **changes) for file in (feedback, SCENARIOS / PAPERS[3]))
    assert results_of(swapped, tmp_path / "a") == results_of(same, tmp_path / "b")


def test_a_text_that_xml_cannot_hold_is_refused(fmus, tmp_path):
    plan = replace(plan_of(SCENARIOS / PAPERS[3], fmus), title="bell \a")
    with refused(ResultsError, names=("system.ssp", "NULL")):
        write_ssp(plan, tmp_path / "system.ssp")
    assert not (tmp_path / "system.ssp").exists()


def test_an_input_that_an_archive_leaves_alone_keeps_its_start_value(archive):
    root = described(archive.path)
    for connection in root.findall(".//{*}Connection[@endConnector='yaw_moment']"):
        connection.getparent().remove(connection)
    assert unit_of(archive.write(root).plan(), "plant").constants["yaw_moment"] == 0.0


def test_start_and_end_of_a_connection_say_nothing_of_its_direction(archive):
    wires, root = archive.plan().wires, described(archive.path)
    for one in root.findall(".//{*}Connection"):
        for what in ("Element", "Connector"):
            start, end = one.get(f"start{what}"), one.get(f"end{what}")
            one.set(f"start{what}", end)
            one.set(f"end{what}", start)
    assert archive.write(root).plan().wires == wires


def nested(root, element):
    """Put a component of a description into a system of its own, behind connectors of it."""
    component = root.find(f".//{{*}}Component[@name='{element}']")
    inner = etree.Element(f"{{{SSD}}}System", name="inner")
    component.getparent().replace(component, inner)
    inner.append(deepcopy(component.find("{*}Connectors")))
    etree.SubElement(inner, f"{{{SSD}}}Elements").append(component)
    connections = etree.SubElement(inner, f"{{{SSD}}}Connections")
    for connector in component.iterfind("{*}Connectors/{*}Connector"):
        name = connector.get("name")
        ends = {"startConnector": name, "endElement": element, "endConnector": name}
        etree.SubElement(connections, f"{{{SSD}}}Connection", ends)
    for connection in root.iterfind("{*}System/{*}Connections/{*}Connection"):
        for end in ("startElement", "endElement"):
            if connection.get(end) == element:
                connection.set(end, "inner")


def test_a_system_in_the_system_is_laid_flat(archive, tmp_path):
    outside, root = results_of(archive.plan(), tmp_path / "outside"), described(archive.path)
    nested(root, "tyre")
    etree.XMLSchema(file=str(SCHEMAS / "SystemStructureDescription.xsd")).assertValid(root)
    plan = archive.write(root).plan()
    assert any("inner_tyre (inner.tyre)" in note for note in texts_of(plan))
    assert results_of(plan, tmp_path / "inside").replace(b"inner_", b"") == outside


def test_names_that_cannot_name_a_unit_are_changed(archive):
    archive.replace(
        ('name="plant"', 'name="vehicle"'), ('t="plant"', 't="vehicle"'),
        ('name="tyre"', 'name="Four tyres.v2"'), ('t="tyre"', 't="Four tyres.v2"'),
    )  # fmt: skip
    root = described(archive.path)
    own = root.find(".//{urn:yawbench:ssp:1}Scenario")
    for record in list(own):
        own.remove(record)
    plan = archive.write(root).plan()
    names = {"driver", "reference", "controller", "_vehicle", "Four_tyres_v2"}
    assert {unit.name for unit in plan.instances} == names
    assert mentions(texts_of(plan), "_vehicle (vehicle)", "Four_tyres_v2")


def test_a_value_for_what_nothing_has_is_passed_over_with_a_note(archive):
    plan = archive.replace(('name="initial_speed"', 'name="speed"')).plan()
    assert "initial_speed" not in unit_of(plan, "plant").parameters
    assert mentions(texts_of(plan), "plant.speed", "values")


def test_a_start_value_of_a_connected_input_counts_for_nothing(archive):
    plant = unit_of(archive.replace(('name="initial_speed"', 'name="steer_angle"')).plan(), "plant")
    assert "steer_angle" not in plant.constants | plant.parameters


TO_PLANT = 'startConnector="steer_angle" endElement="plant"'


@pytest.mark.parametrize(
    ("before", "after", "names"),
    [
        ("resources/plant_two_dof.fmu", "../plant_two_dof.fmu", ("archive",)),
        ("resources/plant_two_dof.fmu", "http://host/plant.fmu", ("archive",)),
        ("resources/plant_two_dof.fmu", "resources/nothing.fmu", ("resources/nothing.fmu",)),
        ("resources/plant_two_dof.fmu", "plant.ssd", ("supported",)),
        ('implementation="CoSimulation"', 'implementation="ModelExchange"', ("CoSimulation", "supported")),
        ("<ssd:Elements>", '<ssd:Elements><ssd:Other name="x"/>', ("Other", "element", "kind")),
        ('name="tyre"', 'name="plant"', ("'plant'", "elements")),
        (TO_PLANT, TO_PLANT.replace("steer_angle", "steer"), ("'steer'", "driver")),
        (
            f'{TO_PLANT} endConnector="steer_angle"',
            f'{TO_PLANT.replace("steer_angle", "velocity_x")} endConnector="steer_angle"',
            ("driver.velocity_x", "plant.steer_angle"),
        ),
        (
            'endElement="plant" endConnector="tyre_force_x_fr"',
            'endElement="plant" endConnector="tyre_force_x_fl"',
            ("plant.tyre_force_x_fl", "tyre.tyre_force_x_fl", "tyre.tyre_force_x_fr"),
        ),
        ('startElement="driver"', 'startElement="nobody"', ("'nobody'", "component")),
        ('startElement="driver"', "", ("'steer_angle'", "connector", "system")),
        ('source="resources/plant_two_dof.fmu"', 'source="a.fmu" sourceBase="component"', ("component",)),
        ('startTime="0.0"', 'startTime="1.0"', ("start_time", "1 s")),
        ('value="25.0"', 'value="fast"', ("'fast'", "Real")),
        ("</ssd:System>", "", ("not well-formed",)),
    ],
)
def test_what_an_archive_cannot_mean_here_is_said_in_one_sentence(archive, before, after, names):
    sentence = archive.replace((before, after)).problem()
    assert sentence.startswith(str(archive.path))
    assert mentions(sentence, *names)


NO_STEP = ("osp:FixedStepAlgorithm", "osp:Other"), ("yawbench:Scenario", "ssc:Other")


def test_an_archive_without_a_step_asks_for_one_and_takes_it(archive):
    archive.replace(*NO_STEP, ("oms:FixedStepMaster", "oms:Other"))
    assert mentions(archive.problem(), archive.path, "communication step", "--set step_size=0.001")
    plan = archive.plan(step_size=0.0025)
    assert (plan.n_steps, plan.algorithm) == (240, "extrapolated")


def test_the_step_of_an_archive_of_omsimulator_is_taken(archive):
    archive.replace(*NO_STEP, ('oms-ma" stepSize="0.001"', 'oms-ma" stepSize="0.000500"'))
    assert archive.plan().step == Fraction(1, 2000)


def test_an_archive_without_a_stop_time_asks_for_one(archive):
    archive.replace(('stopTime="0.6"', ""))
    assert mentions(archive.problem(), "archive", "stop", "time")
    assert archive.plan(stop_time=0.2).n_steps == 200


def test_a_component_that_cannot_be_run_is_named(archive, tmp_path):
    member = "resources/plant_two_dof.fmu"
    content = make_fmu(tmp_path / "plant.fmu", xml='<fmiModelDescription fmiVersion="1.0"/>').read_bytes()
    archive.write(described(archive.path), {member: content})
    assert mentions(archive.problem(), member, "FMI 1.0")


def test_entities_are_not_expanded_and_no_file_is_read_for_them(archive, tmp_path):
    secret = tmp_path / "secret"
    secret.write_text("90")
    declared = f'<!DOCTYPE a [<!ENTITY e SYSTEM "{secret.as_uri()}">]><ssd:SystemStructureDescription '
    value = '<ssv:Real value="25.0" unit="m/s"/>'
    archive.replace(("<ssd:SystemStructureDescription ", declared), (value, "&e;"))
    assert mentions(archive.problem(), "has no value")


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 cut off", None])
def test_what_is_no_archive_is_said_in_one_sentence(archive, content):
    archive.path.unlink()
    if content is not None:
        archive.path.write_bytes(content)
    assert mentions(archive.problem(), f"{archive.path}: ", "archive")
