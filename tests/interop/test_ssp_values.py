"""Values in SSP archives: every form that SSP 1.0 and 2.0 have is read, or refused with a sentence."""

from __future__ import annotations

import json
import sys
import zipfile
from pathlib import Path

import pytest
from lxml import etree

from tests.changed import changed
from tests.command_line import status_of
from tests.fmus import models3
from tests.fmus.fake_fmus import Var, make_fmu
from tests.refusals import mentions, refused, texts_of
from yawbench.foundation.errors import YawbenchError
from yawbench.interop.ssp_write import write_ssp
from yawbench.orchestrator.plan import Instance, Plan
from yawbench.orchestrator.scenario.loader import load_scenario
from yawbench.orchestrator.scenario.ssp_archive import SSC, SSD, SSM, SSV
from yawbench.orchestrator.wiring.make_plan import make_plan

pytestmark = pytest.mark.usefixtures("common_cache")

SPACES = f'xmlns:ssd="{SSD}" xmlns:ssc="{SSC}" xmlns:ssv="{SSV}" xmlns:ssm="{SSM}"'
GAIN = '<ssd:Component name="g" source="resources/g.fmu"/>'
FMI2 = {
    "k": Var("k", "m/s"),
    "n": Var("n", type="Integer", start=0),
    "on": Var("on", type="Boolean", start=False),
    "text": Var("text", type="String", start="none"),
    "mode": Var("mode", type="Enumeration", start=1, items=("dry", "wet")),
}


def parameters(inner: str, *, version: str = "2.0", more: str = "") -> str:
    return (
        f'<ssv:ParameterSet {SPACES} version="{version}" name="p"><ssv:Parameters>{inner}</ssv:Parameters>'
        f"<ssv:Units>{more}</ssv:Units></ssv:ParameterSet>"
    )


def parameter(name: str, inner: str) -> str:
    return f'<ssv:Parameter name="{name}">{inner}</ssv:Parameter>'


def binding(inner: str = "", **attributes: str) -> str:
    given = "".join(f' {key}="{value}"' for key, value in attributes.items())
    return f"<ssd:ParameterBinding{given}>{inner}</ssd:ParameterBinding>"


def inline(content: str, mapping: str = "") -> str:
    return binding(f"<ssd:ParameterValues>{content}</ssd:ParameterValues>{mapping}")


def wire(start: str, end: str, inner: str = "", **attributes: str) -> str:
    (of, output), (to, input_) = start.split("."), end.split(".")
    ends = {"startElement": of, "startConnector": output, "endElement": to, "endConnector": input_}
    given = " ".join(f'{key}="{value}"' for key, value in {**ends, **attributes}.items())
    return f"<ssd:Connection {given}>{inner}</ssd:Connection>"


def description(
    bindings: str, *, elements: str = "", connections: str = "", connectors: str = "", more: str = ""
) -> str:
    return (
        f'<ssd:SystemStructureDescription {SPACES} version="2.0" name="s"><ssd:System name="r">'
        f"<ssd:Connectors>{connectors}</ssd:Connectors>"
        f"<ssd:ParameterBindings>{bindings}</ssd:ParameterBindings><ssd:Elements>"
        f"{elements or GAIN}</ssd:Elements>"
        f"<ssd:Connections>{connections}</ssd:Connections></ssd:System>"
        f'{more}<ssd:DefaultExperiment stopTime="1"/></ssd:SystemStructureDescription>'
    )


def pack(folder: Path, text: str, members: dict[str, str | bytes] | None = None) -> Path:
    """Write an archive of all FMUs of a folder."""
    path = folder / "s.ssp"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("SystemStructure.ssd", text)
        for fmu in folder.glob("*.fmu"):
            archive.write(fmu, f"resources/{fmu.name}")
        for name, content in (members or {}).items():
            archive.writestr(name, content)
    return path


def plan_of(path: Path) -> Plan:
    return make_plan(load_scenario(path, changes=changed(step_size=0.1)))


def fmi2(folder: Path, bindings: str, elements: str = "", **members: str) -> Instance:
    """Return the instance of an FMU with a parameter of each type in an archive with these bindings."""
    (only,) = plan_of(given_to_fmi2(folder, bindings, elements, **members)).instances
    return only


