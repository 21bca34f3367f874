"""One running instance of an FMU: started again and again with other values, stepped, read. Numbers are in the FMU's own units.

All calls go through FMPy's library object. The calls of every step go to its C functions directly, with arrays that are made once: FMPy's
own methods make new ones in every call, which takes longer than a small model computes.
"""

import ctypes
import math
import os
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fmi.archive import FmuError
from fmi.description import Description, Variable, Version, fmpy_or_refusal

Floats = NDArray[np.float64]

WARNING: Final = 1  # the worst status with which a call has done its work
FATAL: Final = 4  # after it no function of the instance may be called
STATUS: Final = ("ok", "warning", "discard", "error", "fatal", "pending")
KEPT: Final = 3  # of the FMU's last messages, in an error

C_TYPES: Final[Mapping[str, Any]] = {
    "Real": ctypes.c_double, "Float64": ctypes.c_double, "Float32": ctypes.c_float,
    "Integer": ctypes.c_int32, "Int8": ctypes.c_int8, "UInt8": ctypes.c_uint8, "Int16": ctypes.c_int16,
    "UInt16": ctypes.c_uint16, "Int32": ctypes.c_int32, "UInt32": ctypes.c_uint32, "Int64": ctypes.c_int64,
    "UInt64": ctypes.c_uint64,
}  # fmt: skip

_messages: deque[str] = deque(maxlen=KEPT)  # of the FMU that speaks; FMPy's proxy has one receiver a process


class StepError(FmuError, OverflowError):
    """The FMU failed at these values. To the engine of the diagnosis this is a model that diverges, as an OverflowError of Python is."""


class Group:
    """Variables of one type, got or set by one call. `columns` are their places among all variables of the exchange."""

    def __init__(
        self, function: Any, wide: bool, variables: Sequence[tuple[int, Variable]], kind: Any
    ) -> None:
        self.columns = [column for column, _ in variables]
        self.references = (ctypes.c_uint * len(variables))(*(v.reference for _, v in variables))
        self.values = (kind * len(variables))()
        self.whole = kind not in (ctypes.c_double, ctypes.c_float)  # integers and flags
        count = len(variables)
        # FMI 3 also gives the number of values
        self.arguments = (function, self.references, count, self.values, *((count,) if wide else ()))

    def call(self, component: Any) -> int:
        """Get or set `values`; returns the status."""
        function, *arguments = self.arguments
        return int(function(component, *arguments))


