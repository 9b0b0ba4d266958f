"""Meshes that no CAD system should write, and some do: for fuzzing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from core.bodies import Body, flat_bodies, round_bodies


def _soup(rng, scale):
    n = int(rng.integers(1, 40))
    vertices = scale * rng.normal(size=(int(rng.integers(3, 30)), 3))
    triangles = rng.integers(len(vertices), size=(n, 3))
    return Body(
        vertices, triangles, rng.integers(0, 5, n), np.full(n, -1), np.zeros((0, 11)), scale * rng.normal(size=(3, 6)),
        scale * rng.normal(size=(2, 3)),
    )  # fmt: skip


def _whole(rng, scale):
    bodies = list({**flat_bodies(), **round_bodies()}.values())
    body = bodies[rng.integers(len(bodies))]
    profiles = body.profiles * np.array([scale] * 3 + [1] * 3 + [scale, 1, scale, 1, 1])
    return replace(
        body, vertices=scale * 20 * body.vertices, edges=scale * 20 * body.edges, corners=scale * 20 * body.corners,
        profiles=profiles * np.array([20] * 3 + [1] * 3 + [20, 1, 20, 1, 1]),
    )  # fmt: skip


def _rows(body, rows):
    rows = np.atleast_1d(rows)
    return replace(body, triangles=body.triangles[rows], faces=body.faces[rows], profile_rows=body.profile_rows[rows])


def _open(body, rng):
    return _rows(body, rng.choice(len(body.triangles), size=max(1, len(body.triangles) // 2), replace=False))


def _doubled(body, rng):
    return _rows(body, np.r_[np.arange(len(body.triangles)), rng.integers(len(body.triangles), size=5)])


def _inverted(body, rng):
    turned = rng.uniform(size=len(body.triangles)) < rng.uniform(0.1, 1)
    return replace(body, triangles=np.where(turned[:, None], body.triangles[:, ::-1], body.triangles))


def _fins(body, rng):
    """Three triangles at one edge."""
    more = np.stack([np.r_[t[:2], rng.integers(len(body.vertices))] for t in body.triangles[:3]])
    return replace(
        body, triangles=np.concatenate([body.triangles, more]), faces=np.r_[body.faces, 0, 0, 0],
        profile_rows=np.r_[body.profile_rows, -1, -1, -1],
    )  # fmt: skip


def _flat_triangles(body, rng):
    """Return some triangles without an area: a corner twice, or three in a line."""
    k = rng.integers(len(body.triangles), size=3)
    triangles, vertices = body.triangles.copy(), body.vertices
    triangles[k[0], 1] = triangles[k[0], 0]
    triangles[k[1]] = triangles[k[1], 0]
    middle = vertices[triangles[k[2], :2]].mean(axis=0)
    triangles[k[2], 2] = len(vertices)
    return replace(body, triangles=triangles, vertices=np.concatenate([vertices, middle[None]]))


def _coincident(body, rng):
    """Return a mesh with all vertices twice and triangles on one or the other copy."""
    n = len(body.vertices)
    return replace(
        body, vertices=np.concatenate([body.vertices] * 2),
        triangles=body.triangles + n * rng.integers(0, 2, body.triangles.shape),
    )  # fmt: skip


def _squeezed(body, rng):
    factor = 10.0 ** -rng.integers(3, 14)
    return replace(body, vertices=body.vertices * np.r_[1, 1, factor])


def _far(body, rng):
    return replace(body, vertices=body.vertices + body.diagonal * 10.0 ** rng.integers(1, 7) * rng.normal(size=3))


def _gaps(body, rng):
    """Faces with numbers that do not follow each other."""
    return replace(body, faces=body.faces * 997)


def _strange_profiles(body, rng):
    n = len(body.profiles)
    return replace(body, profiles=rng.choice([0.0, 1.0, -1.0, 1e-9, 1e9], size=(n, 11)) * rng.normal(size=(n, 11)))


DAMAGES = [
    _open, _doubled, _inverted, _fins, _flat_triangles, _coincident, _squeezed, _far, _gaps, _strange_profiles,
]  # fmt: skip


def random_mesh(rng):
    """Return a random body or triangle soup, at any scale, damaged once or twice."""
    scale = 10.0 ** rng.integers(-6, 7)
    body = _soup(rng, scale) if rng.uniform() < 0.2 else _whole(rng, scale)
    for damage in rng.choice(len(DAMAGES), size=rng.integers(0, 3), replace=False):
        body = DAMAGES[damage](body, rng)
    return (body, scale) if np.any(body.across) else random_mesh(rng)
