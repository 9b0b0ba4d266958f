"""Initial poses from pairings in closed form: rotation from directions, then translation from offsets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from tanteo.fitting.localization.relations import Relation
from tanteo.fitting.localization.solve import Block
from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import FloatArray, Transforms

_MAX_FLIPPED = 6


def first_pose(blocks: Sequence[Block]) -> Transforms:
    """Return an initial pose ``(*batch, 4, 4)`` for pairings whose directions and points fix the rotation.

    Directions are normals and axes with the signs of the frames; two or more vertices add the directions from their
    mean. Along free directions the pose is one of many possible ones.
    """
    sensed, model, weights = _directions(blocks)
    R = SO3.align(model, sensed, weights)
    return SE3.from_parts(R, place(blocks, R))


def _directions(blocks: Sequence[Block]) -> tuple[FloatArray, FloatArray, FloatArray]:
    sensed, model, weights = [], [], []
    for block in blocks:
        a, b = block.relation.sensed.axis, block.relation.model.axis
        if _of_points(block.relation):
            u, v, w = _from_mean(block)
        elif a is None or b is None or a != b:
            continue
        else:
            u, v = block.Ts_world_feature[..., :3, a], block.Ts_part_model[..., :3, b]
            w = block.active.astype(np.float64)
        shape = np.broadcast_shapes(u.shape[:-1], v.shape[:-1], w.shape)
        sensed.append(np.broadcast_to(u, (*shape, 3)))
        model.append(np.broadcast_to(v, (*shape, 3)))
        weights.append(np.broadcast_to(w, shape))
    if not sensed:
        batch = np.broadcast_shapes(*(b.active.shape[:-1] for b in blocks)) if blocks else ()
        empty = np.zeros((*batch, 0, 3))
        return empty, empty, np.zeros((*batch, 0))
    return np.concatenate(sensed, axis=-2), np.concatenate(model, axis=-2), np.concatenate(weights, axis=-1)


def _same(relation: Relation) -> bool:
    """Return whether the relation pairs features of one kind."""
    return relation.sensed == relation.model


def _of_points(relation: Relation) -> bool:
    return _same(relation) and relation.model.shape == "point"


def _from_mean(block: Block) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return directions from the mean of the active points to each, weighted by squared length."""
    w = block.active.astype(np.float64)
    total = np.maximum(w.sum(axis=-1), 1.0)[..., None]
    spokes = []
    for Ts in (block.Ts_world_feature, block.Ts_part_model):
        p = Ts[..., :3, 3]
        spokes.append(p - ((w[..., None] * p).sum(axis=-2) / total)[..., None, :])
    size = np.linalg.norm(spokes[1], axis=-1).max(axis=-1, initial=1e-300)[..., None, None]
    return spokes[0] / size, spokes[1] / size, w


def place(blocks: Sequence[Block], R: FloatArray) -> FloatArray:
    """Return the translation ``(*batch, 3)`` for a given rotation, by least squares of all offset equations.

    Along free directions the means of sensed and model frames coincide, so the part is near the readings.
    """
    batch = R.shape[:-2]
    A, b, total, count = np.zeros((*batch, 3, 3)), np.zeros((*batch, 3)), np.zeros((*batch, 3)), np.zeros(batch)
    for block in blocks:
        rows = [i for i in range(3) if i in block.relation.model.rows and i in block.relation.sensed.rows]
        if not rows:
            continue
        axes = R[..., None, :, :] @ block.Ts_part_model[..., :3, rows]
        gap = block.Ts_world_feature[..., :3, 3] - SE3.apply(R[..., None, :, :], block.Ts_part_model[..., :3, 3])
        N = (axes @ np.swapaxes(axes, -1, -2)) * block.active[..., None, None]
        A += N.sum(axis=-3)
        b += (N @ gap[..., None])[..., 0].sum(axis=-2)
        total += (gap * block.active[..., None]).sum(axis=-2)
        count += block.active.sum(axis=-1)
    mean = total / np.maximum(count, 1)[..., None]
    return np.asarray(np.linalg.solve(A + 1e-9 * np.eye(3), (b + 1e-9 * mean)[..., None])[..., 0])


def first_poses(blocks: Sequence[Block]) -> Transforms:
    """Return initial poses ``(k, 4, 4)``: both directions of undirected lines; many rotations if none is fixed."""
    edges = [
        (b, i)
        for b, block in enumerate(blocks)
        if _same(block.relation) and block.relation.model.flip
        for i in range(block.active.shape[-1])
    ][:_MAX_FLIPPED]
    starts = []
    for flips in product((False, True), repeat=len(edges)):
        flipped = list(blocks)
        for (b, i), flip in zip(edges, flips, strict=True):
            if flip:
                Ts = np.array(flipped[b].Ts_part_model)
                Ts[i] = Ts[i] @ flipped[b].relation.model.symmetries[1]
                flipped[b] = replace(flipped[b], Ts_part_model=Ts)
        starts.append(first_pose(flipped))
    if _fixed_directions(blocks) < 2:
        starts += [SE3.from_parts(R, place(blocks, R)) for R in _rotations()]
    return np.stack(starts)


def _fixed_directions(blocks: Sequence[Block]) -> int:
    """Return the rank of the paired directions; two fix a rotation."""
    rows = [np.zeros((0, 3))]
    for block in blocks:
        relation = block.relation
        if _same(relation) and relation.model.axis is not None:
            rows.append(block.Ts_part_model[..., :3, relation.model.axis])
        elif _of_points(relation):
            p = block.Ts_part_model[..., :3, 3]
            rows.append(p[1:] - p[:1])
    D = np.concatenate(rows)
    norms = np.linalg.norm(D, axis=1, keepdims=True)
    D = D[norms[:, 0] > 0] / norms[norms[:, 0] > 0]
    return int(np.linalg.matrix_rank(D, tol=1e-3)) if len(D) else 0


def _rotations() -> FloatArray:
    """Return the 24 rotations of a cube, each also turned by 60 degrees about its diagonal: 48 uniform starts."""
    turns = [SO3.exp(np.array(w) * np.pi / 2) for w in product((-1, 0, 1, 2), repeat=3)]
    unique = {tuple(np.round(R @ Q, 3).ravel()): R @ Q for R in turns for Q in turns[:8]}
    cube = np.array([R for R in unique.values() if np.all(np.isclose(np.abs(R).max(axis=0), 1.0))])
    return np.concatenate([cube, SO3.exp(np.full(3, np.pi / 3 / np.sqrt(3))) @ cube])
