"""The page in a real browser: nothing is fetched, one cursor and one zoom for all, narrow and dark."""

import re
from pathlib import Path

import numpy as np
import pytest

from report.run import write_report

CHROMIUM = next((p for p in ("/usr/bin/chromium", "/usr/bin/chromium-browser") if Path(p).exists()), None)

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium found: apt install chromium"),
    pytest.mark.filterwarnings("default"),  # the driver's own event loop and sockets are not ours to judge
]


@pytest.fixture(scope="module")
def page(runs):
    return write_report(runs, runs[0].parent / "report.html")


@pytest.fixture(scope="module")
def browser():
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"])
        yield browser
        browser.close()


@pytest.fixture
def opened(browser, page):
    """Opens the page; at the end nothing may have been fetched or complained about."""
    trouble, requests, views = [], [], []

    def open_page(width=1280, scheme="light"):
        view = browser.new_page(
            viewport={"width": width, "height": 900}, color_scheme=scheme, reduced_motion="reduce"
        )
        view.on("console", lambda message: trouble.append(message.text))
        view.on("pageerror", lambda error: trouble.append(str(error)))
        view.on("request", lambda request: requests.append(request.url))
        view.goto(page.as_uri())
        views.append(view)
        return view

    yield open_page
    for view in views:
        view.close()
    assert trouble == []
    assert [url for url in requests if not url.startswith(("file:", "data:"))] == []


def plot_of(view, title, run):
    return view.locator("figure.plot", has=view.locator("figcaption", has_text=title)).nth(run)


def hover(view, plot, share):
    """Mouse over the plot at a share of its width; the time that the page shows for it."""
    area = plot.locator(".area")
    area.scroll_into_view_if_needed()
    box = area.bounding_box()
    view.mouse.move(box["x"] + share * box["width"], box["y"] + box["height"] / 2)
    return number(view.locator(".bar .now").text_content())


def number(text):
    return float(re.search(r"[−-]?[\d.]+", text)[0].replace("−", "-"))


def readout(plot, curve):
    return number(plot.locator(".legend li", has_text=curve).locator("output").first.text_content())


def test_the_cursor_shows_the_values_at_the_time_under_the_mouse(opened, runs):
    view = opened()
    with np.load(runs[1] / "truth.npz") as truth:
        time_s, force, speed = truth["time_s"], truth["normal_force"], truth["speed"]
    plot = plot_of(view, "Normal force, front left", 1)
    for share in (0.2, 0.5, 0.8):
        at = hover(view, plot, share)
        assert at == pytest.approx(share * time_s[-1], abs=0.02)
        span = np.ptp(force[:, 0]) * 1e-3
        near = np.interp([at - 0.006, at, at + 0.006], time_s, force[:, 0]) * 1e-3
        assert near.min() - 0.01 * span <= readout(plot, "true") <= near.max() + 0.01 * span
        other = plot_of(view, "Speed", 1)  # the same cursor reads every plot
        assert readout(other, "true") == pytest.approx(3.6 * np.interp(at, time_s, speed), abs=0.1)


def test_the_cursor_reads_the_bands(opened):
    view = opened()
    hover(view, plot_of(view, "Speed", 0), 0.05)
    words = view.locator(".band output").all_text_contents()
    assert "stable" in words
    assert "running" in words


def test_keys_move_and_remove_the_cursor(opened):
    view = opened()
    area = plot_of(view, "Speed", 0).locator(".area")
    area.focus()
    for _ in range(3):
        view.keyboard.press("ArrowRight")
    assert number(view.locator(".bar .now").text_content()) == pytest.approx(0.3, abs=0.01)
    assert area.get_attribute("aria-valuetext").startswith("0.30 s: true ")
    view.keyboard.press("Escape")
    assert not any(view.locator(".legend output").all_text_contents())
    assert view.locator(".bar").is_hidden()


def labels(plot):
    return [number(text) for text in plot.locator(".x span").all_text_contents()]


def test_a_drag_zooms_every_plot_and_a_double_click_shows_all(opened):
    view = opened()
    first, other = plot_of(view, "Speed", 0), plot_of(view, "Payload", 1)
    whole = labels(other)
    area = first.locator(".area")
    area.scroll_into_view_if_needed()
    box = area.bounding_box()
    middle = box["y"] + box["height"] / 2
    view.mouse.move(box["x"] + 0.4 * box["width"], middle)
    view.mouse.down()
    view.mouse.move(box["x"] + 0.6 * box["width"], middle, steps=4)
    view.mouse.up()
    zoomed = labels(other)
    assert min(zoomed) >= 4.0 - 0.02
    assert max(zoomed) <= 6.0 + 0.02
    assert labels(first) == zoomed
    assert hover(view, first, 0.5) == pytest.approx(5.0, abs=0.02)
    area.dblclick()
    assert labels(other) == whole


def test_the_film_follows_the_cursor_and_its_slider(opened):
    view = opened()
    stage, slider = view.locator(".film .stage").first, view.locator(".film input").first
    before = stage.get_attribute("style")
    slider.fill("6.5")
    assert stage.get_attribute("style") != before
    assert number(view.locator(".bar .now").text_content()) == 6.5
    hover(view, plot_of(view, "Speed", 0), 0.1)
    assert float(slider.input_value()) == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize("width", [340, 420, 700, 1200, 1600])
def test_nothing_is_wider_than_the_window(opened, width):
    view = opened(width)
    assert view.evaluate("document.documentElement.scrollWidth") <= width
    beyond = view.evaluate(
        """[...document.querySelectorAll("nav a, h1, h2, figcaption, .card, .verdicts li, .key, .legend li:not([hidden])")]
           .filter((e) => e.getBoundingClientRect().right > window.innerWidth + 0.5).map((e) => e.textContent)"""
    )
    assert beyond == []


def luminance(colour):
    """Relative luminance of a computed `rgb(...)`, WCAG 2."""
    channels = np.array([int(v) for v in re.findall(r"\d+", colour)[:3]]) / 255
    linear = np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)
    return float(linear @ (0.2126, 0.7152, 0.0722))


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_scheme_is_followed_and_text_can_be_read(opened, scheme):
    """Contrast of at least 4.5 between text and what lies behind it (WCAG 2, AA)."""
    view = opened(scheme=scheme)
    pairs = view.evaluate(
        """[...document.querySelectorAll("p, h1, h2, li, td, th, figcaption, nav a, dd, .track i b")]
           .filter((e) => e.textContent.trim() && e.offsetParent).map((e) => {
             let behind = e;
             while (behind && getComputedStyle(behind).backgroundColor === "rgba(0, 0, 0, 0)") behind = behind.parentElement;
             return [getComputedStyle(e).color, getComputedStyle(behind ?? document.body).backgroundColor, e.textContent];
           })"""
    )
    page_colour = view.evaluate("getComputedStyle(document.body).backgroundColor")
    assert (luminance(page_colour) < 0.05) == (scheme == "dark")
    assert len(pairs) > 100
    for ink, paper, text in {(ink, paper): (ink, paper, text) for ink, paper, text in pairs}.values():
        low, high = sorted((luminance(ink), luminance(paper)))
        assert (high + 0.05) / (low + 0.05) >= 4.5, (text[:40], ink, paper)


def test_paper_has_no_controls(opened):
    view = opened()
    view.emulate_media(media="print")
    assert view.locator("nav").is_hidden()
    assert view.locator(".controls").first.is_hidden()
