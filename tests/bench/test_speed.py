"""The page of speeds: figures are read as benchmarks print them, and a loaded machine publishes nothing."""

import subprocess

import pytest

from bench import speed
from bench.speed import FIGURES, Figure, Host, Load, line, line_or_reason, readings
from bench.speed_kept import keep, kept

PRINTED = {
    "row": ("| plant, semi-implicit | 3.40 | 3.31..3.90 | 294 | 1.00 |", "plant, semi-implicit", (3.40, 3.31, 3.90)),
    "row with range in words": ("| collector on, processor | 125 (120 to 140) | 310 (300 to 400) |", "collector on, processor", (125.0, 120.0, 140.0)),
    "line": ("  0.690 us/frame (0.650 to 0.800)  decode", "decode", (0.69, 0.65, 0.80)),
    "line with count": ("   0.164 s  (0.160 to 0.170, n=5)  candump log, column decoder", "candump log, column decoder", (0.164, 0.160, 0.170)),
    "file": ("write .mf4      0.62 us/frame (0.60 to 0.70), python-can    93.17 (90.00 to 99.00): 143.0x (130.0 to 154.9)", "write .mf4", (0.62, 0.60, 0.70)),
    "file of the peer": ("write .mf4      0.62 us/frame (0.60 to 0.70), python-can    93.17 (90.00 to 99.00): 143.0x (130.0 to 154.9)", "write .mf4, python-can", (93.17, 90.0, 99.0)),
}  # fmt: skip


def all_readings(output: str) -> dict[str, tuple[float, float, float]]:
    return {label: value for (_, label), value in readings("any", output).items()}


@pytest.mark.parametrize("form", PRINTED)
def test_figures_are_read_as_benchmarks_print_them(form):
    text, label, expected = PRINTED[form]
    assert all_readings(f"heading\n{text}\n")[label] == expected


def test_headings_and_sentences_hold_no_figures():
    assert (
        all_readings(
            "| | us/step | min..max |\n|---|---:|---:|\nx86_64, Python 3.11.7, n=5\ndecode: 3.9x cantools\n"
        )
        == {}
    )


def test_the_first_of_several_rows_with_one_label_counts():
    assert all_readings("| hub | 54.0 | 50.0..60.0 |\n| hub | 5.90 | 4.10..7.30 |")["hub"][0] == 54.0


FOUND = {("b", "own"): (2.0, 1.0, 4.0), ("b", "peer"): (6.0, 5.0, 7.0), ("b", "bare"): (0.5, 0.5, 0.5)}


def cells(**fields: object) -> list[str]:
    figure = Figure(what="w", unit="us", bench="b", label="own", peer="peer", peer_name="P", floor=lambda r: r["b", "bare"][0], floor_name="F", **fields)  # type: ignore[arg-type]  # fmt: skip
    return [cell.strip() for cell in line(figure, FOUND).strip("|").split("|")]


def test_a_smaller_time_is_faster_than_the_peer_and_further_from_its_floor():
    assert cells() == ["w", "2 us", "1 to 4", "–", "P 6", "3.00", "F 0.5", "4.00"]


def test_a_figure_of_before_stands_beside_that_of_now():
    assert cells(before=3.4)[1:4] == ["2 us", "1 to 4", "3.4"]


def test_of_rates_the_larger_is_faster():
    # the peer does 6 where we do 2: a third as fast; the floor of a rate lies above
    assert cells(more_is_better=True)[5:] == ["0.33", "F 0.5", "0.25"]


def test_a_time_for_so_many_becomes_a_rate_whose_range_turns_round():
    assert cells(per=8.0, more_is_better=True)[1:5] == ["4 us", "2 to 8", "–", "P 1.33"]


def test_a_disturbed_benchmark_gives_the_reason_and_no_figure():
    figure = Figure(what="w", unit="us", bench="b", label="own")
    assert line_or_reason(figure, FOUND, {"b": "the host took 16% of the time away"}).startswith(
        "| w | not measured: the host took 16% of the time away | – |"
    )


def test_a_floor_from_a_disturbed_benchmark_is_left_out():
    figure = Figure(
        what="w", unit="us", bench="b", label="own", floor=lambda r: r["c", "bare"][0], floor_name="F"
    )
    assert line_or_reason(figure, FOUND, {"c": "others"}).split("|")[2:4] == [" 2 us ", " 1 to 4 "]
    with pytest.raises(KeyError):
        line_or_reason(figure, FOUND, {})


def test_a_figure_that_was_not_printed_is_an_error():
    with pytest.raises(KeyError):
        line(Figure(what="w", unit="us", bench="b", label="gone"), FOUND)


def test_every_benchmark_of_the_page_exists():
    assert [f.bench for f in FIGURES if not (speed.ROOT / "bench" / f"{f.bench}.py").is_file()] == []


def host(at: float, busy: float, own: float, stolen: float = 0.0) -> Host:
    return Host(at_s=at, busy_s=busy, stolen_s=stolen, own_s=own)


