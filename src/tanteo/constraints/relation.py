"""The registry of relations: what pairs of features of two shapes say, one entry a relation.

An entry states the shapes that meet, how many numbers it computes for a pair, the numbers with their partial
derivatives, and the constraints cut from them once their covariance is known.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tanteo.constraints.constraint import ConstraintColumn, ConstraintKind
from tanteo.constraints.relative import Relative
from tanteo.constraints.stacking import MEETINGS, FeatureArrays
from tanteo.errors import InputError
from tanteo.features import Shape
from tanteo.typing import BoolArray, Covariances, FloatArray, IntArray, Vectors

RESOLUTION = 1e-6
"""Tilt [rad] below which directions count as equal even if both features are known exactly (model features)."""


@dataclass(frozen=True, slots=True, eq=False)
class PairGroup:
    """Pairs of features of two shapes, with what a relation computed for them; makes columns.

    Attributes:
        pairs: indices of what meets in ``arrays`` ``(n, 2)``.
        pair: geometry of the second seen from the first.
        b: axis of the second in the first frame ``(n, 3)``.
        value: numbers of the relation ``(n, rows)``.
        S: their covariances ``(n, rows, rows)``.
        arrays: all aspects of the features.
    """

    pairs: IntArray
    pair: Relative
    b: Vectors
    value: FloatArray
    S: Covariances
    arrays: FeatureArrays

    def column(
        self,
        kind: ConstraintKind,
        value: FloatArray,
        S: Covariances,
        present: BoolArray | None = None,
        reason: str = "",
        caution: tuple[BoolArray, str] | None = None,
        bias: FloatArray | Callable[[], FloatArray] | None = None,
    ) -> ConstraintColumn:
        """A column of these pairs; without ``present`` every pair has the constraint."""
        n = len(self.pairs)
        flags, sentence = caution or (np.zeros(n, dtype=bool), "")
        present = np.ones(n, dtype=bool) if present is None else present
        bias = np.zeros((n, kind.dof)) if bias is None else bias
        return ConstraintColumn(kind, self.arrays.owner[self.pairs], value, S, bias, present, flags, (sentence, reason))


@dataclass(frozen=True, slots=True)
class PairRelation:
    """What two features of these shapes say together.

    Attributes:
        kinds: of the constraints, in the order of their columns.
        shapes: of the first and the second feature; a plane comes before a line, a line before an axis before a point.
        rows: how many numbers it computes for a pair.
        fill: ``(p, b, value, q, r)``: from the second origin ``p`` ``(n, 3)`` and its axis ``b`` (x of a line or an
            axis, z of a plane), both in the first frame, writes values ``(n, rows)`` and their partial derivatives
            ``q = d value / d p`` and ``r = d value / d b`` ``(n, rows, 3)``, which come as zeros.
        cut: the columns, from the values and their covariances ``S``.
    """

    kinds: tuple[ConstraintKind, ...]
    shapes: tuple[Shape, Shape]
    rows: int
    fill: Callable[[Vectors, Vectors, FloatArray, FloatArray, FloatArray], None]
    cut: Callable[[PairGroup], list[ConstraintColumn]]


CONSTRAINT_KINDS: dict[str, ConstraintKind] = {}
"""All kinds of constraint by name."""

PAIR_RELATIONS: dict[tuple[Shape, Shape], list[PairRelation]] = {shapes: [] for shapes in MEETINGS}
"""All relations by the shapes that meet."""


def register_relation(relation: PairRelation) -> None:
    """Let every pair of features of these shapes have the constraints of this relation.

    Raises:
        InputError: if the shapes are out of order, or a kind of constraint is there already.
    """
    if relation.shapes not in PAIR_RELATIONS:
        known = "; ".join(", ".join(shapes) for shapes in PAIR_RELATIONS)
        raise InputError(f"shapes: expected one of {known}, got {', '.join(relation.shapes)}. Exchange them.")
    for kind in relation.kinds:
        if kind.name in CONSTRAINT_KINDS:
            raise InputError(f"kind: expected a name of its own, got {kind.name!r}, which is taken. Choose another.")
    CONSTRAINT_KINDS.update({kind.name: kind for kind in relation.kinds})
    PAIR_RELATIONS[relation.shapes].append(relation)
