"""Which part lies in a region, in which stable pose, where: posterior over all of them and the unknown object."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tanteo.lie import SE3
from tanteo.parts import Part
from tanteo.special import log_sum
from tanteo.typing import BoolArray, FloatArray, Transforms
from tanteo.vision.candidates import Candidates
from tanteo.vision.evidence import Weights, log_weight
from tanteo.vision.models import VisionModel

UNKNOWN = 0.1
"""Probability beforehand that the object is none of the parts."""

MISSED = 0.04
"""How often the true pose is not among those found: 3 of 74 times in the scenes that weights are fitted on."""

_MERGE_TURN, _MERGE_SHIFT = 0.04, 0.02
"""Poses nearer than this are one [rad, diagonals]."""


@dataclass(frozen=True, slots=True, eq=False)
class ImageMode:
    """A part at a pose.

    Attributes:
        model: the part.
        rest: which stable pose; -1 where none was assumed.
        T_camera_part: ``(4, 4)``.
        log: log weight, up to a constant that all modes of the object share.
        probability: posterior.
    """

    model: VisionModel
    rest: int
    T_camera_part: Transforms
    log: float
    probability: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class ImagePosterior:
    """Posterior of one object.

    Attributes:
        modes: best first.
        unknown: probability of the unknown object. What is missing to 1 belongs to the parts in poses that were not
            found.
    """

    modes: tuple[ImageMode, ...]
    unknown: float


def infer(candidates: Sequence[Candidates], stretches: float, weights: Weights, parts: int) -> ImagePosterior:
    """Posterior from candidates; poses that are one by symmetry or by convergence are merged, the best stands for them.

    Args:
        candidates: of every part.
        stretches: of edge in the region.
        weights: of the evidence.
        parts: how many there are in the catalogue.
    """
    modes: list[ImageMode] = []
    for c in candidates:
        log = np.log((1 - UNKNOWN) / parts) + c.priors + log_weight(c.evidence, weights)
        kept = distinct_poses(c.model.part, c.T_camera_part, log)
        modes += [ImageMode(c.model, int(c.rests[k]), c.T_camera_part[k], float(log[k])) for k in kept]
    none = np.log(UNKNOWN) + weights.unknown * stretches + weights.base
    total = float(log_sum([m.log for m in modes] + [none]))
    # that none of the poses holds is a strange part's doing, or the search's that missed the true one
    strange = UNKNOWN / (UNKNOWN + (1 - UNKNOWN) * MISSED)
    modes.sort(key=lambda m: -m.log)
    scored = tuple(ImageMode(m.model, m.rest, m.T_camera_part, m.log, float(np.exp(m.log - total))) for m in modes)
    return ImagePosterior(scored, strange * float(np.exp(none - total)))


def distinct_poses(part: Part, Ts: Transforms, log: FloatArray) -> list[int]:
    """Which of the poses ``(B, 4, 4)`` are not one with a more probable one: their numbers, the most probable first."""
    kept: list[int] = []
    for k in np.argsort(-log, kind="stable"):
        if not np.any(one_pose(part, Ts[kept], Ts[k])):
            kept.append(int(k))
    return kept


def one_pose(part: Part, first: Transforms, second: Transforms) -> BoolArray:
    """Whether poses ``(*batch, 4, 4)`` and a second one are one, or one by the part's symmetry ``(*batch,)``."""
    gap = SE3.inverse(first) @ second
    if part.symmetry.spherical or part.symmetry.axis is not None:
        return _one_axis(part, gap)
    between = part.symmetry.Ts @ SE3.inverse(gap)[..., None, :, :]
    # the norm of R - 1 is 2 sqrt(2) times the sine of half the turn
    turn = np.linalg.norm(between[..., :3, :3] - np.eye(3), axis=(-2, -1))
    shift = np.linalg.norm(SE3.apply(between, part.centroid) - part.centroid, axis=-1)
    near = (turn < np.sqrt(8) * np.sin(_MERGE_TURN / 2)) & (shift < _MERGE_SHIFT * part.diagonal)
    return np.asarray(np.any(near, axis=-1))


def _one_axis(part: Part, gap: Transforms) -> BoolArray:
    near = np.linalg.norm(SE3.apply(gap, part.centroid) - part.centroid, axis=-1) < _MERGE_SHIFT * part.diagonal
    if part.symmetry.axis is None:
        return np.asarray(near)
    axis = part.symmetry.axis[1]
    turned = np.einsum("kij,j->ki", part.symmetry.Ts[:, :3, :3], axis)
    along = turned @ (gap[..., :3, :3] @ axis)[..., None]
    return np.asarray(near & np.any(along[..., 0] > np.cos(_MERGE_TURN), axis=-1))
