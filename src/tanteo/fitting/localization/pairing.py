"""Pairings of sensed with model features, and their arrays for the solver."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tanteo.features import Feature, SharedError, collect_shared
from tanteo.features.kinds import FeatureKind
from tanteo.fitting.localization.relations import Relation, relation_between
from tanteo.fitting.localization.solve import Block
from tanteo.geometry.typing import Covariances, FloatArray, Transforms, Vectors


@dataclass(frozen=True, slots=True, eq=False)
class ModelFeature:
    """Feature of the part as designed.

    Attributes:
        kind: vertex, edge, plane or a curved kind.
        T_part_feature: its frame in the part ``(4, 4)``; edge frames point along either direction of the edge.
        P: tolerance of the made part over the kind's rows ``(size, size)`` [m, rad]; zero if not given.
        radius: radius of a cylinder, sphere or circle [m].
        name: name in reports.
        convex: True for a boss, False for a bore, None if unknown.
    """

    kind: FeatureKind
    T_part_feature: Transforms
    P: Covariances | None = None
    radius: float = 0.0
    name: str = ""
    convex: bool | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Pairing:
    """A sensed feature and the model feature with which it coincides, or on which it lies."""

    sensed: Feature
    model: ModelFeature

    @property
    def relation(self) -> Relation:
        """Return the relation of the pairing."""
        return relation_between(self.sensed.kind, self.model.kind)

    @property
    def other_side(self) -> bool:
        """Whether one is a boss and the other a bore: no pose makes them the same."""
        return None not in (self.sensed.convex, self.model.convex) and self.sensed.convex != self.model.convex


def build_blocks(pairings: Sequence[Pairing]) -> tuple[list[Block], FloatArray, tuple[SharedError, ...], list[int]]:
    """Return pairings as blocks for the solver.

    Returns:
        The blocks (one per relation), the factor ``L`` with shared error ``c = L z``, the shared errors, and the
        index of each block's pairings in the input, concatenated.
    """
    errors, C, shared_jacobian = collect_shared([pairing.sensed for pairing in pairings])
    values, vectors = np.linalg.eigh(C) if len(C) else (np.zeros(0), np.zeros((0, 0)))
    L = vectors * np.sqrt(np.maximum(values, 0.0))
    blocks, order = [], []
    for name in dict.fromkeys(pairing.relation.name for pairing in pairings):
        members = [i for i, pairing in enumerate(pairings) if pairing.relation.name == name]
        relation = pairings[members[0]].relation
        blocks.append(
            Block(
                relation,
                np.stack([pairings[i].sensed.T_world_feature for i in members]),
                np.stack([pairings[i].sensed.P for i in members]),
                np.stack([pairings[i].model.T_part_feature for i in members]),
                np.stack([_tolerance(pairings[i].model) for i in members]),
                np.stack([shared_jacobian[i] @ L for i in members]),
                np.array([pairings[i].model.radius for i in members]),
                np.ones(len(members), dtype=bool),
            )
        )
        order += members
    return blocks, L, errors, order


def _tolerance(model: ModelFeature) -> Covariances:
    return np.zeros((model.kind.size, model.kind.size)) if model.P is None else model.P


def model_length(pairings: Sequence[Pairing]) -> float:
    """Return the extent of the model features [m], or 0.1 if they have none, as the scale of rotations."""
    points = np.array([pairing.model.T_part_feature[:3, 3] for pairing in pairings])
    span = float(np.linalg.norm(np.ptp(points, axis=0))) if len(points) else 0.0
    return span if span > 0 else 0.1


def model_middle(pairings: Sequence[Pairing]) -> Vectors:
    """Return the middle of the model features in the part ``(3,)`` [m]; the part's origin may be far away."""
    points = np.array([pairing.model.T_part_feature[:3, 3] for pairing in pairings])
    return np.asarray(points.mean(axis=0)) if len(points) else np.zeros(3)
