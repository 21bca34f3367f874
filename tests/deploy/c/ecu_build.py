"""The whole ECU in C as a library: the same interface as `ecu.cycle.EcuCycle`, for replays and for the bench in lockstep."""

import ctypes
from types import SimpleNamespace

from bus.frame import Frame

MOST_FRAMES = 32


class CFrame(ctypes.Structure):
    """EcuFrame of ecu.h."""

    _fields_ = [("id", ctypes.c_uint32), ("length", ctypes.c_uint8), ("data", ctypes.c_uint8 * 8)]


class BuiltEcu:
    """One ECU; the library has static memory, so that a second one of the same file would be the same ECU."""

    def __init__(self, library, *, limits_enabled=True, detect_faults=False):
        self._c = ctypes.CDLL(str(library))
        self._frames = (CFrame * MOST_FRAMES)()
        self._c.ecu_state.restype = ctypes.c_uint8
        self._c.ecu_tick.restype = ctypes.c_uint8
        self._c.ecu_init(ctypes.c_bool(limits_enabled))
        if hasattr(self._c, "ecu_detect_faults"):  # not in a build without the detection
            self._c.ecu_detect_faults(ctypes.c_bool(detect_faults))

    @property
    def state(self):
        return int(self._c.ecu_state())

    def receive(self, frame, now_ns):
        data = (ctypes.c_uint8 * max(len(frame.data), 1))(*frame.data)
        self._c.ecu_receive(
            ctypes.c_uint32(frame.can_id), data, ctypes.c_uint8(len(frame.data)), ctypes.c_int64(now_ns)
        )
        return []

    def tick(self, now_ns):
        count = self._c.ecu_tick(ctypes.c_int64(now_ns), self._frames)
        frames = [Frame(f.id, bytes(f.data)[: f.length], 0) for f in self._frames[:count]]
        return SimpleNamespace(frames=frames, findings=[])

    def executed(self, execution_ns):
        self._c.ecu_executed(ctypes.c_int64(execution_ns))

    def overran(self, skipped):
        self._c.ecu_overran(ctypes.c_uint32(skipped))
