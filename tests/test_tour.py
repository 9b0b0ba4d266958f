"""``docs/contributing_tour.md`` follows one reading from its file to the answer: its line numbers are true.

``python tests/test_tour.py`` puts them right.
"""

from __future__ import annotations

import ast
import re
import sys
from pathlib import Path

import pytest

import tanteo

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "contributing_tour.md"
STOP = re.compile(r"\[`(?P<name>[\w.]+)`\]\(\.\./src/tanteo/(?P<file>[\w/.]+)#L(?P<line>\d+)\)")
TEXT = PAGE.read_text()
STOPS = [(m["name"], m["file"], int(m["line"])) for m in STOP.finditer(TEXT)]


def line_of(name: str, file: str) -> int:
    """Return the line where a function, class or method begins; in C++ the first line with its name."""
    text = (ROOT / "src" / "tanteo" / file).read_text()
    if not file.endswith(".py"):
        return next(k for k, line in enumerate(text.splitlines(), 1) if re.search(rf"\b{re.escape(name)}\(", line))
    nodes = ast.parse(text).body
    for part in name.split("."):
        node = next(n for n in nodes if getattr(n, "name", None) == part)
        nodes = getattr(node, "body", [])
    return node.lineno


@pytest.mark.parametrize(("name", "file", "line"), STOPS)
def test_a_line_is_where_the_page_states(name, file, line):
    assert line_of(name, file) == line


def test_the_tour_is_short():
    numbered = re.findall(r"^\d+\. \[", TEXT, re.MULTILINE)
    assert 12 <= len(numbered) <= 15
    assert len({file for _, file, _ in STOPS}) <= 20


def test_a_reading_passes_the_stops_in_their_order():
    """The functions of the page are called, first calls in the order of the page."""
    called: list[str] = []

    def note(frame, event, _):
        if event == "call" and "tanteo" in frame.f_code.co_filename:
            called.append(f"{frame.f_code.co_filename.rpartition('tanteo/')[2]} {frame.f_code.co_name}")

    parts = tanteo.read_parts(ROOT / "examples" / "parts")
    before = sys.getprofile()
    sys.setprofile(note)
    try:
        tanteo.identify(tanteo.read_readings(ROOT / "examples" / "readings" / "bracket_bare.csv"), parts)
    finally:
        sys.setprofile(before)
    stops = [f"{file} {name.rpartition('.')[2]}" for name, file, _ in STOPS if file.endswith(".py")]
    assert [s for s in stops if s not in called] == []
    assert [called.index(s) for s in stops] == sorted(called.index(s) for s in stops)


if __name__ == "__main__":
    PAGE.write_text(
        STOP.sub(lambda m: f"[`{m['name']}`](../src/tanteo/{m['file']}#L{line_of(m['name'], m['file'])})", TEXT)
    )
