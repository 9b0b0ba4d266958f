"""Poses with three sensed centres on three axes of holes and bosses, or on centres of spheres and apexes.

The centre of a hole may be at any height along its axis. So the distance of two centres has to equal one between points
on two axes. A sphere centre or an apex is an axis without length. Few triples of holes fit, as few triples of faces fit
three planes (``plane_votes.py``).
"""

from __future__ import annotations

from functools import cached_property
from itertools import combinations

import numpy as np

from tanteo import _core
from tanteo.factors import ContactPoints
from tanteo.factors.factor import numbered_landmarks
from tanteo.geometry import SE3
from tanteo.geometry.typing import BoolArray, FloatArray, Indices, IntArray, Transforms, Vectors
from tanteo.parts import Part
from tanteo.posterior.prepared import PreparedPart
from tanteo.posterior.sampling.peaks import spread_out
from tanteo.posterior.settings import SearchSettings


class Axes:
    """Axes of the holes and bosses of a part, and centres of its spheres and cones.

    Attributes:
        ends: end points of each axis ``(N, 2, 3)`` [m].
        sizes: least and largest radius [m], or half angle [rad], of each axis or centre ``(N, 2)``.
        sides: 1 for a hole, -1 for a boss ``(N,)``.
        kinds: name of the factor of the core that measures each axis or centre ``(N,)``.
    """

    def __init__(self, part: Part, settings: SearchSettings) -> None:
        self.settings = settings
        ends, sizes, sides, kinds, numbers = [], [], [], [], set[int]()
        for cls, number, one in numbered_landmarks(part):
            if number in numbers:
                continue  # the axis of another wall
            numbers.add(number)
            middle, half = one.ends.mean(axis=0), 0.5 * (one.ends - one.ends.mean(axis=0))
            ends.append(middle + half if one.is_line else one.ends[[0, 0]])
            sizes.append(one.sizes)
            sides.append(1.0 if one.hole else -1.0)
            kinds.append(cls.core)
        self.ends = np.array(ends).reshape(-1, 2, 3)
        self.sizes = np.array(sizes).reshape(-1, 2)
        self.sides = np.array(sides)
        self.kinds = np.array(kinds)

    def __len__(self) -> int:
        return len(self.ends)

    @cached_property
    def distances(self) -> tuple[FloatArray, FloatArray]:
        """Return the least and largest distance between places of two axes ``(N, N)`` [m].

        A centre may be anywhere along an axis: the least distance is that of the lines, and only two points have a
        largest one.
        """
        a, along = self.ends[:, 0], self.ends[:, 1] - self.ends[:, 0]
        unit = along / np.maximum(np.linalg.norm(along, axis=1), np.finfo(float).tiny)[:, None]
        corners = np.linalg.norm(self.ends[:, None, :, None] - self.ends[None, :, None], axis=-1)
        off = a[None] - a[:, None]
        beside = np.linalg.norm(off - np.einsum("ijk,jk->ij", off, unit)[..., None] * unit, axis=-1)
        across = np.cross(unit[:, None], unit)
        sines = np.linalg.norm(across, axis=-1)
        skew = np.abs(np.einsum("ijk,ijk->ij", off, across)) / np.maximum(sines, 1e-12)
        point = np.all(along == 0, axis=1)
        most = np.where(point[:, None] & point, corners.max(axis=(2, 3)), np.inf)
        return np.where(sines > self.settings.tilt_as_made, skew, np.minimum(beside, beside.T)), most

    def allowed(self, points: ContactPoints) -> BoolArray:
        """Return whether each centre may be on each axis, by kind, material side and size ``(n, N)``."""
        size, sd, side = sensed_sizes(points)[..., None]
        gate = self.settings.gate * sd
        near = (size > self.sizes[:, 0] - gate) & (size < self.sizes[:, 1] + gate)
        same_kind = np.array([factor.core for factor in points.factors])[:, None] == self.kinds
        return np.asarray(same_kind & (side * self.sides >= 0) & ((size == 0) | near))


def sensed_sizes(points: ContactPoints) -> FloatArray:
    """Return the sensed size of each point, its standard deviation, and the material side ``(3, n)``; 0 if unknown."""
    sizes = [(0.0, 0.0) if f.sensed_size is None else (f.sensed_size.value, f.sensed_size.sd) for f in points.factors]
    return np.column_stack([np.array(sizes).reshape(-1, 2), [f.material_side for f in points.factors]]).T


