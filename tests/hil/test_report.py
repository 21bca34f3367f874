"""The report of real lockstep runs: its figures are those of the runs, and it works in a browser."""

import json
import re
import shutil
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from hil.compose import Choice
from hil.judgement import judge_run
from hil.report import write_report
from hil.report.content import load_errors, stretches
from hil.rundir import RunDirectory, RunError
from hil.runs import run_lockstep

VOID = {"meta", "br", "img", "hr", "link", "input"}


class Outline(HTMLParser):
    """Checks nesting, keeps text and what would be fetched."""

    def __init__(self):
        super().__init__()
        self.open, self.text, self.fetched = [], [], []

    def handle_starttag(self, tag, attrs):
        if tag not in VOID:
            self.open.append(tag)
        for name, value in attrs:
            if name in ("src", "href") and not value.startswith("data:"):
                self.fetched.append(value)

    def handle_startendtag(self, tag, attrs):
        pass

    def handle_endtag(self, tag):
        assert self.open, f"</{tag}> without a start"
        assert self.open.pop() == tag

    def handle_data(self, data):
        if not self.open or self.open[-1] not in ("style", "script"):
            self.text.append(data)


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    for limits in (False, True):
        run_lockstep(Choice(scenario="abrupt_articulation", limits=limits), folder / f"limits_{limits}")
    return [folder / "limits_False", folder / "limits_True"]


@pytest.fixture(scope="module")
def page(runs, tmp_path_factory):
    return write_report(runs, tmp_path_factory.mktemp("report") / "report.html")


def outline(page: Path) -> Outline:
    parser = Outline()
    parser.feed(page.read_text(encoding="utf-8"))
    parser.close()
    return parser


def test_the_page_is_well_formed_and_fetches_nothing(page):
    parser = outline(page)
    assert parser.open == []
    assert parser.fetched == []
    assert "url(http" not in page.read_text(encoding="utf-8")
    assert page.stat().st_size < 5_000_000


def test_its_figures_are_those_of_the_runs(page, runs):
    text = " ".join(outline(page).text)
    free = judge_run(RunDirectory.read(runs[0]))
    assert free.lead_s is not None
    assert f"{free.lift_off_s:.2f} s, front left wheel" in text
    assert f"{free.lead_s:.2f} s before lift-off" in text
    limited = judge_run(RunDirectory.read(runs[1]))
    assert f"{100 * limited.margin:.0f} % of standing" in text


def test_the_error_table_is_the_rms_of_estimate_minus_truth(runs):
    """Recomputed from the files, wheel by wheel, up to lift-off."""
    run = RunDirectory.read(runs[1])
    frames, truth = run.messages["NormalForces"], run.truth
    valid = frames.signals["FrontRightValid"] > 0
    true = np.interp(frames.time_s[valid], truth["time_s"], truth["normal_force"][:, 1])
    rms = np.sqrt(np.mean((frames.signals["FrontRight"][valid] * 1e3 - true) ** 2))
    wheel, found, share = load_errors(run)[1]
    assert wheel == "front right"
    assert found == pytest.approx(rms, rel=0.02)  # the last frame lies after the last truth sample
    assert share == pytest.approx(found / truth["normal_force"][0, 1])


def test_stretches_cover_the_time_without_overlap():
    found = stretches([0, 1, 2, 3, 4], [0, 0, 2, 2, 7], {0: "quiet", 1: "odd", 2: "loud"})
    assert found == ((0.0, 2.0, "quiet", 0), (2.0, 4.0, "loud", 2), (4.0, 4.0, "not available", 0))


def test_a_run_that_lost_its_files_still_gives_a_page_that_says_so(runs, tmp_path):
    half = tmp_path / "half"
    shutil.copytree(runs[0], half)
    (half / "truth.npz").unlink()
    log = (half / "bus.log").read_bytes()
    (half / "bus.log").write_bytes(log[: len(log) // 2 + 7])
    record = json.loads((half / "run.json").read_text())
    (half / "run.json").write_text(json.dumps({**record, "outcome": "running"}))
    text = " ".join(outline(write_report([half], tmp_path / "half.html")).text)
    assert "What is missing" in text
    assert "truth.npz" in text
    assert "killed" in text


def test_no_run_is_one_clear_error(tmp_path):
    with pytest.raises(RunError, match="at least one"):
        write_report([], tmp_path / "none.html")
    with pytest.raises(RunError, match="no such run"):
        write_report([tmp_path / "nothing"], tmp_path / "none.html")


def test_a_quiet_run_has_pictures_and_no_alarm(tmp_path):
    run_lockstep(Choice(scenario="standstill"), tmp_path / "still")
    page = write_report([tmp_path / "still"], tmp_path / "still.html")
    text = page.read_text(encoding="utf-8")
    assert text.count("data:image/png") == 1
    assert "no wheel lifted" in text


CHROMIUM = next((p for p in ("/usr/bin/chromium", "/usr/bin/chromium-browser") if Path(p).exists()), None)


@pytest.mark.browser
@pytest.mark.skipif(CHROMIUM is None, reason="no chromium found: apt install chromium")
@pytest.mark.filterwarnings("default")  # the driver's own event loop and sockets are not ours to judge
@pytest.mark.parametrize(("width", "scheme"), [(1280, "light"), (400, "dark")])
def test_in_a_browser(page, width, scheme):
    """No error, no request, nothing wider than the window; one cursor reads all plots, by mouse and by key."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"])
        view = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme)
        trouble, requests = [], []
        view.on("console", lambda message: trouble.append(message.text))
        view.on("pageerror", lambda error: trouble.append(str(error)))
        view.on("request", lambda request: requests.append(request.url))
        view.goto(page.as_uri())
        assert view.evaluate("document.documentElement.scrollWidth") <= width
        plot = view.locator(".plot svg[data-x]").first
        plot.scroll_into_view_if_needed()
        box = plot.bounding_box()
        view.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        read = [text for text in view.locator(".legend output").all_text_contents() if text]
        assert len(read) > 20
        assert all(re.fullmatch(r"−?[\d.e+−-]+", text) for text in read)
        view.mouse.move(0, 0)
        plot.focus()
        view.keyboard.press("ArrowRight")
        assert any(view.locator(".legend output").all_text_contents())
        view.keyboard.press("Escape")
        assert not any(view.locator(".legend output").all_text_contents())
        browser.close()
    assert trouble == []
    assert [url for url in requests if not url.startswith(("file:", "data:"))] == []
