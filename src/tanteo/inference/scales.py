"""Length scales of a search, and the points that represent all of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo import _core
from tanteo.inference.prepared import PreparedPart
from tanteo.inference.problem import Problem
from tanteo.measurements import ContactPoints
from tanteo.typing import FloatArray, Indices, Transforms


def pair_tilt(problem: Problem) -> float:
    """Return the tolerance of a sensed normal against that of a surface place: one step of the spins [rad]."""
    return float(2 * np.pi / problem.settings.search.spins)


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
    """Return the length scales of the search for one part."""
    points, own = problem.points, problem.settings.search
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
    end = max(2 * sd, shared, own.coarse_to_fine * blur)
    count = max(6, int(np.ceil(np.log(1.5 * blur / end) / own.scale_step)) + 1)
    blurs = own.coarse_to_fine * blur * 0.3 ** np.arange(8)
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


def scores_of(
    problem: Problem, core: _core.Problem, prepared: PreparedPart, rows: Indices, Ts: Transforms, scales: Scales
) -> FloatArray:
    """Return a rough robust cost of the distances of some points from the surface at poses ``(S,)``."""
    return np.asarray(
        _core.scores(prepared.shape, core, rows, np.ascontiguousarray(Ts), scales.blur, pair_tilt(problem))
    )
