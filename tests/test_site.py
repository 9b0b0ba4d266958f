"""The documentation as a site: it builds without a warning, has every room, and asks for nothing when it is read."""

from __future__ import annotations

import importlib.util
import pkgutil
import re
import subprocess
import sys
from pathlib import Path

import pytest

import tanteo

ROOT = Path(__file__).parents[1]
NOT_FOR_PROGRAMS = {"cli", "demo", "typing"}


def test_the_interface_has_every_room():
    text = (ROOT / "docs" / "api.rst").read_text(encoding="utf-8")
    listed = set(re.findall(r"^\.\. automodule:: tanteo\.(\w+)$", text, re.MULTILINE))
    assert listed == {room.name for room in pkgutil.iter_modules(tanteo.__path__)} - NOT_FOR_PROGRAMS


def test_the_contents_name_pages_that_exist():
    text = (ROOT / "docs" / "index.rst").read_text(encoding="utf-8")
    names = re.findall(r"^   ([./\w]+)$", text, re.MULTILINE)
    assert {"../README", "report", "paper"} <= set(names)
    for name in names:
        assert any((ROOT / "docs" / f"{name}{suffix}").is_file() for suffix in (".md", ".rst")), name


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    for module in ("sphinx", "furo", "myst_parser", "latex2mathml"):
        if importlib.util.find_spec(module) is None:
            pytest.skip(f"the extra tanteo[docs] is not installed: {module} is missing")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "-W", "-q", "-c", "docs", "-b", "html", ".", str(folder)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder


@pytest.mark.slow
def test_it_builds_without_a_warning_and_asks_for_nothing(site):
    pages = list(site.rglob("*.html"))
    assert len(pages) > 60
    for page in pages:
        text = page.read_text(encoding="utf-8")
        assert not re.search(r"<(?:script|img|iframe)[^>]*\ssrc=\"(?:https?:)?//", text), page
        assert not re.search(r"<link[^>]*\shref=\"(?:https?:)?//", text), page


@pytest.mark.slow
def test_formulas_are_drawn_by_the_browser(site):
    text = (site / "docs" / "report.html").read_text(encoding="utf-8")
    assert 'display="block"' in text
    assert "<msub><mi>S</mi><mi>k</mi></msub>" in text


@pytest.mark.slow
def test_links_between_pages_and_to_files_hold(site):
    for page in site.rglob("*.html"):
        if "_modules" in page.parts or page.name in ("genindex.html", "py-modindex.html", "search.html"):
            continue
        for target in re.findall(r'(?:href|src)="([^"#:?]+)(?:[#?][^"]*)?"', page.read_text(encoding="utf-8")):
            assert (page.parent / target).exists(), f"{page.relative_to(site)}: {target}"
