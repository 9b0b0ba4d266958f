"""The live page in a real browser: it draws, its buttons work, a click senses, nothing is asked of anybody else."""

from __future__ import annotations

import io
import threading

import numpy as np
import pytest

from tanteo.lie import SE3
from tanteo.viewer import Player, Quit
from tanteo.viewer.view import extent
from viewer_scenes import TRUE, maker

pytest.importorskip("viser", reason="the extra tanteo[viewer] is not installed")
expect = pytest.importorskip("playwright.sync_api", reason="playwright is not installed").expect

PATIENCE = 90_000
"""A busy machine without a graphics card draws slowly [ms]."""

SIZES = {"desk": (1280, 800), "phone": (390, 844)}


@pytest.fixture(scope="module")
def live(targets):
    """A player on a page of this machine, with a session of two brackets."""
    from tanteo.viewer.page import LivePage

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


# Words that are small or pale: their text, size and contrast with what is behind them.
HARD_TO_READ = """() => {
  const linear = (v) => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
  const light = (c) => c.slice(0, 3).map((v) => linear(v / 255))
    .reduce((sum, v, k) => sum + v * [0.2126, 0.7152, 0.0722][k], 0.05);
  const numbers = (colour) => colour.match(/[\\d.]+/g).map(Number);
  const paper = (e) => {
    for (; e; e = e.parentElement) {
      const c = numbers(getComputedStyle(e).backgroundColor);
      if (c.length < 4 || c[3] > 0.9) return c;
    }
    return [255, 255, 255];
  };
  const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT), trouble = [];
  while (walk.nextNode()) {
    const node = walk.currentNode, owner = node.parentElement;
    if (!node.textContent.trim() || owner.closest("script, style") || !owner.checkVisibility()) continue;
    const style = getComputedStyle(owner), [a, b] = [light(numbers(style.color)), light(paper(owner))];
    const contrast = Math.max(a, b) / Math.min(a, b), size = parseFloat(style.fontSize);
    if (size < 12 || contrast < 4.5) trouble.push(`${node.textContent}: ${size} px, ${contrast.toFixed(1)}`);
  }
  return trouble;
}"""


class Watched:
    """The page in a window, what it said and asked for."""

    def __init__(self, browser, url, size):
        self.context = browser.new_context(
            viewport=dict(zip(("width", "height"), size, strict=True)), has_touch=size[0] < 500
        )
        self.page, self.errors, self.asked = self.context.new_page(), [], []
        self.page.set_default_timeout(PATIENCE)
        self.page.on("console", lambda m: self.errors.append(m.text) if m.type == "error" else None)
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.on("websocket", lambda socket: self.asked.append(socket.url.replace("ws://", "http://")))
        self.page.goto(url)
        self.until("Places sensed: ")

    def until(self, words):
        """Wait for words in the page."""
        self.page.get_by_text(words).first.wait_for()

    def press(self, name):
        self.page.get_by_role("button", name=name, exact=True).click()

    def seen(self):
        """Pixels of the picture beside the controls ``(h, w, 3)``, when it has come to rest."""
        from matplotlib.image import imread

        before = None
        self.page.wait_for_timeout(1000)
        for _ in range(20):
            now = imread(io.BytesIO(self.page.screenshot()))[..., :3]
            now = now[300:, :900] if now.shape[1] > 900 else now[180:320]
            if before is not None and np.array_equal(now, before):
                return now
            before = now
            self.page.wait_for_timeout(500)
        return before


def colours(picture):
    return len(np.unique((picture.reshape(-1, 3) * 31).astype(int), axis=0))


def differ(one, other):
    """Share of the pixels that are not the same."""
    return float(np.mean(np.abs(one - other).max(axis=-1) > 0.04))


@pytest.fixture
def open_page(browser, live, tmp_path, request):
    """Open it; at the end a screenshot is kept, and nothing may have gone wrong or out."""
    opened = []

    def call(size):
        opened.append(Watched(browser, f"{live[0].url}/?fixedDpr=0.5", SIZES[size]))
        return opened[-1]

    yield call
    for watched in opened:
        watched.page.screenshot(path=tmp_path / f"{request.node.name}.png")
        watched.context.close()
        assert watched.errors == []
        assert all(url.startswith((live[0].url, "data:", f"blob:{live[0].url}")) for url in watched.asked), (
            watched.asked
        )


def pixel(point, middle, size, window):
    """Where a place of the world is seen ``(2,)``."""
    from tanteo.viewer.page import FOV, seen_from

    width, height = window
    eye, look_at = seen_from(middle, size, 1.6)
    forward = (look_at - eye) / np.linalg.norm(look_at - eye)
    right = np.cross(forward, [0, 0, 1.0])
    right /= np.linalg.norm(right)
    d = point - eye
    scale = 0.5 * height / np.tan(FOV / 2) / (d @ forward)
    return width / 2 + scale * (d @ right), height / 2 - scale * (d @ np.cross(right, forward))


def test_a_session_is_played(open_page, live, tmp_path):
    watched = open_page("desk")
    watched.until("Places sensed: 0")
    page, (_, middle, size, player) = watched.page, live
    first = watched.seen()
    assert colours(first) > 40
    assert page.evaluate(HARD_TO_READ) == []
    watched.press("Step")
    watched.until("Places sensed: 1")
    stepped = watched.seen()
    assert differ(first, stepped) > 0.002
    # on the foot of the bracket, beside its wall
    page.mouse.click(*pixel(SE3.apply(TRUE, [0.1, 0.04, 0.012]), middle, size, SIZES["desk"]))
    watched.until("Places sensed: 2 (1 by you, 1 by the policy)")
    page.screenshot(path=tmp_path / "clicked.png")
    page.get_by_text("What is drawn").click()
    page.get_by_label("Beams").click()
    expect(page.get_by_label("Beams")).not_to_be_checked(timeout=PATIENCE)
    assert differ(watched.seen(), stepped) > 0.002
    watched.press("Go")
    watched.until("alone needs")
    watched.until("It is bracket_left")
    ended = watched.seen()
    assert differ(first, ended) > 0.01
    page.locator("input[role=combobox][value=largest-face]").click()
    page.get_by_role("option", name="nearest").click()
    watched.press("Restart")
    watched.until("Places sensed: 0")
    assert player.policy == "nearest"


def test_on_a_phone_the_part_is_seen_above_the_controls(open_page):
    watched = open_page("phone")
    assert colours(watched.seen()) > 40
    outside = watched.page.evaluate(
        """() => [...document.querySelectorAll(".tanteo *")].filter((e) => e.getClientRects().length &&
        (e.getBoundingClientRect().right > innerWidth + 1 || e.getBoundingClientRect().left < -1)).length"""
    )
    assert outside == 0
