"""Reads the text of a function and does for every lane what it says.

Numbers of Python, indices and loops are worked out while reading; what is known only when the code runs becomes operations. Where a condition
may differ between lanes, both branches are done, and every assignment keeps the old value in the lanes that are not concerned. A condition
that is the same in all lanes is a jump.

A part of the text that is rare and long can be left out: a lane that comes to it is reported, and its machine is to be computed alone.
"""

import ast
import builtins
import inspect
import math
import textwrap
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any, Final

import numpy as np

from bus.lanes import functions, markers
from bus.lanes.operations import Kind, Operand, Operations, Value, is_truth
from bus.user_error import UserError

OWN: Final[dict[Any, Callable[..., float]]] = {
    math.sin: functions.sin,
    math.cos: functions.cos,
    math.atan: functions.atan,
    math.exp: functions.exp,
}
"""Functions of `math` that have a text for vectors."""
OF_VECTORS: Final = {math.sqrt: "sqrt", math.copysign: "copysign", math.floor: "floor", math.fabs: "fabs"}
LANE_BY_LANE: Final = {
    f: f.__name__
    for f in (math.tan, math.asin, math.acos, math.atan2, math.tanh, math.sinh, math.cosh, math.log, math.pow)
}
COMPARED: Final[dict[type[ast.cmpop], str]] = {
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.Eq: "==",
    ast.NotEq: "!=",
}
HIGHEST_POWER: Final = 4  # that is written as products

Cells = list[np.ndarray[Any, Any]]


class NotForLanesError(UserError, ValueError):
    """The text of a function has something that cannot be done for several machines at once."""


@dataclass(slots=True)
class Frame:
    """A call that is being read."""

    function: Any
    names: dict[str, Any]
    result: Any = None
    has_result: bool = False
    node: ast.AST | None = field(default=None)


@cache
def text_of(function: Any) -> ast.FunctionDef:
    """The parsed text of a function; its line numbers are those of the file."""
    lines, first = inspect.getsourcelines(function)
    found = ast.parse(textwrap.dedent("".join(lines))).body[0]
    assert isinstance(found, ast.FunctionDef)
    ast.increment_lineno(found, first - 1)
    return found


