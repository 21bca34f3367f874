"""The services of the C host build beside those of the Python ECU: every frame goes to both, and both have to answer alike."""

import _ctypes
import ctypes
import shutil
import tempfile
import weakref
from pathlib import Path

from bus.frame import FD, Frame
from dbc import loader_database
from deploy.c.project import project_files
from deploy.c.service_tables import service_files
from ecu.calibration import calibration_table, read_calibration
from tests.deploy.c.building import STRICT, build, write
from tests.deploy.c.ecu_build import BuiltEcu, CFrame

HERE = Path(__file__).parent
VERSION = "1.2.3"
"""Of the software, as the tests of the Python services have it."""


def services_library(folder, *options, name="l60"):
    """The exported ECU with its services and the test's program, in double precision."""
    table = calibration_table(name)
    calibration = read_calibration(table)
    files = project_files(calibration, table.values)
    files |= service_files(calibration, table.values, loader_database(), VERSION)
    for place in ("services", "linux", "library", "cortex_m4"):
        (folder / place).mkdir(parents=True, exist_ok=True)
    write(folder, files)
    sources = [*sorted(folder.glob("*.c")), *sorted(folder.glob("services/*.c")), HERE / "services.c"]
    return build(
        sources,
        folder / "services.so",
        *STRICT,
        "-shared",
        "-fPIC",
        f"-I{folder}",
        "-DECU_DOUBLE",
        "-DECU_SETTABLE",
        *options,
    )


class CServices(BuiltEcu):
    """One ECU with its services."""

    def __init__(self, library, *, xcp=None, uds=None, name=None, secret=b"", detect_faults=False):
        """xcp, uds: their channels; name: NAME with which the ECU claims its address."""
        # the memory is static: every ECU is a library of its own
        with tempfile.NamedTemporaryFile(suffix=".so") as copy:
            shutil.copyfile(library, copy.name)
            super().__init__(copy.name)
        weakref.finalize(self, _ctypes.dlclose, self._c._handle)
        self._count = ctypes.c_uint32.in_dll(self._c, "tested_count")
        self._sent = (CFrame * 4096).in_dll(self._c, "tested_sent")
        words = [
            word
            for channel in (xcp, uds)
            for word in ((0, 0) if channel is None else (channel.receive, channel.send))
        ]
        self._c.tested_start(
            *map(ctypes.c_uint32, words),
            secret,
            ctypes.c_uint16(len(secret)),
            ctypes.c_bool(detect_faults),
            ctypes.c_bool(name is not None),
            ctypes.c_uint64(name or 0),
        )

    @property
    def library(self):
        return self._c

    def service(self, frame, now_ns):
        """What the services answer to a frame."""
        if not frame.flags & FD:  # a socket of classic CAN gives none of these
            self._c.services_receive(
                ctypes.c_uint32(frame.can_id),
                frame.data,
                ctypes.c_uint8(len(frame.data)),
                ctypes.c_int64(now_ns),
            )
        return self._taken()

    def may_send(self):
        """Whether the ECU has its address, or needs none."""
        self._c.services_may_send.restype = ctypes.c_bool
        return bool(self._c.services_may_send())

    def before_cycle(self, now_ns):
        self._c.services_before_cycle(ctypes.c_int64(now_ns))
        assert self._taken() == []

    def after_cycle(self, now_ns):
        """The frames after a cycle."""
        self._c.services_after_cycle(ctypes.c_int64(now_ns))
        return self._taken()

    def _taken(self):
        count, self._count.value = self._count.value, 0
        return [Frame(f.id, bytes(f.data)[: f.length]) for f in self._sent[:count]]


class CycleBeside:
    """The cycle of the Python ECU, which is also what tests look into, and that in C on the same frames."""

    def __init__(self, python, c):
        self.__dict__.update(_python=python, _c=c)

    @property
    def c(self):
        """The library of the ECU in C."""
        return self._c.library

    def __getattr__(self, name):
        return getattr(self._python, name)

    def __setattr__(self, name, value):
        setattr(self._python, name, value)

    def receive(self, frame, now_ns):
        self._c.receive(frame, now_ns)
        return self._python.receive(frame, now_ns)

    def tick(self, now_ns):
        tick = self._python.tick(now_ns)
        assert [f[:2] for f in self._c.tick(now_ns).frames] == [
            (f.can_id, bytes(f.data)) for f in tick.frames
        ]
        assert self._c.state == self._python.state
        return tick


class ServiceBeside:
    """A service of the Python ECU and the same in C: the answers that both give."""

    def __init__(self, python, c):
        self._python, self._c = python, c

    def receive(self, frame, now_ns):
        return self._both(self._python.receive(frame, now_ns), self._c.service(frame, now_ns))

    def before_cycle(self, now_ns):
        self._python.before_cycle(now_ns)
        self._c.before_cycle(now_ns)

    def after_cycle(self, now_ns):
        return self._both(self._python.after_cycle(now_ns), self._c.after_cycle(now_ns))

    def _both(self, expected, found):
        assert [(f.can_id, f.data.hex()) for f in found] == [(f.can_id, f.data.hex()) for f in expected]
        return found


def put_beside(ecu, library, *, secret, detect_faults=False, **channel):
    """Let an ECU of the tests answer with C and Python alike. detect_faults: as the ECU in Python was made."""
    c = CServices(library, secret=secret or b"", detect_faults=detect_faults, **channel)
    ecu.cycle, ecu.service = CycleBeside(ecu.cycle, c), ServiceBeside(ecu.service, c)
    return ecu
