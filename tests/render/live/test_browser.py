"""The live page in a real browser: it draws, its buttons work, a click senses, no request goes elsewhere."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest

from browsing import HARD_TO_READ, PATIENCE, SIZES, Watched, colours, complaints, differ, pixels
from tanteo.geometry import SE3
from tanteo.render.live import Player, Quit, extent
from viewer_scenes import TRUE, maker

pytest.importorskip("viser", reason="the extra tanteo[viewer] is not installed")
expect = pytest.importorskip("playwright.sync_api", reason="playwright is not installed").expect

SLACK = 10.0
"""How much slower than a machine that does nothing else the tests may be."""


@pytest.fixture(scope="module")
def live(targets):
    """A player on a page of this machine, with a session of two brackets."""
    from tanteo.render.live.page import LivePage

    make = maker(targets, tolerance=5e-3)
    middle, size = extent(make(0, "largest-face").session.start)
    page = LivePage(8471, middle, size)
    player = Player(make, page, 3, "largest-face", speed=np.inf)
    page.session_controls(player.commands.put, ("largest-face", "nearest"), "largest-face", 3, hand=False)
    thread = threading.Thread(target=player.run)
    thread.start()
    yield page, middle, size, player
    player.commands.put(Quit())
    thread.join(timeout=60)
    page.stop()
    assert not thread.is_alive()


class Live(Watched):
    """The live page in a window."""

    def __init__(self, browser, url, size, query=""):
        super().__init__(browser, f"{url}/?fixedDpr=0.5{query}", size, noise=("error",))
        self.press("Restart")  # this starts again after any earlier session
        self.wait_for_text("No reading yet")

    def wait_for_text(self, words):
        """Wait for words in the page."""
        self.page.get_by_text(words).first.wait_for()

    def press(self, name):
        self.page.get_by_role("button", name=name, exact=True).click()

    def tick(self, name, *, on):
        """Tick a box of the legend and wait for the page."""
        self.page.get_by_label(name, exact=True).click()
        expect(self.page.get_by_label(name, exact=True)).to_be_checked(checked=on)

    def seen(self, unlike=None):
        """Pixels of the picture beside the controls ``(h, w, 3)`` when it has come to rest, and is unlike another."""
        before = None
        for _ in range(PATIENCE // 500):
            now = pixels(self.page.screenshot())
            now = now[300:, :900] if now.shape[1] > 900 else now[150:380]
            rests = before is not None and np.array_equal(now, before) and colours(now) > 10
            if rests and (unlike is None or differ(now, unlike) > 0.002):
                return now
            before = now
            self.page.wait_for_timeout(500)
        raise AssertionError("the picture did not change and come to rest")


@pytest.fixture
def open_page(browser, live, screenshots, request):
    """Open it; at the end a screenshot is kept, and nothing may have gone wrong or out."""
    opened = []

    def call(size, query=""):
        opened.append(Live(browser, live[0].url, size, query))
        return opened[-1]

    yield call
    for watched in opened:
        watched.page.screenshot(path=screenshots / f"live_{request.node.name}.png")
        watched.context.close()
        assert watched.messages == []
        assert all(url.startswith((live[0].url, "data:", f"blob:{live[0].url}")) for url in watched.requests), (
            watched.requests
        )


def pixel(point, middle, size, window):
    """Return the pixel of a point of the world ``(2,)``."""
    from tanteo.render.live.page import FOV, seen_from

    width, height = window
    eye, aim = seen_from(middle, size, 1.6)
    forward = (aim - eye) / np.linalg.norm(aim - eye)
    right = np.cross(forward, [0, 0, 1.0])
    right /= np.linalg.norm(right)
    d = point - eye
    scale = 0.5 * height / np.tan(FOV / 2) / (d @ forward)
    return width / 2 + scale * (d @ right), height / 2 - scale * (d @ np.cross(right, forward))


FOOT = SE3.apply(TRUE, [0.1, 0.04, 0.012])
"""A place on the foot of the bracket, beside its wall."""


def test_a_session_is_played(open_page, live, screenshots):
    watched = open_page("desk")
    page, (_, middle, size, player) = watched.page, live
    first = watched.seen()
    assert colours(first) > 40
    watched.press("Step")
    watched.wait_for_text("Places sensed: 1")
    stepped = watched.seen(unlike=first)
    page.mouse.click(*pixel(FOOT, middle, size, SIZES["desk"]))
    watched.wait_for_text("Places sensed: 2 (1 by you, 1 by the policy)")
    page.screenshot(path=screenshots / "live_clicked.png")
    watched.tick("Beams", on=False)
    watched.seen(unlike=stepped)
    watched.press("Go")
    watched.wait_for_text("distance from the real part")
    watched.wait_for_text("It is bracket_left")
    watched.seen(unlike=first)
    watched.tick("Beams", on=True)
    page.locator("input[role=combobox][value=largest-face]").click()
    page.get_by_role("option", name="nearest").click()
    watched.press("Restart")
    watched.wait_for_text("Places sensed: 0")
    assert player.policy == "nearest"


@pytest.mark.slow
def test_what_else_it_may_be_is_chosen_in_the_legend(open_page):
    watched = open_page("desk")
    one = watched.seen()
    watched.tick("Second most probable part", on=True)
    two = watched.seen(unlike=one)
    watched.tick("Second most probable part", on=False)
    assert differ(one, watched.seen(unlike=two)) < 0.001


@pytest.mark.slow
def test_a_person_plays_against_the_planner(open_page, live):
    watched, (_, middle, size, _) = open_page("desk"), live
    watched.press("You against the planner")
    watched.wait_for_text("Your turn")
    watched.page.mouse.click(*pixel(FOOT, middle, size, SIZES["desk"]))
    watched.wait_for_text("Places sensed: 1, all by you")
    watched.wait_for_text("The planner has sensed 1 place:")
    watched.press("Answer now")
    table = watched.page.get_by_role("table")
    expect(table).to_contain_text("distance from the real part")
    expect(table.get_by_role("columnheader")).to_have_text(["you", "planner"])


def test_the_first_move_is_seen_within_two_seconds(open_page):
    watched = open_page("desk")
    begun = time.monotonic()
    watched.press("Step")
    watched.wait_for_text("Places sensed: 1")
    assert time.monotonic() - begun < 2 * SLACK


SIGNS_OF_VISER = (".mantine-CloseButton-root", ".mantine-ActionIcon-root")
"""Its own buttons, which have a picture and no name."""


@pytest.mark.parametrize(("size", "query"), [("desk", ""), ("phone", "&darkMode")], ids=["light-desk", "dark-phone"])
def test_the_controls_can_be_read_named_and_reached(open_page, size, query):
    watched = open_page(size, query)
    page = watched.page
    assert page.evaluate(HARD_TO_READ, 12) == []
    exclude = [[sign] for sign in SIGNS_OF_VISER]
    assert complaints(page, {"exclude": exclude}, without=("region", "page-has-heading-one", "landmark-one-main")) == []
    page.get_by_role("button", name="Go", exact=True).focus()
    names = []
    for _ in range(30):
        names.append(
            page.evaluate("document.activeElement.textContent || document.activeElement.labels?.[0]?.textContent")
        )
        page.keyboard.press("Tab")
    wanted = (
        "Go",
        "Step",
        "Pause",
        "Restart",
        "You against the planner",
        "Answer now",
        "Second most probable part",
        "Beams",
    )
    assert [name for name in (*wanted, "Policy", "Speed", "Seed") if name not in names] == []


def test_on_a_phone_the_controls_are_a_drawer(open_page):
    watched = open_page("phone")
    page = watched.page
    assert colours(watched.seen()) > 40
    outside = page.evaluate(
        """() => [...document.querySelectorAll(".tanteo *, input, button")].filter((e) => e.getClientRects().length &&
        (e.getBoundingClientRect().right > innerWidth + 1 || e.getBoundingClientRect().left < -1)).length"""
    )
    assert outside == 0
    drawer = page.locator(".mantine-Paper-root").filter(has=page.get_by_role("button", name="Go", exact=True)).last
    box = drawer.bounding_box()
    assert box["width"] == SIZES["phone"][0]
    assert 0.5 * SIZES["phone"][1] < box["y"] < 0.6 * SIZES["phone"][1]
    page.get_by_text("tanteo", exact=True).click()
    watched.until("() => document.querySelector('.mantine-Paper-root').getBoundingClientRect().top > 750")
    page.get_by_text("tanteo", exact=True).click()
    expect(page.get_by_role("button", name="Go", exact=True)).to_be_in_viewport()
