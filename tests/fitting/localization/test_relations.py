"""Every relation: its derivative against differences, its independence of the frames' free directions."""

from __future__ import annotations

import numpy as np
import pytest

from tanteo.errors import InputError
from tanteo.features.kinds import KINDS, PLANE, SPHERE
from tanteo.fitting.localization import RELATIONS, relation_between
from tanteo.geometry import SE3


@pytest.mark.parametrize("name", RELATIONS)
def test_derivative_against_differences(name):
    rng = np.random.default_rng(1)
    T, radius, h = SE3.exp(rng.normal(size=(20, 6))), np.full(20, 0.3), 1e-6
    f, D = RELATIONS[name].linearize(T, radius)
    assert f.shape == (20, RELATIONS[name].size)
    for k, e in enumerate(h * np.eye(6)):
        plus, minus = (RELATIONS[name].linearize(T @ SE3.exp(s * e), radius)[0] for s in (1, -1))
        np.testing.assert_allclose(D[..., k], (plus - minus) / (2 * h), atol=1e-8)


def free_motion(kind, rng):
    out = np.eye(4)
    for rows in ([i for i in kind.free if i < 3], [i for i in kind.free if i >= 3]):
        xi = np.zeros(6)
        xi[rows] = rng.normal(size=len(rows))
        out = out @ SE3.exp(xi)
    return out


@pytest.mark.parametrize("name", RELATIONS)
def test_the_test_statistic_ignores_the_free_directions(name):
    """f' S^-1 f is the same wherever the two frames sit along their symmetries, if the pairing is exact up to noise."""
    rng = np.random.default_rng(2)
    relation, radius = RELATIONS[name], np.array(0.0 if "vertex" in name else 0.3)
    A = rng.normal(size=(relation.sensed.size, relation.sensed.size))
    P = 1e-12 * (A @ A.T)
    T = _exact(relation, rng, radius) @ SE3.exp(relation.sensed.B.T @ np.linalg.cholesky(P) @ rng.normal(size=len(P)))

    def distance(T, P):
        f, D = relation.linearize(T, radius)
        G = D @ relation.sensed.B.T
        return f @ np.linalg.solve(G @ P @ G.T, f)

    S = free_motion(relation.sensed, rng)
    B = relation.sensed.B
    moved = B @ SE3.adjoint_inverse(S) @ B.T
    M = free_motion(relation.model, rng)
    assert distance(SE3.inverse(M) @ T @ S, moved @ P @ moved.T) == pytest.approx(distance(T, P), rel=1e-4)


def _exact(relation, rng, radius):
    """Return a relative frame for which the relation holds, by Gauss-Newton from a random one."""
    T = SE3.exp(0.3 * rng.normal(size=6))
    for _ in range(50):
        f, D = relation.linearize(T, radius)
        T = T @ SE3.exp(-np.linalg.pinv(D) @ f)
    assert np.abs(relation.linearize(T, radius)[0]).max() < 1e-12
    return T


def test_relation_between_finds_all_and_refuses_the_meaningless():
    for relation in RELATIONS.values():
        assert relation_between(relation.sensed, relation.model) is relation
    with pytest.raises(InputError, match="plane_plane"):
        relation_between(PLANE, SPHERE)
    assert "vertex" in KINDS
