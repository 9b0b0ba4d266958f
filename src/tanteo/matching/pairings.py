"""Interpretations as pairings that a pose is solved from: what each choice stands for, and blocks of the solver."""

from __future__ import annotations

import numpy as np

from tanteo.features import EDGE, PLANE, VERTEX
from tanteo.localization.relations import EDGE_DIRECTIONS, PLANE_DIRECTIONS, Relation, relation_between
from tanteo.localization.solve import Block
from tanteo.matching.freedom import NOTHING
from tanteo.matching.model import PartModel
from tanteo.matching.sensed import KINDS_IN_TREE, Sensed
from tanteo.typing import BoolArray, FloatArray, IntArray


def relation_of(kind: str, model: PartModel) -> Relation:
    """How a sensed feature of that kind is compared with its candidate."""
    if model.has_extent:
        k = {"plane": PLANE, "edge": EDGE, "vertex": VERTEX}[kind]
        return relation_between(k, k)
    return {"plane": PLANE_DIRECTIONS, "edge": EDGE_DIRECTIONS}[kind]


def decode(choices: IntArray, model: PartModel, kind: str) -> tuple[IntArray, IntArray]:
    """Candidate and view of each choice; :data:`NOTHING` is candidate ``NOTHING`` in view 0."""
    n = len(model.candidates[kind])
    nothing = choices == NOTHING
    return np.where(nothing, NOTHING, choices % n), np.where(nothing, 0, choices // n)


def build(sensed: Sensed, model: PartModel, choices: IntArray, tolerance: float) -> list[Block]:
    """The pairings of a batch of interpretations as solver blocks."""
    blocks = []
    for kind in KINDS_IN_TREE:
        members = [i for i in range(len(sensed)) if sensed.kinds[i] == kind]
        if not members or kind not in model.candidates:
            continue
        candidates = model.candidates[kind]
        chosen, view = decode(choices[:, members], model, kind)
        rows = np.array([(*sensed.views[i], i)[:2] for i in members])
        seen = rows[:, 0] if not view.any() else rows[np.arange(len(members)), view]
        Ts, Ps, gains = _stacked(sensed, kind)
        sd = tolerance * candidates.tolerance_scale[chosen]
        blocks.append(
            Block(
                relation_of(kind, model),
                Ts[seen],
                Ps[seen],
                candidates.Ts_part_feature[chosen],
                sd[..., None] * sd[..., None, :] * np.eye(sd.shape[-1]) if tolerance else np.zeros((1, 1, 1)),
                gains[seen],
                np.zeros(len(members)),
                chosen != NOTHING,
            )
        )
    return blocks


def self_pairings(sensed: Sensed, model: PartModel, kept: BoolArray) -> list[Block]:
    """Every kept sensed feature ``(F, n)`` paired with itself: the geometry of a perfect match at the identity."""
    blocks = []
    for kind in KINDS_IN_TREE:
        members = [i for i in range(len(sensed)) if sensed.kinds[i] == kind]
        if not members or kind not in model.candidates:
            continue
        Ts, Ps, gains = (array[members] for array in _stacked(sensed, kind))
        blocks.append(
            Block(
                relation_of(kind, model),
                Ts,
                Ps,
                np.broadcast_to(Ts, (len(kept), *Ts.shape)),
                np.zeros((1, 1, 1)),
                gains,
                np.zeros(len(members)),
                kept[:, members],
            )
        )
    return blocks


def _stacked(sensed: Sensed, kind: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Frames, covariances and gains of all views of one kind, at their rows (others are zero)."""
    rows = [i for i, k in enumerate(sensed.kinds) if k == kind]
    size, D = sensed.gains[rows[0]].shape
    Ts, Ps, gains = (np.zeros((len(sensed.kinds), *shape)) for shape in ((4, 4), (size, size), (size, D)))
    for i in rows:
        Ts[i], Ps[i], gains[i] = sensed.features[i].T_world_feature, sensed.features[i].P, sensed.gains[i]
    return Ts, Ps, gains
