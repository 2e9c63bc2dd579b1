"""The order in which units are evaluated, from what their outputs follow at the same instant.

Two graphs tell two things apart. The graph of *variables* joins every wire with every declared
direct dependency; a cycle there is a real algebraic loop: values that define each other at one
instant, for which no order of calls is right. The graph of *units* has an edge for each wire into
an input that some output follows directly ("direct wire"); it says who has to be stepped first for
the other to see values of the same instant. It may have cycles where the variables have none: a
plant gives the tyre its slip angles and reports accelerations that follow the tyre's forces. Since
every unit is stepped by one call, such a cycle is cut: the units in it are put in the order that
leaves the fewest direct wires pointing backwards, counting first those whose followers feed another
unit (a value that is only recorded matters less). Over a wire that points backwards, the master
uses values of earlier communication points, held or extrapolated. Everything else keeps the order
in which the scenario lists the units.

An FMU that does not say what an output follows must be taken, by FMI 2.0.4, section 2.2.8, to
follow every input. A loop that exists only through such outputs is possible, not certain: it is
noted, not refused.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache

from ..plan import Fmu, Wire
from ..wording import star

Node = tuple[str, str]  # unit, variable
Edge = tuple[str, str]  # source unit, target unit

EXACT_UP_TO = 12
"""Units in one cycle for which the best order is searched; beyond, a good one."""


@dataclass(frozen=True)
class Evaluation:
    """The order of the units, and why."""

    order: tuple[str, ...]
    direct: tuple[Wire, ...]
    """Wires whose target has an output that follows them at the same instant."""
    backward: tuple[Wire, ...]
    """Direct wires against the order: their target uses values of earlier communication points."""
    loops: tuple[str, ...]
    """Real algebraic loops, each as 'a.x -> b.y -> ...'."""
    possible_loops: tuple[str, ...]
    """Loops through outputs of which the FMU does not say what they follow."""


def evaluate(fmus: Mapping[str, Fmu], wires: Sequence[Wire]) -> Evaluation:
    """Find the evaluation order of the units `fmus`, given in the order of the scenario."""
    sure = _loops(_variable_graph(fmus, wires, assume=False))
    possible = [loop for loop in _loops(_variable_graph(fmus, wires, assume=True)) if loop not in sure]
    direct = [wire for wire in wires if _followers(fmus[wire.target], wire.input)]
    order = _unit_order(list(fmus), _weights(fmus, wires, direct))
    position = {name: i for i, name in enumerate(order)}
    backward = [wire for wire in direct if position[wire.source] >= position[wire.target]]
    return Evaluation(
        tuple(order), tuple(direct), tuple(backward), tuple(sure), () if sure else tuple(possible)
    )


def _followers(fmu: Fmu, input_name: str) -> list[str]:
    """Return the outputs that may follow an input at the same instant."""
    return [v.name for v in fmu.variables.values() if v.causality == "output" and v.follows(input_name)]


def _variable_graph(
    fmus: Mapping[str, Fmu], wires: Iterable[Wire], *, assume: bool
) -> dict[Node, list[Node]]:
    """Return who follows each variable; `assume`: also where the FMU does not say."""
    graph: dict[Node, list[Node]] = {}
    for wire in wires:
        target = (wire.target, wire.input)
        graph.setdefault((wire.source, wire.output), []).append(target)
        graph[target] = [
            (wire.target, v.name)
            for v in fmus[wire.target].variables.values()
            if v.causality == "output" and v.follows(wire.input) and (assume or v.depends_on is not None)
        ]
    return graph


def _loops(graph: Mapping[Node, list[Node]]) -> list[str]:
    """Return loops that share no variable, the shortest first, alike ones of the four wheels once."""
    texts: dict[str, str] = {}
    remaining = _without_ends(graph)
    while remaining:
        ways = (_way_back(remaining, node) for node in remaining)
        loop = min((way for way in ways if way), key=len)
        text = " -> ".join(f"{unit}.{name}" for unit, name in loop)
        texts.setdefault(star(text), text)
        remaining = _without_ends({k: v for k, v in remaining.items() if k not in loop})
    return list(texts.values())


def _without_ends(graph: Mapping[Node, list[Node]]) -> dict[Node, list[Node]]:
    """Return the graph without all nodes that lead nowhere: empty if there is no cycle."""
    left = dict(graph)
    shrunk = True
    while shrunk:
        kept = {node: [n for n in followers if n in left] for node, followers in left.items()}
        kept = {node: followers for node, followers in kept.items() if followers}
        shrunk = len(kept) < len(left)
        left = kept
    return left


def _way_back(graph: Mapping[Node, list[Node]], start: Node) -> list[Node] | None:
    """Return the shortest path from a node to itself, both ends included."""
    came_from: dict[Node, Node] = {}
    queue = deque([start])
    while queue:
        node = queue.popleft()
        for follower in graph[node]:
            if follower == start:
                path = [start, node]
                while path[-1] != start:
                    path.append(came_from[path[-1]])
                return path[::-1]
            if follower not in came_from:
                came_from[follower] = node
                queue.append(follower)
    return None


def _weights(fmus: Mapping[str, Fmu], wires: Iterable[Wire], direct: Iterable[Wire]) -> dict[Edge, int]:
    """Return what it costs to have source after target: wires whose followers feed a unit, then wires."""
    used = {(wire.source, wire.output) for wire in wires}
    weights: dict[Edge, int] = {}
    for wire in direct:
        passed_on = any((wire.target, name) in used for name in _followers(fmus[wire.target], wire.input))
        edge = (wire.source, wire.target)
        weights[edge] = weights.get(edge, 0) + (10_000 if passed_on else 0) + 1
    return weights


def _unit_order(names: Sequence[str], weights: Mapping[Edge, int]) -> list[str]:
    """Return the units so that sources stand before targets, else as the scenario lists them."""
    edges = set(weights)
    for group in _cycles(names, edges):
        inner = _cheapest_order(group, weights)
        rank = {name: i for i, name in enumerate(inner)}
        edges = {(a, b) for a, b in edges if a not in rank or b not in rank or rank[a] < rank[b]}
    order: list[str] = []
    while len(order) < len(names):
        ready = (
            name for name in names if name not in order and all(a in order for a, b in edges if b == name)
        )
        order.append(next(ready))
    return order


def _cycles(names: Sequence[str], edges: Iterable[Edge]) -> list[list[str]]:
    """Return the groups of units that reach each other."""
    edges = list(edges)
    reach = {name: {b for a, b in edges if a == name} for name in names}
    for middle in names:
        for name in names:
            if middle in reach[name]:
                reach[name] |= reach[middle]
    groups: list[list[str]] = []
    for name in names:
        if name in reach[name] and not any(name in group for group in groups):
            groups.append([other for other in names if other in reach[name] and name in reach[other]])
    return groups


def _cheapest_order(group: Sequence[str], weights: Mapping[Edge, int]) -> list[str]:
    """Return the order of a cycle's units that costs least; of equals, the scenario's."""

    def backward(name: str, placed: frozenset[str]) -> int:
        return sum(weights.get((other, name), 0) for other in group if other not in placed)

    @cache
    def cost_of_rest(placed: frozenset[str]) -> int:
        rest = [name for name in group if name not in placed]
        return min((backward(n, placed) + cost_of_rest(placed | {n}) for n in rest), default=0)

    order: list[str] = []
    while len(order) < len(group):
        placed = frozenset(order)
        rest = [name for name in group if name not in placed]
        if len(group) <= EXACT_UP_TO:
            cost = {name: backward(name, placed) + cost_of_rest(placed | {name}) for name in rest}
        else:
            cost = {name: backward(name, placed) for name in rest}
        order.append(min(rest, key=cost.__getitem__))
    return order
