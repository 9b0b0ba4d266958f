"""The pages: links lead somewhere, figures stand beside their command, the index and the code map are complete."""

from __future__ import annotations

import pkgutil
import re
from pathlib import Path

import pytest

import tanteo

ROOT = Path(__file__).parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])
DOCS = sorted((ROOT / "docs").rglob("*.md"))
DECISIONS = sorted((ROOT / "docs" / "decisions").glob("[0-9]*.md"))
SUPERSEDED = ROOT / "docs" / "decisions" / "superseded.md"
LINK = re.compile(r"(?<!`)!?\[[^\]]*\]\(([^)\s]+)\)")
FIGURE = re.compile(r"\d[\d,.]*\s?(%|ms|µs|s|milliseconds|microseconds)(?![\w/])")
COMMAND = re.compile(r"\b(?:python|pytest)\s+((?:examples|benchmarks|tests|docs)/[\w/]+\.py)")
TYPED = re.compile(
    r"(tanteo (bench|identify|locate|see|part|plan|replay|sense|sensor|view)|make (demo|test|bench|core|wheel))\b"
)


def name(page):
    return page.relative_to(ROOT).as_posix()


def prose(page):
    """Return the text without blocks of code."""
    return re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)


def anchors(page):
    """Return the anchors of a page's headings, made as on code hosts."""
    headings = re.findall(r"^#+ (.*)$", prose(page), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_links_lead_somewhere(page):
    for target in LINK.findall(prose(page)):
        if target.startswith(("https://", "mailto:")):
            continue
        path, _, anchor = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        assert file.exists(), f"{name(page)}: {target}"
        assert file.is_relative_to(ROOT), f"{name(page)}: {target} leaves the repository"
        if anchor and file.suffix == ".md":  # lines of programs: tests/test_tour.py
            assert anchor in anchors(file), f"{name(page)}: {target}"


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_commands_name_files_that_exist(page):
    text = page.read_text(encoding="utf-8")
    for file in COMMAND.findall(text):
        assert (ROOT / file).is_file(), f"{name(page)}: {file}"


@pytest.mark.parametrize("page", DOCS, ids=name)
def test_figures_have_a_command(page):
    text = page.read_text(encoding="utf-8")
    if FIGURE.search(prose(page)):
        assert COMMAND.search(text) or TYPED.search(text), f"{name(page)} has figures and no command that prints them"


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_pages_speak_of_the_project_only(page):
    text = page.read_text(encoding="utf-8")
    assert not re.search(r"(?<![\w.~])/(?:root|home|work|tmp|usr|mnt)/", text), "a path of somebody's machine"
    assert not re.search(r"index-url|pypi\.org/simple", text), "a registry"


def test_the_index_has_every_page():
    index = ROOT / "docs" / "README.md"
    linked = {(index.parent / target.partition("#")[0]).resolve() for target in LINK.findall(prose(index))}
    assert {page.resolve() for page in DOCS if page != index} <= linked
    assert set((ROOT / "examples").glob("[0-9]*.py")) <= linked
    assert set((ROOT / "docs" / "notebooks").glob("[0-9]*.py")) <= linked


def test_the_code_map_has_every_package():
    text = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 200
    for package in pkgutil.iter_modules(tanteo.__path__):
        assert f"`{package.name}{'/' if package.ispkg else '.py'}`" in text, package.name


@pytest.mark.parametrize("page", DECISIONS, ids=name)
def test_decisions_have_context_options_choice_and_consequences(page):
    text = page.read_text(encoding="utf-8")
    assert re.match(rf"# {int(page.name[:4])}\. ", text)
    assert re.findall(r"^\*\*(\w+)\.\*\*", text, re.MULTILINE) == [
        "Context",
        "Options",
        "Choice",
        "Consequences",
    ]
    for file in re.findall(r"`((?:\w+/)+\w+\.py)`", text):
        assert any((root / file).is_file() for root in (ROOT, ROOT / "src" / "tanteo")), file


def test_each_decision_has_a_page_or_a_row():
    rows = [int(n) for n in re.findall(r"^\| (\d+) \|", SUPERSEDED.read_text(encoding="utf-8"), re.MULTILINE)]
    numbers = sorted([*rows, *(int(page.name[:4]) for page in DECISIONS)])
    assert numbers == list(range(1, len(numbers) + 1))


def test_the_picture_is_there_and_is_one():
    picture = (ROOT / "docs" / "pictures" / "from_readings_to_answer.svg").read_text(encoding="utf-8")
    assert picture.startswith("<svg")
    assert "bracket_left" in picture


def test_the_citation_is_of_this_version():
    lines = (ROOT / "CITATION.cff").read_text(encoding="utf-8").splitlines()
    assert f"version: {tanteo.__version__}" in lines
    assert f"## {tanteo.__version__}" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
