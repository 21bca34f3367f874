"""Files for systemd: every setting arrives, and systemd itself accepts the service."""

import configparser
import shutil
import subprocess
from dataclasses import replace

import pytest

from deploy.command import TEMPLATE
from deploy.settings import ServiceSettings
from deploy.units import service_files
from hil.shell.realtime_options import RealtimeOptions

SERVICE = "etc/systemd/system/loaderhil-ecu.service"
SETTINGS = ServiceSettings.from_file(TEMPLATE)


def sections(text):
    parser = configparser.ConfigParser(strict=True, interpolation=None)
    parser.optionxform = str
    parser.read_string(text)
    return parser


def service(settings):
    return sections(service_files(settings, "/usr/bin/loaderhil")[SERVICE])["Service"]


def test_every_setting_arrives_in_the_files():
    changed = replace(
        SETTINGS,
        can=replace(SETTINGS.can, interface="can7", bit_rate=250_000, restart_ms=40),
        calibration="/etc/loaderhil/own.toml",
        form="printed",
        limits=False,
        realtime=RealtimeOptions(fifo=33, cpu=2, lock_memory=True),
        watchdog_s=0.7,
    )
    files = service_files(changed, "/opt/loaderhil", "/etc/own/ecu.toml")
    network = sections(files["etc/systemd/network/70-loaderhil-can7.network"])
    assert network["Match"]["Name"] == "can7"
    assert dict(network["CAN"]) == {"BitRate": "250000", "RestartSec": "40ms"}
    found = sections(files[SERVICE])["Service"]
    assert found["ExecStartPre"] == "/opt/loaderhil deploy check /etc/own/ecu.toml"
    assert found["ExecStart"] == (
        "/opt/loaderhil ecu --bus socketcan:can7 --calibration /etc/own/calibration.toml --form printed --no-limits"
        " --fifo 33 --lock-memory --cpu 2"
    ).replace("/etc/own/calibration.toml", "/etc/loaderhil/own.toml")
    assert found["WatchdogSec"] == "0.7"
    assert found["LimitRTPRIO"] == "33"
    assert "sys-subsystem-net-devices-can7.device" in sections(files[SERVICE])["Unit"]["BindsTo"]


def test_an_ordinary_process_gets_no_privilege():
    assert service(SETTINGS)["AmbientCapabilities"] == "CAP_SYS_NICE CAP_IPC_LOCK"
    plain = service(replace(SETTINGS, realtime=RealtimeOptions()))
    assert plain["AmbientCapabilities"] == plain["CapabilityBoundingSet"] == ""
    assert plain["LimitRTPRIO"] == "0"


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd-analyze is not installed")
def test_systemd_accepts_the_service(tmp_path):
    for name, text in service_files(SETTINGS, "/bin/true").items():
        file = tmp_path / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")
    unit = tmp_path / SERVICE
    verified = subprocess.run(
        ["systemd-analyze", "verify", str(unit)], capture_output=True, text=True, check=False
    )
    # A misspelt key or a wrong value is a line that names the unit; missing units of this computer are not ours.
    complaints = [line for line in verified.stderr.splitlines() if "loaderhil" in line]
    assert complaints == []
    unit.write_text(
        unit.read_text(encoding="utf-8").replace("WatchdogSec=1", "WatchdogSec=soon"), encoding="utf-8"
    )
    broken = subprocess.run(
        ["systemd-analyze", "verify", str(unit)], capture_output=True, text=True, check=False
    )
    assert "soon" in broken.stderr
