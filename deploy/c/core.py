"""The exported C as a core of the bench: the same frames and findings as the Python ECU, in a fifth of its time."""

import _ctypes
import ctypes
import shutil
import struct
import tempfile
import weakref
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from bus.frame import Frame
from bus.machine_code import IN_PYTHON
from bus.rows import LAYOUT, SENT, Rows, columns_of, frames_of
from bus.user_error import UserError
from configuration import CheckedTable
from dbc import loader_database
from dbc.protection import Finding as Check
from deploy.c.detection_tables import machine_detection
from deploy.c.library import built, library
from deploy.c.offered import OfferedInC
from deploy.c.rules_tables import CHECKS, EVENTS, machine_rules
from deploy.c.tables import Received, inputs_of
from ecu.calibration import Calibration
from ecu.codes import Mode
from ecu.core import PYTHON, Core, Ecu, Form
from ecu.findings import (
    EstimatorFailed,
    FaultFound,
    Finding,
    Implausible,
    ProtectionFailed,
    Stale,
    StateChanged,
)
from ecu.inputs import EXCHANGED, FROZEN, GROUP_OF, REPORTED, WEIGHTLESS, Group, doubt
from ecu.measure.channel import Channel
from ecu.states import State

_FRAME: Final = struct.Struct("=IB8s3x")
"""EcuFrame of ecu.h, with the bytes that fill it up to its alignment."""
_FINDING: Final = struct.Struct("=4B4x2d")
"""EcuFinding of ecu.h: kind, subject, detail, other, value, value before."""
_PROTECTION_FAILED, _IMPLAUSIBLE, _STALE, _STATE_CHANGED, _ESTIMATOR_FAILED, _FAULT_FOUND = range(6)
"""EcuFindingKind of ecu.h."""
_BY_SENSOR, _BY_MESSAGE = 1, 2
_made = tuple.__new__


class NotInCError(UserError, ValueError):
    """The C core does not have what was asked for."""


class NotLoadedError(UserError, OSError):
    """The library is there and cannot be loaded."""


@dataclass(frozen=True, slots=True)
class Answer:
    """As `ecu.core.Answer`."""

    frames: list[Frame]
    findings: list[Finding]


