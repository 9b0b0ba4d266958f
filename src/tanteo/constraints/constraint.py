"""What one constraint says, and the table of all that a set of features says."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from tanteo.constraints.gates import chi2_p_value, chi2_statistic
from tanteo.errors import InputError
from tanteo.typing import BoolArray, Covariances, FloatArray, IntArray


@dataclass(frozen=True, slots=True)
class ConstraintKind:
    """What a constraint measures.

    Attributes:
        name: lower case.
        units: of each value, ``m`` or ``rad``.
        meaning: what the value is, in words.
        null: whether the truth is zero when the condition that it states holds (coplanar, parallel).
    """

    name: str
    units: tuple[str, ...]
    meaning: str
    null: bool = False

    @property
    def dof(self) -> int:
        """Degrees of freedom of its chi-square test."""
        return len(self.units)


@dataclass(frozen=True, slots=True, eq=False)
class Constraint:
    """What two (or, for a length, three) features say together.

    Attributes:
        kind: what it measures.
        labels: of the features, the first one first.
        value: ``(m,)`` in the units of the kind.
        covariance: ``(m, m)``, first order, shared errors included exactly.
        bias: second-order mean error of the value ``(m,)``; subtract it if it matters (``math.md`` section 12).
        caution: a sentence if the value needs care, else empty.
    """

    kind: ConstraintKind
    labels: tuple[str, ...]
    value: FloatArray
    covariance: Covariances
    bias: FloatArray
    caution: str = ""

    @property
    def dof(self) -> int:
        """Degrees of freedom of its chi-square test."""
        return self.kind.dof

    def distance2(self, model: FloatArray | float = 0.0) -> FloatArray:
        """Squared Mahalanobis distance to values in the model ``(*batch, m)``, (25) and its joint form."""
        return chi2_statistic(np.asarray(model, dtype=np.float64) - self.value, self.covariance)

    def p_value(self, model: FloatArray | float = 0.0) -> FloatArray:
        """Probability of a larger distance if the model's value is the true one."""
        return chi2_p_value(self.distance2(model), self.dof)


@dataclass(frozen=True, slots=True, eq=False)
class ConstraintColumn:
    """All constraints of one kind in a set of features, as arrays.

    Attributes:
        kind: what they measure.
        pairs: indices of the features ``(N, 2)``, planes before edges before axes before vertices.
        value: ``(N, m)``.
        covariance: ``(N, m, m)``.
        bias_source: the bias ``(N, m)``, or how to compute it: few need that of an angle.
        present: whether the pair has the constraint at all ``(N,)``; rows without are not to be read.
        caution: whether ``cautions[0]`` applies ``(N,)``.
        cautions: what a raised flag means, and why a pair is not present.
    """

    kind: ConstraintKind
    pairs: IntArray
    value: FloatArray
    covariance: Covariances
    bias_source: FloatArray | Callable[[], FloatArray]
    present: BoolArray
    caution: BoolArray
    cautions: tuple[str, str]

    def __len__(self) -> int:
        return len(self.pairs)

    @property
    def bias(self) -> FloatArray:
        """Second-order mean error of the values ``(N, m)`` (``math.md`` section 12)."""
        return self.bias_source() if callable(self.bias_source) else self.bias_source


@dataclass(frozen=True, slots=True, eq=False)
class AbsentConstraint:
    """A constraint that a pair does not have, and why."""

    kind: ConstraintKind
    labels: tuple[str, ...]
    reason: str


@dataclass(frozen=True, slots=True, eq=False)
class ConstraintTable:
    """All pairwise constraints of a set of features; iterate for :class:`Constraint` values.

    Attributes:
        labels: of the features.
        columns: one for each kind that some pair could have.
    """

    labels: tuple[str, ...]
    columns: tuple[ConstraintColumn, ...]

    def column(self, kind: str) -> ConstraintColumn:
        """The column of that kind.

        Raises:
            InputError: if no pair of these features could have it; the message lists the kinds there are.
        """
        for column in self.columns:
            if column.kind.name == kind:
                return column
        known = ", ".join(column.kind.name for column in self.columns) or "none"
        raise InputError(f"kind: expected one of those in the table ({known}), got {kind!r}.")

    def __len__(self) -> int:
        return sum(int(np.count_nonzero(column.present)) for column in self.columns)

    def __iter__(self) -> Iterator[Constraint]:
        for column in self.columns:
            bias = column.bias
            for k in np.flatnonzero(column.present).tolist():
                yield Constraint(
                    column.kind,
                    self._names(column, k),
                    column.value[k],
                    column.covariance[k],
                    bias[k],
                    column.cautions[0] if column.caution[k] else "",
                )

    def absent(self) -> tuple[AbsentConstraint, ...]:
        """What pairs do not say, with the reason: parallel where an angle was wanted, coincident, and so on."""
        return tuple(
            AbsentConstraint(column.kind, self._names(column, k), column.cautions[1])
            for column in self.columns
            for k in np.flatnonzero(~column.present).tolist()
        )

    def _names(self, column: ConstraintColumn, k: int) -> tuple[str, ...]:
        return tuple(self.labels[i] for i in column.pairs[k])
