"""A real controller on a bus under a test, with a rest bus around it."""

import threading
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from bus.address import open_transport
from bus.frame import Frame
from dbc.database import Database
from dbc.recordings.writer import CandumpWriter
from testbench.api.driven import NotPossible
from testbench.api.listening import Listener
from testbench.restbus.core import RestBus
from testbench.restbus.values import values_for


class BusDriven:
    """Simulated nodes are sent, everything is heard."""

    def __init__(self, address: str, simulate: tuple[str, ...], dbc: Path, values: Path | None) -> None:
        self.database = Database.from_file(dbc)
        self._address, self._simulate = address, simulate
        self._generators = values_for(dbc, values).generators
        self._listener: Listener | None = None
        self._rest: RestBus | None = None
        self._stimulated: set[str] = set()
        # The rest bus is used by the listener's thread and by the test.
        self._lock = threading.Lock()

    @property
    def now_s(self) -> float:
        """Since the first frame."""
        return self._listener.now_s if self._listener is not None else 0.0

    @property
    def record(self) -> Sequence[Frame]:
        """Every frame so far."""
        return self._listener.record if self._listener is not None else ()

    async def start(self) -> None:
        """Open the bus and begin to send."""
        # made once for its errors, which would end the thread of the listener
        RestBus(self.database, self._simulate, self._generators)
        # from now on, not from the first frame: on a bus that stays silent no time would pass, and no wait would end
        bus, zero_ns = open_transport(self._address, name="test"), time.monotonic_ns()
        self._listener = Listener(bus, self._due, zero_ns=zero_ns)

    def _due(self, now_ns: int) -> list[Frame]:
        with self._lock:
            # made with its first due time, not in __init__: time that passes before the bus is open would be made up
            # for in a burst
            if self._rest is None:
                self._rest = RestBus(self.database, self._simulate, self._generators, start_ns=now_ns)
            return self._rest.due(now_ns)

    async def advance(self, until_s: float) -> Sequence[Frame] | None:
        """Wait for frames."""
        assert self._listener is not None
        return await self._listener.frames(until_s)

    def truth(self) -> Mapping[str, Any]:
        """None: there is no plant."""
        return {}

    def _sent(self) -> RestBus:
        if self._rest is None:
            self._rest = RestBus(self.database, self._simulate, self._generators)
        return self._rest

    def stimulate(self, message: str, signal: str, value: float) -> None:
        """The rest bus sends this value."""
        with self._lock:
            self._sent().set(f"{message}.{signal}", value)
            self._stimulated.add(f"{message}.{signal}")

    def inject(self, fault: Mapping[str, object]) -> str:
        """Only `drop` without an end: the message stays away. Other faults need the gateway of a run in real time."""
        if fault.get("kind") != "drop" or set(fault) != {"kind", "message"}:
            raise NotPossible(
                "on a bus there is only inject(kind='drop', message=NAME); use Bench.realtime for other faults"
            )
        with self._lock:
            self._sent().stop(str(fault["message"]))
        return f"drop {fault['message']}"

    def clear(self) -> None:
        """Send every message again, with the values of the beginning."""
        from testbench.restbus.core import start_value
        from testbench.restbus.generators import Constant

        with self._lock:
            rest = self._sent()
            for name in self._stimulated:
                message, _, signal = name.partition(".")
                codec = self.database.by_name[message]
                # a values file may give no value for the signal: then it began at its start value
                usual = Constant(start_value(codec.by_signal[signal], codec))
                rest.generate(name, self._generators.get(name, usual))
            self._stimulated.clear()
            # due since time 0, hence sent with the next look; missed cycles are skipped, not sent in a row
            rest.resume(0, *rest.messages)

    async def stop(self) -> None:
        """Leave the bus."""
        if self._listener is not None:
            self._listener.close()

    def keep(self, folder: Path) -> Path:
        """The log of the bus."""
        # late: it loads what checks run directories (pydantic), and only a test that fails keeps a recording
        from hil.rundir import BUS, writing

        with writing(folder / BUS):
            folder.mkdir(parents=True, exist_ok=True)
            with CandumpWriter(folder / BUS) as log:
                for frame in self.record:
                    log.write(frame, "bus")
        return folder
