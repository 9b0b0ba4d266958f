"""Motions of the part that pairings leave free, as vectors and as text."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from tanteo.fitting.localization.solve import Block, assemble, pose_information
from tanteo.geometry import SE3, SO3, maximize
from tanteo.geometry.typing import FloatArray, Tangents, Transforms
from tanteo.words import Motion

_RANK_TOLERANCE = 1e-9
"""Largest eigenvalue of the scaled information that counts as zero, as a fraction of the largest one."""

_SLIDING = 0.02
"""Turn of a free direction for each part size of sliding below which it is called sliding [rad]."""

_AXIS_TOLERANCE = np.cos(np.radians(2.0))
"""Cosine of the angle to a coordinate axis within which a direction has the name of the axis."""


def at_exact_pairings(blocks: Sequence[Block], T_world_part: Transforms) -> list[Block]:
    """Return the blocks with every sensed frame moved onto its model feature.

    Noise tilts sensed features, so that a free direction seems weakly observed. Observability is a property of the
    geometry without noise.
    """
    out = []
    for block in blocks:
        to_world = T_world_part[..., None, :, :] @ block.Ts_part_model
        T = SE3.inverse(to_world) @ block.Ts_world_feature
        T, _ = maximize(T, partial(_onto, block), lambda T, step: T @ SE3.exp(step), 3)
        out.append(replace(block, Ts_world_feature=to_world @ T))
    return out


def _onto(block: Block, T: Transforms) -> tuple[FloatArray, FloatArray]:
    """Return the shortest motions that take sensed frames onto their model features, with unit information."""
    f, D = block.relation.linearize(T, block.radii)
    return np.eye(6), -(np.linalg.pinv(D) @ f[..., None])[..., 0]


def unobserved_directions(
    blocks: Sequence[Block], T_world_part: Transforms, n_shared: int, scale: FloatArray
) -> Tangents:
    """Return an orthonormal basis of motions that no pairing constrains at one pose ``(k, 6)``.

    Args:
        blocks: pairings.
        T_world_part: pose ``(4, 4)``.
        n_shared: number of whitened shared errors in the blocks.
        scale: scale of motions ``(6, 6)``, see :func:`motion_scale`.

    Returns:
        Tangents over that scale: ``[v / length, w]`` of a frame at the part's middle; pure translations first.
    """
    exact = at_exact_pairings(blocks, T_world_part)
    information = pose_information(assemble(exact, T_world_part, np.zeros(n_shared)).information)
    values, vectors = np.linalg.eigh(scale.T @ information @ scale)
    N = vectors[:, values <= _RANK_TOLERANCE * max(values[-1], 0.0)].T
    return _translations_first(N) if len(N) else np.zeros((0, 6))


def weak_motions(
    information: FloatArray, scale: FloatArray, sd: float = 0.3, fixed: Tangents | None = None
) -> Tangents:
    """Return an orthonormal basis of motions whose standard deviation exceeds ``sd`` of their scale ``(k, 6)``.

    A linearized covariance is not valid for these, so they are called free.

    Args:
        information: information on the pose ``(6, 6)``.
        scale: scale of motions ``(6, 6)``, see :func:`motion_scale`.
        sd: limit of the standard deviation, relative to the part's size or in radians.
        fixed: motions ``(m, 6)`` that are free by symmetry; they come first, and the others are orthogonal to them.
    """
    known = np.zeros((0, 6)) if fixed is None else fixed
    A = scale.T @ information @ scale
    keep = np.eye(6) - known.T @ known
    values, vectors = np.linalg.eigh(keep @ A @ keep + 1e3 / sd**2 * known.T @ known)
    N = vectors[:, values < 1 / sd**2].T
    return np.concatenate([known, _translations_first(N)]) if len(N) else known


def _translations_first(N: FloatArray) -> FloatArray:
    """Return a basis of the same space: pure translations first, then screws orthogonal to them."""
    U, s, _ = np.linalg.svd(N[:, 3:], full_matrices=True)
    rank = int(np.sum(s > 1e-6))
    translations = _sparse_rows(U[:, rank:].T @ N)
    turns = U[:, :rank].T @ N
    turns -= turns @ translations.T @ translations if len(translations) else 0.0
    return np.concatenate([translations, turns / np.linalg.norm(turns, axis=1, keepdims=True)])


def _sparse_rows(N: FloatArray) -> FloatArray:
    """Return the coordinate axes for all three translations; other bases unchanged."""
    return np.eye(6)[:3] if len(N) == 3 else N


def describe_motion(u: Tangents, T_world_part: Transforms, scale: FloatArray) -> Motion:
    """Return an unobserved direction as a motion: a translation or a rotation, along a named axis where it has one.

    Args:
        u: tangent over the scale, see :func:`unobserved_directions`.
        T_world_part: the pose.
        scale: scale of motions ``(6, 6)``, see :func:`motion_scale`.
    """
    length, middle, w = scale[0, 0], SO3.vee(scale[:3, 3:]), u[3:]
    v = u[:3] * length
    R = T_world_part[:3, :3]
    if np.linalg.norm(w) < _SLIDING:
        return Motion(False, *_named_direction(v, R))
    axis = w / np.linalg.norm(w)
    pitch = float(v @ axis) / float(np.linalg.norm(w))
    point = T_world_part[:3, :3] @ (middle + np.cross(w, v) / (w @ w)) + T_world_part[:3, 3]
    pitch = 0.0 if abs(pitch) < 1e-3 * length else pitch
    return Motion(True, *_named_direction(axis, R), tuple(map(float, point)), pitch)


def _named_direction(d: FloatArray, R_world_part: FloatArray) -> tuple[str, tuple[float, float, float]]:
    """Return the axis that a direction of the part follows, empty if none, and the direction in the world."""
    d = d / np.linalg.norm(d)
    x, y, z = map(float, R_world_part @ d)
    for frame, u in (("world", (x, y, z)), ("part", tuple(map(float, d)))):
        k = int(np.argmax(np.abs(u)))
        if abs(u[k]) > _AXIS_TOLERANCE:
            return f"{frame} {'xyz'[k]}", (x, y, z)
    return "", (x, y, z)
