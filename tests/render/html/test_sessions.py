"""The report of a session: how it went, and which reading fixed which direction."""

from __future__ import annotations

import re

import numpy as np
import pytest

from report_scenes import SD, TRUTH, touched_session, touches
from tanteo.planning import Session
from tanteo.planning.explanation import explain
from tanteo.posterior import Priors
from tanteo.recognition import locate
from tanteo.render.html import (
    Candidate,
    Run,
    course_section,
    directions_of,
    element,
    find_contacts,
    find_ways,
    gather,
    headline,
    session_page,
)
from tanteo.sensors import Readings
from tanteo.sensors.error_states import Drift, Form, Scale

RUN = Run("tanteo replay s.json", "tanteo 1", (("Least clearance", "3 <mm>"),))


@pytest.fixture(scope="module")
def session(wedge, near_wedge):
    return touched_session(wedge, near_wedge)


def candidate(hypothesis, sensed, part):
    ways = find_ways(part, hypothesis.T_world_part, hypothesis.covariance)
    return Candidate(hypothesis, part, find_contacts(sensed, part, hypothesis), *ways)


def test_it_has_the_answer_the_course_the_directions_and_facts(session):
    page = session_page(session, RUN)
    assert element("h1", headline(session.answer())).text in page
    for words in ("How it went", "Which reading determines which direction", "3 &lt;mm&gt;", "beam that hit nothing"):
        assert words in page
    assert page == session_page(session, RUN)


def test_every_answer_has_its_place_in_the_charts_and_its_row(session):
    (body,) = course_section(session, explain(session.state, session.steps).added).bodies
    rows = re.findall(r'<th scope="row">(\d+)</th>', body.text)
    assert rows == [str(k) for k in range(1, len(session.steps) + 1)]
    titles = re.findall(r"<title>(.*?)</title>", body.text)
    curves = 3  # both parts and unknown object, from before the first answer on
    assert len([s for s in titles if "%" in s]) == curves * (len(rows) + 1)
    corners = [float(v) for v in re.findall(r"after \d+: ([\d.]+) mm, of (?:near_)?wedge", body.text)]
    assert corners == pytest.approx([1e3 * s.corner_sd for s in session.steps], rel=0.05)  # two digits
    assert "tolerance of the corners, 1 mm" in body.text


def test_the_directions_of_session_are_those_of_its_explanation(session):
    page, directions = session_page(session, RUN), explain(session.state, session.steps).directions
    first = page.index('id="rests"')
    assert page.count('aria-label="Show: ') >= len([d for d in directions if d.moves > 0.02 * directions[0].moves]) > 2
    for d in directions:
        name, share = d.shares[0]
        assert f"{name} ({100 * share:.1f} %)" in page[first:], d.motion


def test_shares_of_a_direction_are_those_of_the_information(wedge):
    readings = touches(wedge, np.random.default_rng(1))
    sensed = gather(readings)
    exactly, none = Priors(noise_factor=1.0), (Scale(1e-9), Drift(1e-9), Form(1e-9))  # nothing is assumed
    best = locate(readings, wedge, priors=exactly, shared_errors=none).hypotheses[0]
    one = candidate(best, sensed, wedge)
    local = (readings.points[:] - TRUTH[:3, 3]) @ TRUTH[:3, :3]
    n = np.repeat(wedge.planes.normals, 5, axis=0)
    rows = np.concatenate([n, np.cross(local, n)], axis=1) / SD
    for way, d in zip(one.ways, directions_of(one, sensed), strict=True):
        each = (rows @ way.xi) ** 2
        assert each.sum() == pytest.approx(1, rel=0.05)  # one standard deviation is what all of them leave
        assert dict(d.shares) == pytest.approx(dict(zip(readings.ids, each / each.sum(), strict=True)), abs=0.01)
        assert sum(p for _, p in d.shares) + d.prior == pytest.approx(1)


def test_readings_that_do_not_fit_fix_nothing(wedge):
    readings = touches(wedge, np.random.default_rng(1), wrong=(7,))
    sensed = gather(readings)
    one = candidate(locate(readings, wedge).hypotheses[0], sensed, wedge)
    assert all(dict(d.shares)["8"] == 0 for d in directions_of(one, sensed))


def test_a_session_without_readings_is_reported(session):
    page = session_page(Session(session.start, session.probe), RUN)
    assert "<h1>No reading has hit a part yet.</h1>" in page
    assert "How it went" not in page


def test_a_session_without_hits_is_a_page(session, wedge):
    new = Session(session.start, session.probe, session.sensing)
    far = TRUTH[:3, 3][None] + [0.3, 0.0, 0.0]
    new.tell(Readings.from_columns(far, directions=[[0, 0, 1.0]], is_free=[True], max_ranges=np.array([0.1])))
    page = session_page(new, RUN)
    assert "How it went" in page
    assert "nan" not in page.split('id="scene"')[0].lower().replace("nano", "")


def test_names_are_escaped_as_text(wedge, near_wedge):
    from dataclasses import replace

    evil = "</script><img src=x>"
    page = session_page(touched_session(replace(wedge, name=evil), near_wedge), RUN)
    assert "<img" not in page
    assert page.count("</script>") == 2
