"""Joint model of the surfaces of an unknown object: made objects have parallel and perpendicular faces.

Most objects have faces along three perpendicular axes, and several faces in one plane. Labels and sensed normals show
such faces. Readings without either may share planes, and readings anywhere in a ball hardly ever lie on few planes.
Poses of the parts propose which readings do. The unknown object has planes of its own through them: its size and
position are unknown, and most of its surface is on its bounding box (decision 62).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import erfc

import numpy as np

from tanteo.geometry import SO3, maximize
from tanteo.geometry.special import log_even, log_sum
from tanteo.geometry.typing import BoolArray, Covariances, FloatArray, IntArray, Rotations, Transforms, Vectors
from tanteo.parts import Part
from tanteo.posterior.details import Details
from tanteo.posterior.labels import ANGLES, SMALLEST, Facets
from tanteo.posterior.outliers import JEFFREYS, LEAST_RATE
from tanteo.posterior.problem import Problem
from tanteo.posterior.settings import DEFAULTS, Settings
from tanteo.posterior.touched_region import LARGER

_AXIS_STEPS = 3
"""Numerical: Newton steps from axes of a pair of normals to a maximum; convergence is quadratic."""

_COVERED = 1, JEFFREYS
"""Parameters of the beta density of the fraction of a side of the bounding box that has a face. Its moments 1, 2, 3, 5
are 0.67, 0.53, 0.46, 0.37; those of the parts of ``benchmarks/unknown_parts.py shapes`` 0.61, 0.48, 0.41, 0.35."""

_ALIGNED = 1e-3
"""Numerical: largest sine of the angle between normals of a CAD part that are parallel."""

_SAME = 1e-6
"""Numerical: largest distance of two faces in one plane over the diagonal of the part."""

_GRAZING = 0.02
"""Numerical: smallest cosine of incidence of a beam, as in the core."""

_ATTITUDES = 8 * np.pi**2 / 24
"""Definition: volume of the attitudes of three perpendicular axes; 24 are equal [rad^3]."""

_SCALES = np.linspace(-4.0, 4.0, 17)
"""Numerical: nodes of the integral over the state of the noise scale."""

_LEAST_LEFT = 1e-3
"""Numerical: least fraction of the variance of a reading that is not common to a face."""

_WITHIN = 32
"""Numerical: places between two nodes of that integral at which the parabola is summed."""

_ROUNDING = 1e-12
"""Numerical: relative information that every state has beside that of readings and prior; above rounding."""

_OF_CORNERS = 5 / 3
"""Definition: mean variance over a rectangle that is displaced and tilted about two axes, which move the
middles of its sides by one standard deviation each [1]."""

_WEAK = 1e-8
"""Numerical: information of an even density over that of a reading."""

_GENERIC = np.sqrt([1.0, 2.0, 3.0])
"""Numerical: a direction that is along no face; it distinguishes the two sides of a plane."""

SIZES = 12
"""Numerical: nodes of the integral over a size of an unknown object: its radius, or a side of its bounding box."""


def log_joint_surfaces(facets: Facets, share: float, radius: float, settings: Settings = DEFAULTS) -> float:
    """Return the log density of facets of one made object over that of independent facets.

    Args:
        facets: pieces of planes.
        share: fraction of the faces along three perpendicular axes.
        radius: radius of the object [m].
        settings: settings of the inference.
    """
    return log_right_angled(facets, share, settings) + log_level(facets, radius, settings)


def log_level(facets: Facets, radius: float, settings: Settings = DEFAULTS) -> float:
    """Return the log density of the positions of facets over that of independent facets: some share a plane.

    Args:
        facets: pieces of planes.
        radius: radius of the object [m].
        settings: settings of the inference.
    """
    n, total = facets.normals, 0.0
    for k in range(1, len(facets)):
        tilts = facets.covariances[:k] + facets.covariances[k]
        rotated = n[:k] - n[k]
        parallel = np.sum(rotated**2, axis=1) < settings.search.reach_sds**2 * np.trace(tilts, axis1=1, axis2=2)
        parallel &= np.isfinite(facets.variances[:k] + facets.variances[k])
        if not parallel.any():
            continue
        offset = facets.points[k] - facets.points[:k][parallel]
        off = np.sum(offset * n[:k][parallel], axis=1)
        levers = np.einsum("ki,kij,kj->k", offset, facets.covariances[:k][parallel], offset)
        variance = facets.variances[:k][parallel] + facets.variances[k] + levers
        log = np.log(2 * radius) - 0.5 * np.log(2 * np.pi * variance) - 0.5 * off**2 / variance
        total += float(log_even(log.max()))  # half of parallel facets share a plane (decision 62)
    return total


def log_right_angled(facets: Facets, share: float, settings: Settings = DEFAULTS) -> float:
    """Return the log density of normals over that of independent ones: a fraction is along perpendicular axes.

    Args:
        facets: pieces of planes.
        share: fraction of the faces along the axes.
        settings: settings of the inference.
    """
    normals, covariances = facets.normals, facets.covariances
    k = len(normals)
    if k < 2:
        return 0.0
    none, one = k * np.log1p(-share), np.log(k * share) + (k - 1) * np.log1p(-share)
    tangents = SO3.frame_from_axis(normals, 2)[:, :, :2]
    S = np.swapaxes(tangents, 1, 2) @ covariances @ tangents
    frames = _axes_of_pairs(normals, settings.unknown.axis_pairs)
    log, frames = _maximized(frames, tangents, S, normals, share)
    order, kept = np.argsort(-log, kind="stable"), list[int]()
    for i in order:
        turns = np.abs(np.swapaxes(frames[kept], 1, 2) @ frames[i])
        if not np.any(turns.max(axis=2).min(axis=1) > np.cos(settings.unknown.same_axes)):
            kept.append(int(i))
    return float(log_sum([none, one, *log[kept]]))


def _axes_of_pairs(normals: Vectors, count: int) -> FloatArray:
    """Return perpendicular axes through pairs of directions, as columns ``(F, 3, 3)``.

    If the two directions are parallel, one axis is along both.
    """
    a, b = np.triu_indices(len(normals), 1)
    cosines = np.abs(np.sum(normals[a] * normals[b], axis=1))
    some = np.argsort(cosines, kind="stable")[:count]
    x, z = normals[a[some]], np.cross(normals[a[some]], normals[b[some]])
    sines = np.linalg.norm(z, axis=1, keepdims=True)
    z = np.where(sines > 0.5, z / np.maximum(sines, 1e-12), SO3.frame_from_axis(x, 0)[..., 2])
    return np.stack([x, np.cross(z, x), z], axis=-1)


def _maximized(
    frames: FloatArray, tangents: FloatArray, S: Covariances, normals: Vectors, share: float
) -> tuple[FloatArray, FloatArray]:
    """Return axes at the maxima, and log integrals about them over the density of uniform directions."""
    free = 8 * np.pi**2 / 24  # attitudes of a body, of which 24 have the same axes
    W, log_det = np.linalg.inv(S), np.linalg.slogdet(S)[1]

    def evaluate(frames: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        along = np.einsum("fia,ki->fka", frames, normals)
        nearest = np.argmax(np.abs(along), axis=2)
        sign = np.sign(np.take_along_axis(along, nearest[..., None], 2))
        a = np.take_along_axis(np.swapaxes(frames, 1, 2), nearest[..., None], 1) * sign
        r = np.einsum("kib,fki->fkb", tangents, a)
        pulls = np.einsum("kab,fkb->fka", W, r)
        q = np.einsum("fka,fka->fk", r, pulls)
        on = np.log(share * 4 * np.pi / 6) - np.log(2 * np.pi) - 0.5 * log_det - 0.5 * q
        total = np.logaddexp(np.log1p(-share), on)
        weight = np.exp(on - total)
        J = -np.swapaxes(tangents, 1, 2) @ SO3.hat(a)  # the axis moves by phi x a
        H = np.einsum("fk,fkai,kab,fkbj->fij", weight, J, W, J) + 2 * np.pi / free ** (2 / 3) * np.eye(3)
        g = -np.einsum("fk,fkai,fka->fi", weight, J, pulls)
        log = total.sum(axis=1) + 1.5 * np.log(2 * np.pi) - 0.5 * np.linalg.slogdet(H)[1] - np.log(free)
        return H, g, log

    frames, _ = maximize(frames, lambda at: evaluate(at)[:2], lambda at, step: SO3.exp(step) @ at, _AXIS_STEPS)
    return evaluate(frames)[2], frames


@dataclass(frozen=True, slots=True, eq=False)
class SharedPlanes:
    """Readings that share planes at a pose of a part.

    Attributes:
        planes: rows of the readings of each plane, and the side of the plane on which the object is; they identify the
            assumption.
        log_gain: log density of the readings on an object with these planes, over that of readings anywhere.
        log_displaced: log density of the readings on the part, of which half have displaced faces, over that on the
            part as drawn.
    """

    planes: frozenset[tuple[frozenset[int], bool]]
    log_gain: float
    log_displaced: float = 0.0


def log_gain_of_planes(found: Iterable[SharedPlanes]) -> float:
    """Return the log density of readings on an unknown object, over that of readings anywhere.

    Half of the unknown objects have flat faces. Their density is the sum over all sets of readings that share planes.
    They may explain readings better than the part as drawn, since their planes are free. Only what they explain better
    than a part whose faces are displaced counts.
    """
    best: dict[frozenset[tuple[frozenset[int], bool]], float] = {}
    for one in found:
        best[one.planes] = max(best.get(one.planes, -np.inf), one.log_gain - one.log_displaced)
    return float(np.logaddexp(0.0, log_sum(list(best.values()))) - np.log(2)) if best else 0.0


def shared_planes(
    at: Details, problem: Problem, part: Part, Ts: Transforms, zs: FloatArray, anywhere: float
) -> list[SharedPlanes]:
    """Return which readings share planes at each pose of a part, and their densities on an unknown object.

    Args:
        at: readings at the poses.
        problem: measurements and priors.
        part: the part.
        Ts: poses of the part ``(S, 4, 4)``.
        zs: states beside the pose: shared errors, and the noise scale ``(S, D)``.
        anywhere: log density of the readings without a plane of their own, anywhere on an unknown object
            (:attr:`~tanteo.posterior.unknown.SizesOfUnknown.log_density`).
    """
    free, out = without_plane(problem), list[SharedPlanes]()
    flat = np.array([face.surface == "plane" for face in part.faces], dtype=np.bool_)
    if len(free) < 2:
        return out
    own = ((s, _Box.of(at, s, problem, free, flat, _SAME * part.diagonal, T)) for s, T in enumerate(Ts))
    boxes = {s: box for s, box in own if box is not None}
    gains = {s: box.log_gain(problem, anywhere, part, zs[s]) for s, box in boxes.items()}
    best = 0.0
    for s in sorted(gains, key=lambda s: -gains[s]):
        if gains[s] + np.log(2) < best - problem.settings.search.negligible:
            break  # displaced faces explain readings at least half as well as those drawn
        displaced = boxes[s].log_displaced(problem, zs[s])
        best = max(best, gains[s] - displaced)
        out.append(SharedPlanes(boxes[s].planes(Ts[s]), gains[s], displaced))
    return out


def without_plane(problem: Problem) -> IntArray:
    """Return rows of the readings of a surface of which nothing else is known: no label, no normal, no furniture."""
    points = problem.points
    surface = [f.on_surface and f.codimension == 1 and not f.round_face for f in points.factors]
    known = (problem.groups >= 0) | points.oriented | problem.furniture.on_furniture | problem.distant.rows
    return np.flatnonzero(np.array(surface, dtype=np.bool_) & ~known)


@dataclass(frozen=True, slots=True, eq=False)
class _Box:
    """Readings on an object with planes and a bounding box, in the frame of a part at its pose.

    Attributes:
        rows: rows of the readings ``(n,)``.
        numbers: plane of each reading; -1 elsewhere on the object, -2 off it ``(n,)``.
        points: places relative to their mean ``(n, 3)`` [m].
        distances: signed distances from the planes of the part ``(n,)`` [m].
        per_sd: one over the standard deviation along the normal ``(n,)`` [1/m].
        normals: outward normals of the planes ``(K, 3)``.
        frames: axes in each plane and its normal, as columns ``(K, 3, 3)``.
        aligned: whether each plane is along one of the axes of the box ``(K,)``.
        axes: three axes of the box, as columns ``(3, 3)``.
        ends: end of the box that each plane is: 1 to 3 the upper end of an axis, -1 to -3 the lower one; 0 for a plane
            inside ``(K,)``.
        cosines: cosines of incidence ``(n,)``.
        shared: derivatives of the distances by the shared errors ``(n, E)`` [m].
    """

    rows: IntArray
    numbers: IntArray
    points: Vectors
    distances: FloatArray
    per_sd: FloatArray
    normals: Vectors
    frames: Rotations
    aligned: BoolArray
    axes: Rotations
    ends: IntArray
    cosines: FloatArray
    shared: FloatArray

    @classmethod
    def of(
        cls, at: Details, s: int, problem: Problem, rows: IntArray, flat: BoolArray, same: float, T: Transforms
    ) -> _Box | None:
        """Return the readings at pose ``s``; None if no two of them share a plane.

        Args:
            at: readings at the poses.
            s: number of the pose.
            problem: measurements and priors.
            rows: rows of the readings ``(n,)``.
            flat: whether each face of the part is a plane.
            same: largest distance of two faces in one plane [m].
            T: the pose.
        """
        n, points, d = at.normals[s, rows], at.in_part[s, rows], at.distances[s, rows]
        on, face = at.inlier_probability[s, rows] > 0.5, at.faces[s, rows]
        plane = on & (face >= 0) & flat[np.maximum(face, 0)]
        heights = np.sum(points * n, axis=1) - d
        together = (
            (n @ n.T > 1 - _ALIGNED**2 / 2) & (np.abs(heights[:, None] - heights) < same) & plane & plane[:, None]
        )
        counts = together.sum(axis=1)
        if counts.max() < 2:
            return None
        first, each = together.argmax(axis=1), np.arange(len(rows))
        firsts = np.flatnonzero(plane & (first == each))
        axes = _axes(n[firsts], counts[firsts])
        points, per_sd = points - points.mean(axis=0), at.per_sd[s, rows]
        along, slack = points @ axes, 4 / per_sd
        axis = np.argmax(np.abs(n @ axes), axis=1)
        upward = np.where((n @ axes)[each, axis] > 0, 1, -1)
        beyond = upward * (along[:, axis] - along[each, axis])  # of each place from the plane of each other
        slack_of_two = slack[:, None] + slack
        upper = np.all((beyond < slack_of_two)[on], axis=0)
        lower = np.all((-beyond < slack_of_two)[on], axis=0) & ~problem.points.directed[rows]
        straight = plane & (np.abs(n @ axes).max(axis=1) > 1 - _ALIGNED**2 / 2)
        ends = np.where(straight & (upper | lower), np.where(upper, 1, -1) * upward * (axis + 1), 0)
        kept = plane & ((counts > 1) | (ends != 0))
        numbers = np.full(len(rows), -1)
        order, numbers[kept] = np.unique(first[kept], return_inverse=True)
        numbers[~on & ~_inside(along, ends, slack)] = -2
        world = n @ T[:3, :3].T
        cosines = np.maximum(np.abs(np.sum(world * problem.points.directions[rows], axis=1)), _GRAZING)
        shared = np.einsum("ni,nik->nk", world, problem.points.shared_jacobian[rows])
        frames, aligned = SO3.frame_from_axis(n[order], 2), np.abs(n[order] @ axes).max(axis=1) > 1 - _ALIGNED**2 / 2
        return cls(rows, numbers, points, d, per_sd, n[order], frames, aligned, axes, ends[order], cosines, shared)

    def planes(self, T: Transforms) -> frozenset[tuple[frozenset[int], bool]]:
        """Return the rows of the readings of each plane, and the side on which the object is.

        Args:
            T: pose of the part.
        """
        rows = (frozenset(self.rows[self.numbers == k].tolist()) for k in range(len(self.normals)))
        outward = [self.axes[:, abs(end) - 1] * np.sign(end) if end else np.zeros(3) for end in self.ends]
        sides = (np.array(outward) @ T[:3, :3].T) @ _GENERIC > 0
        return frozenset(zip(rows, sides.tolist(), strict=True))

    def log_places(self, problem: Problem, anywhere: float, part: Part, scale: float) -> float:
        """Return the log density of the places along the planes, and of the planes, over that of readings anywhere.

        Places on the bounding box are even over it. The first reading of a plane inside is even over the box. Each
        further one has the density of a place on the surface, if the face reaches there.

        Args:
            problem: measurements and priors.
            anywhere: log density of the readings anywhere on an unknown object.
            part: the part, whose area over that of its bounding box is that of the object.
            scale: noise scale at the pose of the part.
        """
        share, directed = problem.priors.right_angled, problem.points.directed[self.rows]
        outer, of_planes = np.append(self.ends, 0)[np.maximum(self.numbers, -1)] != 0, 0.0
        later = np.zeros(len(self.rows), dtype=np.bool_)  # readings of a plane inside, beyond the first one
        for k, aligned in enumerate(self.aligned):
            own = self.numbers == k
            if self.ends[k] != 0:
                of_planes += log_covered(int(own.sum()))
            else:
                of_planes += np.log(share / 3) if aligned else np.log((1 - share) / (2 * np.pi))
                of_planes += log_reach(self.points[own] @ self.frames[k, :, :2], 2 * problem.priors.radius)
                later[np.flatnonzero(own)[1:]] = True
        single, off = ~outer & ~later & (self.numbers > -2), self.numbers == -2
        log_sides, sides = self._sides(2 * problem.priors.radius, scale)
        a, b, c = sides[0][:, None, None], sides[1][:, None], sides[2]
        log_area, log_volume = np.log(a * b + b * c + c * a) + _log_filled(part), np.log(a * b * c)
        even = log_sides[0][:, None, None] + log_sides[1][:, None] + log_sides[2]
        even = even - log_area * np.sum((outer | later) & ~directed) - log_volume * np.sum(single & ~directed)
        even -= (np.log(4) + log_volume - log_area) * np.sum(single & directed)  # mean chord (Cauchy)
        region, firsts = problem.region, int(np.sum(~directed & ~off))
        chosen = even + max(firsts - 1, 0) * np.maximum(log_area - np.log(region.area), 0.0) if firsts else even
        log = np.logaddexp(log_sum(even), log_sum(chosen)) - np.log(2) + of_planes
        log += np.log(1 - np.exp(log_covered(1))) * single.sum()
        log += np.log(self.cosines[(outer | later) & directed]).sum()
        log += np.sum(np.log(problem.priors.outlier_rate) + problem.log_outlier[self.rows[off]])
        return float(log - anywhere - problem.log_outlier[self.rows].sum())

    def _sides(self, longest: float, scale: float) -> tuple[list[FloatArray], list[FloatArray]]:
        """Return log weights and lengths of the sides of the box along each axis, which are even up to the longest one.

        A plane at an end fixes this end. If there is none, the box may be anywhere about the readings. Between two
        fixed ends, places of other readings are even over the side, with their noise.

        Args:
            longest: longest side [m].
            scale: noise scale of the readings.
        """
        logs, sides = [], []
        ends = np.append(self.ends, 0)[np.maximum(self.numbers, -1)]  # of each reading
        on, places = self.numbers > -2, self.points @ self.axes
        for axis, along in enumerate(places.T):
            upper, lower = ends == axis + 1, ends == -axis - 1
            low, high = along[on].min(), along[on].max()
            if upper.any() and lower.any():
                side = max(along[upper].mean() - along[lower].mean(), SMALLEST * longest)
                others = on & ~upper & ~lower
                beyond = np.abs(along[others] - (along[upper].mean() + along[lower].mean()) / 2) - side / 2
                sds = np.sqrt(2) / self.per_sd[others] / max(scale, 1.0)  # no more than the stated noise
                within = _erfc(beyond / sds) - _erfc((beyond + side) / sds)
                logs.append(np.array([np.log(np.maximum(within / 2, LEAST_RATE)).sum() - np.log(longest)]))
                sides.append(np.array([side]))
                continue
            shortest = max(high - low, SMALLEST * longest)
            most = max(longest, LARGER * shortest)
            side = shortest + (np.arange(SIZES) + 0.5) / SIZES * (most - shortest)
            slide = np.zeros(SIZES) if upper.any() or lower.any() else np.log(side - (high - low))
            logs.append(slide + np.log((most - shortest) / (SIZES * most)))
            sides.append(side)
        return logs, sides

    def log_gain(self, problem: Problem, anywhere: float, part: Part, z: FloatArray) -> float:
        """Return the log density of the readings on an object with these planes, over that of readings anywhere.

        It is the integral over axes, distances of the planes, shared errors and noise scale.

        Args:
            problem: measurements and priors.
            anywhere: log density of the readings anywhere on an unknown object.
            part: the part, whose area over that of its bounding box is that of the object.
            z: states at the pose of the part ``(D,)``.
        """
        turns, planes, shared = self._levers()
        K, E, off = planes.shape[1], shared.shape[1], np.flatnonzero(~self.aligned)
        tilts = [planes[:, k, None] * (turns @ self.frames[k, :, :2]) for k in off]
        with_axes = turns * (planes @ self.aligned)[:, None]
        J = np.concatenate([planes, with_axes, *tilts, shared], axis=1)
        attitudes = np.full(3, 2 * np.pi / _ATTITUDES ** (2 / 3))
        prior = np.concatenate([np.full(K, self._even()), attitudes, np.ones(2 * len(off) + E)])
        scale = float(np.exp(problem.scale_sd * z[-1])) if problem.scale_sd else 1.0
        log = self._log_exact_and_displaced(J, prior, problem, z)[1] - float(np.log(_ATTITUDES))
        return log + self.log_places(problem, anywhere, part, scale)

    def log_displaced(self, problem: Problem, z: FloatArray) -> float:
        """Return the log density of the readings on the part, of which half have displaced faces, over that as drawn.

        Args:
            problem: measurements and priors.
            z: states at the pose of the part ``(D,)``.
        """
        turns, planes, shared = self._levers()
        length = max(float(np.abs(self.points[self.numbers >= 0]).max()), SMALLEST * problem.priors.radius)
        pose = np.concatenate([-planes @ self.normals, -turns / length, shared], axis=1)
        prior = np.concatenate([np.full(6, self._even()), np.ones(shared.shape[1])])
        as_drawn, half = self._log_exact_and_displaced(pose, prior, problem, z)
        return half - as_drawn

    def _levers(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return derivatives of the distances of readings on planes by turns, planes ``(n, K)`` and shared errors."""
        rows = np.flatnonzero(self.numbers >= 0)
        numbers = self.numbers[rows]
        planes = np.eye(len(self.normals))[numbers]
        return SO3.cross(self.points[rows], self.normals[numbers]), planes, -self.shared[rows]

    def _even(self) -> float:
        """Return the information on a distance of which the density is even [1/m^2]."""
        return _WEAK * float((self.per_sd**2).mean())

    def _log_exact_and_displaced(
        self, J: FloatArray, prior: FloatArray, problem: Problem, z: FloatArray
    ) -> tuple[float, float]:
        """Return log densities of the readings on planes: on faces as made exactly, and if half are displaced.

        Distances are linear in the states. The noise of a reading contains the deviation of the surface from its CAD.
        It may be common to all readings of a face, which is displaced and tilted. If it is not stated, half of the
        variance of the readings is.

        Args:
            J: derivatives of the distances by the states, of which the last are the shared errors ``(n, D)``.
            prior: prior information on the states ``(D,)``.
            problem: measurements and priors.
            z: states at the pose of the part ``(D,)``.
        """
        rows, points = np.flatnonzero(self.numbers >= 0), problem.points
        numbers, per_sd, r = self.numbers[rows], self.per_sd[rows], self.distances[rows]
        errors = z[: self.shared.shape[1]]
        fixed, tolerance = points.tolerance**2 + points.rounding**2, points.tolerance
        noise = np.exp(problem.scale_sd * np.append(_SCALES, z[-1:])) if problem.scale_sd else np.ones(2)
        variances = np.maximum(1 / per_sd**2 - fixed, 0.0) * (noise[:-1, None] / noise[-1]) ** 2 + fixed
        exact = _log_linear(J, r, variances, np.tile(prior, (len(variances), 1)), errors)
        common = tolerance if tolerance else np.sqrt(0.5) / per_sd / noise[-1]
        left = np.maximum(variances - tolerance**2 if tolerance else variances / 2, _LEAST_LEFT * variances)
        own = np.eye(len(self.normals))[numbers]
        across = np.einsum("ni,nij->nj", self.points[rows], self.frames[numbers, :, :2])
        across = across - (own.T @ across / own.sum(axis=0)[:, None])[numbers]
        extent = np.maximum.reduceat(np.abs(across)[np.argsort(numbers, kind="stable")], _starts(numbers))
        across = across / np.maximum(extent, SMALLEST * problem.priors.radius)[numbers]
        moved = np.concatenate([np.ones((len(rows), 1)), across], axis=1) * np.sqrt(1 / _OF_CORNERS)
        displaced = (np.broadcast_to(common, len(rows))[:, None] * own)[:, :, None] * moved[:, None, :]
        D = 3 * len(self.normals)
        of_faces = np.ones(len(left)) if tolerance else noise[:-1] ** -2.0
        priors = np.concatenate([np.repeat(of_faces[:, None], D, axis=1), np.tile(prior, (len(left), 1))], axis=1)
        log = _log_linear(np.concatenate([displaced.reshape(-1, D), J], axis=1), r, left, priors, errors, D)
        return exact, float(log_even(log - exact)) + exact


