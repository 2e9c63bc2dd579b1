"""Conversions by the connections of an SSP archive: units of connectors, transformations, systems."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from tests.fmus.fake_fmus import Var, make_fmu, out
from tests.interop.test_ssp_values import (
    description,
    inline,
    pack,
    parameter,
    parameters,
    plan_of,
    problem,
    wire,
)
from tests.refusals import each_mentions, mentions, refused
from yawbench.foundation.errors import YawbenchError
from yawbench.interop.ssp_write import for_omsimulator, system_structure, write_ssp
from yawbench.orchestrator.plan import Plan, Wire
from yawbench.orchestrator.scenario.loader import load_scenario
from yawbench.orchestrator.scenario.ssp_archive import SSB, SSC, SSD, SSV
from yawbench.orchestrator.wiring.make_plan import make_plan

pytestmark = pytest.mark.usefixtures("common_cache")

UNITS = """<ssd:Units>
  <ssc:Unit name="deg"><ssc:BaseUnit rad="1" factor="0.0174532925199433"/></ssc:Unit>
  <ssc:Unit name="turn"><ssc:BaseUnit rad="1" factor="6.283185307179586"/></ssc:Unit>
  <ssc:Unit name="rad"><ssc:BaseUnit rad="1"/></ssc:Unit>
  <ssc:Unit name="m"><ssc:BaseUnit m="1"/></ssc:Unit>
