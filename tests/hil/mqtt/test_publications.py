"""What is published to a broker: each new state once, the newest only, and what changed for better or worse."""

import json

import pytest

from bus.frame import ERROR, Frame
from dbc import FOLDER, loader_database
from dbc.database import Database
from hil.monitor.board import Board
from hil.monitor.decoded import JsonView
from hil.monitor.messages import Messages, Selection
from hil.monitor.source import Batch
from hil.mqtt.broker import Broker, BrokerError
from hil.mqtt.publications import Publication, Publisher, Topics
from tests.hil.monitor.traffic import MS, can_id_of, machine_frames, messages

TOPICS = Topics("bench")
ARTICULATION = can_id_of("Articulation")


def published(publisher: Publisher, board: Board, now_ns: int) -> list[Publication]:
    return list(publisher.due(board.rows(now_ns), now_ns))


def findings(publications: list[Publication]) -> list[tuple[str, str]]:
    events = [json.loads(each.payload) for each in publications if each.topic == TOPICS.findings]
    return [(event["message"], event["finding"]) for event in events]


def test_the_newest_state_of_each_message_is_what_the_monitor_prints() -> None:
    board = Board(messages())
    for frame in machine_frames():
        board.take("can0", frame)
    now_ns = max(frame.at_ns for frame in machine_frames())
    newest = {frame.can_id: frame for frame in machine_frames()}
    lines = JsonView(messages()).text(Batch([("can0", frame) for frame in newest.values()], 0)).splitlines()
    expected = {f"bench/bus/can0/{json.loads(line)['message']}": json.loads(line) for line in lines}
    publications = published(Publisher(TOPICS), board, now_ns)
    assert all(each.retain for each in publications)
    states = {each.topic: json.loads(each.payload) for each in publications}
    periods = {topic: state.pop("period_ms") for topic, state in states.items()}
    assert states == expected
    by_name = loader_database().by_name
    assert periods == {
        topic: pytest.approx(by_name[state["message"]].cycle_ns / MS) for topic, state in states.items()
    }


def test_a_state_is_published_again_only_if_the_broker_may_have_lost_it() -> None:
    board, publisher = Board(messages(messages=["Articulation"])), Publisher(TOPICS)
    board.take("can0", Frame(ARTICULATION, bytes(8), 1))
    first = [each for each in published(publisher, board, 2) if each.retain]
    assert len(first) == 1
    assert published(publisher, board, 3) == []
    publisher.renew()
    again = published(publisher, board, 4)
    assert [each.topic for each in again] == [each.topic for each in first]
    assert published(publisher, board, 5) == []


def test_states_that_were_never_published_are_counted() -> None:
    board, publisher = Board(messages(messages=["Articulation"])), Publisher(TOPICS)
    for at_ns in range(10):
        board.take("can0", Frame(ARTICULATION, bytes(8), at_ns))
    published(publisher, board, 10)
    assert publisher.superseded == 9


def test_silence_and_its_end_are_findings_once() -> None:
    board, publisher = Board(messages(messages=["LiftPressure"])), Publisher(TOPICS)
    can_id = can_id_of("LiftPressure")
    for index in range(10):
        board.take("can0", Frame(can_id, bytes(8), index * 20 * MS))
    last_ns = 9 * 20 * MS
    at = (last_ns, last_ns + 40 * MS, last_ns + 70 * MS, last_ns + 90 * MS)
    assert [findings(published(publisher, board, now_ns)) for now_ns in at] == [
        [],
        [],
        [("LiftPressure", "stale")],
        [],
    ]
    board.take("can0", Frame(can_id, bytes(8), last_ns + 100 * MS))
    assert findings(published(publisher, board, last_ns + 100 * MS)) == [("LiftPressure", "in time again")]


def test_a_slow_message_is_one_finding_though_each_gap_is_late_too() -> None:
    board, publisher = Board(messages(messages=["LiftPressure"])), Publisher(TOPICS)
    said = []
    for index in range(20):
        board.take("can0", Frame(can_id_of("LiftPressure"), bytes(8), index * 36 * MS))
        said += findings(published(publisher, board, index * 36 * MS))
        said += findings(published(publisher, board, index * 36 * MS + 35 * MS))
    assert said == [("LiftPressure", "slow")]


def test_a_message_that_never_comes_is_a_finding() -> None:
    board, publisher = Board(messages(messages=["LiftPressure", "TiltPressure"])), Publisher(TOPICS)
    for index in range(10):
        board.take("can0", Frame(can_id_of("LiftPressure"), bytes(8), index * 20 * MS))
        now_ns = index * 20 * MS
        said = findings(published(publisher, board, now_ns))
        assert said == ([("TiltPressure", "missing")] if index == 4 else [])


def test_broken_protection_and_error_frames_are_findings() -> None:
    board, publisher = Board(messages()), Publisher(TOPICS)
    board.take("can0", Frame(ARTICULATION, b"\1" + bytes(7), 0))
    board.take("can0", Frame(ERROR | 0x40, bytes(8), 0))
    said = dict(findings(published(publisher, board, 0)))
    assert "CRC" in said["Articulation"]
    assert said["error frame"] == "bus off"
    assert findings(published(publisher, board, 1)) == []


def test_topics_survive_any_name_and_tell_j1939_senders_apart() -> None:
    engine = Database.from_file(FOLDER / "j1939.dbc", strict=False)
    codec = next(codec for codec in engine.by_id.values() if codec.is_j1939)
    board = Board(Messages([engine], Selection()))
    other = codec.can_id ^ 0x01
    for can_id in (codec.can_id, other):
        board.take("a/b+#", Frame(can_id, bytes(codec.length)))
    topics = [each.topic for each in published(Publisher(TOPICS), board, 0) if each.retain]
    assert sorted(topics) == [
        f"bench/bus/a_b__/{codec.name}",
        f"bench/bus/a_b__/{codec.name}/{other & 0x1FFFFFFF:08X}",
    ]


@pytest.mark.parametrize(
    ("text", "host", "port"),
    [
        ("localhost:1884", "localhost", 1884),
        ("broker", "broker", 1883),
        ("[::1]:9", "::1", 9),
        ("[::1]", "::1", 1883),
    ],
)
def test_a_broker_is_named_by_host_and_port(text: str, host: str, port: int) -> None:
    assert Broker.parse(text) == Broker(host=host, port=port)


@pytest.mark.parametrize("text", ["", ":1883", "host:", "host:x", "host:0", "host:65536"])
def test_what_names_no_broker_is_refused(text: str) -> None:
    with pytest.raises(BrokerError, match="write HOST:PORT"):
        Broker.parse(text)
