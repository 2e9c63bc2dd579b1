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

from collections import Counter, deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from graphlib import CycleError, TopologicalSorter
from itertools import chain

from ..messages import star
from ..plan import Fmu, Wire

Node = tuple[str, str]  # unit, variable
Edge = tuple[str, str]  # source unit, target unit
Graph = dict[Node, dict[Node, None]]  # variable -> those that follow it, in order

EXACT_UP_TO = 12
"""Units in one cycle for which the best order is searched; beyond, a good one."""
LOOPS = 10
"""Loops told of. Chosen: whoever mends one checks again."""
EFFORT = 300_000
"""Edges looked at for the shortest loop; beyond, a short one. Chosen: a tenth of a second."""
LONGEST = 20
"""Variables of a loop that are named. Chosen: a screen's line or four."""
UNSAID = ""
"""Stands, in a graph, for all outputs of a unit of which it is not said what they follow."""


@dataclass(frozen=True)
class EvaluationOrder:
    """The order of the units, and why."""

    order: tuple[str, ...]
    direct: tuple[Wire, ...]
    """Wires whose target has an output that follows them at the same instant."""
    backward: tuple[Wire, ...]
    """Direct wires against the order: their target uses values of earlier communication points."""
    loops: tuple[str, ...]
    """Real algebraic loops, each as 'a.x -> b.y -> ...'; the first ones."""
    possible_loops: tuple[str, ...]
    """A loop through outputs of which the FMU does not say what they follow, if there is no real one."""


class _Following:
    """What the outputs of an FMU follow at the same instant."""

    def __init__(self, fmu: Fmu) -> None:
        self.said: dict[str, list[str]] = {}  # input -> outputs
        self.unsaid: list[str] = []  # outputs that may follow every input
        for output in fmu.of("output"):
            if output.depends_on is None:
                self.unsaid.append(output.name)
            for name in output.depends_on or ():
                self.said.setdefault(name, []).append(output.name)

    def outputs(self, name: str) -> Iterator[str]:
        """Yield the outputs that may follow an input."""
        return chain(self.unsaid, self.said.get(name, ()))


def evaluate(fmus: Mapping[str, Fmu], wires: Sequence[Wire]) -> EvaluationOrder:
    """Find the evaluation order of the units `fmus`, given in the order of the scenario."""
    following = {unit: _Following(fmu) for unit, fmu in fmus.items()}
    direct = [wire for wire in wires if any(following[wire.target].outputs(wire.input))]
    weights = _weights(following, wires, direct)
    cycles = _cycles(list(fmus), weights)
    group = {name: i for i, cycle in enumerate(cycles) for name in cycle}
    inside = [w for w in direct if w.source in group and group[w.source] == group.get(w.target)]
    sure = _loops(_variable_graph(following, inside, assume=False), LOOPS)
    possible = [] if sure else _loops(_variable_graph(following, inside, assume=True), 1)
    order = _unit_order(list(fmus), weights, cycles)
    position = {name: i for i, name in enumerate(order)}
    backward = [wire for wire in direct if position[wire.source] >= position[wire.target]]
    return EvaluationOrder(tuple(order), tuple(direct), tuple(backward), tuple(sure), tuple(possible))


def _variable_graph(following: Mapping[str, _Following], wires: Iterable[Wire], *, assume: bool) -> Graph:
    """Return who follows each variable; `assume`: also where the FMU does not say."""
    graph: Graph = {}
    for wire in wires:
        target = (wire.target, wire.input)
        graph.setdefault((wire.source, wire.output), {})[target] = None
        known = following[wire.target]
        graph[target] = {(wire.target, name): None for name in known.said.get(wire.input, ())}
        if assume and known.unsaid:
            unsaid = (wire.target, UNSAID)
            graph[target][unsaid] = None
            graph.setdefault(unsaid, {(wire.target, name): None for name in known.unsaid})
    return graph


def _loops(graph: Graph, most: int) -> list[str]:
    """Return loops that share no variable, the shortest first, alike ones of the four wheels once.

    The graph is used up.
    """
    texts: dict[str, str] = {}
    effort = EFFORT
    while len(texts) < most:
        try:
            TopologicalSorter(graph).prepare()
            break
        except CycleError as error:
            loop = error.args[1][::-1]  # the sorter has it against the direction of the wires
        shortest, effort = _shortest_loop(graph, effort)
        loop = shortest or loop
        names = [f"{unit}.{name}" for unit, name in loop if name != UNSAID]
        if len(names) > LONGEST:
            names[LONGEST - 2 : -1] = [f"{len(names) - LONGEST + 1} more"]
        text = " -> ".join(names)
        texts.setdefault(star(text), text)
        for node in loop:
            graph.pop(node, None)
    return list(texts.values())