def from_centres(
    points: ContactPoints, core: _core.Problem, prepared: PreparedPart, settings: SearchSettings, prior: Transforms
) -> Transforms:
    """Return poses with three centres on three axes, refined with all points, best first ``(S, 4, 4)``.

    Args:
        points: all measurements.
        core: the problem for the core.
        prepared: the part.
        settings: settings of the search.
        prior: prior poses, which state the heights of parallel axes where nothing was touched ``(A, 4, 4)``.
    """
    rows, none = np.flatnonzero(points.centres), np.zeros((0, 4, 4))
    if len(rows) < 3:
        return none
    axes = Axes(prepared.part, settings)
    if len(axes) < 3:
        return none
    centres = points.take(rows)
    found = [_placed(centres, axes, triple) for triple in _triples(centres, settings)]
    Ts = np.concatenate([none, *found])
    Ts = Ts[np.argsort(_costs(centres, axes, Ts), kind="stable")[: settings.kept]]
    return _refined(points, core, prepared, axes, Ts, prior) if len(Ts) else none


def _triples(centres: ContactPoints, settings: SearchSettings) -> list[IntArray]:
    """Return triples of centres that are far apart and not in a row, the largest triangles first."""
    spread = spread_out(centres.landmarks, settings.items)
    triples = np.array(list(combinations(spread.tolist(), 3)))
    a, b, c = centres.landmarks[triples].transpose(1, 0, 2)
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    longest = np.max([np.linalg.norm(p - q, axis=1) for p, q in ((a, b), (b, c), (c, a))], axis=0)
    chosen, used = list[IntArray](), set[int]()
    for k in np.argsort(-areas, kind="stable"):
        if areas[k] > settings.off_line * longest[k] ** 2 and used.isdisjoint(triples[k].tolist()):
            chosen.append(triples[k])
            used.update(triples[k].tolist())
    return chosen[: settings.tuples]


def _placed(centres: ContactPoints, axes: Axes, triple: IntArray) -> Transforms:
    """Return poses with three centres on three axes."""
    p, sd, allowed = centres.landmarks[triple], centres.sd[triple], axes.allowed(centres.take(triple))
    (least, most), gate = axes.distances, axes.settings.gate

    def fits(i: int, j: int) -> BoolArray:
        apart, within = float(np.linalg.norm(p[i] - p[j])), gate * float(np.hypot(sd[i], sd[j])) + axes.settings.as_made
        near = (least < apart + within) & (most > apart - within)
        return np.asarray(near & allowed[i][:, None] & allowed[j] & ~np.eye(len(axes), dtype=bool))

    first, second, third = fits(0, 1), fits(0, 2), fits(1, 2)
    a, b = np.nonzero(first)
    a, b = a[: 20 * axes.settings.max_tuples], b[: 20 * axes.settings.max_tuples]
    pair, c = np.nonzero(second[a] & third[b])
    picked = np.linspace(0, len(pair) - 1, min(len(pair), axes.settings.max_tuples)).astype(int)
    chosen = axes.ends[np.column_stack([a[pair], b[pair], c])[picked]]
    return _on_axes(p, chosen, axes.settings) if len(chosen) else np.zeros((0, 4, 4))


def _on_axes(p: Vectors, ends: FloatArray, settings: SearchSettings) -> Transforms:
    """Return poses ``(K, 4, 4)`` that bring points ``(3, 3)`` near axes ``(K, 3, 2, 3)``, by alternating projection."""
    along = ends[:, :, 1] - ends[:, :, 0]
    squares = np.maximum(np.sum(along**2, axis=-1), np.finfo(float).tiny)
    places, steps = ends.mean(axis=2), settings.steps // 2
    Ts = _aligned(places, p)
    for _ in range(steps):
        there = SE3.apply(SE3.inverse(Ts)[:, None], np.broadcast_to(p, places.shape))
        t = np.sum((there - ends[:, :, 0]) * along, axis=-1) / squares
        places = ends[:, :, 0] + t[..., None] * along
        Ts = _aligned(places, p)
    return Ts


def _aligned(places: Vectors, p: Vectors) -> Transforms:
    """Return rigid motions that bring places ``(K, 3, 3)`` nearest to points ``(3, 3)`` (Kabsch 1976)."""
    middles, middle = places.mean(axis=1), p.mean(axis=0)
    u, _, v = np.linalg.svd(np.einsum("kni,nj->kij", places - middles[:, None], p - middle))
    u[..., 2] *= np.sign(np.linalg.det(u) * np.linalg.det(v))[:, None]
    R = np.swapaxes(u @ v, 1, 2)
    return SE3.from_parts(R, middle - np.einsum("kij,kj->ki", R, middles))


