"""Covariance of a mode: unobserved directions, shared errors, deviations of whole faces."""

from __future__ import annotations

import numpy as np

from tanteo.factors import ContactPoints
from tanteo.fitting.localization import covariance_with_free, pose_information, weak_motions
from tanteo.geometry import SO3
from tanteo.geometry.typing import Covariances, FloatArray, Tangents
from tanteo.posterior.answers.part_motions import part_scale, symmetry_motions, without_symmetry
from tanteo.posterior.fit_at_mode import GoodnessOfFit


def mode_covariances(one: GoodnessOfFit) -> tuple[Covariances, Covariances | None]:
    """Return the pose covariance ``(6, 6)``, uniform along unobserved motions, and that given the shared errors."""
    mode, part = one.mode, one.mode.prepared.part
    scale = part_scale(part)
    whole = without_symmetry(part, pose_information(mode.information))
    covariance = _with_free(mode.covariance if mode.ess > 1 else None, whole, one.free, scale)
    if not mode.objective.problem.points.shared_jacobian.shape[2]:
        return covariance, None
    known = without_symmetry(part, mode.information[:6, :6])
    if len(one.free) > len(symmetry_motions(part)):
        return covariance, _with_free(None, known, one.free, scale)
    if len(weak_motions(whole, scale, fixed=symmetry_motions(part))) > len(one.free):
        return covariance, covariance  # only the samples constrain it, and they do not separate pose and shared errors
    # the samples correct the curvature by the same factor, whether the shared errors are known or not
    curved = _with_free(None, whole, one.free, scale)
    given = _with_free(None, known, one.free, scale)
    return covariance, given * min(_times(curved, covariance), _times(given, covariance))


def _times(one: Covariances, other: Covariances) -> float:
    """Return the mean variance ratio of the second to the first over all motions that are not exact to rounding."""
    size = np.sqrt(np.diag(one).clip(1e-300))
    inverse = np.linalg.pinv(one / np.outer(size, size), rcond=1e-13, hermitian=True)
    return float(np.trace(inverse @ (other / np.outer(size, size)))) / 6


def _with_free(
    covariance: Covariances | None, information: FloatArray, free: Tangents, scale: FloatArray
) -> Covariances:
    if covariance is not None:
        to_unit = np.linalg.inv(scale)
        unit = to_unit @ covariance @ to_unit.T
        unit += 1e-10 * np.trace(unit) * np.eye(6)  # few samples agree in some directions
        information = to_unit.T @ np.linalg.inv(unit) @ to_unit
    out = covariance_with_free(information, free, scale)
    if np.diag(out).min() < 0:  # by rounding, of exact readings beside an unobserved direction
        values, vectors = np.linalg.eigh(out)
        out = np.asarray((vectors * values.clip(0)) @ vectors.T, dtype=np.float64)
    return out


def common_tolerance(points: ContactPoints, one: GoodnessOfFit) -> tuple[Covariances, Covariances]:
    """Return the covariance that deviations of whole faces add, with shared errors estimated and given.

    The estimate weights points as if their deviations were independent. For that estimator, points of one face with one
    deviation of sd ``tolerance`` add ``A^-1 J' W (one draw - many) W J A^-1`` to the covariance ``(6, 6)``. The first
    is with the shared errors estimated beside the pose, the second with these known.
    """
    if points.tolerance == 0:
        return np.zeros((6, 6)), np.zeros((6, 6))
    mode, at, part = one.mode, one.at, one.mode.prepared.part
    n, p, w, per_sd = at.normals[0], at.in_part[0], at.inlier_probability[0], at.per_sd[0]
    shared = np.einsum("ni,nid->nd", n @ mode.T_peak[:3, :3].T, points.shared_jacobian)
    J = np.concatenate([-n, SO3.cross(n, p), shared], axis=1)
    J = np.pad(J, ((0, 0), (0, len(mode.information) - J.shape[1])))
    weighted = J * (w * points.tolerance * per_sd**2)[:, None]
    rows = one.free @ np.linalg.inv(part_scale(part))
    constrained = np.array(mode.information)
    constrained[:6, :6] += 1e9 * np.abs(constrained).max() * rows.T @ rows
    extra = -weighted.T @ weighted
    for face in np.unique(at.faces[0]):
        together = weighted[at.faces[0] == face].sum(axis=0)
        extra = extra + np.outer(together, together)
    shared_jacobian = (_inverse(A) for A in (constrained, constrained[:6, :6]))
    return _gained(next(shared_jacobian)[:6], extra), _gained(next(shared_jacobian), extra[:6, :6])


def _inverse(A: FloatArray) -> FloatArray:
    """Return the inverse of an information matrix; directions without information get no variance."""
    size = np.sqrt(np.maximum(np.diag(A), 1e-300))
    return np.asarray(np.linalg.pinv(A / np.outer(size, size), rcond=1e-12, hermitian=True) / np.outer(size, size))


def _gained(gain: FloatArray, extra: FloatArray) -> Covariances:
    """Return ``gain extra gain'`` without its negative eigenvalues."""
    values, vectors = np.linalg.eigh(gain @ extra @ gain.T)
    return np.asarray((vectors * values.clip(0.0)) @ vectors.T)
