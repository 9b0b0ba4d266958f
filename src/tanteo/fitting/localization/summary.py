"""Covariance, distances of pairings, alternatives and shared errors of a solution."""

from __future__ import annotations

import numpy as np

from tanteo.features import SharedError
from tanteo.fitting.localization.solve import Block, Solution, linearize
from tanteo.geometry import SE3
from tanteo.geometry.typing import BoolArray, Covariances, FloatArray, Tangents, Transforms

_ROUNDING = 1e-15
"""Share of the largest information that is lost in it."""

_CLOSE_CHI2 = 9.21
"""Poses whose chi-square is within this of the best (1 % of two degrees of freedom) are alternatives."""


def covariance_with_free(information: FloatArray, N: Tangents, scale: FloatArray) -> Covariances:
    """Return the inverse information, with a uniform density over size or turn along the free directions ``N``.

    ``N`` are tangents over the ``scale`` of motions ``(6, 6)``, see :func:`motion_scale`.
    """
    A = scale.T @ information @ scale
    Q = np.linalg.qr(np.concatenate([N, np.eye(6)]).T)[0][:, len(N) : 6]
    try:
        observed = Q @ np.linalg.inv(Q.T @ A @ Q) @ Q.T
    except np.linalg.LinAlgError:  # all of it but one motion is exact, to rounding
        observed = Q @ np.linalg.pinv(Q.T @ A @ Q, rcond=_ROUNDING, hermitian=True) @ Q.T
    spread = np.where(np.linalg.norm(N[:, 3:], axis=1) > 1e-6, 2 * np.pi, 1.0) ** 2 / 12
    C = scale @ (observed + (N.T * spread) @ N) @ scale.T
    return 0.5 * (C + C.T)


def hold_motions(N: Tangents, scale: FloatArray, strength: float) -> FloatArray:
    """Return information ``(6, 6)`` of this strength along unobserved motions ``N``, so that steps avoid them."""
    rows = N @ np.linalg.inv(scale)
    return strength * rows.T @ rows


def wrong_side(block: Block, T_world_part: Transforms) -> BoolArray:
    """Return which plane pairings have opposite outward normals ``(*batch, n)``, which residuals do not show."""
    if block.relation.name != "plane_plane":
        return np.zeros((*T_world_part.shape[:-2], block.active.shape[-1]), dtype=np.bool_)
    model = np.einsum("...ij,...nj->...ni", T_world_part[..., :3, :3], block.Ts_part_model[..., :3, 2])
    return np.asarray(np.sum(model * block.Ts_world_feature[..., :3, 2], axis=-1) < 0, dtype=np.bool_)


def pairing_distances(blocks: list[Block], order: list[int], T: Transforms, z: FloatArray) -> FloatArray:
    """Return squared Mahalanobis distances of pairings under their own noise; infinite from the wrong side."""
    out, flat = np.zeros(len(order)), list[float]()
    for block in blocks:
        at = linearize(block, T, z)
        values = [float(f @ np.linalg.solve(S, f)) for f, S in zip(at.f, at.S, strict=True)]
        flat += list(np.where(wrong_side(block, T), np.inf, values))
    out[order] = flat
    return out


def alternatives(solution: Solution, best: int, covariance: Covariances) -> Transforms:
    """Return other poses ``(k, 4, 4)`` at which the fit converged with about the chi-square of the best, each once."""
    kept = [solution.T_world_part[best]]
    weight = np.linalg.inv(covariance)
    for i in np.argsort(solution.chi2):
        if solution.chi2[i] > solution.chi2[best] + _CLOSE_CHI2 or solution.steps[i] > 1e-6:
            continue
        gaps = SE3.log(SE3.inverse(np.stack(kept)) @ solution.T_world_part[i])
        if np.all(np.einsum("ki,ij,kj->k", gaps, weight, gaps) > 16.8):  # 1 % of six degrees of freedom
            kept.append(solution.T_world_part[i])
    return np.stack(kept)[1:]


def shared_estimates(
    z: FloatArray,
    information: FloatArray,
    N: Tangents,
    L: FloatArray,
    errors: tuple[SharedError, ...],
    scale: FloatArray,
) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Return posterior mean and sd of each shared error, with the free directions ``N`` fixed."""
    if not errors:
        return {}
    fixed = np.array(information)
    fixed[:6, :6] += hold_motions(N, scale, float(np.abs(information).max()))
    cross = np.linalg.solve(fixed[:6, :6], fixed[:6, 6:])
    covariance = np.linalg.inv(fixed[6:, 6:] - fixed[6:, :6] @ cross)
    c, sd = L @ z, np.sqrt(np.maximum(np.diag(L @ covariance @ L.T), 0.0))
    out, i = {}, 0
    for error in errors:
        n = len(error.covariance)
        out[error.name] = (c[i : i + n], sd[i : i + n])
        i += n
    return out
