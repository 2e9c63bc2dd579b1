"""Evaluation of Python's built-in functions, and of methods of lists, strings and dictionaries."""

from __future__ import annotations

import array
import bisect
import itertools
import math
import operator
import types
from collections.abc import Callable, Sequence
from typing import Any

from . import ir
from . import values as v
from .attributes import member
from .evaluate import Evaluator
from .expressions import formatted
from .loops import UNROLLED, for_each_index
from .lower import COMPENSATED, complaint
from .shapes import push
from .values import EITHER, UNSET, Refused, is_mixed, is_number, is_plain, is_real, joined_text, read, same

MOST_IN_ARRAY = 4096
"""Largest number of numbers in an array; chosen: it is on the stack."""
MOST_DIGITS = 15
"""Largest number of digits to which numbers are rounded."""
MOST_SORTED = 63
"""Largest number of numbers that are sorted natively; see `arithmetic.h`."""
_PURE = (set, frozenset, str, repr, ord, chr, divmod, pow, format, float, int, bool, tuple, complex, range)


def built_in(e: Evaluator, function: Any, args: list[Any], named: dict[str, Any]) -> Any:
    """Return the value of a call of a function or class of Python."""
    name, of_math = getattr(function, "__name__", ""), getattr(function, "__module__", "") == "math"
    if name == "_replace" and isinstance(args[0], tuple):
        return function(*args, **named)
    if function is math.log and len(args) == 2:
        return e.operators.operate("/", *[built_in(e, function, [x], {}) for x in args])
    if of_math and name not in ("floor", "ceil", "trunc"):
        args = [e.paths.real(x) if is_mixed(x) else x for x in args]
    if any(isinstance(x, v.Union) for x in args) and not any(function is f for f in OF_FORMS):
        k = next(i for i, x in enumerate(args) if isinstance(x, v.Union))
        return e.paths.by_form(
            args[k], lambda x: built_in(e, function, [*args[:k], x, *args[k + 1 :]], named)
        )
    if name == "get" and type(getattr(function, "__self__", None)) is dict:
        return METHODS[v.Dict, name](e, v.Dict(function.__self__), *args)
    if isinstance(function, _KINDS_OF_FUNCTIONS) and function in FUNCTIONS:
        return FUNCTIONS[function](e, *args, **named)
    if of_math and all(map(is_number, args)):
        return e.lower.function(name, *args)
    if isinstance(function, type) and issubclass(function, BaseException):
        return v.Failure(function, text_of(args))
    if getattr(function, "__module__", "") == "_operator" and name.startswith(("i", "set", "del")):
        raise Refused(f"a call of operator.{name}")
    plain = [tuple(e.items.of(x)) if isinstance(x, v.List) else x for x in args]
    if _is_pure(function) and all(map(_is_constant, (*plain, *named.values()))):
        try:
            return e.items.imported(function(*plain, **named))
        except Exception as error:
            e.lower.end(type(error).__name__, str(error))
    raise Refused(f"a call of {name or type(function).__name__}")


def method_of(e: Evaluator, owner: Any, name: str, args: list[Any], named: dict[str, Any]) -> Any:
    """Return the value of a call of a method of a list, text or dictionary."""
    kind, what = type(owner), KINDS[type(owner)]
    if (kind, name) not in METHODS:
        raise Refused(f"the method {name} of a {what}")
    return METHODS[kind, name](e, owner, *args, **named)


def _is_pure(function: Any) -> bool:
    """Return whether a function has no side effects, so that it may be called at build time."""
    if any(function is pure for pure in _PURE):
        return True
    owner = getattr(function, "__self__", None)
    if type(owner) is dict:
        return function.__name__ in ("get", "keys", "values", "items", "copy")
    if is_plain(owner) and owner is not None:
        return True
    return getattr(function, "__module__", "") in ("math", "_operator", "_bisect", "itertools")


def _is_constant(value: Any) -> bool:
    """Return whether a value is known at build time, and none of its operators is of a component."""
    if type(value) in (tuple, list, set, frozenset):
        return all(map(_is_constant, value))
    if type(value) is dict:
        return all(map(_is_constant, (*value, *value.values())))
    return is_plain(value) or isinstance(value, (range, slice, *_KINDS_OF_FUNCTIONS))


def _getattr(e: Evaluator, owner: Any, name: str, *default: Any) -> Any:
    missing = (lambda: default[0]) if default else None
    return e.paths.by_form(owner, lambda x: e.attributes.of(x, name, missing))


