"""Recognition from readings without correspondences: every part's surface against every reading."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import bdtrc, chdtrc, logsumexp

from tanteo.errors import InputError
from tanteo.features import SharedError
from tanteo.fitting import SUSPECT
from tanteo.lie import SE3
from tanteo.localization import covariance_with_free, describe_motion, pose_information, weak_motions
from tanteo.matching.evidence import Priors, sized
from tanteo.matching.model import PartModel
from tanteo.matching.polish import Polished, polish
from tanteo.matching.recognition import Clock
from tanteo.matching.results import Hypothesis, Recognition
from tanteo.matching.surface import (
    DEEPEST,
    EXHAUSTIVE,
    Effort,
    crowded,
    distinct_maxima,
    efforts_for,
    explained,
    leaves_many,
    search,
)
from tanteo.matching.target import Target, prepare_target
from tanteo.matching.touches import FreePaths, Touches
from tanteo.matching.verdict import (
    CONFIDENCE,
    corner_sd,
    excuse,
    spins,
    verdict,
    where_to_sense,
    without_spins,
    world_axis,
)
from tanteo.parts import Part
from tanteo.typing import Covariances, FloatArray, IntArray, Tangents

LEAST = 3
"""Fewer readings than this fit any surface in any way."""

_DETERMINES = 6
"""Readings without normals that can fix a pose; fewer leave a direction free in any case."""

NEGLIGIBLE = 12.0
"""Log odds below the best mode at which another is not reported."""

_TOO_MANY_STRAYS = 1e-4
"""If so many readings off the part are less likely than this, it is not the part, whatever else fits."""

_NOTABLE = 0.5
"""Share of the worst corner's standard deviation from which an error that all readings share is worth a sentence."""

_ENOUGH, _MOST_SCATTER = 6, 2.0
"""Spare readings from which, and ratio up to which, scatter is put down to the stated standard deviation."""


def identify_touches(
    touches: Touches,
    free: FreePaths,
    parts: Sequence[Part] | Sequence[PartModel] | Sequence[Target],
    *,
    shared: Sequence[SharedError] = (),
    alpha: float = 0.01,
    top: int = 5,
    priors: Priors | None = None,
    seed: int = 0,
) -> Recognition:
    """Which part the readings lie on, and its pose, without knowing which face each one met.

    Args:
        touches: points in the world; with directions, normals and tip radii where known.
        free: paths on which nothing was met.
        parts: candidates, or prepared targets (``prepare_target(part)``; do it once for many calls).
        shared: the errors behind ``touches.gains``, in that order, for the words of the answer.
        alpha: an answer whose joint test has a smaller p-value is not accepted.
        top: number of hypotheses to report.
        priors: what is assumed beforehand.
        seed: recorded in the answer; the search itself draws nothing.

    Raises:
        InputError: without parts, or for an ``alpha`` outside (0, 1).
    """
    if not parts:
        raise InputError("parts: expected at least one part, got none.")
    if not 0 < alpha < 1:
        raise InputError(f"alpha: expected a probability between 0 and 1, got {alpha}.")
    if len(touches) < LEAST:
        message = f"{len(touches)} readings fit any part: sense {LEAST} places or more, better eight, on several sides."
        return Recognition("insufficient", message, (), 1.0, {}, seed)
    clock = Clock()
    priors = sized(priors, max(_part(part).radius for part in parts))
    fitting = [part for part in parts if _large_enough(touches, _part(part))]
    targets = [part if isinstance(part, Target) else prepare_target(part) for part in fitting]
    clock.lap("prepare")
    found = _search_all(touches, free, targets, priors)
    clock.lap("search")
    log_unknown = float(np.log(priors.unknown) + unknown_log_density(touches, priors).sum())
    ranked, unknown = _ranked(found, log_unknown, len(parts), priors)
    ratio = _scatter(ranked)
    if ratio > 1:
        touches = replace(touches, covs=ratio**2 * touches.covs, sd=ratio * touches.sd)
        found = [
            (target, distinct_maxima(polish(touches, free, modes.Ts, target, priors), target))
            for target, modes in found
        ]
        ranked, unknown = _ranked(found, log_unknown, len(parts), priors)
    hypotheses = tuple(
        _hypothesis(touches, target, modes, k, probability) for probability, target, modes, k in ranked[:top]
    )
    clock.lap("locate")
    status, message = verdict(hypotheses, unknown, alpha)
    if status in ("recognized", "ambiguous") and _too_many_strays(hypotheses[0], priors):
        status, message = "unknown", _strays_message(hypotheses[0], len(touches))
    if hypotheses and status == "recognized":
        message += _what_limits(touches, ranked[0], shared)
    if ratio > 1:
        message += f" The readings scatter {ratio:.1f} times as much as stated: covariances were widened by that."
    return Recognition(status, message, hypotheses, unknown, clock.laps(), seed)


