"""What a tired reader meets: one figure, words, and a page that folds and prints."""

from __future__ import annotations

import re

import pytest

from tanteo.active import Stop
from tanteo.report import percent
from tanteo.report.combined import BEYOND, combined
from tanteo.report.course import goal_words
from tanteo.report.page import Section, photo_section, render
from tanteo.report.uncertainty import Budget, Source
from tanteo.report.words import brief

LINEAR = Budget((Source("noise of the sensor", "B", 0.64, 8e-5, 6e-5), Source("tip", "B", 0.36, 6e-5, 8e-5)), 1e-4)


@pytest.mark.parametrize("told", [5e-5, 1e-4, 1.001e-4, 1.5e-4])
def test_the_sources_make_up_the_figure_of_the_answer(told):
    budget = combined(LINEAR, told)
    assert budget.total == told
    assert sum(s.sd**2 for s in budget.sources) == pytest.approx(told**2)
    assert sum(s.share for s in budget.sources) == pytest.approx(1)
    assert any(s.name == BEYOND for s in budget.sources) == (told > 1.01e-4)


@pytest.mark.parametrize(
    ("motion", "words"),
    [
        ("sliding along world x", "sliding along world x"),
        ("sliding along the world direction (0.29, 0.90, 0.32)", "sliding along world y, 26° towards x and z"),
        ("rotation about the world direction (0.07, 0.10, -0.99) through (1.0, 2.0, 3.0) mm",
         "rotation about world z, 7° towards −x and −y"),
        ("rotation about part z through (1.0, 2.0, 3.0) mm while sliding 2 mm a radian", "rotation about part z"),
    ],
)  # fmt: skip
def test_directions_are_words(motion, words):
    assert brief(motion) == words


def test_a_goal_is_said_with_its_numbers():
    said = goal_words(Stop(probability=0.99, tolerance=5e-4, confidence=0.95))
    assert said == "Goal: the part with 99 % and the corners of the part within 0.5 mm at 95 %."
    assert "within" not in goal_words(Stop(probability=0.99, tolerance=None))


def test_a_section_folds_and_is_open_without_a_program():
    markup = render(Section("fit", "How", "Lead.", photo_section("a", "b", "c", b"\x89PNG", percent(0.5)).bodies)).text
    assert re.search(r'<section id="fit"><details class="fold" open><summary><h2>How</h2></summary>', markup)
    assert '<img src="data:image/png;base64,iVBORw==" alt="50.0 %" class="photo">' in markup