def given_to_fmi2(folder: Path, bindings: str, elements: str = "", **members: str) -> Path:
    make_fmu(folder / "g.fmu", outputs=["y"], parameters=FMI2.values())
    return pack(folder, description(bindings, elements=elements), dict(members))


def problem(path: Path) -> YawbenchError:
    with pytest.raises(YawbenchError) as caught:
        plan_of(path)
    assert len(texts_of(caught.value)) == 1
    assert caught.value.exit_status == 2
    return caught.value


def one(value: object, name: str = "g.k", more: str = "") -> str:
    """Return a set with one real value."""
    return parameters(parameter(name, f'<ssv:Real value="{value}"{more}/>'))


INTEGERS = ("Integer", *(f"{sign}Int{bits}" for bits in (8, 16, 32, 64) for sign in ("", "U")))


@pytest.mark.parametrize(
    ("name", "inner", "value"),
    [
        *(("k", f'<ssv:{kind} value=" 2.5 "/>', 2.5) for kind in ("Real", "Float64", "Float32")),
        *(("n", f'<ssv:{kind} value="7"/>', 7) for kind in INTEGERS),
        ("text", '<ssv:String value="summer"/>', "summer"),
        ("text", '<ssv:String><ssv:Value value="summer"/></ssv:String>', "summer"),
        ("text", '<ssv:String value=""/>', ""),
        ("text", '<ssv:String><ssv:Value value=""/></ssv:String>', ""),
        ("text", '<ssv:String value="a&#10;&lt;b&gt; &#252;"/>', "a\n<b> ü"),
        ("text", '<ssv:String value=" 5 km/h "/>', " 5 km/h "),
        ("mode", '<ssv:Enumeration value="wet"/>', 2),
        ("mode", '<ssv:Enumeration><ssv:Value value="wet"/></ssv:Enumeration>', 2),
        ("mode", '<ssv:Integer value="2"/>', 2),
        ("on", '<ssv:Boolean value="true"/>', True),
        ("on", '<ssv:Boolean value="1"/>', True),
        ("k", '<ssv:Int32 value="3"/>', 3.0),
        ("k", '<ssv:Float64 value="2.5"/><ssc:Dimension size="1"/>', 2.5),
        ("k", '<ssv:Float64 value="36" unit="km/h"/>', 10.0),
        ("k", '<ssv:Float64 value="36" unit="[km/h]"/>', 10.0),
        ("k", '<ssv:Real value="1"/><ssc:Annotations><ssc:Annotation type="x"/></ssc:Annotations>', 1.0),
    ],
)
def test_every_form_of_a_value_is_read(name, inner, value, tmp_path):
    given = parameters(parameter(f"g.{name}", inner))
    assert fmi2(tmp_path, inline(given)).parameters == {name: value}


MEANINGLESS = [
    ("text", "<ssv:String/>", "no value"),
    ("text", '<ssv:String value="a"><ssv:Value value="b"/></ssv:String>', "both"),
    ("text", '<ssv:String><ssv:Value value="a"/><ssv:Value value="b"/></ssv:String>', "2"),
    ("text", "<ssv:String>summer</ssv:String>", "no value"),
    ("text", "<ssv:String><ssv:Value>summer</ssv:Value></ssv:String>", "Value"),
    ("mode", "<ssv:Enumeration/>", "no value"),
    ("mode", '<ssv:Enumeration value="snow"/>', "snow"),
    ("k", "<ssv:Real/>", "no value"),
    ("k", "", "no value"),
    ("k", '<ssv:Real value=""/>', "no value"),
    ("k", '<ssv:Real value="1"/><ssv:Integer value="2"/>', "more than one value"),
    ("k", '<ssv:Real value="1 2"/>', "2"),
    ("k", '<ssv:Real value="1 2"/><ssc:Dimension size="2"/>', "2"),
    ("k", '<ssv:Real value="1 2"/><ssc:Dimension size="3"/>', "3"),
    ("k", '<ssv:Real value="1"/><ssc:Dimension sizeConnector="n"/>', "dimensions"),
    ("k", '<ssv:Real value="1_000"/>', "1_000"),
    ("k", '<ssv:Real value="INF"/>', "finite"),
    ("k", '<ssv:Float16 value="1"/>', "Float16"),
    ("k", '<ssv:Binary value="00"/>', "Binary"),
    ("k", '<ssv:Boolean value="true"/>', "number"),
    ("k", '<ssv:String value="2.5"/>', "number"),
    ("k", '<ssv:Real value="1" unit="furlong"/>', "furlong"),
    ("k", '<ssv:Real value="1" unit="kg"/>', "kg"),
    ("n", '<ssv:Int8 value="128"/>', "128"),
    ("n", '<ssv:UInt16 value="-1"/>', "-1"),
    ("n", '<ssv:Integer value="2147483648"/>', "2147483648"),
    ("n", '<ssv:Integer value="1.5"/>', "1.5"),
    ("n", '<ssv:Real value="1.5"/>', "1.5"),
    ("on", '<ssv:Boolean value="yes"/>', "yes"),
]


