"""Covariance of a mode: unobserved directions, shared errors, deviations of whole faces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from tanteo.factors import ContactPoints
from tanteo.fitting.localization import covariance_with_free, pose_information, weak_motions
from tanteo.geometry import SO3
from tanteo.geometry.typing import Covariances, FloatArray, Tangents
from tanteo.posterior.answers.part_motions import part_scale, symmetry_motions, without_symmetry
from tanteo.posterior.fit_at_mode import GoodnessOfFit
from tanteo.sensors.error_states import UnstatedError, smooth_correlation


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
        return covariance, _bounded(known, covariance)
    if len(weak_motions(whole, scale, fixed=symmetry_motions(part))) > len(one.free):
        return covariance, covariance  # only the samples constrain it, and they do not separate pose and shared errors
    # the samples correct the curvature by the same factor, whether the shared errors are known or not
    curved = _with_free(None, whole, one.free, scale)
    given = _with_free(None, known, one.free, scale)
    return covariance, given * min(_times(curved, covariance), _times(given, covariance))


def _bounded(information: FloatArray, covariance: Covariances) -> Covariances:
    """Return the inverse information, at most a covariance in every direction, as a conditional covariance is."""
    variances, axes = np.linalg.eigh(covariance)
    L = axes * np.sqrt(variances.clip(0))
    values, vectors = np.linalg.eigh(L.T @ information @ L)
    root = L @ (vectors / np.sqrt(np.maximum(values, 1.0)))
    return np.asarray(root @ root.T)


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
    """Return the covariance that deviations within faces add, with shared errors estimated and given.

    The estimate weights points as if their deviations of sd ``tolerance`` were independent. A made face is not flat:
    it bends and tilts, so near points have similar deviations. For that estimator a smooth deviation of each face with
    correlation ``R`` adds ``A^-1 J' W (R - I) W J A^-1`` to the covariance ``(6, 6)``. The correlation length is half
    of the extent of the points on the face. The first is with the shared errors estimated beside the pose, the second
    with these known.
    """
    if points.tolerance == 0:
        return np.zeros((6, 6)), np.zeros((6, 6))
    at, J, constrained = one.at, _derivatives(points, one), _constrained(one)
    weighted = J * (at.inlier_probability[0] * points.tolerance * at.per_sd[0] ** 2)[:, None]
    extra = np.zeros((J.shape[1], J.shape[1]))
    for face in np.unique(at.faces[0]):
        rows = np.flatnonzero(at.faces[0] == face)
        own = weighted[rows]
        extra += own.T @ (smooth_correlation(at.in_part[0][rows]) - np.eye(len(rows))) @ own
    shared_jacobian = (_inverse(A) for A in (constrained, constrained[:6, :6]))
    return _gained(next(shared_jacobian)[:6], extra), _gained(next(shared_jacobian), extra[:6, :6])


def _derivatives(points: ContactPoints, one: GoodnessOfFit) -> FloatArray:
    """Return the derivatives of the distances from the surface by all states ``(n, 6 + D)``."""
    mode, n, p = one.mode, one.at.normals[0], one.at.in_part[0]
    shared = np.einsum("ni,nid->nd", n @ mode.T_peak[:3, :3].T, points.shared_jacobian)
    J = np.concatenate([-n, SO3.cross(n, p), shared], axis=1)
    return np.pad(J, ((0, 0), (0, len(mode.information) - J.shape[1])))


def _constrained(one: GoodnessOfFit) -> FloatArray:
    """Return the information on all states, with motions that nothing constrains fixed."""
    rows = one.free @ np.linalg.inv(part_scale(one.mode.prepared.part))
    out = np.array(one.mode.information)
    out[:6, :6] += 1e9 * np.abs(out).max() * rows.T @ rows
    return out


@dataclass(frozen=True, slots=True, eq=False)
class PoseMoves:
    """Errors of a pose that its covariance does not contain, as a mixture over models of unstated errors.

    In model ``k`` the true pose is the estimated one moved by ``offsets[k]``, plus ``factors[k]`` times an error by the
    covariance of the pose, plus a normal error of covariance ``covariances[k]``.

    Attributes:
        weights: probabilities of the models ``(K,)``.
        factors: factors on the standard deviations of the pose ``(K,)``.
        offsets: means of the errors, part frame ``(K, 6)`` [m, rad].
        covariances: covariances of the errors about them ``(K, 6, 6)``.
    """

    weights: FloatArray
    factors: FloatArray
    offsets: Tangents
    covariances: Covariances

    @classmethod
    def none(cls) -> PoseMoves:
        """Return one model without further errors."""
        return cls(np.ones(1), np.ones(1), np.zeros((1, 6)), np.zeros((1, 6, 6)))

    def plus(self, covariance: Covariances) -> PoseMoves:
        """Return the same models with a further error.

        Args:
            covariance: covariance of the further error ``(6, 6)``.
        """
        return replace(self, covariances=self.covariances + covariance)

    def widen(self, covariance: Covariances) -> Covariances:
        """Return the mean square error of the pose over all models ``(6, 6)``.

        Args:
            covariance: covariance of the pose in the model without unstated errors ``(6, 6)``.
        """
        square = float(self.weights @ self.factors**2)
        off = np.einsum("k,ki,kj->ij", self.weights, self.offsets, self.offsets)
        return np.asarray(square * covariance + np.tensordot(self.weights, self.covariances, 1) + off)


def unstated_moves(points: ContactPoints, one: GoodnessOfFit, errors: Sequence[UnstatedError]) -> PoseMoves:
    """Return the errors of the pose by unstated errors of the measurements.

    The pose stays that of the model without these errors, as for a consider parameter (Schmidt 1966). Its error is that
    of models with errors of several sizes, weighted by their evidence (Hoeting et al. 1999). All models are linear at
    the maximum, and the noise scale is integrated in each.

    Args:
        points: the measurements.
        one: the mode.
        errors: the errors with the prior of their sizes.
    """
    if not errors or not one.inliers.any():
        return PoseMoves.none()
    mode, at, scale = one.mode, one.at, one.misfit()
    root = np.sqrt(at.inlier_probability[0]) * one.per_stated_sd
    J, residuals = _derivatives(points, one) * root[:, None], -at.distances[0] * root
    there = at.normals[0] @ mode.T_peak[:3, :3].T
    columns = [np.einsum("ni,nid->nd", there * root[:, None], error.columns(one.inliers)) for error in errors]
    G = np.concatenate(columns, axis=1)
    A = _constrained(one) * float(np.median(one.per_stated_sd / at.per_sd[0])) ** 2  # for noise as stated
    A += _positive(J.T @ J - A)
    inverse, B, b = _inverse(A), J.T @ G, J.T @ residuals
    models = _Models(
        _positive(G.T @ G - B.T @ inverse @ B),  # by rounding it may be indefinite
        G.T @ residuals - B.T @ inverse @ b,
        float(residuals @ residuals - b @ inverse @ b),
        max(scale.noise_dof + one.states_from_priors(np.zeros((0, 6))), 0.0),
        scale.log_factor,
    )
    gain, counts = -inverse[:6] @ B, [c.shape[1] for c in columns]
    choices = list(product(*(e.sizes.items() for e in errors)))
    sizes = np.array([np.zeros(len(B.T)), *(np.repeat([size for size, _ in one], counts) for one in choices)])
    logs, squares, means, spreads = models.at(sizes)  # the first is without errors
    log_p = logs[1:] + [sum(np.log(share) for _, share in one) for one in choices]
    weights = np.exp(log_p - log_p.max())
    return PoseMoves(
        weights / weights.sum(), np.sqrt(squares[1:] / squares[0]), means[1:] @ gain.T, gain @ spreads[1:] @ gain.T
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Models:
    """Linear models of the residuals, with the pose and the stated errors eliminated.

    Attributes:
        information: information on the states of the errors for noise as stated ``(d, d)``.
        pull: product of their columns and the residuals ``(d,)``.
        squares: sum of the squared residuals.
        dof: number of residuals less the states that they determine.
        log_factor: log of the factor to which the noise is known.
    """

    information: FloatArray
    pull: FloatArray
    squares: float
    dof: float
    log_factor: float

    def at(self, sizes: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return log-evidence, mean squared noise scale, mean and covariance of the states by model.

        The shapes are ``(K,)``, ``(K,)``, ``(K, d)`` and ``(K, d, d)``.

        Args:
            sizes: standard deviations of the states over that of the noise ``(K, d)``.
        """
        both = sizes[:, :, None] * sizes[:, None]
        precision = np.eye(sizes.shape[1]) + both * self.information
        spread = both * np.linalg.inv(precision)
        means = spread @ self.pull
        squares = np.maximum(self.squares - means @ self.pull, 0.0)
        z = np.linspace(-4.0, 4.0, 41)
        s = np.exp(self.log_factor * z)
        logs = -(z**4) / 16 - self.dof * self.log_factor * z - 0.5 * squares[:, None] / s**2
        top = logs.max(axis=1)
        weights = np.exp(logs - top[:, None])
        square = weights @ s**2 / weights.sum(axis=1)
        log = top + np.log(weights.sum(axis=1)) - 0.5 * np.linalg.slogdet(precision)[1]
        return log, square, means, square[:, None, None] * spread


def _positive(A: FloatArray) -> FloatArray:
    """Return a symmetric matrix without its negative eigenvalues."""
    values, vectors = np.linalg.eigh(A)
    return np.asarray((vectors * values.clip(0.0)) @ vectors.T, dtype=np.float64)


def _inverse(A: FloatArray) -> FloatArray:
    """Return the inverse of an information matrix; directions without information get no variance."""
    size = np.sqrt(np.maximum(np.diag(A), 1e-15 * max(float(np.diag(A).max()), 1e-300)))
    return np.asarray(np.linalg.pinv(A / np.outer(size, size), rcond=1e-9, hermitian=True) / np.outer(size, size))


def _gained(gain: FloatArray, extra: FloatArray) -> Covariances:
    """Return ``gain extra gain'`` without its negative eigenvalues."""
    return _positive(gain @ extra @ gain.T)
