"""MCAP: every known frame with its stamp and values, in the order of time, under a schema with the DBC's units."""

import io
import json

import pytest

from bus.frame import Frame
from dbc import loader_database
from dbc.columns import ColumnDecoder
from loaderhil.cli import app
from loaderhil.export import ExportError, write_mcap
from testbench.conform.evidence import Bench
from testbench.conform.live import keep
from testbench.frames import table_of
from testbench.restbus.core import RestBus
from testbench.restbus.generators import Sine

reader = pytest.importorskip("mcap.reader")
MS = 1_000_000
DATABASE = loader_database()


def sent(ms=200):
    bus = RestBus(DATABASE, ["Machine"], {"BodyRates.YawRate": Sine(20.0, 0.0, 1.0)})
    return [f._replace(at_ns=(1 + now) * MS) for now in range(ms) for f in bus.due(now * MS)]


def exported(frames):
    out = io.BytesIO()
    counts = write_mcap(table_of(frames), [DATABASE], out)
    out.seek(0)
    return counts, [
        (schema, channel.topic, message.log_time, json.loads(message.data))
        for schema, channel, message in reader.make_reader(out).iter_messages()
    ]


def test_every_frame_has_its_stamp_and_the_values_of_decode():
    frames = sent()
    counts, found = exported([*frames, Frame(0x123, b"\1", 5 * MS)])  # the last is in no DBC
    assert sum(counts.values()) == len(found) == len(frames)
    assert [at for _, _, at, _ in found] == sorted(frame.at_ns for frame in frames)
    columns = ColumnDecoder(DATABASE).decode(table_of(frames))["BodyRates"]
    rates = [values["YawRate"] for _, topic, _, values in found if topic == "/BodyRates"]
    assert rates == columns.signals["YawRate"].tolist()


def test_the_schema_has_units_and_value_tables():
    _, found = exported(sent())
    schema = next(s for s, topic, _, _ in found if topic == "/BodyRates")
    assert (schema.name, schema.encoding) == ("BodyRates", "jsonschema")
    properties = json.loads(schema.data)["properties"]
    assert properties["YawRate"]["description"].startswith("[deg/s]")
    assert "3 not_available" in properties["State"]["description"]


def test_nothing_that_a_dbc_knows_is_an_error():
    with pytest.raises(ExportError, match="in any DBC"):
        write_mcap(table_of([Frame(0x123, b"\1", MS)]), [DATABASE], io.BytesIO())


def test_the_command_writes_a_file_that_reads(tmp_path, capsys):
    class Kept:
        record = sent()

    keep(Kept, Bench(), tmp_path)
    with pytest.raises(SystemExit) as ended:
        app(["export", str(tmp_path / "bus.log"), "--out", str(tmp_path / "drive.mcap")])
    assert not ended.value.code
    assert f"{len(Kept.record)} of {len(Kept.record)} frames" in capsys.readouterr().out
    with (tmp_path / "drive.mcap").open("rb") as file:
        assert reader.make_reader(file).get_summary().statistics.message_count == len(Kept.record)
    assert [p.name for p in tmp_path.iterdir() if p.name.startswith(".")] == []
