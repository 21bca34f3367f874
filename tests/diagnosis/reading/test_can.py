"""CAN recordings into `loaderhil diagnose`: formats, names, ranges, several files on several clocks."""

from pathlib import Path

import can
import cantools
import numpy as np
import pytest

from discrepancy.checks.clocks import estimate_offset, join
from discrepancy.signals.recording import Recording, signal
from tests.diagnosis.cases import Call, columns, loaderhil, model_file, write_csv
from tests.discrepancy.toys import record, tank

__all__ = ["loaderhil"]
DBC = """VERSION ""
NS_ :
BS_:
BU_: MACHINE ECU
BO_ 256 Pump: 4 MACHINE
 SG_ inflow : 0|16@1- (0.0001,0) [-3|3] "m/s" ECU
 SG_ spare : 16|8@1+ (1,0) [0|250] "" ECU
BO_ 512 Gauge: 4 MACHINE
 SG_ Height : 0|16@1- (0.5,0) [-16000|16000] "mm" ECU
"""


def write_log(
    path: Path, folder: Path, recording: Recording, names: tuple[str, ...], offset_s: float = 0.0
) -> Path:
    """Frames of some channels of the tank, by python-can's own writers."""
    (folder / "tank.dbc").write_text(DBC)
    database = cantools.database.load_file(folder / "tank.dbc")
    frames = []
    if "inflow" in names:
        s = recording.signals["inflow"]
        pump = database.get_message_by_name("Pump")
        frames += [(t, pump, {"inflow": v, "spare": 0}) for t, v in zip(s.time_s, s.value, strict=True)]
    if "level" in names:
        s = recording.signals["level"]
        gauge = database.get_message_by_name("Gauge")
        frames += [(t, gauge, {"Height": 1e3 * v}) for t, v in zip(s.time_s, s.value, strict=True)]
    with can.Logger(str(path)) as log:
        for t, message, values in sorted(frames, key=lambda f: f[0]):
            data = message.encode(values, strict=False)
            stamp = float(t) + offset_s + 1.0
            log(
                can.Message(
                    timestamp=stamp,
                    arbitration_id=message.frame_id,
                    data=data,
                    is_extended_id=False,
                    channel="can0",
                )
            )
    return path


@pytest.mark.parametrize("suffix", [".log", ".blf", ".asc"])
def test_every_format_says_the_same(suffix: str, loaderhil: Call, tmp_path: Path) -> None:
    file = write_log(tmp_path / f"drive{suffix}", tmp_path, record(2, leak=0.08), ("inflow", "level"))
    words = (
        "--model",
        model_file(tmp_path),
        "--dbc",
        tmp_path / "tank.dbc",
        "--channel",
        "level=Gauge.Height",
    )
    ended = loaderhil("diagnose", file, *words)
    assert ended.code == 0, ended.out
    assert ended.result is not None
    assert ended.result.named == ["leak"]
    assert ended.result.findings[0].parameters[0].value == pytest.approx(0.08, rel=0.05)


@pytest.mark.parametrize("offset", [7.35, -250.0])
def test_two_loggers_are_put_on_one_clock(offset: float, loaderhil: Call, tmp_path: Path) -> None:
    """The second logger's clock is `offset` ahead; what the missing leak hides of it is fitted beside the leak."""
    truth = record(2, leak=0.08)
    machine = write_log(tmp_path / "machine.log", tmp_path, truth, ("inflow",), 300.0)
    reference = write_log(tmp_path / "reference.log", tmp_path, truth, ("level",), 300.0 + offset)
    words = (
        "--model",
        model_file(tmp_path, "leak"),
        "--dbc",
        tmp_path / "tank.dbc",
        "--channel",
        "level=Height",
    )
    ended = loaderhil("diagnose", f"{machine}+{reference}", *words)
    assert ended.code == 0, ended.out
    assert ended.result is not None
    assert ended.result.named == ["leak"]
    assert not any("says which is which" in c.text for c in ended.result.complaints)
    said = next(c.text for c in ended.result.complaints if "another clock" in c.text)
    rest = next(n for n in ended.result.nuisances if n.name == "clock of reference.log")
    added = float(said.split("clock: ")[1].split(" s")[0])
    assert added - rest.after == pytest.approx(-offset, abs=0.03)
    assert ended.result.findings[0].parameters[0].value == pytest.approx(0.08, rel=0.15)