def _costs(centres: ContactPoints, axes: Axes, Ts: Transforms) -> FloatArray:
    """Return the sum of squared distances of some centres from the axes, each truncated ``(S,)``."""
    some = spread_out(centres.landmarks, axes.settings.few_points)
    a, along = axes.ends[:, 0], axes.ends[:, 1] - axes.ends[:, 0]
    squares, allowed = np.maximum(np.sum(along**2, axis=1), np.finfo(float).tiny), axes.allowed(centres.take(some))
    within = axes.settings.gate * centres.sd[some] + 2 * axes.settings.as_made
    out = np.zeros(len(Ts))
    for k, T in enumerate(SE3.inverse(Ts)):
        off = SE3.apply(T, centres.landmarks[some])[:, None] - a
        t = np.sum(off * along, axis=-1) / squares
        beside = np.linalg.norm(off - t[..., None] * along, axis=-1)
        nearest = np.where(allowed, beside, np.inf).min(axis=1)
        out[k] = np.sum(np.minimum((nearest / within) ** 2, 9.0))
    return out


def _refined(
    points: ContactPoints, core: _core.Problem, prepared: PreparedPart, axes: Axes, Ts: Transforms, prior: Transforms
) -> Transforms:
    """Refine poses by all points, with scales from the depth of a hole down to the noise.

    Centres leave the height open: each pose is also tried after slides along the axes.
    """
    both = (np.flatnonzero(points.centres), np.flatnonzero(~points.centres))
    few = axes.settings.few_points  # evenly spaced rows of either kind
    rows: Indices = np.concatenate([r[np.linspace(0, len(r) - 1, min(len(r), few)).astype(int)] for r in both])
    along = axes.ends[:, 1] - axes.ends[:, 0]
    deep = float(np.median(np.linalg.norm(along, axis=1)))
    direction = np.linalg.svd(along, full_matrices=False)[2][0]
    touched = points.points[rows[len(rows) - min(len(both[1]), few) :]]
    slides = _slides(prepared.part, direction, Ts, touched, prior)
    moves = np.tile(np.eye(4), (*slides.shape, 1, 1))
    moves[..., :3, 3] = slides[..., None] * direction
    Ts = (Ts[:, None] @ moves).reshape(-1, 4, 4)
    end = 2 * float(np.median(points.sd))
    count = max(4, int(np.ceil(np.log(max(deep / end, 1.0)) / (2 * axes.settings.scale_step))) + 1)
    scales = np.geomspace(max(deep, end), end, count)
    refined, *_ = _core.refine_poses(prepared.shape, core, rows.astype(np.int32), scales, np.ascontiguousarray(Ts))
    return np.asarray(refined)


_SLIDES = 3
"""Numerical: number of slides along the axes from which each pose is refined."""


def _slides(part: Part, direction: Vectors, Ts: Transforms, touched: Vectors, prior: Transforms) -> FloatArray:
    """Return slides along the axes that bring touched points to heights of faces, or the part to its prior ``(S, k)``.

    Args:
        part: the part.
        direction: common direction of the axes, part frame ``(3,)``.
        Ts: poses ``(S, 4, 4)``.
        touched: touched points in the world ``(m, 3)`` [m].
        prior: prior poses ``(A, 4, 4)``.
    """
    back = SE3.inverse(Ts)
    if len(touched):
        planes = part.planes.Ts_part_feature
        level = np.abs(planes[:, :3, 2] @ direction) > 1 - 0.5 * _LEVEL**2
        heights = np.unique(np.round(np.r_[planes[level, :3, 3] @ direction, *_ends(part, direction)], 6))
        at = SE3.apply(back[:, None], touched[None]) @ direction
        slides = (at[:, :, None] - heights).reshape(len(Ts), -1)
        off = np.abs(at[:, None, :, None] - slides[:, :, None, None] - heights).min(axis=-1)
        costs = np.minimum(off / (np.ptp(heights) + 1e-9), _SAME_HEIGHT).sum(axis=-1)
        best = np.argsort(costs, axis=1, kind="stable")
        chosen = np.take_along_axis(slides, best[:, : 4 * _SLIDES * len(touched)], axis=1)
        return np.stack([_different(own, float(np.ptp(heights)) * _SAME_HEIGHT)[:_SLIDES] for own in chosen])
    if len(prior):
        away = SE3.apply(prior[:_SLIDES], part.centroid)
        return np.asarray((SE3.apply(back[:, None], away[None]) - part.centroid) @ direction)
    return np.zeros((len(Ts), 1))


_LEVEL = 0.05
"""Numerical: largest angle of a face's normal to the axes at which the face has one height [rad]."""

_SAME_HEIGHT = 0.02
"""Numerical: difference of heights, over the part's extent along the axes, within which refinement decides."""


def _ends(part: Part, direction: Vectors) -> tuple[float, float]:
    along = part.vertices @ direction
    return float(along.min()), float(along.max())


def _different(slides: FloatArray, within: float) -> FloatArray:
    """Return the first slides that differ by more than a distance, the last one repeated to the length of all."""
    out = list[float]()
    for one in slides:
        if all(abs(one - other) > within for other in out):
            out.append(float(one))
    return np.array(out + [out[-1]] * (len(slides) - len(out)))
