"""The UDS server: requests in, answers out. No bus and no clock here.

Every malformed request has the standard's negative response. Nothing that a tool sends raises.
"""

import struct
from collections.abc import Callable, Mapping
from typing import Final

from ecu.cycle import EcuCycle
from ecu.measure.access import Lock
from ecu.uds.codes import Negative, Refused, Service, Session
from ecu.uds.trouble import ALL_CODES, TroubleReader

S3_NS: Final = 5_000_000_000
"""Silence after which a session other than the default one ends (ISO 14229-2)."""
P2_MS, P2_STAR_MS = 50, 5000
"""Longest time to an answer, and after one that says to wait; answers come at once, within the cycle that hears them."""
MOST_ATTEMPTS: Final = 3
DELAY_NS: Final = 10_000_000_000
"""After so many wrong keys, no seed for so long."""
LONGEST_ANSWER: Final = 4095
NEGATIVE: Final = 0x7F
STANDING: Final = 0.5
"""Largest speed at which the ECU may be restarted [m/s]: its limits are safe values until the inputs have come again."""
SELF_TEST: Final = 0x0201
HARD_RESET, SOFT_RESET = 0x01, 0x03
SUPPRESS: Final = 0x80
"""Bit of a sub-function: no positive answer wanted."""
# from which length on a request is complete, and whether it has a sub-function that may suppress its answer
_LEAST: Final = {
    Service.SESSION_CONTROL: 2,
    Service.ECU_RESET: 2,
    Service.CLEAR_DIAGNOSTIC_INFORMATION: 4,
    Service.READ_DTC_INFORMATION: 2,
    Service.READ_DATA: 3,
    Service.SECURITY_ACCESS: 2,
    Service.ROUTINE_CONTROL: 4,
    Service.TESTER_PRESENT: 2,
}
_WITHOUT_SUBFUNCTION: Final = (Service.CLEAR_DIAGNOSTIC_INFORMATION, Service.READ_DATA)
_EXTENDED_ONLY: Final = (
    Service.ECU_RESET,
    Service.CLEAR_DIAGNOSTIC_INFORMATION,
    Service.SECURITY_ACCESS,
    Service.ROUTINE_CONTROL,
)