class Reader:
    """Reads functions and writes their operations.

    rare: functions whose calls are left out; they return nothing.
    cells: all arrays of values that the functions write to, so that a jump can be joined again.
    """

    def __init__(self, operations: Operations, *, rare: Collection[Any], cells: Cells) -> None:
        self.operations = operations
        self.left_out: Operand = False
        """The lanes that came to a rare part."""
        self._rare = {getattr(f, "py_func", f) for f in rare}
        self._cells = cells
        self._live: Operand = True
        self._frames: list[Frame] = []

    # ---- calls

    def call(self, function: Any, arguments: Sequence[Any]) -> Any:
        """What a function returns. Errors: NotForLanesError."""
        function = getattr(function, "py_func", function)
        if function in self._rare:
            self.left_out = self.operations.either(self.left_out, self._live)
            return None
        if not hasattr(function, "__code__"):
            raise self._refused(f"{getattr(function, '__name__', function)} has no text to read")
        text = text_of(function)
        names = [argument.arg for argument in text.args.args]
        if len(names) != len(arguments):
            raise self._refused(f"{function.__name__} is called with other than {len(names)} arguments")
        frame, live = Frame(function, dict(zip(names, arguments, strict=True))), self._live
        self._frames.append(frame)
        self._block(text.body)
        self._frames.pop()
        self._live = live
        return frame.result

    def _refused(self, why: str) -> NotForLanesError:
        frame = self._frames[-1] if self._frames else None
        if frame is None:
            return NotForLanesError(why)
        line = getattr(frame.node, "lineno", "?")
        return NotForLanesError(f"{frame.function.__code__.co_filename}:{line}: {why}")

    # ---- statements

    def _block(self, statements: Sequence[ast.stmt]) -> None:
        for statement in statements:
            if self._live is False:
                return
            self._frames[-1].node = statement
            self._statement(statement)

    def _statement(self, node: ast.stmt) -> None:
        match node:
            case ast.Expr(value=ast.Constant()) | ast.Pass():
                pass
            case ast.Expr(value=value):
                self._value(value)
            case ast.Assign(targets=targets, value=value):
                found = self._value(value)
                for target in targets:
                    self._assign(target, found)
            case ast.AnnAssign(target=target, value=ast.expr() as value):
                self._assign(target, self._value(value))
            case ast.AugAssign(target=target, op=op, value=value):
                self._assign(target, self._arithmetic(op, self._value(target), self._value(value)))
            case ast.Return(value=value):
                self._return(None if value is None else self._value(value))
            case ast.If(test=test, body=body, orelse=orelse):
                self._if(self._truth(self._value(test)), body, orelse)
            case ast.For(target=target, iter=items, body=body, orelse=[]):
                for item in self._value(items):
                    self._bind(target, item)
                    self._block(body)
            case _:
                raise self._refused(f"a statement {type(node).__name__} cannot be done for each lane")

    def _return(self, found: Any) -> None:
        frame = self._frames[-1]
        frame.result = self._choose(self._live, found, frame.result) if frame.has_result else found
        frame.has_result = True
        self._live = False

    def _if(self, condition: Operand, body: Sequence[ast.stmt], orelse: Sequence[ast.stmt]) -> None:
        if not isinstance(condition, Value):
            self._block(body if condition else orelse)
        elif condition.kind is Kind.TRUTH:
            self._jump(condition, body, orelse)
        else:
            o, before = self.operations, self._live
            self._live = held = o.both(before, condition)
            self._block(body)
            left = self._live
            self._live = other = o.both(before, o.opposite(condition))
            self._block(orelse)
            nobody_returned = left is held and self._live is other
            self._live = before if nobody_returned else o.either(left, self._live)

    def _jump(self, condition: Value, body: Sequence[ast.stmt], orelse: Sequence[ast.stmt]) -> None:
        """A branch of the code: what the parts have changed is joined behind them."""
        o, b = self.operations, self.operations.builder
        names, known = [dict(frame.names) for frame in self._frames], o.scope()
        returned = [frame.has_result for frame in self._frames]
        before = self._cell_values()
        first, second, behind = (b.append_basic_block() for _ in range(3))
        b.cbranch(condition.code, first, second)
        ends = []
        for block, part in ((first, body), (second, orelse)):
            b.position_at_end(block)
            self._put_back(before, names)
            self._block(part)
            if returned != [frame.has_result for frame in self._frames]:
                raise self._refused("a return within a condition that is the same in all lanes")
            ends.append(End(self._cell_values(), [dict(frame.names) for frame in self._frames], b.block))
            o.restore(dict(known))
        self._join(ends, behind)
        o.restore(known)

    def _join(self, ends: Sequence["End"], behind: Any) -> None:
        """Go on behind both branches. What only one of them has named is its own, and forgotten."""
        one, other = ends
        in_both = [
            (ones, others, [name for name in ones if name in others])
            for ones, others in zip(one.names, other.names, strict=True)
        ]
        pairs = list(zip(one.values, other.values, strict=True))
        pairs += [(ones[name], others[name]) for ones, others, shared in in_both for name in shared]
        differing = [(i, self._kind_of(x, y), x, y) for i, (x, y) in enumerate(pairs) if x is not y]
        b, o = self.operations.builder, self.operations
        incoming = []
        for side, end in enumerate(ends):
            b.position_at_end(end.block)
            known = o.scope()
            incoming.append([o.form(sides[side], kind) for _, kind, *sides in differing])
            o.restore(known)
            b.branch(behind)
        b.position_at_end(behind)
        values = [x for x, _ in pairs]
        for (i, kind, _, _), x, y in zip(differing, *incoming, strict=True):
            phi = b.phi(x.type)
            phi.add_incoming(x, one.block)
            phi.add_incoming(y, other.block)
            values[i] = Value(phi, kind)
        cells, named = values[: len(one.values)], iter(values[len(one.values) :])
        self._put_back(cells, [{name: next(named) for name in shared} for _, _, shared in in_both])

    def _kind_of(self, x: Any, y: Any) -> Kind:
        """The kind that both values of a cell can be given."""
        if not all(isinstance(v, (Value, float, int)) for v in (x, y)):
            raise self._refused(
                "a condition that is the same in all lanes changes something other than numbers"
            )
        if is_truth(x) != is_truth(y):
            raise self._refused("a name is a number in one branch and a truth in the other")
        return Kind.TRUTHS if is_truth(x) else Kind.NUMBERS

    def _cell_values(self) -> list[Any]:
        """The values of all cells, and which lanes are live and left out."""
        values: list[Any] = []
        for cells in self._cells:
            values += cells.ravel().tolist()
        return [*values, self._live, self.left_out]

    def _put_back(self, values: Sequence[Any], names: Sequence[dict[str, Any]]) -> None:
        """Make these the values of all cells, and these the names of all calls being read."""
        at = 0
        for cells in self._cells:
            flat = cells.reshape(-1)
            for i in range(cells.size):
                flat[i] = values[at + i]
            at += cells.size
        self._live, self.left_out = values[at:]
        for frame, known in zip(self._frames, names, strict=True):
            frame.names = dict(known)

    def _assign(self, target: ast.expr, found: Any) -> None:
        match target:
            case ast.Name(id=name):
                names = self._frames[-1].names
                if name in names and self._live is not True:
                    found = self._choose(self._live, found, names[name])
                names[name] = found
            case ast.Tuple(elts=parts):
                for part, item in zip(parts, found, strict=True):
                    self._assign(part, item)
            case ast.Subscript(value=owner, slice=place):
                array, index = self._value(owner), self._index(place)
                array[index] = self._choose(self._live, found, array[index])
            case _:
                raise self._refused("an assignment to something other than a name or a place in an array")

    def _bind(self, target: ast.expr, item: Any) -> None:
        """Give a loop's name its next item: in all lanes, since what follows the loop does not use it."""
        match target:
            case ast.Name(id=name):
                self._frames[-1].names[name] = item
            case ast.Tuple(elts=parts):
                for part, one in zip(parts, item, strict=True):
                    self._bind(part, one)
            case _:
                raise self._refused("a loop over something other than names")

    def _choose(self, condition: Operand, a: Any, b: Any) -> Any:
        """a in the lanes in which the condition holds, else b."""
        if condition is True or a is b:
            return a
        if isinstance(a, tuple) and isinstance(b, tuple):
            return tuple(self._choose(condition, x, y) for x, y in zip(a, b, strict=True))
        if not all(isinstance(x, (Value, float, int)) for x in (a, b)):
            raise self._refused(
                "a condition that may differ between lanes decides on something other than numbers"
            )
        return self.operations.choose(condition, a, b)

    # ---- expressions

    def _value(self, node: ast.expr) -> Any:
        o = self.operations
        match node:
            case ast.Constant(value=value):
                return value
            case ast.Name(id=name):
                return self._named(name)
            case ast.BinOp(left=left, op=op, right=right):
                return self._arithmetic(op, self._value(left), self._value(right))
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return o.negative(self._value(operand))
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return o.opposite(self._truth(self._value(operand)))
            case ast.BoolOp(op=op, values=parts):
                return self._all_or_any(isinstance(op, ast.And), parts)
            case ast.Compare(left=left, ops=signs, comparators=others):
                return self._comparison(left, signs, others)
            case ast.IfExp(test=test, body=body, orelse=orelse):
                condition = self._truth(self._value(test))
                if not isinstance(condition, Value):
                    return self._value(body if condition else orelse)
                one = self._value_where(condition, body)
                return self._choose(condition, one, self._value_where(o.opposite(condition), orelse))
            case ast.Tuple(elts=parts):
                return tuple(map(self._value, parts))
            case ast.Attribute(value=owner, attr=name):
                return getattr(self._value(owner), name)
            case ast.Subscript(value=owner, slice=place):
                return self._value(owner)[self._index(place)]
            case ast.Call(func=function, args=arguments, keywords=[]):
                return self._called(self._value(function), [self._value(argument) for argument in arguments])
        raise self._refused(f"an expression {type(node).__name__} cannot be done for each lane")

    def _value_where(self, condition: Operand, node: ast.expr) -> Any:
        """The value of an expression; what it calls may write only in the lanes in which the condition holds."""
        before = self._live
        self._live = self.operations.both(before, condition)
        found = self._value(node)
        self._live = before
        return found

    def _named(self, name: str) -> Any:
        frame = self._frames[-1]
        for names in (frame.names, frame.function.__globals__, vars(builtins)):
            if name in names:
                return names[name]
        raise self._refused(f"{name} has no value here")

    def _index(self, node: ast.expr) -> Any:
        match node:
            case ast.Tuple(elts=parts):
                return tuple(map(self._index, parts))
            case ast.Slice(lower=lower, upper=upper, step=step):
                return slice(*(None if part is None else self._index(part) for part in (lower, upper, step)))
        found = self._value(node)
        if isinstance(found, Value):
            raise self._refused("an index that is known only when the code runs")
        return found

    def _truth(self, found: Any) -> Operand:
        if isinstance(found, Value):
            if found.is_number:
                raise self._refused("a number as a condition")
            return found
        return bool(found)

    def _all_or_any(self, of_all: bool, parts: Sequence[ast.expr]) -> Operand:
        join = self.operations.both if of_all else self.operations.either
        found: Operand = of_all
        for part in parts:
            if found is not of_all and not isinstance(found, Value):
                return found  # the rest is not evaluated
            asked = found if of_all else self.operations.opposite(found)
            found = join(found, self._truth(self._value_where(asked, part)))
        return found

    def _comparison(self, left: ast.expr, signs: Sequence[ast.cmpop], others: Sequence[ast.expr]) -> Operand:
        found: Operand = True
        a = self._value(left)
        for sign, other in zip(signs, others, strict=True):
            b = self._value(other)
            match sign:
                case ast.Is():
                    holds: Operand = a is b
                case ast.IsNot():
                    holds = a is not b
                case ast.In():
                    holds = a in b
                case _:
                    holds = self.operations.compare(COMPARED[type(sign)], a, b)
            found, a = self.operations.both(found, holds), b
        return found

    def _arithmetic(self, op: ast.operator, a: Any, b: Any) -> Any:
        o = self.operations
        if not isinstance(a, Value) and not isinstance(b, Value):
            return self._known_arithmetic(op, a, b)
        if not all(isinstance(x, (Value, float, int)) for x in (a, b)):
            raise self._refused("arithmetic on whole arrays")
        match op:
            case ast.Add():
                return o.add(a, b)
            case ast.Sub():
                return o.subtract(a, b)
            case ast.Mult():
                return o.multiply(a, b)
            case ast.Div():
                return o.divide(a, b)
            case ast.Pow():
                return self._power(a, b)
        raise self._refused(
            f"an operator {type(op).__name__} on values that are known only when the code runs"
        )

    def _known_arithmetic(self, op: ast.operator, a: Any, b: Any) -> Any:
        match op:
            case ast.Add():
                return a + b
            case ast.Sub():
                return a - b
            case ast.Mult():
                return a * b
            case ast.Div():
                return self.operations.divide(a, b)
            case ast.Pow():
                return a**b
            case ast.FloorDiv():
                return a // b
            case ast.Mod():
                return a % b
        raise self._refused(f"an operator {type(op).__name__}")

    def _power(self, a: Operand, b: Operand) -> Operand:
        if isinstance(b, int) and 1 < b <= HIGHEST_POWER:
            found = a
            for _ in range(b - 1):
                found = self.operations.multiply(found, a)
            return found
        return self.operations.lane_by_lane("pow", a, b)

    def _called(self, function: Any, arguments: Sequence[Any]) -> Any:
        o = self.operations
        if function in (min, max):
            pick = o.least if function is min else o.greatest
            found = arguments[0]
            for other in arguments[1:]:
                found = pick(found, other)
            return found
        if not any(isinstance(x, Value) for x in arguments) and (
            getattr(function, "__module__", None) in ("math", "builtins") or function in MARKERS
        ):
            return function(*arguments)
        if function is abs:
            return o.vector_function("fabs", *arguments)
        if function is float:
            return arguments[0]
        if function in OF_VECTORS:
            return o.vector_function(OF_VECTORS[function], *arguments)
        if function in LANE_BY_LANE:
            return o.lane_by_lane(LANE_BY_LANE[function], *arguments)
        if function is markers.to_whole:
            return o.vector_function("rint", *arguments)
        if function is markers.power_of_two:
            return o.power_of_two(*arguments)
        if function in OWN:
            return self.call(OWN[function], arguments)
        return self.call(function, arguments)


MARKERS: Final = (markers.to_whole, markers.power_of_two)


@dataclass(frozen=True, slots=True)
class End:
    """What is known at the end of a branch."""

    values: list[Any]
    """Of all cells, then which lanes are live and left out."""
    names: list[dict[str, Any]]
    """In each call being read."""
    block: Any
    """Where the code of the branch ends."""