@pytest.mark.parametrize(
    ("given", "says"),
    [
        *((parameter(f"g.{name}", inner), (name, says)) for name, inner, says in MEANINGLESS),
        ('<ssv:Parameter><ssv:Real value="1"/></ssv:Parameter>', ("name",)),
        (2 * parameter("g.k", '<ssv:Real value="1"/>'), ("'g.k' is given twice",)),
    ],
)
def test_a_value_that_means_nothing_is_refused_by_name(given, says, tmp_path):
    error = str(problem(given_to_fmi2(tmp_path, inline(parameters(given)))))
    assert all(part in error for part in says)


@pytest.mark.parametrize("mark", ["", "\ufeff"])
def test_values_of_a_file_are_those_in_place(mark, tmp_path):
    content = f'{mark}<?xml version="1.0" encoding="UTF-8"?>{one(2.5, "k")}'
    read = fmi2(tmp_path, binding(source="values.ssv", prefix="g."), **{"./values.ssv": content})
    assert read.parameters == {"k": 2.5}


def test_later_sets_go_before_earlier_ones_and_those_of_the_system_before_those_of_components(tmp_path):
    assert fmi2(tmp_path, inline(one(1)) + inline(one(2))).parameters == {"k": 2.0}
    own = f"<ssd:ParameterBindings>{inline(one(1, 'k'))}</ssd:ParameterBindings></ssd:Component>"
    given = GAIN.replace("/>", ">") + own
    assert fmi2(tmp_path, inline(one(2)), given).parameters == {"k": 2.0}
    assert fmi2(tmp_path, "", given).parameters == {"k": 1.0}


@pytest.mark.parametrize(
    ("bindings", "says"),
    [
        (binding(), "nowhere"),
        (binding("<ssd:ParameterValues/>"), "nowhere"),
        (binding(f"<ssd:ParameterValues>{parameters('')}</ssd:ParameterValues>", source="v.ssv"), "both"),
        (binding(source="missing.ssv"), "missing.ssv"),
        (binding(source="../v.ssv"), "not in the archive"),
        (binding(source="v.ssv", type="application/x-cdf"), "application/x-cdf"),
        (binding(source="g.fmu", sourceBase="component"), "in a component"),
        (inline(parameters("", version="3.0")), "SSP '3.0'"),
        (inline(parameters(""), "<ssd:ParameterMapping/>"), "nowhere"),
    ],
)
def test_a_binding_that_cannot_be_read_is_refused(bindings, says, tmp_path):
    make_fmu(tmp_path / "g.fmu", outputs=["y"])
    assert says in str(problem(pack(tmp_path, description(bindings))))


# Tables of values in mappings


def mapped(*entries: str) -> str:
    content = f'<ssm:ParameterMapping {SPACES} version="2.0">{"".join(entries)}</ssm:ParameterMapping>'
    return f"<ssd:ParameterMapping>{content}</ssd:ParameterMapping>"


def entry(source: str, target: str, inner: str = "", more: str = "") -> str:
    return f'<ssm:MappingEntry source="{source}" target="{target}" {more}>{inner}</ssm:MappingEntry>'


def table(kind: str, **entries: str) -> str:
    rows = "".join(f'<ssc:MapEntry source="{k.lstrip("_")}" target="{v}"/>' for k, v in entries.items())
    return f"<ssc:{kind}MappingTransformation>{rows}</ssc:{kind}MappingTransformation>"


LINEAR = '<ssc:LinearTransformation factor="2" offset="1"/>'


