"""Does the part have material where the readings met it: extents, after the pose is known."""

from __future__ import annotations

import numpy as np

from tanteo.lie import SE3
from tanteo.matching.gates import GATE_SDS
from tanteo.matching.model import PartModel
from tanteo.matching.sensed import Sensed
from tanteo.matching.tree import NOTHING, Interpretations, decode
from tanteo.typing import BoolArray, FloatArray, IntArray, Transforms

_CHUNK_POINTS = 200_000
_FREE = 1e-6
"""Eigenvalues of the translation information below this share of the largest are free directions."""

_SHIFTS = 9
"""Places tried along a single free direction."""


def within_extent(
    sensed: Sensed, model: PartModel, found: Interpretations, tolerance: float
) -> tuple[BoolArray, Transforms]:
    """Whether every paired feature's points lie on the part's surface, within their uncertainty.

    Planes and edges are infinite to the pose estimate; this is where a face ends. A pose that is free to slide in one
    direction passes if it does so somewhere along it; with more freedom than that, and for a family that is known
    only by its directions, nothing is ruled out.

    Returns:
        Which interpretations pass ``(F,)``, and their poses ``(F, 4, 4)``, slid to where they do.
    """
    ok, poses = np.ones(len(found.choices), dtype=bool), np.array(found.solution.T_world_part)
    if not model.has_extent or not len(ok):
        return ok, poses
    values, vectors = np.linalg.eigh(found.solution.information[:, :3, :3])
    free = (values <= _FREE * values[:, -1:]).sum(axis=1)
    turning = np.linalg.eigvalsh(found.solution.information[:, 3:6, 3:6])
    free[turning[:, 0] <= _FREE * turning[:, -1]] = 3
    fixed, sliding = np.flatnonzero(free == 0), np.flatnonzero(free == 1)
    ok[fixed] = _on_surface(sensed, model, found, fixed, found.solution.T_world_part[fixed], tolerance)
    if len(sliding):
        Ts = _slid(sensed, model, found, sliding, vectors[sliding, :, 0])
        some = np.repeat(sliding, _SHIFTS)
        tried = _on_surface(sensed, model, found, some, Ts.reshape(-1, 4, 4), tolerance)
        ok[sliding], poses[sliding] = _middle(tried.reshape(-1, _SHIFTS), Ts)
    return ok, poses


def _middle(tried: BoolArray, Ts: Transforms) -> tuple[BoolArray, Transforms]:
    """Whether any shift passes, and the pose in the middle of those that do."""
    order = np.cumsum(tried, axis=1)
    half = np.argmax(order >= (order[:, -1:] + 1) // 2, axis=1)
    return np.asarray(tried.any(axis=1), dtype=np.bool_), Ts[np.arange(len(Ts)), half]


def _slid(sensed: Sensed, model: PartModel, found: Interpretations, rows: IntArray, axes: FloatArray) -> Transforms:
    """Poses ``(F, shifts, 4, 4)`` along the free axis (part frame), where all points can lie on their faces."""
    T_part_world = SE3.inverse(found.solution.T_world_part[rows])
    low, high = np.full(len(rows), -np.inf), np.full(len(rows), np.inf)
    for i, kind in enumerate(sensed.kinds[: len(sensed)]):
        feature = sensed.features[i]
        if not len(feature.support) or kind not in model.candidates:
            continue
        chosen, _ = decode(found.choices[rows, i], model, kind)
        candidates = model.candidates[kind]
        at = np.einsum("fni,fi->fn", SE3.apply(T_part_world[:, None], feature.support), axes)
        middle = np.einsum("fi,fi->f", candidates.Ts_part_feature[chosen, :3, 3], axes)
        reach = candidates.radii[chosen]
        paired = chosen != NOTHING
        low = np.where(paired, np.maximum(low, at.max(axis=1) - middle - reach), low)
        high = np.where(paired, np.minimum(high, at.min(axis=1) - middle + reach), high)
    low, high = np.where(np.isfinite(low), low, 0.0), np.where(np.isfinite(high), high, 0.0)
    shifts = low[:, None] + (high - low)[:, None] * np.linspace(0, 1, _SHIFTS)
    Ts = np.repeat(found.solution.T_world_part[rows, None], _SHIFTS, axis=1)
    Ts[..., :3, 3] += np.einsum("fij,fsj->fsi", Ts[:, 0, :3, :3], shifts[..., None] * axes[:, None])
    return Ts


def _on_surface(
    sensed: Sensed, model: PartModel, found: Interpretations, rows: IntArray, Ts: Transforms, tolerance: float
) -> BoolArray:
    """Whether the points of every paired feature are on the surface, interpretation ``rows[f]`` at pose ``Ts[f]``.

    Where a ball touched a plane, its centre must be one radius off the whole part: a ball does not fit into a corner.
    """
    ok = np.ones(len(rows), dtype=bool)
    for i, views in enumerate(sensed.views):
        for view, row in enumerate(views):
            if not len(sensed.features[row].support) or sensed.kinds[row] not in model.candidates:
                continue
            chosen, seen = decode(found.choices[rows, i], model, sensed.kinds[row])
            paired = np.flatnonzero(ok & (chosen != NOTHING) & (seen == view))
            step = max(1, _CHUNK_POINTS // len(sensed.features[row].support))
            for some in (paired[k : k + step] for k in range(0, len(paired), step)):
                ok[some] &= _touches(sensed, row, model, Ts[some], _pose_sd(found, rows[some]), tolerance)
    return ok


def _touches(
    sensed: Sensed, row: int, model: PartModel, Ts: Transforms, pose_sd: FloatArray, tolerance: float
) -> BoolArray:
    """Whether the points of one view are on the surface, and the ball that touched there clear of the rest ``(F,)``."""
    feature = sensed.features[row]
    T_part_world = SE3.inverse(Ts)[:, None]
    local = SE3.apply(T_part_world, feature.support)
    room = GATE_SDS * np.sqrt(len(feature.support) * sensed.shift[row] ** 2 + tolerance**2 + pose_sd**2)
    ok = np.all(model.surface.closest(local).distances <= room, axis=-1)
    if feature.tip_radius > 0 and sensed.kinds[row] == "plane":
        centres = local + feature.tip_radius * (T_part_world[..., :3, :3] @ sensed.directions[row])
        gap = model.surface.closest(centres).distances - feature.tip_radius
        ok &= np.all(np.abs(gap) <= room, axis=-1)
    return np.asarray(ok, dtype=np.bool_)


def _pose_sd(found: Interpretations, rows: IntArray) -> FloatArray:
    """Standard deviation of the position that the pose itself leaves ``(F, 1)`` [m]; free directions are skipped."""
    values = np.linalg.eigvalsh(found.solution.information[rows, :3, :3])
    return np.asarray(1 / np.sqrt(np.maximum(values[:, 0], 1e-2 * values[:, -1]))[:, None])
