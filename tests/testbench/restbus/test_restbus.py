"""The rest bus: cyclic and event messages, counters and CRC as receivers want them, generators, orders, hooks."""

import math
import selectors
import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bus.address import open_transport
from configuration.table import ConfigurationError
from dbc import FOLDER, loader_database
from dbc.database import Database
from dbc.protection import Checker, Finding
from dbc.protections import ProtectionError, read_protections
from hil.check.check import Rules, check
from testbench.frames import table_of
from testbench.restbus.core import RestBus, RestBusError
from testbench.restbus.generators import Constant, Count, Noise, Points, Ramp, Sine, Square
from testbench.restbus.values import Order, Values, values_for
from tests.examples.test_foreign_nodes import hub  # noqa: F401

MS = 1_000_000
LOADER = FOLDER / "loader.dbc"


def frames_of(bus, *, ms, orders=()):
    """What a rest bus sends within a time, stamped; orders: (ms, line)."""
    sent, waiting = [], sorted(orders)
    for now in range(ms):
        while waiting and waiting[0][0] <= now:
            Order.parse(waiting.pop(0)[1]).give(bus, now * MS)
        sent += [frame._replace(at_ns=now * MS) for frame in bus.due(now * MS)]
    return sent


@pytest.mark.parametrize("node", ["Machine", "EstimatorEcu"])
def test_any_node_of_the_dbc_passes_the_check(node):
    bus = RestBus(loader_database(), [node], values_for(LOADER, None).generators if node == "Machine" else {})
    done = check(table_of(frames_of(bus, ms=1000)), [loader_database()], Rules(nodes=(node,)))
    assert done.passed, (done.overall, done.intact)
    names = {one.verdict.name for one in done.messages}
    assert names == {n for n, c in loader_database().by_name.items() if node in c.senders}


def test_start_values_of_the_dbc_are_sent():
    (frame,) = [
        f for f in RestBus(loader_database(), ["Machine"]).due(20 * MS)
        if f.can_id == loader_database().by_name["BodyAcceleration"].can_id
    ]  # fmt: skip
    sent = loader_database().by_name["BodyAcceleration"].decode_dict(frame.data)
    assert sent["Vertical"] == pytest.approx(9.81)


def test_a_stopped_message_stays_away_and_its_counter_goes_on():
    codec = loader_database().by_name["BodyRates"]
    bus = RestBus(loader_database(), ["Machine"])
    sent = frames_of(bus, ms=300, orders=[(100, "stop BodyRates"), (200, "resume BodyRates")])
    times = [f.at_ns // MS for f in sent if f.can_id == codec.can_id]
    assert not [t for t in times if 100 <= t < 200]
    counters = [f.data[1] & 0xF for f in sent if f.can_id == codec.can_id]
    assert counters == [k % 15 for k in range(len(counters))]


def test_a_missed_time_is_skipped_not_made_up_for():
    bus = RestBus(loader_database(), ["Machine"])
    bus.due(0)
    late = [f.can_id for f in bus.due(500 * MS)]
    assert len(late) == len(set(late))


EVENTS = """VERSION ""
BS_:
BU_: A B
BO_ 256 Both: 8 A
 SG_ Level : 0|8@1+ (1,0) [0|200] "" B
BO_ 257 OnChange: 2 A
 SG_ Level : 0|8@1+ (1,0) [0|200] "" B
BO_ 258 Select: 4 A
 SG_ Kind M : 0|8@1+ (1,0) [0|255] "" B
 SG_ First m3 : 8|8@1+ (1,0) [0|255] "" B
 SG_ Second m5 : 8|16@1- (0.5,0) [-100|100] "" B
BO_ 259 Wide: 8 A
 SG_ Raw : 0|32@1- (1,0) [0|0] "" B
 SG_ Float : 32|32@1- (1,0) [0|0] "" B
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_ BO_ "GenMsgSendType" ENUM "cyclic","event";
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_DEF_DEF_ "GenMsgSendType" "cyclic";
BA_ "GenMsgCycleTime" BO_ 256 100;
BA_ "GenMsgSendType" BO_ 256 1;
BA_ "GenMsgSendType" BO_ 257 1;
BA_ "GenMsgCycleTime" BO_ 258 20;
BA_ "GenMsgCycleTime" BO_ 259 20;
SIG_VALTYPE_ 259 Float : 1;
"""


@pytest.fixture
def events(tmp_path):
    file = tmp_path / "events.dbc"
    file.write_text(EVENTS)
    return Database.from_file(file)


def times_of(frames, can_id):
    return [frame.at_ns // MS for frame in frames if frame.can_id == can_id]


def test_event_messages_are_sent_on_change_and_on_demand(events):
    sent = frames_of(
        RestBus(events, ["A"]), ms=250,
        orders=[(50, "OnChange.Level = 7"), (120, "send OnChange"), (130, "Both.Level = 3")],
    )  # fmt: skip
    assert times_of(sent, 257) == [50, 120]
    assert times_of(sent, 256) == [0, 100, 130, 200]  # cyclic as well
    assert next(f.data[0] for f in sent if f.can_id == 257) == 7


def test_multiplexed_and_unbounded_signals_have_values_that_can_be_sent(events):
    sent = frames_of(
        RestBus(events, ["A"]), ms=30, orders=[(5, "Select.Kind = 5"), (6, "Select.Second = -20")]
    )
    last = [events.by_id[258].decode_dict(f.data) for f in sent if f.can_id == 258]
    assert last[0] == {"Kind": 3, "First": 0}
    assert last[1] == {"Kind": 5, "Second": -20}


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("Nothing.Level = 1", "not sent here; there are"),
        ("Both.Nothing = 1", "has no signal 'Nothing'; it has Level"),
        ("Both.Level = much", "is no value"),
        ("Both.Level = 300", "does not fit"),
        ("jump Both", "write Message.Signal = VALUE"),
    ],
)
def test_an_order_that_means_nothing_says_what_would(events, line, said):
    bus = RestBus(events, ["A"])
    with pytest.raises(RestBusError, match=said):
        Order.parse(line).give(bus, 0)
    assert bus.due(0)  # and the bus goes on with the old value


