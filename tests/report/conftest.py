"""Parts, and a real browser if there is one."""

from __future__ import annotations

import os
import shutil

import pytest

from report_scenes import prism_text
from tanteo.parts import read_part

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")


@pytest.fixture(scope="session")
def wedge(tmp_path_factory):
    """A 60 x 40 x 30 mm block with one slanted side: no symmetry."""
    path = tmp_path_factory.mktemp("parts") / "wedge.off"
    path.write_text(prism_text([(0, 0), (60, 0), (45, 40), (0, 40)], 30))
    return read_part(path, unit="mm")


@pytest.fixture(scope="session")
def near_wedge(tmp_path_factory):
    """The same with a side that slants a little more."""
    path = tmp_path_factory.mktemp("parts") / "near_wedge.off"
    path.write_text(prism_text([(0, 0), (60, 0), (44.9, 40), (0, 40)], 30))
    return read_part(path, unit="mm")


@pytest.fixture(scope="session")
def browser():
    """Headless Chromium; the tests are skipped where there is none."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    program = os.environ.get("TANTEO_BROWSER") or next(filter(None, map(shutil.which, BROWSERS)), None)
    if program is None:
        pytest.skip("no Chromium found; install one, or name it in TANTEO_BROWSER")
    arguments = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
    with sync_api.sync_playwright() as driver:
        started = driver.chromium.launch(executable_path=program, args=arguments)
        yield started
        started.close()