def _too_many_strays(best: Hypothesis, priors: Priors) -> bool:
    """Whether more readings are off the part than clutter at the assumed rate ever leaves."""
    strays, n = len(best.outliers), len(best.outliers) + len(best.pairings)
    return strays > 0 and bool(bdtrc(strays - 1, n, priors.clutter) < _TOO_MANY_STRAYS)


def _strays_message(best: Hypothesis, n: int) -> str:
    return (
        f"The closest part is {best.part}, but {len(best.outliers)} of {n} readings are not on it: "
        "it may be another part; add its file, or check the sensor's standard deviation."
    )


def _part(part: Part | PartModel | Target) -> Part:
    if isinstance(part, Part):
        return part
    assert part.part is not None
    return part.part


def _search_all(
    touches: Touches, free: FreePaths, targets: Sequence[Target], priors: Priors
) -> list[tuple[Target, Polished]]:
    """All parts with a quick search; wider and wider while no part explains the readings."""
    found: list[tuple[Target, Polished]] = []
    efforts = [efforts_for(touches, target) for target in targets]
    for level in range(max(map(len, efforts), default=0)):
        found = _search_each(touches, free, targets, priors, [e[min(level, len(e) - 1)] for e in efforts], found)
        if any(explained(modes, priors.clutter) for _, modes in found):
            return _search_crowded(touches, free, found, priors)
    best = max((modes for _, modes in found if len(modes.Ts)), key=lambda m: float(m.log_evidence[0]), default=None)
    if best is not None and leaves_many(best, priors.clutter):
        found = _search_each(touches, free, targets, priors, [DEEPEST] * len(targets), found)
    return found


def _search_crowded(
    touches: Touches, free: FreePaths, found: Sequence[tuple[Target, Polished]], priors: Priors
) -> list[tuple[Target, Polished]]:
    """Search parts that matter exhaustively where so many poses explain the readings that some were missed."""
    best = max(float(modes.log_evidence.max(initial=-np.inf)) for _, modes in found)
    out = []
    for target, modes in found:
        if (
            len(touches) > _DETERMINES
            and touches.oriented.sum() < LEAST
            and crowded(modes)
            and modes.log_evidence[0] > best - NEGLIGIBLE
        ):
            out.append((target, search(touches, free, target, priors, EXHAUSTIVE, modes.Ts)))
        else:
            out.append((target, modes))
    return out


def _search_each(
    touches: Touches,
    free: FreePaths,
    targets: Sequence[Target],
    priors: Priors,
    efforts: Sequence[Effort],
    found: Sequence[tuple[Target, Polished]],
) -> list[tuple[Target, Polished]]:
    """One search of every part, the best poses so far among the starts."""
    known = [modes.Ts[:4] for _, modes in found] if found else [None] * len(targets)
    return [
        (target, search(touches, free, target, priors, effort, Ts))
        for target, effort, Ts in zip(targets, efforts, known, strict=True)
    ]


