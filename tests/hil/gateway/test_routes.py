"""Routes: what the DBC says, what a file overrides, and what a file may not say."""

import cantools
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bus.frame import ERROR, EXTENDED, REMOTE
from dbc import FOLDER, loader_database
from hil.gateway.routes import KNOWN_LIMIT, OTHER, SIDES, Fate, Routes
from hil.gateway.settings import Settings, SettingsError, read_settings, routes_of

DATABASE = loader_database()
SIDE_OF = {"Machine": "plant", "EstimatorEcu": "ecu"}


def routes(text, tmp_path):
    file = tmp_path / "routes.toml"
    file.write_text(text)
    return routes_of(read_settings(file), DATABASE, "routes.toml")


def test_every_message_crosses_from_its_sender_to_its_receivers_as_cantools_reads_them():
    table = Routes(DATABASE)
    for message in cantools.database.load_file(FOLDER / "loader.dbc").messages:
        can_id = message.frame_id | EXTENDED
        home = SIDE_OF[message.senders[0]]
        wanted = OTHER[home] in {SIDE_OF[node] for node in message.receivers}
        assert table.fate(home, can_id) is (Fate.PASS if wanted else Fate.UNWANTED)
        assert table.fate(OTHER[home], can_id) is Fate.WRONG_SIDE


def test_what_crosses_in_both_directions_is_the_whole_bus():
    table = Routes(DATABASE)
    names = {codec.name for side in SIDES for codec in table.crossing(side)}
    assert names == set(DATABASE.by_name)
    assert "Articulation" in {codec.name for codec in table.crossing("plant")}
    assert "Limits" in {codec.name for codec in table.crossing("ecu")}


def test_another_j1939_source_address_takes_the_route_of_its_parameter_group():
    pressure = DATABASE.by_name["LiftPressure"].can_id
    assert Routes(DATABASE).fate("plant", pressure & ~0xFF | 0x99) is Fate.PASS


@pytest.mark.parametrize("flag", [ERROR, REMOTE])
def test_error_and_remote_frames_stay_even_where_unknown_ones_pass(flag):
    assert Routes(DATABASE, unknown_passes=True).fate("plant", flag | 0x123) is Fate.NOT_DATA


def test_unknown_identifiers_stay_unless_they_are_let_through():
    assert Routes(DATABASE).fate("ecu", 0x123) is Fate.UNKNOWN
    assert Routes(DATABASE, unknown_passes=True).fate("ecu", 0x123) is Fate.PASS


def test_a_flood_of_identifiers_does_not_fill_the_memory():
    table = Routes(DATABASE)
    for can_id in range(3 * KNOWN_LIMIT):
        table.fate("plant", can_id | EXTENDED)
    assert len(table._fates["plant"]) <= KNOWN_LIMIT
    assert table.fate("plant", DATABASE.by_name["Articulation"].can_id) is Fate.PASS


def test_rules_override_the_database(tmp_path):
    table = routes(
        """
        [[route]]
        message = "VehicleSpeed"
        from = "plant"
        pass = false
        [[route]]
        id = "18FF4A21"
        from = "ecu"
        pass = true
        [[route]]
        id = "7DF"
        from = "plant"
        pass = true
        [[route]]
        message = "Limits"
        from = "plant"
        pass = true
        """,
        tmp_path,
    )
    assert table.fate("plant", DATABASE.by_name["VehicleSpeed"].can_id) is Fate.BLOCKED
    assert table.fate("ecu", 0x18FF4A21 | EXTENDED) is Fate.PASS
    assert table.fate("plant", 0x18FF4A21 | EXTENDED) is Fate.UNKNOWN
    assert table.fate("plant", 0x7DF) is Fate.PASS
    assert table.fate("plant", DATABASE.by_name["Limits"].can_id) is Fate.PASS


def test_the_sides_may_be_named_anew(tmp_path):
    table = routes('[nodes]\nplant = ["EstimatorEcu"]\necu = ["Machine"]\n', tmp_path)
    assert table.fate("ecu", DATABASE.by_name["Articulation"].can_id) is Fate.PASS


def test_without_a_file_nothing_unknown_passes():
    table = routes_of(Settings(), DATABASE, "nothing")
    assert table.fate("plant", 0x1) is Fate.UNKNOWN
    assert table.fate("plant", DATABASE.by_name["Articulation"].can_id) is Fate.PASS


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("unknown = maybe", ("not valid TOML", "line 1")),
        ('unknown = "maybe"', ("unknown", "'drop' or 'pass'", "'maybe'")),
        ("queue_frames = 0", ("queue_frames", "greater than or equal to 1", "got 0")),
        ("queue = 5", ("queue", "no such key")),
        ('[[route]]\nfrom = "plant"', ("route 1.pass", "is missing")),
        ('[[route]]\nfrom = "left"\npass = true\nid = "123"', ("route 1.from", "'plant' or 'ecu'", "'left'")),
        ('[[route]]\nfrom = "plant"\npass = true', ("route 1", "either message or id")),
        (
            '[[route]]\nfrom = "plant"\npass = true\nid = "123"\nmessage = "Limits"',
            ("route 1", "either message or id"),
        ),
        (
            '[[route]]\nfrom = "ecu"\npass = true\nmessage = "Limit"',
            ("route 1", "message", "'Limit'", "did you mean 'Limits'"),
        ),
        ('[[route]]\nfrom = "ecu"\npass = true\nid = "0x12"', ("route 1", "id", "'0x12'", "000 to 7FF")),
        ('[[route]]\nfrom = "ecu"\npass = true\nid = "800"', ("route 1", "'800'")),
        ('[[route]]\nfrom = "ecu"\npass = true\nid = "FFFFFFFF"', ("route 1", "'FFFFFFFF'")),
        (
            '[[route]]\nfrom = "ecu"\npass = true\nid = "123"\n[[route]]\nfrom = "ecu"\npass = false\nid = "123"',
            ("route 2", "earlier route"),
        ),
        ('[nodes]\nplant = ["Digger"]', ("nodes.plant", "'Digger'", "Machine")),
        ('[nodes]\nplant = ["Machine"]\necu = ["Machine"]', ("nodes", "'Machine' is on both sides")),
    ],
)
def test_what_a_file_may_not_say_is_reported_in_one_line(text, parts, tmp_path):
    with pytest.raises(SettingsError) as caught:
        routes(text, tmp_path)
    message = str(caught.value)
    assert "\n" not in message
    assert "routes.toml" in message
    for part in parts:
        assert part in message


def test_a_missing_file_is_reported(tmp_path):
    with pytest.raises(SettingsError, match=r"nothing\.toml: cannot be read: No such file"):
        read_settings(tmp_path / "nothing.toml")


@given(st.integers(0, 0xFFFF_FFFF), st.sampled_from(SIDES))
def test_what_was_decided_once_is_decided_the_same_again(can_id, side):
    table = Routes(DATABASE)
    assert table.fate(side, can_id) is table.fate(side, can_id)
