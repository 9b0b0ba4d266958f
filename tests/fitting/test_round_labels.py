"""Labelled readings of round features: balls in bores, wrong readings, normals, arcs that are too short."""

from __future__ import annotations

import numpy as np
import pytest

from round_scenes import RADIUS, round_points
from tanteo.fitting import fit_labelled
from tanteo.geometry import SE3
from tanteo.sensors import Readings, measure

SD = 1e-5
T = SE3.exp(np.array([0.1, -0.05, 0.2, 0.4, -0.7, 0.3]))


def sensed(kind, arc=360, n=12, side=-1.0, tip=0.0, seed=1):
    """Touches of a bore (side -1) or boss: points or centres of the ball, directions, away from the axis."""
    rng = np.random.default_rng(seed)
    q, away = round_points(kind, arc, n)
    points = SE3.apply(T, q + side * tip * away) + SD * rng.normal(size=(n, 3))
    away = away @ T[:3, :3].T
    return points, -side * away


def fit(kind, points, **columns):
    readings = Readings.from_columns(
        points, features=("a",) * len(points), kinds=(kind,) * len(points), **columns
    )  # fmt: skip
    return fit_labelled(measure(readings, sd=SD))


@pytest.mark.parametrize("kind", ["cylinder", "cone", "sphere"])
def test_labelled_touches_of_a_bore_with_a_ball(kind):
    points, directions = sensed(kind, tip=1e-3)
    found = fit(kind, points, directions=directions, radii=np.full(12, 1e-3))
    (feature,) = found.features
    assert (feature.kind.name, feature.convex, feature.tip_radius) == (kind, False, 1e-3)
    if kind != "cone":
        assert feature.radius == pytest.approx(RADIUS, abs=3e-5)
    assert found.notes == ()


@pytest.mark.parametrize("kind", ["cylinder", "circle", "sphere"])
def test_a_wrong_reading_of_a_round_feature_is_dropped(kind):
    points, directions = sensed(kind)
    points[4] += 1e-3 * directions[4]
    found = fit(kind, points, directions=directions if kind != "circle" else np.tile(-T[:3, 2], (12, 1)))
    assert found.rejected == ("5",)
    assert found.rejected_by[0] == pytest.approx(1e-3, rel=0.1)
    assert found.features[0].radius == pytest.approx(RADIUS, abs=3e-5)


def test_a_circle_points_out_of_the_face_that_was_sensed():
    points, _ = sensed("circle")
    for z in (T[:3, 2], -T[:3, 2]):
        (feature,) = fit("circle", points, directions=np.tile(-z, (12, 1))).features
        assert feature.T_world_feature[:3, 2] @ z > 0.999
        assert feature.convex is None


def test_sensed_normals_count_in_the_fit():
    points, directions = sensed("cylinder", arc=60)
    plain = fit("cylinder", points, directions=directions).features[0]
    sds = np.full(12, np.radians(0.1))
    with_normals = fit("cylinder", points, normals=-directions, normal_sds=sds).features[0]
    assert with_normals.size.variance < 0.5 * plain.size.variance
    assert with_normals.convex is plain.convex is False


def test_what_is_too_short_is_left_out_with_the_reason():
    points, directions = sensed("cylinder", arc=8)
    found = fit("cylinder", points, directions=directions)
    assert found.features == ()
    assert "'a' was excluded: cylinder 'a': the arc covers" in found.notes[0]
    assert "not observable" in found.notes[0]


def test_scatter_widens_size_and_frame_equally():
    rng = np.random.default_rng(3)
    points, directions = sensed("cylinder")
    clean = fit("cylinder", points, directions=directions).features[0]
    found = fit("cylinder", points + 6 * SD * rng.normal(size=points.shape), directions=directions)
    assert "scatter" in found.notes[0]
    wide = found.features[0]
    ratio = wide.size.variance / clean.size.variance
    assert 10 < ratio < 100
    assert wide.P[0, 0] / clean.P[0, 0] == pytest.approx(ratio, rel=0.2)
