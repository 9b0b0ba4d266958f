"""The documentation as a site: it builds without a warning, has every package, and makes no request when it is read."""

from __future__ import annotations

import contextlib
import html
import importlib.util
import os
import pkgutil
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import tanteo
from browsing import Watched, complaints, pixels

ROOT = Path(__file__).parents[1]
NOTEBOOKS = ROOT / "docs" / "notebooks"
NOT_FOR_PROGRAMS = {
    "__main__",
    "_core",
    "cli",
    "defaults",
    "demo",
    "lazy",
    "limits",
    "plugins",
    "remarks",
    "replaced",
    "special",
    "threads",
    "typing",
    "values",
    "whole",
}


def test_the_interface_has_every_package():
    text = (ROOT / "docs" / "api.rst").read_text(encoding="utf-8")
    listed = set(re.findall(r"^\.\. automodule:: tanteo\.(\w+)$", text, re.MULTILINE))
    assert listed == {package.name for package in pkgutil.iter_modules(tanteo.__path__)} - NOT_FOR_PROGRAMS


def test_the_contents_name_pages_that_exist():
    text = (ROOT / "docs" / "index.rst").read_text(encoding="utf-8")
    names = set(re.findall(r"^   ([./\w]+)$", text, re.MULTILINE))
    made = {"../build/notebooks/index"}  # from docs/notebooks, when the site is built
    assert {"../README", "report", "paper"} | made <= names
    for name in names - made:
        assert any((ROOT / "docs" / f"{name}{suffix}").is_file() for suffix in (".md", ".rst")), name


PRINTS = {
    "01_locate_a_fixture": [
        "recognized - clamp, located to",
        "without 5, noise",
        "without prior: ambiguous",
        "between 4.2 and 8.1 in 95 of 100 cases",
        "known to a factor of two: without none, noise",
    ],
    "02_which_of_twenty_brackets": [
        "recognized - 60x50x6s4b30",
        "This reading discriminates 60x40x5s4b30",
        "unknown - The closest",
    ],
    "03_plan_touches_for_a_tolerance": [
        "within 0.2 mm (P = 0.9",
        "every touch hit the part",
        "the faces that the probe reaches leave a direction free",
        "No number of readings places",
    ],
    "04_the_paper_equation_by_equation": ["mean squared distance 5.9", "with plus 1.0", "corrected; 5 % is right"],
    "05_exercise_uncertain_frames": ["[0.2   0.283 0.283]", "largest difference from compose: 2"],
    "06_exercise_matching_by_chi_square": ["accepted ['web', 'flange']", "joint test 0.048"],
    "07_exercise_pose_from_touches": ["mean 2.96", "0.202 mm with the state", "tanteo: recognized"],
    "08_exercise_next_best_touch": ["best from s = -50 mm", "{0.2: 0.693", "information: "],
}
"""What the notebooks print, in short."""


def test_every_notebook_has_an_expected_output():
    assert sorted(PRINTS) == [file.stem for file in sorted(NOTEBOOKS.glob("[0-9]*.py"))]


