"""Evaluation order of the instances, and algebraic loops, from direct feedthrough.

Two graphs serve two purposes. The graph of *variables* joins every wire with every declared direct
dependency; a cycle in it is a real algebraic loop: values that define each other at one instant, for which
no order of calls is right. The graph of *instances* has an edge for each wire into an input with direct
feedthrough to some output ("direct wire"); it determines which instance has to be stepped first for another
to get values of the same instant. It may have cycles where the variables have none: a plant gives the tyre
its slip angles and reports accelerations that depend on the tyre's forces. Since every instance is stepped by
one call, such a cycle is cut: its instances are put in the order with the fewest backward direct wires,
counting first those whose dependent outputs feed another instance (a value that is only recorded matters
less). Over a backward wire, the master uses values of earlier communication points, held or extrapolated.
Apart from that, instances keep the order of the scenario.

If an FMU does not declare the dependencies of an output, by FMI 2.0.4, section 2.2.8, the output must be
assumed to depend on every input. A loop that exists only through such outputs is possible, not certain: it
is noted, not refused.

A wire with a declared delay is in neither graph: it passes on a value of another instant.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from graphlib import CycleError, TopologicalSorter
from itertools import chain

from yawbench.fmus.fmu import Fmu
from yawbench.foundation.messages import star

from ..plan import Wire

Node = tuple[str, str]  # instance, variable
Edge = tuple[str, str]  # source instance, target instance
Graph = dict[Node, dict[Node, None]]  # variable -> those that depend on it, in order

EXACT_UP_TO = 12
"""Instances in a cycle up to which the best order is searched; for larger cycles, a good one."""
LOOPS = 10
"""Maximum number of reported loops. Chosen: users check again after correcting some."""
EFFORT = 300_000
"""Edges examined for the shortest loop; beyond, any short loop. Chosen: a tenth of a second."""
LONGEST = 20
"""Maximum number of variables named in a loop. Chosen: four lines of a terminal."""
UNDECLARED = ""
"""Name of the node for all outputs of an instance without declared dependencies."""


@dataclass(frozen=True)
class EvaluationOrder:
    """The evaluation order of the instances, with direct wires and algebraic loops."""

    order: tuple[str, ...]
    direct: tuple[Wire, ...]
    """Wires whose target has an output with direct feedthrough from them."""
    backward: tuple[Wire, ...]
    """Direct wires against the order: their target uses values of earlier communication points."""
    loops: tuple[str, ...]
    """Real algebraic loops, each as 'a.x -> b.y -> ...'; at most `LOOPS`."""
    possible_loops: tuple[str, ...]
    """A loop through outputs without declared dependencies, if there is no real loop."""


class _Feedthrough:
    """Direct feedthrough of an FMU: which outputs depend on which inputs at the same instant."""

    def __init__(self, fmu: Fmu) -> None:
        self.declared: dict[str, list[str]] = {}  # input -> outputs
        self.undeclared: list[str] = []  # outputs that may depend on every input
        for output in fmu.of("output"):
            if output.depends_on is None:
                self.undeclared.append(output.name)
            for name in output.depends_on or ():
                self.declared.setdefault(name, []).append(output.name)

    def outputs(self, name: str) -> Iterator[str]:
        """Yield the outputs that may depend on an input."""
        return chain(self.undeclared, self.declared.get(name, ()))


def evaluate(fmus: Mapping[str, Fmu], wires: Sequence[Wire]) -> EvaluationOrder:
    """Find the evaluation order of the instances `fmus`, given in the order of the scenario."""
    following = {instance: _Feedthrough(fmu) for instance, fmu in fmus.items()}
    direct = [w for w in wires if not w.delayed and any(following[w.target].outputs(w.input))]
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


def _variable_graph(following: Mapping[str, _Feedthrough], wires: Iterable[Wire], *, assume: bool) -> Graph:
    """Return the graph of variables; `assume`: undeclared outputs depend on every input."""
    graph: Graph = {}
    for wire in wires:
        target = (wire.target, wire.input)
        graph.setdefault((wire.source, wire.output), {})[target] = None
        known = following[wire.target]
        graph[target] = {(wire.target, name): None for name in known.declared.get(wire.input, ())}
        if assume and known.undeclared:
            undeclared = (wire.target, UNDECLARED)
            graph[target][undeclared] = None
            graph.setdefault(undeclared, {(wire.target, name): None for name in known.undeclared})
    return graph


def _loops(graph: Graph, most: int) -> list[str]:
    """Return disjoint loops, the shortest first, with those of the four wheels reported once.

    The graph is consumed.
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
        names = [f"{instance}.{name}" for instance, name in loop if name != UNDECLARED]
        if len(names) > LONGEST:
            names[LONGEST - 2 : -1] = [f"{len(names) - LONGEST + 1} more"]
        text = " -> ".join(names)
        texts.setdefault(star(text), text)
        for node in loop:
            graph.pop(node, None)
    return list(texts.values())


def _shortest_loop(graph: Graph, effort: int) -> tuple[list[Node], int]:
    """Return the shortest loop found within the effort, and the remaining effort.

    The loop has its first node at both ends; it is empty if none was found.
    """
    best: list[Node] = []
    for start in (node for node in graph if node[1] != UNDECLARED):
        if effort <= 0:
            break
        loop, looked_at = _way_back(graph, start)
        effort -= looked_at
        if loop and (not best or len(loop) < len(best)):
            best = loop
    return best, effort


def _way_back(graph: Graph, start: Node) -> tuple[list[Node], int]:
    """Return the shortest path from a node to itself, both ends included, and the number of edges examined.

    The path is empty if there is none.
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
    following: Mapping[str, _Feedthrough], wires: Iterable[Wire], direct: Iterable[Wire]
) -> dict[Edge, int]:
    """Return the cost of evaluating source after target: first wires whose followers are used, then wires."""
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
    """Sort the instances with sources before targets, otherwise in the scenario's order."""
    rank = {name: i for group in cycles for i, name in enumerate(_cheapest_order(group, weights))}
    group = {name: i for i, cycle in enumerate(cycles) for name in cycle}
    edges = [
        (source, target)
        for source, target in weights
        if source not in group or group[source] != group.get(target) or rank[source] < rank[target]
    ]
    return in_order(names, edges)


def in_order(names: Iterable[str], edges: Iterable[Edge]) -> list[str]:
    """Sort names topologically by edges (before, after), otherwise keeping their order.

    Raises:
        CycleError: the edges form a cycle.
    """
    position = {name: i for i, name in enumerate(names)}
    sorter: TopologicalSorter[str] = TopologicalSorter({name: () for name in position})
    for first, second in edges:
        sorter.add(second, first)
    sorter.prepare()
    ready: list[str] = []
    order: list[str] = []
    while sorter.is_active():
        ready += sorter.get_ready()
        order.append(min(ready, key=position.__getitem__))
        ready.remove(order[-1])
        sorter.done(order[-1])
    return order


def _cycles(names: Sequence[str], edges: Iterable[Edge]) -> list[list[str]]:
    """Return the strongly connected groups of instances."""
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
    """Return all instances that can be reached from one, itself only through a cycle."""
    reached: set[str] = set()
    waiting = list(after[name])
    while waiting:
        other = waiting.pop()
        if other not in reached:
            reached.add(other)
            waiting += after[other]
    return reached


def _cheapest_order(group: Sequence[str], weights: Mapping[Edge, int]) -> list[str]:
    """Return the cheapest order of the instances in a cycle; of equals, the scenario's.

    For large cycles it is a greedy order: the next instance is always the cheapest.
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
