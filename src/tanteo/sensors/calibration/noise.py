"""How far stations miss their planes: variance that grows with range and incidence, by restricted likelihood.

Readings from one place repeat to the noise of the device; from another place they miss by more, because of the spot
on an oblique surface, of steps in the device's scale, of the robot's pose. Only the second kind matters for a plane
that was sensed from several places, and many repeats of one place do not average it away.
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
"""Least variance: a micrometre. A log without scatter is not believed beyond the resolution of its numbers."""

_LARGEST_DENSE = 1500
"""Stations up to which the covariance of the variances takes account of how they were fitted."""


@dataclass(frozen=True, slots=True, eq=False)
class PlaceLaw:
    """Variances of the places of every sensor.

    Attributes:
        squares: Squares of :data:`TERMS` of every sensor, ``(k, 3)``.
    """

    squares: FloatArray

    def variances(self, log: PlaneLog, basis: FloatArray) -> FloatArray:
        """Variance of a station's mean range: of its place, and what its repeats leave of theirs [m^2]."""
        return np.maximum(np.sum(self.squares[log.beam] * basis, axis=1) + repeat_variances(log), _LEAST)

    def moved(self, step: FloatArray) -> PlaceLaw:
        """Return the law after a step of the logarithms of its squares, ``(3 k,)``."""
        return PlaceLaw(self.squares * np.exp(step.reshape(self.squares.shape)))


def place_basis(ranges: FloatArray, incidences: FloatArray) -> FloatArray:
    """What multiplies the squares of :data:`TERMS`, ``(m, 3)``."""
    d2 = ranges**2
    return np.stack([np.ones_like(d2), d2, d2 * np.tan(incidences) ** 2], axis=1)


def repeat_variances(log: PlaneLog) -> FloatArray:
    """Variance that the repeats leave in the mean of every station [m^2]; zero where nothing was repeated."""
    sigmas = np.stack([r.law.sigma(log.ranges) for r in log.repeats])
    return np.asarray(sigmas[log.beam, np.arange(len(log))] ** 2 / log.counts)


def first_law(log: PlaneLog, residuals: FloatArray, basis: FloatArray, share: float) -> PlaceLaw:
    """A law to start from: what the share of smallest residuals suggests, in three equal terms.

    The less of them is trusted, the more stations begin as outliers.
    """
    squares = np.empty((len(log.beams), len(TERMS)))
    for k in range(len(log.beams)):
        mine = log.beam == k
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
    for k in range(len(log.beams)):
        mine = log.beam == k
        down[k] = rest[mine] @ basis[mine]
        np.divide(pull[mine] @ basis[mine], down[k], out=ratio[k], where=down[k] > 0)
    step = np.log(np.maximum(law.squares * np.sqrt(ratio), 1e-3 * _LEAST) / law.squares)
    return step.ravel(), (law.squares * down).ravel()


def law_cov(
    law: PlaceLaw, log: PlaneLog, weights: FloatArray, basis: FloatArray, jacobian: FloatArray, cov: FloatArray
) -> FloatArray:
    """Covariance ``(k, 3, 3)`` of the squares, by the expected information of the restricted likelihood."""
    v = law.variances(log, basis)
    out = np.empty((len(log.beams), len(TERMS), len(TERMS)))
    for k in range(len(log.beams)):
        mine = (log.beam == k) & (weights > 0.5)
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
    """Covariance of the setup when the noise was estimated from the same stations: a little larger.

    The weights of the stations are as uncertain as the variances, and were chosen to suit these very residuals
    (Kenward and Roger, Biometrics 53, 1997; variances linear in their parameters).
    """
    v = law.variances(log, basis)
    W = law_cov(law, log, weights, basis, jacobian, cov)
    more = np.zeros_like(cov)
    for k in range(len(log.beams)):
        mine = log.beam == k
        J, B, w, u = jacobian[mine], basis[mine], weights[mine], v[mine]
        P = [(J * (w * B[:, i] / u**2)[:, None]).T @ J for i in range(len(TERMS))]
        for i in range(len(TERMS)):
            for j in range(len(TERMS)):
                Q = (J * (w * B[:, i] * B[:, j] / u**3)[:, None]).T @ J
                more += W[k, i, j] * (Q - P[i] @ cov @ P[j])
    out = cov + 2 * cov @ (0.5 * (more + more.T)) @ cov
    return np.asarray(0.5 * (out + out.T))
