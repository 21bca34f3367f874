"""Expressions of the Python subset in C, with the same order of operations and the same failures.

A division by zero raises in Python; in C the runtime's `divided` takes a note of it, and the cycle counts as failed.
"""

import ast
import builtins
import inspect
import math
import types
from collections.abc import Callable, Mapping
from typing import Any, Final

from deploy.c.translation.arrays import fresh_array, place_in, size_of
from deploy.c.translation.kinds import (
    BOOL,
    INT,
    NUMBERS,
    REAL,
    TIME,
    Array,
    Group,
    Kind,
    Record,
    defaults_of,
    fields_of,
    is_record,
)
from deploy.c.translation.names import local_name
from deploy.c.translation.scope import Scope, Value

MATH: Final[Mapping[str, int]] = {
    "sin": 1, "cos": 1, "tan": 1, "asin": 1, "acos": 1, "atan": 1, "atan2": 2, "exp": 1, "log": 1, "sqrt": 1,
    "copysign": 2, "hypot": 2,
}  # fmt: skip
"""Functions of `math` that C has too, with their number of arguments."""
_ARITHMETIC: Final = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*"}
_COMPARISONS: Final = {
    ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!=", ast.Is: "==", ast.IsNot: "!=",
}  # fmt: skip
NEVER: Final = "NEVER_NS"
"""None, where a time is meant."""
_BUILTINS: Final = ("abs", "min", "max", "int", "float", "bool")


def literal(number: float) -> str:
    """A real constant, rounded to the build's precision by the compiler."""
    if math.isinf(number):
        return "-REAL_INFINITY" if number < 0 else "REAL_INFINITY"
    return f"R({number!r})"