class CEcu:
    """One ECU in C. As `ecu.core.Ecu`."""

    def __init__(self, calibration: Calibration, *, limits: bool, detect_faults: bool = False) -> None:
        self._calibration, self._limits, self._detect_faults = calibration, limits, detect_faults
        self._inputs = inputs_of(calibration)
        self._suspects: tuple[str, ...] = ()  # of a fault whose other signals are still to come
        self._load(library(calibration))

    def offer(
        self,
        table: CheckedTable,
        channels: tuple[Channel | None, Channel | None],
        secret: bytes | None,
        random: Callable[[int], bytes],
    ) -> OfferedInC:
        """XCP and UDS of this ECU, before its first frame. As `ecu.offered.services.OffersByItself`."""
        # a bench without tools neither builds nor loads the services
        self._load(library(self._calibration, table.values))
        return OfferedInC(self._c, channels, secret, random)

    def _load(self, file: Path) -> None:
        """Start as this library."""
        c = self._c = _own_copy(file)
        # the C has no ECU to hand around, its memory is static: each ECU is a library of its own, unloaded with it
        weakref.finalize(self, _ctypes.dlclose, c._handle)
        _set_machine(c, self._calibration)
        most_frames, most_findings, self._most_received = (
            ctypes.c_uint32.in_dll(c, f"library_most_{what}").value
            for what in ("frames", "findings", "received")
        )
        self._frames = ctypes.create_string_buffer(most_frames * _FRAME.size)
        self._made_rows = columns_of(np.frombuffer(memoryview(self._frames), SENT))
        self._table: NDArray[np.void] | None = None  # where frames came from as rows, and its address
        self._address = 0
        self._findings = (ctypes.c_char * (most_findings * _FINDING.size)).in_dll(c, "library_findings")
        self._finding_frames = (ctypes.c_uint8 * most_findings).in_dll(c, "library_finding_frames")
        self._count = ctypes.c_uint32.in_dll(c, "library_finding_count")
        self._cycle = c.library_cycle
        self._cycle.argtypes = (ctypes.c_void_p, ctypes.c_uint32, ctypes.c_int64, ctypes.c_void_p)
        self._cycle.restype = ctypes.c_uint8
        self._receive, self._tick = c.ecu_receive, c.ecu_tick
        self._receive.argtypes = (ctypes.c_uint32, ctypes.c_char_p, ctypes.c_uint8, ctypes.c_int64)
        self._receive.restype = None
        self._tick.argtypes, self._tick.restype = (ctypes.c_int64, ctypes.c_void_p), ctypes.c_uint8
        self._executed, self._overran, self._state = c.ecu_executed, c.ecu_overran, c.ecu_state
        self._executed.argtypes, self._overran.argtypes = (ctypes.c_int64,), (ctypes.c_uint32,)
        self._state.restype = ctypes.c_uint8
        c.ecu_init(ctypes.c_bool(self._limits))
        c.ecu_detect_faults(ctypes.c_bool(self._detect_faults))

    @property
    def state(self) -> State:
        """The state of the cycle."""
        return State(self._state())

    def warm_up(self) -> None:
        """Nothing compiles: the code was compiled before it was loaded."""

    def receive(self, frame: Frame, now_ns: int) -> Sequence[Finding]:
        """As `ecu.core.Ecu`."""
        data = frame.data
        self._receive(frame.can_id, data, len(data), now_ns)
        # nearly no frame has a finding: the count is asked for before anything is made
        return self._found(now_ns, data) if self._count.value else ()

    def tick(self, now_ns: int) -> Answer:
        """As `ecu.core.Ecu`."""
        count = self._tick(now_ns, self._frames)
        return Answer(self._made(count), self._found(now_ns) if self._count.value else [])

    def cycle_rows(self, received: NDArray[np.void], now_ns: int) -> tuple[Rows, int, Sequence[Finding]]:
        """Receive frames as rows (the first of a table of bus.rows.LAYOUT), each at its stamp, then tick, in one call of the library.

        Returns rows of answers, which the next call overwrites, how many they are, and findings.
        """
        if received.base is not self._table:
            # asked for once per table: it takes a microsecond
            self._table, self._address = received.base, received.ctypes.data
        most, first, left = self._most_received, 0, len(received)
        findings: list[Finding] = []
        while left > most:
            self._cycle(self._address + first * LAYOUT.itemsize, most, now_ns, None)
            if self._count.value:
                findings += self._found_in(frames_of(received[first : first + most]), now_ns)
            first, left = first + most, left - most
        count = self._cycle(self._address + first * LAYOUT.itemsize, left, now_ns, self._frames)
        if self._count.value:
            findings += self._found_in(frames_of(received[first:]), now_ns)
        return self._made_rows, count, findings

    def _made(self, count: int) -> list[Frame]:
        made = _FRAME.iter_unpack(memoryview(self._frames)[: count * _FRAME.size])
        # not by Frame(...): half of the time of making one is the call
        return [_made(Frame, (can_id, data[:length], 0, 0)) for can_id, length, data in made]

    def executed(self, execution_ns: int) -> None:
        """As `ecu.core.Ecu`."""
        self._executed(execution_ns)

    def overran(self, skipped: int) -> None:
        """As `ecu.core.Ecu`."""
        self._overran(skipped)

    def _found(self, now_ns: int, data: bytes = b"") -> list[Finding]:
        """What the last call found; data: of the frame that it received."""
        count, self._count.value = self._count.value, 0
        raw = self._findings.raw[: count * _FINDING.size]
        made = (self._finding(found, now_ns, data) for found in _FINDING.iter_unpack(raw))
        return [finding for finding in made if finding is not None]

    def _found_in(self, frames: Sequence[Frame], now_ns: int) -> list[Finding]:
        """What the last call of `library_cycle` found, of each frame at its stamp and of the cycle."""
        count, self._count.value = self._count.value, 0
        raw = self._findings.raw[: count * _FINDING.size]
        cycle = Frame(0, b"", now_ns)
        found = []
        for values, at in zip(_FINDING.iter_unpack(raw), self._finding_frames[:count], strict=True):
            frame = frames[at] if at < len(frames) else cycle
            finding = self._finding(values, frame.at_ns, frame.data)
            if finding is not None:
                found.append(finding)
        return found

    def _finding(self, raw: tuple[Any, ...], now_ns: int, data: bytes) -> Finding | None:
        """One finding; None for a signal of a fault that may be of several, until the last of them."""
        kind, subject, detail, other, value, before = raw
        if kind == _PROTECTION_FAILED:
            name = list(GROUP_OF)[subject]
            return ProtectionFailed(name, _whose(name, CHECKS[detail], data), now_ns)
        if kind == _IMPLAUSIBLE:
            given = self._inputs[subject]
            signal = given.source.fields[given.at].row.signal
            reason = _reason(given, Mode(detail), other, value, before)
            return Implausible(given.source.message, signal, value, reason, now_ns)
        if kind == _STALE:
            return Stale(Group(subject).name.lower(), now_ns)
        if kind == _STATE_CHANGED:
            return StateChanged(State(subject), State(other), EVENTS[detail], now_ns)
        if kind == _FAULT_FOUND:
            suspects = (*self._suspects, self._inputs[subject].name)
            self._suspects = suspects if other else ()
            return None if other else FaultFound(suspects, Mode(detail), now_ns)
        what = "fault detection: division by zero" if subject else "the estimators have no finite result"
        return EstimatorFailed(what, now_ns)


