"""Many arms on dask.distributed: what a killed worker, a failing arm or an interrupted run does not lose or repeat."""

import os
import signal
import threading
import time
from pathlib import Path

import psutil
import pyarrow.parquet as pq
import pytest

from diagnosis.fleet.cluster import NoCluster, Tally, carry_out, client_of
from diagnosis.fleet.store import NotOurs, Store
from tests.diagnosis.fleet.worked import note

WORK = {"what": "notes", "commit": "abc"}
PATIENCE_S = 60.0


def arms(log: Path, *names: str, **special: dict[str, str]) -> dict[str, dict[str, str]]:
    return {name: {"name": name, "log": str(log), **special.get(name, {})} for name in names}


def begun(log: Path) -> list[str]:
    """Names in the order in which workers began them."""
    return [line.split()[0] for line in log.read_text().splitlines()] if log.exists() else []


def process_of(log: Path, name: str) -> int:
    """The worker that is at an arm."""
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        for line in log.read_text().splitlines() if log.exists() else []:
            if line.split()[0] == name:
                return int(line.split()[1])
        time.sleep(0.02)
    raise TimeoutError(name)


def test_a_row_is_kept_as_it_was_and_another_work_is_refused(tmp_path: Path) -> None:
    store = Store(tmp_path, WORK)
    row = {"text": "a/b: ä", "number": 0.1 + 0.2, "whole": 3, "flag": True, "none": None}
    store.keep("arm / one", row)
    assert "arm / one" in Store(tmp_path, WORK)
    assert Store(tmp_path, WORK).rows(["arm / one", "other"]) == [{"key": "arm / one", **row}]
    with pytest.raises(NotOurs, match="commit = 'abc', not 'abd'"):
        Store(tmp_path, {**WORK, "commit": "abd"})
    (tmp_path / "work.json").write_text("{")
    with pytest.raises(NotOurs, match="damaged"):
        Store(tmp_path, WORK)


def test_a_row_that_was_not_finished_is_not_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Interrupted between writing and naming the file, the arm counts as not done."""
    store = Store(tmp_path, WORK)

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        store.keep("one", {"a": 1})
    monkeypatch.undo()
    assert "one" not in store
    assert store.rows(["one"]) == []


@pytest.mark.processes
@pytest.mark.timeout(180)
def test_a_killed_worker_loses_nothing_and_repeats_only_what_it_was_at(tmp_path: Path) -> None:
    log, go = tmp_path / "log", tmp_path / "go"
    names = [f"arm{i}" for i in range(8)]
    held = {"until": str(go)}
    wanted, store = arms(log, *names, arm0=held, arm1=held), Store(tmp_path / "out", WORK)

    def kill() -> None:
        os.kill(process_of(log, "arm0"), signal.SIGKILL)
        go.touch()

    killer = threading.Thread(target=kill)
    killer.start()
    tally = carry_out(note, wanted, store, workers=2)
    killer.join()
    assert (tally.done, tally.failures, tally.left) == (8, {}, 0)
    table = pq.read_table(store.collect(wanted, tally.failures)).to_pylist()
    assert sorted(row["name"] for row in table) == names
    again = {name: begun(log).count(name) for name in names}
    assert again["arm0"] == 2
    assert all(count == 1 for name, count in again.items() if name != "arm0")


@pytest.mark.processes
@pytest.mark.timeout(180)
def test_a_run_taken_up_again_does_only_what_is_left(tmp_path: Path) -> None:
    """Arms that raise, whose file is missing or that kill their workers fail alone; the next run tries those and no other."""
    log, store = tmp_path / "log", Store(tmp_path / "out", WORK)
    wanted = arms(
        log, "good", "bad", "gone", "deadly", bad={"do": "raise"}, gone={"do": "miss"}, deadly={"do": "die"}
    )
    heard: list[tuple[int, int]] = []
    first = carry_out(
        note, wanted, store, workers=1, report=lambda t: heard.append((t.left, len(t.failures)))
    )
    assert first.failures["bad"] == "ValueError: no such arm"
    assert first.failures["gone"].startswith("FileNotFoundError")
    assert first.failures["deadly"].startswith("KilledWorker")
    assert (first.done, heard[0], heard[-1]) == (1, (4, 0), (0, 3))
    failed = {r["key"]: r["failed"] for r in pq.read_table(store.collect(wanted, first.failures)).to_pylist()}
    assert failed == {"good": None, **first.failures}
    mended = arms(log, "good", "bad", "gone", "deadly")
    second = carry_out(note, mended, Store(tmp_path / "out", WORK), workers=1)
    assert (second.before, second.done, second.failures) == (1, 3, {})
    assert begun(log).count("good") == 1


@pytest.mark.processes
@pytest.mark.timeout(180)
def test_an_existing_cluster_by_its_address(tmp_path: Path) -> None:
    with client_of(None, 1) as client:
        address = client.scheduler.address
        assert "127.0.0.1" in address
        store = Store(tmp_path / "out", WORK)
        tally = carry_out(note, arms(tmp_path / "log", "one", "two"), store, scheduler=address)
    assert tally.done == 2


@pytest.mark.processes
@pytest.mark.timeout(180)
def test_two_clusters_run_beside_one_another_and_listen_on_the_loopback_only() -> None:
    with client_of(None, 1), client_of(None, 1):
        me = psutil.Process()
        heard = {
            c.laddr.ip
            for process in (me, *me.children(recursive=True))
            for c in process.net_connections(kind="inet")
            if c.status == psutil.CONN_LISTEN
        }
    assert heard == {"127.0.0.1"}


def test_no_scheduler_there_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("diagnosis.fleet.cluster.PATIENCE_S", 0.5)
    with pytest.raises(NoCluster, match="no scheduler answers there") as error:
        carry_out(note, arms(tmp_path / "log", "one"), Store(tmp_path, WORK), scheduler="tcp://127.0.0.1:9")
    assert "\n" not in str(error.value)


def test_what_is_done_needs_no_cluster(tmp_path: Path) -> None:
    store = Store(tmp_path, WORK)
    store.keep("one", {"name": "one"})
    tally = carry_out(note, arms(tmp_path / "log", "one"), store, scheduler="tcp://127.0.0.1:9")
    assert tally == Tally(1, before=1)
