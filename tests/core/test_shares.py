"""What of a normal density falls into a face, against integrals that know nothing of how the core does it."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from core.bodies import Body, _ears, cylinder, flat_bodies
from core.oracle import EXACT, Oracle
from core.questions import anisotropic, point_question, random_pose, touched
from tanteo import _core

CUT = norm.sf(5)
"""Largest change of a share by an excluded edge farther than five standard deviations."""


def sheet(outline):
    """Return one face at z = 0 without material below."""
    outline = np.asarray(outline, dtype=float)
    ears, none = _ears(outline), np.zeros((0, 3))
    vertices, faces = np.column_stack([outline, np.zeros(len(outline))]), np.zeros(len(ears), int)
    return Body(vertices, ears, faces, faces - 1, np.zeros((0, 11)), np.zeros((0, 6)), none)


def star(rng, corners, size):
    """Return a random polygon about the origin, mostly concave."""
    angles = np.sort(rng.uniform(0, 0.7, corners) + np.arange(corners)) * 2 * np.pi / corners
    return size * rng.uniform(0.3, 1, (corners, 1)) * np.column_stack([np.cos(angles), np.sin(angles)])


def core_shares(body, points, C):
    """Return the mass from the density of one point on the face: undirected, of the whole area."""
    q = replace(point_question(points, 1.0), covs=np.tile(C, (len(points), 1, 1)))
    density = _core.details(body.shape(4), q.core(), np.eye(4)[None], np.zeros((1, 0)))[0][0, :, 0]
    area, sd = 0.5 * np.linalg.norm(body.across, axis=1).sum(), np.sqrt(C[2, 2])
    return density * np.exp(q.log_outlier) * area / norm.pdf(points[:, 2] / sd) * sd


def integral(outline, p, C):
    """Slice by slice: the chance of x, times the chance that y is inside, given x and the distance from the plane."""
    given_z = p[:2] - C[:2, 2] / C[2, 2] * p[2]
    S = C[:2, :2] - np.outer(C[:2, 2], C[:2, 2]) / C[2, 2]
    a, b = outline, np.roll(outline, -1, axis=0)

    def slice_at(x):
        on = (a[:, 0] <= x) != (b[:, 0] <= x)
        y = np.sort((a[on] + ((x - a[on, 0]) / (b[on, 0] - a[on, 0]))[:, None] * (b[on] - a[on]))[:, 1])
        mean = given_z[1] + S[0, 1] / S[0, 0] * (x - given_z[0])
        inside = np.diff(norm.cdf(y, mean, np.sqrt(S[1, 1] - S[0, 1] ** 2 / S[0, 0])))[::2].sum()
        return norm.pdf(x, given_z[0], np.sqrt(S[0, 0])) * inside

    stops = np.unique(outline[:, 0])
    return sum(quad(slice_at, s, t, epsabs=1e-13, epsrel=1e-12, limit=200)[0] for s, t in pairwise(stops))


def noise(rng, kind):
    if kind == "even":
        return np.eye(3)
    A = rng.normal(size=(3, 3))
    return A @ A.T + 0.05 * np.eye(3)


@pytest.mark.parametrize("kind", ["even", "uneven"])
@pytest.mark.parametrize("seed", range(4))
def test_small_faces_have_the_integral(seed, kind):
    rng = np.random.default_rng(seed)
    outline, C = star(rng, 5 + seed, 1.5), noise(rng, kind) + 0.4 * np.eye(3)
    points = rng.normal(size=(5, 3)) * 0.7
    expected = [integral(outline, p, C) for p in points]
    assert core_shares(sheet(outline), points, C) == pytest.approx(expected, rel=0, abs=1e-9)


@pytest.mark.parametrize("corners", [6, 40])
@pytest.mark.parametrize("kind", ["even", "uneven"])
def test_large_faces_have_it_but_for_the_cut(kind, corners):
    rng = np.random.default_rng(corners)
    outline, C = star(rng, corners, 12.0), noise(rng, kind)
    points = rng.normal(size=(6, 3)) * [6, 6, 1.5]
    expected = np.array([integral(outline, p, C) for p in points])
    assert np.all(np.abs(core_shares(sheet(outline), points, C) - expected) < corners * CUT)


@pytest.mark.parametrize("at", [(1, 0), (2, 1), (1, 2), (0, 1), (1, 1)])
def test_a_point_right_on_an_edge_is_half_inside(at):
    square = 20 * np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    share = core_shares(sheet(square), np.array([[10.0 * at[0], 10.0 * at[1], 0.0]]), np.eye(3))
    assert share == pytest.approx(0.5 ** np.sum(np.array(at) != 1), abs=4 * CUT)


@pytest.mark.parametrize("kind", ["even", "uneven"])
@pytest.mark.parametrize("name", flat_bodies())
def test_cuts_lose_no_more_than_their_bound(name, kind):
    body, rng = flat_bodies()[name], np.random.default_rng(4)
    T = random_pose(rng)
    q, _ = touched(body, T, 30, 1e-3, rng)
    q = anisotropic(q, rng) if kind == "uneven" else q
    got = _core.details(body.shape(), q.core(), T[None], np.zeros((1, 0)))[0][0, :, 0]
    oracle = Oracle(body, q, EXACT)
    sds = np.sqrt(np.linalg.eigvalsh(q.covs + q.extra[:, None, None] * np.eye(3))[:, 0])
    peak = np.exp(-q.log_outlier) / (oracle.area * sds * np.sqrt(2 * np.pi))
    expected = np.array([sum(w for _, w in oracle.hits(j, T, np.zeros(0))) for j in range(30)])
    edges, flats = sum(len(f.outline) for f in oracle.flats), len(oracle.flats)
    assert np.all(np.abs(got - expected) < peak * (edges * CUT + flats * np.exp(-18)) + flats * 1e-9 * q.mean_rate)


@pytest.mark.parametrize("r", [-2.0, 0.0, 2.0])
def test_a_round_face_counts_once_but_for_its_curvature(r):
    radius, sd, n = 0.03, 3e-4, 24
    body, turn = cylinder(radius, 0.05, n), np.linspace(0, 2 * np.pi / n, 9)
    points = np.column_stack([(radius + r * sd) * np.cos(turn), (radius + r * sd) * np.sin(turn), np.full(9, 0.02)])
    q = point_question(points, sd)
    got = _core.details(body.shape(4), q.core(), np.eye(4)[None], np.zeros((1, 0)))[0][0, :, 0] * np.exp(q.log_outlier)
    on = np.linspace(-8 * sd / radius, 8 * sd / radius, 4001)
    gaps = (radius * np.cos(on) - radius - r * sd) ** 2 + (radius * np.sin(on)) ** 2
    true = np.sum(norm.pdf(np.sqrt(gaps), scale=sd)) * radius * (on[1] - on[0]) / (sd * np.sqrt(2 * np.pi))
    area = 0.5 * np.linalg.norm(body.across, axis=1).sum()
    assert np.log(got * area / true) == pytest.approx(0.5 * r * sd / radius, abs=6e-3)
