"""Generates C code from the intermediate form: variables, the four functions, and the include of `unit.h`."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

from . import ir
from .lower import TIES, WHOLE_ARE_PLAIN
from .specialise import Program

TYPES = {
    ir.REAL: "double", ir.INT: "double", ir.BOOL: "int", ir.EITHER: "double",
    ir.WORD: "uint64_t", ir.WIDE: "uint64_t",
}  # fmt: skip
_INFIX = {"add": "+", "sub": "-", "mul": "*", "div": "/"}
_COMPARED = {"lt": "<", "le": "<=", "gt": ">", "ge": ">=", "eq": "==", "ne": "!="}
_WORDS = {
    "add_word": "+",
    "mul_word": "*",
    "and_word": "&",
    "or_word": "|",
    "xor_word": "^",
    "right_word": ">>",
}
_INLINE = {"fabs", "copysign", "sqrt"}  # exact in every implementation
_SIGNATURES = {
    "configure": "const Variables *v, Configured *c",
    "start": "const Variables *v, const Configured *c, State *s, List *lists, double t",
    "advance": "const Variables *v, const Configured *c, State *s, List *lists, double t, double h",
    "output": "const Variables *v, const Configured *c, const State *s, const List *lists, double *y,"
    " double t",
}


def emit(program: Program, source: str, guid: str) -> str:
    """Return the text of a C file for a program, which includes `arithmetic.h` and `unit.h`."""
    lines = [f"/* Made from {source} by yawbench build. */", f"#define UNTRIED {quoted(ir.UNTRIED)}"]
    lines += ['#include "arithmetic.h"', ""]
    lines += _variables(program.variables, guid)
    for name, kind, types in (("Configured", "c", program.configured), ("State", "s", program.state)):
        members = [f"    {TYPES[type]} {kind}{i};" for i, type in enumerate(types)]
        lines += ["typedef struct {", *(members or ["    char nothing;"]), f"}} {name};", ""]
    widths = ", ".join(map(str, program.rings)) or "0"
    lines += [f"enum {{ N_LISTS = {len(program.rings)} }};", f"static const int WIDTHS[] = {{{widths}}};", ""]
    made: dict[ir.Outlined, str] = {}
    branches: dict[str, int] = {}
    functions: list[str] = []
    for name, function in program.functions.items():
        for outlined in _outlined(function.body):
            if outlined not in made:
                made[outlined] = f"{outlined.name}_{len(made)}"
                own = ir.Function(outlined.body, ())
                functions += _Function(program, own, made, branches).of_its_own(outlined)
        functions += _Function(program, function, made, branches).lines(name)
    return "\n".join([*lines, *_table(branches), *functions, '#include "unit.h"', ""])


def _table(branches: Iterable[str]) -> list[str]:
    """Return the lines of the table of branches that were compared with Python (see `arithmetic.h`)."""
    if not branches:
        return []
    places = [quoted(f" ({':'.join(x.split(':')[:2])})" if ":" in x else "") for x in branches]
    return [
        f"enum {{ N_BRANCHES = {len(places)} }};",
        f"static const char *const BRANCHES[] = {{{', '.join(places)}}};",
        "static struct {",
        "    char mark[sizeof MARK];",
        "    unsigned char closed, reached[N_BRANCHES];",
        "} branches = {MARK, 0, {0}};",
        "BRANCHES_OF_LIBRARY",
        "",
    ]


def constant(value: bool | int | float) -> str:
    """Return a number as a C constant of type double."""
    value = float(value)
    if math.isnan(value):
        return "NAN"
    if math.isinf(value):
        return "INFINITY" if value > 0 else "(-INFINITY)"
    text = f"{value:.1f}" if value.is_integer() and abs(value) < 1e6 else value.hex()
    return f"({text})" if text.startswith("-") else text


def quoted(text: str) -> str:
    """Return a text as a C string."""
    made = ""
    for byte in text.encode("utf-8", "backslashreplace"):
        char = chr(byte)
        made += (
            f"\\{char}" if char in '"\\' else char if 32 <= byte < 127 and char != "?" else f"\\{byte:03o}"
        )
    return f'"{made}"'


def _variables(variables: Sequence[Any], guid: str) -> list[str]:
    kinds = {"Real": "double", "Integer": "int", "Boolean": "int", "String": "int"}
    members = [f"    {kinds[v.type]} {v.name};" for v in variables]
    lines = ["typedef struct {", *(members or ["    char nothing;"]), "} Variables;", ""]
    lines += [
        f"static const char *const CHOICES_{v.name}[] = {{{', '.join(map(quoted, v.choices))}}};"
        for v in variables
        if v.type == "String"
    ]
    rows = []
    for v in variables:
        start = v.choices.index(v.start) if v.type == "String" else v.start or 0
        low = "-INFINITY" if v.minimum is None else constant(v.minimum)
        high = "INFINITY" if v.maximum is None else constant(v.maximum)
        choices = f"CHOICES_{v.name}, {len(v.choices)}" if v.type == "String" else "NULL, 0"
        place = f"offsetof(Variables, {v.name})"
        rows.append(
            f"    {{{quoted(v.name)}, {v.type.upper()}, {v.causality.upper()}, {place}, "
            f"{constant(start)}, {low}, {high}, {choices}}},"
        )
    counts = {c: sum(v.causality == c for v in variables) for c in ("input", "output")}
    reals = sum(v.type == "Real" for v in variables)
    return [
        *lines,
        f"enum {{ N_INPUTS = {counts['input']}, N_OUTPUTS = {counts['output']}, N_REALS = {reals}, "
        f"N_VARIABLES = {len(variables)} }};",
        "static const Declared DECLARED[] = {",
        *(rows or ["    {0}"]),
        "};",
        f"#define GUID {quoted(guid)}",
        "",
    ]


class _Function:
    """Generator of the text of a function."""

    def __init__(
        self, program: Program, function: ir.Function, names: dict[ir.Outlined, str], branches: dict[str, int]
    ) -> None:
        self.program, self.function, self.names, self.branches = program, function, names, branches
        self.tables: list[str] = []

    def lines(self, name: str) -> list[str]:
        body: list[str] = []
        self._statements(self.function.body, body, 1)
        stores = [(place, x) for place, x in self.function.stores]
        made = [
            f"    const {self._store_type(place, x)} n{i} = {self._stored(place, x)};"
            for i, (place, x) in enumerate(stores)
        ]
        made += [f"    {self._place(place)} = n{i};" for i, (place, _) in enumerate(stores)]
        head = f"static int {name}(Problem *problem, {_SIGNATURES[name]})"
        return self._whole(head, body, made, [x for _, x in stores], ())

    def of_its_own(self, function: ir.Outlined) -> list[str]:
        """Return the lines of an outlined function, which depends only on numbers."""
        body: list[str] = []
        self._statements(function.body, body, 1)
        parameters = "".join(f", {TYPES[x.type]} {x.name}" for x in function.parameters)
        types = dict.fromkeys(TYPES[type] for type in map(ir.type_of, function.results))
        out = "".join(f", {type} *{type}s" for type in types)
        made, counts = [], dict.fromkeys(types, 0)
        for x in function.results:
            type = TYPES[ir.type_of(x)]
            made.append(f"    {type}s[{counts[type]}] = {self._as(ir.type_of(x), x)};")
            counts[type] += 1
        always = "Problem *problem, const Variables *v, const Configured *c"
        head = f"static int {self.names[function]}({always}{parameters}{out})"
        return self._whole(head, body, made, function.results, function.parameters)

    def _whole(
        self,
        head: str,
        body: list[str],
        made: list[str],
        results: Sequence[ir.Operand],
        parameters: Sequence[ir.Var],
    ) -> list[str]:
        used = dict.fromkeys(x for x in self._used(self.function.body, results))
        assigned = list(dict.fromkeys(_targets(self.function.body)))
        own = {*assigned, *parameters}
        reads = [
            f"    const {TYPES[x.type]} {x.name} = {self.program.reads[x]};"
            for x in used
            if x not in own and self.program.reads[x] != x.name
        ]
        declared = [
            f"    {TYPES[type]} {', '.join(f'{x.name} = 0' for x in assigned if x.type == type)};"
            for type in dict.fromkeys(x.type for x in assigned)
        ]
        texts = [
            f"    char text_{s.count.name}[24];"
            for s in ir.every(self.function.body)
            if isinstance(s, ir.Digits)
        ]
        arrays = ir.arrays_of(self.function.body)
        texts += [f"    double {array.name}[{array.length}];" for array in arrays]
        return [head, "{", *reads, *declared, *texts, *self.tables, *body, *made, "    return 0;", "}", ""]

    def _place(self, place: str) -> str:
        return f"y[{place[1:]}]" if place.startswith("y") else place

    def _type_at(self, place: str) -> str:
        kind, number = place[0], int(place.rpartition(">")[2].lstrip("csy"))
        if kind == "y":
            return ir.REAL
        return (self.program.configured if kind == "c" else self.program.state)[number]

    def _store_type(self, place: str, value: ir.Operand) -> str:
        return TYPES[self._type_at(place)]

    def _stored(self, place: str, value: ir.Operand) -> str:
        return self._as(self._type_at(place), value)

    def _used(self, body: Sequence[ir.Statement], more: Sequence[ir.Operand]) -> Iterator[ir.Var]:
        for statement in ir.every(body):
            for x in _operands(statement):
                if isinstance(x, ir.Var):
                    yield x
        for x in more:
            if isinstance(x, ir.Var):
                yield x

    # ---- statements -------------------------------------------------------------------------

    def _statements(self, body: Sequence[ir.Statement], lines: list[str], depth: int) -> None:
        pad = "    " * depth
        for s in body:
            if isinstance(s, ir.Let):
                lines.append(f"{pad}{s.target.name} = {self._operation(s)};")
            elif isinstance(s, ir.If):
                goes_on = not ir.raises(s.then) and not ir.raises(s.orelse)
                lines.append(f"{pad}if ({'' if s.then or goes_on else '!'}{s.test.name}) {{")
                if goes_on:
                    lines += [self._reached(f"{s.where}:true", depth + 1)]
                self._statements(s.then if s.then or goes_on else s.orelse, lines, depth + 1)
                if goes_on or (s.then and s.orelse):
                    lines.append(f"{pad}}} else {{")
                    if goes_on:
                        lines += [self._reached(f"{s.where}:false", depth + 1)]
                    self._statements(s.orelse, lines, depth + 1)
                lines.append(f"{pad}}}")
            elif isinstance(s, ir.Loop):
                lines.append(f"{pad}for (;;) {{")
                self._statements(s.body, lines, depth + 1)
                lines.append(f"{pad}}}")
            elif isinstance(s, ir.Leave):
                lines += [f"{pad}if ({self._bool(s.test)}) {{", f"{pad}    break;", f"{pad}}}"]
            elif isinstance(s, ir.Load):
                lines.append(
                    f"{pad}{s.target.name} = {self._table(s, lines, pad)}[(int){self._real(s.index)}];"
                )
            elif isinstance(s, ir.Fetch):
                lines.append(f"{pad}{s.target.name} = {s.array.name}[(int){self._real(s.index)}];")
            elif isinstance(s, ir.Put):
                lines.append(f"{pad}{s.array.name}[(int){self._real(s.index)}] = {self._real(s.value)};")
            elif isinstance(s, ir.Raise):
                lines += self._raise(s, pad)
            elif isinstance(s, ir.Push):
                numbers = self._item(s.items)
                lines += [
                    f"{pad}if (!push(&lists[{s.ring}], {numbers})) {{",
                    f'{pad}    begin_problem(problem, "MemoryError", "");',
                    f"{pad}    return 1;",
                    f"{pad}}}",
                ]
            elif isinstance(s, ir.Replace):
                index = self._real(s.index)
                lines.append(f"{pad}replace(&lists[{s.ring}], {index}, {self._item(s.items)});")
            elif isinstance(s, ir.Drop):
                lines.append(f"{pad}drop(&lists[{s.ring}], {int(s.every)});")
            elif isinstance(s, ir.Invoke):
                lines += self._invoke(s, pad)
            elif isinstance(s, ir.Digits):
                lines.append(
                    f"{pad}{s.count.name} = write_integer(text_{s.count.name}, {self._real(s.value)});"
                )
            elif isinstance(s, ir.Digit):
                text = f"text_{s.digits.name}[(int){self._real(s.index)}]"
                lines.append(f"{pad}{s.target.name} = (unsigned char){text};")

    def _reached(self, branch: str, depth: int) -> str:
        """Return the line that notes a branch, or ends the call if it was never compared with Python."""
        return f"{'    ' * depth}REACHED({self.branches.setdefault(branch, len(self.branches))})"

    def _item(self, numbers: Sequence[ir.Operand]) -> str:
        """Return the width of a list's items, and an item."""
        numbers = numbers or (0,)  # of items that are always the same, only the number is kept
        return f"{len(numbers)}, (const double[]){{{', '.join(map(self._real, numbers))}}}"

    def _invoke(self, s: ir.Invoke, pad: str) -> list[str]:
        arguments = "".join(
            f", {self._as(p.type, x)}" for p, x in zip(s.function.parameters, s.operands, strict=True)
        )
        types = [TYPES[ir.type_of(x)] for x in s.function.results]
        used = dict.fromkeys(types)
        out = "".join(f", {type}s" for type in used)
        lines = [f"{pad}{{"]
        lines += [f"{pad}    {type} {type}s[{types.count(type)}];" for type in used]
        lines += [
            f"{pad}    if ({self.names[s.function]}(problem, v, c{arguments}{out})) {{",
            f"{pad}        return 1;",
        ]
        lines.append(f"{pad}    }}")
        counts = dict.fromkeys(used, 0)
        for target, type in zip(s.targets, types, strict=True):
            lines.append(f"{pad}    {target.name} = {type}s[{counts[type]}];")
            counts[type] += 1
        return [*lines, f"{pad}}}"]

    def _raise(self, s: ir.Raise, pad: str) -> list[str]:
        where = f" ({s.where})" if s.where else ""
        lines = [f"{pad}begin_problem(problem, {quoted(s.kind)}, {quoted(where)});"]
        for part in s.message:
            if isinstance(part, str):
                lines.append(f"{pad}say(problem, {quoted(part)});")
                continue
            value, form = part
            kind = ir.type_of(value)
            if kind == ir.BOOL and form == "r":
                lines.append(f'{pad}say(problem, {self._bool(value)} ? "True" : "False");')
            elif kind == ir.INT and form == "r":
                lines.append(f"{pad}say_integer(problem, {self._real(value)});")
            else:
                digits = 0 if form == "r" else int(form[1:-1] or 6)
                lines.append(f"{pad}say_real(problem, {self._real(value)}, {digits});")
        return [*lines, f"{pad}return 1;"]

    def _table(self, s: ir.Load, lines: list[str], pad: str) -> str:
        type = TYPES[s.target.type]
        items = ", ".join(self._as(s.target.type, x) for x in s.table)
        if any(isinstance(x, ir.Var) for x in s.table):
            return f"((const {type}[]){{{items}}})"
        name = f"TABLE_{len(self.tables)}"
        known = f"[] = {{{items}}};"
        for line in self.tables:
            if line.endswith(known) and f" {type} " in line:
                return line.split("[")[0].rpartition(" ")[2]
        self.tables.append(f"    static const {type} {name}{known}")
        return name

    # ---- expressions ------------------------------------------------------------------------

    def _real(self, x: ir.Operand) -> str:
        if not isinstance(x, ir.Var):
            return constant(x)
        return x.name if x.type in (ir.REAL, ir.INT, ir.EITHER) else f"(double){x.name}"

    def _bool(self, x: ir.Operand) -> str:
        if not isinstance(x, ir.Var):
            return str(int(bool(x)))
        return x.name if x.type == ir.BOOL else f"({x.name} != 0)"

    def _word(self, x: ir.Operand) -> str:
        if not isinstance(x, ir.Var):
            return f"{int(x) & (2**64 - 1)}ull"
        return x.name if x.type in (ir.WORD, ir.WIDE) else f"(uint64_t)(int64_t){x.name}"

    def _as(self, type: str, x: ir.Operand) -> str:
        by: dict[str, Callable[[ir.Operand], str]] = {
            ir.BOOL: self._bool,
            ir.WORD: self._word,
            ir.WIDE: self._word,
        }
        return by.get(type, self._real)(x)

    def _operation(self, s: ir.Let) -> str:
        op, args = s.op, s.operands
        if op == "copy":
            return self._as(s.target.type, args[0])
        if op == "not":
            return f"!{self._bool(args[0])}"
        if op == "both":
            return f"{self._bool(args[0])} && {self._bool(args[1])}"
        if op == "select":
            type = s.target.type
            return f"{self._bool(args[0])} ? {self._as(type, args[1])} : {self._as(type, args[2])}"
        if op in _WORDS:
            count = str(int(args[1])) if op == "right_word" else self._word(args[1])  # type: ignore[arg-type]
            return f"{self._word(args[0])} {_WORDS[op]} {count}"
        if op == "word":
            return self._word(args[0])
        if op in _COMPARED:
            words = [ir.type_of(x) for x in args].count(ir.WORD)
            show = self._word if words and ir.REAL not in map(ir.type_of, args) else self._real
            return f"{show(args[0])} {_COMPARED[op]} {show(args[1])}"
        if op == "ring_length":
            return f"(double)lists[{args[0]}].count"
        if op == "ring_item":
            ring, k, index = args
            item = f"item(&lists[{ring}], {self.program.rings[int(ring)]}, {self._real(index)})[{k}]"  # type: ignore
            return item if s.target.type != ir.BOOL else f"{item} != 0.0"
        reals = [self._real(x) for x in args]
        if op in _INFIX:
            return f"{reals[0]} {_INFIX[op]} {reals[1]}"
        if op == "neg":
            return f"-{reals[0]}"
        if op == "real":
            return reals[0]
        if op == "mul_int":
            return f"{reals[0]} * {reals[1]} + 0.0"
        if op == "compensated_sum":
            plain = ", ".join(str(int(WHOLE_ARE_PLAIN and ir.type_of(x) != ir.REAL)) for x in args)
            return f"{op}({len(reals)}, (const double[]){{{', '.join(reals)}}}, (const char[]){{{plain}}})"
        if op == "sorted_item":
            keys = ", ".join(reals[1:])
            return f"{op}({args[0]}, {int(TIES)}, {len(reals) - 1}, (const double[]){{{keys}}})"
        if op == "norm":
            return f"{op}({len(reals)}, (const double[]){{{', '.join(reals)}}})"
        name = f"__builtin_{op}" if op in _INLINE else op.removesuffix("_int")
        call = f"{name}({', '.join(reals)})"
        if op == "undefined":
            name = "undefined_2" if len(reals) == 3 else "undefined_1"
            return f"{name}({', '.join(reals)})"
        if op == "overflown":
            return f"isinf({reals[0]}) && " + " && ".join(f"isfinite({x})" for x in reals[1:])
        return f"{call} + 0.0" if s.target.type == ir.INT else call