def _log_linear(
    J: FloatArray,
    r: FloatArray,
    variances: FloatArray,
    prior: FloatArray,
    errors: FloatArray,
    displaced: int = 0,
) -> float:
    """Return the log density of distances that are linear in states, integrated over the states and the noise scale.

    The density of the first and the last states is normal. That of all others is 1 at zero.

    Args:
        J: derivatives of the distances by the states, of which the last are the shared errors ``(n, D)``.
        r: distances ``(n,)`` [m].
        variances: variances of the distances at each noise scale ``(M, n)`` [m^2].
        prior: prior information on the states at each noise scale ``(M, D)``.
        errors: shared errors at the pose of the part ``(E,)``.
        displaced: number of the first states, which displace and tilt faces.
    """
    E, nodes = len(errors), _SCALES if len(variances) == len(_SCALES) else np.zeros(1)
    errors = np.concatenate([np.zeros(J.shape[1] - E), errors])
    weights, own = 1 / variances, np.arange(len(errors))
    H = np.empty((len(weights), len(errors) + 1, len(errors) + 1))  # the last row is the gradient and chi2 at zero
    extended = np.concatenate([J, r[:, None]], axis=1)
    np.matmul(extended.T * weights[:, None, :], extended, out=H)
    H[:, own, own] += prior
    H[:, -1, :-1] -= errors
    H[:, -1, -1] += errors @ errors
    unit = np.sqrt(np.diagonal(H, axis1=1, axis2=2))
    unit[:, -1] = np.maximum(unit[:, -1], 1.0)
    H = H / (unit[:, :, None] * unit[:, None]) + _ROUNDING * np.eye(len(errors) + 1)
    root = np.diagonal(np.linalg.cholesky(H), axis1=1, axis2=2)  # reads the lower triangle
    log = -0.5 * (np.log(variances).sum(axis=1) + (root[:, -1] * unit[:, -1]) ** 2) - nodes**4 / 16
    log += 0.5 * np.log(prior[:, :displaced]).sum(axis=1) - np.log(root[:, :-1] * unit[:, :-1]).sum(axis=1)
    constant = 0.5 * (len(errors) - displaced - E - len(r)) * np.log(2 * np.pi)
    return _log_mean(log) + constant - (_LOG_SCALES if len(nodes) > 1 else 0.0)


