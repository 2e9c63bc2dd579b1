"""The system that a page draws: what it holds, and that every wire is drawn."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

from lxml import etree

from tests.refusals import each_mentions
from yawbench.fmus.fmu import Fmu
from yawbench.orchestrator.plan import Instance, Plan, Wire
from yawbench.reports.diagram import diagram, system_of, systems_of
from yawbench.vocabulary.wheels import WHEELS


def plan(controller: str = "controller_off", *, extra: bool = False) -> Plan:
    """Return a plan of three units, with a road or without."""
    names = {"driver": "driver_sine", "controller": controller, "plant": "plant_seven_dof"}
    if extra:
        names["road"] = "road_patches"
    wires = [
        Wire("driver", "steer_angle", "plant", "steer_angle"),
        Wire("plant", "yaw_rate", "controller", "yaw_rate"),
    ]
    wires += [Wire("controller", f"torque_request_{w}", "plant", f"wheel_torque_{w}") for w in WHEELS]
    if extra:
        wires.append(Wire("road", "friction", "controller", "friction"))
    fmus = {name: Fmu(fmu, Path(fmu), Path(fmu), "0" * 64, "", fmu, "", {}) for name, fmu in names.items()}
    units = tuple(Instance(name, fmus[name], 1, {}, {}) for name in reversed(names))  # evaluation order
    scenario = {"units": dict.fromkeys(names)}
    return Plan(
        units, tuple(wires), (), Fraction(1, 1000), 1000, "extrapolated", title="made up", scenario=scenario
    )


def test_blocks_stand_in_the_order_of_the_scenario_not_of_evaluation():
    assert [block.name for block in system_of([plan()]).blocks] == ["driver", "controller", "plant"]


def test_runs_that_differ_in_an_fmu_are_one_system_with_a_choice():
    ((found, numbers),) = systems_of([plan(), plan("controller_fnn"), plan()])
    assert numbers == [0, 1, 2]
    assert found.blocks[1].fmus == ("controller_off", "controller_fnn")


def test_runs_with_other_units_are_another_system():
    assert [numbers for _, numbers in systems_of([plan(), plan(extra=True), plan()])] == [[0, 2], [1]]


def test_the_wires_of_four_wheels_are_one_signal():
    signals = system_of([plan()]).signals
    assert each_mentions(signals["controller", "plant"], ("torque_request_*", "wheel_torque_*"))
    assert signals["driver", "plant"] == ("steer_angle",)


def test_every_unit_fmu_and_signal_is_in_the_drawing_and_an_arrow_for_every_pair_of_units():
    system = system_of([plan(extra=True)])
    drawing = etree.fromstring(str(diagram(system, "title")))
    said = " ".join(element.text for element in drawing.iter("text")).replace("  ", " ")
    for word in ("driver", "plant_seven_dof", "road_patches", "yaw_rate", "friction", "torque_request_*"):
        assert word in said
    assert len(list(drawing.iter("polygon"))) == len(system.signals)


def test_names_cannot_break_out_of_the_drawing():
    nasty = plan("<script>alert(1)</script>")
    assert "<script" not in diagram(system_of([nasty]), '"><script>')
