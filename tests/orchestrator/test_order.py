"""The evaluation order, and real algebraic loops told from cycles of units."""

from __future__ import annotations

from itertools import permutations

import pytest

from tests.orchestrator.fakes import Behaviour, make_fmu
from tests.refusals import each_mentions
from yawbench.fmus.fmu import Fmu
from yawbench.orchestrator.plan import Wire
from yawbench.orchestrator.wiring.order import EvaluationOrder, evaluate


def fmu(inputs: str = "", **outputs: str | None) -> Fmu:
    """Return an FMU with these inputs and, per output, the inputs it follows; None: not said."""
    behaviour = Behaviour()
    behaviour.inputs = inputs.split()
    behaviour.outputs = {name: None if text is None else text.split() for name, text in outputs.items()}
    return make_fmu("x", behaviour)


def by_names(fmus: dict[str, Fmu]) -> list[Wire]:
    """Connect every input to the output of its name."""
    return [
        Wire(source, v.name, target, v.name)
        for target, f in fmus.items()
        for v in f.of("input")
        for source, g in fmus.items()
        if source != target and v.name in [o.name for o in g.of("output")]
    ]


def evaluated(**fmus: Fmu) -> EvaluationOrder:
    return evaluate(fmus, by_names(fmus))


def test_sources_come_before_those_that_follow_them() -> None:
    found = evaluated(c=fmu("b", y="b"), b=fmu("a", b="a"), a=fmu(a=""))
    assert found.order == ("a", "b", "c")
    assert not found.backward


def test_units_that_do_not_follow_each_other_keep_the_scenarios_order() -> None:
    units = {"a": fmu("z", a=""), "b": fmu("z", b=""), "c": fmu("a b", z="")}
    for names in permutations(units):
        fmus = {name: units[name] for name in names}
        assert evaluate(fmus, by_names(fmus)).order == names


def test_an_input_that_only_enters_an_integration_sets_no_order() -> None:
    found = evaluated(plant=fmu("torque", speed=""), control=fmu("speed", torque="speed"))
    assert found.order == ("plant", "control")
    assert [wire.input for wire in found.direct] == ["speed"]


def test_a_cycle_of_units_that_is_none_of_variables_is_no_loop() -> None:
    found = evaluated(
        tyre=fmu("slip load", force="slip load"), plant=fmu("force", slip="", load="", acceleration="force")
    )
    assert not found.loops
    assert not found.possible_loops
    assert found.order == ("plant", "tyre")
    assert found.backward == (Wire("tyre", "force", "plant", "force"),)


def test_a_cycle_is_cut_where_values_are_only_recorded() -> None:
    # One wire each way, but the acceleration goes on to nobody.
    units = {"tyre": fmu("slip", force="slip"), "plant": fmu("force", slip="", acceleration="force")}
    assert evaluated(**units).order == ("plant", "tyre")
    # The acceleration now feeds a controller, the force still comes from one wire: a tie, so as listed.
    found = evaluated(**units, controller=fmu("acceleration", moment="acceleration"))
    assert found.order == ("tyre", "plant", "controller")


def test_a_cycle_is_cut_over_as_few_wires_as_possible() -> None:
    found = evaluated(
        driver=fmu("x y psi", steer="x y psi"),
        plant=fmu("steer", x="", y="", psi="", slip="steer"),
        tyre=fmu("slip", force="slip"),
    )
    assert found.order == ("plant", "driver", "tyre")
    assert found.backward == (Wire("driver", "steer", "plant", "steer"),)


def test_the_order_within_a_cycle_is_the_best_of_all() -> None:
    ring = {
        f"u{i}": fmu(f"v{(i + 4) % 5} w{(i + 2) % 5}", **{f"v{i}": f"w{(i + 2) % 5}", f"w{i}": ""})
        for i in range(5)
    }
    wires = by_names(ring)
    found = evaluate(ring, wires)

    def backward(order: tuple[str, ...]) -> int:
        return sum(order.index(wire.source) > order.index(wire.target) for wire in found.direct)

    assert not found.loops
    assert backward(found.order) == min(map(backward, permutations(ring))) == len(found.backward) > 0


def test_a_real_loop_is_reported_with_its_shortest_path() -> None:
    found = evaluated(
        plant=fmu("force", acceleration_y="force", slip=""),
        loads=fmu("acceleration_y", vertical_load="acceleration_y"),
        tyre=fmu("vertical_load slip", force="vertical_load slip"),
    )
    path = ("plant.force", "plant.acceleration_y", "loads.acceleration_y", "loads.vertical_load")
    assert each_mentions(found.loops, ("tyre.force", *path, "tyre.vertical_load"))


def test_loops_alike_on_four_wheels_are_reported_once() -> None:
    wheels = ("fl", "fr", "rl", "rr")
    loads, forces = [f"load_{w}" for w in wheels], [f"force_{w}" for w in wheels]
    found = evaluated(
        plant=fmu(" ".join(forces), **dict(zip(loads, forces, strict=True))),
        tyre=fmu(" ".join(loads), **dict(zip(forces, loads, strict=True))),
    )
    assert each_mentions(found.loops, ("tyre.force_fl", "plant.force_fl", "plant.load_fl", "tyre.load_fl"))


def test_separate_loops_are_reported_each() -> None:
    found = evaluated(
        a=fmu("y1 y2 other", x1="y1", x2="y2"), b=fmu("x1 x2", y1="x1", y2="x2"), c=fmu(other="")
    )
    assert found.loops == (
        "b.y1 -> a.y1 -> a.x1 -> b.x1 -> b.y1",
        "b.y2 -> a.y2 -> a.x2 -> b.x2 -> b.y2",
    )


def test_a_loop_through_an_output_that_says_nothing_is_only_possible() -> None:
    found = evaluated(plant=fmu("force", slip=None), tyre=fmu("slip", force="slip"))
    assert found.loops == ()
    assert each_mentions(found.possible_loops, ("tyre.force", "plant.force", "plant.slip", "tyre.slip"))
    assert sorted(found.order) == ["plant", "tyre"]


@pytest.mark.parametrize("n", [1, 12, 40])
def test_a_ring_is_cut_once_and_ordering_it_again_changes_nothing(n: int) -> None:
    ring = {f"u{i}": fmu(f"v{(i - 1) % n}", **{f"v{i}": "", f"a{i}": f"v{(i - 1) % n}"}) for i in range(n)}
    wires = by_names(ring)
    first = evaluate(ring, wires)
    assert sorted(first.order) == sorted(ring)
    assert len(first.backward) == (n > 1)
    assert evaluate({name: ring[name] for name in first.order}, wires).order == first.order
