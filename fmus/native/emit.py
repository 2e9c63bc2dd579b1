"""Generates C code from the intermediate form: variables, the four functions, and include of `fmi_unit.h`."""

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
_OF_REALS = {
    "add": "{} + {}", "sub": "{} - {}", "mul": "{} * {}", "div": "{} / {}", "neg": "-{}", "real": "{}",
    "mul_int": "{} * {} + 0.0",
}  # fmt: skip
_OF_WORDS = {
    "add_word": "{} + {}", "mul_word": "{} * {}", "and_word": "{} & {}", "or_word": "{} | {}",
    "xor_word": "{} ^ {}", "word": "{}",
}  # fmt: skip
_COMPARED = {"lt": "<", "le": "<=", "gt": ">", "ge": ">=", "eq": "==", "ne": "!="}
_INLINE = {"fabs", "copysign", "sqrt"}  # exact in every implementation
_SIGNATURES = {
    "configure": "const Variables *v, Configured *c",
    "start": "const Variables *v, const Configured *c, State *s, List *lists, double t",
    "advance": "const Variables *v, const Configured *c, State *s, List *lists, double t, double h",
    "output": "const Variables *v, const Configured *c, const State *s, const List *lists, double *y,"
    " double t",
}


def emit(program: Program, source: str, guid: str) -> str:
    """Return the text of a C file for a program, which includes `arithmetic.h` and `fmi_unit.h`."""
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
    return "\n".join([*lines, *_table(branches), *functions, '#include "fmi_unit.h"', ""])


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
    kinds = {"Real": "double", "Integer": "int", "Boolean": "int", "Enumeration": "int"}
    members = [f"    {kinds[v.fmi_type]} {v.name};" for v in variables]
    lines = ["typedef struct {", *(members or ["    char nothing;"]), "} Variables;", ""]
    lines += [
        f"static const char *const CHOICES_{v.name}[] = {{{', '.join(map(quoted, v.choices))}}};"
        for v in variables
        if v.choices
    ]
    rows = []
    for v in variables:
        start = v.choices.index(v.start) if v.choices else v.start or 0
        low = "-INFINITY" if v.minimum is None else constant(v.minimum)
        high = "INFINITY" if v.maximum is None else constant(v.maximum)
        choices = f"CHOICES_{v.name}, {len(v.choices)}" if v.choices else "NULL, 0"
        place = f"offsetof(Variables, {v.name})"
        rows.append(
            f"    {{{quoted(v.name)}, {v.fmi_type.upper()}, {v.causality.upper()}, "
            f"{int(v.variability == 'tunable')}, {place}, "
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
        body = self._statements(self.function.body, "    ")
        stores = [(place, self._type_at(place), x) for place, x in self.function.stores]
        made = [
            f"    const {TYPES[type]} n{i} = {self._as(type, x)};" for i, (_, type, x) in enumerate(stores)
        ]
        made += [
            f"    {f'y[{place[1:]}]' if place[0] == 'y' else place} = n{i};"
            for i, (place, _, _) in enumerate(stores)
        ]
        head = f"static int {name}(Problem *problem, {_SIGNATURES[name]})"
        return self._whole(head, body, made, [x for _, _, x in stores], ())

    def of_its_own(self, function: ir.Outlined) -> list[str]:
        """Return the lines of an outlined function, which depends only on numbers."""
        body = self._statements(function.body, "    ")
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
        statements = list(ir.every(self.function.body))
        operands = [x for s in statements if type(s) in _OPERANDS for x in _OPERANDS[type(s)](s)]
        used = dict.fromkeys(x for x in (*operands, *results) if isinstance(x, ir.Var))
        assigned = dict.fromkeys(x for s in statements if type(s) in _TARGETS for x in _TARGETS[type(s)](s))
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
        texts = [f"    char text_{s.count.name}[24];" for s in statements if isinstance(s, ir.Digits)]
        texts += [f"    double {array.name}[{array.length}];" for array in ir.arrays_of(self.function.body)]
        return [head, "{", *reads, *declared, *texts, *self.tables, *body, *made, "    return 0;", "}", ""]

    def _type_at(self, place: str) -> str:
        kind, number = place[0], int(place.rpartition(">")[2].lstrip("csy"))
        if kind == "y":
            return ir.REAL
        return (self.program.configured if kind == "c" else self.program.state)[number]

    # ---- statements -------------------------------------------------------------------------

    def _statements(self, body: Sequence[ir.Statement], pad: str) -> list[str]:
        return [line for s in body for line in _STATEMENTS[type(s)](self, s, pad)]

    def _if(self, s: ir.If, pad: str) -> list[str]:
        inner = f"{pad}    "
        if ir.raises(s.then) or ir.raises(s.orelse):
            lines = [f"{pad}if ({'' if s.then else '!'}{s.test.name}) {{"]
            lines += self._statements(s.then or s.orelse, inner)
            if s.then and s.orelse:
                lines += [f"{pad}}} else {{", *self._statements(s.orelse, inner)]
            return [*lines, f"{pad}}}"]
        return [
            f"{pad}if ({s.test.name}) {{",
            self._reached(f"{s.where}:true", inner),
            *self._statements(s.then, inner),
            f"{pad}}} else {{",
            self._reached(f"{s.where}:false", inner),
            *self._statements(s.orelse, inner),
            f"{pad}}}",
        ]

    def _reached(self, branch: str, pad: str) -> str:
        """Return the line that notes a branch, or ends the call if it was never compared with Python."""
        return f"{pad}REACHED({self.branches.setdefault(branch, len(self.branches))})"

    def _item(self, numbers: Sequence[ir.Operand]) -> str:
        """Return the width of a list's items, and an item."""
        return self._array(numbers or (0,))  # of items that are always the same, only the number is kept

    def _push(self, s: ir.Push, pad: str) -> list[str]:
        return [
            f"{pad}if (!push(&lists[{s.ring}], {self._item(s.items)})) {{",
            f'{pad}    begin_problem(problem, "MemoryError", "");',
            f"{pad}    return 1;",
            f"{pad}}}",
        ]

    def _at(self, index: ir.Operand) -> str:
        return f"[(int){self._real(index)}]"

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
            f"{pad}    }}",
        ]
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

    def _table(self, s: ir.Load) -> str:
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
        if op in _OPERATIONS:
            return _OPERATIONS[op](self, s, *args)
        if op in _COMPARED:
            words = [ir.type_of(x) for x in args].count(ir.WORD)
            show = self._word if words and ir.REAL not in map(ir.type_of, args) else self._real
            return f"{show(args[0])} {_COMPARED[op]} {show(args[1])}"
        if op in _OF_WORDS:
            return _OF_WORDS[op].format(*map(self._word, args))
        reals = list(map(self._real, args))
        if op in _OF_REALS:
            return _OF_REALS[op].format(*reals)
        name = f"__builtin_{op}" if op in _INLINE else op.removesuffix("_int")
        return f"{name}({', '.join(reals)})" + " + 0.0" * (s.target.type == ir.INT)

    def _array(self, numbers: Sequence[ir.Operand]) -> str:
        """Return the number of numbers, and an array of them."""
        return f"{len(numbers)}, (const double[]){{{', '.join(map(self._real, numbers))}}}"

    def _ring_item(self, s: ir.Let, ring: Any, k: Any, index: ir.Operand) -> str:
        item = f"item(&lists[{ring}], {self.program.rings[ring]}, {self._real(index)})[{k}]"
        return item if s.target.type != ir.BOOL else f"{item} != 0.0"

    def _compensated(self, s: ir.Let, *args: ir.Operand) -> str:
        plain = ", ".join(str(int(WHOLE_ARE_PLAIN and ir.type_of(x) != ir.REAL)) for x in args)
        return f"compensated_sum({self._array(args)}, (const char[]){{{plain}}})"

    def _undefined(self, s: ir.Let, *args: ir.Operand) -> str:
        return f"undefined_{len(args) - 1}({', '.join(map(self._real, args))})"


