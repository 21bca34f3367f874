"""The A2L file, read by another's reader, says what the ECU's own tables say."""

import re
from types import SimpleNamespace

import pytest
from pya2l.parser import A2lParser
from typer.testing import CliRunner

from dbc import loader_database
from deploy.a2l.document import write_a2l
from ecu.calibration import calibration_table
from ecu.measure.channel import EXAMPLE, Channel
from ecu.measure.measurements import measurements
from ecu.measure.parameters import calibration_numbers
from ecu.xcp.memory import EPK_ADDRESS, epk
from loaderhil.cli import app

CHANNEL = Channel.parse(EXAMPLE, loader_database())


@pytest.fixture(scope="module")
def read():
    text = write_a2l("l60", CHANNEL)
    with A2lParser() as parser:
        tree = parser.tree_from_a2l(text.encode())
        warnings = list(parser.warnings)
    return SimpleNamespace(text=text, module=tree.PROJECT.MODULE[0], warnings=warnings)


def test_another_reader_finds_no_fault(read):
    lines = read.text.splitlines()
    for warning in read.warnings:
        # pya2l 0.4.0 takes the end of every block in IF_DATA for a second one; of anything else it does not complain
        assert "at most once" in warning
        assert lines[int(warning.split(":")[0]) - 1].strip().startswith("/end ")


def test_every_measurement_has_address_type_and_unit(read):
    units = {m.Name.Value: m.Unit.Value for m in read.module.COMPU_METHOD}
    found = {m.Name.Value: m for m in read.module.MEASUREMENT}
    assert list(found) == [row.name for row in measurements()]
    for row in measurements():
        m = found[row.name]
        assert (m.ECU_ADDRESS.Address.Value, m.DataType.Value) == (row.address, row.type)
        assert units[m.Conversion.Value] == ("" if row.choices else row.unit)
        assert m.LongIdentifier.Value == row.comment.replace('"', "'")


def test_names_are_identifiers_that_a_tool_takes(read):
    """ASAP2: letters, digits, underscores and points, at most 1024 characters, and 128 between two points."""
    module = read.module
    named = [*module.MEASUREMENT, *module.CHARACTERISTIC, *module.COMPU_METHOD, *module.COMPU_VTAB]
    for item in named:
        for part in item.Name.Value.split("."):
            assert re.fullmatch(r"[A-Za-z_]\w{0,127}", part, re.ASCII), item.Name.Value
    for kind in (module.COMPU_METHOD, module.COMPU_VTAB):
        names = [item.Name.Value for item in kind]
        assert len(set(names)) == len(names)


def test_every_number_of_the_calibration_has_its_range(read):
    found = {c.Name.Value: c for c in read.module.CHARACTERISTIC}
    assert list(found) == [number.name for number in calibration_numbers()]
    for number in calibration_numbers():
        c = found[number.name]
        assert c.Address.Value == number.address
        assert (c.LowerLimit.Value, c.UpperLimit.Value) == (number.quantity.low, number.quantity.high)
        assert c.READ_ONLY.Present == (not number.adjustable)


def test_every_number_of_the_file_can_be_read(read):
    names = {c.Name.Value for c in read.module.CHARACTERISTIC}
    for section, values in calibration_table().values.items():
        if isinstance(values, dict):
            assert {f"{section}.{key}" for key in values if key != "source"} <= names


def test_words_of_states_are_those_of_the_dbc(read):
    tables = {t.Name.Value: t for t in read.module.COMPU_VTAB}
    methods = {m.Name.Value: m for m in read.module.COMPU_METHOD}
    state = next(m for m in read.module.MEASUREMENT if m.Name.Value == "state")
    table = tables[methods[state.Conversion.Value].COMPU_TAB_REF.ConversionTable.Value]
    words = {int(pair.InVal.Value): pair.OutVal.Value for pair in table.InValOutVal}
    assert words == loader_database().by_name["EcuStatus"].by_signal["State"].choices


def test_the_version_text_is_the_ecus(read):
    module = read.module.MOD_PAR
    assert module.EPK.Identifier.Value == epk().decode()
    assert [each.Address.Value for each in module.ADDR_EPK] == [EPK_ADDRESS]


def test_groups_name_members_that_exist(read):
    names = {m.Name.Value for m in read.module.MEASUREMENT} | {
        c.Name.Value for c in read.module.CHARACTERISTIC
    }
    grouped = re.findall(r"/begin REF_\w+\n\s+(.*)\n", read.text)
    assert sorted(" ".join(grouped).split()) == sorted(names)


def test_the_command_writes_the_file_of_a_calibration(tmp_path):
    out = tmp_path / "deep" / "compact.a2l"
    result = CliRunner().invoke(
        app, ["export-a2l", str(out), "--calibration", "compact", "--xcp", "0x600,0x601"]
    )
    assert result.exit_code == 0, result.output
    assert "PROJECT loaderhil_compact" in out.read_text()
    assert "CAN_ID_MASTER 0x600" in out.read_text()
