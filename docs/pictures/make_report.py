"""Take the pictures of ``docs/report.md``: reports of the examples in a browser.

``python docs/pictures/make_report.py [folder]``. Needs playwright and a Chromium (``TANTEO_BROWSER`` names one that is
not found automatically).
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from playwright.sync_api import Browser, sync_playwright

from tanteo.cli import main

HERE = Path(__file__).resolve().parent
EXAMPLES = HERE.parents[1] / "examples"
FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]


READINGS, PARTS, BRACKET = EXAMPLES / "readings", EXAMPLES / "parts", EXAMPLES / "parts" / "bracket_left.step"
SCENE = EXAMPLES / "scenes" / "part_unknown.toml"
PICTURES = {
    "report.png": (("identify", READINGS / "bracket_left.csv", "--parts", PARTS), 1280, 830, "light"),
    "report_phone.png": (("identify", READINGS / "step_not_felt.csv", "--parts", PARTS), 390, 844, "dark"),
    "report_session.png": (
        ("sense", "part", "--scene", SCENE, "--parts", PARTS, "--goal", "2mm"),
        1280,
        800,
        "light",
        "How it went",
    ),
    "report_plan.png": (("plan", "--part", BRACKET, "--goal", "0.2mm", "--sd", "0.05mm"), 1280, 800, "light"),
}


def report(command: Sequence[object], file: Path) -> None:
    """Write the report of a command."""
    with suppress(SystemExit):
        main([*map(str, command), "--report", str(file)])


def shoot(
    browser: Browser, page_file: Path, picture: Path, width: int, height: int, scheme: str, heading: str = ""
) -> None:
    """Take a screenshot of the first screen, or of the part below a heading."""
    context = browser.new_context(
        viewport={"width": width, "height": height}, color_scheme=scheme, offline=True, device_scale_factor=1
    )
    page = context.new_page()
    page.goto(page_file.as_uri())
    if heading:
        page.get_by_role("heading", name=heading).evaluate("e => e.scrollIntoView()")
    page.wait_for_timeout(500)
    page.screenshot(path=picture)
    context.close()


def make(folder: Path) -> None:
    """Take all pictures."""
    found = (shutil.which(name) for name in ("chromium", "chromium-browser", "google-chrome", "chrome"))
    program = os.environ.get("TANTEO_BROWSER") or next(filter(None, found))
    with tempfile.TemporaryDirectory() as scratch, sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=program, args=FLAGS)
        for picture, (command, *how) in PICTURES.items():
            file = Path(scratch) / "report.html"
            report(command, file)
            shoot(browser, file, folder / picture, *how)
        browser.close()


if __name__ == "__main__":
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else HERE
    target.mkdir(parents=True, exist_ok=True)
    make(target)
