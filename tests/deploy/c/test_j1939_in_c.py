"""The network management of the exported C beside the other services and the cycle; that of the frames alone: tests/ecu/j1939."""

import ctypes
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bus.frame import Frame
from bus.socketcan.transport import SocketCanTransport
from dbc import loader_database
from dbc.j1939 import source_address
from ecu.j1939.claim import ADDRESS_CLAIMED, CONTENTION_NS, NULL, message
from ecu.j1939.name import BadName, Name
from ecu.j1939.service import REQUEST, SOFTWARE
from tests.bus.conftest import vcan  # noqa: F401
from tests.bus.vcan import INTERFACE
from tests.deploy.c.beside import CServices, services_library
from tests.deploy.c.building import STRICT, build
from tests.deploy.c.test_targets import make
from tests.ecu.uds.tool import CHANNEL as UDS
from tests.ecu.xcp.tool import CHANNEL as XCP

ADDRESS = source_address(loader_database().by_name["EcuStatus"].can_id)
TICK_NS = 10_000_000
TEXT = "identity=77,manufacturer=5"


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    return services_library(tmp_path_factory.mktemp("services"))


def claimed(name, address=ADDRESS):
    return message(ADDRESS_CLAIMED, address, name.to_bytes(8, "little"))


def ticked(ecu, now):
    """Frames of one cycle as the program for Linux sends them, and those of the services."""
    ecu.before_cycle(now)
    own = ecu.tick(now).frames
    return [*(own if ecu.may_send() else []), *ecu.after_cycle(now)]


def test_neither_xcp_nor_uds_answers_without_the_address(library):
    ecu = CServices(library, xcp=XCP, uds=UDS, name=int(Name.parse(TEXT)))
    connect, session = Frame(XCP.receive, b"\xff\x00"), Frame(UDS.receive, b"\x02\x10\x01")
    assert ticked(ecu, 0) == [claimed(int(Name.parse(TEXT)))]
    assert [ecu.service(frame, 1) for frame in (connect, session)] == [[], []]
    for now in range(TICK_NS, CONTENTION_NS, TICK_NS):
        assert ticked(ecu, now) == []
    ticked(ecu, CONTENTION_NS)
    assert len(ticked(ecu, CONTENTION_NS + TICK_NS)) > 3
    assert [len(ecu.service(frame, CONTENTION_NS)) for frame in (connect, session)] == [1, 1]
    assert ecu.service(claimed(1), CONTENTION_NS) == []
    assert [ecu.service(frame, CONTENTION_NS) for frame in (connect, session)] == [[], []]
    sent = [frame for k in range(2, 40) for frame in ticked(ecu, CONTENTION_NS + k * TICK_NS)]
    assert [source_address(frame.can_id) for frame in sent] == [NULL]


@pytest.mark.parametrize("seed", range(6))
def test_in_the_end_the_lowest_name_alone_has_the_address(library, seed):
    """Two to four ECUs in C that start at any time and hear one another's frames up to a tick later."""
    draw = random.Random(seed)
    names = sorted({draw.getrandbits(64) for _ in range(draw.randint(2, 4))})
    ecus = {name: CServices(library, name=name) for name in names}
    starts = {name: draw.randrange(0, 2 * CONTENTION_NS, TICK_NS) for name in names}
    on_the_wire = []
    for now in range(0, 2 * CONTENTION_NS + 10**9, TICK_NS):
        heard = [item for item in on_the_wire if item[0] <= now]
        on_the_wire = [item for item in on_the_wire if item[0] > now]
        for name in (name for name in names if starts[name] <= now):
            answers = [f for _, by, frame in heard if by != name for f in ecus[name].service(frame, now)]
            answers += ecus[name].after_cycle(now)
            on_the_wire += [(now + draw.randrange(1, TICK_NS), name, frame) for frame in answers]
    assert [ecus[name].may_send() for name in names] == [True] + [False] * (len(names) - 1)


@pytest.fixture(scope="module")
def name_read(tmp_path_factory):
    """The reader of the command line in C: NAME, or None."""
    from deploy.c.project import RUNTIME

    file = tmp_path_factory.mktemp("name") / "name.so"
    library = ctypes.CDLL(str(build([RUNTIME / "linux/j1939_name.c"], file, *STRICT, "-shared", "-fPIC")))
    library.name_read.restype = ctypes.c_bool

    def read(text):
        name = ctypes.c_uint64()
        return name.value if library.name_read(text.encode(), ctypes.byref(name)) else None

    return read


KEYS = tuple(Name.__dataclass_fields__)
NUMBERS = st.one_of(
    st.integers(0, 1 << 22).map(str), st.integers(0, 1 << 22).map(hex), st.sampled_from(["", "-1", "01", "0", "1x", "+1", "9" * 30])
)  # fmt: skip
WORDS = st.tuples(st.sampled_from([*KEYS, "maker", ""]), NUMBERS).map("=".join)
VALID = st.fixed_dictionaries(
    {"identity": st.integers(0, (1 << 21) - 1), "manufacturer": st.integers(0, (1 << 11) - 1)},
    optional={
        "ecu_instance": st.integers(0, 7),
        "function_instance": st.integers(0, 31),
        "function": st.integers(0, 255),
        "vehicle_system": st.integers(0, 127),
        "vehicle_system_instance": st.integers(0, 15),
        "industry": st.integers(0, 7),
    },
)


@given(VALID)
def test_a_name_on_the_command_line_is_that_of_python(name_read, values):
    text = ",".join(f"{key}={value}" for key, value in values.items())
    assert name_read(text) == int(Name.parse(text))


@given(st.lists(st.one_of(WORDS, st.sampled_from(["identity=1", "manufacturer=0", "identity"])), max_size=5))
def test_what_python_refuses_as_a_name_is_refused(name_read, words):
    text = ",".join(words)
    try:
        expected = int(Name.parse(text))
    except BadName:
        expected = None
    # Python also takes a plus sign
    assert name_read(text) == (None if "+" in text else expected)


@pytest.mark.socketcan
@pytest.mark.usefixtures("vcan")
def test_the_linux_program_claims_its_address_and_answers_a_request(ecu_sources):
    """The claim is its first frame; the next comes a quarter of a second later; a long text is announced to all."""
    import subprocess
    import time

    make(ecu_sources, "linux/loader-ecu")
    heard = []
    with SocketCanTransport(INTERFACE) as bus:
        ecu = subprocess.Popen([ecu_sources / "linux/loader-ecu", "--j1939", TEXT, INTERFACE])
        try:
            end, asked = time.monotonic() + 20.0, False
            while time.monotonic() < end and not any(f.can_id & 0x3FF_FF00 == 0x0EB_FF00 for f in heard):
                heard += bus.drain()
                if len(heard) > 20 and not asked:
                    bus.send(message(REQUEST, 0xF9, SOFTWARE.to_bytes(3, "little"), to=ADDRESS))
                    asked = True
                time.sleep(0.005)
            ecu.terminate()
            assert ecu.wait(20) == 0
        finally:
            ecu.kill()
    assert (heard[0].can_id, heard[0].data) == claimed(int(Name.parse(TEXT)))[:2]
    assert heard[1].at_ns - heard[0].at_ns >= CONTENTION_NS - TICK_NS
    assert any(
        f.data[:1] == b"\x01" and b"load" in f.data for f in heard if f.can_id & 0x3FF_FF00 == 0x0EB_FF00
    )
