"""What a ball touches beside faces: convex edges and vertices; and what keeps it off a face."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

PARALLEL, BESIDE, TURN = 1e-3, 1e-3, 1e-3


@dataclass(frozen=True)
class Touch:
    """One contact of a ball: on a flat, or on an edge or a vertex (``flat`` None)."""

    flat: object
    face: int
    round: bool
    normal: np.ndarray
    on_it: np.ndarray
    gap: float
    share: float
    sd: float
    bends: list


def middle(flat):
    """Return the centre of the bounding rectangle of the outline."""
    corners = flat.outline.reshape(-1, 2)
    return flat.origin + 0.5 * (corners.min(axis=0) + corners.max(axis=0)) @ np.stack([flat.u, flat.v])


def convex_edges(body, flats):
    """Edges between two flats that turn down from one to the other: ends, their numbers, normals, face of the first."""
    flat_of = {t: f for f in flats for t in f.triangles}
    T = body.triangles
    sides = {(t[i], t[(i + 1) % 3]): k for k, t in enumerate(T) for i in range(3)}
    for (a, b), k in sides.items():
        other = sides.get((b, a))
        if a > b or other is None or flat_of[k] is flat_of[other]:
            continue
        if _turn(body, a, b, k, other) > TURN:
            n0, n1 = (body.across[t] / np.linalg.norm(body.across[t]) for t in (k, other))
            yield *body.vertices[[a, b]], (a, b), n0, n1, body.faces[k]


def convex_vertices(body, edges):
    """Return the vertices where only convex edges end, three or more: position, edge directions, faces."""
    T = body.triangles
    sides = {(t[i], t[(i + 1) % 3]): k for k, t in enumerate(T) for i in range(3)}
    bad = {v for (a, b), k in sides.items() if (b, a) not in sides for v in (a, b)}
    bad |= {
        v
        for (a, b), k in sides.items()
        if (b, a) in sides and _turn(body, a, b, k, sides[b, a]) < -TURN
        for v in (a, b)
    }
    away = defaultdict(list)
    for a, b, (i, j), _, _, face in edges:
        d = (b - a) / np.linalg.norm(b - a)
        away[i].append((d, face))
        away[j].append((-d, face))
    return [(body.vertices[v], *zip(*ways, strict=True)) for v, ways in away.items() if len(ways) >= 3 and v not in bad]


def _turn(body, a, b, k, other):
    n0, n1 = (body.across[t] / np.linalg.norm(body.across[t]) for t in (k, other))
    d = body.vertices[b] - body.vertices[a]
    return np.cross(n0, n1) @ d / np.linalg.norm(d)


def over_edges(p, radius, sd, edges, reach):
    """Yield the density where the centre is on a cylinder about the edge, between the faces' normals."""
    for a, b, _, n0, n1, face in edges:
        d = (b - a) / np.linalg.norm(b - a)
        off = p - a
        out = off - (off @ d) * d
        far = np.linalg.norm(out)
        if abs(far - radius) > reach * sd or max(out @ n0, out @ n1) < 0:
            continue
        part = np.prod([norm.cdf(-(out @ i) / sd) for i in (np.cross(n0, d), np.cross(d, n1))])
        part *= norm.cdf(off @ d / sd) - norm.cdf((off @ d - np.linalg.norm(b - a)) / sd)
        n = out / far
        yield Touch(None, face, False, n, a, far - radius, part, sd, [(0.0, d), (1 / far, np.cross(n, d))])


def over_vertices(p, radius, sd, vertices, reach):
    """Yield the density where the centre is on a sphere about the vertex, outside of all its edges."""
    for at, away, faces in vertices:
        out = p - at
        far = np.linalg.norm(out)
        if abs(far - radius) > reach * sd:
            continue
        part = np.prod([norm.cdf(-(out @ d) / sd) for d in away])
        n = out / far
        u = np.cross(n, np.eye(3)[np.argmin(np.abs(n))])
        u /= np.linalg.norm(u)
        yield Touch(None, faces[0], False, n, at, far - radius, part, sd, [(1 / far, u), (1 / far, np.cross(n, u))])


def log_outside(own, near, diagonal):
    """Log of the share of the noise, along what is touched, that leaves the ball outside of other faces."""
    log = 0.0
    for other in near:
        if other.flat is own.flat or (own.round and other.round and own.face == other.face):
            continue
        if other.normal @ (own.on_it - other.on_it) <= 1e-9 * diagonal:
            continue
        if own.flat is not None and own.normal @ (other.on_it - own.on_it) <= 1e-9 * diagonal:
            continue
        cosine = other.normal @ own.normal
        sine = np.sqrt(max(1 - cosine**2, 0.0))
        if sine >= PARALLEL:
            u = (other.gap - cosine * own.gap) / (sine * own.sd)
            log += np.log(max(1 - other.share * norm.cdf(-u), 1e-300))
    return log
