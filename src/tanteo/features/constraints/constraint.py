"""Define a constraint, and the table of all constraints between a set of features."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from tanteo.errors import InputError
from tanteo.features.constraints.gates import chi2_p_value, chi2_statistic
from tanteo.geometry.typing import BoolArray, Covariances, FloatArray, IntArray


@dataclass(frozen=True, slots=True)
class ConstraintKind:
    """Kind of constraints.

    Attributes:
        name: name in lower case.
        units: unit of each value, ``m`` or ``rad``.
        meaning: description of the value.
        null: whether the true value is zero if the stated condition holds (coplanar, parallel).
    """

    name: str
    units: tuple[str, ...]
    meaning: str
    null: bool = False

    @property
    def dof(self) -> int:
        """Degrees of freedom of the chi-square test."""
        return len(self.units)


@dataclass(frozen=True, slots=True, eq=False)
class Constraint:
    """Measured relation between two features (three for a length, one for a size).

    Attributes:
        kind: kind of the constraint.
        labels: labels of the features, the first one first.
        value: values ``(m,)`` in the units of the kind.
        covariance: first-order covariance ``(m, m)``, with shared errors treated exactly.
        bias: second-order mean error of the value ``(m,)``, to be subtracted if it matters (``math.md`` section 12).
        caution: warning sentence about the value; empty if there is none.
    """

    kind: ConstraintKind
    labels: tuple[str, ...]
    value: FloatArray
    covariance: Covariances
    bias: FloatArray
    caution: str = ""

    @property
    def dof(self) -> int:
        """Degrees of freedom of the chi-square test."""
        return self.kind.dof

    def distance2(self, model: FloatArray | float = 0.0) -> FloatArray:
        """Return the squared Mahalanobis distance to values in the model, (25) and its joint form ``(*batch,)``.

        Args:
            model: values in the model ``(*batch, m)``.
        """
        return chi2_statistic(np.asarray(model, dtype=np.float64) - self.value, self.covariance)

    def p_value(self, model: FloatArray | float = 0.0) -> FloatArray:
        """Return the probability of a larger distance if the model's value is the true one ``(*batch,)``.

        Args:
            model: values in the model ``(*batch, m)``.
        """
        return chi2_p_value(self.distance2(model), self.dof)


@dataclass(frozen=True, slots=True, eq=False)
class ConstraintColumn:
    """All constraints of one kind in a set of features, as arrays.

    Attributes:
        kind: kind of the constraints.
        pairs: indices of the features ``(N, 2)``, planes before edges before axes before vertices.
        value: values ``(N, m)``.
        covariance: covariances ``(N, m, m)``.
        bias_source: bias ``(N, m)``, or a function that computes it when needed.
        present: mask of the pairs that have the constraint ``(N,)``; other rows are meaningless.
        caution: mask of the pairs to which ``cautions[0]`` applies ``(N,)``.
        cautions: warning for pairs with a caution, and reason why a pair is not present.
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
    """Constraint that a pair does not have, with the reason.

    Attributes:
        kind: kind of the constraint.
        labels: labels of the features.
        reason: reason for the absence, as a sentence.
    """

    kind: ConstraintKind
    labels: tuple[str, ...]
    reason: str


@dataclass(frozen=True, slots=True, eq=False)
class ConstraintTable:
    """All pairwise constraints of a set of features; iteration yields :class:`Constraint` values.

    Attributes:
        labels: labels of the features.
        columns: one column for each kind that a pair could have.
    """

    labels: tuple[str, ...]
    columns: tuple[ConstraintColumn, ...]

    def column(self, kind: str) -> ConstraintColumn:
        """Return the column of a kind.

        Args:
            kind: name of the kind.

        Raises:
            InputError: no pair of these features could have it; the message lists the kinds of the table.
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
        """Return the constraints that pairs do not have, with the reason, such as an angle of parallel edges."""
        return tuple(
            AbsentConstraint(column.kind, self._names(column, k), column.cautions[1])
            for column in self.columns
            for k in np.flatnonzero(~column.present).tolist()
        )

    def _names(self, column: ConstraintColumn, k: int) -> tuple[str, ...]:
        return tuple(self.labels[i] for i in column.pairs[k])