class Repeated:
    """Endless `itertools.repeat`."""

    def __init__(self, value: Any) -> None:
        self.value = value


def _float(e: Evaluator, value: Any) -> Any:
    if type(value) is str:
        return e.lower.computed(float, value)
    return _converted(e, "__float__", (ir.REAL,), e.lower.as_real, value)


def _int(e: Evaluator, value: Any) -> Any:
    if type(value) is str:
        return e.lower.computed(int, value)
    return _converted(e, "__int__", (ir.INT,), lambda x: e.lower.whole("trunc", x), value)


def _converted(e: Evaluator, name: str, of: Sequence[str], usual: Any, value: Any) -> Any:
    """Return a number, or that of an object whose class has a special method that returns one."""
    result = e.paths.narrowed(e.operators.unary(name, usual, value))
    if e.attributes.special(value, name) is UNSET:
        return result
    if not is_number(result) or ir.type_of(result) not in of:
        raise Refused(f"{name} that returns something other than Python wants")
    return result


def _round(e: Evaluator, value: Any, digits: Any = None) -> Any:
    if digits is None:
        return e.operators.unary("__round__", lambda x: e.lower.whole("rint", x), value)
    if not is_number(value):
        raise Refused(f"round of a {type(value).__name__}")
    if not isinstance(value, ir.Var):
        return round(value, digits)
    if not isinstance(digits, int) or not 0 <= digits <= MOST_DIGITS:
        raise Refused(f"round to other than 0 to {MOST_DIGITS} digits")
    return e.lower.let(ir.REAL, "rounded", value, digits) if is_real(value) else e.lower.whole("rint", value)


def _divmod(e: Evaluator, a: Any, b: Any) -> Any:
    if is_number(a) and is_number(b):
        unit: Any = 1.0 if is_real(a) or is_real(b) else 1
        e.lower.require(e.lower.compare("!=", b, 0), *complaint(lambda: divmod(unit, 0 * unit)))
    return e.operators.operate("//", a, b), e.operators.operate("%", a, b)


def _isclose(e: Evaluator, a: Any, b: Any, *, rel_tol: Any = 1e-09, abs_tol: Any = 0.0) -> Any:
    if not all(isinstance(x, (int, float)) and x >= 0.0 for x in (rel_tol, abs_tol)):
        raise Refused("math.isclose with tolerances that are only known at run time, or negative")
    a, b = e.paths.real(a), e.paths.real(b)
    finite = [e.lower.negation(e.lower.function("isinf", x)) for x in (a, b)]
    apart = e.lower.size(e.lower.binary("-", b, a))
    bounds = [e.lower.size(e.lower.binary("*", float(rel_tol), x)) for x in (b, a)]

    def near() -> Any:
        return _one_of(e, [e.lower.compare("<=", apart, bound) for bound in (*bounds, float(abs_tol))])

    def of_finite() -> Any:
        return e.paths.branch(
            finite[0], lambda: e.paths.branch(finite[1], near, lambda: False), lambda: False
        )

    return e.paths.branch(e.lower.compare("==", a, b), lambda: True, of_finite)


def _one_of(e: Evaluator, conditions: list[ir.Operand]) -> ir.Operand:
    first, *rest = conditions
    return e.paths.branch(first, lambda: True, lambda: _one_of(e, rest)) if rest else first


def _hypot(e: Evaluator, *values: Any) -> Any:
    return (
        e.lower.function("hypot", *values)
        if any(isinstance(x, ir.Var) for x in values)
        else math.hypot(*values)
    )


def _dist(e: Evaluator, first: Any, second: Any) -> Any:
    pairs = list(zip(e.items.of(first), e.items.of(second), strict=True))
    if not any(isinstance(x, (ir.Var, v.Union)) for pair in pairs for x in pair):
        return math.dist(*zip(*pairs, strict=True))
    return e.lower.function(
        "dist", *[e.lower.binary("-", e.paths.real(a), e.paths.real(b)) for a, b in pairs]
    )


def _prod(e: Evaluator, values: Any) -> Any:
    product: Any = 1
    for item in e.items.of(values):
        product = e.operators.operate("*", product, item)
    return product


def _sum(e: Evaluator, values: Any, start: Any = 0) -> Any:
    """Return sum(values, start), by the summation of the Python that builds."""
    numbers = [start, *e.items.of(values)]
    if not all(is_number(x) or is_mixed(x) for x in numbers):
        raise Refused("a sum of values that are not numbers")
    if COMPENSATED:
        return _compensated(e, numbers, 0)
    total = numbers[0]
    for x in numbers[1:]:
        total = e.operators.operate("+", total, x)
    return total


