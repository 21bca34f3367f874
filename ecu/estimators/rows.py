"""Tuples of numbers as rows of arrays, for compiled code: how many numbers, and a row as a tuple."""

from typing import Any, Final

from numba.np.unsafe import ndarray as unsafe

from ecu.estimators.signals import Estimates, Inputs
from ecu.estimators.state import State

INPUTS: Final = len(Inputs._fields)
ESTIMATES: Final = len(Estimates._fields)
STATES: Final = len(State._fields)

to_fixed_tuple: Any = unsafe.to_fixed_tuple  # an intrinsic; its annotations are those of its typing function