def test_a_name_of_the_value_table_is_a_value():
    bus = RestBus(loader_database(), ["EstimatorEcu"])
    bus.set("EcuStatus.State", "degraded")
    codec = loader_database().by_name["EcuStatus"]
    frame = next(f for f in bus.due(MS * 20) if f.can_id == codec.can_id)
    assert codec.decode_dict(frame.data)["State"] == 2


@given(st.floats(0, 1000), st.floats(0.01, 100))
def test_generators_keep_to_their_bounds_and_period(time_s, period_s):
    for generator in (Sine(2.0, 1.0, period_s), Square(-1.0, 3.0, period_s), Ramp(-1.0, 3.0, period_s)):
        assert -1.0 - 1e-9 <= generator.value(time_s, 0) <= 3.0 + 1e-9
    assert Sine(2.0, 1.0, period_s).value(period_s / 4, 0) == pytest.approx(3.0)
    assert Square(-1.0, 3.0, period_s).value(period_s * 0.75, 0) == -1.0
    assert Ramp(0.0, 8.0, period_s).value(period_s / 2, 0) == pytest.approx(4.0)


def test_points_are_joined_by_straight_lines():
    curve = Points((1.0, 3.0), (10.0, 20.0))
    assert [curve.value(t, 0) for t in (0, 1, 2, 3, 9)] == [10, 10, 15, 20, 20]


def test_noise_repeats_by_its_seed_and_has_its_deviation():
    values = [Noise(5.0, 2.0, 7).value(0.0, k) for k in range(4000)]
    assert values == [Noise(5.0, 2.0, 7).value(9.0, k) for k in range(4000)]
    mean = sum(values) / 4000
    assert abs(mean - 5.0) < 5 * 2.0 / math.sqrt(4000)
    assert math.sqrt(sum((v - mean) ** 2 for v in values) / 4000) == pytest.approx(2.0, rel=0.06)
    assert [Count(3).value(0.0, k) for k in range(5)] == [0, 1, 2, 0, 1]


def test_the_values_file_of_a_dbc_serves_each_of_its_nodes():
    """loader.values.toml is about the machine, and is read by itself for the ECU too."""
    values = values_for(FOLDER / "loader.dbc", None)
    for node in ("Machine", "EstimatorEcu"):
        bus = RestBus(loader_database(), [node], values.generators)
        assert bus.due(MS * 20)
    with pytest.raises(RestBusError, match="'Nonsense': not sent here"):
        RestBus(loader_database(), ["EstimatorEcu"], {"Nonsense.Level": Constant(1.0)})


