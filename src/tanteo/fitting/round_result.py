"""What a fit of a round feature gave, over batches: frames, sizes, covariances, gains, degrees of freedom."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.features import FeatureKind
from tanteo.fitting.estimate import Estimate
from tanteo.fitting.round_steps import Linear, RoundProblem, RoundState
from tanteo.lie import SE3
from tanteo.typing import BoolArray, Covariances, FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class RoundEstimate:
    """Fitted round features over batches.

    Attributes:
        fit: frames, with ``P`` and ``shared_jacobian`` over the kind's rows and then the size: one row more.
        size: radius [m] or half angle [rad] ``(*batch,)``.
        rival: size of another feature that fits about as well ``(*batch,)``; NaN if there is none.
        settled: whether the iteration came to rest ``(*batch,)``.
        condition: least eigenvalue of the information scaled to unit diagonal ``(*batch,)``: zero if the points leave
            something free.
    """

    fit: Estimate
    size: FloatArray
    rival: FloatArray
    settled: BoolArray
    condition: FloatArray


def finish(
    kind: FeatureKind, problem: RoundProblem, state: RoundState, at: Linear, rest: BoolArray, rival: FloatArray
) -> RoundEstimate:
    """The estimate at the state where a fit came to rest."""
    d = np.diagonal(at.information, axis1=-2, axis2=-1)
    unit = 1 / np.sqrt(np.where(d > 0, d, 1.0))
    values, vectors = np.linalg.eigh(at.information * unit[..., :, None] * unit[..., None, :])
    inverse = (vectors / np.maximum(values, 1e-14)[..., None, :]) @ np.swapaxes(vectors, -1, -2)
    P = inverse * unit[..., :, None] * unit[..., None, :]
    gains = -P[..., None, :, :] @ np.swapaxes(at.h, -1, -2) @ at.W @ at.G
    counts = _counts(problem, at)
    freedom = counts - np.einsum("...nij,...ji->...n", at.spent, P)
    standardised = np.sqrt(counts * at.each / np.maximum(freedom, 1e-9))
    full, gain = _with_row(kind, P, gains)
    T = SE3.from_parts(state.R, state.c)
    fit = Estimate(T, full, at.chi2, dof_of(problem, at), at.e, standardised, gain)
    return RoundEstimate(fit, state.s, rival, rest, values[..., 0])


def _counts(problem: RoundProblem, at: Linear) -> FloatArray:
    """Residuals of each point ``(n,)``: one, two on a rim, and two a sensed normal."""
    counts = np.full(at.each.shape[-1], float(at.e.shape[-1]))
    if problem.normal_sds is not None:
        counts += 2 * np.isfinite(problem.normal_sds.reshape(-1, len(counts))[0])  # one of a batch is as the others
    return counts


def dof_of(problem: RoundProblem, at: Linear) -> int:
    """Degrees of freedom: residuals and what is known beforehand, less the unknowns."""
    known = 0
    if problem.known_frame is not None:
        known = int(np.any(problem.known_frame[2] != 0, axis=-1).sum())
    unknown = at.information.shape[-1]
    return int(_counts(problem, at).sum()) - unknown + known + bool(problem.known_size)


def _with_row(kind: FeatureKind, P: Covariances, gains: FloatArray) -> tuple[Covariances, FloatArray]:
    """The row of the size, zero where it is given."""
    m = kind.size + 1
    if P.shape[-1] == m:
        return P, gains
    full, gain = np.zeros((*P.shape[:-2], m, m)), np.zeros((*gains.shape[:-2], m, 3))
    full[..., :-1, :-1], gain[..., :-1, :] = P, gains
    return full, gain