def _outlined(body: Sequence[ir.Statement]) -> Iterator[ir.Outlined]:
    """Yield the functions called by statements, each after those that it calls itself."""
    for s in ir.every(body):
        if isinstance(s, ir.Invoke):
            yield from _outlined(s.function.body)
            yield s.function


def _targets(body: Sequence[ir.Statement]) -> Iterator[ir.Var]:
    for s in ir.every(body):
        if isinstance(s, (ir.Let, ir.Load, ir.Fetch, ir.Digit)):
            yield s.target
        elif isinstance(s, ir.Invoke):
            yield from s.targets
        elif isinstance(s, ir.Digits):
            yield s.count


def _operands(s: ir.Statement) -> Sequence[ir.Operand]:
    if isinstance(s, ir.Let):
        return s.operands
    if isinstance(s, ir.Load):
        return (*s.table, s.index)
    if isinstance(s, ir.Invoke):
        return s.operands
    if isinstance(s, ir.If):
        return (s.test,)
    if isinstance(s, ir.Leave):
        return (s.test,)
    if isinstance(s, ir.Fetch):
        return (s.index,)
    if isinstance(s, ir.Put):
        return (s.index, s.value)
    if isinstance(s, ir.Push):
        return s.items
    if isinstance(s, ir.Replace):
        return (s.index, *s.items)
    if isinstance(s, ir.Digits):
        return (s.value,)
    if isinstance(s, ir.Digit):
        return (s.index,)
    if isinstance(s, ir.Raise):
        return [part[0] for part in s.message if not isinstance(part, str)]
    return ()
