"""`loaderhil diagnose` as a user calls it: verdicts, exit codes, files, and what it says of bad input."""

import gzip
import json
import tomllib
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from diagnosis.reading.reading import Misuse, constants_of, measured
from discrepancy.models import ball
from discrepancy.signals.units import parse_scaled
from tests.diagnosis.cases import Call, columns, loaderhil, model_file, write_csv
from tests.discrepancy.toys import record, struck

__all__ = ["loaderhil"]


def test_a_leak_in_a_csv_is_explained(loaderhil: Call, tmp_path: Path) -> None:
    file = write_csv(tmp_path / "drive.csv", columns(record(2, leak=0.08)))
    ended = loaderhil("diagnose", file, "--model", model_file(tmp_path))
    assert ended.code == 0
    assert ended.result is not None
    assert ended.result.named == ["leak"]
    assert ended.result.recordings == ["drive.csv"]
    assert ended.result.findings[0].parameters[0].value == pytest.approx(0.08, rel=0.05)
    assert "explained" in ended.out
    assert "leak = 0.0" in ended.out
    assert "effects screened" in ended.err


def test_parquet_other_units_and_a_german_csv_say_the_same(loaderhil: Call, tmp_path: Path) -> None:
    """The same numbers in another file format, in mm, and with decimal commas: the same verdict to the last digit but rounding."""
    table, model = columns(record(2, leak=0.08)), model_file(tmp_path)
    names = list(table)
    schema = pa.schema([pa.field("time_s", pa.float64()), *(pa.field(n, pa.float64()) for n in names[1:])])
    pq.write_table(
        pa.Table.from_arrays([pa.array(v) for v in table.values()], schema=schema), tmp_path / "a.parquet"
    )
    write_csv(tmp_path / "b.csv", table, ";", ",")
    scaled = {
        "t [ms]": 1e3 * table["time [s]"],
        "inflow [mm/s]": 1e3 * table["inflow [m/s]"],
        "level [mm]": 1e3 * table["level [m]"],
    }
    write_csv(tmp_path / "c.csv", scaled)
    values = []
    for name in ("a.parquet", "b.csv", "c.csv"):
        ended = loaderhil("diagnose", tmp_path / name, "--model", model)
        assert ended.code == 0
        assert ended.result is not None
        values.append(ended.result.finding("leak").parameters[0].value)
    np.testing.assert_allclose(values, values[0], rtol=1e-6)


def encoded(text: str, kind: str) -> bytes:
    """The text as other programs write it: Windows' encodings, or the units in a row of their own."""
    if kind != "row of units":
        return ("# Höhe über Grund\n" + text).encode(kind)
    rows = text.splitlines()
    heads = [head.removesuffix("]").partition(" [") for head in rows[0].split(",")]
    return "\n".join([",".join(h[0] for h in heads), ",".join(h[2] for h in heads), *rows[1:]]).encode()


@pytest.mark.parametrize("kind", ["utf-16", "cp1252", "utf-8-sig", "row of units"])
def test_tables_of_other_programs_say_the_same(kind: str, loaderhil: Call, tmp_path: Path) -> None:
    table = columns(record(2, leak=0.08))
    table["level [mm]"] = 1e3 * table.pop("level [m]")
    file = write_csv(tmp_path / "drive.csv", table)
    file.write_bytes(encoded(file.read_text(), kind))
    ended = loaderhil("diagnose", file, "--model", model_file(tmp_path))
    assert ended.code == 0, ended.out
    assert ended.result is not None
    assert ended.result.named == ["leak"]
    assert [c.text for c in ended.result.complaints] == (
        ["is not UTF-8; read as Windows-1252"] if kind == "cp1252" else []
    )


def test_nothing_missing_and_unknown_have_their_exit_codes(loaderhil: Call, tmp_path: Path) -> None:
    whole = write_csv(tmp_path / "whole.csv", columns(record(1)))
    ended = loaderhil("diagnose", whole, "--model", model_file(tmp_path))
    assert ended.result is not None
    assert (ended.code, ended.result.status) == (0, "nothing missing")
    odd = write_csv(tmp_path / "odd.csv", columns(record(5, square=0.02, noise=0.005)))
    ended = loaderhil("diagnose", odd, "--model", model_file(tmp_path, "level scale", "level bias"))
    assert ended.result is not None
    assert (ended.code, ended.result.status) == (1, "unknown")