class UdsServer:
    """One ECU as a diagnostic tool sees it."""

    def __init__(
        self,
        cycle: EcuCycle,
        lock: Lock,
        data: Mapping[int, Callable[[], bytes]],
        self_test: Callable[[], bytes],
    ) -> None:
        """data: readers of ReadDataByIdentifier; self_test: its result as bytes, the first 0 where it has passed."""
        self._cycle, self._lock, self._data, self._self_test = cycle, lock, data, self_test
        self._troubles = TroubleReader(lambda: cycle.trouble_codes)
        self._session = Session.DEFAULT
        self._heard_ns = 0
        self._attempts = 0
        self._barred_ns: int | None = None  # since when no seed is given
        self._seed_given = False
        self._tested: bytes | None = None
        self._restart = False
        self._services: dict[int, Callable[[bytes, int], bytes]] = {
            Service.SESSION_CONTROL: self._session_control,
            Service.ECU_RESET: self._ecu_reset,
            Service.CLEAR_DIAGNOSTIC_INFORMATION: self._clear,
            Service.READ_DTC_INFORMATION: lambda request, _: self._troubles.report(request[1:]),
            Service.READ_DATA: self._read_data,
            Service.SECURITY_ACCESS: self._security_access,
            Service.ROUTINE_CONTROL: self._routine_control,
            Service.TESTER_PRESENT: self._tester_present,
        }

    def request(self, data: bytes, now_ns: int) -> bytes:
        """The answer to one request; b"" where none is wanted."""
        self._expire(now_ns)
        self._heard_ns = now_ns
        if not data:
            return b""
        service = data[0]
        try:
            if service not in self._services:
                raise Refused(Negative.SERVICE_NOT_SUPPORTED)
            if service in _EXTENDED_ONLY and self._session is Session.DEFAULT:
                raise Refused(Negative.SERVICE_NOT_IN_SESSION)
            if len(data) < _LEAST[Service(service)]:
                raise Refused(Negative.WRONG_LENGTH)
            answer = bytes((service + 0x40,)) + self._services[service](data, now_ns)
            if len(answer) > LONGEST_ANSWER:
                raise Refused(Negative.RESPONSE_TOO_LONG)
        except Refused as refused:
            return bytes((NEGATIVE, service, refused.code))
        quiet = service not in _WITHOUT_SUBFUNCTION and data[1] & SUPPRESS
        return b"" if quiet else answer

    def before_cycle(self, now_ns: int) -> None:
        """A cycle begins: a restart that was asked for takes place, and a silent tool loses its session."""
        self._expire(now_ns)
        if self._restart:
            self._restart = False
            self._cycle.restart()

    def _expire(self, now_ns: int) -> None:
        if self._session is not Session.DEFAULT and now_ns - self._heard_ns > S3_NS:
            self._enter(Session.DEFAULT)

    def _enter(self, session: Session) -> None:
        """Every change of the session locks what was unlocked (ISO 14229-1)."""
        self._session = session
        self._lock.close()
        self._seed_given, self._tested = False, None

    def _need_key(self) -> None:
        if not self._lock.open:
            raise Refused(Negative.SECURITY_ACCESS_DENIED)

    def _session_control(self, request: bytes, now_ns: int) -> bytes:
        _exactly(request, 2)
        wanted = request[1] & 0x7F
        if wanted not in list(Session):
            raise Refused(Negative.SUBFUNCTION_NOT_SUPPORTED)
        self._enter(Session(wanted))
        return struct.pack(">BHH", wanted, P2_MS, P2_STAR_MS // 10)

    def _tester_present(self, request: bytes, now_ns: int) -> bytes:
        _exactly(request, 2)
        if request[1] & 0x7F:
            raise Refused(Negative.SUBFUNCTION_NOT_SUPPORTED)
        return b"\0"

    def _ecu_reset(self, request: bytes, now_ns: int) -> bytes:
        _exactly(request, 2)
        kind = request[1] & 0x7F
        if kind not in (HARD_RESET, SOFT_RESET):
            raise Refused(Negative.SUBFUNCTION_NOT_SUPPORTED)
        self._need_key()
        speeds = (self._cycle.inputs.get(f"wheel_speed_{n}", 0.0) for n in range(1, 5))
        radius = self._cycle.calibration.parameters.wheel.unloaded_radius
        # by the wheels and not by the estimate, which a fault sets to zero
        if max(map(abs, speeds)) * radius > STANDING:
            raise Refused(Negative.CONDITIONS_NOT_CORRECT)
        self._restart = True
        self._enter(Session.DEFAULT)
        return bytes((kind,))

    def _clear(self, request: bytes, now_ns: int) -> bytes:
        _exactly(request, 4)
        if int.from_bytes(request[1:4], "big") != ALL_CODES:
            raise Refused(Negative.OUT_OF_RANGE)
        self._cycle.trouble_codes.clear()
        return b""

    def _read_data(self, request: bytes, now_ns: int) -> bytes:
        if len(request) % 2 == 0:
            raise Refused(Negative.WRONG_LENGTH)
        wanted = struct.unpack(f">{len(request) // 2}H", request[1:])
        known = [(identifier, self._data[identifier]) for identifier in wanted if identifier in self._data]
        if not known:
            raise Refused(Negative.OUT_OF_RANGE)
        return b"".join(struct.pack(">H", identifier) + read() for identifier, read in known)

    def _security_access(self, request: bytes, now_ns: int) -> bytes:
        kind = request[1] & 0x7F
        if kind == 0x01:
            _exactly(request, 2)
            self._barred(now_ns)
            self._seed_given = not self._lock.open
            seed = self._lock.seed()
            return b"\x01" + (seed if self._seed_given else bytes(len(seed)))  # zeros: unlocked already
        if kind != 0x02:
            raise Refused(Negative.SUBFUNCTION_NOT_SUPPORTED)
        if not self._seed_given:
            raise Refused(Negative.SEQUENCE_ERROR)
        self._seed_given = False
        if self._lock.unlock(request[2:]):
            self._attempts = 0
            return b"\x02"
        self._attempts += 1
        if self._attempts < MOST_ATTEMPTS:
            raise Refused(Negative.INVALID_KEY)
        self._attempts, self._barred_ns = 0, now_ns
        raise Refused(Negative.TOO_MANY_ATTEMPTS)

    def _barred(self, now_ns: int) -> None:
        if self._barred_ns is not None:
            if now_ns - self._barred_ns < DELAY_NS:
                raise Refused(Negative.DELAY_NOT_EXPIRED)
            self._barred_ns = None

    def _routine_control(self, request: bytes, now_ns: int) -> bytes:
        _exactly(request, 4)
        kind, routine = request[1] & 0x7F, int.from_bytes(request[2:4], "big")
        if kind not in (0x01, 0x03):
            raise Refused(Negative.SUBFUNCTION_NOT_SUPPORTED)
        if routine != SELF_TEST:
            raise Refused(Negative.OUT_OF_RANGE)
        if kind == 0x01:
            self._tested = self._self_test()
        if self._tested is None:
            raise Refused(Negative.SEQUENCE_ERROR)  # no results before a start
        return bytes((kind,)) + request[2:4] + self._tested


def _exactly(request: bytes, length: int) -> None:
    if len(request) != length:
        raise Refused(Negative.WRONG_LENGTH)
