"""Features as lines: on what was sensed, and off it by what they are uncertain by."""

from __future__ import annotations

import numpy as np
import pytest

from tanteo.features import Feature, Round, outline, outlines_off
from tanteo.features.kinds import CIRCLE, CONE, CYLINDER, EDGE, KINDS, PLANE, SPHERE, VERTEX
from tanteo.geometry import SE3

T = SE3.exp(np.array([0.1, -0.2, 0.05, 0.4, 0.3, -0.6]))
SUPPORT = SE3.apply(T, np.array([[0.02, 0.01, 0.004], [-0.01, 0.02, 0.03], [0.005, -0.02, 0.012]]))
RADIUS = 0.02


def made(kind, sd=1e-4, radius=RADIUS):
    size = Round(0.3 if kind is CONE else radius, sd**2) if kind.size_name else None
    return Feature(kind, T, sd**2 * np.eye(len(kind.rows)), label="f", support=SUPPORT, size=size)


def distances(kind, lines):
    """Return the distances of the ends of lines from the ideal feature, in its frame."""
    x, y, z = np.moveaxis(SE3.apply(SE3.inverse(T), lines.reshape(-1, 3)), -1, 0)
    across = np.hypot(x, y)
    return {
        "plane": z, "edge": np.hypot(y, z), "vertex": np.maximum(np.sqrt(x**2 + y**2 + z**2) - 0.003, 0.0),
        "circle": np.hypot(across - RADIUS, z), "cylinder": across - RADIUS, "cone": across - np.tan(0.3) * z,
        "sphere": np.sqrt(x**2 + y**2 + z**2) - RADIUS,
    }[kind.name]  # fmt: skip


@pytest.mark.parametrize("kind", [PLANE, EDGE, VERTEX, CIRCLE, CYLINDER, CONE, SPHERE], ids=lambda kind: kind.name)
def test_lines_lie_on_the_feature_and_off_it_by_its_spread(kind):
    feature = made(kind)
    lines = outline(feature)
    assert lines.shape[1:] == (2, 3)
    assert np.abs(distances(kind, lines)).max() < 1e-9
    off = outlines_off(feature, 2.0)
    assert len(off) == 2 * (len(kind.rows) + bool(kind.size_name))
    away = np.linalg.norm(off - lines, axis=-1).max(axis=(1, 2))
    assert 1e-4 < away.max() < 2e-3
    np.testing.assert_allclose(off[::2] + off[1::2], np.broadcast_to(2 * lines, off[::2].shape), atol=2e-6)


def test_the_extent_is_that_of_what_was_sensed():
    z = SE3.apply(SE3.inverse(T), outline(made(CYLINDER)).reshape(-1, 3))[:, 2]
    assert (z.min(), z.max()) == pytest.approx((0.004, 0.03))


def test_a_radius_that_is_given_does_not_move():
    feature = Feature(CIRCLE, T, 1e-20 * np.eye(5), label="f", size=Round(RADIUS, 1e-6))
    wide = outlines_off(feature, 2.0)[-2:]
    grown = [np.linalg.norm(one.reshape(-1, 3) - T[:3, 3], axis=1).mean() - RADIUS for one in wide]
    assert sorted(grown) == pytest.approx([-2e-3, 2e-3], rel=1e-6)


def test_every_kind_has_lines():
    assert all(len(outline(made(kind))) for kind in KINDS.values())


def test_a_sphere_has_a_great_circle_square_to_each_axis():
    points = SE3.apply(SE3.inverse(T), outline(made(SPHERE))[:, 0])
    for axis in range(3):
        ring = points[np.abs(points[:, axis]) < 1e-9]
        assert len(ring) >= len(points) // 3
        np.testing.assert_allclose(np.delete(ring, axis, axis=1).min(axis=0), -RADIUS, rtol=0.01)
        np.testing.assert_allclose(np.delete(ring, axis, axis=1).max(axis=0), RADIUS, rtol=0.01)


@pytest.mark.parametrize("kind", KINDS.values(), ids=lambda kind: kind.name)
def test_without_sensed_points_lines_are_about_the_frame(kind):
    bare = Feature(kind, T, 1e-8 * np.eye(len(kind.rows)), label="f", size=made(kind).size)
    places = SE3.apply(SE3.inverse(T), outline(bare).reshape(-1, 3))
    assert len(places)
    assert np.abs(places).max() < 2 * RADIUS
