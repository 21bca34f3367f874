"""A function for several machines at once, to be called from code that numba compiles."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from bus.lanes.operations import DOUBLE, DOUBLES, INDEX, LANES, Kind, Operations, Value
from bus.lanes.reader import NotForLanesError, Reader

Array = np.ndarray[Any, Any]

unpacked: Any = cgutils.unpack_tuple
BITS = ir.IntType(LANES)


@dataclass(frozen=True, slots=True)
class Lanes:
    """An argument of the kernel: an array (count, LANES), which the function sees as one of `count` values."""

    count: int
    written: bool = False
    seen: int | None = None
    """How many values the function sees; those beyond `count` are zero. None: `count`."""


@dataclass(frozen=True, slots=True)
class Same:
    """An argument of the kernel: an array (count,) of numbers that are the same in all lanes."""

    count: int


@dataclass(frozen=True, slots=True)
class Joined:
    """Two arguments of the kernel that the function sees as one array: first what is the same in all lanes, then what is not."""

    same: int
    lanes: int


@dataclass(frozen=True, slots=True)
class Fixed:
    """An argument of the function that the kernel does not have: work arrays, and what is known beforehand."""

    make: Callable[[], Any]
    """Makes it anew."""
    arrays: Callable[[Any], list[Array]] = field(default=lambda _: [])
    """The work arrays in what `make` has made."""


Argument = Lanes | Same | Joined | Fixed


def values_of(array: Array) -> Array:
    """An array of numbers as an array whose places can hold values of lanes."""
    found = np.empty(array.shape, object)
    for place, number in np.ndenumerate(array):
        found[place] = float(number)
    return found


def kernel(
    name: str, function: Callable[..., None], arguments: Sequence[Argument], rare: Collection[Any] = ()
) -> Any:
    """An intrinsic of numba that does what `function` says for LANES machines.

    It takes a tuple of the arrays of `arguments`, all contiguous, and returns the lanes that came to a call of a `rare` function, as bits of a whole number; in
    these nothing is changed. Errors, when it is compiled: NotForLanesError.
    """

    def made(context: Any, given: Any) -> Any:
        def code(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            arrays = zip(signature.args[0], unpacked(builder, values[0]), strict=True)
            pointers = [context.make_array(kind)(context, builder, value).data for kind, value in arrays]
            module = builder.module
            if name not in module.globals:
                _write(module, name, function, arguments, rare, len(pointers))
            return builder.call(module.globals[name], pointers)

        return types.int64(given), code

    return intrinsic(made)


def is_readable(function: Callable[..., None], arguments: Sequence[Argument]) -> bool:
    """Whether a kernel can be made of a function."""
    try:
        _write(ir.Module(), "trial", function, arguments, (), len(arguments))
    except NotForLanesError:
        return False
    return True


def _write(
    module: Any,
    name: str,
    function: Callable[..., None],
    arguments: Sequence[Argument],
    rare: Collection[Any],
    count: int,
) -> None:
    """Write the function of LLVM into `module`."""
    made = ir.Function(module, ir.FunctionType(INDEX, [DOUBLE.as_pointer()] * count), name)
    made.linkage = "internal"
    made.attributes.add("noinline")
    for argument in made.args:
        argument.attributes.add("noalias")
    builder = ir.IRBuilder(made.append_basic_block())
    operations = Operations(builder)
    pointers = iter(made.args)
    seen: list[Any] = []
    written: list[tuple[Any, int, list[Value]]] = []
    arrays: list[Array] = []
    cells: list[Array] = []
    for argument in arguments:
        if isinstance(argument, Fixed):
            seen.append(argument.make())
            cells += argument.arrays(seen[-1])
            continue
        own = []
        if isinstance(argument, (Same, Joined)):
            pointer = next(pointers)
            size = argument.count if isinstance(argument, Same) else argument.same
            own += [Value(_loaded(builder, pointer, i), Kind.NUMBER) for i in range(size)]
        if isinstance(argument, (Lanes, Joined)):
            pointer = builder.bitcast(next(pointers), DOUBLES.as_pointer())
            size = argument.count if isinstance(argument, Lanes) else argument.lanes
            own += [Value(_loaded(builder, pointer, i), Kind.NUMBERS) for i in range(size)]
            if isinstance(argument, Lanes) and argument.written:
                written.append((pointer, len(arrays), list(own)))
        more = argument.seen - len(own) if isinstance(argument, Lanes) and argument.seen is not None else 0
        array = np.empty(len(own) + more, object)
        array[:] = own + [0.0] * more
        arrays.append(array)
        seen.append(array)
    reader = Reader(operations, rare=rare, cells=[*arrays, *cells])
    reader.call(function, seen)
    out = operations.truths(reader.left_out)
    for pointer, at, before in written:
        for i, (old, new) in enumerate(zip(before, arrays[at], strict=False)):
            if new is not old:
                kept = operations.numbers(operations.choose(reader.left_out, old, new))
                builder.store(kept, builder.gep(pointer, [ir.Constant(INDEX, i)]), align=8)
    builder.ret(builder.zext(builder.bitcast(out, BITS), INDEX))


def _loaded(builder: Any, pointer: Any, at: int) -> Any:
    return builder.load(builder.gep(pointer, [ir.Constant(INDEX, at)]), align=8)
