"""Estimate the variance of stations about their planes, which grows with range and incidence.

Readings at one place differ by the noise of the device. Readings at different places differ by more: by the spot on an
oblique surface, steps in the device's scale, and the robot's pose. Only the second kind matters for a plane that was
sensed from several places, and repeats at one place do not average it. The estimate maximizes the restricted
likelihood.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import erfinv

from tanteo.geometry.typing import FloatArray
from tanteo.sensors.calibration.log import PlaneLog

TERMS = ("floor", "per range", "across")
"""Standard deviations of the place law: [m], per metre of range, per metre of range and tangent of the incidence."""

_LEAST = 1e-12
"""Smallest variance [m^2]: that of a micrometre, about the resolution of the numbers in a log."""

_LARGEST_DENSE = 1500
"""Largest number of stations for which the covariance of the variances takes the fit into account."""


@dataclass(frozen=True, slots=True, eq=False)
class PlaceLaw:
    """Noise law of the places for every device.

    Attributes:
        squares: squares of :data:`TERMS` for every device ``(k, 3)``.
    """

    squares: FloatArray

    def variances(self, log: PlaneLog, basis: FloatArray) -> FloatArray:
        """Return the variances of the stations' mean ranges, from place and repeats ``(m,)`` [m^2].

        Args:
            log: stations.
            basis: factors of the squares, see :func:`place_basis` ``(m, 3)``.
        """
        return np.maximum(np.sum(self.squares[log.of] * basis, axis=1) + repeat_variances(log), _LEAST)

    def moved(self, step: FloatArray) -> PlaceLaw:
        """Return the law after a step.

        Args:
            step: change of the logarithms of the squares ``(3 k,)``.
        """
        return PlaceLaw(self.squares * np.exp(step.reshape(self.squares.shape)))


def place_basis(ranges: FloatArray, incidences: FloatArray) -> FloatArray:
    """Return the factors of the squares of :data:`TERMS` ``(m, 3)``.

    Args:
        ranges: ranges ``(m,)`` [m].
        incidences: angles of incidence ``(m,)`` [rad].
    """
    d2 = ranges**2
    return np.stack([np.ones_like(d2), d2, d2 * np.tan(incidences) ** 2], axis=1)


def repeat_variances(log: PlaneLog) -> FloatArray:
    """Return the variances of the stations' means by the repeatability ``(m,)`` [m^2]; zero without repeats.

    Args:
        log: stations.
    """
    sigmas = np.stack([r.law.sigma(log.ranges) for r in log.repeats])
    return np.asarray(sigmas[log.of, np.arange(len(log))] ** 2 / log.counts)


def first_law(log: PlaneLog, residuals: FloatArray, basis: FloatArray, share: float) -> PlaceLaw:
    """Return a first law from a fraction of the smallest residuals, in three equal terms.

    A smaller fraction lets more stations begin as outliers.

    Args:
        log: stations.
        residuals: measured minus predicted ranges ``(m,)`` [m].
        basis: factors of the squares, see :func:`place_basis` ``(m, 3)``.
        share: fraction of the residuals.
    """
    squares = np.empty((len(log.devices), len(TERMS)))
    for k in range(len(log.devices)):
        mine = log.of == k
        quantile = math.sqrt(2) * float(erfinv(share))
        spread = max((np.quantile(np.abs(residuals[mine]), share) / quantile) ** 2, 1e-16)
        squares[k] = spread / len(TERMS) / np.maximum(np.mean(basis[mine], axis=0), 1e-9)
    return PlaceLaw(squares)


def law_step(
    law: PlaceLaw, log: PlaneLog, residuals: FloatArray, weights: FloatArray, basis: FloatArray, hat: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return one step of the logarithms of the squares up the restricted likelihood, and its curvature there.

    The step maximizes a minorizer of the likelihood (Zhou, Hu, Zhou and Lange 2019), so the squares stay positive.

    Args:
        law: variances of the places.
        log: stations.
        residuals: measured minus predicted ranges [m], ``(m,)``.
        weights: probabilities of the stations to be no outliers, ``(m,)``.
        basis: see :func:`place_basis`, ``(m, 3)``.
        hat: variances of the fitted ranges [m^2], ``(m,)``.
    """
    v = law.variances(log, basis)
    pull = weights * residuals**2 / v**2
    rest = np.maximum(weights / v - weights**2 * hat / v**2, 0.0)
    ratio, down = np.ones_like(law.squares), np.zeros_like(law.squares)
    for k in range(len(log.devices)):
        mine = log.of == k
        down[k] = rest[mine] @ basis[mine]
        np.divide(pull[mine] @ basis[mine], down[k], out=ratio[k], where=down[k] > 0)
    step = np.log(np.maximum(law.squares * np.sqrt(ratio), 1e-3 * _LEAST) / law.squares)
    return step.ravel(), (law.squares * down).ravel()