class Instance:
    """An FMU in memory. `start` makes it ready for a simulation; `close` releases it."""

    def __init__(
        self, description: Description, inputs: Sequence[Variable], outputs: Sequence[Variable]
    ) -> None:
        """inputs, outputs: what `step` sets and gets, in this order. Raises FmuError where the binary cannot be loaded."""
        self._of = description
        self._library = _loaded(description)
        self._inputs, self._outputs = self._groups("Set", inputs), self._groups("Get", outputs)
        self._can_reset = True
        self._used = False  # since it was instantiated
        self._step = self._step2 if description.version == 2 else self._step3
        self._flags = [ctypes.c_bool() for _ in range(3)], ctypes.c_double()
        self._instantiate()

    def start(self, values: Sequence[tuple[Variable, float]], inputs: Floats) -> None:
        """A simulation from time 0 with these start values and first inputs. Raises StepError if the FMU refuses them."""
        if self._used:
            self._reset()
        self._used = True
        library = self._library
        try:
            if self._of.version == 2:
                library.setupExperiment(startTime=0.0)
            for group, numbers in self._each("Set", values):
                self._put(group, numbers)
                self._check(group.call(library.component), "setting start values")
            if self._of.version == 2:
                library.enterInitializationMode()
            else:
                library.enterInitializationMode(startTime=0.0)
            self.set_inputs(inputs)
            library.exitInitializationMode()
        except FmuError:
            raise
        except Exception as error:  # FMPy's FMICallException, whose import would load FMPy
            raise StepError(f"{self._of.file.name}: fails in its initialization: {error}{said()}") from error

    def set_inputs(self, values: Floats) -> None:
        """Set all inputs (m,)."""
        for group in self._inputs:
            self._put(group, values[group.columns])
            self._check(group.call(self._library.component), "setting inputs")

    def get_outputs(self, into: Floats) -> None:
        """Write all outputs into an array (k,)."""
        for group in self._outputs:
            self._check(group.call(self._library.component), "reading outputs")
            into[group.columns] = group.values

    def step(self, time_s: float, step_s: float) -> None:
        """Advance. Raises StepError where the FMU fails or wants to end."""
        status = self._step(time_s, step_s)
        if status > WARNING:
            self._check(status, f"doStep fails at {time_s:.6g} s")

    def run(self, inputs: Floats, over: Floats | None, step_s: float, outputs: Floats) -> None:
        """Simulate n - 1 steps from the start. inputs (n, m) at the grid points; over (n, m): during the step after each, if that differs.

        outputs (n, k) are written at the grid points, with the inputs of that point.
        """
        count = len(inputs)
        given = self._rows(self._inputs, inputs)
        driving = given if over is None else self._rows(self._inputs, over)
        read = self._rows(self._outputs, outputs)
        step, check = self._step, self._check
        for i in range(count):
            # the first inputs have been set by the initialization
            if i > 0:
                check(given(i), "setting inputs")
            check(read(i), "reading outputs")
            if i + 1 < count:
                if over is not None:
                    check(driving(i), "setting inputs")
                if (status := step(i * step_s, step_s)) > WARNING:
                    check(status, f"doStep fails at {i * step_s:.6g} s")

    def _rows(self, groups: Sequence[Group], table: Floats) -> Callable[[int], int]:
        """A function that sets or gets one row of a table, and returns the status."""
        component = self._library.component
        if not groups:
            return lambda _: 0
        if len(groups) == 1 and groups[0].values._type_ is ctypes.c_double:
            # no copies: the FMU reads and writes the rows of the table themselves
            function, references, size, _, *tail = groups[0].arguments
            rows = (ctypes.c_double * size * len(table)).from_buffer(table)
            return lambda i: int(function(component, references, size, rows[i], *tail))
        if groups is self._inputs:

            def put(i: int) -> int:
                for group in groups:
                    self._put(group, table[i, group.columns])
                return max([int(group.call(component)) for group in groups])

            return put

        def read(i: int) -> int:
            status = max(group.call(component) for group in groups)
            for group in groups:
                table[i, group.columns] = group.values
            return status

        return read

    def get(self, variables: Sequence[Variable]) -> list[float]:
        """The values of any variables now."""
        found = [math.nan] * len(variables)
        for group in self._groups("Get", variables):
            self._check(group.call(self._library.component), "reading variables")
            for column, value in zip(group.columns, group.values, strict=True):
                found[column] = float(value)
        return found

    def renew(self) -> None:
        """From now on instantiate anew for every simulation: the FMU's reset does not bring it back to its start."""
        self._can_reset = False

    @property
    def resets(self) -> bool:
        """Whether simulations begin with the FMU's reset, and not with a new instance."""
        return self._can_reset

    def close(self) -> None:
        """Release the instance and its library."""
        self._free()
        self._library.freeLibrary()

    def _instantiate(self) -> None:
        _messages.clear()
        try:
            if self._of.version == 2:
                self._library.instantiate(callbacks=_callbacks2())
            else:
                self._library.instantiate(logMessage=_heard3)
        except Exception as error:
            self._library.component = None
            raise FmuError(f"{self._of.file}: cannot be instantiated{said()}") from error
        self._used = False

    def _free(self) -> None:
        library = self._library
        if library.component is not None:
            free = library.fmi2FreeInstance if self._of.version == 2 else library.fmi3FreeInstance
            free(library.component)
            library.component = None

    def _reset(self) -> None:
        """Back to the state before the first start."""
        _messages.clear()
        if self._can_reset and self._library.component is not None:
            try:
                self._library.reset()
                return
            except Exception:  # FMICallException: a status beyond warning
                self._can_reset = False
        self._free()
        self._instantiate()

    def _check(self, status: int, doing: str) -> None:
        if status <= WARNING:
            return
        if status == FATAL:
            self._library.component = None  # nothing may be called any more, not even free
        name = STATUS[status] if status < len(STATUS) else str(status)
        raise StepError(f"{self._of.file.name}: {doing} ({name}){said()}")

    def _step2(self, time_s: float, step_s: float) -> int:
        return int(self._library.dll.fmi2DoStep(self._library.component, time_s, step_s, 1))

    def _step3(self, time_s: float, step_s: float) -> int:
        (event, ends, early), last = self._flags
        status = int(
            self._library.dll.fmi3DoStep(
                self._library.component, time_s, step_s, True, event, ends, early, last
            )
        )
        if status <= WARNING and (ends.value or early.value):
            raise StepError(f"{self._of.file.name}: asks to end the simulation at {last.value:.6g} s{said()}")
        return status

    def _each(self, call: str, values: Sequence[tuple[Variable, float]]) -> list[tuple[Group, Floats]]:
        numbers = np.array([value for _, value in values], float)
        return [(g, numbers[g.columns]) for g in self._groups(call, [v for v, _ in values])]

    def _groups(self, call: str, variables: Sequence[Variable]) -> list[Group]:
        """The variables by type, each with the C function that gets or sets that type."""
        by_type: dict[str, list[tuple[int, Variable]]] = {}
        for column, variable in enumerate(variables):
            by_type.setdefault(_stored(variable.type, self._of.version), []).append((column, variable))
        version = self._of.version
        return [
            Group(
                getattr(self._library.dll, f"fmi{version}{call}{kind}"),
                version == 3,
                members,
                _c_type(kind, version),
            )
            for kind, members in by_type.items()
        ]

    @staticmethod
    def _put(group: Group, numbers: Floats) -> None:
        group.values[:] = [round(n) for n in numbers.tolist()] if group.whole else numbers.tolist()


