"""What is still possible: poses of parts with their probabilities, and "none of these"."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tanteo.answers.part_motions import without_spin
from tanteo.answers.priors import Priors
from tanteo.lie import SE3
from tanteo.localization.solve import pose_information, take
from tanteo.matching.evidence import log_evidence, perfect_evidence
from tanteo.matching.freedom import free_projector, pose_scale
from tanteo.matching.model import PartModel
from tanteo.matching.sensed import Sensed
from tanteo.matching.tree import Gates, Interpretations, interpret, pair_gates
from tanteo.matching.unknown import log_unknown
from tanteo.matching.verify import within_extent
from tanteo.parts import Part
from tanteo.special import log_sum
from tanteo.typing import BoolArray, FloatArray, IntArray, Tangents, Transforms

NEGLIGIBLE = 10.0
"""Log odds below which an explanation by a part is not looked for: less than one in ten thousand."""

_TAIL = 6.0
"""Interpretations this much less likely still count towards their sum."""

_SAME_POSE = 22.5
"""Squared Mahalanobis distance within which two poses are one mode (one in a thousand, six degrees of freedom)."""


@dataclass(frozen=True, slots=True, eq=False)
class Mode:
    """One pose of one part: interpretations that imply it, symmetric ones included, are summed.

    Attributes:
        model: the part.
        choices: of the most probable interpretation ``(n,)``.
        T_world_part: its pose.
        probability: posterior.
        information: on the pose ``(6, 6)``.
    """

    model: PartModel
    choices: IntArray
    T_world_part: Transforms
    probability: float
    information: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Belief:
    """The posterior over parts and poses.

    Attributes:
        modes: best first.
        unknown: probability of none of the parts.
        cut: whether the search had to drop partial interpretations.
    """

    modes: tuple[Mode, ...]
    unknown: float
    cut: bool


@dataclass(frozen=True, slots=True, eq=False)
class _Explained:
    """Interpretations of one part with their log weights (prior included)."""

    model: PartModel
    choices: IntArray
    Ts: Transforms
    information: FloatArray
    log_weights: FloatArray


def believe(sensed: Sensed, models: Sequence[PartModel], priors: Priors, tolerance: float = 0.0) -> Belief:
    """Posterior over the parts, their poses and "none of these".

    Parts are searched with no feature left out, then one, then two, as long as some part could still reach a weight
    that matters beside the best explanation so far.
    """
    unknown = log_unknown(sensed, models, priors, tolerance) + np.log(priors.unknown)
    prior = np.log1p(-priors.unknown) - np.log(max(len(models), 1))
    known: dict[bytes, float] = {}
    bounds = {model.name: perfect_evidence(sensed, model, priors, known) + prior for model in models}
    gates: dict[str, Gates] = {}
    best, found, cut = unknown, [], False
    for left_out in range(len(sensed)):
        for model in models:
            if bounds[model.name][left_out] < best - NEGLIGIBLE:
                continue
            if model.name not in gates:
                gates[model.name] = pair_gates(sensed, model, tolerance)
            interpretations = interpret(sensed, model, left_out, tolerance, gates[model.name])
            cut |= interpretations.cut
            if not len(interpretations.choices):
                continue
            explained = _explain(sensed, model, interpretations, priors, tolerance, prior, best)
            if len(explained.log_weights):
                found.append(explained)
                best = max(best, float(explained.log_weights.max()))
    return _weigh(found, unknown, best, cut, apart=priors.pose is not None and priors.pose.T_world_part is not None)


def _explain(
    sensed: Sensed,
    model: PartModel,
    interpretations: Interpretations,
    priors: Priors,
    tolerance: float,
    prior: float,
    best: float,
) -> _Explained:
    weights = log_evidence(sensed, model, interpretations, priors) + prior
    hopeful = weights > best - NEGLIGIBLE - _TAIL
    some = Interpretations(interpretations.choices[hopeful], take(interpretations.solution, hopeful), False)
    keep, poses, share = within_extent(sensed, model, some, tolerance, priors.radius)
    free, _ = free_projector(sensed, model, some.choices[keep], priors.radius)
    scale = pose_scale(priors.radius, model.middle)
    bound = np.eye(6) - scale @ free @ np.linalg.inv(scale)  # motions that nothing resists are not told apart
    information = np.swapaxes(bound, -1, -2) @ pose_information(some.solution.information[keep]) @ bound
    return _Explained(model, some.choices[keep], poses[keep], information, (weights[hopeful] + share)[keep])


def _weigh(found: Sequence[_Explained], unknown: float, best: float, cut: bool, *, apart: bool) -> Belief:
    total = float(log_sum(np.concatenate([[unknown], *(e.log_weights for e in found)])))
    modes: list[Mode] = []
    by_part: dict[str, list[_Explained]] = {}
    for explained in found:
        by_part.setdefault(explained.model.name, []).append(explained)
    for group in by_part.values():
        modes += _merge(group, total, best, apart=apart)
    modes.sort(key=lambda mode: -mode.probability)
    return Belief(tuple(modes), float(np.exp(unknown - total)), cut)


def _merge(group: Sequence[_Explained], total: float, best: float, *, apart: bool) -> list[Mode]:
    """Interpretations of one part as distinct poses, symmetric ones together or ``apart``: a rough pose names one."""
    model = group[0].model
    log = np.concatenate([e.log_weights for e in group])
    choices = np.concatenate([e.choices for e in group])
    Ts = np.concatenate([e.Ts for e in group])
    information = np.concatenate([e.information for e in group])
    assert model.part is not None
    left = np.flatnonzero(log > best - NEGLIGIBLE - _TAIL)
    left = left[np.argsort(-log[left], kind="stable")]
    modes = []
    while len(left):
        top = left[0]
        same = equivalent(model.part, Ts[top], Ts[left], information[left], apart=apart)
        same[0] = True
        weight = float(np.exp(log_sum(log[left[same]]) - total))
        modes.append(Mode(model, choices[top], Ts[top], weight, information[top]))
        left = left[~same]
    return modes


def equivalent(
    part: Part,
    T: Transforms,
    others: Transforms,
    information: FloatArray,
    limit: float = _SAME_POSE,
    *,
    apart: bool = False,
) -> BoolArray:
    """Which of the poses ``others`` ``(F, 4, 4)``, known so well, put the part where ``T`` does, up to its symmetry."""
    Ts = np.broadcast_to(T, others.shape)
    return np.asarray(squared_gaps(part, Ts, others, information, apart=apart) <= limit, dtype=np.bool_)


def squared_gaps(
    part: Part, Ts: Transforms, others: Transforms, information: FloatArray, *, apart: bool = False
) -> FloatArray:
    """Squared Mahalanobis distances ``(F,)`` between poses of a part, to the nearest of those that symmetry makes one.

    Args:
        part: the part.
        Ts: poses ``(F, 4, 4)``.
        others: a pose for each ``(F, 4, 4)``.
        information: of the others, for motions of their own frames ``(F, 6, 6)``.
        apart: whether only what a continuous symmetry makes one is taken as one.
    """
    return gaps_between(part, Ts, others, information, apart=apart)[1]


def gaps_between(
    part: Part, Ts: Transforms, others: Transforms, information: FloatArray, *, apart: bool = False
) -> tuple[Tangents, FloatArray]:
    """Motions from the others to the poses, in the frames of the others ``(F, 6)``, and their squared lengths ``(F,)``.

    Args:
        part: the part.
        Ts: as of :func:`squared_gaps`.
        others: as of :func:`squared_gaps`.
        information: as of :func:`squared_gaps`.
        apart: as of :func:`squared_gaps`.
    """
    turns = part.symmetry.Ts[:1] if apart else part.symmetry.Ts
    gaps = (SE3.inverse(others) @ Ts) @ turns[:, None]
    if part.symmetry.continuous:
        gaps = without_spin(part, gaps)
    xi = SE3.log(gaps)
    squared = np.sum((xi[:, :, None] @ information)[:, :, 0] * xi, axis=-1)
    nearest, rows = squared.argmin(axis=0), np.arange(squared.shape[1])
    return xi[nearest, rows], squared[nearest, rows]
