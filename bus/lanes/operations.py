"""Operations on values that hold one number for each lane, as instructions for the compiler (LLVM).

An operation whose result is known is not written down: numbers of Python stay numbers. What is added to zero or multiplied by zero or one is left out, so
that the zeros of an inertia cost nothing; infinities times zero are then zero, which the law of the text does not meet.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum, auto
from typing import Any, Final

import numpy as np
from llvmlite import ir

LANES: Final = 4
"""Machines side by side: the doubles of one vector of the processors that code is made for (bus.machine_code). Eight of them, two vectors
for each value, took 11 to 30 % longer per machine: there are not enough registers."""

DOUBLE: Final = ir.DoubleType()
TRUTH: Final = ir.IntType(1)
INDEX: Final = ir.IntType(64)
DOUBLES: Final = ir.VectorType(DOUBLE, LANES)
TRUTHS: Final = ir.VectorType(TRUTH, LANES)
INDICES: Final = ir.VectorType(INDEX, LANES)
ROUNDED_ONCE: Final = ("contract", "arcp")
"""A product and a sum may become one instruction, and several quotients of one divisor products with its inverse. Both change the last bit, and
took a fifth off a step of the plant."""
EXPONENT_BIAS: Final = 1023  # of a double
MANTISSA_BITS: Final = 52


class Kind(Enum):
    """What a value holds."""

    NUMBERS = auto()  # a number for each lane
    TRUTHS = auto()  # true or false for each lane
    NUMBER = auto()  # a number that is the same in all lanes
    TRUTH = auto()  # true or false, the same in all lanes


@dataclass(frozen=True, slots=True, eq=False)
class Value:
    """A value that is known when the code runs."""

    code: Any
    kind: Kind

    @property
    def is_number(self) -> bool:
        """Whether it holds numbers, and not truths."""
        return self.kind in (Kind.NUMBERS, Kind.NUMBER)

    @property
    def is_same(self) -> bool:
        """Whether it is the same in all lanes."""
        return self.kind in (Kind.NUMBER, Kind.TRUTH)


Operand = Value | float | int | bool

COMPARED: Final[dict[str, Callable[[Any, Any], bool]]] = {
    "<": lambda a, b: a < b,
    "<=": lambda a, b: a <= b,
    ">": lambda a, b: a > b,
    ">=": lambda a, b: a >= b,
    "==": lambda a, b: a == b,
    "!=": lambda a, b: a != b,
}


def is_number(operand: Operand, value: float) -> bool:
    """Whether an operand is this number of Python."""
    return not isinstance(operand, (Value, bool)) and operand == value


def is_truth(operand: Operand) -> bool:
    """Whether an operand is true or false, and not a number."""
    return not operand.is_number if isinstance(operand, Value) else isinstance(operand, bool)


class Operations:
    """Writes operations at the place of `builder`, and each of them once."""

    def __init__(self, builder: Any) -> None:
        self.builder = builder
        self._known: dict[tuple[Any, ...], tuple[Value, tuple[Operand, ...]]] = {}

    def scope(self) -> dict[tuple[Any, ...], tuple[Value, tuple[Operand, ...]]]:
        """What has been computed so far; `restore` forgets what was computed since, which a branch may have left out."""
        return dict(self._known)

    def restore(self, known: dict[tuple[Any, ...], tuple[Value, tuple[Operand, ...]]]) -> None:
        """Forget what was computed since `scope`."""
        self._known = known

    # ---- forms of a value

    def numbers(self, operand: Operand) -> Any:
        """The operand as a vector of numbers."""
        if not isinstance(operand, Value):
            return ir.Constant(DOUBLES, [float(operand)] * LANES)
        assert operand.is_number
        return self._in_all_lanes(operand) if operand.is_same else operand.code

    def truths(self, operand: Operand) -> Any:
        """The operand as a vector of truths."""
        if not isinstance(operand, Value):
            return ir.Constant(TRUTHS, [int(bool(operand))] * LANES)
        assert not operand.is_number
        return self._in_all_lanes(operand) if operand.is_same else operand.code

    def form(self, operand: Operand, kind: Kind) -> Any:
        """The operand as code of a kind."""
        if kind is Kind.NUMBERS:
            return self.numbers(operand)
        if kind is Kind.TRUTHS:
            return self.truths(operand)
        if isinstance(operand, Value):
            assert operand.kind is kind
            return operand.code
        if kind is Kind.NUMBER:
            return ir.Constant(DOUBLE, float(operand))
        return ir.Constant(TRUTH, int(bool(operand)))

    def _in_all_lanes(self, value: Value) -> Any:
        kind = DOUBLES if value.is_number else TRUTHS
        return self._once(
            ("in all lanes", id(value.code)),
            (value,),
            Kind.NUMBERS if value.is_number else Kind.TRUTHS,
            lambda: self._filled(kind, value.code),
        ).code

    def _filled(self, kind: Any, code: Any) -> Any:
        b = self.builder
        one = b.insert_element(ir.Constant(kind, ir.Undefined), code, ir.Constant(INDEX, 0))
        order = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
        return b.shuffle_vector(one, ir.Constant(kind, ir.Undefined), order)

    def _once(
        self, key: tuple[Any, ...], operands: tuple[Operand, ...], kind: Kind, make: Callable[[], Any]
    ) -> Value:
        if key not in self._known:
            self._known[key] = Value(make(), kind), operands  # operands are kept, so that no id is used twice
        return self._known[key][0]

    def _key(self, name: str, operands: Sequence[Operand]) -> tuple[Any, ...]:
        return (
            name,
            *(("v", id(x.code)) if isinstance(x, Value) else (type(x).__name__, repr(x)) for x in operands),
        )

    def _numeric(self, name: str, *operands: Operand) -> Value:
        """An arithmetic instruction on vectors of numbers."""

        def make() -> Any:
            return getattr(self.builder, name)(*map(self.numbers, operands), flags=ROUNDED_ONCE)

        return self._once(self._key(name, operands), operands, Kind.NUMBERS, make)

    # ---- arithmetic

    def add(self, a: Operand, b: Operand) -> Operand:
        """a + b."""
        if not isinstance(a, Value) and not isinstance(b, Value):
            return a + b
        if is_number(a, 0.0):
            return b
        return a if is_number(b, 0.0) else self._numeric("fadd", a, b)

    def subtract(self, a: Operand, b: Operand) -> Operand:
        """a - b."""
        if not isinstance(a, Value) and not isinstance(b, Value):
            return a - b
        if is_number(b, 0.0):
            return a
        return self.negative(b) if is_number(a, 0.0) else self._numeric("fsub", a, b)

    def multiply(self, a: Operand, b: Operand) -> Operand:
        """a * b."""
        if not isinstance(a, Value) and not isinstance(b, Value):
            return a * b
        for known, other in ((a, b), (b, a)):
            if is_number(known, 0.0):
                return 0.0
            if is_number(known, 1.0):
                return other
            if is_number(known, -1.0):
                return self.negative(other)
        return self._numeric("fmul", a, b)

    def divide(self, a: Operand, b: Operand) -> Operand:
        """a / b; over zero infinite or not a number, as code that numba compiles for the plant has it."""
        if not isinstance(a, Value) and not isinstance(b, Value):
            with np.errstate(divide="ignore", invalid="ignore"):
                return float(np.float64(a) / np.float64(b))
        if is_number(a, 0.0):
            return 0.0
        return a if is_number(b, 1.0) else self._numeric("fdiv", a, b)

    def negative(self, a: Operand) -> Operand:
        """-a."""
        if not isinstance(a, Value):
            return -a
        return self._once(
            self._key("fneg", (a,)), (a,), Kind.NUMBERS, lambda: self.builder.fneg(self.numbers(a))
        )

    def vector_function(self, name: str, *operands: Operand) -> Value:
        """A function that LLVM knows for vectors, such as sqrt."""

        def make() -> Any:
            return self.builder.call(self._declared(f"llvm.{name}.v{LANES}f64", DOUBLES, len(operands)),
                                     [*map(self.numbers, operands)])  # fmt: skip

        return self._once(self._key(name, operands), operands, Kind.NUMBERS, make)

    def lane_by_lane(self, name: str, *operands: Operand) -> Value:
        """A function of the C library, called for each lane."""

        def make() -> Any:
            b, function = self.builder, self._declared(name, DOUBLE, len(operands))
            vectors = [*map(self.numbers, operands)]
            found = ir.Constant(DOUBLES, ir.Undefined)
            for lane in range(LANES):
                at = ir.Constant(INDEX, lane)
                one = b.call(function, [b.extract_element(vector, at) for vector in vectors])
                found = b.insert_element(found, one, at)
            return found

        return self._once(self._key(f"libm {name}", operands), operands, Kind.NUMBERS, make)

    def power_of_two(self, exponent: Operand) -> Value:
        """2 to the power of a whole number that a normal double can hold."""

        def make() -> Any:
            b = self.builder
            whole = b.fptosi(self.numbers(exponent), INDICES)
            biased = b.add(whole, ir.Constant(INDICES, [EXPONENT_BIAS] * LANES))
            return b.bitcast(b.shl(biased, ir.Constant(INDICES, [MANTISSA_BITS] * LANES)), DOUBLES)

        return self._once(self._key("power of two", (exponent,)), (exponent,), Kind.NUMBERS, make)

    def _declared(self, name: str, kind: Any, count: int) -> Any:
        module = self.builder.module
        found = module.globals.get(name)
        return found or ir.Function(module, ir.FunctionType(kind, [kind] * count), name)

    # ---- comparison and choice

    def compare(self, sign: str, a: Operand, b: Operand) -> Operand:
        """a < b and the like; false where either is not a number, but for !=."""
        if not isinstance(a, Value) and not isinstance(b, Value):
            return COMPARED[sign](a, b)
        if is_truth(a) or is_truth(b):
            assert sign in ("==", "!=")
            other = self.either(self.both(a, self.opposite(b)), self.both(self.opposite(a), b))
            return other if sign == "!=" else self.opposite(other)
        write = self.builder.fcmp_unordered if sign == "!=" else self.builder.fcmp_ordered
        same = all(x.is_same for x in (a, b) if isinstance(x, Value))
        kind, form = (Kind.TRUTH, Kind.NUMBER) if same else (Kind.TRUTHS, Kind.NUMBERS)
        return self._once(
            self._key(sign, (a, b)), (a, b), kind, lambda: write(sign, self.form(a, form), self.form(b, form))
        )

    def both(self, a: Operand, b: Operand) -> Operand:
        """Whether both are true."""
        if a is False or b is False:
            return False
        if a is True:
            return b
        return a if b is True else self._logical("and_", a, b)

    def either(self, a: Operand, b: Operand) -> Operand:
        """Whether one of them is true."""
        if a is True or b is True:
            return True
        if a is False:
            return b
        return a if b is False else self._logical("or_", a, b)

    def opposite(self, a: Operand) -> Operand:
        """Whether it is false."""
        return self._logical("xor", a, True) if isinstance(a, Value) else not a

    def _logical(self, name: str, a: Operand, b: Operand) -> Value:
        same = all(x.is_same for x in (a, b) if isinstance(x, Value))
        kind = Kind.TRUTH if same else Kind.TRUTHS
        return self._once(
            self._key(name, (a, b)),
            (a, b),
            kind,
            lambda: getattr(self.builder, name)(self.form(a, kind), self.form(b, kind)),
        )

    def choose(self, condition: Operand, a: Operand, b: Operand) -> Operand:
        """a where the condition holds, else b."""
        if not isinstance(condition, Value):
            return a if condition else b
        if a is b or (not isinstance(a, Value) and not isinstance(b, Value) and repr(a) == repr(b)):
            return a
        if is_truth(a) or is_truth(b):
            return self.either(self.both(condition, a), self.both(self.opposite(condition), b))
        return self._once(
            self._key("select", (condition, a, b)),
            (condition, a, b),
            Kind.NUMBERS,
            lambda: self.builder.select(self.truths(condition), self.numbers(a), self.numbers(b)),
        )

    def least(self, a: Operand, b: Operand) -> Operand:
        """min(a, b) as Python has it."""
        return self.choose(self.compare("<", b, a), b, a)

    def greatest(self, a: Operand, b: Operand) -> Operand:
        """max(a, b) as Python has it."""
        return self.choose(self.compare(">", b, a), b, a)
