"""Values in SSP archives: every form that SSP 1.0 and 2.0 have is read, or refused with a sentence."""

from __future__ import annotations

import json
import math
import sys
import zipfile
from pathlib import Path

import pytest
from lxml import etree

from tests.changed import changed
from tests.command_line import status_of
from tests.conftest import compiled
from tests.fmus import models3
from tests.fmus.fake_fmus import Var, make_fmu
from tests.refusals import mentions, texts_of
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


def parameters(inner: str, *, version: str = "2.0") -> str:
    return (
        f'<ssv:ParameterSet {SPACES} version="{version}" name="p"><ssv:Parameters>{inner}</ssv:Parameters>'
        "</ssv:ParameterSet>"
    )


def parameter(name: str, inner: str) -> str:
    return f'<ssv:Parameter name="{name}">{inner}</ssv:Parameter>'


def binding(inner: str = "", **attributes: str) -> str:
    given = "".join(f' {key}="{value}"' for key, value in attributes.items())
    return f"<ssd:ParameterBinding{given}>{inner}</ssd:ParameterBinding>"


def inline(content: str, mapping: str = "") -> str:
    return binding(f"<ssd:ParameterValues>{content}</ssd:ParameterValues>{mapping}")


def description(
    bindings: str, *, elements: str = "", connections: str = "", connectors: str = "", version: str = "2.0"
) -> str:
    return (
        f'<ssd:SystemStructureDescription {SPACES} version="{version}" name="s"><ssd:System name="r">'
        f"<ssd:Connectors>{connectors}</ssd:Connectors>"
        f"<ssd:ParameterBindings>{bindings}</ssd:ParameterBindings><ssd:Elements>"
        f"{elements or GAIN}</ssd:Elements>"
        f"<ssd:Connections>{connections}</ssd:Connections></ssd:System>"
        '<ssd:DefaultExperiment stopTime="1"/></ssd:SystemStructureDescription>'
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


def fmi2(folder: Path, bindings: str, **members: str) -> Instance:
    """Return the instance of an FMU with a parameter of each type in an archive with these bindings."""
    make_fmu(folder / "g.fmu", outputs=["y"], parameters=FMI2.values())
    (only,) = plan_of(pack(folder, description(bindings), dict(members))).instances
    return only


def problem(path: Path) -> YawbenchError:
    with pytest.raises(YawbenchError) as caught:
        plan_of(path)
    assert len(texts_of(caught.value)) == 1
    return caught.value


INTEGERS = ("Integer", *(f"{sign}Int{bits}" for bits in (8, 16, 32, 64) for sign in ("", "U")))


@pytest.mark.parametrize("kind", ["Real", "Float64", "Float32"])
def test_every_type_of_real_numbers_is_read(kind, tmp_path):
    given = parameter("g.k", f'<ssv:{kind} value=" 2.5 "/>')
    assert fmi2(tmp_path, inline(parameters(given))).parameters == {"k": 2.5}


@pytest.mark.parametrize("kind", INTEGERS)
def test_every_type_of_integers_is_read(kind, tmp_path):
    assert fmi2(tmp_path, inline(parameters(parameter("g.n", f'<ssv:{kind} value="7"/>')))).parameters == {
        "n": 7
    }


@pytest.mark.parametrize(
    ("name", "inner", "value"),
    [
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
        ("k", '<ssv:Real value="1"/><ssc:Annotations><ssc:Annotation type="x"/></ssc:Annotations>', 1.0),
    ],
)
@pytest.mark.parametrize("version", ["1.0", "2.0"])
def test_every_form_of_a_value_is_read(name, inner, value, version, tmp_path):
    given = parameters(parameter(f"g.{name}", inner), version=version)
    assert fmi2(tmp_path, inline(given)).parameters == {name: value}


def test_the_sign_of_zero_is_kept(tmp_path):
    given = parameters(parameter("g.k", '<ssv:Real value="-0.0"/>'))
    assert math.copysign(1.0, fmi2(tmp_path, inline(given)).parameters["k"]) == -1.0


@pytest.mark.parametrize(
    ("name", "inner", "says"),
    [
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
    ],
)
def test_a_value_that_means_nothing_is_refused_by_name(name, inner, says, tmp_path):
    make_fmu(tmp_path / "g.fmu", outputs=["y"], parameters=FMI2.values())
    error = problem(pack(tmp_path, description(inline(parameters(parameter(f"g.{name}", inner))))))
    assert error.exit_status == 2
    assert name in str(error)
    assert says in str(error)


def test_a_parameter_without_a_name_is_refused(tmp_path):
    make_fmu(tmp_path / "g.fmu", outputs=["y"], parameters=FMI2.values())
    nameless = parameters('<ssv:Parameter><ssv:Real value="1"/></ssv:Parameter>')
    assert "name" in str(problem(pack(tmp_path, description(inline(nameless)))))


def test_a_parameter_that_a_set_gives_twice_is_refused(tmp_path):
    make_fmu(tmp_path / "g.fmu", outputs=["y"], parameters=FMI2.values())
    twice = "".join(parameter("g.k", f'<ssv:Real value="{i}"/>') for i in (1, 2))
    assert "'g.k' is given twice" in str(problem(pack(tmp_path, description(inline(parameters(twice))))))


@pytest.mark.parametrize("mark", ["", "\ufeff"])
def test_values_of_a_file_are_those_in_place(mark, tmp_path):
    content = (
        mark
        + '<?xml version="1.0" encoding="UTF-8"?>'
        + parameters(parameter("k", '<ssv:Float64 value="2.5"/>'))
    )
    assert fmi2(
        tmp_path, binding(source="values.ssv", prefix="g."), **{"./values.ssv": content}
    ).parameters == {"k": 2.5}


def test_later_sets_go_before_earlier_ones(tmp_path):
    sets = [inline(parameters(parameter("g.k", f'<ssv:Real value="{i}"/>'))) for i in (1, 2)]
    assert fmi2(tmp_path, "".join(sets)).parameters == {"k": 2.0}


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
    content = "".join(entries)
    return (
        f'<ssd:ParameterMapping><ssm:ParameterMapping version="2.0">{content}</ssm:ParameterMapping>'
        "</ssd:ParameterMapping>"
    )


def entry(source: str, target: str, inner: str = "") -> str:
    return f'<ssm:MappingEntry source="{source}" target="{target}">{inner}</ssm:MappingEntry>'


def table(kind: str, **entries: str) -> str:
    rows = "".join(f'<ssc:MapEntry source="{k.lstrip("_")}" target="{v}"/>' for k, v in entries.items())
    return f"<ssc:{kind}MappingTransformation>{rows}</ssc:{kind}MappingTransformation>"


@pytest.mark.parametrize(
    ("name", "inner", "transformation", "value"),
    [
        ("on", '<ssv:Boolean value="true"/>', table("Boolean", true="false", false="true"), False),
        ("n", '<ssv:Int16 value="3"/>', table("Integer", _3="30"), 30),
        ("n", '<ssv:Int16 value="4"/>', table("Integer", _3="30"), 4),
        ("mode", '<ssv:Enumeration value="snow"/>', table("Enumeration", snow="wet"), 2),
        ("k", '<ssv:Real value="2"/>', '<ssc:LinearTransformation factor="2" offset="1"/>', 5.0),
    ],
)
def test_a_mapping_replaces_values(name, inner, transformation, value, tmp_path):
    mapping = mapped(entry("given", f"g.{name}", transformation))
    assert fmi2(tmp_path, inline(parameters(parameter("given", inner)), mapping)).parameters == {name: value}


@pytest.mark.parametrize(
    ("entries", "says"),
    [
        ([entry("given", "g.k", table("Boolean", true="false"))], "Boolean"),
        ([entry("given", "g.k", table("Integer", _3="x"))], "Integer"),
        ([entry("given", "g.k", "<ssc:OtherTransformation/>")], "OtherTransformation"),
        ([entry("given", "g.k"), entry("other", "g.k")], "g.k"),
        ([entry("given", "g.k", 2 * '<ssc:LinearTransformation factor="2"/>')], "more than one"),
        ([entry("given", "")], "target"),
        ([entry("", "g.k")], "source"),
    ],
)
def test_a_mapping_that_means_nothing_is_refused(entries, says, tmp_path):
    make_fmu(tmp_path / "g.fmu", outputs=["y"], parameters=FMI2.values())
    values = parameters(parameter("given", '<ssv:Real value="2"/>'))
    assert says in str(problem(pack(tmp_path, description(inline(values, mapped(*entries))))))


def test_a_mapping_of_a_parameter_that_no_set_has_is_said(tmp_path):
    make_fmu(tmp_path / "g.fmu", outputs=["y"], parameters=FMI2.values())
    values = parameters(parameter("speed", '<ssv:Real value="2"/>'))
    plan = plan_of(pack(tmp_path, description(inline(values, mapped(entry("sped", "g.k"))))))
    assert any("sped" in d.message for d in plan.diagnostics if d.code == "variable-unknown")


# Variants


def test_of_several_descriptions_it_is_said_which_is_taken_and_how_to_take_another(tmp_path):
    make_fmu(tmp_path / "g.fmu", outputs=["y"], parameters=FMI2.values())
    texts = [description(inline(parameters(parameter("g.k", f'<ssv:Real value="{i}"/>')))) for i in (1, 2)]
    path = pack(tmp_path, texts[0], {"fast.ssd": texts[1], "resources/other.ssd": texts[1]})
    for scenario, value in ((path, 1.0), (path / "SystemStructure.ssd", 1.0), (path / "fast.ssd", 2.0)):
        plan = plan_of(scenario)
        assert plan.instances[0].parameters == {"k": value}
        (said,) = (d for d in plan.diagnostics if d.code == "ssp-variants")
        assert "SystemStructure.ssd" in said.message
        assert "fast.ssd" in said.message
        assert "resources" not in said.message
    assert "fast.ssd" in str(problem(path / "slow.ssd"))


def test_an_archive_without_the_default_description_names_the_others(tmp_path):
    path = tmp_path / "s.ssp"
    for name, said in (("fast.ssd", f"{path}/fast.ssd"), ("readme.txt", "SystemStructure.ssd")):
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr(name, description(""))
        assert said in str(problem(path))


def test_a_description_in_a_folder_is_run_with_the_files_beside_it(tmp_path):
    make_fmu(tmp_path / "g.fmu", outputs=["y"], parameters=FMI2.values())
    packed = pack(
        tmp_path,
        description(binding(source="resources/values.ssv")),
        {"resources/values.ssv": parameters(parameter("g.k", '<ssv:Real value="3"/>'))},
    )
    folder = tmp_path / "unpacked"
    with zipfile.ZipFile(packed) as archive:
        archive.extractall(folder)
    (plan, same) = plan_of(folder / "SystemStructure.ssd"), plan_of(packed)
    assert plan.instances[0].parameters == same.instances[0].parameters == {"k": 3.0}
    assert plan.instances[0].fmu.sha256 == same.instances[0].fmu.sha256
    (folder / "resources" / "values.ssv").unlink()
    assert mentions(str(problem(folder / "SystemStructure.ssd")), "resources/values.ssv")
    assert mentions(str(problem(folder / "Other.ssd")), "no such file")
    outside = description(binding(source="../values.ssv"))
    (folder / "SystemStructure.ssd").write_text(outside, encoding="utf-8")
    assert mentions(str(problem(folder / "SystemStructure.ssd")), "../values.ssv")


# Arrays

MATRIX = '<ssd:Component name="m" source="resources/Matrix.fmu"/>'


def matrix(folder: Path, bindings: str = "", **options: str) -> Path:
    """Return an archive of an FMU that multiplies its input, of two elements, with a matrix A."""
    (folder / "none.so").write_bytes(b"")
    models3.make_fmu(folder, "Matrix", folder / "none.so")
    return pack(folder, description(bindings, elements=MATRIX, **options))


@pytest.mark.parametrize("name", ["m.A", "m.A[1,2]"])
def test_a_parameter_reaches_an_array_or_one_element(name, tmp_path):
    inner = (
        '<ssv:Float64 value="1 2 3 4"/><ssc:Dimension size="2"/><ssc:Dimension size="2"/>'
        if name == "m.A"
        else '<ssv:Float64 value="2"/>'
    )
    (only,) = plan_of(matrix(tmp_path, inline(parameters(parameter(name, inner))))).instances
    all_of_it = {"A[1,1]": 1.0, "A[1,2]": 2.0, "A[2,1]": 3.0, "A[2,2]": 4.0}
    assert only.parameters == (all_of_it if name == "m.A" else {"A[1,2]": 2.0})


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


def ends(start: str, end: str, **more: str) -> str:
    names = dict(zip(("startElement", "startConnector"), start.split("."), strict=True))
    names |= dict(zip(("endElement", "endConnector"), end.split("."), strict=True))
    given = " ".join(f'{name}="{value}"' for name, value in {**names, **more}.items())
    return f"<ssd:Connection {given}/>"


TWO = MATRIX + MATRIX.replace('name="m"', 'name="n"')


def wires(folder: Path, connections: str) -> set[str]:
    models3.make_fmu(folder, "Matrix", Path(__file__))
    plan = plan_of(pack(folder, description("", elements=TWO, connections=connections)))
    return {f"{wire.output}->{wire.input}" for wire in plan.wires}


def test_a_connection_of_arrays_connects_their_elements(tmp_path):
    assert wires(tmp_path, ends("m.y", "n.u")) == {"y[1]->u[1]", "y[2]->u[2]"}
    assert wires(tmp_path, ends("m.result", "n.force")) == {"y[1]->u[1]", "y[2]->u[2]"}
    assert wires(tmp_path, ends("m.y", "n.u", startIndices="2", endIndices="1")) == {"y[2]->u[1]"}
    assert wires(tmp_path, ends("m.y[2]", "n.u[1]")) == {"y[2]->u[1]"}


@pytest.mark.parametrize("indices", ["0", "3", "1 1", "x"])
def test_an_index_that_an_array_lacks_is_refused(indices, tmp_path):
    models3.make_fmu(tmp_path, "Matrix", Path(__file__))
    connection = ends("m.y", "n.u", startIndices=indices, endIndices="1")
    error = problem(pack(tmp_path, description("", elements=TWO, connections=connection)))
    assert f"'{indices}'" in str(error)
    assert "counted from 1" in str(error)


def test_arrays_pass_the_connectors_of_systems(tmp_path):
    models3.make_fmu(tmp_path, "Matrix", Path(__file__))
    sized = '<ssc:Float64/><ssc:Dimension size="2"/>'
    inner = (
        f'<ssd:System name="in"><ssd:Connectors><ssd:Connector name="v" kind="input">{sized}</ssd:Connector>'
        f"</ssd:Connectors><ssd:Elements>{MATRIX}</ssd:Elements><ssd:Connections>"
        '<ssd:Connection startConnector="v" endElement="m" endConnector="u"/></ssd:Connections></ssd:System>'
    )
    given = inline(parameters(parameter("in.v", '<ssv:Float64 value="3 4"/>')))
    (only,) = plan_of(pack(tmp_path, description(given, elements=inner))).instances
    assert only.constants == {"u[1]": 3.0, "u[2]": 4.0}
    unsized = inner.replace('<ssc:Dimension size="2"/>', "<ssc:Dimension/>")
    assert "how many elements" in str(problem(pack(tmp_path, description(given, elements=unsized))))


# Export and import

ODD = {
    "a.String_in": "grö&ßer <b> \"q\" 'a'\ttab\nline  two ", "a.mode_in": "wet", "a.Boolean_in": True,
    "a.Float64_in": -0.0, "a.Float32_in": 0.1, "a.Int8_in": -128, "a.UInt8_in": 255, "a.Int16_in": -32768,
    "a.UInt16_in": 65535, "a.Int32_in": -(2**31), "a.UInt32_in": 2**32 - 1, "a.Int64_in": -(2**53),
    "a.UInt64_in": 2**53,
}  # fmt: skip


@pytest.mark.skipif(sys.platform != "linux", reason="compiles for Linux")
def test_an_archive_of_arrays_and_all_types_gives_the_same_bits(tmp_path, capsys):
    (tmp_path / "stubs.h").write_text(models3.stubs(), encoding="utf-8")
    library = compiled(models3.HERE / "models3.c", tmp_path / "models3.so", f"-I{tmp_path}")
    for model in ("Every", "Matrix"):
        models3.make_fmu(tmp_path, model, library)
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
    with pytest.raises(YawbenchError) as caught:
        write_ssp(plan, tmp_path / "t.ssp", "1.0")
    assert caught.value.code == "ssp-unsupported"
    assert "2.0" in str(caught.value)
    assert not (tmp_path / "t.ssp").exists()