_OPERATIONS: dict[str, Callable[..., str]] = {
    "compensated_sum": _Function._compensated,
    "copy": lambda f, s, x: f._as(s.target.type, x),
    "norm": lambda f, s, *args: f"norm({f._array(args)})",
    "not": lambda f, s, x: f"!{f._bool(x)}",
    "overflown": lambda f, s, result, *args: (
        f"isinf({f._real(result)}) && " + " && ".join(f"isfinite({f._real(x)})" for x in args)
    ),
    "rshift_word": lambda f, s, x, count: f"{f._word(x)} >> {int(count)}",
    "ring_item": _Function._ring_item,
    "ring_length": lambda f, s, ring: f"(double)lists[{ring}].count",
    "select": lambda f, s, test, a, b: (
        f"{f._bool(test)} ? {f._as(s.target.type, a)} : {f._as(s.target.type, b)}"
    ),
    "sorted_item": lambda f, s, k, *keys: f"sorted_item({k}, {int(TIES)}, {f._array(keys)})",
    "undefined": _Function._undefined,
}
"""Operations of `Let` that are not functions of C, infix operators or comparisons."""
_STATEMENTS: dict[type, Callable[[_Function, Any, str], list[str]]] = {
    ir.Digit: lambda f, s, pad: [
        f"{pad}{s.target.name} = (unsigned char)text_{s.digits.name}{f._at(s.index)};"
    ],
    ir.Digits: lambda f, s, pad: [
        f"{pad}{s.count.name} = write_integer(text_{s.count.name}, {f._real(s.value)});"
    ],
    ir.Drop: lambda f, s, pad: [f"{pad}drop(&lists[{s.ring}], {int(s.every)});"],
    ir.Fetch: lambda f, s, pad: [f"{pad}{s.target.name} = {s.array.name}{f._at(s.index)};"],
    ir.If: _Function._if,
    ir.Invoke: _Function._invoke,
    ir.Leave: lambda f, s, pad: [f"{pad}if ({f._bool(s.test)}) {{", f"{pad}    break;", f"{pad}}}"],
    ir.Let: lambda f, s, pad: [f"{pad}{s.target.name} = {f._operation(s)};"],
    ir.Load: lambda f, s, pad: [f"{pad}{s.target.name} = {f._table(s)}{f._at(s.index)};"],
    ir.Loop: lambda f, s, pad: [f"{pad}for (;;) {{", *f._statements(s.body, f"{pad}    "), f"{pad}}}"],
    ir.Push: _Function._push,
    ir.Put: lambda f, s, pad: [f"{pad}{s.array.name}{f._at(s.index)} = {f._real(s.value)};"],
    ir.Raise: _Function._raise,
    ir.Replace: lambda f, s, pad: [
        f"{pad}replace(&lists[{s.ring}], {f._real(s.index)}, {f._item(s.items)});"
    ],
}
"""Lines of each kind of statement."""
_TARGETS: dict[type, Callable[[Any], Sequence[ir.Var]]] = {
    **dict.fromkeys((ir.Let, ir.Load, ir.Fetch, ir.Digit), lambda s: (s.target,)),
    ir.Invoke: lambda s: s.targets,
    ir.Digits: lambda s: (s.count,),
}
"""Variables that a statement sets."""
_OPERANDS: dict[type, Callable[[Any], Sequence[ir.Operand]]] = {
    **dict.fromkeys((ir.Let, ir.Invoke), lambda s: s.operands),
    **dict.fromkeys((ir.If, ir.Leave), lambda s: (s.test,)),
    **dict.fromkeys((ir.Fetch, ir.Digit), lambda s: (s.index,)),
    ir.Load: lambda s: (*s.table, s.index),
    ir.Put: lambda s: (s.index, s.value),
    ir.Push: lambda s: s.items,
    ir.Replace: lambda s: (s.index, *s.items),
    ir.Digits: lambda s: (s.value,),
    ir.Raise: lambda s: [part[0] for part in s.message if not isinstance(part, str)],
}
"""Operands of a statement, which may be constants."""


def _outlined(body: Sequence[ir.Statement]) -> Iterator[ir.Outlined]:
    """Yield the functions called by statements, each after those that it calls itself."""
    for s in ir.every(body):
        if isinstance(s, ir.Invoke):
            yield from _outlined(s.function.body)
            yield s.function
