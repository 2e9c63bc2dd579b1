"""Differences (`relativeQuantity`): a rise of 7 degC is one of 7 K, wherever a number meets a unit."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import pytest

from tests.changed import changed
from tests.fmus.fake_fmus import Var, make_fmu, out
from tests.interop.test_ssp_units import archive, component, connector, wire
from tests.refusals import refused
from yawbench.fmus.archive import open_fmu
from yawbench.foundation.errors import YawbenchError
from yawbench.interop.ssp_write import for_omsimulator, write_ssp
from yawbench.orchestrator.plan import Instance, Plan
from yawbench.orchestrator.scenario.loader import load_scenario
from yawbench.orchestrator.wiring.make_plan import make_plan

pytestmark = pytest.mark.usefixtures("common_cache")

DEGREES = {
    "K": 'K="1"',
    "degC": 'K="1" offset="273.15"',
    "degF": 'K="1" factor="0.5555555555555556" offset="255.372222"',
}
UNITS = "".join(f'<Unit name="{name}"><BaseUnit {base}/></Unit>' for name, base in DEGREES.items())


def plan_of(
    folder: Path, source: Var, target: Var, *, more: str = "", parameter: object = None, **changes: object
) -> Plan:
    """Return the plan of an FMU that feeds another."""
    make_fmu(folder / "a.fmu", outputs=[source], definitions=DEGREES)
    parameters = [Var("p", target.unit, relative=target.relative)]
    make_fmu(folder / "b.fmu", inputs=[target], outputs=["z"], parameters=parameters, definitions=DEGREES)
    units: dict[str, dict[str, object]] = {"a": {"fmu": "./a.fmu"}, "b": {"fmu": "./b.fmu"}}
    if parameter is not None:
        units["b"]["parameters"] = {"p": parameter}
    ends = f"{{from: a.{source.name}, to: b.{target.name}{more}}}"
    (folder / "s.yaml").write_text(
        f"stop_time: 1\nstep_size: 0.1\nunits: {json.dumps(units)}\nconnections: [{ends}]\n"
    )
    return make_plan(load_scenario(folder / "s.yaml", changes=changed(**changes)))  # type: ignore[arg-type]


RISE, TEMPERATURE = (Var("x", "K", relative=relative) for relative in (True, False))


@pytest.mark.parametrize(
    ("unit", "target", "offset"),
    [
        ("degC", RISE, 0.0),
        ("degF", RISE, 0.0),
        ("degC", TEMPERATURE, 273.15),
        ("degF", TEMPERATURE, 255.372222),
    ],
)
def test_a_wire_between_differences_has_no_offset(unit, target, offset, tmp_path):
    (only,) = plan_of(tmp_path, out("y", unit=unit, relative=target.relative), target).wires
    assert (only.gain, only.offset) == pytest.approx((1.0 if unit == "degC" else 5 / 9, offset))


def b_of(plan: Plan) -> Instance:
    return next(unit for unit in plan.instances if unit.name == "b")


@pytest.mark.parametrize(("target", "value"), [(RISE, 5.0), (TEMPERATURE, 278.15)])
@pytest.mark.parametrize("written", ["scenario", "override"])
def test_a_parameter_that_is_a_difference_has_no_offset(target, value, written, tmp_path):
    given = {"parameter": "5 degC"} if written == "scenario" else {"settings": ["b.p=5 degC"]}
    plan = plan_of(tmp_path, out("y", unit="K", relative=target.relative), target, **given)
    assert b_of(plan).parameters == {"p": value}


def test_a_constant_and_a_time_series_that_are_differences_have_no_offset(tmp_path):
    inputs = [RISE, Var("v", "K", relative=True)]
    make_fmu(tmp_path / "b.fmu", inputs=inputs, outputs=["z"], definitions=DEGREES)
    (tmp_path / "r.csv").write_text("time [s],rise [degC]\n0,7\n1,7\n")
    (tmp_path / "s.yaml").write_text(
        "stop_time: 1\nstep_size: 0.1\nunits: {b: {fmu: ./b.fmu}}\n"
        "inputs: {b.v: 3 degC, b.x: {file: r.csv, column: rise}}\n"
    )
    (b,) = make_plan(load_scenario(tmp_path / "s.yaml")).instances
    assert b.constants == {"v": 3.0, "x": 7.0}


@pytest.mark.parametrize("fault", ["bias 2 degC", "noise 2 degC", "outlier 2 degC share 0.1"])
def test_what_a_fault_adds_is_a_difference(fault, tmp_path):
    plan = plan_of(tmp_path, out("y", unit="K"), TEMPERATURE, faults=[f"a.y: {fault}"])
    assert [signal.value for signal in plan.faults] == [2.0]


@pytest.mark.parametrize("unit", ["degC", "degF"])
def test_a_difference_into_a_temperature_of_another_zero_is_refused(unit, tmp_path):
    rise = out("y", unit=unit, relative=True)
    with refused(YawbenchError, "wiring-relative-mismatch", names=(f"a.y [{unit}]", "b.x [K]")):
        plan_of(tmp_path, rise, TEMPERATURE)
    assert plan_of(tmp_path, rise, TEMPERATURE, more=", gain: 1, offset: 300").wires[0].offset == 300.0


def test_a_difference_into_a_temperature_of_the_same_unit_is_a_warning(tmp_path):
    plan = plan_of(tmp_path, out("y", unit="K", relative=True), TEMPERATURE)
    assert [d.severity for d in plan.diagnostics if d.code == "wiring-relative-mismatch"] == ["warning"]
    assert (plan.wires[0].gain, plan.wires[0].offset) == (1.0, 0.0)


def test_a_difference_of_a_quantity_without_offsets_fits_any(tmp_path):
    plan = plan_of(tmp_path, out("y", unit="km/h", relative=True), Var("x", "m/s"))
    assert plan.wires[0].gain == pytest.approx(1 / 3.6)
    assert not [d for d in plan.diagnostics if d.code == "wiring-relative-mismatch"]


def is_difference(path: Path) -> bool:
    return open_fmu(path).variables["y"].relative


@pytest.mark.parametrize(("own", "relative"), [("", True), ('relativeQuantity="false"', False)])
def test_what_a_type_says_of_differences_is_the_default_of_its_variables(own, relative, tmp_path):
    xml = (
        '<fmiModelDescription fmiVersion="2.0" modelName="m" guid="m"><CoSimulation modelIdentifier="m"/>'
        f"<UnitDefinitions>{UNITS}</UnitDefinitions>"
        '<TypeDefinitions><SimpleType name="T"><Real unit="K" relativeQuantity="1"/></SimpleType>'
        '</TypeDefinitions><ModelVariables><ScalarVariable name="y" valueReference="1" causality="output">'
        f'<Real declaredType="T" {own}/></ScalarVariable></ModelVariables>'
        '<ModelStructure><Outputs><Unknown index="1"/></Outputs></ModelStructure></fmiModelDescription>'
    )
    assert is_difference(make_fmu(tmp_path / "m.fmu", xml=xml)) is relative


@pytest.mark.parametrize("standard", ["1.0", "2.0"])
def test_differences_are_the_same_after_a_way_through_an_archive(standard, tmp_path):
    plan = plan_of(tmp_path, out("y", unit="degC", relative=True), RISE, parameter="7 K")
    write_ssp(plan, tmp_path / "s.ssp", standard=standard)
    with zipfile.ZipFile(tmp_path / "s.ssp") as held:
        assert b'suppressUnitConversion="true"' in held.read("SystemStructure.ssd")  # others would add 273.15
    back = make_plan(load_scenario(tmp_path / "s.ssp"))
    assert back.wires == plan.wires
    assert b_of(back).parameters == b_of(plan).parameters == {"p": 7.0}


def joined(folder: Path, target: Var, inner: str = "", **attributes: str) -> Plan:
    """Return the plan of an archive in which a rise in degC is connected to an input."""
    make_fmu(folder / "a.fmu", outputs=[out("y", unit="degC", relative=True)], definitions=DEGREES)
    make_fmu(folder / "b.fmu", inputs=[target], outputs=["z"], definitions=DEGREES)
    ends = component("a", connector("y", "output", "degC")), component("b", connector("x", "input", "K"))
    path = archive(folder, "".join(ends), wire("a.y", "b.x", inner, **attributes))
    return make_plan(load_scenario(path, changes=changed(step_size=0.1)))


def test_connections_of_an_archive_between_differences_have_no_offset(tmp_path):
    (only,) = joined(tmp_path, RISE).wires
    assert (only.gain, only.offset) == (1.0, 0.0)


def test_a_difference_and_a_temperature_are_not_connected_by_an_archive(tmp_path):
    with refused(YawbenchError, names=("relativeQuantity",)):
        joined(tmp_path, TEMPERATURE)
    linear = '<ssc:LinearTransformation factor="1" offset="300"/>'
    for inner, offset in ((linear, 300.0), ("", 0.0)):
        (only,) = joined(tmp_path, TEMPERATURE, inner, suppressUnitConversion="true").wires
        assert (only.gain, only.offset) == (1.0, offset)


def test_a_value_of_an_archive_for_a_difference_has_no_offset(tmp_path):
    plan = plan_of(tmp_path, out("y", unit="K", relative=True), RISE, parameter="5 K")
    write_ssp(plan, tmp_path / "s.ssp")
    with zipfile.ZipFile(tmp_path / "s.ssp") as held:
        members = {name: held.read(name) for name in held.namelist()}
    ssd = members["SystemStructure.ssd"]
    assert ssd.count(b'<ssv:Real value="5.0" unit="K"/>') == 1
    ssd = ssd.replace(b'<ssv:Real value="5.0" unit="K"/>', b'<ssv:Real value="5.0" unit="degC"/>')
    with zipfile.ZipFile(tmp_path / "t.ssp", "w") as held:
        for name, content in {**members, "SystemStructure.ssd": ssd}.items():
            held.writestr(name, content)
    back = make_plan(load_scenario(tmp_path / "t.ssp"))
    assert b_of(back).parameters == {"p": 5.0}


def test_omsimulator_which_converts_differences_with_the_offset_does_not_get_them(tmp_path):
    plan = plan_of(tmp_path, out("y", unit="degC", relative=True), RISE)
    with refused(YawbenchError, "ssp-unsupported"):
        for_omsimulator(plan)


@pytest.mark.parametrize("where", ["variable", "type"])
def test_fmi_3_says_differences_too(where, tmp_path):
    on_type, on_variable = (' relativeQuantity="true"' * (where == place) for place in ("type", "variable"))
    xml = (
        '<fmiModelDescription fmiVersion="3.0" modelName="m" instantiationToken="m">'
        f'<CoSimulation modelIdentifier="m"/><UnitDefinitions>{UNITS}</UnitDefinitions>'
        f'<TypeDefinitions><Float64Type name="T" unit="K"{on_type}/></TypeDefinitions>'
        '<ModelVariables><Float64 name="time" valueReference="0" causality="independent"/>'
        f'<Float64 name="y" valueReference="1" causality="output" declaredType="T"{on_variable}/>'
        '</ModelVariables><ModelStructure><Output valueReference="1"/><InitialUnknown valueReference="1"/>'
        "</ModelStructure></fmiModelDescription>"
    )
    path = tmp_path / "m.fmu"
    with zipfile.ZipFile(path, "w") as held:
        held.writestr("modelDescription.xml", xml)
        held.writestr("binaries/x86_64-linux/m.so", b"")
        held.writestr("binaries/aarch64-linux/m.so", b"")
    assert is_difference(path)
