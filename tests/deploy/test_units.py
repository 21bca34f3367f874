"""Files for systemd: every setting arrives, and systemd itself accepts the service."""

import configparser
import re
import shlex
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from configuration import ConfigurationError
from deploy.command import TEMPLATE
from deploy.settings import GatewaySettings, RecorderSettings, ServiceSettings
from deploy.units import service_files
from deploy.words import UnitTextError
from ecu.offered.services import ServiceOptions
from hil.shell.realtime_options import RealtimeOptions
from tests.deploy.c.building import compiler
from tests.deploy.c.test_targets import make

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
        " --detect-faults --fifo 33 --lock-memory --cpu 2"
    ).replace("/etc/own/calibration.toml", "/etc/loaderhil/own.toml")
    assert found["WatchdogSec"] == "0.7"
    assert found["LimitRTPRIO"] == "33"
    assert "sys-subsystem-net-devices-can7.device" in sections(files[SERVICE])["Unit"]["BindsTo"]


def test_an_ordinary_process_gets_no_privilege():
    assert service(SETTINGS)["AmbientCapabilities"] == "CAP_SYS_NICE CAP_IPC_LOCK"
    plain = service(replace(SETTINGS, realtime=RealtimeOptions()))
    assert plain["AmbientCapabilities"] == plain["CapabilityBoundingSet"] == ""
    assert plain["LimitRTPRIO"] == "0"