</ssd:Units>"""


def connector(name: str, kind: str, unit: str | None = None, of: str = "Real") -> str:
    measure = f' unit="{unit}"' if unit else ""
    return f'<ssd:Connector name="{name}" kind="{kind}"><ssc:{of}{measure}/></ssd:Connector>'


def component(name: str, *connectors: str, more: str = "") -> str:
    return (
        f'<ssd:Component name="{name}" source="resources/{name}.fmu">'
        f"<ssd:Connectors>{''.join(connectors)}</ssd:Connectors>{more}</ssd:Component>"
    )


def archive(
    folder: Path, elements: str, connections: str, *, bindings: str = "", dictionaries: str = "", **more: str
) -> Path:
    """Write an archive of the FMUs a, which gives y, and b, which takes x."""
    text = description(bindings, elements=elements, connections=connections, more=UNITS, **more)
    return pack(folder, text.replace("</ssd:System><ssd:Units>", f"{dictionaries}</ssd:System><ssd:Units>"))


def fmus(folder: Path, of: str | None, to: str | None, kind: str = "Real") -> None:
    change = {} if kind == "Real" else {"type": kind, "variability": "discrete"}
    make_fmu(folder / "a.fmu", outputs=[out("y", unit=of, **change)], parameters=[Var("p", to)])
    start = "false" if kind == "Boolean" else 0
    make_fmu(folder / "b.fmu", inputs=[Var("x", to, start=start, **change)], outputs=["z"])


def scale(path: Path) -> tuple[float, float]:
    """Return gain and offset of the only wire."""
    (only,) = plan_of(path).wires
    assert (only.source, only.output, only.target, only.input) == ("a", "y", "b", "x")
    return pytest.approx(only.gain, rel=1e-12), pytest.approx(only.offset, rel=1e-12)  # type: ignore[return-value]


@pytest.mark.parametrize(
    ("of", "to", "start", "end", "gain"),
    [
        (None, None, "deg", "rad", math.pi / 180),  # only the archive says
        ("deg", "rad", None, None, math.pi / 180),  # only the FMUs say
        ("deg", "rad", "deg", "rad", math.pi / 180),
        ("deg", "rad", "rad", "deg", math.pi / 180),  # there and back
        ("rad", None, None, "deg", 180 / math.pi),
        (None, "rad", "turn", None, 2 * math.pi),  # known by its definition alone
        (None, None, "deg", None, 1.0),
        ("rad", "rad", None, None, 1.0),
    ],
)
def test_units_of_connectors_are_converted(of, to, start, end, gain, tmp_path):
    fmus(tmp_path, of, to)
    elements = component("a", connector("y", "output", start)) + component("b", connector("x", "input", end))
    assert scale(archive(tmp_path, elements, wire("a.y", "b.x"))) == (gain, 0.0)


def reference(name: str, *connectors: str) -> str:
    return (
        f'<ssd:SignalDictionaryReference name="{name}" dictionary="d">'
        f"<ssd:Connectors>{''.join(connectors)}</ssd:Connectors></ssd:SignalDictionaryReference>"
    )


def dictionary(unit: str | None = None, **attributes: str) -> str:
    more = "".join(f' {key}="{value}"' for key, value in attributes.items())
    measure = f' unit="{unit}"' if unit else ""
    inner = (
        f'<ssb:SignalDictionary xmlns:ssb="{SSB}" version="1.0"><ssb:DictionaryEntry name="angle">'
        f"<ssc:Real{measure}/></ssb:DictionaryEntry></ssb:SignalDictionary>"
    )
    return (
        f'<ssd:SignalDictionaries><ssd:SignalDictionary name="d"{more}>{"" if more else inner}'
        "</ssd:SignalDictionary></ssd:SignalDictionaries>"
    )


IN_SYSTEM = (
    '<ssd:System name="inner"><ssd:Elements>{elements}</ssd:Elements>'
    "<ssd:Connections>{connections}</ssd:Connections></ssd:System>"
)


@pytest.mark.parametrize(("unit", "gain"), [(None, 0.5), ("deg", 90 / math.pi), ("rad", 0.5)])
def test_a_signal_dictionary_passes_its_source_on_to_all_that_refer_to_it(unit, gain, tmp_path):
    fmus(tmp_path, "rad", None)
    inner = IN_SYSTEM.format(
        elements=component("b", connector("x", "input")) + reference("there", connector("angle", "inout")),
        connections=wire("b.x", "there.angle", '<ssc:LinearTransformation factor="0.5"/>'),
    )
    elements = (
        component("a", connector("y", "output")) + reference("here", connector("angle", "inout")) + inner
    )
    path = archive(tmp_path, elements, wire("a.y", "here.angle"), dictionaries=dictionary(unit))
    (only,) = plan_of(path).wires
    assert (only.source, only.output, only.target, only.input) == ("a", "y", "inner_b", "x")
    assert (only.gain, only.offset) == (pytest.approx(gain, rel=1e-12), 0.0)


@pytest.mark.parametrize(
    ("connections", "given", "names"),
    [
        (wire("a.y", "bus.speed"), dictionary(), ("'speed'", "signal dictionary d")),
        (wire("a.y", "bus.angle"), "", ("'d'", "'bus'")),
        (wire("a.y", "bus.angle"), dictionary(source="d.ssb"), ("d.ssb",)),
        (wire("a.y", "bus.angle"), dictionary(type="text/csv"), ("text/csv",)),
        (wire("a.y", "bus.angle") + wire("b.z", "bus.angle"), dictionary(), ("a.y", "b.z")),
    ],
)
def test_a_signal_dictionary_that_cannot_be_is_refused(connections, given, names, tmp_path):
    fmus(tmp_path, "rad", "rad")
    text = (
        component("a", connector("y", "output")) + component("b", connector("x", "input")) + reference("bus")
    )
    assert mentions(problem(archive(tmp_path, text, connections, dictionaries=given)), *names)


ENDS = component("a", connector("y", "output", "deg")) + component("b", connector("x", "input", "rad"))
LINEAR = '<ssc:LinearTransformation factor="10" offset="0.5"/>'


@pytest.mark.parametrize(
    ("inner", "attributes", "expected"),
    [
        ("<ssc:LinearTransformation/>", {}, (math.pi / 180, 0.0)),
        (LINEAR, {}, (math.pi / 18, 0.5)),  # converted first
        (LINEAR, {"suppressUnitConversion": "true"}, (10.0, 0.5)),
        ("", {"suppressUnitConversion": "1"}, (1.0, 0.0)),
    ],
)
def test_a_linear_transformation_comes_after_the_conversion_or_in_its_place(
    inner, attributes, expected, tmp_path
):
    fmus(tmp_path, "deg", "rad")
    assert scale(archive(tmp_path, ENDS, wire("a.y", "b.x", inner, **attributes))) == expected


def test_units_that_do_not_fit_are_refused_unless_that_is_suppressed(tmp_path):
    fmus(tmp_path, None, None)
    elements = component("a", connector("y", "output", "m")) + component("b", connector("x", "input", "rad"))
    assert mentions(problem(archive(tmp_path, elements, wire("a.y", "b.x"))), "SystemStructure.ssd:1", "b.x")
    assert scale(archive(tmp_path, elements, wire("a.y", "b.x", suppressUnitConversion="true"))) == (1.0, 0.0)


def test_an_empty_element_is_the_system_itself_and_its_connectors_convert_too(tmp_path):
    fmus(tmp_path, None, None)
    inner = (
        '<ssd:System name="in"><ssd:Connectors>' + connector("u", "input", "deg") + "</ssd:Connectors>"
        "<ssd:Elements>" + component("b", connector("x", "input", "rad")) + "</ssd:Elements>"
        "<ssd:Connections>" + wire(".u", "b.x", LINEAR) + "</ssd:Connections></ssd:System>"
    )
    elements = component("a", connector("y", "output", "turn")) + inner
    (only,) = plan_of(archive(tmp_path, elements, wire("a.y", "in.u"))).wires
    assert (only.gain, only.offset) == (pytest.approx(10 * 2 * math.pi), 0.5)


def test_a_value_at_a_systems_connector_is_converted_on_its_way_to_all_inputs_behind_it(tmp_path):
    make_fmu(tmp_path / "b.fmu", inputs=[Var("x", None), Var("w", None)], outputs=["z"])
    definition = '<ssc:Unit name="turn"><ssc:BaseUnit rad="1" factor="6.283185307179586"/></ssc:Unit>'
    given = parameters(parameter("u", '<ssv:Real value="0.25" unit="turn"/>'), more=definition)
    path = archive(
        tmp_path,
        component("b", connector("x", "input", "rad"), connector("w", "input", "deg")),
        wire(".u", "b.x", LINEAR) + wire(".u", "b.w"),
        connectors=connector("u", "input", "deg"),
        bindings=inline(given),
    )
    (b,) = plan_of(path).instances
    assert b.constants == {"x": pytest.approx(10 * math.pi / 2 + 0.5), "w": pytest.approx(90.0)}


@pytest.mark.parametrize(
    ("kind", "inner", "names"),
    [
        ("Integer", LINEAR, ("gain", "offset", "Integer")),
        ("Boolean", '<ssc:LinearTransformation factor="2"/>', ("gain", "Boolean")),
        ("Boolean", "<ssc:BooleanMappingTransformation/>", ("BooleanMappingTransformation",)),
        ("Integer", "<ssc:IntegerMappingTransformation/>", ("IntegerMappingTransformation",)),
        ("Real", '<ssc:LinearTransformation factor="much"/>', ("factor", "'much'")),
    ],
)
def test_what_cannot_be_done_to_a_type_is_refused_in_one_sentence(kind, inner, names, tmp_path):
    assert mentions(problem(of_type(tmp_path, kind, inner)), *names)


def test_integers_have_whole_gains_and_offsets(tmp_path):
    whole = '<ssc:LinearTransformation factor="2" offset="-1"/>'
    assert scale(of_type(tmp_path, "Integer", whole)) == (2.0, -1.0)


def of_type(folder: Path, kind: str, inner: str) -> Path:
    fmus(folder, None, None, kind)
    a, b = connector("y", "output", of=kind), connector("x", "input", of=kind)
    return archive(folder, component("a", a) + component("b", b), wire("a.y", "b.x", inner))


# What is written


def converting(folder: Path, connection: str = "{from: a.y, to: b.x}") -> Plan:
    fmus(folder, "deg", "rad")
    (folder / "s.yaml").write_text(
        "title: 3 m/s, Größe\nstop_time: 1\nstep_size: 0.1\nunits: {a: {fmu: ./a.fmu}, b: {fmu: ./b.fmu}}\n"
        f"connections: [{connection}]\n",
        encoding="utf-8",
    )
    return make_plan(load_scenario(folder / "s.yaml"))


@pytest.mark.parametrize(
    "connection",
    [
        "{from: a.y, to: b.x}",
        "{from: a.y, to: b.x, gain: 7, offset: -1}",
        "{from: a.y, to: b.x, gain: 1}",  # of another unit: it must not be converted
    ],
)
def test_a_converting_wire_is_written_in_full_and_read_back_the_same(connection, tmp_path):
    plan = converting(tmp_path, connection)
    write_ssp(plan, tmp_path / "s.ssp")
    back = make_plan(load_scenario(tmp_path / "s.ssp"))
    assert back.wires == plan.wires
    (transformation,) = system_structure(plan).iter(f"{{{SSC}}}LinearTransformation")
    assert transformation.getparent().get("suppressUnitConversion") == "true"
    assert float(transformation.get("factor")) == plan.wires[0].gain


def test_the_name_is_an_identifier_and_the_title_is_read_back(tmp_path):
    plan = converting(tmp_path)
    assert system_structure(plan).get("name") == "_3_m_s_Groe"
    write_ssp(plan, tmp_path / "s.ssp")
    assert load_scenario(tmp_path / "s.ssp").title == "3 m/s, Größe"


def test_for_omsimulator_units_convert_and_a_gain_of_its_own_is_refused(tmp_path):
    plan, notes = for_omsimulator(converting(tmp_path))
    assert plan.wires == (Wire("a", "y", "b", "x"),)
    assert notes == []
    units = [real.get("unit") for real in system_structure(plan).iter(f"{{{SSC}}}Real")]
    assert units[:2] == ["deg", "rad"]
    with refused(YawbenchError, "ssp-unsupported", names=("a.y", "b.x")):
        for_omsimulator(converting(tmp_path, "{from: a.y, to: b.x, gain: 7}"))


def test_for_omsimulator_steps_and_texts_are_left_out_with_a_word(tmp_path):
    make_fmu(
        tmp_path / "c.fmu",
        outputs=["z"],
        parameters=[Var("mode", type="String", start="calm"), Var("kind", type="String", start="old")],
    )
    (tmp_path / "s.yaml").write_text(
        "stop_time: 1\nstep_size: 0.1\n"
        "units: {c: {fmu: ./c.fmu, step_size: 0.2, parameters: {mode: wild, kind: old}}}\n"
    )
    plan, notes = for_omsimulator(make_plan(load_scenario(tmp_path / "s.yaml")))
    assert each_mentions(notes, ("OMSimulator", "step", "instances"), ("c.mode", "'wild'"))
    component = next(system_structure(plan).iter(f"{{{SSD}}}Component"))
    assert component.find(f"{{{SSD}}}Annotations") is None
    assert not list(component.iter(f"{{{SSV}}}String"))