def test_what_is_explained_in_part_ends_with_1_and_says_how_much_is_left(
    loaderhil: Call, tmp_path: Path
) -> None:
    """The leak is sure and applied; the swing for ten seconds has no name."""
    hit = struck(record(14, leak=0.05), 90.0, 100.0, 0.8)
    file, model = write_csv(tmp_path / "hit.csv", columns(hit)), model_file(tmp_path, "leak")
    ended = loaderhil("diagnose", file, "--model", model, "--apply", tmp_path / "leaky.toml")
    assert ended.result is not None
    assert (ended.code, ended.result.status) == (1, "explained in part")
    applied = (tmp_path / "leaky.toml").read_text()
    assert tomllib.loads(applied)["effects"]["leak"]["leak"] == pytest.approx(0.05, rel=0.1)
    assert "still wrong: level is simulated to 0." in applied
    first_screen = ended.out[: ended.out.index("1. leak")]
    assert "still wrong: level is simulated to 0." in first_screen
    assert "times its budget" in first_screen


def test_channels_constants_and_shifts_can_be_said_on_the_command_line(
    loaderhil: Call, tmp_path: Path
) -> None:
    table = columns(record(2, leak=0.08))
    table["Pegel [m]"] = table.pop("level [m]")
    file, model = write_csv(tmp_path / "drive.csv", table), model_file(tmp_path)
    ended = loaderhil("diagnose", file, "--model", model)
    assert ended.code == 5
    assert "Pegel" in ended.out
    ended = loaderhil("diagnose", file, "--model", model, "--channel", "level=Pegel")
    assert ended.code == 0
    late = {**table, "time [s]": table["time [s]"] + 1.7e9}
    ended = loaderhil(
        "diagnose", write_csv(tmp_path / "epoch.csv", late), "--model", model, "--channel", "level=Pegel"
    )
    assert ended.code == 0


def test_a_gram_is_a_mass_where_a_mass_is_wanted_and_gravity_elsewhere() -> None:
    assert parse_scaled("g", "kg").factor == pytest.approx(1e-3)
    assert parse_scaled("g/m^3", "kg/m^3").factor == pytest.approx(1e-3)
    assert parse_scaled("g", "m/s^2").factor == pytest.approx(9.80665)
    assert parse_scaled("g").factor == pytest.approx(9.80665)


def test_constants_are_converted_to_what_the_model_needs_or_refused() -> None:
    """Named units; a mass in grams was taken for an acceleration once."""
    model = ball.model()
    given = measured("--constant", ["mass [g]=58", "diameter [cm]=6.7"])
    assert constants_of(model, given) == pytest.approx({"mass": 0.058, "diameter": 0.067})
    assert constants_of(model, measured("--constant", ["mass=0.058"])) == {"mass": 0.058}
    for text, said in (
        ("mass [cm]=5", "is in cm, the model needs kg"),
        ("weight=5", "no such constant; it has mass, diameter"),
        ("mass [stone]=5", "cannot read 'stone'"),
    ):
        with pytest.raises(Misuse, match=said):
            constants_of(model, measured("--constant", [text]))
    with pytest.raises(Misuse, match="'much' is not a number"):
        measured("--constant", ["mass=much"])


BROKEN = {
    "empty": "is empty",
    "zero bytes": "contains only zero bytes (4000); was power lost",
    "a page of the web": "no time column",
    "only a heading": "no rows",
    "no time": "no time column",
    "no heading": "has no heading, line 1 contains numbers",
    "binary": "is not a text file",
    "repeated column": "2 columns are called level",
    "no numbers": "are not numbers",
    "constant": "constant at 2 m",
    "all NaN": "usable samples",
    "millimetres under metres": "level in mm under a heading of m",
    "litres under cubic metres": "inflow in m/s under a heading of mm/s",
    "other clock": "another clock",
    "no common time": "samples in a row from 0 to 60 s, where all inputs exist",
    "other quantity": "the model tank needs m/s",
    "unknown unit": "cannot read 'furlong'",
    "input missing": "cannot be driven without this input",
    "too short": "too few",
}