def test_a_late_sensor_on_the_same_clock_stays_a_delay() -> None:
    late = record(3, delay_s=0.35)
    parts = [Recording(n, {n: late.signals[n]}) for n in ("inflow", "level")]
    joined = join(tank(), parts, "run")
    assert joined.offset_s == (0.0, 0.0)
    assert "not changed" in joined.complaints[0].text
    late_by, alike = estimate_offset(tank(), parts[0], parts[1])
    assert late_by == pytest.approx(-0.35, abs=0.1)
    assert alike > 0.9


def test_files_that_have_nothing_in_common_are_reported_as_not_synchronised() -> None:
    noise = np.random.default_rng(0).normal(size=600)
    parts = [
        Recording("a.log", {"inflow": record(1).signals["inflow"]}),
        Recording("b.log", {"level": signal(0.1 * np.arange(600), noise, "m")}),
    ]
    joined = join(tank(), parts, "run")
    assert joined.offset_s == (0.0, 0.0)
    assert "could not be synchronised" in joined.complaints[0].text


def test_values_outside_the_range_are_not_available(loaderhil: Call, tmp_path: Path) -> None:
    truth = record(2, leak=0.08)
    level = truth.signals["level"].value.copy()
    level[50:60] = 16.2
    broken = Recording("x", {**truth.signals, "level": signal(truth.signals["level"].time_s, level, "m")})
    file = write_log(tmp_path / "drive.log", tmp_path, broken, ("inflow", "level"))
    words = ("--model", model_file(tmp_path), "--dbc", tmp_path / "tank.dbc", "--channel", "level=Height")
    ended = loaderhil("diagnose", file, *words)
    assert ended.result is not None
    assert ended.result.named == ["leak"]
    assert any("10 of 1200 values outside -16000 to 16000 mm" in c.text for c in ended.result.complaints)


def test_what_is_missing_to_read_a_log_is_said(loaderhil: Call, tmp_path: Path) -> None:
    model = model_file(tmp_path)
    file = write_log(tmp_path / "drive.log", tmp_path, record(2), ("inflow", "level"))
    (tmp_path / "other.dbc").write_text(DBC.replace("256", "257").replace("512", "513"))
    (tmp_path / "junk.bin").write_bytes(b"\x00\x01" * 50)
    for words, expected in (
        ((file,), "needs --dbc FILE"),
        ((file, "--dbc", tmp_path / "other.dbc"), "frames is in the DBC files"),
        ((file, "--dbc", tmp_path / "tank.dbc", "--bus", "can7"), "has no bus 'can7'; it has can0"),
        (
            (file, "--dbc", tmp_path / "tank.dbc", "--channel", "level=Depth"),
            "has no column Depth; it has the columns Pump.inflow",
        ),
        (
            (file, "--dbc", tmp_path / "tank.dbc", "--channel", "inflow=pump.Inflow"),
            "has no column pump.Inflow (did you mean 'Pump.inflow'?); it has",
        ),
        ((tmp_path / "junk.bin", "--dbc", tmp_path / "tank.dbc"), "junk.bin"),
    ):
        ended = loaderhil("diagnose", *words, "--model", model)
        assert ended.code == 5, ended.err
        assert expected in " ".join(ended.out.split())


def test_averaged_columns(loaderhil: Call, tmp_path: Path) -> None:
    """Two gauges that are wrong by the same amount with opposite signs."""
    table = columns(record(2, leak=0.08))
    level = table.pop("level [m]")
    table |= {"left [m]": level + 0.4, "right [mm]": 1e3 * (level - 0.4)}
    file = write_csv(tmp_path / "drive.csv", table)
    ended = loaderhil("diagnose", file, "--model", model_file(tmp_path), "--channel", "level=left, right")
    assert ended.result is not None
    assert ended.result.named == ["leak"]