def _compensated(e: Evaluator, numbers: list[Any], k: int) -> Any:
    mixed = next((i for i in range(k, len(numbers)) if isinstance(numbers[i], v.Union)), None)
    if mixed is not None:
        before, after = numbers[:mixed], numbers[mixed + 1 :]
        return e.paths.by_form(numbers[mixed], lambda x: _compensated(e, [*before, x, *after], mixed))
    if not any(isinstance(x, ir.Var) for x in numbers):
        return sum(numbers[1:], numbers[0])
    first = next((i for i, x in enumerate(numbers) if is_real(x)), len(numbers))
    whole: Any = 0
    for x in numbers[:first]:
        whole = e.operators.operate("+", whole, x)
    if first == len(numbers):
        return whole
    return e.lower.let(ir.REAL, "compensated_sum", whole, *numbers[first:])


def _extreme(e: Evaluator, op: str, args: Sequence[Any], key: Any = None, **default: Any) -> Any:
    items = e.items.of(args[0]) if len(args) == 1 else list(args)
    if not items and default:
        return default["default"]
    if items and key is None and all(map(_is_constant, items)):
        return (max if op == ">" else min)(items)
    if not items:
        raise Refused("min or max of nothing")
    best, *others = _keyed(e, items, key, "min or max of values that are not numbers")
    for other in others:
        better = _in_order(e, op, other[0], best[0])
        best = tuple(e.paths.selected(better, x, y) for x, y in zip(other, best, strict=True))
    return best[-1]


def _sorted(e: Evaluator, values: Any, key: Any = None, reverse: Any = False) -> Any:
    items = e.items.of(values)
    if not isinstance(reverse, (bool, int)):
        raise Refused("an order that is only known at run time")
    if key is None and all(map(_is_constant, items)):
        return v.List(sorted(items, reverse=bool(reverse)))
    rows = _keyed(e, items, key, "sorting values that are not numbers")
    if len(rows) > MOST_SORTED:
        raise Refused(f"sorting more than {MOST_SORTED} numbers that are only known at run time")
    rows = rows[::-1] if reverse else rows  # of equal ones, the first stays first
    keys = [e.paths.real(row[0]) if is_mixed(row[0]) else row[0] for row in rows]
    if any(ir.type_of(x) in (ir.WORD, ir.WIDE) for x in keys):
        raise Refused("sorting integers of 64 bits")
    places = [e.lower.let(ir.INT, "sorted_item", k, *keys) for k in range(len(keys))] if keys[1:] else [0]
    ordered = [_numbered(e, place, [row[-1] for row in rows]) for place in places]
    return v.List(ordered[::-1] if reverse else ordered)


def _numbered(e: Evaluator, number: ir.Operand, items: Sequence[Any]) -> Any:
    chosen = items[0]
    for k, item in enumerate(items[1:], start=1):
        chosen = e.paths.selected(e.lower.compare("==", number, k), item, chosen)
    return chosen


def _keyed(e: Evaluator, items: Sequence[Any], key: Any, text: str) -> list[tuple[Any, ...]]:
    """Return items with their keys before them, if there are keys; refused with a text if not numbers."""
    if not all(is_number(x) or is_mixed(x) for x in items):
        raise Refused(text)
    if key is None:
        return [(x,) for x in items]
    keys = [e.call(key, [x], {}) for x in items]
    if not all(is_number(x) or is_mixed(x) for x in keys):
        raise Refused("keys that are not numbers")
    return list(zip(keys, items, strict=True))


def _in_order(e: Evaluator, op: str, a: Any, b: Any) -> ir.Operand:
    return e.lower.compare(op, *(e.paths.real(x) if is_mixed(x) else x for x in (a, b)))


def _searched(e: Evaluator, method: Callable[..., int], owner: v.List, args: Sequence[Any]) -> int:
    if not all(map(is_plain, (*read(owner), *args))):
        raise Refused(f"the method {method.__name__} of a list")
    return e.lower.computed(method, read(owner), *args)  # type: ignore[no-any-return]


def _view(owner: v.Dict, keys: tuple[Any, ...], with_keys: bool) -> v.Each:
    def item(k: int) -> Any:
        if tuple(read(owner)) != keys:
            raise Refused("a dictionary whose keys change during iteration")
        value = read(owner)[keys[k]]
        return (keys[k], value) if with_keys else value

    return v.Each(len(keys), item, once=False)


