"""Where a maximization starts: pairs of surface places as far apart as two points, samples of the prior, half turns."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tanteo import _core
from tanteo.inference.prepared import PreparedPart
from tanteo.inference.problem import Problem
from tanteo.lie import SE3
from tanteo.measurements import ContactPoints
from tanteo.typing import FloatArray, Indices, Transforms, Vectors

FEW = 12
"""Points on which proposals are scored: more tell no more at this precision."""

_TILT = 0.25
"""Of a sensed normal against that of a place of the surface [rad]."""

_EACH, _BEYOND = 30, 1.2
"""Samples of the prior that are scored for each that is settled, and their spread in that of the prior."""

_SPINS = 24
"""Turns about the line of two points, where no normal says which: one in a quarter of a radian."""


_CLIMBED = 0.25
"""Share of the blur of proposals with which maximizations begin, where steps to the nearest surface have led."""

_SLIDES = 12
"""Slides of a pose: as many as it has half turns."""


@dataclass(frozen=True, slots=True)
class Effort:
    """How much is proposed in one round.

    Attributes:
        pairs: of points.
        per_pair: pairs of surface places for each.
        keep: proposals of each pair that are settled.
        maximize: of all of them that are maximized.
        move: of the best maxima afterwards that are turned in their place, and slid.
        hard: the same where maxima are narrow beside what is proposed, or the best one leaves points out that it should
            not.
    """

    pairs: int = 12
    per_pair: int = 40
    keep: int = 7
    maximize: int = 40
    move: int = 0
    hard: int = 10


@dataclass(frozen=True, slots=True, eq=False)
class Scales:
    """Lengths of the search, from the part and the noise.

    Attributes:
        blur: error of a proposal: the spacing of surface places, or the noise [m].
        settle: scales of the steps to the nearest surface, from coarse to that of the first maximization [m].
        blurs: noise added in maximizations before the last [m].
    """

    blur: float
    settle: FloatArray
    blurs: FloatArray


def scales_for(problem: Problem, prepared: PreparedPart) -> Scales:
    """The lengths of a search."""
    points = problem.points
    if not len(points):  # free-space rays alone: nothing settles
        return Scales(prepared.spacing, np.array([prepared.spacing]), np.zeros(0))
    sd = float(np.median(points.sd))
    shared = (
        float(np.sqrt(np.mean(np.sum(points.shared_jacobian**2, axis=(1, 2))))) if points.shared_jacobian.size else 0.0
    )
    off = np.linalg.norm(points.points - np.median(points.points, axis=0), axis=1)
    spread = 2 * float(np.quantile(off, 0.75))
    wide = float(np.hypot(sd, shared))
    blur = max(min(prepared.spacing, spread / 8), 1.5 * wide)
    end = max(2 * sd, shared, _CLIMBED * blur)
    count = max(6, int(np.ceil(np.log(1.5 * blur / end) / 0.25)) + 1)
    blurs = _CLIMBED * blur * 0.3 ** np.arange(8)
    settle = np.asarray(np.geomspace(1.5 * blur, min(end, blur), count), dtype=np.float64)
    return Scales(blur, settle, np.asarray(blurs[blurs > 2 * sd], dtype=np.float64))


def spread_rows(points: ContactPoints, count: int) -> Indices:
    """Rows of points that are far from each other, the farthest from the middle first.

    Of many points they are of twice as many that come at even steps: of all points, outliers would be the farthest.
    """
    some = np.arange(min(2 * count, len(points)))
    some = some * len(points) // max(len(some), 1)
    p = points.points[some]
    if len(p) <= count:
        return some.astype(np.int32)
    chosen = [int(np.argmax(np.linalg.norm(p - p.mean(axis=0), axis=1)))]
    nearest = np.linalg.norm(p - p[chosen[0]], axis=1)
    while len(chosen) < count:
        chosen.append(int(np.argmax(nearest)))
        nearest = np.minimum(nearest, np.linalg.norm(p - p[chosen[-1]], axis=1))
    return some[chosen].astype(np.int32)


def far_pairs(points: ContactPoints, rows: Indices, count: int) -> Indices:
    """Pairs of those points that are far apart ``(count, 2)``, no point in many of them: one outlier spoils few."""
    p = points.points[rows]
    gaps = np.linalg.norm(p[:, None] - p, axis=-1)
    first, second = np.triu_indices(len(p), 1)
    order = np.argsort(-gaps[first, second], kind="stable")
    used, most, out = np.zeros(len(p), dtype=int), 1 + 2 * count // max(len(p), 1), []
    for k in order:
        i, j = first[k], second[k]
        if used[i] < most and used[j] < most and gaps[i, j] > 0:
            out.append((rows[i], rows[j]))
            used[[i, j]] += 1
        if len(out) == count:
            break
    return np.array(out, dtype=np.int32).reshape(-1, 2)


def from_pairs(
    core: _core.Problem,
    prepared: PreparedPart,
    rows: Indices,
    pairs: Indices,
    scales: Scales,
    effort: Effort,
    seed: int,
) -> Transforms:
    """Poses that put two points on the surface, the others near it, best first."""
    Ts, _ = _core.propose(
        prepared.shape,
        core,
        rows,
        pairs,
        effort.per_pair,
        _SPINS,
        scales.blur,
        scales.blur,
        _TILT,
        effort.keep,
        seed,
    )
    return Ts


def from_prior(problem: Problem, prepared: PreparedPart, count: int, rng: np.random.Generator) -> Transforms:
    """Samples of what is known of the pose, the means first; none where nothing is known."""
    known = problem.mixture(prepared)
    if known is None:
        return np.zeros((0, 4, 4))
    weights = np.exp(known.log_weights - known.log_weights.max())
    rows = rng.choice(len(weights), size=count, p=weights / weights.sum())
    xi = np.linalg.cholesky(known.covariances)[rows] @ rng.normal(size=(count, 6, 1))
    return np.concatenate([known.Ts[:count], known.Ts[rows] @ SE3.exp(xi[..., 0])])


def best_of_prior(
    core: _core.Problem,
    problem: Problem,
    prepared: PreparedPart,
    rows: Indices,
    scales: Scales,
    count: int,
    rng: np.random.Generator,
) -> Transforms:
    """Of many samples of what is known of the pose, and somewhat beyond, those that points are near, best first."""
    known = problem.mixture(prepared)
    if known is None:
        return np.zeros((0, 4, 4))
    wider = replace(known, covariances=_BEYOND**2 * known.covariances)
    Ts = np.ascontiguousarray(
        from_prior(replace(problem, mixtures={id(prepared): wider}), prepared, _EACH * count, rng)
    )
    if len(rows):
        Ts = Ts[np.argsort(scores_of(core, prepared, rows, Ts, scales), kind="stable")]
    return np.ascontiguousarray(Ts[:count])


def scores_of(core: _core.Problem, prepared: PreparedPart, rows: Indices, Ts: Transforms, scales: Scales) -> FloatArray:
    """How far points are from the surface at poses, as a cost each ``(S,)``: robust, and rough."""
    return np.asarray(_core.scores(prepared.shape, core, rows, np.ascontiguousarray(Ts), scales.blur, _TILT))


def moved(prepared: PreparedPart, Ts: Transforms, rng: np.random.Generator) -> Transforms:
    """Poses beside poses, which explain many of the same points: the part turned in its place, or slid along itself."""
    return np.concatenate([rotated(prepared, Ts), translated(prepared, Ts, rng)])


def translated(prepared: PreparedPart, Ts: Transforms, rng: np.random.Generator) -> Transforms:
    """Poses with the part slid along its axes, by up to half its length: from one wall, or step, to the next."""
    axes, size = _axes(prepared), np.ptp(prepared.part.box, axis=0)
    which = rng.integers(len(axes), size=(len(Ts), _SLIDES))
    ways = rng.uniform(-0.5, 0.5, size=which.shape) * (np.abs(axes) @ size)[which]
    slides = np.tile(np.eye(4), (*which.shape, 1, 1))
    slides[..., :3, 3] = ways[..., None] * axes[which]
    return np.ascontiguousarray((Ts[:, None] @ slides).reshape(-1, 4, 4))


def _axes(prepared: PreparedPart) -> Vectors:
    """Of the part's frame and of its surface, which are those of most faces ``(6, 3)``."""
    return np.concatenate([np.eye(3), np.linalg.eigh(np.cov(prepared.samples.T))[1].T])


def rotated(prepared: PreparedPart, Ts: Transforms) -> Transforms:
    """Poses with the part turned in its place by half turns, after which many a part nearly fills its old place."""
    part = prepared.part
    axes = _axes(prepared)
    middles = np.stack([part.box.mean(axis=0), prepared.samples.mean(axis=0)]).repeat(3, axis=0)
    R = 2 * axes[:, :, None] * axes[:, None] - np.eye(3)
    turns = SE3.from_parts(R, middles - SE3.apply(R, middles))
    return np.ascontiguousarray((Ts[:, None] @ turns).reshape(-1, 4, 4))
