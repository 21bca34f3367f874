"""pyxcp, a tool that knows only the standard and the A2L file, measures and calibrates the ECU."""

import struct
import sys
import threading

import pytest
from pya2l.parser import A2lParser
from pyxcp import checksum
from pyxcp.daq_stim import DaqList, DaqOnlinePolicy
from pyxcp.types import XcpResponseError

from deploy.a2l.document import write_a2l
from ecu.measure.parameters import BASE
from tests.ecu.xcp.tool import CHANNEL, DirectBus, tool

FORMATS = {"FLOAT32_IEEE": "<f", "UBYTE": "<B"}
TYPES = {"FLOAT32_IEEE": "F32", "UBYTE": "U8"}


@pytest.fixture(autouse=True)
def no_arguments(monkeypatch):
    """pyxcp reads the command line of whatever process it is in."""
    monkeypatch.setattr(sys, "argv", ["pyxcp"])


@pytest.fixture(scope="module")
def a2l():
    with A2lParser() as parser:
        return parser.tree_from_a2l(write_a2l("l60", CHANNEL).encode()).PROJECT.MODULE[0]


@pytest.fixture
def ecu(make_ecu):
    ecu = make_ecu()
    ecu.cycles(60)
    return ecu


@pytest.fixture
def bus(ecu):
    with DirectBus(ecu) as bus:
        yield bus


class Kept(DaqOnlinePolicy):
    """Keeps what pyxcp makes of the packets: time stamp of the ECU [ns] and the values in the order of its headers."""

    def __init__(self, lists: list[DaqList]) -> None:
        super().__init__(lists)
        self.rows: list[tuple[int, list[float]]] = []
        self.came = threading.Condition()

    def on_daq_list(self, daq_list, timestamp0, timestamp1, payload):
        with self.came:
            self.rows.append((timestamp1, list(payload)))
            self.came.notify_all()


def test_every_measurement_of_the_file_is_read_by_its_address(ecu, bus, a2l):
    with tool(bus) as master:
        assert master.identifier(1) == "loaderhil_l60"
        master.setMta(a2l.MOD_PAR.ADDR_EPK[0].Address.Value)
        epk = a2l.MOD_PAR.EPK.Identifier.Value
        assert master.fetch(len(epk)).decode() == epk
        for m in a2l.MEASUREMENT:
            layout = FORMATS[m.DataType.Value]
            value = struct.unpack(
                layout, master.shortUpload(struct.calcsize(layout), m.ECU_ADDRESS.Address.Value)
            )[0]
            group, _, name = m.Name.Value.partition(".")
            if group in ("estimate", "input"):
                values = ecu.cycle.inputs if group == "input" else ecu.cycle.values
                assert value == pytest.approx(values[name], rel=1e-6), m.Name.Value
        master.disconnect()


def test_the_tools_checksum_of_the_calibration_is_the_ecus(bus, a2l):
    size = 4 * len(a2l.CHARACTERISTIC)
    with tool(bus) as master:
        master.setMta(BASE)
        content = master.fetch(size)
        master.setMta(BASE)
        answer = master.buildChecksum(size)
        assert answer.checksum == checksum.check(content, str(answer.checksumType))


def test_a_calibrated_value_changes_the_estimate_and_goes_with_the_tool(ecu, bus, a2l):
    number = next(c for c in a2l.CHARACTERISTIC if c.Name.Value == "bucket.mass_kg")
    before = ecu.cycle.values["payload"]
    with tool(bus) as master:
        master.cond_unlock("calpag")
        master.setMta(number.Address.Value)
        master.download(struct.pack("<f", 980.0))
        ecu.cycles(400)
        assert ecu.cycle.values["payload"] - before == pytest.approx(-100.0, abs=10.0)
        master.setMta(number.Address.Value)
        with pytest.raises(XcpResponseError, match="OUT_OF_RANGE"):
            master.download(struct.pack("<f", 2.0 * number.UpperLimit.Value))
        master.disconnect()
    ecu.cycles(400)
    assert ecu.cycle.values["payload"] == pytest.approx(before, abs=1.0)


def test_a_wrong_key_is_refused(bus):
    with (
        tool(bus, secret=b"the secret of somebody else") as master,
        pytest.raises(XcpResponseError, match="ACCESS_LOCKED"),
    ):
        master.cond_unlock("calpag")


def test_lists_bring_every_cycle_once_and_as_a_whole(ecu, bus, a2l):
    chosen = [
        m
        for m in a2l.MEASUREMENT
        if m.Name.Value in ("echo", "state", "input.wheel_speed_1", "estimate.normal_3")
    ]
    measured = [(m.Name.Value, m.ECU_ADDRESS.Address.Value, 0, TYPES[m.DataType.Value]) for m in chosen]
    kept = Kept(
        [
            DaqList(
                name="all",
                event_num=0,
                stim=False,
                enable_timestamps=True,
                measurements=measured,
                priority=0,
                prescaler=1,
            )
        ]
    )
    expected = []
    with tool(bus, policy=kept) as master:
        kept.setup()
        kept.start()
        for _ in range(100):
            ecu.machine.values["wheel_speed_1"] = 0.01 * (ecu.machine.tick % 7)
            bus.deliver(ecu.cycles(1))
            values = {**{f"input.{k}": v for k, v in ecu.cycle.inputs.items()}, **ecu.cycle.values}
            values["estimate.normal_3"] = values["normal_3"]
            expected.append((1000 * (ecu.now_ns // 1000), values))
        with kept.came:
            assert kept.came.wait_for(lambda: len(kept.rows) == 100, timeout=20.0)
        kept.stop()
        names = [header[0] for header in kept.daq_lists[0].headers]
        master.disconnect()
    for (stamp, row), (at_ns, values) in zip(kept.rows, expected, strict=True):
        assert stamp - kept.rows[0][0] == at_ns - expected[0][0]
        assert row == pytest.approx([values[name] for name in names], rel=1e-6)
