"""`loaderhil deploy new` and `units` as commands: what they refuse to write, and what they say."""

import shutil
import stat
import subprocess
import sys
from types import SimpleNamespace

import pytest

from loaderhil.cli import main

LEAST = '[can]\ninterface = "can0"\n'


@pytest.fixture
def cli(monkeypatch, capsys):
    """The command line in this process: exit code and standard error."""

    def called(*words):
        monkeypatch.setattr(sys, "argv", ["loaderhil", *words])
        with pytest.raises(SystemExit) as ended:
            main()
        return SimpleNamespace(code=ended.value.code or 0, err=capsys.readouterr().err)

    return called


def ecu_file(folder, more=""):
    file = folder / "ecu.toml"
    file.write_text(LEAST + more)
    return file


def test_new_leaves_an_edited_file_alone(cli, tmp_path):
    file = tmp_path / "ecu.toml"
    assert cli("deploy", "new", str(file)).code == 0
    file.write_text(LEAST)
    again = cli("deploy", "new", str(file))
    assert again.code == 2
    assert str(file) in again.err
    assert file.read_text() == LEAST


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ('[ecu]\ncalibration = "/etc/own.toml"\n', "ecu.calibration = '/etc/own.toml': there is no file"),
        ('[ecu]\ncalibration = "own.toml"\n', "ecu.calibration = 'own.toml' is relative"),
        ('[ecu]\ncalibration = "/home/me/own.toml"\n', "(ProtectHome=yes)"),
        ('[offered]\naccess_key = "/tmp/key"\n', "offered.access_key = '/tmp/key' is below /tmp"),
        (
            '[gateway]\nmachine_interface = "can1"\nroutes = "/etc/r.toml"\n',
            "gateway.routes = '/etc/r.toml': there is no",
        ),
    ],
)
def test_units_refuse_a_file_that_no_service_would_find(cli, tmp_path, more, said):
    refused = cli(
        "deploy",
        "units",
        str(ecu_file(tmp_path, more)),
        "--out",
        str(tmp_path / "root"),
        "--program",
        "/opt/x",
    )
    assert refused.code == 2
    assert "ecu.toml: " in refused.err
    assert said in refused.err
    assert not (tmp_path / "root").exists()


def test_files_of_the_target_lie_below_its_root(cli, tmp_path):
    own = tmp_path / "root/etc/own.toml"
    own.parent.mkdir(parents=True)
    own.write_text("")
    file = ecu_file(tmp_path, '[ecu]\ncalibration = "/etc/own.toml"\n')
    assert cli("deploy", "units", str(file), "--out", str(tmp_path / "root"), "--program", "/opt/x").code == 0
    assert (
        "--calibration /etc/own.toml "
        in (tmp_path / "root/etc/systemd/system/loaderhil-ecu.service").read_text()
    )


@pytest.mark.parametrize("program", ["bin/loaderhil", "/home/me/bin/loaderhil"])
def test_units_refuse_a_program_that_no_service_would_find(cli, tmp_path, program):
    refused = cli(
        "deploy", "units", str(ecu_file(tmp_path)), "--out", str(tmp_path / "root"), "--program", program
    )
    assert refused.code == 2
    assert f"--program '{program}' is " in refused.err


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd-analyze is not installed")
def test_systemd_finds_a_program_with_an_awkward_name(cli, tmp_path, monkeypatch):
    """The judge of the quoting is systemd itself: it names the program that it does not find."""
    # below / for the time of the test: the services' own sandbox hides /tmp, and so units refuse it
    monkeypatch.setattr("deploy.words._HIDDEN", {})
    program = tmp_path / "my 100% loader"
    program.write_text("#!/bin/sh\n")
    program.chmod(stat.S_IRWXU)
    assert (
        cli(
            "deploy", "units", str(ecu_file(tmp_path)), "--out", str(tmp_path), "--program", str(program)
        ).code
        == 0
    )
    unit = tmp_path / "etc/systemd/system/loaderhil-ecu.service"

    def complaints():
        found = subprocess.run(
            ["systemd-analyze", "verify", str(unit)], capture_output=True, text=True, check=False
        )
        return [line for line in found.stderr.splitlines() if "loaderhil" in line]

    assert complaints() == []
    program.rename(program.with_name("elsewhere"))
    assert any("my 100% loader" in line for line in complaints())


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--core", "c", "--form", "printed"), "--form printed: not in the ECU's C core"),
        (("--xcp", "foo"), "foo"),
        (("--core", "c", "--uds", "0x610"), "two CAN identifiers"),
    ],
)
def test_options_are_judged_whether_there_is_a_bus_or_not(cli, options, said, tmp_path):
    refused = cli("ecu", *options, "--bus", f"hub:{tmp_path}/none")
    assert refused.code == 2
    assert said in refused.err
    assert len(refused.err.splitlines()) == 1