def _log_mean(log: FloatArray) -> float:
    """Return the log of the mean of a density from its logs at even nodes, by a parabola about each node.

    Args:
        log: log density at the nodes ``(M,)``; its maximum may be narrower than the distance of two nodes.
    """
    if len(log) < 3:
        return float(log_sum(log)) - float(np.log(len(log)))
    steps = np.diff(log)
    bend = np.diff(steps)[np.clip(np.arange(len(log)) - 1, 0, len(log) - 3)]
    slope = np.concatenate([steps[:1], (steps[1:] + steps[:-1]) / 2, steps[-1:]])
    x = (np.arange(_WITHIN) + 0.5) / _WITHIN - 0.5
    within = log[:, None] + slope[:, None] * x + 0.5 * bend[:, None] * x**2
    return float(log_sum(within)) - float(np.log(within.size))


_LOG_SCALES = _log_mean(-(_SCALES**4) / 16)
"""Numerical: log of the mean of the unnormalized prior density of the state of the noise scale at the nodes."""


def _starts(numbers: IntArray) -> IntArray:
    """Return where each number begins in their sorted order."""
    return np.flatnonzero(np.diff(np.sort(numbers), prepend=-1))


def _log_filled(part: Part) -> float:
    """Return the log of the area of a part over the sum of the areas of three sides of its bounding box."""
    a, b, c = np.maximum(np.ptp(part.box, axis=0), SMALLEST * part.diagonal)
    return float(np.log(part.area / (a * b + b * c + c * a)))


