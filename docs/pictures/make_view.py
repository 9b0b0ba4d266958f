"""Take the pictures of ``docs/view.md``: the live page of the example in a browser, on a desk and on a phone.

``python docs/pictures/make_view.py [folder]``. Needs the extra ``viewer``, playwright and a Chromium
(``TANTEO_BROWSER`` names one that is not found automatically). Without a graphics card it takes a minute.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

from playwright.sync_api import Browser, Page, sync_playwright

HERE = Path(__file__).resolve().parent
FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-gpu-compositing"]
PATIENCE = 300_000


def opened(browser: Browser, url: str, width: int, height: int) -> Page:
    """Return the page in a window, without the notice about slow graphics."""
    page = browser.new_page(viewport={"width": width, "height": height})
    page.set_default_timeout(PATIENCE)
    page.goto(url)
    page.get_by_text("Places sensed: 0").first.wait_for()
    page.wait_for_timeout(5000)
    notice = page.get_by_text("Software WebGL rendering detected")
    if notice.count():
        page.locator("button.mantine-Notification-closeButton").first.click()
    return page


def until_places(page: Page, count: int) -> None:
    """Step until a number of places were sensed."""
    for k in range(1, count + 1):
        page.get_by_role("button", name="Step", exact=True).click()
        page.get_by_text(f"Places sensed: {k}").first.wait_for()
    page.wait_for_timeout(5000)


def make(folder: Path) -> None:
    """Take both pictures, each of a new page."""
    found = (shutil.which(name) for name in ("chromium", "chromium-browser", "google-chrome", "chrome"))
    program = os.environ.get("TANTEO_BROWSER") or next(filter(None, found))
    for picture, size, options, places in (
        ("view.png", (1280, 800), [], 4),
        ("view_phone.png", (390, 844), ["--bare"], 2),
    ):
        code = [sys.executable, "-c", "from tanteo.cli import main; main()", "view", "--no-open", *options]
        with subprocess.Popen(code, stdout=subprocess.PIPE, text=True) as server, sync_playwright() as driver:
            assert server.stdout is not None
            url = next(word for line in server.stdout for word in line.split() if word.startswith("http"))
            browser = driver.chromium.launch(executable_path=program, args=FLAGS)
            page = opened(browser, url, *size)
            until_places(page, places)
            page.screenshot(path=folder / picture)
            browser.close()
            server.terminate()


if __name__ == "__main__":
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else HERE
    target.mkdir(parents=True, exist_ok=True)
    make(target)