def broken(kind: str, folder: Path) -> Path:
    table, path = columns(record(3, leak=0.03)), folder / "broken.csv"
    n = table["time [s]"].size
    if kind == "empty":
        path.write_text("")
    elif kind == "zero bytes":
        path.write_bytes(bytes(4000))
    elif kind == "a page of the web":
        path.write_text("<!DOCTYPE html><html><head><title>404 Not Found</title></head></html>\n")
    elif kind == "only a heading":
        path.write_text("time [s],inflow [m/s],level [m]\n")
    elif kind == "no heading":
        path.write_text("\n".join(write_csv(path, table).read_text().splitlines()[1:]))
    elif kind == "binary":
        path.write_bytes(b"\x00\xff\x13" * 1000)
    elif kind == "repeated column":
        head, *rows = write_csv(path, table).read_text().splitlines()
        path.write_text("\n".join([f"{head},level [m]", *(f"{row},0" for row in rows)]))
    elif kind == "no time":
        write_csv(path, {k: v for k, v in table.items() if k != "time [s]"})
    elif kind == "no numbers":
        rows = [f"{t},{u},broken" for t, u in zip(table["time [s]"], table["inflow [m/s]"], strict=True)]
        path.write_text("\n".join(["time [s],inflow [m/s],level [m]", *rows]))
    else:
        changed = {
            "constant": {"level [m]": np.full(n, 2.0)},
            "all NaN": {"level [m]": np.full(n, np.nan)},
            "millimetres under metres": {"level [m]": 1e3 * table["level [m]"]},
            "litres under cubic metres": {"inflow [m/s]": 1e-3 * table["inflow [m/s]"]},
            "other clock": {
                "level [m]": np.interp(table["time [s]"] - 7.3, table["time [s]"], table["level [m]"])
            },
            "too short": {},
        }.get(kind, {})
        table |= changed
        if kind == "other quantity":
            table["inflow [kg]"] = table.pop("inflow [m/s]")
        elif kind == "unknown unit":
            table["inflow [furlong/s]"] = table.pop("inflow [m/s]")
        elif kind == "input missing":
            table.pop("inflow [m/s]")
        elif kind == "too short":
            table = {name: value[:20] for name, value in table.items()}
        elif kind == "no common time":
            half = table["time [s]"] < 60.0
            table["inflow [m/s]"] = np.where(half, table["inflow [m/s]"], np.nan)
            table["level [m]"] = np.where(half, np.nan, table["level [m]"])
        write_csv(path, table)
    return path


@pytest.mark.parametrize("kind", BROKEN)
def test_bad_recordings_are_inconclusive_for_a_reason_that_is_said(
    kind: str, loaderhil: Call, tmp_path: Path
) -> None:
    ended = loaderhil("diagnose", broken(kind, tmp_path), "--model", model_file(tmp_path))
    assert ended.code == 5, ended.out
    assert ended.result is not None
    assert ended.result.status == "inconclusive"
    said = " ".join([*ended.result.reasons, *(c.text for c in ended.result.complaints)])
    assert BROKEN[kind] in said
    assert ended.result.recordings == ["broken.csv"]
    assert "Traceback" not in ended.err


def test_damaged_files_are_reported_and_the_whole_ones_judged(loaderhil: Call, tmp_path: Path) -> None:
    good = write_csv(tmp_path / "good.csv", columns(record(2, leak=0.08)))
    (tmp_path / "cut.parquet").write_bytes(b"PAR1 and no more")
    (tmp_path / "cut.csv.gz").write_bytes(gzip.compress(good.read_bytes())[:20])
    (tmp_path / "drive.zip").write_bytes(b"PK")
    files = [tmp_path / name for name in ("cut.parquet", "cut.csv.gz", "drive.zip")]
    ended = loaderhil("diagnose", good, *files, "--model", model_file(tmp_path))
    assert ended.code == 0
    assert ended.result is not None
    assert ended.result.named == ["leak"]
    assert {c.recording for c in ended.result.complaints if c.fatal} == {f.name for f in files}
    ended = loaderhil("diagnose", *files, "--model", model_file(tmp_path))
    assert ended.code == 5
    assert ended.result is not None
    assert ended.result.recordings == [f.name for f in files]


