"""Which part is it, where is it, how sure are we: the whole path from sensed features to the answer."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tanteo.errors import InputError
from tanteo.fitting import Sides
from tanteo.lie import SE3
from tanteo.localization import ModelFeature, Pairing, PoseEstimate, estimate_pose
from tanteo.matching.belief import Belief, Mode, believe
from tanteo.matching.evidence import Priors
from tanteo.matching.model import PartModel, prepare
from tanteo.matching.published import believe_as_published
from tanteo.matching.results import Hypothesis, Recognition, Status
from tanteo.matching.sensed import Sensed, sense
from tanteo.matching.tree import NOTHING, decode
from tanteo.parts import Part
from tanteo.typing import Covariances, FloatArray

CONFIDENCE = 0.95
"""Posterior from which one answer is given as the answer."""


def identify_features(
    features: Sequence[Sides],
    parts: Sequence[Part] | Sequence[PartModel],
    *,
    tolerance: float = 0.0,
    alpha: float = 0.01,
    top: int = 5,
    as_published: bool = False,
    priors: Priors | None = None,
    seed: int = 0,
) -> Recognition:
    """Which of the parts the sensed features belong to, and its pose.

    Args:
        features: sensed planes, edges and vertices in the world; a plane whose outward side is unknown as a pair of
            both.
        parts: candidates, as parts or prepared (``prepare(part)``; do it once for many calls).
        tolerance: sd of the made part's surface against its CAD [m].
        alpha: an answer whose joint test has a smaller p-value than this is not accepted.
        top: number of hypotheses to report.
        as_published: use the constraints and tests of the 1991 paper as printed, for comparison.
        priors: what is assumed beforehand; the radius is that of the largest part if not given.
        seed: recorded in the answer; this search draws nothing.

    Returns:
        The answer, whatever its status; nothing is raised for an unkind world.

    Raises:
        InputError: without parts, or for an ``alpha`` outside (0, 1).
    """
    if not parts:
        raise InputError("parts: expected at least one part, got none.")
    if not 0 < alpha < 1:
        raise InputError(f"alpha: expected a probability between 0 and 1, got {alpha}.")
    clock = _Clock()
    models = [part if isinstance(part, PartModel) else prepare(part) for part in parts]
    sensed = sense(features)
    priors = priors or Priors(radius=max(model.radius for model in models))
    clock.lap("prepare")
    belief = believe_as_published(sensed, models, alpha) if as_published else believe(sensed, models, priors, tolerance)
    clock.lap("search")
    hypotheses = tuple(_hypothesis(sensed, mode, tolerance) for mode in belief.modes[:top])
    clock.lap("locate")
    status, message = _verdict(belief, hypotheses, alpha, as_published)
    return Recognition(status, message, hypotheses, belief.unknown, clock.laps(), seed)


class _Clock:
    """Seconds by stage."""

    def __init__(self) -> None:
        self._start = self._last = time.perf_counter()
        self._laps: dict[str, float] = {}

    def lap(self, name: str) -> None:
        now = time.perf_counter()
        self._laps[name], self._last = now - self._last, now

    def laps(self) -> dict[str, float]:
        return {**self._laps, "total": time.perf_counter() - self._start}


def pairings_of(sensed: Sensed, mode: Mode, tolerance: float) -> list[Pairing]:
    """The mode's interpretation as pairings of sensed with model features."""
    out = []
    for i, choice in enumerate(mode.choices):
        if choice == NOTHING:
            continue
        kind = sensed.kinds[i]
        chosen, view = (int(k) for k in decode(choice, mode.model, kind))
        feature, candidates = sensed.features[sensed.views[i][view]], mode.model.candidates[kind]
        P = np.diag((tolerance * candidates.tolerance_scale[chosen]) ** 2)
        T = candidates.Ts_part_feature[chosen]
        out.append(Pairing(feature, ModelFeature(feature.kind, T, P, 0.0, candidates.names[chosen])))
    return out


def _hypothesis(sensed: Sensed, mode: Mode, tolerance: float) -> Hypothesis:
    part = mode.model.part
    assert part is not None
    pairings = pairings_of(sensed, mode, tolerance)
    estimate = estimate_pose(pairings, start=mode.T_world_part, length=part.diagonal)
    unexplained, covariance = _unexplained(part, estimate)
    outliers = tuple(
        reading
        for feature, chosen in zip(sensed.features, mode.choices, strict=False)
        if chosen == NOTHING
        for reading in feature.readings or (feature.label,)
    )
    return Hypothesis(
        part=part.name,
        file=part.source,
        probability=mode.probability,
        T_world_part=estimate.T_world_part,
        covariance=estimate.covariance,
        worst_corner_sd=corner_sd(part, covariance),
        unobserved=unexplained,
        symmetry_order=part.symmetry.order,
        symmetry_poses=estimate.T_world_part @ part.symmetry.Ts[1:],
        chi2=estimate.chi2,
        dof=estimate.dof,
        p_value=estimate.p_value,
        rms=_rms(estimate, pairings),
        outliers=outliers,
        pairings=tuple((r, p.model.name) for p in pairings for r in p.sensed.readings or (p.sensed.label,)),
    )