def _inside(along: Vectors, ends: IntArray, slack: FloatArray) -> BoolArray:
    """Return which places are not beyond an end of the box that a reading is on ``(n,)``.

    Args:
        along: places along the axes ``(n, 3)`` [m].
        ends: end of the box that each reading is on, as in :class:`_Box`; 0 for others ``(n,)``.
        slack: largest deviation of each reading ``(n,)`` [m].
    """
    inside = np.ones(len(along), dtype=np.bool_)
    for k in np.flatnonzero(ends):
        axis, sign = abs(int(ends[k])) - 1, np.sign(ends[k])
        inside &= sign * (along[:, axis] - along[k, axis]) < slack + slack[k]
    return inside


def _axes(normals: Vectors, counts: IntArray) -> Rotations:
    """Return three perpendicular axes, as columns, that most readings on planes agree with ``(3, 3)``.

    Args:
        normals: normals of the planes ``(K, 3)``.
        counts: number of readings in each ``(K,)``.
    """
    cosines = np.abs(normals @ normals.T)
    rows, direction = np.unique((cosines > 1 - _ALIGNED**2 / 2).argmax(axis=1), return_inverse=True)
    normals, counts, cosines = normals[rows], np.bincount(direction, counts), cosines[np.ix_(rows, rows)]
    best, most = SO3.frame_from_axis(normals[np.argmax(counts)], 2), -1.0
    for a, b in np.argwhere(np.triu(cosines < _ALIGNED)):
        frame = np.stack([normals[a], normals[b], np.cross(normals[a], normals[b])], axis=1)
        agree = float(counts @ (np.abs(normals @ frame).max(axis=1) > 1 - _ALIGNED**2 / 2))
        if agree > most:
            best, most = frame, agree
    return np.asarray(best)