def _large_enough(touches: Touches, part: Part) -> bool:
    """Whether the part is as large as the readings' spread, a few strays left aside."""
    centre = np.median(touches.points, axis=0)
    reach = np.sort(np.linalg.norm(touches.points - centre, axis=1) - 4 * touches.sd - touches.radii)
    shared = 4 * np.sqrt(np.sum(touches.gains**2) / max(len(touches), 1))
    return bool(reach[int(0.75 * (len(reach) - 1))] - shared <= part.diagonal)


def unknown_log_density(touches: Touches, priors: Priors) -> FloatArray:
    """Log density of each reading if the part is none of these: anywhere in the workspace ``(n,)``."""
    ball = np.log(4 / 3 * np.pi * priors.radius**3)
    log: FloatArray = np.where(touches.directed, -np.log(2 * priors.radius), -ball)
    return np.asarray(log - np.where(touches.oriented, np.log(4 * np.pi), 0.0))


def _ranked(
    found: Sequence[tuple[Target, Polished]], log_unknown: float, count: int, priors: Priors
) -> tuple[list[tuple[float, Target, Polished, int]], float]:
    """All modes of all parts with their probabilities, best first, and that of "none of these"."""
    prior = np.log1p(-priors.unknown) - np.log(max(count, 1))
    logs = [modes.log_evidence + np.log(target.part.symmetry.order) + prior for target, modes in found]
    total = float(logsumexp(np.concatenate([[log_unknown], *logs])))
    ranked = [
        (float(np.exp(log[k] - total)), target, modes, k)
        for (target, modes), log in zip(found, logs, strict=True)
        for k in range(len(log))
        if log[k] > total - NEGLIGIBLE
    ]
    ranked.sort(key=lambda row: -row[0])
    return ranked, float(np.exp(log_unknown - total))


def _scatter(ranked: Sequence[tuple[float, Target, Polished, int]]) -> float:
    """How many times more the readings scatter than stated, if the part is sure and nothing else is wrong; else 1."""
    if not ranked or sum(row[0] for row in ranked if row[1] is ranked[0][1]) < CONFIDENCE:
        return 1.0
    _, _, modes, k = ranked[0]
    belongs = modes.belongs[k] > 0.5
    chi2, dof = float(np.sum(modes.residuals[k, belongs] ** 2)), int(belongs.sum()) - 6
    if dof < _ENOUGH or chdtrc(dof, chi2) > SUSPECT:
        return 1.0
    ratio = float(np.sqrt(chi2 / dof))
    return ratio if ratio <= _MOST_SCATTER else 1.0


def _hypothesis(touches: Touches, target: Target, modes: Polished, k: int, probability: float) -> Hypothesis:
    part, T = target.part, modes.Ts[k]
    faces = _faces(touches, target, modes, k)
    information = without_spins(part, pose_information(modes.information[k]))
    free = weak_motions(information, part.diagonal, fixed=spins(part))
    covariance = covariance_with_free(information, free, part.diagonal)
    covariance = covariance + _common_tolerance(touches, modes, k, faces, free, part.diagonal)
    words = tuple(describe_motion(xi, T, part.diagonal) for xi in free)
    unobserved, observed = excuse(part, free, words, covariance)
    belongs, names = modes.belongs[k] > 0.5, [part.faces[f].name for f in faces]
    chi2 = float(np.sum(modes.residuals[k, belongs] ** 2) + np.sum(modes.z[k] ** 2))
    dof = int(belongs.sum()) - (6 - len(free))
    return Hypothesis(
        part=part.name,
        file=part.source,
        probability=probability,
        T_world_part=T,
        covariance=covariance,
        worst_corner_sd=corner_sd(part, observed),
        unobserved=unobserved,
        symmetry_order=part.symmetry.order,
        symmetry_poses=T @ part.symmetry.Ts[1:],
        chi2=chi2,
        dof=max(dof, 0),
        p_value=float(chdtrc(dof, chi2)) if dof > 0 else 1.0,
        rms=float(np.sqrt(np.mean(modes.distances[k, belongs] ** 2))) if belongs.any() else 0.0,
        outliers=tuple(name for name, ok in zip(touches.ids, belongs, strict=True) if not ok),
        pairings=tuple((i, f) for i, f, ok in zip(touches.ids, names, belongs, strict=True) if ok),
        outlier_distances=tuple(float(d) for d, ok in zip(modes.distances[k], belongs, strict=True) if not ok),
        covariance_same_robot=_same_robot(part, modes, k, free),
        symmetry_axis=world_axis(part, T),
        advice=where_to_sense(part, T, free[len(spins(part))]) if unobserved else "",
    )