def test_a_compressed_table_that_is_cut_off_is_read_as_far_as_it_goes(
    loaderhil: Call, tmp_path: Path
) -> None:
    packed = gzip.compress(write_csv(tmp_path / "a.csv", columns(record(2, leak=0.08))).read_bytes())
    file = tmp_path / "cut.csv.gz"
    file.write_bytes(packed[: len(packed) * 9 // 10])
    ended = loaderhil("diagnose", file, "--model", model_file(tmp_path))
    assert ended.result is not None
    assert ended.result.named == ["leak"]
    assert "the compressed file is cut off; read as far as line 10" in ended.result.complaints[0].text
    middle = len(packed) // 2
    for junk in (
        bytes(400),
        bytes(range(255, 55, -1)),
    ):  # caught by the sum at the end, and by the unpacking itself
        file.write_bytes(packed[:middle] + junk + packed[middle + len(junk) :])
        ended = loaderhil("diagnose", file, "--model", model_file(tmp_path))
        assert ended.code == 5
        assert "cut.csv.gz: cannot be read" in ended.out


def test_of_files_joined_the_readable_are_judged(loaderhil: Call, tmp_path: Path) -> None:
    table = columns(record(2, leak=0.08))
    whole = write_csv(tmp_path / "whole.csv", table)
    bad, worse = tmp_path / "bad.csv", tmp_path / "worse.csv"
    bad.write_text("")
    worse.write_bytes(bytes(9))
    ended = loaderhil("diagnose", f"{bad}+{whole}", "--model", model_file(tmp_path))
    assert ended.result is not None
    assert ended.result.named == ["leak"]
    assert any("bad.csv: is empty" in c.text for c in ended.result.complaints)
    ended = loaderhil("diagnose", f"{bad}+{worse}", "--model", model_file(tmp_path))
    assert ended.code == 5
    assert ended.result is not None
    assert "bad.csv: is empty (0 bytes); worse.csv: contains only zero bytes (9)" in ended.result.reasons[0]


def test_a_channel_in_two_joined_files_and_a_recording_given_twice_are_reported(
    loaderhil: Call, tmp_path: Path
) -> None:
    files = [write_csv(tmp_path / f"{seed}.csv", columns(record(seed, leak=0.08))) for seed in (2, 3)]
    ended = loaderhil("diagnose", f"{files[0]}+{files[1]}", "--model", model_file(tmp_path))
    assert ended.result is not None
    assert any("inflow, level: in more than one of the files" in c.text for c in ended.result.complaints)
    ended = loaderhil("diagnose", files[0], tmp_path / "." / "2.csv", "--model", model_file(tmp_path))
    assert ended.code == 2
    assert "is given twice" in ended.err.splitlines()[-1]


def test_bytes_read_as_numbers_are_no_measurement(loaderhil: Call, tmp_path: Path) -> None:
    table = columns(record(2, leak=0.08))
    table["level [m]"][500:520] = -3.7e211
    ended = loaderhil("diagnose", write_csv(tmp_path / "a.csv", table), "--model", model_file(tmp_path))
    assert ended.result is not None
    assert ended.result.named == ["leak"]
    assert "20 of 1200 values are larger than 1e+30" in ended.result.complaints[0].text


def test_a_channel_that_has_nothing_to_do_with_the_model_is_no_wrong_sign(
    loaderhil: Call, tmp_path: Path
) -> None:
    """Noise fits half a change of sign best, which is no reading at all; a level that runs backwards nearly so."""
    table = columns(record(2))
    level = table["level [m]"]
    for other in (np.random.default_rng(1).normal(0.0, 1.0, level.size), level[::-1].copy()):
        file = write_csv(tmp_path / "a.csv", table | {"level [m]": other})
        ended = loaderhil("diagnose", file, "--model", model_file(tmp_path))
        assert ended.code == 1
        assert ended.result is not None
        assert (ended.result.status, ended.result.named) == ("unknown", [])


def test_inputs_that_never_move_are_reported(loaderhil: Call, tmp_path: Path) -> None:
    table = columns(record(2))
    for still, complained in ((np.full(1200, 0.5), True), (table["inflow [m/s]"], False)):
        file = write_csv(tmp_path / "a.csv", table | {"inflow [m/s]": still})
        ended = loaderhil("diagnose", file, "--model", model_file(tmp_path))
        assert ended.result is not None
        assert any("no input changes (inflow)" in c.text for c in ended.result.complaints) is complained


def test_damaged_cells_and_lines_cost_themselves_only(loaderhil: Call, tmp_path: Path) -> None:
    lines = write_csv(tmp_path / "drive.csv", columns(record(2, leak=0.08))).read_text().splitlines()
    lines[100] = lines[100].rsplit(",", 1)[0] + ",###"
    lines[200] = "1,2"
    (tmp_path / "drive.csv").write_text("\n".join(lines))
    ended = loaderhil("diagnose", tmp_path / "drive.csv", "--model", model_file(tmp_path))
    assert ended.code == 0
    assert ended.result is not None
    said = " ".join(c.text for c in ended.result.complaints)
    assert "the first in line 101" in said
    assert "line 201 has 2 of 3 cells" in said


def test_a_reversed_or_slow_sensor_is_an_effect_and_no_damage(loaderhil: Call, tmp_path: Path) -> None:
    """What the library can name must not be thrown out as failing_channels."""
    for truth, effect in (
        ({"sign": -1.0}, "level sign"),
        ({"delay_s": 0.45}, "level delay"),
        ({"lag_s": 1.2}, "level lag"),
    ):
        file = write_csv(tmp_path / "drive.csv", columns(record(3, **truth)))
        ended = loaderhil("diagnose", file, "--model", model_file(tmp_path))
        assert ended.result is not None
        assert ended.result.findings[0].effect == effect


def test_misuse_is_one_line_and_exit_code_2(loaderhil: Call, tmp_path: Path) -> None:
    file, model = write_csv(tmp_path / "drive.csv", columns(record(2))), model_file(tmp_path)
    (tmp_path / "raises.py").write_text("x = 1\nmodel = undefined\n")
    (tmp_path / "none.py").write_text("x = 1\n")
    for words, expected in (
        ((file, "--model", "submarine"), "there are ball"),
        ((file, "--model", tmp_path / "gone.py"), "no such file"),
        ((file, "--model", tmp_path / "raises.py"), "raises.py, line 2: NameError"),
        ((file, "--model", tmp_path / "none.py"), "does not define `model`"),
        ((tmp_path / "gone.csv", "--model", model), "gone.csv: no such file"),
        ((file, "--model", model, "--channel", "depth=x"), "tank has no such channel; it has inflow, level"),
        ((file, "--model", model, "--shift", "level=soon"), "'soon' is not a number"),
        ((file, "--model", model, "--constant", "mass"), "must read NAME=VALUE"),
    ):
        ended = loaderhil("diagnose", *words)
        assert ended.code == 2, words
        assert expected in ended.err
        assert len(ended.err.strip().splitlines()) == 1


def test_findings_json_is_what_the_schema_in_the_repository_says(loaderhil: Call, tmp_path: Path) -> None:
    from discrepancy.signals.findings import SCHEMA

    schema = json.loads(SCHEMA.read_text())
    file = write_csv(tmp_path / "drive.csv", columns(record(2, leak=0.08)))
    ended = loaderhil("diagnose", file, "--model", model_file(tmp_path))
    assert ended.result is not None
    assert set(schema["required"]) <= set(json.loads((tmp_path / "out0" / "findings.json").read_text()))
