"""How a part may lie on a table: its stable poses, and its convex hull, which is all that its outline there is made of.

Both are kept: beside a part in the cache, and as columns of a catalogue.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.catalogue import cache
from tanteo.lie import SE3, SO3
from tanteo.parts import Part
from tanteo.typing import FloatArray, Transforms, Vectors

ANY = 0.3
"""Share of parts that lie as somebody put them, each stable pose as likely as the others."""

RESTS = "rests2"
"""Of what is kept beside a part, with its version: rows of direction down and probability, in single precision."""

_SAME = 0.02
"""Directions down that differ less than this are one [rad]."""

_FINE, _HULL = 2000, 200
"""Points of a hull from which a few of them stand for it; so many at most are kept of any: a ball of 50 mm is
taken as up to half a millimetre smaller."""


@dataclass(frozen=True, slots=True, eq=False)
class Rest:
    """One way to lie on the plane z = 0.

    Attributes:
        T_table_part: the part lying at the origin: centroid over it, turned as little as can be ``(4, 4)``.
        probability: beforehand.
        height: of the part as it lies [m].
    """

    T_table_part: Transforms
    probability: float
    height: float


def rests(part: Part, least: float = 0.01) -> tuple[Rest, ...]:
    """The stable poses of a part, most probable first.

    A pose is stable if the centroid is over the face of the convex hull that it stands on; a part that is dropped comes
    to lie on a face as often as the centroid sees it, tipping over unstable ones (Goldberg and others 1999, by
    ``trimesh``).

    Args:
        part: with its mesh; its density is taken as even.
        least: poses that dropped parts take less often than this are left out, but for the best.
    """
    return _of_rows(part, _computed(part, least))


def known_rests(part: Part) -> tuple[Rest, ...]:
    """The same; what was found before stays with the part, and is beside it in the cache or its catalogue."""
    if "rest_poses" not in part.derived:
        rows = _stored(part)
        if rows is None:
            rows = _computed(part)
            cache.store_derived(part, RESTS, rows.tobytes())
        part.derived["rest_poses"] = _of_rows(part, rows)
    found: tuple[Rest, ...] = part.derived["rest_poses"]
    return found


def rest_rows(part: Part) -> np.ndarray:
    """Of each stable pose the direction down in the part's frame, and its probability ``(R, 4)``."""
    rows = _stored(part)
    return _computed(part) if rows is None else rows


def hull_points(part: Part) -> np.ndarray:
    """Corners of the convex hull, or those of very many that are the farthest in some direction ``(N, 3)``.

    Of a flat part, which has none, they are taken among all its vertices.
    """
    corners = _hull(part)
    return _few(part.vertices if corners is None else corners, _HULL).astype(np.float32)


def _stored(part: Part) -> np.ndarray | None:
    """What is beside the part, if it is whole."""
    stored = cache.load_derived(part, RESTS)
    if stored is None or not stored.nbytes or stored.nbytes % 16:
        return None
    rows = stored.view(np.float32).reshape(-1, 4)
    return rows if np.isfinite(rows).all() else None


def _computed(part: Part, least: float = 0.01) -> np.ndarray:
    """Rows of the stable poses; those that symmetry makes equal are one."""
    down, shares = _faces_down(part)
    kept: list[tuple[FloatArray, float]] = []
    for k in np.argsort(-np.asarray(shares), kind="stable"):
        equal = [j for j, (other, _) in enumerate(kept) if _equal(part, down[k], other)]
        if equal:
            kept[equal[0]] = kept[equal[0]][0], kept[equal[0]][1] + float(shares[k])
        else:
            kept.append((down[k], float(shares[k])))
    kept = [pair for j, pair in enumerate(kept) if pair[1] >= least or j == 0]
    total = sum(share for _, share in kept)
    rows = [(*d, (1 - ANY) * share / total + ANY / len(kept)) for d, share in kept]
    return np.array(sorted(rows, key=lambda row: -row[3]), dtype=np.float32).reshape(-1, 4)


def _faces_down(part: Part) -> tuple[Vectors, FloatArray]:
    """Directions down of faces of the hull that the part may lie on, and how often it does; of a sheet both sides."""
    import trimesh  # slow to import

    corners = _hull(part)
    if corners is None:
        normal = np.linalg.svd(part.vertices - part.vertices.mean(axis=0), full_matrices=False)[2][2]
        return np.stack([normal, -normal]), np.full(2, 0.5)
    hull = trimesh.convex.convex_hull(_few(corners, _FINE))
    Ts, shares = trimesh.poses.compute_stable_poses(
        hull, center_mass=np.array(part.centroid), sigma=0.0, n_samples=1, threshold=0.0
    )
    return -np.asarray(Ts)[:, 2, :3], np.asarray(shares)


def _hull(part: Part) -> Vectors | None:
    """Corners of the convex hull; None of a part that is flat."""
    from scipy.spatial import ConvexHull, QhullError  # slow to import

    try:
        return part.vertices[ConvexHull(part.vertices).vertices]
    except QhullError:
        return None


def _few(points: Vectors, most: int) -> Vectors:
    """The points; of more than these those that are the farthest in so many directions, even over the sphere."""
    if len(points) <= most:
        return points
    k = np.arange(most) + 0.5
    z, turn = 1 - 2 * k / most, np.pi * (1 + np.sqrt(5)) * k
    ways = np.stack([np.cos(turn) * np.sqrt(1 - z * z), np.sin(turn) * np.sqrt(1 - z * z), z])
    return points[np.unique(np.argmax(points @ ways, axis=0))]


def _equal(part: Part, first: FloatArray, second: FloatArray) -> bool:
    """Whether the part's symmetry maps one direction down to the other."""
    turned = np.einsum("kij,j->ki", part.symmetry.Ts[:, :3, :3], second)
    if part.symmetry.spherical:
        return True
    if part.symmetry.axis is not None:
        axis = part.symmetry.axis[1]
        return bool(np.any(np.abs(turned @ axis - first @ axis) < _SAME))
    return bool(np.any(turned @ first > np.cos(_SAME)))


def _of_rows(part: Part, rows: np.ndarray) -> tuple[Rest, ...]:
    exact = rows.astype(np.float64)
    down = exact[:, :3] / np.linalg.norm(exact[:, :3], axis=1, keepdims=True)
    return tuple(_rest(part, d, float(p)) for d, p in zip(down, exact[:, 3] / exact[:, 3].sum(), strict=True))


def _rest(part: Part, down: FloatArray, probability: float) -> Rest:
    R = _turn_down(down)
    low = (part.vertices @ R.T)[:, 2]
    p = -R @ part.centroid
    p[2] = -low.min()
    return Rest(SE3.from_parts(R, p), probability, float(np.ptp(low)))


def _turn_down(down: FloatArray) -> FloatArray:
    """The smallest rotation that takes a direction to -z."""
    axis = np.cross(down, [0.0, 0.0, -1.0])
    sine, cosine = float(np.linalg.norm(axis)), -float(down[2])
    if sine < 1e-12:
        return np.eye(3) if cosine > 0 else np.diag([1.0, -1.0, -1.0])
    return SO3.exp(axis / sine * np.arctan2(sine, cosine))
