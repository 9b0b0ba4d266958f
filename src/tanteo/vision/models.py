"""A part made ready to be looked for: its edges, and its stable poses, those that symmetry makes equal counted once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.catalogue import cache
from tanteo.lie import SE3, SO3
from tanteo.parts import Part
from tanteo.typing import FloatArray, Transforms, Vectors
from tanteo.vision.descriptors import Descriptors, outline_from_above
from tanteo.vision.wireframe import Wireframe, wireframe

ANY = 0.3
"""Share of parts that lie as somebody put them, each stable pose as likely as the others."""

_KIND, _NUMBERS = "rests1", 18
"""Of what is kept beside a part in the cache, with its version; numbers of each."""

_SAME = 0.02
"""Directions down that differ less than this are one [rad]."""


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
    import trimesh  # slow to import

    mesh = trimesh.Trimesh(part.vertices, part.triangles, process=False)
    Ts, shares = trimesh.poses.compute_stable_poses(
        mesh, center_mass=np.array(part.centroid), sigma=0.0, n_samples=1, threshold=0.0
    )
    down = -np.asarray(Ts)[:, 2, :3]
    kept: list[tuple[FloatArray, float]] = []
    for k in np.argsort(-np.asarray(shares), kind="stable"):
        equal = [j for j, (other, _) in enumerate(kept) if _equal(part, down[k], other)]
        if equal:
            kept[equal[0]] = kept[equal[0]][0], kept[equal[0]][1] + float(shares[k])
        else:
            kept.append((down[k], float(shares[k])))
    kept = [pair for j, pair in enumerate(kept) if pair[1] >= least or j == 0]
    total = sum(share for _, share in kept)
    out = [_rest(part, d, (1 - ANY) * share / total + ANY / len(kept)) for d, share in kept]
    return tuple(sorted(out, key=lambda rest: -rest.probability))


def known_rests(part: Part) -> tuple[Rest, ...]:
    """The same; what was found before is in the cache, beside the part."""
    stored = cache.load_derived(part, _KIND)
    if stored is not None and stored.nbytes % (8 * _NUMBERS) == 0:
        rows = stored.view(np.float64).reshape(-1, _NUMBERS)
        if len(rows) and np.isfinite(rows).all():
            return tuple(Rest(row[:16].reshape(4, 4).copy(), float(row[16]), float(row[17])) for row in rows)
    found = rests(part)
    rows = np.array([[*rest.T_table_part.ravel(), rest.probability, rest.height] for rest in found])
    cache.store_derived(part, _KIND, rows.tobytes())
    return found


def _equal(part: Part, first: FloatArray, second: FloatArray) -> bool:
    """Whether the part's symmetry maps one direction down to the other."""
    turned = np.einsum("kij,j->ki", part.symmetry.Ts[:, :3, :3], second)
    if part.symmetry.spherical:
        return True
    if part.symmetry.axis is not None:
        axis = part.symmetry.axis[1]
        return bool(np.any(np.abs(turned @ axis - first @ axis) < _SAME))
    return bool(np.any(turned @ first > np.cos(_SAME)))


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


def lay(part: Part, rest: Rest, T_table_part: Transforms) -> Transforms:
    """The pose ``(*batch, 4, 4)`` at which the part lies exactly, nearest to a given one in place and yaw."""
    M = T_table_part[..., :3, :3] @ rest.T_table_part[:3, :3].T
    yaw = np.arctan2(M[..., 1, 0] - M[..., 0, 1], M[..., 0, 0] + M[..., 1, 1])
    middle = SE3.apply(T_table_part, part.centroid)
    middle[..., 2] = 0.0
    return np.asarray(SE3.from_parts(SO3.axis_rotation(2, yaw), middle) @ rest.T_table_part)


COARSE = 80
"""About how many samples of edges the first search uses."""


INNER = 48
"""How many points of the surface are asked whether they lie on bare table."""


@dataclass(frozen=True, slots=True, eq=False)
class VisionModel:
    """Computed once from the CAD.

    Attributes:
        part: the part.
        frame: samples of its edges.
        coarse: fewer of them, for the first search.
        inner: points all over its surface ``(INNER, 3)``, which are within its silhouette, part frame [m].
        rests: its stable poses on a table.
        outlines: of each of them from straight above [m].
    """

    part: Part
    frame: Wireframe
    coarse: Wireframe
    inner: Vectors
    rests: tuple[Rest, ...]
    outlines: tuple[Descriptors, ...]


def prepare_vision(part: Part) -> VisionModel:
    """Make a part ready; what was made is kept with the part, for further images."""
    if "vision" not in part.derived:
        frame, ways = wireframe(part), known_rests(part)
        outlines = tuple(outline_from_above(frame.surface, rest) for rest in ways)
        part.derived["vision"] = VisionModel(part, frame, wireframe(part, COARSE), spread(part), ways, outlines)
    model: VisionModel = part.derived["vision"]
    return model


def spread(part: Part, count: int = INNER) -> Vectors:
    """Points of a part's surface that are about as dense everywhere (Kronecker's sequence; Roberts 2018)."""
    a, b, c = np.moveaxis(part.vertices[part.triangles], 1, 0)
    upto = np.cumsum(np.linalg.norm(np.cross(b - a, c - a), axis=1))
    k = np.searchsorted(upto, (np.arange(count) + 0.5) / count * upto[-1])
    u, v = ((0.5 + share * np.arange(count)) % 1.0 for share in (0.7548776662, 0.5698402910))
    folded = np.where(u + v > 1, [1 - u, 1 - v], [u, v])[..., None]
    return np.asarray(a[k] + folded[0] * (b[k] - a[k]) + folded[1] * (c[k] - a[k]))
