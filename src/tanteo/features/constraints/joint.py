"""Test all relations that depend on one unknown pose jointly, at once or incrementally (``math.md`` section 9).

Pairings give ``f + H xi + noise = 0`` with unknown pose error ``xi``. The residual of ``f`` at the best ``xi`` is
chi-square distributed. It equals the Mahalanobis distance of a complete set of constraints that do not depend on the
pose. Unlike pairwise angles and distances, it detects mirror images and offsets.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.errors import CovarianceError
from tanteo.features.constraints.gates import chi2_p_value
from tanteo.geometry.typing import Covariances, FloatArray

_RANK = 1e-10


@dataclass(frozen=True, slots=True, eq=False)
class JointTest:
    """Residual of stacked relations at the best pose.

    Attributes:
        D2: joint squared Mahalanobis distance, ``D_J^2``.
        dof: number of equations minus the rank of ``H``.
        xi: best pose error ``(k,)``; the shortest one if some directions are free.
        information: ``H' S^-1 H`` ``(k, k)``.
        p_value: probability of a larger ``D2``; 1 without degrees of freedom.
    """

    D2: float
    dof: int
    xi: FloatArray
    information: FloatArray
    p_value: float


def joint_test(f: FloatArray, H: FloatArray, S: Covariances) -> JointTest:
    """Return the joint test ``min over xi of (f + H xi)' S^-1 (f + H xi)``.

    Args:
        f: residuals ``(m,)``; rows may mix m and rad.
        H: derivatives of the residuals by the pose error ``(m, k)``.
        S: covariance of the residuals ``(m, m)``, with the blocks of shared errors, positive definite.

    Raises:
        CovarianceError: ``S`` is not positive definite.
    """
    whiten = _whitening(S)
    return whitened_test(whiten @ f, whiten @ H)


def whitened_test(g: FloatArray, G: FloatArray) -> JointTest:
    """Return :func:`joint_test` from whitened residuals and derivatives.

    Shared errors may be additional unknowns, with rows that state their prior. The statistic is the same, without a
    joint covariance of all residuals.

    Args:
        g: whitened residuals ``(m,)``.
        G: whitened derivatives ``(m, k)``.
    """
    scale = np.linalg.norm(G, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    U, s, Vt = np.linalg.svd(G / scale, full_matrices=False)
    rank = int(np.count_nonzero(s > _RANK * s[0])) if len(s) and s[0] > 0 else 0
    U = U[:, :rank]
    s = s[:rank]
    Vt = Vt[:rank]
    along = U.T @ g
    rest = g - U @ along
    rest = rest - U @ (U.T @ rest)  # repeated projection: the residual may be far smaller than f
    D2 = float(rest @ rest)
    dof = len(g) - rank
    return JointTest(D2, dof, -(Vt.T @ (along / s)) / scale, G.T @ G, _p_value(D2, dof))


def joint_update(first: JointTest, f: FloatArray, H: FloatArray, S: Covariances) -> JointTest:
    """Add relations that are independent of the first ones, as at one node of an interpretation tree.

    ``D_J^2`` grows by ``r' (S + H L^-1 H')^-1 r`` with ``r = f + H xi`` (``math.md`` section 9).

    Args:
        first: previous test; its information must have full rank.
        f: new residuals ``(m,)``, at the same pose as the first ones.
        H: derivatives of the new residuals ``(m, k)``.
        S: covariance of the new residuals ``(m, m)``.

    Raises:
        CovarianceError: the previous information is singular; use :func:`joint_test` on all rows.
    """
    try:
        LHt = np.linalg.solve(first.information, H.T)
    except np.linalg.LinAlgError:
        raise CovarianceError(
            "information: expected full rank before relations are added, got a singular matrix. Use joint_test."
        ) from None
    r = f + H @ first.xi
    w = np.linalg.solve(S + H @ LHt, r)
    D2 = first.D2 + float(r @ w)
    dof = first.dof + len(f)
    G = _whitening(S) @ H
    return JointTest(D2, dof, first.xi - LHt @ w, first.information + G.T @ G, _p_value(D2, dof))


def laplace_log_evidence(
    chi2: FloatArray, log_det: FloatArray, equations: FloatArray, information: FloatArray, log_prior: FloatArray | float
) -> FloatArray:
    """Return the log density of all residuals with the pose integrated out by Laplace's method (``math.md`` 10).

    Args:
        chi2: joint statistic at the best pose ``(*batch,)``.
        log_det: sum of ``log |S|`` over the pairings ``(*batch,)``.
        equations: number of scalar residuals ``(*batch,)``.
        information: information on the pose at the best pose, positive definite ``(*batch, k, k)``.
        log_prior: log density of the pose at the best pose; ``-log(8 pi^2 V)`` for any attitude and a volume ``V``.
    """
    k = information.shape[-1]
    volume = 0.5 * (k * np.log(2 * np.pi) - np.linalg.slogdet(information)[1])
    return -0.5 * (equations * np.log(2 * np.pi) + log_det + chi2) + log_prior + volume


def _p_value(D2: float, dof: int) -> float:
    return float(chi2_p_value(np.asarray(D2), dof)) if dof else 1.0


def _whitening(S: Covariances) -> FloatArray:
    sd = np.sqrt(np.diag(S))
    try:
        L = np.linalg.cholesky(S / np.outer(sd, sd))
    except np.linalg.LinAlgError:
        raise CovarianceError(
            "S: expected a positive definite covariance of the residuals, got a singular one. "
            "Remove residuals that follow from the others."
        ) from None
    return np.linalg.solve(L, np.diag(1 / sd))
