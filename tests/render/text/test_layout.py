"""Tables as wide as the terminal, with every digit, and bold where the terminal supports it."""

from __future__ import annotations

import pytest

from tanteo.render.text import PLAIN, Layout

HEADERS = ["part", "probability", "x mm", "y mm", "z mm", "roll", "pitch", "yaw deg", "corner sd mm"]
ROWS = [
    ["step_15mm", "48.4 %", "379.96", "139.90", "20.03", "0.04", "0.05", "-27.91", "0.0868"],
    ["a part with a rather long name", "3.1 %", "-1379.96", "-1139.90", "-120.03", "-170.04", "10.05", "-127.91", "12"],
]
WORDS = [["vl53l0x", "tof", "30-1200", "V: FoV 25 deg, 33 ms/1.2 m modes, sigma law; A: bias, min, incidence"]]


@pytest.mark.parametrize("columns", [20, 60, 80, 120])
@pytest.mark.parametrize("indent", [0, 2])
def test_tables_fit_and_no_digit_is_lost(columns, indent):
    lines = Layout(columns).table(HEADERS, ROWS, indent=indent)
    assert max(map(len, lines)) <= columns
    shown = " ".join(lines).split()
    for row in ROWS:
        for cell in row[1:]:
            assert all(word in shown for word in cell.split()), cell
    assert all(line.startswith(" " * indent) for line in lines if line)


@pytest.mark.parametrize("columns", [40, 60, 80, 120])
def test_long_words_fold(columns):
    lines = Layout(columns).table(["sensor", "kind", "range mm", "verified"], WORDS, left=(0, 1, 3))
    assert max(map(len, lines)) <= columns
    assert "incidence" in " ".join(lines)
    assert "30-1200" in " ".join(lines)


def test_wide_tables_have_one_line_a_row():
    assert len(PLAIN.table(HEADERS, ROWS)) == 3
    assert Layout(60).table(HEADERS, ROWS[:1])[0] == "part          step_15mm"


def test_headings_are_bold_in_colour_only():
    assert PLAIN.bold("wedge") == "wedge"
    assert Layout(colour=True).bold("wedge") == "\x1b[1mwedge\x1b[0m"
