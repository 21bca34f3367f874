"""The how-to on measuring and calibrating, followed as printed with an ECU as a process on a hub."""

import csv
import itertools
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from bus.hub.client import HubTransport
from tests.bus.hub.running import RunningHub
from tests.docs.pages import ROOT, commands, fences
from tests.ecu.machine import PERIOD_NS, FakeMachine

PAGE = (ROOT / "docs/howto/measure-and-calibrate.md").read_text(encoding="utf-8")
HUB = "/tmp/loaderhil.hub"  # as the page has it


def printed(command: str, hub: str) -> list[str]:
    """The page's call of a command, on a hub of the test's own."""
    page = PAGE.replace("\nloaderhil ", "\n    loaderhil ")
    words = next(c.words for c in commands(page) if c.words[0] == command)
    return [sys.executable, "-m", "loaderhil", *(word.replace(HUB, hub) for word in words)]


def drive(bus: HubTransport, script: subprocess.Popen[bytes]) -> int:
    """Be a standing machine until the script has ended; its exit code."""
    machine, due = FakeMachine(), time.monotonic_ns()
    while script.poll() is None:
        for frame in machine.frames():
            bus.send(frame)
        bus.drain(1000)
        due += PERIOD_NS
        time.sleep(max(due - time.monotonic_ns(), 0) * 1e-9)
    return script.returncode


@pytest.mark.processes
def test_the_page_measures_and_calibrates_as_printed(tmp_path):
    hub, environment = RunningHub(str(tmp_path / "hub")), os.environ | {"PYTHONPATH": str(ROOT)}
    (tmp_path / "access.key").write_bytes(b"thirty-two bytes that are secret\n")
    text = next(f.text for f in fences(PAGE) if f.language == "python").replace(HUB, hub.path)
    (tmp_path / "script.py").write_text(text)
    subprocess.run(printed("export-a2l", hub.path), cwd=tmp_path, env=environment, check=True, timeout=60)
    ecu = subprocess.Popen(printed("ecu", hub.path), cwd=tmp_path, env=environment)
    try:
        with hub.connect() as bus:
            # the ECU has compiled when it sends; only then the script's two seconds mean anything
            deadline = time.monotonic() + 200.0
            while not bus.drain(1) and time.monotonic() < deadline:
                time.sleep(0.05)
            script = subprocess.Popen([sys.executable, "script.py"], cwd=tmp_path, env=environment)
            assert drive(bus, script) == 0
    finally:
        ecu.terminate()
        ecu.wait(30)
        hub.stop()
    check(tmp_path / "loads.csv")


def check(file: Path) -> None:
    """Every row is a cycle, and the payload falls by what the bucket has gained."""
    with file.open() as opened:
        rows = list(csv.DictReader(opened))
    stamps = [int(row["timestamp1"]) for row in rows]
    assert all((b - a) % 10_000_000 == 0 and b > a for a, b in itertools.pairwise(stamps))
    payload = [float(row["estimate.payload"]) for row in rows]
    assert payload[-1] - payload[len(rows) // 6] == pytest.approx(-100.0, abs=15.0)
