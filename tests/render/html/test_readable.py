"""What a tired reader meets: one figure, words, and a page that folds and prints."""

from __future__ import annotations

import pytest

from tanteo.planning import Stop
from tanteo.render.html import Budget, Source, goal_words, photo_section
from tanteo.render.html.combined import combined
from tanteo.words import Motion

LINEAR = Budget((Source("noise of the sensor", "B", 0.64, 8e-5, 6e-5), Source("tip", "B", 0.36, 6e-5, 8e-5)), 1e-4)


@pytest.mark.parametrize("stated_sd", [5e-5, 1e-4, 1.001e-4, 1.5e-4])
def test_the_sources_make_up_the_figure_of_the_answer(stated_sd):
    budget = combined(LINEAR, stated_sd)
    assert budget.total == stated_sd
    assert sum(s.sd**2 for s in budget.sources) == pytest.approx(stated_sd**2)
    assert sum(s.share for s in budget.sources) == pytest.approx(1)
    assert any(s.name == "beyond first order" for s in budget.sources) == (stated_sd > 1.01e-4)


@pytest.mark.parametrize(
    ("motion", "words"),
    [
        (Motion(False, "world x", (1.0, 0.0, 0.0)), "sliding along world x"),
        (Motion(False, "", (0.29, 0.90, 0.32)), "sliding along world y, 26° towards x and z"),
        (Motion(True, "", (0.07, 0.10, -0.99), (1e-3, 2e-3, 3e-3)), "rotation about world z, 7° towards −x and −y"),
        (Motion(True, "part z", (0.0, 0.0, 1.0), (1e-3, 2e-3, 3e-3), 2e-3), "rotation about part z"),
    ],
)
def test_directions_are_words(motion, words):
    assert motion.brief == words


def test_a_motion_has_every_number_in_words():
    slide = Motion(False, "", (0.29, 0.90, 0.32))
    assert str(slide) == "sliding along the world direction (0.29, 0.90, 0.32)"
    turn = Motion(True, "part z", (0.0, 0.0, 1.0), (1e-3, 2e-3, 3e-3), 2e-3)
    assert str(turn) == "rotation about part z through (1.0, 2.0, 3.0) mm while sliding 2.0 mm a radian"


def test_a_goal_is_stated_with_its_numbers():
    goal = goal_words(Stop(probability=0.99, tolerance=5e-4, confidence=0.95))
    assert goal == "Goal: the part with 99 % and the corners of the part within 0.5 mm at 95 %."
    assert "within" not in goal_words(Stop(probability=0.99, tolerance=None))


def test_an_image_is_in_the_page_and_has_words():
    (body,) = photo_section("seen", "What", "Lead.", b"\x89PNG", 'a "part"').bodies
    assert body.text == '<img src="data:image/png;base64,iVBORw==" alt="a &quot;part&quot;" class="photo">'
