"""The report in a real browser, offline: it draws, it switches, nothing overlaps, no request leaves the page."""

from __future__ import annotations

import numpy as np
import pytest

from browsing import HARD_TO_READ, SIZES, TEXT_TROUBLE, Watched, colours, complaints, differ, not_reached, pixels
from report_scenes import ROUGH, SD, TOUCH, TRUTH, touched_session, touches
from tanteo.planning import discriminate, plan
from tanteo.planning.start import at_pose
from tanteo.posterior import prepare
from tanteo.recognition import identify, locate
from tanteo.render.html import Run, distinction_page, gather, plan_page, report_page, session_page, write_report
from tanteo.sensors import Readings

expect = pytest.importorskip("playwright.sync_api", reason="playwright is not installed").expect

NAMES = ("clear", "several", "none", "session", "plan", "twins")

SMALLEST = 11.5
"""Letters of a page, in charts and on phones too [px]."""


class Report(Watched):
    """A report, read from a file without a network."""

    def __init__(self, browser, file, size, scheme):
        super().__init__(browser, file.as_uri(), size, scheme, offline=True)
        self.file = file

    def picture(self):
        """Return the shown pixels of the canvas ``(h, w, 3)``."""
        self.wait_until_quiet()
        return pixels(self.page.locator("#view").screenshot())[5:-5, 5:-5]  # less the frame that a focus draws


@pytest.fixture(scope="module")
def files(tmp_path_factory, wedge, near_wedge):
    """Reports: one answer with a wrong reading, several answers, none; a session, a plan, a reading for twins."""
    folder = tmp_path_factory.mktemp("reports")
    rng = np.random.default_rng(1)
    clear = touches(wedge, rng, wrong=(7,))
    write_report(
        folder / "clear.html", report_page(locate(clear, wedge), gather(clear), [wedge], Run("tanteo locate c.csv"))
    )
    open_ = touches(wedge, rng, planes=[0, 1])
    several = identify(open_, [wedge, near_wedge])
    assert len(several.hypotheses) > 1
    both = report_page(several, gather(open_), [wedge, near_wedge], Run("tanteo identify x.csv"))
    write_report(folder / "several.html", both)
    few = Readings.from_columns(points=clear.points[:2], sds=np.full(2, SD))
    write_report(
        folder / "none.html", report_page(locate(few, wedge), gather(few), [wedge], Run("tanteo locate f.csv"))
    )
    write_report(folder / "session.html", session_page(touched_session(wedge, near_wedge), Run("tanteo replay s.json")))
    planned = plan(at_pose(prepare(wedge), TRUTH, ROUGH), TOUCH, 2e-4)
    write_report(folder / "plan.html", plan_page(planned, wedge, TOUCH, 2e-4, 0.95, Run("tanteo plan --part w.stl")))
    twins = discriminate(prepare(wedge), prepare(near_wedge), TOUCH)
    write_report(folder / "twins.html", distinction_page(twins, [wedge, near_wedge], TOUCH, Run("tanteo plan")))
    return {path.stem: path for path in folder.glob("*.html")}


@pytest.fixture
def open_page(browser, files):
    """Open a report; at the end there may be no message and no request."""
    opened = []

    def call(name, size="desk", scheme="light"):
        opened.append(Report(browser, files[name], size, scheme))
        return opened[-1]

    yield call
    for watched in opened:
        watched.context.close()
        assert watched.messages == []
        assert watched.requests == [watched.file.as_uri()]


