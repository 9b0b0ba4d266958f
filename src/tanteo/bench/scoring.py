"""Score methods: correctness, calibration of covariances and probabilities, declared ambiguity, time."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tanteo.bench.running import Outcome
from tanteo.bench.sets import BenchScene, BenchSet, Placement
from tanteo.geometry import SE3
from tanteo.geometry.typing import Covariances, FloatArray, Transforms
from tanteo.parts import Part
from tanteo.posterior.answers import without_symmetric_rotation

SURE = 0.9
"""Probability from which an answer counts as claimed."""

LIKELY = 0.05
"""Probability from which another answer counts as declared."""

_LEVEL = 0.95


@dataclass(frozen=True, slots=True)
class Score:
    """Score of one method on one set.

    Attributes:
        bench_set: name of the set.
        method: name of the method.
        scenes: number of scenes, failures included.
        right: fraction of scenes whose first answer is the true part within the tolerance, or correctly unknown.
        among: fraction of scenes with a right answer among all answers.
        sure_and_wrong: fraction of scenes whose first answer is claimed with 0.9 or more, and wrong by tolerance
            and by its own 95 % region; None without probabilities.
        declared: fraction of the scenes with several likely answers in which one is true; None without such scenes.
        several: fraction of scenes with several likely answers; None without probabilities.
        claimed: mean probability of the first answers; None without probabilities.
        in_region: fraction of first answers whose 95 % region contains the true pose (never for a wrong part); None
            without covariances.
        nees: mean NEES of right answers over its degrees of freedom; None without covariances.
        median_nees: median NEES over the median of chi-square; None without covariances.
        nees_count: number of right answers with a covariance.
        median_ms: median time of a scene [ms].
        slow_ms: 95th percentile of the time of a scene [ms].
        readings: median number of readings after which the answer is the only likely one, claimed with 0.9 or more;
            None if not measured, or reached in fewer than half of the scenes.
        decided: fraction of scenes with such a decision; None if not measured.
        decided_right: fraction of these decisions that are right; None without decisions.
        failures: number of scenes without an answer (exception, crash, time limit).
        why: reason of the first failure.
    """

    bench_set: str
    method: str
    scenes: int
    right: float
    among: float
    sure_and_wrong: float | None
    declared: float | None
    several: float | None
    claimed: float | None
    in_region: float | None
    nees: float | None
    median_nees: float | None
    nees_count: int
    median_ms: float
    slow_ms: float
    failures: int
    why: str = ""
    readings: float | None = None
    decided: float | None = None
    decided_right: float | None = None


def largest_corner_error(part: Part, T: Transforms, truth: Transforms) -> float:
    """Return the largest distance of a vertex from its true position, up to the part's symmetry [m].

    This is the maximum symmetry-aware surface distance of the BOP benchmark (Hodan et al. 2020).

    Args:
        part: part at both poses.
        T: estimated pose ``(4, 4)``.
        truth: true pose ``(4, 4)``.

    Example:
        >>> part = tanteo.bench.generate("points", 1).parts[0]
        >>> T = np.eye(4)
        >>> T[0, 3] = 0.002
        >>> round(tanteo.bench.scoring.largest_corner_error(part, T, np.eye(4)), 6)
        0.002
    """
    images = _images(part, T, truth)
    there = SE3.apply(truth, part.vertices)
    return min(float(np.linalg.norm(SE3.apply(image, part.vertices) - there, axis=1).max()) for image in images)


def squared_error(part: Part, one: Placement, truth: Transforms) -> tuple[float, int]:
    """Return the squared Mahalanobis distance of the true pose up to symmetry, and its degrees of freedom."""
    gaps = SE3.inverse(np.asarray(one.T_world_part)) @ (truth @ part.symmetry.Ts)
    dof = 6
    if part.symmetry.continuous:
        gaps, dof = without_symmetric_rotation(part, gaps), 3 if part.symmetry.spherical else 5
    xi = SE3.log(gaps)
    return float(np.einsum("si,ij,sj->s", xi, _information(one.covariance), xi).min()), dof


def score(bench_set: BenchSet, method: str, outcomes: Sequence[Outcome]) -> Score:
    """Return the score of a method on a set.

    Args:
        bench_set: set of scenes.
        method: name of the method.
        outcomes: result of each scene.
    """
    rows = [_row(bench_set, scene, one) for scene, one in zip(bench_set.scenes, outcomes, strict=True)]
    failures = [one.failure for one in outcomes if one.failure]
    with_claims = [row for row in rows if row.several is not None]
    several = [row for row in with_claims if row.several]
    claims = [row.claimed for row in rows if row.claimed is not None]
    values = [row.nees for row in rows if row.nees is not None]
    regions = [row.inside for row in rows if row.inside is not None]
    times = 1e3 * np.array([one.seconds for one in outcomes if not one.failure] or [np.nan])
    return Score(
        bench_set.name, method, len(rows), _share([row.right for row in rows]), _share([row.among for row in rows]),
        _share([row.sure and not row.right and not row.inside for row in rows]) if claims else None,
        _share([row.among for row in several]) if several else None,
        _share([bool(row.several) for row in with_claims]) if with_claims else None,
        float(np.mean(claims)) if claims else None,
        _share(regions) if regions else None,
        float(np.mean([value / dof for value, dof in values])) if values else None,
        float(np.median([value / _quantile(0.5, dof) for value, dof in values])) if values else None,
        len(values), float(np.median(times)), float(np.quantile(times, 0.95)), len(failures),
        failures[0] if failures else "",
    )  # fmt: skip


COUNTS = (6, 8, 10, 13, 16, 20, 25, 32, 40, 50)
"""Numbers of readings after which a decision is tested; a pose has six degrees of freedom."""


def with_decisions(
    one: Score, bench_set: BenchSet, solve_scene: Callable[[BenchScene], Outcome], progress: Callable[[int, int], None]
) -> Score:
    """Return the score with the number of readings for a decision, from growing numbers of readings of each scene.

    Args:
        one: score on the complete scenes.
        bench_set: set of scenes.
        solve_scene: function that runs the method on a scene.
        progress: function called with the numbers of finished and of all scenes.
    """
    counts, right = [], []
    for k, scene in enumerate(bench_set.scenes):
        for count in (c for c in COUNTS if c <= len(scene.points)):
            row = _row(bench_set, scene, solve_scene(scene.first(count)))
            if row.sure and not row.several:
                counts.append(count)
                right.append(row.right or bool(row.inside))
                break
        progress(k + 1, len(bench_set.scenes))
    n = len(bench_set.scenes)
    every = sorted(counts) + [math.inf] * (n - len(counts))
    middle = every[n // 2]
    return replace(
        one,
        readings=middle if math.isfinite(middle) else None,
        decided=len(counts) / n,
        decided_right=_share(right) if right else None,
    )


@dataclass(frozen=True, slots=True)
class _Row:
    right: bool
    among: bool
    sure: bool
    several: bool | None
    claimed: float | None
    inside: bool | None
    nees: tuple[float, int] | None


def _row(bench_set: BenchSet, scene: BenchScene, one: Outcome) -> _Row:
    best = one.placements[0] if one.placements else None
    right = [_is_right(bench_set, scene, placement) for placement in one.placements]
    if best is None:
        unknown = scene.truth is None and not one.failure
        return _Row(unknown, unknown, False, None, None, None, None)
    claimed = best.probability
    likely = [p.probability >= LIKELY for p in one.placements if p.probability is not None]
    declared = [p.probability is None or p.probability >= LIKELY for p in one.placements]
    among = any(r and s for r, s in zip(right, declared, strict=True))
    inside = nees = None
    if best.covariance is not None:
        inside = False
        if scene.T_world_part is not None and best.part == scene.truth:
            value, dof = squared_error(bench_set.part(best.part), best, scene.T_world_part)
            inside = value < _quantile(_LEVEL, dof)
            nees = (value, dof) if right[0] else None
    sure = claimed is not None and claimed >= SURE
    # the answer is an unknown object if no part is likely
    is_right = right[0] if scene.truth is not None else claimed is not None and sum(likely) == 0
    several = sum(likely) > 1 if claimed is not None else None
    return _Row(is_right, among or is_right, sure, several, claimed, inside, nees)


def _is_right(bench_set: BenchSet, scene: BenchScene, one: Placement) -> bool:
    if one.part != scene.truth:
        return False
    if scene.T_world_part is None:
        return True
    return largest_corner_error(bench_set.part(one.part), one.T_world_part, scene.T_world_part) < bench_set.tolerance


def _images(part: Part, T: Transforms, truth: Transforms) -> Transforms:
    """Return the equivalent poses by symmetry; a continuous rotation is set to the nearest value."""
    images = np.asarray(T) @ part.symmetry.Ts
    if part.symmetry.continuous:
        images = truth @ without_symmetric_rotation(part, SE3.inverse(truth) @ images)
    return images


def _information(covariance: Covariances | None) -> FloatArray:
    return np.asarray(np.linalg.pinv(np.asarray(covariance), rcond=1e-12, hermitian=True))


def _quantile(level: float, dof: int) -> float:
    from scipy.stats import chi2  # slow to import

    return float(chi2.ppf(level, dof))


def _share(values: Sequence[bool]) -> float:
    return float(np.mean(values)) if len(values) else 0.0
