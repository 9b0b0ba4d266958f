"""Recognition from readings without correspondences: every part's surface against every reading."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import chdtrc, logsumexp

from tanteo.errors import InputError
from tanteo.features import SharedError
from tanteo.lie import SE3
from tanteo.localization import covariance_with_free, describe_motion, pose_information, weak_motions
from tanteo.matching.evidence import Priors
from tanteo.matching.model import PartModel
from tanteo.matching.polish import Polished
from tanteo.matching.recognition import Clock
from tanteo.matching.results import Hypothesis, Recognition
from tanteo.matching.surface import search
from tanteo.matching.target import Target, prepare_target
from tanteo.matching.touches import FreePaths, Touches
from tanteo.matching.verdict import corner_sd, excuse, verdict, where_to_sense
from tanteo.parts import Part
from tanteo.typing import FloatArray

LEAST = 3
"""Fewer readings than this fit any surface in any way."""

NEGLIGIBLE = 12.0
"""Log odds below the best mode at which another is not reported."""


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
    targets = [part if isinstance(part, Target) else prepare_target(part) for part in parts]
    priors = priors or Priors(radius=max(target.part.radius for target in targets))
    clock.lap("prepare")
    found = [(target, search(touches, free, target, priors)) for target in targets if _large_enough(touches, target)]
    clock.lap("search")
    log_unknown = float(np.log(priors.unknown) + unknown_log_density(touches, free, priors).sum())
    ranked, unknown = _ranked(found, log_unknown, len(targets), priors)
    hypotheses = tuple(
        _hypothesis(touches, target, modes, k, probability) for probability, target, modes, k in ranked[:top]
    )
    clock.lap("locate")
    status, message = verdict(hypotheses, unknown, alpha, advice=_advice(ranked))
    if hypotheses and status == "recognized":
        message += _what_limits(touches, ranked[0], shared)
    return Recognition(status, message, hypotheses, unknown, clock.laps(), seed)


def _large_enough(touches: Touches, target: Target) -> bool:
    """Whether the part is as large as the readings' spread, a few strays left aside."""
    centre = np.median(touches.points, axis=0)
    reach = np.sort(np.linalg.norm(touches.points - centre, axis=1) - 4 * touches.sd - touches.radii)
    shared = 4 * np.sqrt(np.sum(touches.gains**2)) / max(len(touches), 1) ** 0.5
    return bool(reach[int(0.75 * (len(reach) - 1))] - shared <= target.part.diagonal)


def unknown_log_density(touches: Touches, free: FreePaths, priors: Priors) -> FloatArray:
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


def _hypothesis(touches: Touches, target: Target, modes: Polished, k: int, probability: float) -> Hypothesis:
    part, T = target.part, modes.Ts[k]
    information = pose_information(modes.information[k])
    free = weak_motions(information, part.diagonal)
    covariance = covariance_with_free(information, free, part.diagonal)
    words = tuple(describe_motion(xi, T, part.diagonal) for xi in free)
    unobserved, observed = excuse(part, free, words, covariance)
    belongs = modes.belongs[k] > 0.5
    chi2 = float(np.sum(modes.residuals[k, belongs] ** 2) + np.sum(modes.z[k] ** 2))
    dof = int(belongs.sum()) - (6 - len(free))
    faces = _faces(touches, target, modes, k)
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
        pairings=tuple((i, f) for i, f, ok in zip(touches.ids, faces, belongs, strict=True) if ok),
    )


def _faces(touches: Touches, target: Target, modes: Polished, k: int) -> list[str]:
    """Name of the face that each reading is nearest to."""
    points = touches.points + touches.gains @ modes.z[k]
    near = target.surface.closest(SE3.apply(SE3.inverse(modes.Ts[k]), points))
    return [target.part.faces[f].name for f in target.part.triangle_face[near.triangles]]


def _advice(ranked: Sequence[tuple[float, Target, Polished, int]]) -> str:
    """What to sense for the first direction that the best mode leaves free."""
    if not ranked:
        return ""
    _, target, modes, k = ranked[0]
    free = weak_motions(pose_information(modes.information[k]), target.part.diagonal)
    for xi in free:
        if excuse(target.part, xi[None], ("free",), np.eye(6))[0]:
            return where_to_sense(target.part, modes.Ts[k], xi)
    return ""


def _what_limits(touches: Touches, best: tuple[float, Target, Polished, int], shared: Sequence[SharedError]) -> str:
    """A sentence if an error that all readings share, not the readings, limits the answer."""
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
    if worst < 0.7 * total:
        return ""
    return (
        f" What limits it is not the readings but {name}, which they all share: {1e3 * worst:.2g} mm of the "
        f"{1e3 * total:.2g} mm. "
        "More readings of the same kind do not help; calibrate it, or turn the hand between readings."
    )