def test_a_values_file_has_values_generators_and_a_script(tmp_path):
    file = tmp_path / "v.toml"
    file.write_text(
        '[values]\n"Both.Level" = 4\n[[generator]]\nsignal = "OnChange.Level"\nkind = "ramp"\nlow = 0\nhigh = 10\n'
        'period_s = 1\n[[at]]\ntime_s = 0.2\ndo = ["Both.Level = 5", "stop Both"]\n'
    )
    read = Values.from_file(file)
    assert set(read.generators) == {"Both.Level", "OnChange.Level"}
    assert [(t, o.verb, o.name) for t, o in read.script] == [
        (0.2, "set", "Both.Level"),
        (0.2, "stop", "Both"),
    ]
    file.write_text('[[generator]]\nsignal = "A.B"\nkind = "triangle"\n')
    with pytest.raises(ConfigurationError, match=r"generator.*kind"):
        Values.from_file(file)


HOOK = '''
class Sum:
    """Counter 0..255 in byte 6, inverted sum in byte 7."""

    counters = 256

    def protect(self, data, counter):
        body = data[:6] + bytes([counter])
        return body + bytes([255 - sum(body) % 256])

    def intact(self, data):
        return data[7] == 255 - sum(data[:7]) % 256

    def counter(self, data):
        return data[6]


PROTECTIONS = {"Both": Sum()}
'''


class TestHooks:
    @pytest.fixture
    def hooked(self, events, tmp_path):
        file = tmp_path / "sums.py"
        file.write_text(HOOK)
        events.protect_with(read_protections(file))
        return events

    def test_sender_and_receiver_use_the_users_protection(self, hooked):
        sent = [f for f in frames_of(RestBus(hooked, ["A"]), ms=3000) if f.can_id == 256]
        checker = Checker(hooked.by_name["Both"])
        found = [checker.check(frame.data, frame.at_ns) for frame in sent]
        assert found == [Finding.INITIAL] + [Finding.OK] * 29
        broken = bytes([sent[5].data[0] ^ 1]) + sent[5].data[1:]
        assert checker.check(broken, sent[-1].at_ns + 100 * MS) is Finding.WRONG_CRC

    def test_check_judges_by_it(self, hooked):
        sent = frames_of(RestBus(hooked, ["A"]), ms=3000)
        assert check(table_of(sent), [hooked]).intact.result.value == "PASSED"
        spoilt = [f._replace(data=bytes(8)) if f.can_id == 256 and f.at_ns == 1000 * MS else f for f in sent]
        done = check(table_of(spoilt), [hooked])
        assert "Both: 1 of 30 frames with a wrong CRC" in done.intact.reason
        lost = [f for f in sent if not (f.can_id == 256 and f.at_ns == 1000 * MS)]
        (both,) = [
            one.verdict for one in check(table_of(lost), [hooked]).messages if one.verdict.name == "Both"
        ]
        assert both.counter_jumps == 1

    @pytest.mark.parametrize(
        ("text", "said"),
        [
            ("x = 1\n", "has no PROTECTIONS"),
            ("PROTECTIONS = {'Both': 3}\n", "has no counters and no protect"),
            ("1 / 0\n", "ZeroDivisionError"),
        ],
    )
    def test_a_file_that_is_none_says_why(self, tmp_path, text, said):
        file = tmp_path / "bad.py"
        file.write_text(text)
        with pytest.raises(ProtectionError, match=said):
            read_protections(file)

    def test_a_message_that_is_not_there_is_refused(self, events):
        with pytest.raises(ProtectionError, match="no message 'Engine'"):
            events.protect_with({"Engine": object()})


@pytest.mark.processes
@pytest.mark.timeout(300)
def test_the_command_sends_and_takes_orders(hub):  # noqa: F811
    codec = loader_database().by_name["DriverDemand"]
    heard = []
    with open_transport(f"hub:{hub}") as bus:
        command = [
            sys.executable,
            "-m",
            "loaderhil",
            "restbus",
            f"hub:{hub}",
            "--node",
            "Machine",
            "--for-s",
            "2",
        ]
        with subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        ) as sender:
            sender.stdin.write("DriverDemand.BrakeDemand = 50\nnonsense\n")
            sender.stdin.close()
            with selectors.DefaultSelector() as selector:
                selector.register(bus.fileno(), selectors.EVENT_READ)
                while selector.select(0.0 if sender.poll() is not None else 0.2) or sender.poll() is None:
                    heard += bus.drain()
            said = sender.stderr.read()
    assert sender.returncode == 0, said
    assert "write Message.Signal = VALUE" in said
    assert "frames sent" in said
    demands = [codec.decode_dict(f.data)["BrakeDemand"] for f in heard if f.can_id == codec.can_id]
    assert demands[-1] == 50
    assert {f.can_id for f in heard} == {
        c.can_id for c in loader_database().by_name.values() if "Machine" in c.senders
    }
