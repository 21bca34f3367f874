"""Tuples of numbers as rows of arrays, for compiled code: how many numbers, and a row as a tuple."""

from typing import Any, Final

from numba.np.unsafe import ndarray as unsafe

from bus.machine_code import IN_PYTHON
from ecu.estimators.signals import Estimates, Inputs
from ecu.estimators.state import State

INPUTS: Final = len(Inputs._fields)
ESTIMATES: Final = len(Estimates._fields)
STATES: Final = len(State._fields)


def _first(row: Any, count: int) -> tuple[Any, ...]:
    return tuple(row[:count].tolist())


# numba's is an intrinsic, which Python cannot call; its annotations are those of its typing function
to_fixed_tuple: Any = _first if IN_PYTHON else unsafe.to_fixed_tuple