@pytest.mark.parametrize(
    ("name", "inner", "transformation", "value"),
    [
        ("on", '<ssv:Boolean value="true"/>', table("Boolean", true="false", false="true"), False),
        ("n", '<ssv:Int16 value="3"/>', table("Integer", _3="30"), 30),
        ("n", '<ssv:Int16 value="4"/>', table("Integer", _3="30"), 4),
        ("mode", '<ssv:Enumeration value="snow"/>', table("Enumeration", snow="wet"), 2),
        ("k", '<ssv:Real value="2"/>', LINEAR, 5.0),
    ],
)
def test_a_mapping_replaces_values(name, inner, transformation, value, tmp_path):
    mapping = mapped(entry("given", f"g.{name}", transformation))
    assert fmi2(tmp_path, inline(parameters(parameter("given", inner)), mapping)).parameters == {name: value}


def test_units_are_converted_before_values_are_mapped_unless_the_mapping_forbids_it(tmp_path):
    given = one(72, "given", ' unit="km/h"')
    held = mapped(entry("car.given", "g.k", LINEAR)).removeprefix("<ssd:ParameterMapping>")
    in_a_file = binding('<ssd:ParameterMapping source="names.ssm"/>', source="values.ssv", prefix="car.")
    files = {"values.ssv": given, "names.ssm": held.removesuffix("</ssd:ParameterMapping>")}
    assert fmi2(tmp_path, in_a_file, **files).parameters == {"k": 41.0}
    as_is = mapped(entry("given", "g.k", LINEAR, 'suppressUnitConversion="true"'))
    assert fmi2(tmp_path, inline(given, as_is)).parameters == {"k": 145.0}


@pytest.mark.parametrize(
    ("entries", "says"),
    [
        ([entry("given", "g.k", table("Boolean", true="false"))], "Boolean"),
        ([entry("given", "g.k", table("Integer", _3="x"))], "Integer"),
        ([entry("given", "g.k", "<ssc:OtherTransformation/>")], "OtherTransformation"),
        ([entry("given", "g.k"), entry("other", "g.k")], "g.k"),
        ([entry("given", "g.k", 2 * LINEAR)], "more than one"),
        ([entry("given", "")], "target"),
        ([entry("", "g.k")], "source"),
    ],
)
def test_a_mapping_that_means_nothing_is_refused(entries, says, tmp_path):
    assert says in str(problem(given_to_fmi2(tmp_path, inline(one(2, "given"), mapped(*entries)))))


def test_a_mapping_of_a_parameter_that_no_set_has_is_said(tmp_path):
    plan = plan_of(given_to_fmi2(tmp_path, inline(one(2, "speed"), mapped(entry("sped", "g.k")))))
    assert any("sped" in d.message for d in plan.diagnostics if d.code == "variable-unknown")


# Variants


def test_of_several_descriptions_it_is_said_which_is_taken_and_how_to_take_another(tmp_path):
    other = description(inline(one(2)))
    path = given_to_fmi2(tmp_path, inline(one(1)), **{"fast.ssd": other, "resources/other.ssd": other})
    for scenario, value in ((path, 1.0), (path / "SystemStructure.ssd", 1.0), (path / "fast.ssd", 2.0)):
        plan = plan_of(scenario)
        assert plan.instances[0].parameters == {"k": value}
        (said,) = (d for d in plan.diagnostics if d.code == "ssp-variants")
        assert mentions(said.message, "SystemStructure.ssd", "fast.ssd") and "resources" not in said.message
    assert "fast.ssd" in str(problem(path / "slow.ssd"))


def test_an_archive_without_the_default_description_names_the_others(tmp_path):
    path = tmp_path / "s.ssp"
    for name, said in (("fast.ssd", f"{path}/fast.ssd"), ("readme.txt", "SystemStructure.ssd")):
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr(name, description(""))
        assert said in str(problem(path))


def test_a_description_in_a_folder_is_run_with_the_files_beside_it(tmp_path):
    values = {"resources/values.ssv": one(3)}
    packed = given_to_fmi2(tmp_path, binding(source="resources/values.ssv"), **values)
    folder = tmp_path / "unpacked"
    with zipfile.ZipFile(packed) as archive:
        archive.extractall(folder)
    (plan, same) = plan_of(folder / "SystemStructure.ssd"), plan_of(packed)
    assert plan.instances[0].parameters == same.instances[0].parameters == {"k": 3.0}
    assert plan.instances[0].fmu.sha256 == same.instances[0].fmu.sha256
    (folder / "resources" / "values.ssv").unlink()
    assert mentions(problem(folder / "SystemStructure.ssd"), "resources/values.ssv")
    assert mentions(problem(folder / "Other.ssd"), "no such file")
    (folder / "SystemStructure.ssd").write_text(description(binding(source="../values.ssv")))
    assert mentions(problem(folder / "SystemStructure.ssd"), "../values.ssv")