def _same_robot(part: Part, modes: Polished, k: int, free: Tangents) -> Covariances | None:
    """Covariance with the shared errors known; none if there are none."""
    if modes.z.shape[1] == 0:
        return None
    return covariance_with_free(without_spins(part, modes.information[k][:6, :6]), free, part.diagonal)


def _faces(touches: Touches, target: Target, modes: Polished, k: int) -> IntArray:
    """Index of the face that each reading is nearest to."""
    points = touches.points + touches.gains @ modes.z[k]
    near = target.surface.closest(SE3.apply(SE3.inverse(modes.Ts[k]), points))
    return target.part.triangle_face[near.triangles]


def _common_tolerance(
    touches: Touches, modes: Polished, k: int, faces: IntArray, free: Tangents, length: float
) -> Covariances:
    """What the covariance lacks because a made face deviates as a whole, not anew at every reading ``(6, 6)``.

    The estimate weighs readings as if their deviations were independent; for that estimator, readings of one face
    with one deviation of sd ``tolerance`` add ``A^-1 J' W (one draw - many) W J A^-1``.
    """
    if touches.tolerance == 0:
        return np.zeros((6, 6))
    J, w = modes.rows[k], modes.belongs[k]
    sd = 1 / np.linalg.norm(J[:, :3], axis=1)  # the translation part of a row is the normal over its sd
    weighted = J * (w * touches.tolerance / sd)[:, None]
    scale = np.r_[np.full(3, length), np.ones(3)]
    hold = 1e9 * np.abs(modes.information[k]).max()
    held = np.array(modes.information[k])
    held[:6, :6] += hold * (free / scale).T @ (free / scale)
    gain = np.linalg.inv(held)[:6, :6]
    extra = -weighted.T @ weighted
    for face in np.unique(faces):
        together = weighted[faces == face].sum(axis=0)
        extra = extra + np.outer(together, together)
    values, vectors = np.linalg.eigh(gain @ extra @ gain.T)
    return np.asarray((vectors * values.clip(0.0)) @ vectors.T)


def _what_limits(touches: Touches, best: tuple[float, Target, Polished, int], shared: Sequence[SharedError]) -> str:
    """A sentence on the largest of the errors that all readings share, if it matters."""
    _, target, modes, k = best
    information, start = modes.information[k], 6
    total = corner_sd(target.part, np.asarray(np.linalg.inv(pose_information(information))))
    worst, name = 0.0, ""
    for error in shared:
        stop = start + len(error.covariance)
        known = np.array(information)
        known[start:stop, start:stop] += 1e12 * np.eye(stop - start)
        without = corner_sd(target.part, np.asarray(np.linalg.inv(pose_information(known))))
        part_of = float(np.sqrt(max(total**2 - without**2, 0.0)))
        if part_of > worst:
            worst, name = part_of, error.meaning or error.name
        start = stop
    if worst < _NOTABLE * total:
        return ""
    known_well = float(np.sqrt(total**2 - worst**2))
    what = f"{name}, which all readings share: {1e3 * worst:.2g} mm of the {1e3 * total:.2g} mm"
    says = f"What limits it is not the readings but {what}" if worst > known_well else f"Part of it is {what}"
    return f" {says}. Calibrate it ({1e3 * known_well:.2g} mm are left then), or turn the hand more between readings."