def law_cov(
    law: PlaceLaw, log: PlaneLog, weights: FloatArray, basis: FloatArray, jacobian: FloatArray, cov: FloatArray
) -> FloatArray:
    """Return the covariances of the squares by the expected information of the restricted likelihood ``(k, 3, 3)``.

    Args:
        law: noise law of the places.
        log: stations.
        weights: probabilities of the stations to be no outliers ``(m,)``.
        basis: factors of the squares, see :func:`place_basis` ``(m, 3)``.
        jacobian: derivatives of the ranges by the setup ``(m, size)``.
        cov: covariance of the setup ``(size, size)``.
    """
    v = law.variances(log, basis)
    out = np.empty((len(log.devices), len(TERMS), len(TERMS)))
    for k in range(len(log.devices)):
        mine = (log.of == k) & (weights > 0.5)
        B, inverse = basis[mine], 1 / v[mine]
        if mine.sum() <= _LARGEST_DENSE:
            scaled = inverse[:, None] * jacobian[mine]
            squared = (np.diag(inverse) - scaled @ cov @ scaled.T) ** 2
        else:
            squared = np.diag(inverse**2)
        information = 0.5 * B.T @ squared @ B
        # terms differ by powers of the range: scale before inverting
        s = 1 / np.sqrt(np.maximum(np.diag(information), 1e-300))
        out[k] = np.linalg.pinv(information * np.outer(s, s), rcond=1e-12, hermitian=True) * np.outer(s, s)
    return out


def with_noise_uncertain(
    law: PlaceLaw, log: PlaneLog, weights: FloatArray, basis: FloatArray, jacobian: FloatArray, cov: FloatArray
) -> FloatArray:
    """Return the covariance of the setup with the uncertainty of the estimated noise ``(size, size)``.

    The weights of the stations depend on the variances, which were estimated from the same residuals (Kenward and
    Roger, Biometrics 53, 1997; variances linear in their parameters).

    Args:
        law: noise law of the places.
        log: stations.
        weights: probabilities of the stations to be no outliers ``(m,)``.
        basis: factors of the squares, see :func:`place_basis` ``(m, 3)``.
        jacobian: derivatives of the ranges by the setup ``(m, size)``.
        cov: covariance of the setup for known noise ``(size, size)``.
    """
    v = law.variances(log, basis)
    W = law_cov(law, log, weights, basis, jacobian, cov)
    more = np.zeros_like(cov)
    for k in range(len(log.devices)):
        mine = log.of == k
        J, B, w, u = jacobian[mine], basis[mine], weights[mine], v[mine]
        P = [(J * (w * B[:, i] / u**2)[:, None]).T @ J for i in range(len(TERMS))]
        for i in range(len(TERMS)):
            for j in range(len(TERMS)):
                Q = (J * (w * B[:, i] * B[:, j] / u**3)[:, None]).T @ J
                more += W[k, i, j] * (Q - P[i] @ cov @ P[j])
    out = cov + 2 * cov @ (0.5 * (more + more.T)) @ cov
    return np.asarray(0.5 * (out + out.T))
