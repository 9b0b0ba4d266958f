"""The file as a whole: complete, small, self-contained, the same every time."""

from __future__ import annotations

import base64
import json
import re
from dataclasses import replace

import numpy as np
import pytest

from report_scenes import SD, ball, touches
from tanteo.errors import InputError
from tanteo.geometry import SE3, UncertainFrame
from tanteo.io import write_pose
from tanteo.posterior import Answer
from tanteo.recognition import identify, locate
from tanteo.render.html import Run, Section, element, gather, headline, report_page, write_report
from tanteo.sensors import Readings
from tanteo.words import details_of, p_equals, percent
from tanteo.words.findings import AccuracyNeeded, CloseTogether, Located, NextTouch, NothingSensed, SeveralPoses

MOST_BYTES = 6_000_000


@pytest.fixture(scope="module")
def run(wedge):
    readings = touches(wedge, np.random.default_rng(1), wrong=(7,))
    return readings, locate(readings, wedge)


def scene_of(page):
    return json.loads(re.search(r'id="scene">(.*?)</script>', page, re.DOTALL)[1])


def test_it_has_the_answer_the_wrong_reading_and_the_command(run, wedge):
    readings, answer = run
    page = report_page(answer, gather(readings), [wedge], Run("tanteo locate 'a b.csv' --part w.stl"))
    assert "wedge, located to" in page
    assert "✕ does not fit" in page
    assert "tanteo locate &#x27;a b.csv&#x27; --part w.stl" in page
    for words in ("[mm]", "world", "right perturbation", "noise of the sensor", "touches.csv"):
        assert words in page
    assert scene_of(page)["hypotheses"][0]["wrong"] == [int(i == 7) for i in range(len(readings))]


def test_a_pose_for_controllers_is_that_of_a_usable_answer(run, wedge):
    readings, answer = run
    assert answer.status == "recognized"
    page = report_page(answer, gather(readings), [wedge], Run("tanteo"))
    frame = UncertainFrame(answer.best.T_world_part, answer.best.covariance)
    assert write_pose("kuka", frame).text in page
    assert "roll, pitch, yaw" in page
    missed = answer.adding(AccuracyNeeded(wedge.name, 1e-3, 1e-4, reached=False))
    for other in (replace(answer, status="ambiguous"), missed):
        assert "notation of controllers" not in report_page(other, gather(readings), [wedge], Run("tanteo"))


def test_the_same_answer_is_the_same_file(run, wedge):
    readings, answer = run
    pages = [report_page(answer, gather(readings), [wedge], Run("tanteo")) for _ in range(2)]
    assert pages[0] == pages[1]
    assert pages[0] == report_page(replace(answer, elapsed={"total": 9.0}), gather(readings), [wedge], Run("tanteo"))


def test_nothing_outside_the_file_is_named(run, wedge):
    readings, answer = run
    page = report_page(answer, gather(readings), [wedge], Run("tanteo"))
    assert "default-src 'none'" in page
    assert '<section id="fit"><details class="fold" open><summary><h2>' in page  # without a program all is open
    assert set(re.findall(r"https?://[^\s\"']+", page)) == {"http://www.w3.org/2000/svg"}  # a name, not an address
    assert not re.search(r"<(?:link|img|iframe)|\ssrc=|@import|url\(", page)


def test_text_of_files_is_escaped(run, wedge):
    readings, _ = run
    evil = "</script><img src=x onerror=alert(1)>\x1b[31m\ud800"
    named = Readings.from_columns(
        points=readings.points, directions=readings.directions, sds=readings.sds, features=readings.features,
        kinds=readings.kinds, source=evil, ids=[f"{i}{evil}" for i in readings.ids],
    )  # fmt: skip
    found = locate(named, replace(wedge, name=evil, source=evil))
    page = report_page(found, gather(named), [replace(wedge, name=evil)], Run(evil, evil))
    page.encode("utf-8")
    assert "<img" not in page
    assert page.count("</script>") == 2  # data and program
    assert scene_of(page)["readings"]["names"][0] == f"1{evil}"


def test_several_hypotheses_have_one_body_each(wedge, near_wedge):
    readings = touches(wedge, np.random.default_rng(2), planes=[0, 1])
    answer = identify(readings, [wedge, near_wedge])
    assert len(answer.hypotheses) > 1
    page = report_page(answer, gather(readings), [wedge, near_wedge], Run("tanteo"))
    assert page.count('name="hypothesis"') == len(answer.hypotheses)
    assert page.count("All readings as a table") == len(answer.hypotheses)
    assert len(scene_of(page)["hypotheses"]) == len(answer.hypotheses)


def test_faces_that_differ_and_the_next_touch_are_drawn(run, wedge):
    readings, answer = run
    T = answer.best.T_world_part @ SE3.from_parts(np.eye(3), np.array([0.02, 0.0, 0.0]))
    poses = replace(answer.best, probability=0.6), replace(answer.best, probability=0.35, T_world_part=T)
    touch = NextTouch("wedge", "face 0", (0.4, -0.1, 0.3), (0.4, -0.1, 0.25), (0.0, 0.0, -1.0), 0.5, ())
    undecided = replace(answer, status="ambiguous", hypotheses=poses).adding(touch)
    page = report_page(undecided, gather(readings), [wedge], Run("tanteo locate"))
    scene = scene_of(page)
    along_x = np.abs(wedge.planes.normals[:, 0]) > 0.1  # the others still overlap
    faces = wedge.planes.faces[along_x]
    for one in scene["hypotheses"]:
        drawn = np.frombuffer(base64.b64decode(one["differs"]), "<u4").reshape(-1, 3)
        assert np.array_equal(drawn, wedge.triangles[np.isin(wedge.triangle_face, faces)])
    ends = [np.frombuffer(base64.b64decode(scene["next"][name]), "<f4") for name in ("start", "point")]
    assert np.allclose(ends + np.array(scene["centre_mm"]), 1e3 * np.array([touch.start, touch.point]), atol=1e-3)
    assert "face where wedge, pose 2 has none" in page
    decided = scene_of(report_page(answer, gather(readings), [wedge], Run("tanteo locate")))
    assert "next" not in decided
    assert not any("differs" in one for one in decided["hypotheses"])