def _iter(e: Evaluator, value: Any) -> v.Each:
    each = e.items.each(value)
    return each if each.once else v.Each(each.count, each.item, each.end)


def _len(e: Evaluator, value: Any) -> Any:
    own = e.attributes.called(value, "__len__")
    if own is not UNSET:
        return _length(e, e.paths.narrowed(own))
    if isinstance(value, v.Ring):
        return e.memory.ring_length(value)
    if isinstance(value, v.Picked):
        if all(isinstance(x, str) or type(x) is tuple for x in value.items):
            return e.memory.by_item(value, len)
        return e.memory.length_of_picked(value)
    if isinstance(value, v.Array):
        return value.memory.length
    if isinstance(value, v.Each) and not value.once:
        return value.count
    if isinstance(value, (v.List, v.Dict)):
        return len(read(value))
    if isinstance(value, tuple) or type(value) in (str, bytes, range, list, dict, set, frozenset):
        return len(value)
    raise Refused(f"len of a {type(value).__name__}")


def _length(e: Evaluator, count: Any) -> Any:
    """Return what a __len__ has returned, which must be an integer that is not negative."""
    if not is_number(count) or ir.type_of(count) not in (ir.INT, ir.BOOL):
        raise Refused("a __len__ that returns something other than an integer")
    e.lower.require(e.lower.compare(">=", count, 0), "ValueError", "__len__() should return >= 0")
    return e.lower.binary("+", count, 0)


def _array(e: Evaluator, kind: Any, values: Any = ()) -> v.Array:
    each = e.items.each(values)
    if kind != "d" or not each.count:
        raise Refused("an array other than one of real numbers")
    if each.count > MOST_IN_ARRAY:
        raise Refused(f"an array of more than {MOST_IN_ARRAY:,} numbers")
    made = v.Array(ir.Array(f"a{e.lower.new(ir.REAL).name}", each.count))
    if isinstance(values, v.Array):
        for_each_index(
            e, each.count, lambda k: e.items.set_array_item(made, k, e.memory.array_item(values, k))
        )
        return made
    items = [each.item(k) for k in range(each.count)]
    if len(items) > UNROLLED and all(same(x, items[0]) for x in items):
        for_each_index(e, len(items), lambda k: e.items.set_array_item(made, k, items[0]))
        return made
    for k, x in enumerate(items):
        e.items.set_array_item(made, k, x)
    return made


def _dict(e: Evaluator, value: Any = (), /, **named: Any) -> Any:
    if type(value) is dict:
        value = v.Dict(value)
    held = read(value) if isinstance(value, v.Dict) else dict(map(e.items.of, e.items.of(value)))
    held = {e.items.key(k): x for k, x in held.items()}
    return v.Dict({**held, **named})


def _decided(e: Evaluator, each: v.Each, by: bool, k: int = 0) -> Any:
    if k == each.count:
        return not by
    test = e.operators.truth_of(each.item(k))
    on = lambda: _decided(e, each, by, k + 1)  # noqa: E731
    return e.paths.branch(test, *((lambda: True, on) if by else (on, lambda: False)))


def _zip(e: Evaluator, *values: Any, strict: bool = False) -> Any:
    rows = [x if isinstance(x, Repeated) else e.items.each(x) for x in values]
    counts = {x.count for x in rows if isinstance(x, v.Each)}
    if strict and len(counts) > 1:
        e.lower.end("ValueError", "zip() arguments differ in length")
    return v.Each(min(counts), lambda k: tuple(x.item(k) if isinstance(x, v.Each) else x.value for x in rows))


def _map(e: Evaluator, function: Any, *values: Any) -> Any:
    rows = _zip(e, *values)
    return v.Each(rows.count, lambda k: e.call(function, rows.item(k), {}))


def _enumerate(e: Evaluator, values: Any, start: int = 0) -> Any:
    if isinstance(values, (v.Ring, v.Span)):
        raise Refused("enumerate of a list whose length changes")
    each = e.items.each(values)
    return v.Each(each.count, lambda k: (start + k, each.item(k)), each.end)


def _reversed(e: Evaluator, values: Any) -> Any:
    if e.attributes.special(values, "__reversed__") is not UNSET or isinstance(values, v.Instance):
        raise Refused("reversed of an object")
    each = e.items.each(values)
    return v.Each(each.count, lambda k: each.item(each.count - 1 - k))


