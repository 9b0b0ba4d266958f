"""The example parts, read once; and a real browser if there is one."""

from __future__ import annotations

import functools
import os
import shutil
from collections import defaultdict
from pathlib import Path

import pytest

from browsing import PATIENCE
from tanteo.parts import read_part
from tanteo.posterior import prepare

PARTS = Path(__file__).parents[1] / "examples" / "parts"
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Mark sets of parameters beyond ``quick_sets`` as slow, and run long tests first, so that no worker waits."""
    functions = defaultdict(list)
    for item in items:
        functions[item.getparent(pytest.Module), item.getparent(pytest.Class), item.originalname].append(item)
    for sets in functions.values():
        mark = sets[0].get_closest_marker("quick_sets")
        count = len(sets) if mark is None else mark.args[0]
        for k, item in enumerate(sets):
            if (k * count) // len(sets) == ((k - 1) * count) // len(sets):  # quick ones are even over the sets
                item.add_marker(pytest.mark.slow)
    items.sort(key=lambda item: item.get_closest_marker("slow") is None and item.path.name != "test_cluster.py")


@pytest.fixture(scope="session", autouse=True)
def cache(tmp_path_factory):
    """Where all tests and the processes they start keep what was read of CAD files: entries are named by content."""
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if os.environ.get("PYTEST_XDIST_WORKER") else base) / "cache"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TANTEO_CACHE", str(folder))
        yield folder


@pytest.fixture(scope="session", autouse=True)
def commands():
    """Build the tree of commands once: typer rebuilds it for each call, which takes 40 ms."""
    import typer.main

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(typer.main, "get_command", functools.cache(typer.main.get_command))
        yield


@pytest.fixture(scope="session")
def models():
    """Prepared example parts by name."""
    pytest.importorskip("OCP", reason="reading STEP needs tanteo[step]")
    return {path.stem: prepare(read_part(path)) for path in sorted(PARTS.glob("*.step"))}


@pytest.fixture(scope="session")
def parts(models):
    """The same, not prepared."""
    return {name: model.part for name, model in models.items()}


@pytest.fixture(scope="session")
def browser():
    """A headless Chromium that puts its windows together without a graphics card; tests are skipped where none is."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    program = os.environ.get("TANTEO_BROWSER") or next(filter(None, map(shutil.which, BROWSERS)), None)
    if program is None:
        pytest.skip("no Chromium found; install one, or name it in TANTEO_BROWSER")
    arguments = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-gpu-compositing"]
    sync_api.expect.set_options(timeout=PATIENCE)
    with sync_api.sync_playwright() as driver:
        started = driver.chromium.launch(executable_path=program, args=arguments, timeout=PATIENCE)
        yield started
        started.close()


@pytest.fixture(scope="session")
def screenshots(tmp_path_factory):
    """Where screenshots are kept: the folder that TANTEO_SCREENSHOTS names, or else pytest's temporary one."""
    named = os.environ.get("TANTEO_SCREENSHOTS")
    folder = Path(named) if named else tmp_path_factory.mktemp("screenshots")
    folder.mkdir(parents=True, exist_ok=True)
    return folder