def _shortest_loop(graph: Graph, effort: int) -> tuple[list[Node], int]:
    """Return the shortest loop as far as the effort reaches, and what is left of that.

    The loop has its first node at both ends; it is empty if none was found.
    """
    best: list[Node] = []
    for start in (node for node in graph if node[1] != UNSAID):
        if effort <= 0:
            break
        found, looked_at = _way_back(graph, start)
        effort -= looked_at
        if found and (not best or len(found) < len(best)):
            best = found
    return best, effort


def _way_back(graph: Graph, start: Node) -> tuple[list[Node], int]:
    """Return the shortest path from a node to itself, both ends included, and how many edges it took.

    It is empty if there is none.
    """
    came_from: dict[Node, Node] = {}
    queue = deque([start])
    looked_at = 0
    while queue and start not in came_from:
        node = queue.popleft()
        looked_at += len(graph.get(node, ()))
        for follower in graph.get(node, ()):
            if follower not in came_from:
                came_from[follower] = node
                queue.append(follower)
    if start not in came_from:
        return [], looked_at
    path = [start, came_from[start]]
    while path[-1] != start:
        path.append(came_from[path[-1]])
    return path[::-1], looked_at


def _weights(
    following: Mapping[str, _Following], wires: Iterable[Wire], direct: Iterable[Wire]
) -> dict[Edge, int]:
    """Return what it costs to have source after target: wires whose followers feed a unit, then wires."""
    used = {(wire.source, wire.output) for wire in wires}
    weights: Counter[Edge] = Counter()
    for wire in direct:
        followers = following[wire.target].outputs(wire.input)
        counts = any((wire.target, output) in used for output in followers)
        weights[wire.source, wire.target] += (10_000 if counts else 0) + 1
    return weights


def _unit_order(
    names: Sequence[str], weights: Mapping[Edge, int], cycles: Iterable[Sequence[str]]
) -> list[str]:
    """Return the units so that sources stand before targets, else as the scenario lists them."""
    rank = {name: i for group in cycles for i, name in enumerate(_cheapest_order(group, weights))}
    group = {name: i for i, cycle in enumerate(cycles) for name in cycle}
    edges = [
        (source, target)
        for source, target in weights
        if source not in group or group[source] != group.get(target) or rank[source] < rank[target]
    ]
    return in_order(names, edges)


def in_order(names: Iterable[str], edges: Iterable[Edge]) -> list[str]:
    """Return names so that the first of every edge stands before the second, else in the order given.

    Raises:
        CycleError: the edges lead in a circle.
    """
    place = {name: i for i, name in enumerate(names)}
    sorter: TopologicalSorter[str] = TopologicalSorter({name: () for name in place})
    for first, second in edges:
        sorter.add(second, first)
    sorter.prepare()
    ready: list[str] = []
    order: list[str] = []
    while sorter.is_active():
        ready += sorter.get_ready()
        order.append(min(ready, key=place.__getitem__))
        ready.remove(order[-1])
        sorter.done(order[-1])
    return order


def _cycles(names: Sequence[str], edges: Iterable[Edge]) -> list[list[str]]:
    """Return the groups of units that reach each other."""
    after: dict[str, list[str]] = {name: [] for name in names}
    for source, target in edges:
        after[source].append(target)
    reached = {name: _reached(name, after) for name in names}
    groups = {
        tuple(other for other in names if other in reached[name] and name in reached[other]): None
        for name in names
    }
    return [list(group) for group in groups if group]


def _reached(name: str, after: Mapping[str, Sequence[str]]) -> set[str]:
    """Return all that can be reached from a unit; itself only if a cycle leads back."""
    found: set[str] = set()
    waiting = list(after[name])
    while waiting:
        other = waiting.pop()
        if other not in found:
            found.add(other)
            waiting += after[other]
    return found


def _cheapest_order(group: Sequence[str], weights: Mapping[Edge, int]) -> list[str]:
    """Return the order of a cycle's units that costs least; of equals, the scenario's.

    Of a large cycle it is a good order: each unit the one that costs least at its place.
    """
    sources: dict[str, dict[str, int]] = {name: {} for name in group}
    for (source, target), cost in weights.items():
        if source in sources and target in sources:
            sources[target][source] = cost

    def backward(name: str, placed: frozenset[str]) -> int:
        return sum(cost for source, cost in sources[name].items() if source not in placed)

    @cache
    def cost_of_rest(placed: frozenset[str]) -> int:
        rest = [name for name in group if name not in placed]
        return min((backward(n, placed) + cost_of_rest(placed | {n}) for n in rest), default=0)

    order: list[str] = []
    while len(order) < len(group):
        placed = frozenset(order)
        total = {name: backward(name, placed) for name in group if name not in placed}
        if len(group) <= EXACT_UP_TO:
            total = {name: cost + cost_of_rest(placed | {name}) for name, cost in total.items()}
        order.append(min(total, key=total.__getitem__))
    return order
