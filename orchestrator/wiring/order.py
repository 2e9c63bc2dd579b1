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
from heapq import heapify, heappop, heappush

from ..plan import Fmu, Wire
from ..wording import star

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
class Evaluation:
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

    def passes_on(self, name: str) -> bool:
        """Return whether any output may follow an input."""
        return bool(self.unsaid) or name in self.said


def evaluate(fmus: Mapping[str, Fmu], wires: Sequence[Wire]) -> Evaluation:
    """Find the evaluation order of the units `fmus`, given in the order of the scenario."""
    following = {unit: _Following(fmu) for unit, fmu in fmus.items()}
    direct = [wire for wire in wires if following[wire.target].passes_on(wire.input)]
    weights = _weights(following, wires, direct)
    cycles = _cycles(list(fmus), weights)
    group = {name: i for i, cycle in enumerate(cycles) for name in cycle}
    inside = [w for w in direct if w.source in group and group[w.source] == group.get(w.target)]
    sure = _loops(_variable_graph(following, inside, assume=False), LOOPS)
    possible = [] if sure else _loops(_variable_graph(following, inside, assume=True), 1)
    order = _unit_order(list(fmus), weights, cycles)
    position = {name: i for i, name in enumerate(order)}
    backward = [wire for wire in direct if position[wire.source] >= position[wire.target]]
    return Evaluation(tuple(order), tuple(direct), tuple(backward), tuple(sure), tuple(possible))


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
    before: dict[Node, list[Node]] = {}
    for node, followers in graph.items():
        for follower in followers:
            before.setdefault(follower, []).append(node)
    _remove([node for node in before if not graph.get(node)], graph, before)
    texts: dict[str, str] = {}
    effort = EFFORT
    while graph and len(texts) < most:
        loop, effort = _shortest_loop(graph, effort)
        names = [f"{unit}.{name}" for unit, name in loop]
        if len(names) > LONGEST:
            names[LONGEST - 2 : -1] = [f"{len(names) - LONGEST + 1} more"]
        text = " -> ".join(names)
        texts.setdefault(star(text), text)
        _remove(loop, graph, before)
    return list(texts.values())


def _remove(nodes: Iterable[Node], graph: Graph, before: Mapping[Node, Sequence[Node]]) -> None:
    """Take nodes out of a graph, then all that lead nowhere: none is left if there is no cycle."""
    waiting = list(nodes)
    while waiting:
        node = waiting.pop()
        graph.pop(node, None)
        for earlier in before.get(node, ()):
            followers = graph.get(earlier, {})
            if node in followers:
                del followers[node]
                if not followers:
                    waiting.append(earlier)


def _shortest_loop(graph: Graph, effort: int) -> tuple[list[Node], int]:
    """Return the shortest loop of a graph in which all nodes lead to one, and what is left of the effort.

    The loop has its first node at both ends.
    """
    best: list[Node] = []
    for start in (node for node in graph if node[1] != UNSAID):
        found, looked_at = _way_back(graph, start, shorter_than=len(best))
        best, effort = found or best, effort - looked_at
        if best and effort <= 0:
            break
    return best, max(effort, 0)


def _way_back(graph: Graph, start: Node, *, shorter_than: int) -> tuple[list[Node], int]:
    """Return the shortest path from a node to itself, both ends included, and how many edges it took.

    It is empty if there is none, or none shorter (0: any); outputs of which nothing is said count once.
    """
    came_from: dict[Node, Node] = {}
    length = {start: 1}
    queue = deque([start])
    looked_at = 0
    while queue:
        node = queue.popleft()
        if shorter_than and length[node] + 1 >= shorter_than:
            break
        looked_at += len(graph[node])
        for follower in graph[node]:
            if follower == start:
                path = [start, node]
                while path[-1] != start:
                    path.append(came_from[path[-1]])
                return [one for one in reversed(path) if one[1] != UNSAID], looked_at
            if follower in length or follower not in graph:
                continue
            came_from[follower] = node
            if follower[1] == UNSAID:  # no step of its own
                length[follower] = length[node]
                queue.appendleft(follower)
            else:
                length[follower] = length[node] + 1
                queue.append(follower)
    return [], looked_at