def _unexplained(part: Part, estimate: PoseEstimate) -> tuple[tuple[str, ...], Covariances]:
    """Free directions that the part's own symmetry does not excuse, and the covariance without the excused ones."""
    spins = _spins(part)
    words, covariance = [], np.array(estimate.covariance)
    for xi, name in zip(estimate.free, estimate.unobserved, strict=True):
        left = xi - spins.T @ (spins @ xi)
        if np.linalg.norm(left) > 1e-3:
            words.append(name)
            continue
        scaled = xi * np.r_[np.full(3, part.diagonal), np.ones(3)]
        covariance -= (2 * np.pi) ** 2 / 12 * np.outer(scaled, scaled)
    return tuple(words), covariance


def _spins(part: Part) -> FloatArray:
    """Orthonormal basis ``(k, 6)`` of the motions of the part's continuous symmetry, scaled by its diagonal."""
    if not part.symmetry.continuous:
        return np.zeros((0, 6))
    if part.symmetry.spherical:
        axes, point = np.eye(3), part.centroid
    else:
        assert part.symmetry.axis is not None
        point, axis = part.symmetry.axis
        axes = axis[None]
    rows = np.concatenate([np.cross(point, axes) / part.diagonal, axes], axis=1)
    return np.linalg.qr(rows.T)[0].T


def corner_sd(part: Part, covariance: Covariances) -> float:
    """Largest standard deviation of the position of a corner of the part's box, in any direction [m]."""
    low, high = part.box
    corners = np.array(
        [[(low, high)[i][0], (low, high)[j][1], (low, high)[k][2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    )
    J = np.zeros((8, 3, 6))
    J[:, :, :3] = np.eye(3)
    x, y, z = corners.T
    J[:, 0, 4], J[:, 0, 5], J[:, 1, 3], J[:, 1, 5], J[:, 2, 3], J[:, 2, 4] = z, -y, -z, x, y, -x
    return float(np.sqrt(np.linalg.eigvalsh(J @ covariance @ np.swapaxes(J, 1, 2)).max()))


def _rms(estimate: PoseEstimate, pairings: Sequence[Pairing]) -> float:
    """Root mean square distance of the sensed points from the model features they are paired with [m]."""
    squared = [np.zeros(0)]
    for pairing in pairings:
        T_world_model = estimate.T_world_part @ pairing.model.T_part_feature
        local = SE3.apply(SE3.inverse(T_world_model), pairing.sensed.support)
        across = [i for i in pairing.model.kind.rows if i < 3]
        squared.append(np.sum(local[:, across] ** 2, axis=1))
    total = np.concatenate(squared)
    return float(np.sqrt(total.mean())) if len(total) else 0.0


def _verdict(
    belief: Belief, hypotheses: tuple[Hypothesis, ...], alpha: float, as_published: bool
) -> tuple[Status, str]:
    note = " The search was cut short: sense fewer, better spread features." if belief.cut else ""
    if not hypotheses or belief.unknown > max(h.probability for h in hypotheses):
        return "unknown", _unknown_message(belief, hypotheses) + note
    best = hypotheses[0]
    if best.p_value < alpha and not as_published:
        return "unknown", (
            f"The closest part is {best.part}, but the features contradict it (p = {best.p_value:.2g}): "
            "check the sensor's standard deviation, the tolerance and the units." + note
        )
    if best.unobserved:
        return "insufficient", (
            f"{best.part} fits, but {' and '.join(best.unobserved)} stays free: "
            "sense a face or an edge that resists it." + note
        )
    if best.probability < CONFIDENCE:
        return "ambiguous", _ambiguous_message(hypotheses, belief) + note
    sd = 1e3 * best.worst_corner_sd
    return "recognized", f"{best.part}, located to {sd:.2g} mm (1 sd, worst corner)." + note


def _unknown_message(belief: Belief, hypotheses: tuple[Hypothesis, ...]) -> str:
    if not hypotheses:
        return "None of the parts explains the features: add the part's file, or check units and standard deviations."
    best = hypotheses[0]
    return (
        f"None of the parts is the best explanation (P = {belief.unknown:.2f}); the closest is {best.part} "
        f"(P = {best.probability:.2f}): sense more features, or add the part's file."
    )


def _ambiguous_message(hypotheses: tuple[Hypothesis, ...], belief: Belief) -> str:
    likely = [h for h in hypotheses if h.probability > 0.01] or hypotheses[:1]
    names = list(dict.fromkeys(h.part for h in likely))
    if len(names) > 1:
        return f"It may be {', '.join(names[:-1])} or {names[-1]}: sense a face where they differ."
    if belief.unknown > 0.01 and hypotheses[0].probability + belief.unknown > 0.99:
        return f"{names[0]} fits, but so may an unknown part (P = {belief.unknown:.2f}): sense one more feature."
    return f"It is {names[0]}, in one of several poses: sense a face that is not where its others would put it."


def with_elapsed(recognition: Recognition, **seconds: float) -> Recognition:
    """The same answer with more stages in its clock (loading, measuring); the total grows by them."""
    elapsed = {**seconds, **recognition.elapsed}
    elapsed["total"] = recognition.elapsed.get("total", 0.0) + sum(seconds.values())
    return replace(recognition, elapsed=elapsed)
