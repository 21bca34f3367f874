"""The monitor beside Debian's candump on virtual interfaces: equal byte for byte."""

import shutil
from pathlib import Path

import pytest

from bus.frame import ERROR, EXTENDED, Frame
from bus.socketcan.can_socket import kernel_has_can
from bus.socketcan.link import can_interfaces
from bus.socketcan.transport import SocketCanTransport
from hil.monitor.raw import RawView
from hil.monitor.source import Buses
from hil.monitor.target import Target
from hil.shell.process import Stop
from tests.hil.monitor.candump_tool import STYLES, candumps, every_kind

pytestmark = pytest.mark.socketcan


@pytest.fixture(autouse=True)
def can_and_candump() -> None:
    if not kernel_has_can() or {"vcan0", "vcan1"} - set(can_interfaces()):
        pytest.skip("there are no vcan0 and vcan1; run scripts/with-vcan .venv/bin/pytest -m socketcan")
    if shutil.which("candump") is None:
        pytest.skip("candump is missing: install can-utils")


def received(buses: Buses, count: int) -> list:
    """Batches until `count` frames have come and nothing follows."""
    batches, seen = [], 0
    with Stop() as stop:
        for batch in buses.batches(stop, 0.2):
            batches.append(batch)
            seen += len(batch.frames)
            if not batch.frames and seen >= count:
                return batches
    raise AssertionError


@pytest.mark.parametrize(
    "targets",
    [
        ["any,0:0,#FFFFFFFF"],
        ["vcan1"],
        ["vcan0,#FFFFFFFF", "vcan1,100:100"],
    ],
    ids=" ".join,
)
def test_every_style_is_candumps(tmp_path: Path, targets: list[str]) -> None:
    frames = every_kind(150, seed=1)
    with (
        Buses([Target.parse(target) for target in targets], origins=True) as buses,
        SocketCanTransport("vcan0") as zero,
        SocketCanTransport("vcan1") as one,
        candumps(tmp_path, [(options, targets) for options in STYLES]) as running,
    ):
        for number, frame in enumerate(frames):  # blocks of ten: candump reads its interfaces in turns
            if number % 10 == 0:
                for candump in running:
                    candump.wait_settled()
            (one if number // 10 % 2 else zero).send(frame)
        theirs = [candump.finish() for candump in running]
        batches = received(buses, theirs[1].count(b"\n"))
        for (options, style), reference in zip(STYLES.items(), theirs, strict=True):
            view = RawView(style, buses)
            assert "".join(map(view.text, batches)).encode() == reference, options


FILTERS = [
    "123:7FF",
    "123~7FF",
    "00000123:7FF",
    "123:C00007FF",
    "123:800007FF",
    "12345678:DFFFFFFF",
    "0~0",
    "0:0",
    "100:100,200:200",
    "100:100,200:200,j",
    "100:100,200:200,J,#FFFFFFFF",
    "100~100,200~200,j",
    "100:100,j,#FF",
    "#1FF",
    "#004",
    "0~0,#FFFFFFFF",
    "0x100:0x700",
    "80000000:80000000",
    "40000000:40000000",
    "20000100:7FF",
    "0:FFFFFFFF",
]


def test_every_filter_is_candumps(tmp_path: Path) -> None:
    frames = every_kind(400, seed=2)
    frames += [Frame(bits, b"") for bits in (0x123, EXTENDED | 0x123, EXTENDED | 0x12345678)]
    frames += [Frame(ERROR | 1 << bit, bytes(8)) for bit in range(9)]
    targets = [f"vcan0,{text}" for text in FILTERS]
    with (
        SocketCanTransport("vcan0") as sender,
        candumps(tmp_path, [("-L", [target]) for target in targets]) as running,
    ):
        sources = [Buses([Target.parse(target)]) for target in targets]
        for number, frame in enumerate(frames):
            if number % 50 == 0:  # candump's receive buffer is small
                for candump in running:
                    candump.wait_settled()
            sender.send(frame)
        for text, candump, source in zip(FILTERS, running, sources, strict=True):
            theirs = candump.finish()
            with source:
                view = RawView(STYLES["-L"], source)
                ours = "".join(map(view.text, received(source, theirs.count(b"\n"))))
            assert ours.encode() == theirs, text
