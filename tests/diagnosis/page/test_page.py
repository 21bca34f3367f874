"""The report: self-contained, well formed, and with all that a reader needs."""

import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from diagnosis.page import page
from diagnosis.page.heat import LEVELS, level
from diagnosis.page.page import SHOWN_CARDS
from diagnosis.page.profile import profile
from diagnosis.page.sentences import better, clause, percent, sentence
from discrepancy.decision.evidence import Evidence, RegimeCell, evidence, held_out_prediction
from discrepancy.decision.judgement import Judgement
from discrepancy.examine import investigate
from discrepancy.selection.state import Settings
from discrepancy.signals.findings import Estimate, Findings
from discrepancy.signals.recording import Array
from tests.diagnosis.cases import Call, columns, loaderhil, model_file, write_csv
from tests.discrepancy.toys import record, struck, tank

__all__ = ["loaderhil"]
VOID = {"meta", "br", "img", "input", "link", "hr", "mspace", "path", "rect", "wbr"}


class Checker(HTMLParser):
    """Every tag closed in order, ids unique, nothing fetched from elsewhere."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.links: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in VOID:
            self.open.append(tag)
        for name, value in attrs:
            if name == "id" and value:
                self.ids.append(value)
            if name in ("src", "href") and value:
                self.links.append(value)

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            assert self.open.pop() == tag


@pytest.fixture(scope="module")
def leaking() -> tuple[Judgement, Evidence]:
    judged = investigate(tank(), [record(2, leak=0.08)], Settings())
    assert isinstance(judged, Judgement)
    return judged, evidence(judged, Settings())


def test_the_page_says_how_much_is_left_and_where() -> None:
    hit = struck(record(14, leak=0.05), 90.0, 100.0, 0.8)
    judged = investigate(tank("leak"), [hit], Settings(open_ended=False))
    assert isinstance(judged, Judgement)
    text = page(judged.findings, None, [], {})
    head, _, below = text.partition('id="adequacy"')
    for words in (
        "Explained in part",
        "Left out: leak, and more",
        "Beyond the error budget: 1 of 1 channel",
    ):
        assert words in head
    assert "differences" in below
    Checker().feed(text)


def test_a_wrong_value_of_the_baseline_heads_the_page() -> None:
    model = tank("leak")
    area, level = model.nuisances
    judged = investigate(
        replace(model, nuisances=(replace(area, value=1.2, prior_sd=0.026), level)),
        [record(20)],
        Settings(open_ended=False),
    )
    assert isinstance(judged, Judgement)
    head, _, _ = page(judged.findings, None, [], {}).partition('id="adequacy"')
    for words in (
        "Explained",
        "A value of the baseline is wrong: area is 1, not 1.2",
        "1 value of the baseline is wrong",
    ):
        assert words in head


def test_the_page_is_well_formed_and_fetches_nothing(leaking: tuple[Judgement, Evidence]) -> None:
    judged, shown = leaking
    text = page(judged.findings, shown, ["Type `a <b>`."], {"command": "loaderhil diagnose <x>"})
    checker = Checker()
    checker.feed(text)
    assert checker.open == []
    assert len(set(checker.ids)) == len(checker.ids)
    assert all(link.startswith("#") for link in checker.links)
    assert {link[1:] for link in checker.links} <= set(checker.ids)
    assert "http" not in text.replace("http-equiv", "")
    assert "&lt;x&gt;" in text
    for expected in (
        "Left out: leak",
        "leak = 0.0",
        "level, recorded minus simulated",
        "autocorrelation",
        "Type <code>a &lt;b&gt;</code>.",
        "level delay",
        "area",
    ):
        assert expected in text


def many(shown: Evidence, count: int) -> Evidence:
    """The same with so many channels, the last of which differs most, by signals of which the last matters most."""

    def grown(i: int, values: Array) -> Array:
        return (1.0 + i) * values

    [row], [trace], [spectrum] = shown.time_map, shown.traces, shown.spectra
    names = [f"c{i:02}" for i in range(count)]
    return Evidence(
        traces=[replace(trace, channel=name) for name in names],
        time_map=[replace(row, channel=name, before=grown(i, row.before)) for i, name in enumerate(names)],
        regimes=[
            RegimeCell(channel, signal, regime, (1.0 + i) * (1.0 + j * k), 1.0)
            for i, channel in enumerate(names)
            for j, signal in enumerate(f"s{j:02}" for j in range(count))
            for k, regime in enumerate(("low", "middle", "high"))
        ],
        spectra=[replace(spectrum, channel=n, before=grown(i, spectrum.before)) for i, n in enumerate(names)],
    )


def test_many_channels_are_folded_and_what_differs_most_comes_first(
    leaking: tuple[Judgement, Evidence],
) -> None:
    judged, shown = leaking
    text = page(judged.findings, many(shown, 12), [], {})
    checker = Checker()
    checker.feed(text)
    assert checker.open == []
    drawn = re.findall(r"<figcaption>(c\d\d)[^,:]*</figcaption>", text) or re.findall(
        r"<figcaption>(c\d\d)\b", text
    )
    assert list(dict.fromkeys(drawn))[:3] == ["c11", "c10", "c09"]
    assert set(drawn) == {f"c{i:02}" for i in range(12)}
    assert text.count("<details>") == 2  # traces, spectra
    regimes = text[text.index("By regime") : text.index("Simulated against recorded</h2>")]
    assert "Of 12 channels and 12 signals" in regimes
    assert "c11, before → after" in regimes
    assert "c07, before" not in regimes
    assert re.findall(r"<td>(s\d\d)</td>", regimes) == [f"s{j:02}" for j in range(11, 3, -1)]


def test_an_effect_of_many_values_is_drawn_with_its_intervals() -> None:
    values = [Estimate(name=f"grade.{i}", value=0.01 * i, low=None, high=0.1, unit="rad") for i in range(6)]
    drawn = profile(values)
    assert "grade.0 to grade.5 [rad]" in drawn
    assert drawn.count("<path") == 2 + 3  # grid, zero; either end of the interval, and the value
    assert profile(values[:4]) == ""


def test_a_page_without_a_verdict_says_why_once() -> None:
    reasons = ["a.csv: level is constant at 2 m", "b.csv: is empty"]
    result = Findings(model="tank", recordings=["a.csv"], status="inconclusive", reasons=reasons)
    text = page(result, None, [], {})
    assert "No verdict is possible: a.csv: level is constant at 2 m." in text
    assert text.count("b.csv: is empty") == 1


def test_the_reasons_of_a_verdict_stand_before_its_findings(leaking: tuple[Judgement, Evidence]) -> None:
    judged, _ = leaking
    doubted = replace(judged.findings, reasons=["leak depends on the length of the windows"])
    _, _, found = page(doubted, None, [], {}).partition('id="found"')
    before, _, _ = found.partition("1. leak")
    assert "leak depends on the length of the windows" in before


def test_words_of_the_page() -> None:
    texts = [percent(share).replace("\N{NO-BREAK SPACE}", " ") for share in (0.0, 0.003, 0.18, 0.998, 1.0)]
    assert texts == ["0 %", "under 1 %", "18 %", "over 99 %", "100 %"]
    assert better({"a": 0.001}) == "a error below × 0.01"
    assert better({"a": 0.5, "b": 1.0, "c": 0.1}) == "c error × 0.10; a error × 0.50; others unchanged"
    few = {f"c{i}": 0.1 * i + 0.05 for i in range(8)}
    assert better(few).endswith("2 more channels × 0.65 to 0.75")
    assert better({"a": 1.0}) == "no channel changes"
    assert sentence("accel_x is late") == "accel_x is late."
    assert sentence("There is more.") == "There is more."
    assert clause("There is more.") == "there is more"
    assert clause("CAN frames are late") == "CAN frames are late"
    assert percent(-0.001) == "0\N{NO-BREAK SPACE}%"


def test_held_out_predictions_come_from_the_other_stretches(leaking: tuple[Judgement, Evidence]) -> None:
    """A stretch that is changed beyond recognition changes the parameters for the others and not its own."""
    judged, _ = leaking
    problem, state, settings = judged.problem, judged.state, Settings()
    first = held_out_prediction(problem, state.noise, state.accepted, state.fit.values, settings)
    rows = problem.row_window == 0
    recorded = problem.measured.copy()
    problem.measured[rows] += 0.5 * np.sin(np.arange(np.count_nonzero(rows)))
    second = held_out_prediction(problem, state.noise, state.accepted, state.fit.values, settings)
    problem.measured[:] = recorded
    even, odd = problem.row_window % 2 == 0, problem.row_window % 2 == 1
    assert np.max(np.abs(first - second)[odd]) > 1e-4  # trained on the changed window
    assert np.max(np.abs(first - second)[even & ~rows]) < 1e-9  # trained without it


def test_residuals_shrink_to_the_one_step_error(leaking: tuple[Judgement, Evidence]) -> None:
    _, shown = leaking
    row = shown.time_map[0]
    assert row.after is not None
    assert np.nanmean(row.before) > 1.2
    assert np.nanmean(row.after) == pytest.approx(1.0, abs=0.1)
    spectrum = shown.spectra[0]
    assert spectrum.after is not None
    assert np.mean(spectrum.after) == pytest.approx(1.0, abs=0.15)
    assert spectrum.before[0] > 3.0 * spectrum.after[0]
    assert np.mean(np.abs(spectrum.correlation_after) < spectrum.band) > 0.85  # type: ignore[arg-type]


def test_traces_hold_every_sample_once(leaking: tuple[Judgement, Evidence]) -> None:
    judged, shown = leaking
    drawn = np.concatenate([t.recorded[np.isfinite(t.recorded)] for t in shown.traces])
    assert np.sort(drawn) == pytest.approx(np.sort(judged.problem.measured))


def test_colours_begin_where_the_legend_says() -> None:
    assert [level(edge) for edge in LEVELS] == list(range(1, len(LEVELS) + 1))
    assert level(0.99 * LEVELS[0]) == 0


def test_every_verdict_has_its_page(loaderhil: Call, tmp_path: Path) -> None:
    model = model_file(tmp_path, "level scale", "level bias")
    for name, recording, expected in (
        ("nothing", record(1), "Nothing is missing"),
        ("unknown", record(5, square=0.02, noise=0.005), "the cause is unknown"),
    ):
        loaderhil("diagnose", write_csv(tmp_path / f"{name}.csv", columns(recording)), "--model", model)
        pages = sorted(tmp_path.glob("out*/report.html"))
        assert expected in pages[-1].read_text()
    (tmp_path / "empty.csv").write_text("")
    loaderhil("diagnose", tmp_path / "empty.csv", "--model", model)
    assert "allow no verdict" in sorted(tmp_path.glob("out*/report.html"))[-1].read_text()


def test_a_folder_that_cannot_be_written_is_said_in_one_line(tmp_path: Path, loaderhil: Call) -> None:
    import sys

    from loaderhil import cli

    file, model = write_csv(tmp_path / "a.csv", columns(record(1))), model_file(tmp_path)
    sys.argv[:] = ["loaderhil", "diagnose", str(file), "--model", str(model), "--out", str(file / "below")]
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert ended.value.code == 2


def test_without_findings_the_page_shows_one_curve() -> None:
    """That of the baseline; no row, column or caption says before or after."""
    judged = investigate(tank(), [record(1)], Settings(open_ended=False))
    assert isinstance(judged, Judgement)
    text = page(judged.findings, evidence(judged, Settings()), [], {})
    blind = sum(c.verdict == "could not be judged" for c in judged.findings.candidates)
    assert blind
    assert (
        f"{blind} of the {len(judged.findings.candidates)} effects would not show in these recordings."
        in text
    )
    body = text[text.index("<body") : text.index("Terms</h2>")]
    for word in ("with the effects found", "before", "after"):
        assert word not in re.sub(r"<script.*?</script>|<style.*?</style>", "", body, flags=re.DOTALL)


def test_names_stand_before_proxies_and_what_has_no_card_of_its_own_is_listed(
    leaking: tuple[Judgement, Evidence],
) -> None:
    judged, _ = leaking
    [leak] = judged.findings.findings
    proxies = [replace(leak, effect=f"proxy {i}", named=False) for i in range(SHOWN_CARDS)]
    result = replace(judged.findings, findings=[*proxies, leak])
    _, _, cards = page(result, None, [], {}).partition('<div class="cards">')
    outcomes = re.findall(r'class="outcome">([^<]*)<', cards)
    shown = [x for x in outcomes if "leak" in x or "proxy" in x]
    assert "leak" in shown[0]
    assert shown[1:] == [f"Best proxy: proxy {i}" for i in range(SHOWN_CARDS - 1)]
    assert "1 more" in outcomes
    assert f"best proxy: proxy {SHOWN_CARDS - 1}" in cards