def initialiser(value: Any) -> str:
    """A constant record, field by field."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(int(value))
    if isinstance(value, float):
        return literal(value)
    if value is None:
        return NEVER
    if type(value) is tuple:
        return "{" + ", ".join(map(initialiser, value)) + "}"
    parts = [f".{local_name(name)} = {initialiser(getattr(value, name))}" for name in fields_of(type(value))]
    return "{" + ", ".join(parts) + "}"


class Expressions:
    """Translates the expressions of one function."""

    def __init__(self, scope: Scope) -> None:
        self.scope = scope
        self._globals = scope.source.function.__globals__

    def value(self, node: ast.expr) -> Value:
        """Any expression."""
        method: Callable[[Any], Value] | None = getattr(self, f"_{type(node).__name__.lower()}", None)
        if method is None:
            raise self.scope.refused(node, f"{type(node).__name__} ({ast.unparse(node)[:60]})")
        return method(node)

    def as_kind(self, node: ast.expr, kind: Kind) -> str:
        """An expression converted as Python would: integers become reals, never the other way round."""
        return self.converted(self.value(node), kind, node).c

    def converted(self, value: Value, kind: Kind, node: ast.AST) -> Value:
        """A value as another kind, where that loses nothing."""
        if value.kind == kind:
            return value
        if kind == REAL and value.kind in (INT, BOOL):
            if value.exact is not None:
                return Value(literal(float(value.exact)), REAL, exact=float(value.exact))
            inner = value.operand() if value.kind == INT else f"({value.operand()} ? 1 : 0)"
            return Value(f"(real_t){inner}", REAL)
        if kind == TIME and value.kind == INT:
            return Value(f"(int64_t){value.operand()}", TIME)
        if kind == INT and value.kind == BOOL:
            return Value(f"real_counted({value.c})", INT)
        raise self.scope.refused(node, f"{value.kind} where {kind} is needed")

    def truth(self, node: ast.expr) -> Value:
        """A condition; a number is none, because C and Python would read other values of it as true."""
        found = self.value(node)
        if found.kind != BOOL:
            raise self.scope.refused(node, f"{ast.unparse(node)} is no truth value: compare it")
        return found

    def address(self, node: ast.expr) -> str:
        """Pointer to a record, which gets a place before the statement if it has none."""
        if isinstance(node, ast.IfExp):
            test = self.truth(node.test)
            return f"({test.operand()} ? {self.address(node.body)} : {self.address(node.orelse)})"
        found = self.value(node)
        if found.pointer:
            return found.place
        if found.place:
            return f"&{found.place}"
        if found.c.startswith("(") and "){" in found.c:
            return f"&{found.c}"  # a compound literal has the lifetime of the block
        assert isinstance(node, ast.Call)
        name = self.scope.temporary(node, ast.unparse(node.func), found.kind, found.c)
        return f"&{name}"

    # -- constants and names

    def _constant(self, node: ast.Constant) -> Value:
        number = node.value
        if isinstance(number, bool):
            return Value("true" if number else "false", BOOL)
        if isinstance(number, int):
            return Value(str(number), INT, exact=number)
        if number is None:
            return Value(NEVER, TIME)
        if isinstance(number, float):
            return Value(literal(number), REAL, exact=number)
        raise self.scope.refused(node, f"the constant {number!r}")

    def _name(self, node: ast.Name) -> Value:
        local = self.scope.locals.get(node.id)
        if local is None:
            return self._global(node, node.id, self._globals)
        if isinstance(local.kind, Array):
            return Value(local.c, local.kind, place=local.c, pointer=local.pointer, root=node.id)
        if local.pointer:
            return Value(f"*{local.c}", local.kind, place=local.c, pointer=True, atom=False)
        return Value(local.c, local.kind, place=local.c)

    def _global(self, node: ast.expr, name: str, names: Mapping[str, Any]) -> Value:
        if name not in names:
            raise self.scope.refused(node, f"the name {name}")
        return self._known(node, name, names[name], names["__name__"])

    def _known(self, node: ast.expr, name: str, thing: Any, module: str) -> Value:
        """A constant of a module."""
        program = self.scope.program
        if isinstance(thing, bool):
            return Value("true" if thing else "false", BOOL)
        if isinstance(thing, int):
            return Value(program.needs_constant(module, name, thing), INT, exact=int(thing))
        if isinstance(thing, float):
            if not math.isfinite(thing):
                return Value(literal(thing), REAL, exact=thing)
            c = program.needs_constant(module, name, thing)
            return Value(c, REAL, exact=thing)
        if is_record(type(thing)):
            place = program.needs_constant(module, name, thing)
            return Value(place, Record(type(thing)), place=place)
        raise self.scope.refused(node, f"{name} is no number, record or function")

    def _attribute(self, node: ast.Attribute) -> Value:
        thing = self._python(node)
        if thing is not None:
            owner = self._python(node.value)
            # module.NAME: the constant keeps its module's name, so that two modules may have the same one
            if isinstance(owner, types.ModuleType):
                return self._known(node, node.attr, thing, owner.__name__)
            if isinstance(thing, int):  # a member of an enumeration
                assert isinstance(owner, type)
                c = self.scope.program.needs_constant(
                    owner.__module__, f"{owner.__name__}_{node.attr}", int(thing)
                )
                return Value(c, INT, exact=int(thing))
        owner_value = self.value(node.value)
        if isinstance(owner_value.kind, Array) and node.attr == "size":
            return size_of(owner_value.kind.shape)
        if not isinstance(owner_value.kind, Record):
            raise self.scope.refused(node, f"an attribute of {owner_value.kind}")
        kind = fields_of(owner_value.kind.python).get(node.attr)
        if kind is None:
            raise self.scope.refused(
                node, f"{owner_value.kind.python.__name__} has no field {node.attr} of a known kind"
            )
        text = owner_value.field(local_name(node.attr))
        # a field of a call's result has no address of its own
        has_place = bool(owner_value.place)
        return Value(text, kind, place=text if has_place else "")

    def _python(self, node: ast.expr) -> Any:
        """The live Python object that a name outside of the function stands for, else None."""
        if isinstance(node, ast.Name):
            if node.id in self.scope.locals:
                return None
            return self._globals.get(node.id, getattr(builtins, node.id, None))
        if isinstance(node, ast.Attribute):
            owner = self._python(node.value)
            return None if owner is None else getattr(owner, node.attr, None)
        return None

    def _subscript(self, node: ast.Subscript) -> Value:
        at = node.slice
        if isinstance(node.value, ast.Attribute) and node.value.attr == "shape":
            kind = self.value(node.value.value).kind
            which = at.value if isinstance(at, ast.Constant) else None
            if isinstance(kind, Array) and isinstance(which, int) and 0 <= which < len(kind.shape):
                return size_of(kind.shape[which : which + 1])
        owner = self.value(node.value)
        if isinstance(owner.kind, Array):
            found = self.element(node, owner)
            if not isinstance(found.kind, Array):
                self.scope.reads.add(self.scope.memory(owner.root))
            return found
        if not isinstance(at, ast.Constant) or not isinstance(at.value, int) or at.value < 0:
            raise self.scope.refused(node, "an index that is no constant")
        if isinstance(owner.kind, Group) and at.value < len(owner.kind.items):
            return Value(owner.field(f"item{at.value}"), owner.kind.items[at.value])
        raise self.scope.refused(node, f"an index into {owner.kind}")

    def element(self, node: ast.Subscript, owner: Value) -> Value:
        """A number of an array, or a row of it."""
        assert isinstance(owner.kind, Array)
        indices = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        if len(indices) > len(owner.kind.shape) or any(isinstance(each, ast.Slice) for each in indices):
            raise self.scope.refused(node, f"the part {ast.unparse(node)} of an array")
        found = [self.value(each) for each in indices]
        for index, most in zip(found, owner.kind.shape, strict=False):
            # Python counts from the end with a negative one
            if index.kind != INT or (index.exact is not None and not 0 <= index.exact < most):
                raise self.scope.refused(
                    node, f"{ast.unparse(node)}: an index is an integer from 0 to {most - 1}"
                )
        return place_in(owner, [index.c for index in found])

    def _tuple(self, node: ast.Tuple) -> Value:
        items = [self.value(item) for item in node.elts]
        group = Group(tuple(item.kind for item in items))
        name = self.scope.program.needs_kind(group)
        return Value(f"({name}){{{', '.join(item.c for item in items)}}}", group)

    # -- operators

    def _binop(self, node: ast.BinOp) -> Value:
        left, right = self.value(node.left), self.value(node.right)
        for side, value in ((node.left, left), (node.right, right)):
            if value.kind not in NUMBERS:
                raise self.scope.refused(side, f"arithmetic with {value.kind}")
        if isinstance(node.op, ast.Div):
            return self._division(node, self.converted(left, REAL, node), self.converted(right, REAL, node))
        if isinstance(node.op, ast.Pow):
            return self._power(node, left, right)
        if isinstance(node.op, ast.Mod):
            # with a negative divisor the remainders of C and Python have different signs
            if left.kind != INT or not isinstance(right.exact, int) or right.exact <= 0:
                raise self.scope.refused(node, "a remainder that is not integer % positive constant")
            return Value(f"modulo({left.c}, {right.c})", INT)
        if isinstance(node.op, (ast.BitOr, ast.BitAnd)) and left.kind == right.kind == BOOL:
            # both sides are computed in Python: the second one first and always, the first one is a name
            if not isinstance(node.left, ast.Name):
                raise self.scope.refused(node, "| or & of truth values behind more than a name")
            sign = "||" if isinstance(node.op, ast.BitOr) else "&&"
            return Value(f"{right.operand()} {sign} {left.operand()}", BOOL, atom=False)
        operator = _ARITHMETIC.get(type(node.op))
        if operator is None:
            raise self.scope.refused(node, f"the operator {type(node.op).__name__}")
        # Python widens integers to real numbers; times in nanoseconds need 64 bits
        kind = next((k for k in (REAL, TIME) if k in (left.kind, right.kind)), INT)
        left, right = self.converted(left, kind, node), self.converted(right, kind, node)
        # a + b + c and a * b * c need no parentheses in C: the order is Python's, from the left
        chained = (
            isinstance(node.left, ast.BinOp) and isinstance(node.left.op, type(node.op)) and operator in "+*"
        )
        first = left.c if chained and not self.scope.program.perturbed else left.operand()
        return self._rounded(f"{first} {operator} {right.operand()}", kind)

    def _power(self, node: ast.BinOp, left: Value, right: Value) -> Value:
        """2.0 ** integer, which is exact everywhere, or real ** real between 0 and 1, such as a root."""
        if left.exact == 2 and right.kind == INT:
            return Value(f"real_ldexp(R(1.0), {right.c})", REAL)
        root = _number(node.right, self._globals)
        # of a negative number Python makes a complex one, numba and C none; another exponent may leave the range of numbers
        if left.kind != REAL or right.kind != REAL or root is None or not 0.0 < root < 1.0:
            raise self.scope.refused(
                node, "a power that is neither 2.0 ** integer nor a root: write the product or the root"
            )
        return self._rounded(f"real_pow({left.c}, {right.c})", REAL)

    def _rounded(self, text: str, kind: Kind) -> Value:
        """The result of an operation, which the perturbed build changes by the rounding of single precision."""
        if kind == REAL and self.scope.program.perturbed:
            return Value(f"PERTURBED({text})", kind)
        return Value(text, kind, atom=False)

    def _division(self, node: ast.BinOp, left: Value, right: Value) -> Value:
        if right.exact is not None:
            # found here rather than in the vehicle
            if right.exact == 0:
                raise self.scope.refused(node, "a division by zero")
            return self._rounded(f"{left.operand()} / {right.operand()}", REAL)
        text = f"divided({left.c}, {right.c})"
        return Value(f"PERTURBED({text})" if self.scope.program.perturbed else text, REAL)

    def _unaryop(self, node: ast.UnaryOp) -> Value:
        if isinstance(node.op, ast.Not):
            return Value(f"!{self.truth(node.operand).operand()}", BOOL)
        found = self.value(node.operand)
        if not isinstance(node.op, ast.USub) or found.kind not in (REAL, INT):
            raise self.scope.refused(node, f"the operator {type(node.op).__name__}")
        exact = None if found.exact is None else -found.exact
        return Value(f"-{found.operand()}", found.kind, atom=False, exact=exact)

    def _boolop(self, node: ast.BoolOp) -> Value:
        sign = " && " if isinstance(node.op, ast.And) else " || "
        # The first operand is always evaluated, the others perhaps not: what they need must not be computed before the statement.
        parts = [self.truth(node.values[0]).operand()]
        self.scope.conditional += 1
        parts += [self.truth(value).operand() for value in node.values[1:]]
        self.scope.conditional -= 1
        return Value(sign.join(parts), BOOL, atom=False)

    def _compare(self, node: ast.Compare) -> Value:
        left, parts = node.left, []
        for op, right in zip(node.ops, node.comparators, strict=True):
            if isinstance(op, ast.In) and isinstance(right, ast.Tuple):
                parts.append(self._among(node, left, right))
            else:
                parts.append(self._pair(node, left, op, right))
            left = right
        if len(parts) == 1:
            return Value(parts[0], BOOL, atom=False)
        return Value(" && ".join(f"({part})" for part in parts), BOOL, atom=False)

    def _pair(self, node: ast.Compare, left: ast.expr, op: ast.cmpop, right: ast.expr) -> str:
        a, b = self.value(left), self.value(right)
        sign = _COMPARISONS.get(type(op))
        if sign is None or a.kind not in NUMBERS or b.kind not in NUMBERS:
            raise self.scope.refused(node, f"the comparison {ast.unparse(node)}")
        # C would convert by its own rules, a signed 64-bit time to float among them
        if a.kind != b.kind:
            common = TIME if TIME in (a.kind, b.kind) else REAL
            a, b = self.converted(a, common, node), self.converted(b, common, node)
        return f"{a.operand()} {sign} {b.operand()}"

    def _among(self, node: ast.Compare, left: ast.expr, right: ast.Tuple) -> str:
        pairs = [self._pair(node, left, ast.Eq(), item) for item in right.elts]
        return " || ".join(f"({pair})" for pair in pairs)

    def _ifexp(self, node: ast.IfExp) -> Value:
        test = self.truth(node.test)
        self.scope.conditional += 1
        yes, no = self.value(node.body), self.value(node.orelse)
        self.scope.conditional -= 1
        if yes.kind != no.kind:
            yes, no = self.converted(yes, REAL, node), self.converted(no, REAL, node)
        return Value(f"{test.operand()} ? {yes.operand()} : {no.operand()}", yes.kind, atom=False)

    # -- calls

    def _call(self, node: ast.Call) -> Value:
        if (fresh := fresh_array(node, self._python(node.func), self.value)) is not None:
            return fresh
        thing = self._python(node.func)
        if thing is None:
            raise self.scope.refused(node, f"a call of {ast.unparse(node.func)}")
        if any(isinstance(argument, ast.Starred) for argument in node.args):
            raise self.scope.refused(node, "arguments with a star")
        if is_record(thing):
            return self.record(node, thing)
        name = str(getattr(thing, "__name__", ""))
        if getattr(math, name, None) is thing:
            return self._mathematics(node, name)
        if getattr(builtins, name, None) is thing:
            return self._builtin(node, name)
        return self._function(node, thing)

    def record(self, node: ast.Call, record: type) -> Value:
        """A record made from its fields, as a compound literal that names them."""
        fields = fields_of(record)
        given = dict(zip(fields, node.args, strict=False)) | {k.arg: k.value for k in node.keywords if k.arg}
        defaults = defaults_of(record)
        missing = fields.keys() - given.keys() - defaults.keys()
        if missing or len(node.args) > len(fields):
            raise self.scope.refused(node, f"{record.__name__} without {', '.join(sorted(missing))}")
        parts = []
        for name, kind in fields.items():
            if kind is None:
                raise self.scope.refused(node, f"{record.__name__}.{name} is of no known kind")
            text = self.as_kind(given[name], kind) if name in given else initialiser(defaults[name])
            parts.append(f".{local_name(name)} = {text}")
        c = self.scope.program.needs_kind(Record(record))
        return Value(f"({c}){{{', '.join(parts)}}}", Record(record))

    def _mathematics(self, node: ast.Call, name: str) -> Value:
        # only what newlib and glibc both have in single precision
        if name not in MATH or len(node.args) != MATH[name]:
            raise self.scope.refused(node, f"math.{name}")
        arguments = ", ".join(self.as_kind(argument, REAL) for argument in node.args)
        text = f"real_{name}({arguments})"
        # copysign rounds nothing, so there is nothing to perturb
        exact = name == "copysign" or not self.scope.program.perturbed
        return Value(text if exact else f"PERTURBED({text})", REAL)

    def _builtin(self, node: ast.Call, name: str) -> Value:
        if name not in _BUILTINS or node.keywords:
            raise self.scope.refused(node, f"{name}()")
        values = [self.value(argument) for argument in node.args]
        if name == "int":
            if values[0].kind != REAL:
                raise self.scope.refused(node, "int() of what is no real number")
            return Value(f"real_whole({values[0].c})", INT)
        if name == "float":
            return self.converted(values[0], REAL, node)
        kind = INT if all(value.kind == INT for value in values) else REAL
        texts = [self.converted(value, kind, node).c for value in values]
        word = "real" if kind == REAL else "int"
        if name == "abs":
            return Value(f"{word}_abs({texts[0]})", kind)
        if name == "bool" or len(texts) < 2:
            raise self.scope.refused(node, f"{name}() of {len(texts)} argument")
        # min and max of several: pairwise from the left, as Python compares them
        found = texts[0]
        for text in texts[1:]:
            found = f"{word}_{name}({found}, {text})"
        return Value(found, kind)

    def _function(self, node: ast.Call, thing: Any) -> Value:
        def error(what: str) -> Exception:
            return self.scope.refused(node, what)

        function = getattr(thing, "py_func", thing)
        names = inspect.signature(function).parameters if inspect.isfunction(function) else ()
        given = dict(zip(names, node.args, strict=False))
        given |= {k.arg: k.value for k in node.keywords if k.arg}
        arrays = {name: kind for name, each in given.items() if (kind := self._array(each)) is not None}
        signature = self.scope.program.needs_function(function, error, arrays)
        if given.keys() != {p for p, _ in signature.parameters}:
            expected = ", ".join(p for p, _ in signature.parameters)
            raise self.scope.refused(node, f"a call of {signature.name} with other arguments than {expected}")
        before = set(self.scope.reads)
        texts = [
            self._argument(given[p], kind, written=p in signature.written) for p, kind in signature.parameters
        ]
        memory = {name: self.scope.memory(self.value(given[name]).root) for name in arrays}
        changed = {memory[name] for name in signature.written}
        if any(name not in signature.written and memory[name] in changed for name in memory) or (
            len(changed) < len(signature.written)
        ):
            raise self.scope.refused(
                node, f"one array as two arguments of {signature.name}, which changes it"
            )
        if changed:
            # what the arguments read is read before the call, in C as well
            self.scope.reads = before
            self.scope.changes.append(changed)
        else:
            self.scope.reads |= set(memory.values())
        return Value(f"{signature.name}({', '.join(texts)})", signature.result)

    def _array(self, node: ast.expr) -> Array | None:
        """The kind of an array's name or row; None of anything else."""
        name = node.value if isinstance(node, ast.Subscript) else node
        local = self.scope.locals.get(name.id) if isinstance(name, ast.Name) else None
        if local is None or not isinstance(local.kind, Array):
            return None
        before = set(self.scope.reads)
        kind = self.value(node).kind
        # the text is not used here, so nothing has been read yet
        self.scope.reads = before
        return kind if isinstance(kind, Array) else None

    def _argument(self, node: ast.expr, kind: Kind, *, written: bool) -> str:
        """An argument of a call: a number, or a pointer to a record or an array. written: whether the function changes it."""
        if not isinstance(kind, Array):
            return self.address(node) if isinstance(kind, (Record, Group)) else self.as_kind(node, kind)
        found = self.converted(self.value(node), kind, node)
        if written:
            self.scope.writes(found.root)
        return f"&{found.c}" if len(kind.shape) == 2 and not found.pointer else found.c


def _number(node: ast.expr, names: Mapping[str, Any]) -> float | None:
    """The value of an expression of constants; None of any other."""
    try:
        found = eval(compile(ast.Expression(node), "", "eval"), {**names, "__builtins__": {}})
    except (NameError, TypeError, ArithmeticError):
        return None
    return float(found) if isinstance(found, (int, float)) else None