@pytest.mark.quick_sets(6)
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(
    ("size", "scheme"),
    [
        ("desk", "light"),
        ("phone", "dark"),
        *(pytest.param(*pair, marks=pytest.mark.slow) for pair in (("desk", "dark"), ("phone", "light"))),
    ],
)
def test_every_page_can_be_read(open_page, screenshots, name, size, scheme):
    """Nothing overlaps, is cut off, pale, small or without a name, folded or open; a phone's page is short."""
    watched = open_page(name, size, scheme)
    page = watched.page
    if size == "phone":
        assert page.evaluate("document.documentElement.scrollHeight") <= 3000
    assert page.evaluate(TEXT_TROUBLE) == []
    page.evaluate("() => document.querySelectorAll('details').forEach((d) => { d.open = true; })")
    assert page.evaluate(TEXT_TROUBLE) == []
    assert page.evaluate(HARD_TO_READ, SMALLEST) == []
    assert page.evaluate("document.documentElement.scrollWidth <= document.documentElement.clientWidth")
    if size == "desk":
        assert complaints(page) == []
    picture = watched.picture()
    assert colours(picture) > 10
    page.screenshot(path=screenshots / f"report_{name}_{size}_{scheme}.png", full_page=True)


def test_everything_is_reached_by_the_keyboard(open_page):
    page = open_page("several").page
    page.evaluate("() => document.querySelectorAll('details').forEach((d) => { d.open = true; })")
    assert not_reached(page) == []
    page.locator("input[name=hypothesis]").first.focus()
    page.keyboard.press("ArrowDown")
    expect(page.locator("input[name=hypothesis]").nth(1)).to_be_checked()


@pytest.mark.parametrize("size", SIZES)
def test_the_picture_is_drawn(open_page, size):
    picture = open_page("clear", size).picture()
    background = picture[2, 2]
    assert differ(picture, np.broadcast_to(background, picture.shape)) > 0.1
    assert colours(picture) > 40


def test_a_plan_has_arrows_with_numbers(open_page):
    watched = open_page("plan")
    page, before = watched.page, watched.picture()
    numbers, names = page.locator("#overlay text").all_text_contents(), page.evaluate("scene.readings.names")
    assert set(names) <= set(numbers)
    page.locator("[data-layer=names]").uncheck()
    watched.wait_until_quiet()
    assert len(page.locator("#overlay text").all()) < len(numbers)
    page.locator("[data-layer=readings]").uncheck()
    assert differ(before, watched.picture()) > 0.005


def test_the_ghosts_of_a_direction_can_be_shown(open_page):
    watched = open_page("session")
    page, before = watched.page, watched.picture()
    page.locator("[data-way='2']:visible").click()
    assert page.locator(".overlays:visible select").input_value() == "2"
    assert differ(before, watched.picture()) > 0.003


def test_the_answer_and_the_picture_are_on_the_first_screen(open_page):
    watched = open_page("clear")
    for place in ("h1", "#view", ".bars", "dl"):
        box = watched.page.locator(place).first.bounding_box()
        assert box["y"] + box["height"] <= 800, place


def test_choosing_a_hypothesis_changes_everything(open_page):
    watched = open_page("several")
    before = watched.picture()
    shown = "() => [...document.querySelectorAll('[data-h]')].filter((e) => !e.hidden).map((e) => e.dataset.h)"
    assert set(watched.page.evaluate(shown)) == {"0"}
    watched.page.locator("input[name=hypothesis]").nth(1).check()
    assert set(watched.page.evaluate(shown)) == {"1"}
    assert differ(before, watched.picture()) > 0.005
    watched.page.locator("input[name=hypothesis]").nth(0).check()
    assert differ(before, watched.picture()) < 0.001


def test_ghosts_layers_and_views_can_be_changed(open_page):
    watched = open_page("clear")
    page, before = watched.page, watched.picture()
    page.locator(".overlays select").select_option("1")
    other = watched.picture()
    assert differ(before, other) > 0.003
    page.locator(".overlays select").select_option("")
    without = watched.picture()
    assert differ(before, without) > 0.003
    for layer in ("readings", "beams", "sticks"):
        page.locator(f"[data-layer={layer}]").uncheck()
        less = watched.picture()
        assert differ(without, less) > 0.0003, layer
        without = less
    pictures = []
    for view in ("top", "front", "side", "reset"):
        page.locator(f"[data-view={view}]").click()
        pictures.append(watched.picture())
    assert min(differ(a, b) for i, a in enumerate(pictures) for b in pictures[:i]) > 0.05