def test_a_recorder_never_needs_a_name_twice():
    """A recording does not overwrite another one: with a fixed name the second start would fail."""
    settings = replace(SETTINGS, recorder=RecorderSettings(suffix="mf4", rotate_mib=12.0))
    files = service_files(settings, "/usr/bin/loaderhil")
    assert files[SERVICE] == service_files(SETTINGS, "/usr/bin/loaderhil")[SERVICE]
    found = sections(files["etc/systemd/system/loaderhil-recorder.service"])["Service"]
    # as systemd reads it: "$$" and "%%" are one sign each
    command = found["ExecStart"].replace("$$", "$").replace("%%", "%")
    assert "record loader=socketcan:can0 --rotate-mib 12 --out" in command
    # ... and the quotes of systemd are those of a shell here, with nothing for it to replace in them
    words = shlex.split(command)
    shown = subprocess.run(
        [*words[:2], words[2].replace("exec /usr/bin/loaderhil", "echo")],
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    assert re.search(r"--out /var/log/loaderhil/can0-\d{8}T\d{6}Z\.mf4$", shown.strip())
    assert found["CapabilityBoundingSet"] == ""


def test_a_gateway_needs_both_interfaces():
    settings = replace(SETTINGS, gateway=GatewaySettings(machine_interface="can1", routes="/etc/routes.toml"))
    files = service_files(settings, "/usr/bin/loaderhil")
    unit = sections(files["etc/systemd/system/loaderhil-gateway.service"])
    assert unit["Unit"]["BindsTo"].split() == [
        f"sys-subsystem-net-devices-{n}.device" for n in ("can1", "can0")
    ]
    assert unit["Service"]["ExecStart"] == (
        "/usr/bin/loaderhil gateway --plant-bus socketcan:can1 --ecu-bus socketcan:can0 --routes /etc/routes.toml"
        " --fifo 50 --lock-memory --cpu 1"
    )
    assert sections(files["etc/systemd/network/70-loaderhil-can1.network"])["Match"]["Name"] == "can1"


@pytest.mark.parametrize("program", [None, "/opt/loader-ecu"], ids=["python", "exported program"])
def test_the_detection_of_faults_is_said_either_way(program):
    def command(settings):
        files = service_files(settings, "/usr/bin/loaderhil", ecu_program=program)
        return sections(files[SERVICE])["Service"]["ExecStart"].split()

    assert "--detect-faults" in command(replace(SETTINGS, core="c", detect_faults=True))
    assert "--no-detect-faults" in command(replace(SETTINGS, core="c", detect_faults=False))


def test_the_exported_program_detects_faults_beside_xcp():
    files = service_files(replace(OFFERING, detect_faults=True), "/usr/bin/loaderhil", ecu_program="/opt/ecu")
    words = sections(files[SERVICE])["Service"]["ExecStart"]
    assert " --detect-faults " in words
    assert " --xcp 0x600,0x601 " in words


def test_the_core_arrives():
    assert "--core" not in service(SETTINGS)["ExecStart"]
    assert " --core c " in service(replace(SETTINGS, core="c"))["ExecStart"]


IN_C = replace(SETTINGS, core="c", can=replace(SETTINGS.can, listen_s=0.5), limits=False)
OFFERING = replace(
    IN_C,
    detect_faults=False,
    offered=ServiceOptions(
        xcp="0x600,0x601",
        uds="0x610,0x611",
        j1939="identity=1,manufacturer=0",
        access_key=Path("/etc/loaderhil/access.key"),
    ),
)


def test_the_exported_program_takes_the_place_of_the_ecu():
    files = service_files(IN_C, "/usr/bin/loaderhil", ecu_program="/opt/loader-ecu")
    found = sections(files[SERVICE])["Service"]
    assert found["ExecStart"] == (
        "/opt/loader-ecu --bus socketcan:can0 --listen-s 0.5 --no-limits --detect-faults --fifo 50 --lock-memory --cpu 1"
    )
    assert "ExecStartPre" not in found
    assert "loaderhil " not in found["ExecStart"]
    assert (found["MemoryDenyWriteExecute"], found["RestrictAddressFamilies"]) == ("yes", "AF_CAN AF_UNIX")


@pytest.mark.parametrize(
    ("changed", "key"),
    [
        ({"core": "python"}, "ecu.core"),
        ({"form": "printed"}, "ecu.form"),
    ],
)
def test_what_the_exported_program_does_not_have_is_refused(changed, key):
    with pytest.raises(ConfigurationError, match=f"{key} does not fit --ecu-program"):
        service_files(replace(IN_C, **changed), "/usr/bin/loaderhil", ecu_program="/opt/loader-ecu")


def test_the_exported_program_understands_its_unit(ecu_sources):
    """The words of the unit, but for the help that ends them: not one is an unknown option."""
    compiler()
    make(ecu_sources, "linux/loader-ecu")
    program = ecu_sources / "linux/loader-ecu"
    files = service_files(OFFERING, "/usr/bin/loaderhil", ecu_program="/opt/loader-ecu")
    words = sections(files[SERVICE])["Service"]["ExecStart"]
    offered = "--xcp 0x600,0x601 --uds 0x610,0x611 --j1939 identity=1,manufacturer=0 --access-key /etc/loaderhil/access.key"
    assert f" {offered} " in words
    shown = subprocess.run(
        [program, *words.split()[1:], "--help"], capture_output=True, text=True, check=False
    )
    assert (shown.returncode, shown.stderr) == (0, "")


AWKWARD = '/opt/my \\ "own"; l60/100%$x.toml'
IN_WORDS = r'"/opt/my \\ \"own\"; l60/100%%$$x.toml"'


def test_a_blank_or_sign_in_a_path_stays_in_one_word():
    """systemd.service(5): words in quotes; % and $ are special unless they are doubled."""
    settings = replace(
        SETTINGS, calibration=AWKWARD, gateway=GatewaySettings(machine_interface="can1", routes=AWKWARD)
    )
    files = service_files(settings, "/opt/my loader/100%", "/etc/my ecu.toml")
    found = {name: sections(text)["Service"] for name, text in files.items() if name.endswith(".service")}
    gateway = found["etc/systemd/system/loaderhil-gateway.service"]
    assert f" --calibration {IN_WORDS} " in found[SERVICE]["ExecStart"]
    assert f" --routes {IN_WORDS} " in gateway["ExecStart"]
    assert found[SERVICE]["ExecStartPre"] == '"/opt/my loader/100%%" deploy check "/etc/my ecu.toml"'
    assert gateway["ExecStart"].startswith('"/opt/my loader/100%%" gateway ')


@pytest.mark.parametrize(
    "program",
    [
        "loaderhil",
        ".venv/bin/loaderhil",
        "/home/me/loaderhil",
        "/opt/../home/x",
        "/opt/$x",
        "/opt/'x'",
        '/opt/"x"',
        "/opt/x\\y",
        "/opt/x\nUser=root",
    ],
)
def test_a_program_that_systemd_cannot_start_is_refused(program):
    with pytest.raises(UnitTextError):
        service_files(SETTINGS, program)


def test_a_service_never_gives_up():
    """A cause may pass by itself; systemd.unit(5): an interval of 0 switches the limit of starts off."""
    for name, text in service_files(SETTINGS, "/usr/bin/loaderhil").items():
        if name.endswith(".service"):
            assert sections(text)["Unit"]["StartLimitIntervalSec"] == "0"


OFFERED = ServiceOptions(
    j1939="identity=1,manufacturer=0", uds="0x610,0x611", access_key=Path('/etc/my \\ "keys"/100%$x')
)


def test_what_the_ecu_offers_arrives_as_words_of_systemd():
    """systemd.service(5): words in quotes; % and $ are special unless they are doubled."""
    started = service(replace(SETTINGS, offered=OFFERED))["ExecStart"]
    assert (
        r'--uds 0x610,0x611 --j1939 identity=1,manufacturer=0 --access-key "/etc/my \\ \"keys\"/100%%$$x"'
        in started
    )
    assert "--xcp" not in started


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd-analyze is not installed")
def test_systemd_accepts_the_exported_program(tmp_path):
    unit = tmp_path / "loaderhil-ecu.service"
    unit.write_text(service_files(IN_C, "/bin/true", ecu_program="/bin/true")[SERVICE], encoding="utf-8")
    verified = subprocess.run(
        ["systemd-analyze", "verify", str(unit)], capture_output=True, text=True, check=False
    )
    assert [line for line in verified.stderr.splitlines() if "loaderhil" in line] == []


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd-analyze is not installed")
@pytest.mark.parametrize("name", ["ecu", "recorder", "gateway"])
def test_systemd_accepts_every_service(tmp_path, name):
    settings = replace(
        SETTINGS,
        offered=OFFERED,
        recorder=RecorderSettings(suffix="blf", rotate_mib=64.0),
        gateway=GatewaySettings(machine_interface="can1", routes=None),
    )
    unit = tmp_path / f"loaderhil-{name}.service"
    unit.write_text(service_files(settings, "/bin/true")[f"etc/systemd/system/{unit.name}"], encoding="utf-8")
    verified = subprocess.run(
        ["systemd-analyze", "verify", str(unit)], capture_output=True, text=True, check=False
    )
    assert [line for line in verified.stderr.splitlines() if "loaderhil" in line] == []


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
