"""What a fleet needs: laws of the arithmetic, and one plan computed by hand."""

from dataclasses import replace
from itertools import pairwise

import pytest

from bench import scaling
from bench.fleet_needs import Costs, Need, amount, needs
from bus.frame import Frame

COSTS = Costs(
    frames_per_s=2000.0,
    rows_per_s=100.0,
    record_s=0.5e-6,
    decode_s=0.25e-6,
    estimate_s=10e-6,
    task_s=3.6e-3,
    efficiency=0.8,
    recorded_bytes=10.0,
    table_bytes=12.5,
    stream_bytes=16.0,
)


def of(costs: Costs, machines: int, hours: float) -> dict[str, float]:
    return {need.what: need.amount for need in needs(costs, machines, hours)}


def test_ten_thousand_machines_as_computed_by_hand():
    found = of(COSTS, 10_000, 24.0)
    assert found["frames"] == pytest.approx(2e7)
    assert found["frames a day"] == pytest.approx(1.728e12)
    assert found["cores that record"] == pytest.approx(10.0)
    assert found["cores that decode"] == pytest.approx(6.25)
    assert found["cores that estimate"] == pytest.approx(12.5)
    assert found["cores that hand out tasks"] == pytest.approx(0.01)  # 240 000 a day, 3.6 ms each
    assert found["cores to be bought"] == pytest.approx(57.52)  # of which half is used
    assert found["storage of recordings a day"] == pytest.approx(17.28e12)
    assert found["storage of tables a day"] == pytest.approx(21.6e12)
    assert found["network, all machines"] == pytest.approx(2.56e9)
    assert found["network, one machine"] == pytest.approx(256e3)
    assert found["links to be rented"] == pytest.approx(5.12e9)


def test_twice_the_machines_need_twice_of_everything_but_the_link_of_one():
    one, two = of(COSTS, 50, 24.0), of(COSTS, 100, 24.0)
    ratios = {what: two[what] / one[what] for what in one}
    assert ratios.pop("network, one machine") == 1.0
    assert set(ratios.values()) == {2.0}


def test_half_the_hours_halve_what_is_worked_on_over_the_day_but_not_what_comes_at_once():
    whole, half = of(COSTS, 100, 24.0), of(COSTS, 100, 12.0)
    at_once = {
        "frames",
        "cores that record",
        "network, all machines",
        "network, one machine",
        "links to be rented",
    }
    for what in set(whole) - {"cores to be bought"}:
        assert half[what] == pytest.approx(whole[what] * (1.0 if what in at_once else 0.5)), what


def test_workers_that_share_badly_need_more_cores():
    good, bad = of(replace(COSTS, efficiency=1.0), 10, 24.0), of(replace(COSTS, efficiency=0.5), 10, 24.0)
    assert bad["cores that decode"] == 2.0 * good["cores that decode"]
    assert bad["cores that record"] == good["cores that record"]


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (57.52, "cores", "57.5 cores"),
        (1.728e12, "frames", "1.73 Tframes"),
        (2.56e9, "bit/s", "2.56 Gbit/s"),
        (12.0, "B", "12 B"),
    ],
)
def test_amounts_have_three_digits_and_a_prefix(value, unit, text):
    assert amount(Need("any", value, unit, "")) == text


def test_frames_repeated_go_on_in_time():
    drive = [Frame(k, bytes([k]), k * 1000) for k in range(50)]
    many = list(scaling.repeated(drive, 120))
    assert len(many) == 120
    assert [f.data for f in many[50:100]] == [f.data for f in drive]
    assert all(a.at_ns < b.at_ns for a, b in pairwise(many))


def test_a_loaded_machine_writes_no_page(tmp_path, monkeypatch, capsys):
    def busy(name, one, two):
        return scaling.Load(name, 5.0, foreign=0.5, stolen=0.0)

    monkeypatch.setattr(scaling.Load, "between", busy)
    monkeypatch.setattr(scaling, "IDLE_S", 0.0)
    out = tmp_path / "scaling.md"
    assert scaling.main(["--out", str(out)]) == scaling.INCONCLUSIVE
    assert not out.exists()
    assert "others used 0.50 processors" in capsys.readouterr().err