def said() -> str:
    """': ' and the last messages of the FMU, or nothing."""
    return f": {'; '.join(_messages)}" if _messages else ""


def _stored(kind: str, version: Version) -> str:
    """The type by whose functions an enumeration is set."""
    return {2: "Integer", 3: "Int64"}[version] if kind == "Enumeration" else kind


def _c_type(kind: str, version: Version) -> Any:
    if kind == "Boolean":
        return ctypes.c_int if version == 2 else ctypes.c_bool
    return C_TYPES[kind]


def _loaded(description: Description) -> Any:
    """FMPy's object of the binary, not yet instantiated."""
    fmpy_or_refusal()
    if description.version == 2:
        from fmpy.fmi2 import FMU2Slave as Slave
    else:
        from fmpy.fmi3 import FMU3Slave as Slave
    # FMPy changes into the folder of the binary and stays there if loading fails
    here = Path.cwd()
    try:
        return Slave(
            guid=description.token,
            modelIdentifier=description.identifier,
            unzipDirectory=str(description.unpacked.folder),
            instanceName=description.identifier,
        )
    except Exception as error:
        first = str(error).splitlines()[0] if str(error) else type(error).__name__
        shown = first.replace(str(description.unpacked.folder), description.file.name)
        raise FmuError(f"{description.file}: its binary cannot be loaded: {shown}") from error
    finally:
        os.chdir(here)


def _heard2(_: Any, __: bytes, status: int, ___: bytes, message: bytes) -> None:
    _keep(status, message)


def _heard3(_: Any, status: int, __: bytes, message: bytes) -> None:
    _keep(status, message)


def _keep(status: int, message: bytes | None) -> None:
    """Keep a warning or an error of the FMU, on one line."""
    if status >= WARNING and message:
        _messages.append(" ".join(message.decode("utf-8", errors="replace").split()))


_made: list[Any] = []  # FMPy keeps no reference to callbacks that it is given; freed ones would be called


def _callbacks2() -> Any:
    """FMI 2 callbacks that keep messages, made once a process."""
    if not _made:
        from fmpy import calloc, fmi2, free
        from fmpy.logging import addLoggerProxy

        made = fmi2.fmi2CallbackFunctions()
        made.logger = fmi2.fmi2CallbackLoggerTYPE(_heard2)
        made.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(calloc)
        made.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(free)
        addLoggerProxy(ctypes.byref(made))  # formats C's variadic messages
        _made.append(made)
    return _made[0]
