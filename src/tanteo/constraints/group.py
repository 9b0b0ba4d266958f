"""Pairs of two shapes on their way into the table: their numbers, and the tests that decide what they have."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tanteo.constraints.angle import angle_bias
from tanteo.constraints.constraint import ConstraintColumn, ConstraintKind
from tanteo.constraints.relative import Relative
from tanteo.constraints.stacking import FeatureArrays, PairPlan
from tanteo.typing import BoolArray, Covariances, FloatArray

PARALLEL_ALPHA = 1e-4
"""Rejected share of truly parallel pairs: the pruning level of ``math.md`` section 9."""
_PARALLEL_LIMIT = -2 * float(np.log(PARALLEL_ALPHA))  # of chi-square with two degrees of freedom
RESOLUTION = 1e-6
"""Tilt [rad] below which directions count as equal even if both features are known exactly (model features)."""


class Group:
    """Pairs of two shapes, with their geometry, values and covariances; makes columns."""

    __slots__ = ("S", "arrays", "b", "n", "no", "pair", "pairs", "part", "plan", "value", "yes", "zero")

    def __init__(
        self,
        arrays: FeatureArrays,
        plan: PairPlan,
        part: slice,
        pair: Relative,
        b: FloatArray,
        value: FloatArray,
        S: Covariances,
    ) -> None:
        self.arrays, self.plan, self.part, self.pair, self.b = arrays, plan, part, pair, b
        self.value, self.S, self.pairs = value, S, plan.pairs[part]
        self.n = len(value)
        self.zero = np.zeros((self.n, 6))
        self.no, self.yes = np.zeros(self.n, dtype=bool), np.ones(self.n, dtype=bool)

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
        flags, sentence = caution or (self.no, "")
        present = self.yes if present is None else present
        bias = self.zero[:, : kind.dof] if bias is None else bias
        return ConstraintColumn(kind, self.pairs, value, S, bias, present, flags, (sentence, reason))


def bent_pairs(group: Group, row: int) -> BoolArray:
    """Whether the angle is a valid linear quantity: ``sin(alpha) > 5 sigma`` (``math.md`` section 12)."""
    return np.sin(group.value[:, row]) > 5 * np.sqrt(group.S[:, row, row]) + RESOLUTION


def parallel_pairs(group: Group, row: int) -> BoolArray:
    """Whether the two tilts from ``row`` on pass the test of parallelism with 2 degrees of freedom."""
    v1, v2 = group.value[:, row], group.value[:, row + 1]
    S = group.S
    a, b, c = S[:, row, row] + RESOLUTION**2, S[:, row, row + 1], S[:, row + 1, row + 1] + RESOLUTION**2
    return c * v1 * v1 - 2 * b * v1 * v2 + a * v2 * v2 <= _PARALLEL_LIMIT * (a * c - b * b)


def angle_bias_of(group: Group, axis: int) -> FloatArray:
    """Bias of the angles of a group ``(n, 1)`` with shared errors, as :func:`tanteo.constraints.angle_bias`."""
    arrays, (first, second) = group.arrays, group.pairs.T
    C12 = None
    C1, C2 = arrays.C[first], arrays.C[second]
    if arrays.shared_jacobian is not None:
        A1, A2 = arrays.shared_jacobian[first], arrays.shared_jacobian[second]
        A1t, A2t = A1.swapaxes(1, 2), A2.swapaxes(1, 2)
        C1, C2, C12 = C1 + A1 @ arrays.shared @ A1t, C2 + A2 @ arrays.shared @ A2t, A1 @ arrays.shared @ A2t
    pair = Relative(group.pair.R[group.part], group.pair.p[group.part], group.pair.slide[group.part])
    return angle_bias(pair, axis, (C1, C2, C12))[:, None]


def length_of(v: FloatArray, S: Covariances) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Lengths of vectors ``(N, k)``, their variances, and the summed variance across them."""
    d = np.sqrt((v * v).sum(axis=1))
    u = v / np.where(d > 0, d, 1.0)[:, None]
    variance = (u[:, None] @ S @ u[..., None])[:, 0, 0]
    return d, variance, np.maximum(S.trace(axis1=1, axis2=2) - variance, 0.0)