def test_without_a_hypothesis_it_shows_the_readings(run, wedge):
    readings, _ = run
    answer = Answer("insufficient", (NothingSensed(),), (), 1.0)
    page = report_page(answer, gather(readings), [wedge], Run("tanteo"))
    assert "No reading met anything." in page
    assert scene_of(page)["hypotheses"] == []
    assert len(scene_of(page)["readings"]["names"]) == len(readings)


def test_only_readings_without_hits_are_accepted(wedge):
    free = Readings.from_columns(
        points=np.zeros((2, 3)), directions=np.array([[0, 0, 1.0], [0, 1.0, 0]]), kinds=["free"] * 2,
        max_ranges=np.full(2, 0.1),
    )  # fmt: skip
    page = report_page(Answer("insufficient", (NothingSensed(),), (), 1.0), gather(free), [wedge], Run("tanteo"))
    assert "beam that hit nothing" in page


def test_further_sections_stand_before_the_figures(run, wedge):
    readings, answer = run
    more = Section("story", "How it was found", "One line a step.", (element("p", "<first>"),))
    page = report_page(answer, gather(readings), [wedge], Run("tanteo"), [more])
    assert page.index("Where the uncertainty") < page.index('id="story"') < page.index('id="figures"')
    assert "&lt;first&gt;" in page


def test_a_hypothesis_of_an_absent_part_is_the_callers_mistake(run, near_wedge):
    readings, answer = run
    with pytest.raises(InputError, match="expected 'wedge' among them"):
        report_page(answer, gather(readings), [near_wedge], Run("tanteo"))


@pytest.mark.slow
def test_a_large_mesh_and_many_readings_stay_small(run, wedge, tmp_path):
    best, part = run[1].hypotheses[0], ball(wedge, subdivisions=6)
    points = part.vertices[np.random.default_rng(4).integers(len(part.vertices), size=20_000)]
    readings = Readings.from_columns(points=points, sds=np.full(len(points), SD))
    h = replace(best, T_world_part=np.eye(4), pairings=tuple((i, "face 0") for i in readings.ids[5:]), outliers=())
    answer = Answer("ambiguous", (), (h,) * 5, 0.1)
    file = tmp_path / "report.html"
    write_report(file, report_page(answer, gather(readings), [part], Run("tanteo")))
    assert 1_000_000 < file.stat().st_size < MOST_BYTES
    assert re.search(r"\d+ of 20000 readings are shown", file.read_text(encoding="utf-8"))


def test_the_headline_is_the_verdict_without_advice(run):
    _, answer = run
    assert headline(answer).startswith("wedge, located to")
    several = SeveralPoses("wedge", others=(("an unknown part", 0.2),))
    text = headline(replace(answer, status="ambiguous", findings=(several, CloseTogether())))
    assert text == "It is wedge, in one of several poses. It may also be an unknown part (20.0 %)."


def test_no_sentence_of_the_title_is_repeated_below_it(run, wedge):
    readings, answer = run
    several = replace(answer, status="ambiguous", findings=(SeveralPoses("wedge"), CloseTogether()))
    page = report_page(several, gather(readings), [wedge], Run("tanteo"))
    assert page.count(headline(several)) == 2  # the tab's title and the heading
    assert headline(several) + " " + details_of(several.findings) == several.message
    assert f"<p>{details_of(several.findings)}</p></header>" in re.sub("</?span[^>]*>", "", page)
    sure = replace(answer, findings=(Located("wedge", 0.999, 1e-4),))
    assert "</h1></header>" in report_page(sure, gather(readings), [wedge], Run("tanteo"))


@pytest.mark.parametrize(("p", "words"), [(0.0123, "p = 0.012"), (3e-15, "p = 3e-15"), (1e-300, "p < 2.2e-16")])
def test_a_tiny_p_value_is_a_bound(p, words):
    assert p_equals(p) == words


def test_a_large_sd_is_no_power_of_ten(run):
    _, answer = run
    located = Located("wedge", float("nan"), 0.132)
    assert "located to 130 mm " in headline(replace(answer, findings=(located,)))


def test_nothing_is_certain():
    assert percent(1.0) == "> 99.9 %"
    assert percent(0.0) == "< 0.1 %"
    assert percent(0.5) == "50.0 %"


@pytest.mark.parametrize("rejected", [False, True])
def test_a_page_judges_the_fit_by_the_significance_of_its_answer(run, wedge, rejected):
    readings, usual = run
    p = usual.hypotheses[0].p_value
    level = (p + 1) / 2 if rejected else p / 2
    found = locate(readings, wedge, significance=level, conventions=False)
    page = report_page(found, gather(readings), [wedge], Run("tanteo"))
    assert found.significance == level
    assert ("contradict it" in found.message) is rejected
    assert ("no, they contradict each other" in page) is rejected
    assert ("yes, within their noise" in page) is not rejected
