"""A DBC of a stranger is refused in one line before it costs memory or leaves its folder."""

import subprocess
import sys
from pathlib import Path

import pytest

from dbc.database import Database
from dbc.errors import DatabaseError

DBC = """VERSION ""
NS_ :
BS_:
BU_: Node
BO_ 256 Message: {length} Node
 SG_ Signal : {start}|{bits}@1+ (1,0) [0|0] "{unit}" Node
BA_DEF_ BO_ "SystemMessageLongSymbol" STRING ;
BA_DEF_ SG_ "SystemSignalLongSymbol" STRING ;
BA_DEF_DEF_ "SystemMessageLongSymbol" "";
BA_DEF_DEF_ "SystemSignalLongSymbol" "";
{more}
"""


def written(
    folder: Path, *, length: object = 8, start: object = 0, bits: object = 8, unit: str = "m", more: str = ""
) -> Path:
    file = folder / "stranger.dbc"
    file.write_text(DBC.format(length=length, start=start, bits=bits, unit=unit, more=more))
    return file


def test_the_file_is_read_when_nothing_is_wrong(tmp_path):
    assert Database.from_file(written(tmp_path)).by_name["Message"].signals == ("Signal",)


@pytest.mark.parametrize(
    "name", ["../../x", "/etc/passwd", "a/b", "..", ".hidden", "", "a b", "a\x1b[2J", "x" * 10 + "/.."]
)
@pytest.mark.parametrize("kind", ["Message", "Signal"])
def test_a_long_name_cannot_leave_the_folder(tmp_path, kind, name):
    of = "BO_ 256" if kind == "Message" else "SG_ 256 Signal"
    file = written(tmp_path, more=f'BA_ "System{kind}LongSymbol" {of} "{name}";')
    with pytest.raises(DatabaseError, match=f"{kind.lower()} name"):
        Database.from_file(file, strict=False)


@pytest.mark.parametrize(
    "wrong", [{"length": 4_000_000}, {"length": "9" * 5000}, {"bits": 4_000_000}, {"start": "9" * 30}]
)
def test_sizes_beyond_any_bus_cost_no_memory(tmp_path, wrong):
    """A message of 4 MB took 6.3 GiB; here the reader may take 1 GiB."""
    code = (
        f"import resource; resource.setrlimit(resource.RLIMIT_AS, ({2 << 30}, {2 << 30}))\n"
        "from dbc.database import Database; from dbc.errors import DatabaseError\n"
        f"try: Database.from_file({str(written(tmp_path, **wrong))!r}, strict=False)\n"
        "except DatabaseError as error: print(error)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=100, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "at most 4095 are possible" in done.stdout or "lies outside any message" in done.stdout
    assert len(done.stdout) < 300


def test_texts_of_a_value_table_cannot_steer_a_terminal(tmp_path):
    file = written(tmp_path, unit="\x1b[31m", more='VAL_ 256 Signal 0 "\x1b]0;title\x07" ;')
    signal = Database.from_file(file).by_name["Message"].by_signal["Signal"]
    assert signal.unit == "\\x1b[31m"
    assert signal.choices[0] == "\\x1b]0;title\\x07"
