"""The report of a plan, and of the reading that discriminates two parts."""

from __future__ import annotations

import base64
import json
import re
from dataclasses import replace

import numpy as np
import pytest

from report_scenes import ROUGH, TOUCH, TRUTH
from tanteo.planning import discriminate, plan
from tanteo.planning.start import at_pose
from tanteo.posterior import prepare
from tanteo.render.html import Run, distinction_page, plan_page
from tanteo.render.html.charts import SHARES, Curve, curve_chart, lengths_scale
from tanteo.words import percent
from tanteo.words.findings import NoPlaceReached

RUN = Run("tanteo plan --part wedge.stl")


@pytest.fixture(scope="module")
def planned(wedge):
    return plan(at_pose(prepare(wedge), TRUTH, ROUGH), TOUCH, 2e-4)


def scene_of(page):
    return json.loads(re.search(r'id="scene">(.*?)</script>', page, re.DOTALL)[1])


def places(scene, name):
    mm = np.frombuffer(base64.b64decode(scene["readings"][name]), dtype="<f4").reshape(-1, 3)
    return (mm + scene["centre_mm"]) / 1e3


def test_the_arrows_are_the_readings(planned, wedge):
    page = plan_page(planned, wedge, TOUCH, 2e-4, 0.95, RUN)
    scene = scene_of(page)
    assert scene["arrows"] is True
    assert ", ".join(scene["readings"]["names"]).split(", ") == [str(k + 1) for k in range(len(planned.readings))]
    tips, tails = places(scene, "points"), places(scene, "starts")
    assert tips == pytest.approx(np.array([r.point for r in planned.readings]), abs=1e-6)
    along = (tips - tails) / np.linalg.norm(tips - tails, axis=1, keepdims=True)
    assert along == pytest.approx(np.array([r.direction for r in planned.readings]), abs=1e-4)


def test_its_text_table_and_curves_agree(planned, wedge):
    page = plan_page(planned, wedge, TOUCH, 2e-4, 0.95, RUN)
    assert f"{len(planned.readings)} readings place wedge." in page
    assert "✓ planned" in page
    for n, r in enumerate(planned.readings, 1):
        assert f"after {n}: {1e3 * r.corner_sd:.2g} mm" in page
        assert f"<td>{1e3 * r.corner_sd:.2g}</td>" in page
    assert "tolerance, 0.2 mm" in page
    assert "required, 95.0 %" in page
    last = planned.readings[-1]
    assert "All corners within the tolerance then, over all placements" in page
    assert f"<dd>{percent(last.within)}</dd>" in page
    assert f"as at {percent(planned.all_meet)} of the placements" in page
    assert f"<td>{percent(last.within_if_hit)}</td>" in page


def test_a_reading_that_is_made_twice_has_one_arrow(planned, wedge):
    again = replace(planned, readings=(*planned.readings, planned.readings[1]))
    scene = scene_of(plan_page(again, wedge, TOUCH, 2e-4, 0.95, RUN))
    assert f"2, {len(again.readings)}" in scene["readings"]["names"]
    assert len(scene["readings"]["names"]) == len(planned.readings)


def test_a_plan_that_cannot_be_made_is_a_page_too(planned, wedge):
    none = replace(planned, readings=(), reached=False, findings=(NoPlaceReached(("wedge",)),))
    page = plan_page(none, wedge, TOUCH, 2e-4, 0.95, RUN)
    assert "No plan for wedge achieves the tolerance." in page
    assert "Result of each reading" not in page
    assert scene_of(page)["parts"][0]["name"] == "wedge"


def test_the_reading_for_twins_hits_each_at_its_stated_range(wedge, near_wedge):
    found = discriminate(prepare(wedge), prepare(near_wedge), TOUCH)
    page = distinction_page(found, [wedge, near_wedge], TOUCH, RUN)
    scene = scene_of(page)
    distances = np.linalg.norm(places(scene, "points") - found.origin, axis=1)
    assert distances == pytest.approx(found.ranges[np.isfinite(found.ranges)], abs=1e-6)
    assert [h["part"] for h in scene["hypotheses"]] == [0, 1]
    target = prepare(near_wedge)  # at the second part on the page, its ray has the stated length
    T = np.array(scene["hypotheses"][1]["pose"]).reshape(4, 4).T
    T[:3, 3] = (T[:3, 3] + scene["centre_mm"]) / 1e3
    start, along = np.linalg.inv(T) @ np.r_[found.origin, 1], T[:3, :3].T @ found.direction
    assert float(target.surface.cast(start[None, :3], along[None]).distances[0]) == pytest.approx(
        found.ranges[1], abs=1e-5
    )
    nothing = replace(found, ranges=np.array([found.ranges[0], np.inf]))
    page = distinction_page(nothing, [wedge, near_wedge], TOUCH, RUN)
    assert len(scene_of(page)["readings"]["names"]) == 1
    assert len(base64.b64decode(scene_of(page)["free"])) == 2 * 3 * 4
    nowhere = replace(found, origin=np.full(3, np.nan), ranges=np.full(2, np.nan), information=0.0)
    assert "No reading discriminates wedge and near_wedge." in distinction_page(
        nowhere, [wedge, near_wedge], TOUCH, RUN
    )


def test_a_scale_spans_all_values_with_readable_lines():
    for low, high in ((0.08, 8.0), (0.5, 0.5), (1e-3, 1e3)):
        scale = lengths_scale(np.array([low, high, np.nan]))
        assert scale.low < low <= high < scale.high
        assert 1 <= len(scale.ticks) <= 7
        heights = [scale.y(v) for v in (low, high)]
        assert heights[0] >= heights[1]
    assert SHARES.y(0) - SHARES.y(0.5) == pytest.approx(SHARES.y(0.5) - SHARES.y(1))


def test_a_curve_is_broken_where_there_is_no_value():
    values = np.array([0.1, 0.5, np.nan, 0.5, 0.7])
    chart = curve_chart("x", [Curve("c", values, ("",) * 5)], SHARES, [str(k) for k in range(5)]).text
    assert chart.count('class="curve c0"') == 2 + 1  # and one in the legend
    assert chart.count('class="mark-of c0"') == 4 + 1
