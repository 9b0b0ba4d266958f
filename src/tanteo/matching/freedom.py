"""Which directions of the pose an interpretation leaves free, by the geometry of the model alone.

Noise tilts sensed normals against each other, and a direction that nothing resists then looks faintly observed. Taken
at its word, such a direction sends the pose away along it, spoils the test and distorts the evidence.
"""

from __future__ import annotations

import numpy as np

from tanteo.localization import motions_about
from tanteo.matching.model import PartModel
from tanteo.matching.sensed import KINDS_IN_TREE, Sensed
from tanteo.typing import FloatArray, IntArray, Vectors

_RANK_TOLERANCE = 1e-9
"""Eigenvalues of the scaled geometry below this share of the largest count as zero."""

NOTHING = -1
"""In an interpretation: the sensed feature is clutter."""


def pose_scale(radius: float, middle: Vectors) -> FloatArray:
    """Extent of each coordinate of the pose, a cube of ``2 radius`` and all attitudes, as columns ``(6, 6)`` [m, rad].

    The motions are those of a frame at ``middle`` ``(3,)`` of the part, in coordinates of the part's own frame.
    """
    return motions_about(middle) * np.r_[np.full(3, 2 * radius), np.full(3, (8 * np.pi**2) ** (1 / 3))]


def free_projector(sensed: Sensed, model: PartModel, choices: IntArray, radius: float) -> tuple[FloatArray, IntArray]:
    """Projector on the motions of the part, over :func:`pose_scale` about its middle, that no pairing resists.

    Args:
        sensed: the sensed features.
        model: the part, or a family known by its directions.
        choices: candidates ``(F, n)``.
        radius: see :func:`pose_scale`.

    Returns:
        Projectors ``(F, 6, 6)``, and their ranks ``(F,)``.
    """
    A = np.zeros((len(choices), 6, 6))
    for kind in KINDS_IN_TREE:
        members = [i for i in range(len(sensed)) if sensed.kinds[i] == kind]
        if members and kind in model.candidates:
            each = _resistance(model, kind)
            n = len(each)
            chosen = choices[:, members]
            A += np.where((chosen != NOTHING)[..., None, None], each[chosen % n], 0.0).sum(axis=1)
    scale = pose_scale(radius, model.middle)
    values, vectors = np.linalg.eigh(scale.T @ A @ scale)
    free = values <= _RANK_TOLERANCE * np.maximum(values[:, -1:], 1e-300)
    return (vectors * free[:, None]) @ np.swapaxes(vectors, -1, -2), free.sum(axis=1)


def _resistance(model: PartModel, kind: str) -> FloatArray:
    """What each candidate resists: sum of squares of its equations' gradients by the pose ``(N, 6, 6)``."""
    if kind in model.resistances:
        return model.resistances[kind]
    candidates = model.candidates[kind]
    axes, p = candidates.directions, candidates.Ts_part_feature[:, :3, 3]
    along = axes[:, :, None] * axes[:, None]
    offsets = {"plane": along, "edge": np.eye(3) - along, "vertex": np.broadcast_to(np.eye(3), along.shape)}[kind]
    turns = np.zeros_like(along) if kind == "vertex" else (np.eye(3) - along) * model.radius**2
    J = np.zeros((len(p), 3, 6))  # displacement of the part's point p by the pose
    J[:, :, :3] = np.eye(3)
    x, y, z = p.T
    J[:, 0, 4], J[:, 0, 5], J[:, 1, 3], J[:, 1, 5], J[:, 2, 3], J[:, 2, 4] = z, -y, -z, x, y, -x
    out = np.swapaxes(J, 1, 2) @ offsets @ J if model.has_extent else np.zeros((len(p), 6, 6))
    out[:, 3:, 3:] += turns
    model.resistances[kind] = out
    return out