# Arrays

MATRIX = '<ssd:Component name="m" source="resources/Matrix.fmu"/>'


def matrix(folder: Path, bindings: str = "", elements: str = MATRIX, connections: str = "") -> Path:
    """Return an archive of an FMU that multiplies its input, of two elements, with a matrix A."""
    (folder / "none.so").write_bytes(b"")
    models3.make_fmu(folder, "Matrix", folder / "none.so")
    return pack(folder, description(bindings, elements=elements, connections=connections))


@pytest.mark.parametrize(
    ("name", "inner", "read"),
    [
        ("m.A", '<ssv:Float64 value="1 2 3 4"/><ssc:Dimension size="2"/><ssc:Dimension size="2"/>',
         {"A[1,1]": 1.0, "A[1,2]": 2.0, "A[2,1]": 3.0, "A[2,2]": 4.0}),
        ("m.A[1,2]", '<ssv:Float64 value="2"/>', {"A[1,2]": 2.0}),
    ],
)  # fmt: skip
def test_a_parameter_reaches_an_array_or_one_element(name, inner, read, tmp_path):
    (only,) = plan_of(matrix(tmp_path, inline(parameters(parameter(name, inner))))).instances
    assert only.parameters == read


@pytest.mark.parametrize("name", ["u", "force", "u[2]", "force[2]"])
def test_the_start_value_of_an_array_is_read_by_any_of_its_names(name, tmp_path):
    value = '"0 5"' if "[" not in name else '"5"'
    given = inline(parameters(parameter(f"m.{name}", f"<ssv:Float64 value={value}/>")))
    (only,) = plan_of(matrix(tmp_path, given)).instances
    assert only.constants == {"u[1]": 0.0, "u[2]": 5.0}


@pytest.mark.parametrize(
    ("name", "inner", "says"),
    [
        ("m.A", '<ssv:Float64 value="1 2 3"/>', "3"),
        ("m.A", '<ssv:Float64 value="1 2 3 4"/><ssc:Dimension size="4"/>', "2x2"),
        ("m.u", '<ssv:Float64 value="1"/>', "2"),
    ],
)
def test_values_for_another_number_of_elements_are_refused(name, inner, says, tmp_path):
    assert says in str(problem(matrix(tmp_path, inline(parameters(parameter(name, inner))))))


TWO = MATRIX + MATRIX.replace('name="m"', 'name="n"')


def wires(folder: Path, start: str, end: str, **indices: str) -> set[str]:
    plan = plan_of(matrix(folder, elements=TWO, connections=wire(start, end, **indices)))
    return {f"{one.output}->{one.input}" for one in plan.wires}


def test_a_connection_of_arrays_connects_their_elements(tmp_path):
    assert wires(tmp_path, "m.y", "n.u") == {"y[1]->u[1]", "y[2]->u[2]"}
    assert wires(tmp_path, "m.result", "n.force") == {"y[1]->u[1]", "y[2]->u[2]"}
    assert wires(tmp_path, "m.y", "n.u", startIndices="2", endIndices="1") == {"y[2]->u[1]"}
    assert wires(tmp_path, "m.y[2]", "n.u[1]") == {"y[2]->u[1]"}


@pytest.mark.parametrize("indices", ["0", "3", "1 1", "x"])
def test_an_index_that_an_array_lacks_is_refused(indices, tmp_path):
    with refused(YawbenchError, names=(f"'{indices}'", "counted from 1")):
        wires(tmp_path, "m.y", "n.u", startIndices=indices, endIndices="1")