def _weights(
    following: Mapping[str, _Following], wires: Iterable[Wire], direct: Iterable[Wire]
) -> dict[Edge, int]:
    """Return what it costs to have source after target: wires whose followers feed a unit, then wires."""
    used = {(wire.source, wire.output) for wire in wires}
    passed_on: set[Node] = set()  # inputs that an output follows which feeds a unit
    of_all = set()  # units all of whose inputs do
    for unit, known in following.items():
        if any((unit, name) in used for name in known.unsaid):
            of_all.add(unit)
        passed_on.update(
            (unit, name) for name, outputs in known.said.items() if any((unit, o) in used for o in outputs)
        )
    weights: dict[Edge, int] = {}
    for wire in direct:
        counts = wire.target in of_all or (wire.target, wire.input) in passed_on
        edge = (wire.source, wire.target)
        weights[edge] = weights.get(edge, 0) + (10_000 if counts else 0) + 1
    return weights


def _unit_order(
    names: Sequence[str], weights: Mapping[Edge, int], cycles: Iterable[Sequence[str]]
) -> list[str]:
    """Return the units so that sources stand before targets, else as the scenario lists them."""
    edges = set(weights)
    for group in cycles:
        rank = {name: i for i, name in enumerate(_cheapest_order(group, weights))}
        edges = {(a, b) for a, b in edges if a not in rank or b not in rank or rank[a] < rank[b]}
    after, before = _neighbours(names, edges)
    place = {name: i for i, name in enumerate(names)}
    waits_for = {name: len(before[name]) for name in names}
    ready = [place[name] for name in names if not waits_for[name]]
    heapify(ready)
    order: list[str] = []
    while ready:
        name = names[heappop(ready)]
        order.append(name)
        for target in after[name]:
            waits_for[target] -= 1
            if not waits_for[target]:
                heappush(ready, place[target])
    return order


def _neighbours(
    names: Iterable[str], edges: Iterable[Edge]
) -> tuple[dict[str, list[str]], dict[str, list[str]]]:
    """Return the targets and the sources of every unit."""
    after: dict[str, list[str]] = {name: [] for name in names}
    before: dict[str, list[str]] = {name: [] for name in names}
    for source, target in edges:
        after[source].append(target)
        before[target].append(source)
    return after, before


def _cycles(names: Sequence[str], edges: Iterable[Edge]) -> list[list[str]]:
    """Return the groups of units that reach each other."""
    after, before = _neighbours(names, edges)
    groups: list[list[str]] = []
    grouped: set[str] = set()
    for name in names:
        if name in grouped:
            continue
        group = _reached(name, after) & _reached(name, before)
        if group:
            groups.append([other for other in names if other in group])
            grouped |= group
    return groups


def _reached(name: str, neighbours: Mapping[str, Sequence[str]]) -> set[str]:
    """Return all that can be reached from a unit; itself only if a cycle leads back."""
    found: set[str] = set()
    waiting = list(neighbours[name])
    while waiting:
        other = waiting.pop()
        if other not in found:
            found.add(other)
            waiting += neighbours[other]
    return found


def _cheapest_order(group: Sequence[str], weights: Mapping[Edge, int]) -> list[str]:
    """Return the order of a cycle's units that costs least; of equals, the scenario's."""
    members = set(group)
    inner = {edge: cost for edge, cost in weights.items() if members.issuperset(edge)}
    after, before = _neighbours(group, inner)

    def backward(name: str, placed: frozenset[str]) -> int:
        return sum(inner[other, name] for other in before[name] if other not in placed)

    @cache
    def cost_of_rest(placed: frozenset[str]) -> int:
        rest = [name for name in group if name not in placed]
        return min((backward(n, placed) + cost_of_rest(placed | {n}) for n in rest), default=0)

    order: list[str] = []
    cost = {name: backward(name, frozenset()) for name in group}
    while cost:
        if len(group) <= EXACT_UP_TO:
            placed = frozenset(order)
            total = {name: cost[name] + cost_of_rest(placed | {name}) for name in cost}
            chosen = min(total, key=total.__getitem__)
        else:
            chosen = min(cost, key=cost.__getitem__)
        order.append(chosen)
        del cost[chosen]
        for target in after[chosen]:
            if target in cost:
                cost[target] -= inner[chosen, target]
    return order
