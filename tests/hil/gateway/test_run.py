"""A run with a gateway, as processes over two hubs: both buses carry the same frames, every hop is timed."""

import os
import signal

import numpy as np
import pytest

from hil.ending import Ending
from hil.gateway.histograms import read_log, tag_of
from hil.gateway.hops import AGE, PROCESSING, REACTION
from hil.judgement import timing_of
from hil.rundir import RunDirectory
from tests.hil.processes.test_realtime import children, end, fewest_reactions, started, wait_until_ticking

pytestmark = [pytest.mark.processes, pytest.mark.timeout(240)]


def frames_of(log):
    """(identifier, data) of every line, in order."""
    return [line.split(" ")[2] for line in log.read_text().splitlines()]


@pytest.mark.parametrize("core", ["python", "c"])
def test_a_run_over_two_hubs_loses_nothing_and_times_every_hop(scenario, tmp_path, core):
    out = tmp_path / "run"
    with started("run", scenario(3.0), "--gateway", "--ecu-core", core, "--out", out) as process:
        code, errors = end(process)
    assert errors == ""
    assert code in (Ending.PASSED, Ending.FAILED)  # a busy host may miss deadlines
    run = RunDirectory.read(out)
    assert run.problems == ()
    figures = run.record.statistics
    assert figures["gateway_plant_received"] == figures["gateway_ecu_sent"] == figures["plant_sent"]
    assert figures["gateway_ecu_received"] == figures["gateway_plant_sent"] == figures["ecu_sent"]
    assert figures["ecu_received"] == figures["plant_sent"]
    plant, ecu = frames_of(out / "bus.log"), frames_of(out / "ecu-bus.log")
    assert sorted(plant) == sorted(ecu)
    samples = run.messages["Articulation"].signals["SampleSequence"]
    assert np.all(np.diff(samples) == 1)
    assert len(samples) == len(run.truth["time_s"])

    timing = timing_of(run)
    assert timing.dropped == 0
    hops = timing.hops
    assert hops[REACTION].count > fewest_reactions(run)
    assert all(hop.median > 0 for hop in hops.values())
    assert hops[PROCESSING].median < hops[REACTION].median
    assert hops[AGE].median < 10e6 + hops[PROCESSING].p99
    logged = read_log(out / "latency.hlog")
    assert set(logged) == {tag_of(name) for name in hops}
    for name, spread in hops.items():
        assert logged[tag_of(name)].get_total_count() == spread.count
        assert logged[tag_of(name)].get_value_at_percentile(50) == pytest.approx(spread.median, rel=0.1)


@pytest.mark.parametrize(("victim", "code"), [("gateway", Ending.PEER_DIED), ("hub", Ending.HUB_LOST)])
def test_a_killed_process_is_named(scenario, tmp_path, victim, code):
    out = tmp_path / "run"
    with started("run", scenario(60.0), "--gateway", "--out", out) as process:
        wait_until_ticking(process, out)
        pid = children(process.pid)[victim]
        os.kill(pid, signal.SIGKILL)
        ended, errors = end(process)
    assert ended == code
    assert len(errors.splitlines()) == 1
    assert f"{victim} process ({pid}) was killed by SIGKILL" in errors
    assert len(RunDirectory.read(out).messages["Articulation"].time_s) > 0


def test_buses_without_a_gateway_are_a_mistake(scenario, tmp_path):
    with started("run", scenario(1.0), "--ecu-bus", "hub:@x", "--out", tmp_path / "run") as process:
        code, errors = end(process)
    assert code == Ending.MISUSED
    assert errors == "loaderhil: --ecu-bus is about a gateway; add --gateway, or leave it out\n"