def test_it_turns_and_zooms_and_comes_back(open_page):
    watched = open_page("clear")
    page, before = watched.page, watched.picture()
    box = page.locator("#view").bounding_box()
    x, y = box["x"] + 40, box["y"] + 60
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 90, y + 30, steps=4)
    page.mouse.up()
    turned = watched.picture()
    assert differ(before, turned) > 0.05
    page.mouse.wheel(0, -300)
    assert differ(turned, watched.picture()) > 0.05
    page.locator("#view").press("0")
    page.mouse.move(1, 1)
    assert differ(before, watched.picture()) < 0.02


def test_the_wheel_scrolls_the_page_until_picture_was_clicked(open_page):
    watched = open_page("clear")
    box = watched.page.locator("#view").bounding_box()
    watched.page.mouse.move(box["x"] + 60, box["y"] + 60)
    watched.page.mouse.wheel(0, 200)
    watched.until("scrollY > 50")


def test_pointing_at_a_reading_names_it(open_page):
    watched = open_page("clear")
    page = watched.page
    x, y = page.evaluate("() => picture.project(picture.place(7))")
    box = page.locator("#view").bounding_box()
    page.mouse.move(box["x"] + x, box["y"] + y)
    expect(page.locator("#tip")).to_be_visible()
    words = page.locator("#tip").inner_text()
    assert words.startswith("reading 8, side 1: ")
    assert words.endswith("does not fit")
    page.mouse.move(1, 1)
    expect(page.locator("#tip")).to_be_hidden()


@pytest.mark.parametrize("size", SIZES)
def test_the_wrong_reading_is_named_in_the_picture_and_the_chart(open_page, size):
    page = open_page("clear", size).page
    assert page.locator("#overlay text.wrong").text_content().startswith("8: 2.")
    assert page.locator(".chart text.wrong").text_content() == "8"


def test_the_command_can_be_copied(open_page):
    watched = open_page("clear")
    watched.page.locator("#copy").click()
    watched.until("document.getElementById('copy').textContent === 'Copied'")


def test_without_the_means_to_draw_the_rest_is_there(open_page):
    watched = open_page("clear")
    watched.page.add_init_script("HTMLCanvasElement.prototype.getContext = () => null;")
    watched.page.reload()
    watched.requests[1:] = []
    expect(watched.page.locator("#no3d")).to_contain_text("cannot draw the picture")
    expect(watched.page.locator("#view")).to_be_hidden()
    expect(watched.page.locator(".chart")).to_be_visible()


@pytest.mark.parametrize("size", SIZES)
def test_the_part_fills_the_picture(open_page, size):
    watched = open_page("clear", size)
    seen = "() => { const p = unpack(scene.seen, Float32Array); return picture.project([p[0], p[1], p[2]]); }"
    assert len(watched.page.evaluate(seen)) == 2
    picture = watched.picture()
    marked = np.abs(picture - picture[2, 2]).max(axis=-1) > 0.1
    filled = [np.ptp(np.flatnonzero(marked.any(axis=k))) / marked.shape[1 - k] for k in (0, 1)]
    assert max(filled) > 0.7


def test_paper_has_the_picture_and_all_sections(open_page):
    page = open_page("clear", "phone", "dark").page
    page.evaluate("() => window.dispatchEvent(new Event('beforeprint'))")
    page.emulate_media(media="print")
    assert page.locator(".fold:not([open])").count() == 0
    assert page.locator("#printed").is_visible()
    assert page.locator("#view").is_hidden()
    assert page.evaluate("getComputedStyle(document.documentElement).backgroundColor") == "rgb(255, 255, 255)"
    page.emulate_media(media="screen")
    page.evaluate("() => window.dispatchEvent(new Event('afterprint'))")
    assert page.locator("#printed").count() == 0
    assert page.locator(".fold[open]").count() == 1
