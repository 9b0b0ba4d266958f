"""Compute the stable poses of a part on a table, and its convex hull, which determines its outline in a stable pose.

Both are stored beside a part in the cache, and as columns of a catalogue.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.catalogue import cache
from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import FloatArray, Transforms, Vectors
from tanteo.parts import Part

ANY = 0.3
"""Fraction of parts that were placed by hand, for which all stable poses are equally probable."""

RESTS = "rests2"
"""Kind and version of the stored stable poses: rows of downward direction and probability in single precision."""

_SAME = 0.02
"""Angle below which two downward directions are the same stable pose [rad]."""

_FINE, _HULL = 2000, 200
"""Largest number of hull points for computing stable poses, and for storage; the latter shrinks a ball of 50 mm by up
to 0.5 mm."""


@dataclass(frozen=True, slots=True, eq=False)
class StablePose:
    """Stable pose on the plane z = 0.

    Attributes:
        T_table_part: pose with the centroid above the origin and the smallest rotation ``(4, 4)`` [m].
        probability: prior probability.
        height: height of the part in this pose [m].
    """

    T_table_part: Transforms
    probability: float
    height: float


def stable_poses(part: Part, least: float = 0.01) -> tuple[StablePose, ...]:
    """Return the stable poses of a part, most probable first.

    A pose is stable if the centroid is above the face of the convex hull that the part rests on. A dropped part ends on
    a face with a probability proportional to the solid angle of the face seen from the centroid, plus that of unstable
    faces that tip over to it (Goldberg et al. 1999, implemented in ``trimesh``).

    Args:
        part: part with its mesh; its density is assumed to be uniform.
        least: smallest probability of a pose for dropped parts; the most probable pose is always kept.
    """
    return _of_rows(part, _computed(part, least))


def known_stable_poses(part: Part) -> tuple[StablePose, ...]:
    """Return the stable poses of a part, most probable first, from the part, the cache or the catalogue if stored.

    Args:
        part: part with its mesh.
    """
    if "rest_poses" not in part.derived:
        rows = _stored(part)
        if rows is None:
            rows = _computed(part)
            cache.store_derived(part, RESTS, rows.tobytes())
        part.derived["rest_poses"] = _of_rows(part, rows)
    found: tuple[StablePose, ...] = part.derived["rest_poses"]
    return found


def stable_pose_rows(part: Part) -> np.ndarray:
    """Return downward direction in the part frame and probability of each stable pose ``(R, 4)``.

    Args:
        part: part with its mesh.
    """
    rows = _stored(part)
    return _computed(part) if rows is None else rows


def hull_points(part: Part) -> np.ndarray:
    """Return vertices of the convex hull ``(N, 3)`` [m], at most 200 extreme ones; of a flat part extreme vertices.

    Args:
        part: part with its mesh.
    """
    corners = _hull(part)
    return _few(part.vertices if corners is None else corners, _HULL).astype(np.float32)


def _stored(part: Part) -> np.ndarray | None:
    """Return the stored stable poses; None if there is no valid entry."""
    stored = cache.load_derived(part, RESTS)
    if stored is None or not stored.nbytes or stored.nbytes % 16:
        return None
    rows = stored.view(np.float32).reshape(-1, 4)
    return rows if np.isfinite(rows).all() else None


def _computed(part: Part, least: float = 0.01) -> np.ndarray:
    """Return rows of the stable poses, with symmetric poses merged."""
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
    """Return downward directions of the stable hull faces and their probabilities; both sides of a flat part."""
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
    """Return vertices of the convex hull; None for a flat part."""
    from scipy.spatial import ConvexHull, QhullError  # slow to import

    try:
        return part.vertices[ConvexHull(part.vertices).vertices]
    except QhullError:
        return None


def _few(points: Vectors, most: int) -> Vectors:
    """Return at most so many points: those extreme in directions evenly spaced on the sphere."""
    if len(points) <= most:
        return points
    k = np.arange(most) + 0.5
    z = 1 - 2 * k / most
    turn = np.pi * (1 + np.sqrt(5)) * k
    ways = np.stack([np.cos(turn) * np.sqrt(1 - z * z), np.sin(turn) * np.sqrt(1 - z * z), z])
    return points[np.unique(np.argmax(points @ ways, axis=0))]


def _equal(part: Part, first: FloatArray, second: FloatArray) -> bool:
    """Return whether the part's symmetry maps one downward direction to another."""
    turned = np.einsum("kij,j->ki", part.symmetry.Ts[:, :3, :3], second)
    if part.symmetry.spherical:
        return True
    if part.symmetry.axis is not None:
        axis = part.symmetry.axis[1]
        return bool(np.any(np.abs(turned @ axis - first @ axis) < _SAME))
    return bool(np.any(turned @ first > np.cos(_SAME)))


def _of_rows(part: Part, rows: np.ndarray) -> tuple[StablePose, ...]:
    exact = rows.astype(np.float64)
    down = exact[:, :3] / np.linalg.norm(exact[:, :3], axis=1, keepdims=True)
    return tuple(_rest(part, d, float(p)) for d, p in zip(down, exact[:, 3] / exact[:, 3].sum(), strict=True))


def _rest(part: Part, down: FloatArray, probability: float) -> StablePose:
    R = _turn_down(down)
    low = (part.vertices @ R.T)[:, 2]
    p = -R @ part.centroid
    p[2] = -low.min()
    return StablePose(SE3.from_parts(R, p), probability, float(np.ptp(low)))


def _turn_down(down: FloatArray) -> FloatArray:
    """Return the smallest rotation that maps a direction to -z."""
    axis = np.cross(down, [0.0, 0.0, -1.0])
    sine = float(np.linalg.norm(axis))
    cosine = -float(down[2])
    if sine < 1e-12:
        return np.eye(3) if cosine > 0 else np.diag([1.0, -1.0, -1.0])
    return SO3.exp(axis / sine * np.arctan2(sine, cosine))
