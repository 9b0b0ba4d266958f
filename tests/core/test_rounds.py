"""Fits of round features in the core: invalid input is refused, uninformative input does not crash."""

from __future__ import annotations

import numpy as np
import pytest

from tanteo import _core
from tanteo.features.kinds import CIRCLE, CONE, CYLINDER, SPHERE

ROWS = [np.array(kind.rows, dtype=np.int32) for kind in (CIRCLE, CYLINDER, CONE, SPHERE)]
NONE = np.zeros(0)


def fit(kind=3, **more):
    """Arguments of a fit to five points, with some of them changed."""
    rng = np.random.default_rng(1)
    given = {
        "kind": kind, "surface": kind, "rows": ROWS[min(kind, 3)], "points": rng.normal(size=(2, 5, 3)),
        "covs": np.tile(np.eye(3), (2, 5, 1, 1)), "normals": NONE, "normal_sds": NONE, "outward": NONE, "side": 0,
        "shared_jacobian": np.zeros((5, 3, 0)), "size": 0.0, "size_sd": 0.0, "frame": NONE, "frame_information": NONE,
        "frame_jacobian": NONE, "limit": 0.0,
    }  # fmt: skip
    return _core.fit_rounds(**(given | more))


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"kind": 4}, "kind"),
        ({"surface": -1}, "surface"),
        ({"rows": np.array([6], dtype=np.int32)}, "rows"),
        ({"points": np.full((2, 5, 3), np.nan)}, "points"),
        ({"points": np.zeros((2, 0, 3)), "covs": np.zeros((2, 0, 3, 3))}, "points"),
        ({"covs": np.zeros((2, 4, 3, 3))}, "covs"),
        ({"normals": np.zeros((2, 5, 3))}, "normal_sds"),
        ({"outward": np.zeros((1, 5, 3))}, "outward"),
        ({"shared_jacobian": np.zeros((4, 3, 1))}, "shared_jacobian"),
        ({"frame": np.eye(3)}, "frame"),
        ({"frame": np.eye(4)}, "frame_information"),
        ({"size": -1.0}, "size"),
    ],
)
def test_arguments_that_do_not_fit_are_refused(more, message):
    with pytest.raises(ValueError, match=message):
        fit(**more)


@pytest.mark.parametrize("kind", range(4))
@pytest.mark.parametrize("n", [1, 2, 3])
def test_few_points_and_no_noise_do_not_crash(kind, n):
    for scale in (0.0, 1e-300, 1.0, 1e300):
        points = scale * np.ones((1, n, 3))
        for covs in (np.zeros((1, n, 3, 3)), np.tile(np.eye(3), (1, n, 1, 1))):
            found = fit(kind, points=points, covs=covs, shared_jacobian=np.ones((n, 3, 2)))
            assert found[0].shape == (1, 4, 4)


def test_no_fits_are_none():
    assert fit(points=np.zeros((0, 5, 3)), covs=np.zeros((0, 5, 3, 3)))[1].shape == (0,)


def test_distances_are_signed_and_a_rim_has_two():
    p = np.array([[2.0, 0, 1], [0, 0.5, 0]])
    F, G, by_size = _core.round_distances(0, p, 1.0)
    np.testing.assert_allclose(F, [[1, 1], [0, -0.5]])
    np.testing.assert_allclose(G[0], [[0, 0, 1], [1, 0, 0]])
    np.testing.assert_allclose(by_size, [[0, -1], [0, -1]])
    with pytest.raises(ValueError, match="size"):
        _core.round_distances(1, p, 0.0)