def test_own_work_is_no_load_and_that_of_others_is(monkeypatch):
    monkeypatch.setattr("os.cpu_count", lambda: 2)
    own = Load.between("x", host(0.0, 0.0, 0.0), host(10.0, 10.5, 10.0))
    assert own.reasons == []
    others = Load.between("x", host(0.0, 0.0, 0.0), host(10.0, 12.0, 10.0))
    assert others.reasons == ["x: others used 0.20 processors (at most 0.10)"]
    stolen = Load.between("x", host(0.0, 0.0, 0.0), host(10.0, 0.0, 0.0, stolen=1.0))
    assert stolen.reasons == ["x: the host took 5.0% of the time away (at most 3%)"]


@pytest.fixture
def loaded_machine(monkeypatch):
    """Others use a processor while the program waits before the first benchmark."""
    moments = iter([host(0.0, 0.0, 0.0), host(5.0, 5.0, 0.0)])
    monkeypatch.setattr(Host, "now", lambda: next(moments))
    monkeypatch.setattr("time.sleep", lambda seconds: None)


def test_a_loaded_machine_measures_and_publishes_nothing(loaded_machine, tmp_path, capsys):
    out = tmp_path / "speed.md"
    assert speed.main(["--out", str(out)]) == speed.INCONCLUSIVE
    assert not out.exists()
    assert "before the first: others used 1.00 processors" in capsys.readouterr().err


def after(*stolen: float) -> list[Host]:
    """What Host.now gives before and after runs of 10 s each, of which the host took these shares of two processors' time."""
    moments = []
    for k, share in enumerate(stolen):
        moments += [host(10.0 * k, 0.0, 0.0), host(10.0 * (k + 1), 0.0, 0.0, stolen=20.0 * share)]
    return moments


@pytest.mark.parametrize(
    ("stolen", "kept", "disturbed", "refused"),
    [((0.0,), "run 1", 0, False), ((0.2, 0.3, 0.0), "run 3", 2, False), ((0.2, 0.3, 0.4), "run 3", 2, True)],
)
def test_a_disturbed_benchmark_runs_again_until_one_run_is_quiet(
    monkeypatch, stolen, kept, disturbed, refused
):
    """The load decides, not the figures: the first quiet run counts, and none after the last try."""
    monkeypatch.setattr("os.cpu_count", lambda: 2)
    moments, runs = iter(after(*stolen)), iter(range(1, 9))
    monkeypatch.setattr(Host, "now", lambda: next(moments))
    monkeypatch.setattr(
        "subprocess.run",
        lambda command, **options: subprocess.CompletedProcess(command, 0, stdout=f"run {next(runs)}"),
    )
    session = speed.Session()
    assert bool(session.measure(["floors"], tries=3)) == refused
    assert session.outputs["floors"] == kept
    assert session.loads[-1].disturbed == disturbed


def test_a_disturbed_benchmark_runs_again_after_the_others(monkeypatch):
    monkeypatch.setattr("os.cpu_count", lambda: 2)
    moments, ran = iter(after(0.0, 0.2, 0.0, 0.0)), []

    def run(command, **options):
        ran.append(command[-1])
        return subprocess.CompletedProcess(command, 0, stdout=f"run {len(ran)}")

    monkeypatch.setattr(Host, "now", lambda: next(moments))
    monkeypatch.setattr("subprocess.run", run)
    session = speed.Session()
    assert session.measure(["floors", "bench_plant", "bench_hub"], tries=3) == []
    assert ran == ["bench.floors", "bench.bench_plant", "bench.bench_hub", "bench.bench_plant"]
    assert [load.name for load in session.loads] == ["floors", "bench_plant", "bench_hub"]
    assert session.outputs["bench_plant"] == "run 4"


def test_runs_that_count_are_taken_up_and_the_others_made_again(monkeypatch, tmp_path):
    monkeypatch.setattr("os.cpu_count", lambda: 2)
    ran = []

    def run(command, **options):
        ran.append(command[-1])
        return subprocess.CompletedProcess(command, 0, stdout=f"run {len(ran)}")

    monkeypatch.setattr("subprocess.run", run)
    moments = iter(after(0.0, 0.2))
    monkeypatch.setattr(Host, "now", lambda: next(moments))
    first = speed.Session(tmp_path)
    assert first.measure(["floors", "bench_hub"], tries=1) != []
    assert set(first.disturbed) == {"bench_hub"}
    moments = iter(after(0.0))
    second = speed.Session(tmp_path)
    assert second.measure(["floors", "bench_hub"], tries=1) == []
    assert ran == ["bench.floors", "bench.bench_hub", "bench.bench_hub"]
    assert second.outputs == {"floors": "run 1", "bench_hub": "run 3"}
    assert [load.name for load in second.loads] == ["floors", "bench_hub"]


def test_a_damaged_file_of_a_kept_run_is_no_run(tmp_path):
    keep(tmp_path, "floors", "printed", Load("floors", 1.0, 0.0, 0.0))
    assert kept(tmp_path, "floors") == ("printed", Load("floors", 1.0, 0.0, 0.0))
    (tmp_path / "floors.json").write_text("{", encoding="utf-8")
    assert kept(tmp_path, "floors") is None
    assert kept(tmp_path, "bench_hub") is None
