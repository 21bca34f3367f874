"""The how-to on diagnosis over UDS, its script followed as printed with an ECU on a hub."""

import asyncio
import os
import subprocess
import sys
import threading

import pytest

from bus.hub.client import HubTransport
from ecu import node
from tests.bus.hub.running import RunningHub
from tests.docs.pages import ROOT, fences
from tests.ecu.uds.tool import UdsEcu

PAGE = (ROOT / "docs/howto/diagnose-over-uds.md").read_text(encoding="utf-8")
HUB = "/tmp/loaderhil.hub"  # as the page has it


def serve(ecu: UdsEcu, bus: HubTransport, over: threading.Event) -> None:
    """The ECU's shell on the hub until the script is over."""

    async def both() -> None:
        shell = asyncio.create_task(node.run(bus, ecu.cycle, found=lambda _: None, services=[ecu.service]))
        await asyncio.to_thread(over.wait)
        shell.cancel()

    asyncio.run(both())


@pytest.mark.processes
def test_the_script_of_the_page_reads_identity_and_codes(tmp_path):
    ecu, hub, over = UdsEcu(), RunningHub(str(tmp_path / "hub")), threading.Event()
    ecu.cycles(60)
    ecu.machine.silent.add("SlopeSensor")
    ecu.cycles(60)
    (code,) = ecu.cycle.trouble_codes.active
    (tmp_path / "script.py").write_text(
        next(f.text for f in fences(PAGE) if f.language == "python").replace(HUB, hub.path)
    )
    with hub.connect() as bus:
        shell = threading.Thread(target=serve, args=(ecu, bus, over))
        shell.start()
        try:
            said = subprocess.run(
                [sys.executable, "script.py"],
                cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True, text=True, timeout=120,
            )  # fmt: skip
        finally:
            over.set()
            shell.join(30)
    hub.stop()
    assert said.returncode == 0, said.stderr
    lines = said.stdout.splitlines()
    assert lines[0] == "0xf190 LOADERHILL6000000"
    assert any(line.startswith(f"SPN {code.spn} FMI {code.mode.value} active:") for line in lines)
    assert "0x104" in lines[-1]
