"""Register the relations between pairs of features by their shapes.

An entry states the shapes, the number of values per pair, a function for the values with their partial derivatives, and
a function that makes constraints once their covariance is known.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tanteo.errors import InputError
from tanteo.features.constraints.constraint import ConstraintColumn, ConstraintKind
from tanteo.features.constraints.relative import Relative
from tanteo.features.constraints.stacking import MEETINGS, FeatureArrays
from tanteo.features.kinds import Shape
from tanteo.geometry.typing import BoolArray, Covariances, FloatArray, IntArray, Vectors

RESOLUTION = 1e-6
"""Tilt [rad] below which directions count as equal, even for exactly known features (model features)."""


@dataclass(frozen=True, slots=True, eq=False)
class PairGroup:
    """Pairs of features of two shapes, with the values of a relation.

    Attributes:
        pairs: indices of the aspects in ``arrays`` ``(n, 2)``.
        pair: geometry of the second in the frame of the first.
        b: axis of the second in the first frame ``(n, 3)``.
        value: values of the relation ``(n, rows)``.
        S: covariances of the values ``(n, rows, rows)``.
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
        """Return a column of constraints of these pairs.

        Args:
            kind: kind of the constraint.
            value: values ``(n, m)``.
            S: covariances ``(n, m, m)``.
            present: mask of the pairs that have the constraint ``(n,)``; None for all.
            reason: reason why a pair is not present, as a sentence.
            caution: mask of the pairs with a caution ``(n,)``, and its sentence; None for none.
            bias: second-order mean errors ``(n, m)``, or a function that computes them; None for zero.
        """
        n = len(self.pairs)
        flags, sentence = caution or (np.zeros(n, dtype=bool), "")
        present = np.ones(n, dtype=bool) if present is None else present
        bias = np.zeros((n, kind.dof)) if bias is None else bias
        return ConstraintColumn(kind, self.arrays.owner[self.pairs], value, S, bias, present, flags, (sentence, reason))


@dataclass(frozen=True, slots=True)
class PairRelation:
    """Relation between two features of given shapes.

    Attributes:
        kinds: kinds of its constraints, in the order of the columns.
        shapes: shapes of the first and the second feature; planes precede lines, axes and points in this order.
        rows: number of values per pair.
        fill: function ``(p, b, value, q, r)``. From the second origin ``p`` ``(n, 3)`` and its axis ``b`` (x of a line
            or an axis, z of a plane), both in the first frame, it writes values ``(n, rows)`` and their partial
            derivatives ``q = d value / d p`` and ``r = d value / d b`` ``(n, rows, 3)``, which are zero at the call.
        cut: function that makes the columns from the values and their covariances ``S``.
    """

    kinds: tuple[ConstraintKind, ...]
    shapes: tuple[Shape, Shape]
    rows: int
    fill: Callable[[Vectors, Vectors, FloatArray, FloatArray, FloatArray], None]
    cut: Callable[[PairGroup], list[ConstraintColumn]]


CONSTRAINT_KINDS: dict[str, ConstraintKind] = {}
"""All kinds of constraints by name."""

PAIR_RELATIONS: dict[tuple[Shape, Shape], list[PairRelation]] = {shapes: [] for shapes in MEETINGS}
"""All relations by the shapes of the pair."""


def register_relation(relation: PairRelation) -> None:
    """Register a relation for all pairs of features of its shapes.

    Args:
        relation: relation to register.

    Raises:
        InputError: the shapes are out of order, or a kind of constraint has the same name.
    """
    if relation.shapes not in PAIR_RELATIONS:
        known = "; ".join(", ".join(shapes) for shapes in PAIR_RELATIONS)
        raise InputError(f"shapes: expected one of {known}, got {', '.join(relation.shapes)}. Exchange them.")
    for kind in relation.kinds:
        if kind.name in CONSTRAINT_KINDS:
            raise InputError(f"kind: expected a name of its own, got {kind.name!r}, which is taken. Choose another.")
    CONSTRAINT_KINDS.update({kind.name: kind for kind in relation.kinds})
    PAIR_RELATIONS[relation.shapes].append(relation)