def _pairwise(e: Evaluator, values: Any) -> Any:
    if isinstance(values, v.Ring):
        ring = values
        last = e.lower.binary("-", e.memory.ring_length(ring), 1)

        def pair(k: ir.Operand) -> tuple[Any, Any]:
            return e.memory.ring_item(ring, k), e.memory.ring_item(ring, e.lower.binary("+", k, 1))

        return v.Span(0, last, pair, ring)
    each = e.items.each(values)
    before: list[Any] = []

    def following(k: int) -> tuple[Any, Any]:
        first = before.pop() if k else each.item(0)
        before.append(each.item(k + 1))
        return first, before[0]

    return v.Each(max(each.count - 1, 0), following)


def _chain(e: Evaluator, *values: Any) -> Any:
    rows = [(each, k) for each in map(e.items.each, values) for k in range(each.count)]
    return v.Each(len(rows), lambda i: rows[i][0].item(rows[i][1]))


def _range(e: Evaluator, *ends: Any) -> Any:
    if any(map(is_real, ends)):
        e.lower.end("TypeError", "'float' object cannot be interpreted as an integer")
    if not any(isinstance(x, ir.Var) for x in ends):
        return range(*ends)
    if len(ends) > 2:
        raise Refused("a range whose step or ends are only known at run time")
    return v.Span(ends[0] if len(ends) == 2 else 0, ends[-1], lambda k: k)


def _bisect_right(e: Evaluator, values: Any, x: Any) -> Any:
    items = e.items.of(values)
    if not any(isinstance(y, ir.Var) for y in (*items, x)):
        return bisect.bisect_right(items, x)

    def go(low: int, high: int) -> ir.Operand:  # the search order of `bisect`
        if low == high:
            return low
        middle = (low + high) // 2
        less = e.lower.compare("<", x, items[middle])
        return e.paths.branch(less, lambda: go(low, middle), lambda: go(middle + 1, high))  # type: ignore

    return go(0, len(items))


def _isinstance(e: Evaluator, value: Any, kinds: Any) -> Any:
    value = e.paths.narrowed(value)
    if isinstance(value, v.Union):
        return e.paths.by_form(value, lambda x: _isinstance(e, x, kinds))
    if isinstance(value, ir.Var):
        of = {ir.REAL: float, ir.BOOL: bool}.get(value.type, int)
        if value.type == ir.EITHER and issubclass(bool, kinds) != issubclass(int, kinds):
            raise Refused(EITHER)
        return issubclass(of, kinds)
    for kind in kinds if isinstance(kinds, tuple) else (kinds,):
        check = member(type(kind), "__instancecheck__")
        if isinstance(check, types.FunctionType) and type(kind).__module__ not in (
            "abc",
            "typing",
            "enum",
        ):
            raise Refused(f"isinstance of {kind.__name__}, whose class has a metaclass")
    if isinstance(value, v.Picked):
        value = e.memory.loaded(value)
    if isinstance(value, (v.Closure, v.Bound, v.Bytes, v.Span, v.Each, v.Failure)):
        raise Refused(f"isinstance of a {type(value).__name__}")
    if isinstance(value, v.Text):
        return issubclass(str, kinds)
    if isinstance(value, v.Instance):
        return issubclass(value.cls, kinds)
    if isinstance(value, v.Array):
        return issubclass(array.array, kinds)
    if isinstance(value, (v.List, v.Ring, v.Dict)):
        return issubclass(dict if isinstance(value, v.Dict) else list, kinds)
    return isinstance(value, kinds)


def text_of(args: Sequence[Any]) -> v.Text:
    if len(args) > 1:
        raise Refused("an exception of several values")
    if not args:
        return v.Text(())
    if isinstance(args[0], v.Text):
        return args[0]
    if not is_plain(args[0]):
        raise Refused("an exception of something unknown")
    return v.Text((str(args[0]),))


def _resized(e: Evaluator, owner: v.List, change: Callable[..., Any], *args: Any) -> None:
    if owner.path is not None:
        raise Refused(f"{change.__name__} of a list of the state")
    change(e.paths.open(owner), *args)


def _append(e: Evaluator, owner: v.List, item: Any) -> None:
    e.items.promote(owner, item)
    e.paths.open(owner).append(item)