@dataclass(frozen=True, slots=True)
class CCore(Core):
    """As `ecu.core.Core`."""

    name: str = "c"

    def ecu(
        self,
        calibration: Calibration,
        *,
        form: Form = "corrected",
        limits: bool = True,
        detect_faults: bool = False,
    ) -> CEcu:
        """As `ecu.core.Core`. NotInCError for the printed form; NoCompilerError."""
        if form != "corrected":
            raise NotInCError(f"--form {form}: not in the ECU's C core; take the Python core for it")
        return CEcu(calibration, limits=limits, detect_faults=detect_faults)


C: Final = CCore()


@dataclass(frozen=True, slots=True)
class Quickest(Core):
    """The C core where its library was built before and has what is asked for, else the Python one. The frames are the same (ADR 92).

    With NUMBA_DISABLE_JIT=1 always the Python one.
    """

    name: str = "auto"

    def computing(self, calibration: Calibration, form: Form) -> str:
        """As `ecu.core.Core`."""
        return _quickest(calibration, form).name

    def ecu(
        self,
        calibration: Calibration,
        *,
        form: Form = "corrected",
        limits: bool = True,
        detect_faults: bool = False,
    ) -> Ecu:
        """As `ecu.core.Core`. Never waits for a compiler, and needs none."""
        core = _quickest(calibration, form)
        try:
            return core.ecu(calibration, form=form, limits=limits, detect_faults=detect_faults)
        except NotLoadedError:  # a full disk, or a library of another computer: nobody asked for C
            return PYTHON.ecu(calibration, form=form, limits=limits, detect_faults=detect_faults)


def _quickest(calibration: Calibration, form: Form) -> Core:
    # who wants no machine code wants to step through the ECU, too
    in_c = form == "corrected" and not IN_PYTHON and built(calibration) is not None
    return C if in_c else PYTHON


AUTO: Final = Quickest()
BY_NAME: Final[Mapping[str, Core]] = {core.name: core for core in (PYTHON, C)}


def _own_copy(file: Path) -> ctypes.CDLL:
    """The library, loaded with memory of its own. NotLoadedError."""
    # the loader knows a file that it has loaded, and would give the same memory to a second ECU
    try:
        with tempfile.NamedTemporaryFile(dir=file.parent, prefix="loaded-", suffix=".so") as copy:
            with file.open("rb") as original:
                shutil.copyfileobj(original, copy)
            copy.flush()
            return ctypes.CDLL(copy.name)
    except OSError as error:
        raise NotLoadedError(
            f"{file.parent}: the ECU in C cannot be loaded: {error.strerror or error}; make room, `loaderhil compile`, or take the Python core"
        ) from error


def _set_machine(c: ctypes.CDLL, calibration: Calibration) -> None:
    """Set what estimators and detection know of the machine, and the rules that follow from it."""
    parameters = calibration.parameters
    numbers, rules = _flat(parameters), list(machine_rules(parameters).values())
    count = ctypes.c_uint32.in_dll(c, "library_parameter_count").value
    # a structure of numbers alone: its fields lie in their order, without gaps
    if count != len(numbers):
        raise RuntimeError(
            f"the library has {count} parameters of the machine, and {len(numbers)} are to be set"
        )
    named = {"calibration_parameters": numbers, "machine_rules": rules}
    for name, values in (named | machine_detection(calibration, loader_database())).items():
        place = (ctypes.c_double * len(values)).in_dll(c, name)
        for k, value in enumerate(values):
            place[k] = value


def _flat(record: tuple[Any, ...]) -> list[float]:
    """All numbers of nested named tuples in their order."""
    return [
        number
        for value in record
        for number in (_flat(value) if isinstance(value, tuple) else [float(value)])
    ]


def _whose(message: str, check: Check, data: bytes) -> Check:
    """The check of a frame, as the Python ECU reports it: a CRC that is right for another message is a finding of its own."""
    # The C refuses both alike and knows no other message's data id, so the difference is found here, for the log only.
    neighbours = loader_database().by_name[message].neighbours
    if check is Check.WRONG_CRC and any(neighbour.intact(data) for neighbour in neighbours.values()):
        return Check.MASQUERADED
    return check


def _reason(given: Received, mode: Mode, by: int, value: float, before: float) -> str:
    """Why an input is implausible, in the words of `ecu.inputs`."""
    if by == _BY_SENSOR:
        return REPORTED
    if by == _BY_MESSAGE:
        return EXCHANGED if mode is Mode.EXCHANGED else WEIGHTLESS
    if mode is Mode.NOT_RESPONDING:
        return FROZEN
    return doubt(given.source.fields[given.at], value, before)
