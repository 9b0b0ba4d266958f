"""Does the part have material where the readings met it: extents, after the pose is known."""

from __future__ import annotations

import numpy as np

from tanteo.lie import SE3
from tanteo.matching.freedom import NOTHING, free_projector, pose_scale
from tanteo.matching.gates import GATE_SDS
from tanteo.matching.model import PartModel
from tanteo.matching.pairings import decode
from tanteo.matching.sensed import Sensed
from tanteo.matching.tree import Interpretations
from tanteo.typing import BoolArray, FloatArray, IntArray, Transforms

_CHUNK_POINTS = 200_000

_WHOLE = 1 - 1e-6
"""A translation whose projection on the free motions is longer than this is free."""

_SAMPLES = {(1, 0): (1, 24), (0, 1): (48, 1), (1, 1): (24, 8), (2, 1): (24, 16)}
"""Turns and slides tried for each number of free slides and free turns; with more freedom nothing is ruled out."""

_MEMBERSHIP = 1e-6
"""Faces in one plane to within this, in angle [rad] and height over the part's radius, are told apart by place."""


def within_extent(
    sensed: Sensed, model: PartModel, found: Interpretations, tolerance: float, radius: float
) -> tuple[BoolArray, Transforms, FloatArray]:
    """Whether every paired feature's points lie on the part's surface, within their uncertainty.

    Planes and edges are infinite to the pose estimate; this is where a face ends. A pose that is free to slide or to
    turn passes if it does so somewhere; with more freedom than a turn and two slides, and for a family that is known
    only by its directions, nothing is ruled out.

    Args:
        sensed: the sensed features.
        model: the part.
        found: its interpretations.
        tolerance: sd of the made surface against its CAD [m].
        radius: half the extent of the free translations in the prior [m].

    Returns:
        Which interpretations pass ``(F,)``, their poses ``(F, 4, 4)``, moved to where they do, and the log of the
        share of the free motions' extents in which they do ``(F,)``.
    """
    Ts = found.solution.T_world_part
    ok, poses, share = np.ones(len(Ts), dtype=bool), np.array(Ts), np.zeros(len(Ts))
    if not model.has_extent or not len(ok):
        return ok, poses, share
    free, n_free = free_projector(sensed, model, found.choices, radius)
    fixed, scale = np.flatnonzero(n_free == 0), pose_scale(radius, model.middle)
    ok[fixed] = _on_surface(sensed, model, found, fixed, Ts[fixed], tolerance)
    lengths, axes = np.linalg.eigh(free[:, :3, :3])
    slides = (lengths > _WHOLE).sum(axis=1)
    for (n_slides, n_turns), (turns, steps) in _SAMPLES.items():
        rows = np.flatnonzero((slides == n_slides) & (n_free - slides == n_turns))
        step = max(1, _CHUNK_POINTS // (10 * turns * steps))
        for some in (rows[k : k + step] for k in range(0, len(rows), step)):
            turned = _turned(Ts[some], free[some], axes[some, :, 3 - n_slides :], scale, turns)
            tried, lengths_ = _slid(sensed, model, found, some, turned, axes[some, :, 3 - n_slides :], steps)
            again = np.repeat(some, turns * steps)
            hopeful = np.repeat((lengths_ > 0).ravel(), steps)
            hit = np.zeros(len(again), dtype=bool)
            flat = tried.reshape(-1, 4, 4)[hopeful]
            hit[hopeful] = _on_surface(sensed, model, found, again[hopeful], flat, tolerance)
            on = hit.reshape(len(some), turns, steps)
            extent = np.mean(on.mean(axis=-1) * lengths_, axis=1) / (2 * radius) ** n_slides
            extent *= (2 * np.pi / (8 * np.pi**2) ** (1 / 3)) ** n_turns
            ok[some], poses[some] = _middle(on.reshape(len(some), -1), tried.reshape(len(some), -1, 4, 4))
            share[some] = np.log(np.maximum(extent, 1e-300))
    return ok, poses, share


def _middle(tried: BoolArray, Ts: Transforms) -> tuple[BoolArray, Transforms]:
    """Whether any try passes, and the pose in the middle of those that do."""
    order = np.cumsum(tried, axis=1)
    half = np.argmax(order >= (order[:, -1:] + 1) // 2, axis=1)
    return np.asarray(tried.any(axis=1), dtype=np.bool_), Ts[np.arange(len(Ts)), half]


def _turned(Ts: Transforms, free: FloatArray, axes: FloatArray, scale: FloatArray, turns: int) -> Transforms:
    """Poses ``(F, turns, 4, 4)`` turned about the free axis, if there is one."""
    if turns == 1:
        return Ts[:, None]
    slides = np.zeros_like(free)
    slides[:, :3, :3] = axes @ np.swapaxes(axes, -1, -2)
    xi = np.linalg.eigh(free - slides)[1][..., -1] @ scale.T
    xi /= np.linalg.norm(xi[:, 3:], axis=1, keepdims=True)
    angles = np.linspace(-np.pi, np.pi, turns, endpoint=False)
    return np.asarray(Ts[:, None] @ SE3.exp(angles[:, None] * xi[:, None]))


def _slid(
    sensed: Sensed,
    model: PartModel,
    found: Interpretations,
    rows: IntArray,
    Ts: Transforms,
    axes: FloatArray,
    steps: int,
) -> tuple[Transforms, FloatArray]:
    """Slide poses ``(F, turns, 4, 4)`` along the free axes ``(F, 3, k)``, part frame.

    Only where spheres about the faces can hold all points.

    Returns:
        Poses ``(F, turns, steps, 4, 4)``, and the length (area) of the range that they sample ``(F, turns)``.
    """
    T_part_world = SE3.inverse(Ts)
    shape = (*Ts.shape[:2], axes.shape[-1])
    low, high = np.full(shape, -np.inf), np.full(shape, np.inf)
    for i, kind in enumerate(sensed.kinds[: len(sensed)]):
        feature = sensed.features[i]
        if not len(feature.support) or kind not in model.candidates:
            continue
        chosen, _ = decode(found.choices[rows, i], model, kind)
        candidates = model.candidates[kind]
        at = SE3.apply(T_part_world[:, :, None], feature.support) @ axes[:, None]
        middle = np.einsum("fi,fik->fk", candidates.Ts_part_feature[chosen, :3, 3], axes)[:, None]
        reach = candidates.radii[chosen][:, None, None]
        paired = (chosen != NOTHING)[:, None, None]
        low = np.where(paired, np.maximum(low, at.max(axis=2) - middle - reach), low)
        high = np.where(paired, np.minimum(high, at.min(axis=2) - middle + reach), high)
    low, high = np.where(np.isfinite(low), low, 0.0), np.where(np.isfinite(high), high, 0.0)
    length = np.maximum(high - low, 0.0)
    at = _even(steps, axes.shape[-1]) * length[:, :, None] + low[:, :, None]
    out = np.repeat(Ts[:, :, None], steps, axis=2)
    out[..., :3, 3] += np.einsum("ftij,fjk,ftsk->ftsi", Ts[..., :3, :3], axes, at)
    return out, length.prod(axis=-1)


def _even(steps: int, k: int) -> FloatArray:
    """Points that fill the unit cube of ``k`` axes evenly ``(steps, k)``: midpoints, then Kronecker's sequence."""
    s = np.arange(steps) + 0.5
    return np.column_stack([s / steps, (s * (np.sqrt(5) - 1) / 2) % 1])[:, :k]


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
                sd = _pose_sd(found, rows[some])
                ok[some] &= _touches(sensed, row, model, chosen[some], Ts[some], sd, tolerance)
    return ok


def _touches(
    sensed: Sensed,
    row: int,
    model: PartModel,
    chosen: IntArray,
    Ts: Transforms,
    pose_sd: FloatArray,
    tolerance: float,
) -> BoolArray:
    """Whether the points of one view are on the surface, and the ball that touched there clear of the rest ``(F,)``."""
    feature = sensed.features[row]
    T_part_world = SE3.inverse(Ts)[:, None]
    local = SE3.apply(T_part_world, feature.support)
    room = GATE_SDS * np.sqrt(len(feature.support) * sensed.shift[row] ** 2 + tolerance**2 + pose_sd**2)
    nearest = model.surface.closest(local)
    ok = np.all(nearest.distances <= room, axis=-1)
    if sensed.kinds[row] == "plane":
        ok &= ~np.any(_beside(model, nearest.triangles, chosen[:, None]), axis=-1)
    if feature.tip_radius > 0 and sensed.kinds[row] == "plane":
        centres = local + feature.tip_radius * (T_part_world[..., :3, :3] @ sensed.directions[row])
        gap = model.surface.closest(centres).distances - feature.tip_radius
        ok &= np.all(np.abs(gap) <= room, axis=-1)
    return np.asarray(ok, dtype=np.bool_)


def _beside(model: PartModel, triangles: IntArray, chosen: IntArray) -> BoolArray:
    """Whether points whose nearest triangle is given lie on another face in the plane of the chosen one."""
    levels, plane_of_face = _levels(model)
    assert model.part is not None
    nearest = plane_of_face[model.part.triangle_face[triangles]]
    return (nearest >= 0) & (nearest != chosen) & (levels[nearest] == levels[chosen])


def _levels(model: PartModel) -> tuple[IntArray, IntArray]:
    """A number for each plane, the same for faces in one plane; and the plane of each face, -1 if it is curved."""
    if not model.levels:
        assert model.part is not None
        planes, n = model.part.planes, len(model.part.planes)
        gap = np.einsum("ai,abi->ab", planes.normals, planes.centroids[None] - planes.centroids[:, None])
        same = (planes.normals @ planes.normals.T > 1 - _MEMBERSHIP**2) & (np.abs(gap) < _MEMBERSHIP * model.radius)
        plane_of_face = np.full(len(model.part.faces), -1)
        plane_of_face[planes.faces] = np.arange(n)
        model.levels.extend([np.argmax(same, axis=1), plane_of_face])
    return model.levels[0], model.levels[1]


def _pose_sd(found: Interpretations, rows: IntArray) -> FloatArray:
    """Standard deviation of the position that the pose itself leaves ``(F, 1)`` [m]; free directions are skipped."""
    values = np.linalg.eigvalsh(found.solution.information[rows, :3, :3])
    return np.asarray(1 / np.sqrt(np.maximum(values[:, 0], 1e-2 * values[:, -1]))[:, None])