FUNCTIONS: dict[Any, Callable[..., Any]] = {
    abs: lambda e, value: e.paths.by_form(value, lambda x: e.operators.unary("__abs__", e.lower.size, x)),
    all: lambda e, values: _decided(e, e.items.each(values), False),
    any: lambda e, values: _decided(e, e.items.each(values), True),
    array.array: _array,
    bisect.bisect_right: _bisect_right,
    bool: lambda e, value: e.operators.truth_of(value),
    dict: _dict,
    divmod: _divmod,
    enumerate: _enumerate,
    float: _float,
    getattr: _getattr,
    hasattr: lambda e, owner, name: e.paths.by_form(owner, lambda x: e.attributes.has(x, name)),
    int: _int,
    isinstance: _isinstance,
    iter: _iter,
    itertools.chain: _chain,
    itertools.chain.from_iterable: lambda e, values: _chain(e, *e.items.of(values)),
    itertools.pairwise: _pairwise,
    itertools.repeat: lambda e, value, times=None: Repeated(value) if times is None else (value,) * times,
    len: _len,
    list: lambda e, values=(): v.List(e.items.of(values)),
    map: _map,
    math.dist: _dist,
    math.fabs: lambda e, value: e.lower.function("fabs", value),
    math.hypot: _hypot,
    math.isclose: _isclose,
    math.prod: _prod,
    max: lambda e, *args, **named: _extreme(e, ">", args, **named),
    min: lambda e, *args, **named: _extreme(e, "<", args, **named),
    range: _range,
    reversed: _reversed,
    round: _round,
    setattr: lambda e, owner, name, value: e.attributes.set(owner, name, value),
    sorted: _sorted,
    str: lambda e, value: joined_text(formatted(value, "", False)),
    sum: _sum,
    tuple: lambda e, values=(): tuple(e.items.of(values)),
    zip: _zip,
    operator.add: lambda e, a, b: e.operators.operate("+", a, b),
    operator.floordiv: lambda e, a, b: e.operators.operate("//", a, b),
    operator.mod: lambda e, a, b: e.operators.operate("%", a, b),
    operator.mul: lambda e, a, b: e.operators.operate("*", a, b),
    operator.pow: lambda e, a, b: e.operators.operate("**", a, b),
    operator.sub: lambda e, a, b: e.operators.operate("-", a, b),
    operator.truediv: lambda e, a, b: e.operators.operate("/", a, b),
}
"""Functions and classes of Python that are understood, with what evaluates a call. Others are called at build
time if nothing in the call is only known at run time (see `_is_pure`)."""
OF_FORMS = (getattr, hasattr, isinstance, bool, zip)
"""Those that take values of several forms; others are called for each form."""
METHODS: dict[tuple[type, str], Callable[..., Any]] = {
    (v.Dict, "copy"): lambda e, owner: v.Dict(read(owner)),
    (v.Dict, "get"): lambda e, owner, key, default=None: read(owner).get(e.items.key(key), default),
    (v.Dict, "items"): lambda e, owner: _view(owner, tuple(read(owner)), with_keys=True),
    (v.Dict, "keys"): lambda e, owner: tuple(read(owner)),
    (v.Dict, "values"): lambda e, owner: _view(owner, tuple(read(owner)), with_keys=False),
    (v.List, "append"): _append,
    (v.List, "clear"): lambda e, owner: _resized(e, owner, list.clear),
    (v.List, "copy"): lambda e, owner: v.List(read(owner)),
    (v.List, "count"): lambda e, owner, *args: _searched(e, list.count, owner, args),
    (v.List, "extend"): lambda e, owner, values: _resized(e, owner, list.extend, e.items.of(values)),
    (v.List, "index"): lambda e, owner, *args: _searched(e, list.index, owner, args),
    (v.List, "insert"): lambda e, owner, *args: _resized(e, owner, list.insert, *args),
    (v.List, "pop"): lambda e, owner, index=-1: e.items.remove(owner, index, "pop from empty list"),
    (v.List, "reverse"): lambda e, owner: e.paths.open(owner).reverse(),
    (v.Ring, "append"): lambda e, ring, item: push(ring, item, read, e.lower),
    (v.Ring, "pop"): lambda e, ring, index: e.items.remove(ring, index, "pop from empty list"),
    (v.Text, "encode"): lambda e, text, *_, **__: v.Bytes(text),
}
"""Methods of values that are understood, with what evaluates a call."""
KINDS = {v.List: "list", v.Ring: "list whose length changes", v.Dict: "dictionary", v.Text: "text"}
_KINDS_OF_FUNCTIONS = (type, types.BuiltinFunctionType)
