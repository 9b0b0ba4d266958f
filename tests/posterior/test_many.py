"""More readings than are useful: a subset is used, and the answer reports it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tanteo
from bare_scenes import surface_points
from tanteo.posterior import prepare
from tanteo.sensors import Readings, thinned

PART = Path(__file__).parents[2] / "examples" / "parts" / "bracket_left.step"


@pytest.mark.slow
def test_a_subset_of_many_readings_is_used_and_reported():
    pytest.importorskip("OCP", reason="the extra tanteo[step] is not installed")
    part, rng = tanteo.read_part(PART), np.random.default_rng(1)
    points = surface_points(prepare(part), 6000, rng)[0]
    readings = Readings.from_columns(points=points + 1e-4 * rng.normal(size=points.shape))
    answer = tanteo.locate(readings, part, sd=1e-4)
    assert answer.status == "recognized"
    assert "5,000 of the 6,000 readings were used" in answer.message
    kinds = [one.kind for one in answer.findings if one.role != "verdict"]
    assert kinds == ["shared_error", "many"]  # more readings do not reduce a warp
    assert np.abs(answer.pose - np.eye(4)).max() < 1e-4


@pytest.mark.parametrize(("n", "most"), [(10, 4), (7, 6), (4, 4), (3, 4)])
def test_the_thinned_are_spread_and_each_comes_once(n, most):
    readings = thinned(Readings.from_columns(points=np.arange(3.0 * n).reshape(n, 3)), most)
    assert len(readings) == len(set(readings.ids)) == min(n, most)
    assert (readings.ids[0], readings.ids[-1]) == ("1", str(n))
