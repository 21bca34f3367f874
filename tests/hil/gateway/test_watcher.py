"""The gateway's own check: what is wrong is reported once and counted always, and passed on all the same."""

from bus.frame import Frame
from dbc import loader_database
from dbc.protection import Protector
from dbc.watch import Trouble
from hil.gateway.core import GatewayCore
from hil.gateway.routes import Routes
from hil.gateway.watcher import Watcher

DATABASE = loader_database()
SENSOR, OTHER, LIMITS = (DATABASE.by_name[name] for name in ("Articulation", "BodyRates", "Limits"))
CYCLE = SENSOR.cycle_ns
ROUTES = Routes(DATABASE)


def stream(codec, count, *, start_ns=0):
    """Good frames, one per cycle."""
    protector = Protector(codec)
    return [
        Frame(
            codec.can_id,
            protector.protect(bytes([0, 0, n % 200, 0, 0, 0, 0, 0])),
            start_ns + n * codec.cycle_ns,
        )
        for n in range(count)
    ]


def fed(frames, side="plant"):
    watcher = Watcher(ROUTES)
    for frame in frames:
        watcher.receive(side, frame, frame.at_ns)
    return watcher


def broken(frame):
    return frame._replace(data=bytes([frame.data[0] ^ 0x5A]) + frame.data[1:])


def test_a_sound_stream_is_no_news():
    watcher = fed(stream(SENSOR, 50))
    assert watcher.findings() == []
    assert not watcher.troubles("plant")


def test_a_trouble_is_reported_once_and_counted_each_time():
    frames = stream(SENSOR, 60)
    for n in (20, 40):
        frames[n] = frames[n - 1]._replace(at_ns=frames[n].at_ns)
    watcher = fed(frames)
    reported = [str(finding) for finding in watcher.findings()]
    assert sum("counter repeated" in line for line in reported) == 1
    assert watcher.troubles("plant")["Articulation", Trouble.REPEATED] == 2
    assert not watcher.troubles("ecu")


def test_a_masquerade_is_reported_with_the_message_it_really_is():
    frames = stream(SENSOR, 20)
    foreign = stream(OTHER, 21)[-1]
    frames.append(Frame(SENSOR.can_id, foreign.data, 20 * CYCLE))
    (found,) = fed(frames).findings()
    assert found.what == "CRC is that of another message (BodyRates)"


def test_a_message_that_becomes_invalid_is_reported_and_that_it_is_valid_again():
    frames = stream(SENSOR, 400)
    frames[100:110] = [broken(frame) for frame in frames[100:110]]
    reported = [finding.what for finding in fed(frames).findings()]
    assert [what for what in reported if what.startswith("is ")] == [
        "is invalid"
    ]  # back within the second: not reported
    frames = stream(SENSOR, 700)
    frames[100:400] = [broken(frame) for frame in frames[100:400]]
    reported = [finding.what for finding in fed(frames).findings()]
    assert [what for what in reported if what.startswith("is ")] == ["is invalid", "is valid"]


def test_silence_is_found_only_when_everything_has_been_received():
    core = GatewayCore(ROUTES, watcher=Watcher(ROUTES))
    for frame in stream(SENSOR, 10):
        core.receive("plant", [frame], frame.at_ns)
    late_ns = 9 * CYCLE + 10 * CYCLE
    core.advance(late_ns)  # the gateway may be behind: what it has not read is not silent
    assert core.findings() == []
    core.nothing_came("ecu", late_ns)
    assert core.findings() == []
    core.nothing_came("plant", late_ns)
    assert [finding.what for finding in core.findings()] == ["silent", "is invalid"]


def test_the_core_wakes_up_to_look_for_silence():
    core = GatewayCore(ROUTES, watcher=Watcher(ROUTES))
    assert core.next_ns() is None
    core.receive("plant", stream(SENSOR, 1), 0)
    due = core.next_ns()
    assert due is not None
    assert due <= 3 * CYCLE


def test_broken_frames_are_passed_on_for_their_receiver_to_judge():
    frames = [broken(frame) for frame in stream(SENSOR, 5)]
    core = GatewayCore(ROUTES, watcher=Watcher(ROUTES))
    core.receive("plant", frames, 0)
    assert list(core.waiting("ecu")) == frames
    assert core.findings()


def test_each_side_has_watches_of_its_own():
    watcher = fed(stream(LIMITS, 5), side="ecu")
    watcher.receive("ecu", broken(stream(LIMITS, 6)[-1]), 5 * CYCLE)
    assert sum(watcher.troubles("ecu").values()) == 1
    assert not watcher.troubles("plant")