@pytest.mark.slow
@pytest.mark.parametrize("with_notebooks", [False, True])
def test_the_site(tmp_path, with_notebooks, request):
    """Built once, with the notebooks run or not: no warning, every page, no request to other hosts, valid links."""
    for module in ("sphinx", "furo", "myst_parser", "latex2mathml", "sphinx_gallery", "matplotlib"):
        if importlib.util.find_spec(module) is None:
            pytest.skip(f"the extra tanteo[docs] is not installed: {module} is missing")
    command = [sys.executable, "-m", "sphinx", "-W", "-q", "-c", "docs", "-b", "html", ".", str(tmp_path)]
    command += [] if with_notebooks else ["-D", "sphinx_gallery_conf.plot_gallery=False"]
    environment = {**os.environ, "MPLBACKEND": "agg"}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    pages = {
        page.relative_to(tmp_path).as_posix(): page.read_text(encoding="utf-8") for page in tmp_path.rglob("*.html")
    }
    sources = [*(ROOT / "docs").rglob("*.md"), *ROOT.glob("*.md")]
    assert {page.relative_to(ROOT).with_suffix(".html").as_posix() for page in sources} <= set(pages)
    for name, text in pages.items():
        assert not re.search(r"<(?:script|img|iframe)[^>]*\ssrc=\"(?:https?:)?//", text), name
        assert not re.search(r"<link[^>]*\shref=\"(?:https?:)?//", text), name
    formulas = pages["docs/report.html"]
    assert 'display="block"' in formulas
    assert "<msub><mi>S</mi><mi>k</mi></msub>" in formulas
    for name, words in PRINTS.items():
        shown = html.unescape(re.sub(r"<[^>]*>", "", pages[f"build/notebooks/{name}.html"]))
        assert not with_notebooks or [w for w in words if w not in shown] == [], name
        assert f"{name}.ipynb" in shown
    assert broken_links(tmp_path, pages) == []
    assert "tanteo.sensors.measure" in pages["build/api/tanteo.sensors.html"]
    assert 'href="../build/api/tanteo.sensors.html"' in pages["docs/api.html"]
    assert "url=docs/index.html" in pages["index.html"]
    with contextlib.suppress(pytest.skip.Exception):  # the rest needs a browser
        view(tmp_path, request.getfixturevalue("browser"), request.getfixturevalue("screenshots"), with_notebooks)


VIEWED = {
    "home": "docs/index.html",
    "interface": "build/api/tanteo.sensors.html",
    "notebook": "build/notebooks/04_the_paper_equation_by_equation.html",
}

CUT = """() => [...document.querySelectorAll("article pre, article img, article table, article math")].filter((e) => {
  const box = e.getBoundingClientRect(), around = e.closest(".table-wrapper") ? innerWidth * 9 : innerWidth;
  return e.scrollWidth > e.clientWidth + 2 && e.tagName === "PRE" || box.right > around + 1;
}).map((e) => e.outerHTML.slice(0, 120))"""
"""What is wider than its place."""


def view(site, browser, folder, with_notebooks):
    """Check the three entry points and pictures, a working search, no clipped text, and a name for every control."""
    for name, page in VIEWED.items():
        for size, scheme in (("desk", "light"), ("phone", "dark")):
            watched = Watched(browser, (site / page).as_uri(), size, scheme, offline=True, noise=("error",))
            watched.page.wait_for_load_state("load")
            watched.page.get_by_role("heading", level=1).wait_for()
            assert watched.page.evaluate(CUT) == [], name
            if size == "desk":  # furo gives both of its side bars one role
                assert complaints(watched.page, without=("landmark-unique",)) == [], name
            watched.page.screenshot(path=folder / f"site_{name}_{size}.png")
            if (name, size) == ("home", "phone"):
                drawing = pixels(watched.page.locator("img[src$='.svg']").first.screenshot())
                assert np.mean(drawing.min(axis=-1) > 0.8) < 0.05  # no white block on a dark page
            assert watched.messages == []
            watched.context.close()
    watched = Watched(browser, (site / "docs/index.html").as_uri(), "desk", offline=True, noise=("error",))
    entries = watched.page.locator(".start")
    assert [entry.locator("strong").inner_text()[:6] for entry in entries.all()] == ["I have", "I have", "I teac"]
    images = watched.page.locator(".gallery img")
    assert images.count() >= 6
    watched.until("[...document.querySelectorAll('.gallery img')].every((i) => i.loading === 'lazy' || i.naturalWidth)")
    watched.page.get_by_role("searchbox").or_(watched.page.locator("input[name=q]")).first.fill("tolerance")
    watched.page.keyboard.press("Enter")
    watched.page.locator("#search-results li a").first.wait_for()
    watched.context.close()


def broken_links(site, pages):
    """Links between the site's own pages, and to its files, that lead nowhere."""
    return [
        f"{name}: {target}"
        for name, text in pages.items()
        if name not in ("genindex.html", "py-modindex.html", "search.html")
        for target in re.findall(r'(?:href|src)="([^"#:?]+)(?:[#?][^"]*)?"', text)
        if not ((site / name).parent / target).exists()
    ]
