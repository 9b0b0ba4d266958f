"""Fuse several estimates of one frame by Gauss-Newton on SE(3) in information form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.errors import CovarianceError, InputError
from tanteo.geometry import se3 as SE3
from tanteo.geometry.covariances import symmetrised, unit_diagonal
from tanteo.geometry.levenberg_marquardt import maximize
from tanteo.geometry.typing import BoolArray, Covariances, FloatArray, Transforms
from tanteo.geometry.uncertain import UncertainFrame

_CONVERGED = 1e-12
"""Squared length of the last step at convergence, in standard deviations of the result."""
_ITERATIONS = 50
_SINGULAR = 1e-12


@dataclass(frozen=True, slots=True, eq=False)
class Fusion:
    """Result of :func:`fuse`.

    Attributes:
        frame: fused frame with its covariance.
        chi2: chi-square statistic of the estimates' disagreement ``(*batch,)``.
        dof: degrees of freedom of ``chi2``, ``6 (n - 1)``.
        converged: whether the iteration converged ``(*batch,)``; if not, the estimates differ by rotations too large to
            average, and the frame must not be used.
    """

    frame: UncertainFrame
    chi2: FloatArray
    dof: int
    converged: BoolArray


def fuse(estimates: UncertainFrame) -> Fusion:
    """Return the maximum-likelihood frame of independent estimates.

    It minimizes ``sum r_i' C_i^-1 r_i`` with ``r_i = log(T_i^-1 T)`` (Barfoot and Furgale 2014). Estimates that share
    an error (one robot base, one calibration) are not independent: fusing them here reduces the shared error wrongly.

    Args:
        estimates: ``T_a_b`` ``(*batch, n, 4, 4)`` with covariances ``(*batch, n, 6, 6)``; the last batch axis counts
            the estimates.

    Raises:
        InputError: there is no axis of estimates, or it is empty.
        CovarianceError: a covariance is singular, as those of features with free directions are.
    """
    if not estimates.batch or estimates.batch[-1] == 0:
        raise InputError(f"estimates: expected at least one along the last batch axis, got batch {estimates.batch}.")
    W = _information("estimates", estimates.C)

    def linearize(T: Transforms) -> tuple[FloatArray, FloatArray]:
        H, gradient, _ = _normal_equations(estimates.T, W, T)
        return H, -gradient

    start = estimates.T[..., 0, :, :]
    T, delta = maximize(start, linearize, lambda T, step: T @ SE3.exp(step), _ITERATIONS, _CONVERGED)
    H, _, chi2 = _normal_equations(estimates.T, W, T)
    frame = UncertainFrame(T, _information("fused", H))
    return Fusion(frame, chi2, 6 * (estimates.batch[-1] - 1), delta < _CONVERGED)


def _normal_equations(Ts: Transforms, W: FloatArray, T: Transforms) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return information ``H``, gradient and chi-square at ``T``, with ``d r_i = Jr^-1(r_i) delta``."""
    r = SE3.log(SE3.inverse(Ts) @ T[..., None, :, :])
    J = SE3.right_jacobian_inverse(r)
    JW = np.swapaxes(J, -1, -2) @ W
    Wr = np.einsum("...ij,...j->...i", W, r)
    gradient = np.einsum("...nij,...nj->...i", np.swapaxes(J, -1, -2), Wr)
    return np.sum(JW @ J, axis=-3), gradient, np.einsum("...ni,...ni->...", r, Wr)


def _information(name: str, C: Covariances) -> FloatArray:
    """Return the inverses of positive definite matrices.

    Raises:
        CovarianceError: a matrix is singular to rounding.
    """
    unit, d = unit_diagonal(C)
    if np.all(d > 0) and np.linalg.eigvalsh(unit).min(initial=1.0) > _SINGULAR:
        return symmetrised(np.linalg.inv(unit) / (d[..., :, None] * d[..., None, :]))
    raise CovarianceError(
        f"{name}: expected positive definite covariances, got a singular one. Give every direction a variance, or"
        " locate from features, which may leave directions free."
    )