def _erfc(x: FloatArray) -> FloatArray:
    """Return the complementary error function of each value ``(n,)``."""
    return np.array([erfc(value) for value in x.tolist()])


def log_covered(count: int) -> float:
    """Return the log probability that a side of the bounding box has a face at some places.

    Args:
        count: number of the places.
    """
    a, b = _COVERED
    k = np.arange(count)
    return float(np.log((a + k) / (a + b + k)).sum())


def log_reach(places: FloatArray, longest: float) -> float:
    """Return the log probability that a face with one of some readings on it reaches to all others.

    The face is a rectangle at any angle and place. Its sides are log-uniform up to the longest one.

    Args:
        places: places of the readings in the plane ``(n, 2)`` [m].
        longest: longest side of a face [m].
    """
    angles = np.arange(ANGLES) * np.pi / (2 * ANGLES)
    turns = np.stack([np.cos(angles), np.sin(angles), -np.sin(angles), np.cos(angles)], axis=1).reshape(-1, 2, 2)
    extents = np.ptp(places @ np.swapaxes(turns, 1, 2), axis=1)
    shortest = SMALLEST * longest
    low = np.clip(extents, shortest, longest)
    covered = np.maximum(longest - low - extents * np.log(longest / low), np.finfo(float).tiny)
    log = np.log(covered / (longest - shortest)).sum(axis=1)
    return float(log_sum(log) - np.log(len(log)))