def test_arrays_pass_the_connectors_of_systems(tmp_path):
    sized = '<ssc:Float64/><ssc:Dimension size="2"/>'
    inner = (
        f'<ssd:System name="in"><ssd:Connectors><ssd:Connector name="v" kind="input">{sized}</ssd:Connector>'
        f"</ssd:Connectors><ssd:Elements>{MATRIX}</ssd:Elements><ssd:Connections>"
        '<ssd:Connection startConnector="v" endElement="m" endConnector="u"/></ssd:Connections></ssd:System>'
    )
    given = inline(parameters(parameter("in.v", '<ssv:Float64 value="3 4"/>')))
    (only,) = plan_of(matrix(tmp_path, given, inner)).instances
    assert only.constants == {"u[1]": 3.0, "u[2]": 4.0}
    unsized = inner.replace('<ssc:Dimension size="2"/>', "<ssc:Dimension/>")
    assert "how many elements" in str(problem(matrix(tmp_path, given, unsized)))


# Export and import

ODD = {
    "a.String_in": "grö&ßer <b> \"q\" 'a'\ttab\nline  two ", "a.mode_in": "wet", "a.Boolean_in": True,
    "a.Float64_in": -0.0, "a.Float32_in": 0.1, "a.Int8_in": -128, "a.UInt8_in": 255, "a.Int16_in": -32768,
    "a.UInt16_in": 65535, "a.Int32_in": -(2**31), "a.UInt32_in": 2**32 - 1, "a.Int64_in": -(2**53),
    "a.UInt64_in": 2**53,
}  # fmt: skip


@pytest.mark.skipif(sys.platform != "linux", reason="compiles for Linux")
def test_an_archive_of_arrays_and_all_types_gives_the_same_bits(models, tmp_path, capsys):
    for model in ("Every", "Matrix"):
        models3.make_fmu(tmp_path, model, models)
    numbers = {"m.u[2]": 0.3, "n.u[1]": 7.0}
    data = {
        "stop_time": 0.5,
        "step_size": 0.1,
        "units": {
            "a": {"fmu": "./Every.fmu"},
            "m": {"fmu": "./Matrix.fmu", "parameters": {"A[1,2]": 1e-300, "A[2,1]": -0.0}},
            "n": {"fmu": "./Matrix.fmu"},
        },
        "inputs": ODD | numbers,
        "connections": [{"from": "a.Float32_out", "to": "m.u[1]"}, {"from": "m.y[1]", "to": "n.u[2]"}],
    }
    (tmp_path / "s.yaml").write_text(json.dumps(data), encoding="utf-8")
    for arguments in (
        ["run", str(tmp_path / "s.yaml"), "--out", str(tmp_path / "yaml")],
        ["export-ssp", str(tmp_path / "s.yaml"), "--out", str(tmp_path / "s.ssp")],
        ["run", str(tmp_path / "s.ssp"), "--out", str(tmp_path / "ssp")],
        ["export-ssp", str(tmp_path / "s.ssp"), "--out", str(tmp_path / "t.ssp")],
    ):
        assert status_of(*arguments) == 0, capsys.readouterr().err
    assert (tmp_path / "ssp/results.csv").read_bytes() == (tmp_path / "yaml/results.csv").read_bytes()
    assert (tmp_path / "t.ssp").read_bytes() == (tmp_path / "s.ssp").read_bytes()
    first, back = (make_plan(load_scenario(tmp_path / f"s.{kind}")) for kind in ("yaml", "ssp"))
    assert {u.name: u.constants for u in back.instances} == {u.name: u.constants for u in first.instances}
    with zipfile.ZipFile(tmp_path / "s.ssp") as archive:
        root = etree.fromstring(archive.read("SystemStructure.ssd"))
    assert root.get("version") == "2.0"
    (a,) = root.iterfind(f".//{{{SSD}}}Component[@name='m']//{{{SSV}}}Parameter[@name='A']")
    assert a.find(f"{{{SSV}}}Float64").get("value") == "1.0 1e-300 -0.0 1.0"
    assert [d.get("size") for d in a.iter(f"{{{SSC}}}Dimension")] == ["2", "2"]
    assert any(c.get("endIndices") == "1" for c in root.iter(f"{{{SSD}}}Connection"))


def test_ssp_1_0_has_no_arrays(tmp_path):
    plan = plan_of(matrix(tmp_path))
    with refused(YawbenchError, "ssp-unsupported", names=("2.0",)):
        write_ssp(plan, tmp_path / "t.ssp", "1.0")
    assert not (tmp_path / "t.ssp").exists()
