"""Trial fits: tests whether a part may explain the readings at all, before a search.

A trial fit moves coarse poses of each part onto the points by robust least squares, with a common offset of the points
as one more state if ``offset_sd`` is positive. It draws no samples and computes no evidence, so it takes milliseconds
where a search takes tenths of a second. A part that passes is not yet an answer; a part that fails needs no search.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo import _core
from tanteo.geometry.typing import FloatArray, Indices, Transforms
from tanteo.posterior.candidate_pruning import screen
from tanteo.posterior.candidates import Candidates
from tanteo.posterior.prepared import PreparedPart
from tanteo.posterior.problem import Problem
from tanteo.posterior.proposals.coarse_field import evaluate_fields
from tanteo.posterior.sampling.peaks import point_scales, spread_rows
from tanteo.posterior.settings import POSE_DOF

_PER_SD = 2
"""Number of coarse fields for each standard deviation of an offset: a step is then below the spacing of most fields."""


@dataclass(frozen=True, slots=True, eq=False)
class TrialFit:
    """Pose of a part that explains most points.

    Attributes:
        part: the part.
        T_world_part: its pose ``(4, 4)``.
        explained: number of points within the gate of its surface.
        count: number of points that were fitted.
        offset: common offset of the points against their approach, or outward where none is known [m].
        offset_sd: lower bound of the standard deviation of this offset [m].
    """

    part: PreparedPart
    T_world_part: Transforms
    explained: int
    count: int
    offset: float
    offset_sd: float

    def rejects(self, fraction: float) -> bool:
        """Return whether the trial shows that the part does not explain this fraction of the points.

        With fewer than twice as many points as a pose has degrees of freedom, coarse poses miss the right one too
        often: of 11 points in 8 of 96 scenes, of 14 in 7, of 20 in one (``python benchmarks/conventions.py``).
        """
        return self.count >= 2 * POSE_DOF and self.explained < fraction * self.count

    def is_without_offset(self, gate: float) -> bool:
        """Return whether the points are enough for a trial, and their common offset is less than ``gate`` sds."""
        return self.count >= 2 * POSE_DOF and abs(self.offset) < gate * self.offset_sd


def trial_fits(problem: Problem, candidates: Candidates, *, offset_sd: float = 0.0) -> list[TrialFit]:
    """Return a trial fit of each part that may be searched, the one that explains most points first.

    The list is empty where there are too few points for a fit.

    Args:
        problem: measurements and priors, of which the points count.
        candidates: the parts.
        offset_sd: standard deviation of a common offset of all points [m]; 0 for none.
    """
    points = problem.points
    others = problem.furniture.others
    usable = others[~points.centres[others]]
    if len(usable) < POSE_DOF - 1:
        return []
    shared = np.sqrt(np.sum(points.shared_jacobian**2, axis=(1, 2))) if points.shared_jacobian.size else 0.0
    factor = float(np.exp(problem.scale_sd)) if problem.scale_sd else 1.0
    limits = problem.settings.search.gate * np.hypot(factor * points.sd, shared)
    few_points = problem.settings.search.few_points
    rows = usable[spread_rows(points.take(usable), few_points)].astype(np.int32)
    few = len(candidates) <= problem.settings.pruning.budget
    active = np.arange(len(candidates)) if few else screen(problem, candidates).rows
    step = offset_sd / _PER_SD
    offsets = step * np.arange(-2 * _PER_SD, 2 * _PER_SD + 1) if offset_sd > 0 else np.zeros(1)
    starts = []
    for o in map(float, offsets):
        _, Ts_of = evaluate_fields(
            problem, points.take(others), candidates, active, thorough=not offset_sd, offset=o, offset_sd=step / 2
        )
        starts.append(Ts_of)
    of_points, found = point_scales(problem), []
    for row in map(int, active):
        own = [poses[row] for poses in starts if row in poses]
        if own:
            Ts = np.ascontiguousarray(np.concatenate(own))
            part = candidates.prepared(row).at(problem.resolution)
            blur = of_points.on(part).blur
            found.append(_of_part(problem, part, Ts, rows, limits[rows], offset_sd, step, blur))
    return sorted(found, key=lambda fit: -fit.explained)


def _of_part(
    problem: Problem,
    part: PreparedPart,
    Ts: Transforms,
    rows: Indices,
    limits: FloatArray,
    offset_sd: float,
    step: float,
    blur: float,
) -> TrialFit:
    """Return the fit of one part that explains most points, from poses ``Ts`` with an error of ``blur`` [m]."""
    sd = float(np.median(problem.points.sd[rows]))
    start, end = 1.5 * max(blur, step), 2 * sd
    steps = max(6, int(np.ceil(np.log(start / end) / problem.settings.search.scale_step)) + 1)
    Ts, _, _, offsets, distances = _core.refine_poses(
        part.shape, problem.compiled(part), rows, np.geomspace(start, min(end, start), steps), np.ascontiguousarray(Ts),
        offset_sd, True,
    )  # fmt: skip
    explained = np.sum(np.abs(distances) <= limits, axis=1)
    best = int(np.argmax(explained))
    return TrialFit(
        part, Ts[best], int(explained[best]), len(rows), float(offsets[best]), sd / float(np.sqrt(len(rows)))
    )
