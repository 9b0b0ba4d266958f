"""A page in a real browser, observed: its messages and requests, and what can be read, reached and named in it."""

from __future__ import annotations

import io

import numpy as np
import pytest

PATIENCE = 90_000
"""How long a busy machine without a graphics card may take for anything [ms]."""

SIZES = {"desk": (1280, 800), "phone": (390, 844)}

_LINES = """
  const lines = [], trouble = [], wide = document.documentElement.clientWidth;
  const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walk.nextNode()) {
    const node = walk.currentNode, owner = node.parentElement;
    if (!node.textContent.trim() || owner.closest("script, style, noscript, title, option")) continue;
    if (!owner.checkVisibility()) continue;
    const range = document.createRange();
    range.selectNodeContents(node);
    const words = node.textContent.trim();
    for (const box of range.getClientRects()) if (box.width > 1 && box.height > 1) lines.push([box, owner, words]);
  }
"""

TEXT_TROUBLE = (
    "() => {"
    + _LINES
    + """
  for (const [box, owner, words] of lines) {
    if (owner.closest(".scroll")) continue;
    if (box.left < -1 || box.right > wide + 1) trouble.push("leaves the page: " + words);
    const cut = owner.closest(".stage, .chart");
    if (cut) {
      const c = cut.getBoundingClientRect();
      const beside = box.left < c.left - 1 || box.right > c.right + 1;
      if (beside || box.top < c.top - 1 || box.bottom > c.bottom + 1) trouble.push("cut off: " + words);
    }
  }
  for (let i = 0; i < lines.length; i++) for (let j = 0; j < i; j++) {
    const [a, , u] = lines[i], [b, , v] = lines[j];
    const x = Math.min(a.right, b.right) - Math.max(a.left, b.left);
    const y = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
    if (x > 1.5 && y > 0.3 * Math.min(a.height, b.height)) trouble.push(`covers: ${u} | ${v}`);
  }
  return trouble;
}"""
)
"""Every line of text that can be seen: does it leave the page, is it cut off, does it cover another?"""

HARD_TO_READ = (
    """(least) => {
  const linear = (v) => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
  const light = (c) => c.slice(0, 3).map((v) => linear(v / 255))
    .reduce((sum, v, k) => sum + v * [0.2126, 0.7152, 0.0722][k], 0.05);
  const canvas = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
  const numbers = (colour) => {
    canvas.clearRect(0, 0, 1, 1);
    canvas.fillStyle = colour;
    canvas.fillRect(0, 0, 1, 1);
    return [...canvas.getImageData(0, 0, 1, 1).data];
  };
  const paper = (e) => {
    for (; e; e = e.parentElement) {
      const c = numbers(getComputedStyle(e).backgroundColor);
      if (c[3] > 230) return c;
    }
    return [255, 255, 255];
  };
"""
    + _LINES
    + """
  for (const [, owner, words] of lines) {
    const style = getComputedStyle(owner), drawn = owner instanceof SVGElement;
    const [a, b] = [light(numbers(drawn ? style.fill : style.color)), light(paper(owner))];
    const contrast = Math.max(a, b) / Math.min(a, b), size = parseFloat(style.fontSize);
    if (size < least || contrast < 4.5) trouble.push(`${words}: ${size} px, ${contrast.toFixed(1)}`);
  }
  return trouble;
}"""
)
"""Words that are small or pale: their text, size and contrast with what is behind them."""

CONTROLS = "a[href], button, input, select, summary, textarea, [tabindex='0']"

REACHABLE = f"""() => [...document.querySelectorAll("{CONTROLS}")].filter((e) => !e.disabled && e.tabIndex >= 0
  && e.checkVisibility({{ visibilityProperty: true }}) && e.type !== "radio")
  .map((e) => {{ e.dataset.wanted = "1"; return e.outerHTML.slice(0, 120); }})"""

FOCUSED = """() => {
  const e = document.activeElement, style = getComputedStyle(e), box = e.getBoundingClientRect();
  const ring = style.outlineStyle !== "none" && parseFloat(style.outlineWidth) > 0;
  const here = e !== document.body, seen = ring || style.boxShadow !== "none" || e.closest(":focus-within label");
  delete e.dataset.wanted;
  return { here, seen: !here || Boolean(seen), what: e.outerHTML.slice(0, 120), top: box.top };
}"""


class Watched:
    """A page with its console messages and network requests.

    Args:
        noise: types of console messages that count as messages; None counts all.
    """

    def __init__(self, browser, url, size, scheme="light", *, offline=False, noise=None):
        self.context = browser.new_context(
            viewport=dict(zip(("width", "height"), SIZES[size], strict=True)), color_scheme=scheme, offline=offline,
            has_touch=size == "phone",
        )  # fmt: skip
        self.page, self.messages, self.requests = self.context.new_page(), [], []
        self.page.set_default_timeout(PATIENCE)
        self.page.on("console", lambda m: self._heard(m.text) if noise is None or m.type in noise else None)
        self.page.on("pageerror", lambda error: self.messages.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.on("websocket", lambda socket: self.requests.append(socket.url.replace("ws://", "http://")))
        self.page.goto(url)
        self.wait_until_quiet()

    def _heard(self, text):
        if "GL Driver Message" not in text:  # the browser about its own screenshots
            self.messages.append(text)

    def wait_until_quiet(self):
        """Wait until what was wanted has been drawn."""
        self.page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def until(self, expression):
        """Wait until an expression is true; Python evaluates it, since the policy of a report allows no page to do
        so."""
        for _ in range(PATIENCE // 50):
            if self.page.evaluate(expression):
                return
            self.page.wait_for_timeout(50)
        raise AssertionError(expression)


def pixels(png):
    """Return the pixels of a screenshot ``(h, w, 3)``, from 0 to 1."""
    from matplotlib.image import imread

    return imread(io.BytesIO(png))[..., :3]


def colours(picture):
    """Return the number of colours."""
    return len(np.unique((picture.reshape(-1, 3) * 31).astype(int), axis=0))


def differ(one, other):
    """Share of the pixels that are not the same."""
    return float(np.mean(np.abs(one - other).max(axis=-1) > 0.04))


def complaints(page, context=None, without=()):
    """Return what axe-core finds about names, roles, order and contrast, one line for each finding."""
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="axe-playwright-python is not installed")
    rules = {name: {"enabled": False} for name in without}
    found = (
        axe.Axe()
        .run(page, context, {"resultTypes": ["violations"], "rules": rules, "preload": False})
        .response["violations"]
    )
    return [f"{v['id']}: {node['html'][:200]}" for v in found for node in v["nodes"]]


def not_reached(page):
    """Return the controls that Tab does not reach, and those without a visible focus."""
    wanted = page.evaluate(REACHABLE)
    unseen = []
    for _ in range(len(wanted) + 5):
        page.keyboard.press("Tab")
        at = page.evaluate(FOCUSED)
        if not at["seen"]:
            unseen.append(f"not seen: {at['what']}")
        left = page.evaluate("() => [...document.querySelectorAll('[data-wanted]')].map((e) => e.outerHTML)")
        if not left:
            break
    return [*unseen, *(text[:120] for text in left)]
