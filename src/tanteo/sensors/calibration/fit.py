"""The calibration itself: geometry, noise and outliers together, from several starts; the likeliest is kept."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from tanteo.geometry import maximize
from tanteo.geometry.typing import FloatArray
from tanteo.sensors.calibration.geometry import BEAM, Prediction, Prior, Setup, facing, predict
from tanteo.sensors.calibration.log import PlaneLog, mixture_log_likelihood, outlier_probabilities
from tanteo.sensors.calibration.noise import PlaceLaw, first_law, law_step, place_basis

_FIRST_PASSES, _PASSES = 25, 300
_CONTINUED = 3
_TRUSTED = (0.5, 0.2)
_SETTLED = 3e-4
"""Squared length of a step, in standard deviations of all parameters together, below which a fit has converged. The
statistics of ``pytest tests/sensors/calibration`` hold with it; with a third of it the fits take a fifth longer."""


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """One fit.

    Attributes:
        setup: Beams and planes.
        law: Variances of the places.
        prediction: Of every station.
        residuals: Read less predicted [m], ``(m,)``.
        variances: Of good residuals [m^2], ``(m,)``.
        outlier: How probably each station is an outlier, ``(m,)``.
        cov: Of all parameters, ``(size, size)``.
        evidence: Logarithm of the probability of the stations under the mixture, with the setup integrated out
            around its best (Laplace); comparable between fits of one log.
        gain: Log likelihood more than that of readings which are anywhere by chance, less one a parameter (Akaike's
            criterion): below zero there is nothing in the log.
        settled: It came to rest.
    """

    setup: Setup
    law: PlaceLaw
    prediction: Prediction
    residuals: FloatArray
    variances: FloatArray
    outlier: FloatArray
    cov: FloatArray
    evidence: float
    gain: float
    settled: bool

    @property
    def explains(self) -> bool:
        """Most places are no outliers, and chance does not explain them as well."""
        return bool(np.mean(self.outlier > 0.5) < 0.5) and self.gain > 0


def refine(
    setup: Setup, log: PlaneLog, prior: Prior, *, share: float = 0.5, law: PlaceLaw | None = None, passes: int = _PASSES
) -> Fit:
    """Return the joint fit of setup, noise and outliers that :func:`tanteo.geometry.maximize` reaches from one start.

    The noise begins as ``law``, or by the share of the residuals that is trusted (:func:`first_law`).
    """
    if law is None:
        now = predict(setup, log)
        law = first_law(log, log.ranges - now.ranges, place_basis(log.ranges, now.incidences), share)
    start: tuple[Setup, PlaceLaw] = setup, law
    linearize = partial(_linearized, log=log, prior=prior)
    (end, noise), squared = maximize(start, linearize, _moved, passes, _SETTLED)
    return _result(end, log, prior, noise, bool(squared < _SETTLED))


def _linearized(state: tuple[Setup, PlaceLaw], log: PlaneLog, prior: Prior) -> tuple[FloatArray, FloatArray]:
    """Return information and gradient of the setup's parameters and the logarithms of the law's squares.

    The expected information has no terms between the two. The weights are the probabilities of the stations to be
    no outliers, so that the steps are those of expectation and maximization (Dempster, Laird and Rubin 1977).
    """
    setup, law = state
    n = setup.size
    now = predict(setup, log)
    residuals, J = log.ranges - now.ranges, now.jacobian
    basis = place_basis(log.ranges, now.incidences)
    v = law.variances(log, basis)
    weights = 1 - _outlier_probabilities(log, residuals, v)
    weighted = J * (weights / v)[:, None]
    information = weighted.T @ J
    # in the coordinates that make the prior a unit ball the inverse is accurate, whatever is not determined
    unit = J @ prior.root
    hat = np.sum((unit @ np.linalg.inv(np.eye(n) + prior.root.T @ information @ prior.root)) * unit, axis=1)
    step, curvature = law_step(law, log, residuals, weights, basis, hat)
    H = np.diag(np.concatenate([np.zeros(n), curvature]))
    H[:n, :n] = information + prior.precision
    g = np.concatenate([weighted.T @ residuals - prior.precision @ prior.deviation(setup), curvature * step])
    return H, g


def _moved(state: tuple[Setup, PlaceLaw], step: FloatArray) -> tuple[Setup, PlaceLaw]:
    """Return setup and law after a step, which is shortened for the setup."""
    setup, law = state
    return setup.moved(_bounded(step[: setup.size])), law.moved(step[setup.size :])


def _result(setup: Setup, log: PlaneLog, prior: Prior, law: PlaceLaw, settled: bool) -> Fit:
    setup = facing(setup, log)
    now = predict(setup, log)
    residuals = log.ranges - now.ranges
    v = law.variances(log, place_basis(log.ranges, now.incidences))
    outlier = _outlier_probabilities(log, residuals, v)
    J = now.jacobian
    cov = _covariance((J * ((1 - outlier) / v)[:, None]).T @ J, prior)
    likelihood = sum(
        mixture_log_likelihood(residuals[mine], v[mine], log.widths[k])
        for k in range(len(log.beams))
        if (mine := log.beam == k).any()
    )
    deviation = prior.deviation(setup)
    evidence = likelihood - 0.5 * float(deviation @ prior.precision @ deviation)
    evidence += 0.5 * float(np.linalg.slogdet(cov)[1] + np.linalg.slogdet(prior.precision)[1])
    chance = -float(np.sum(np.log(log.widths[log.beam])))
    # every parameter, variances as well, gains half a unit by fitting and as much again by luck (Akaike)
    gain = likelihood - chance - setup.size - law.squares.size
    return Fit(setup, law, now, residuals, v, outlier, cov, evidence, gain, settled)


def _outlier_probabilities(log: PlaneLog, residuals: FloatArray, v: FloatArray) -> FloatArray:
    """Probabilities of the stations to be outliers, each sensor with its own share."""
    out = np.zeros(len(log))
    for k in range(len(log.beams)):
        mine = log.beam == k
        out[mine] = outlier_probabilities(residuals[mine], v[mine], log.widths[k])
    return out


def _bounded(step: FloatArray) -> FloatArray:
    """A step of half a radian or ten centimetres at most: far starts must not be thrown farther."""
    return np.asarray(step * min(1.0, 0.3 / max(float(np.max(np.abs(step))), 1e-12)))


def _covariance(information: FloatArray, prior: Prior) -> FloatArray:
    """Of all parameters, from what the stations tell and the prior.

    In the coordinates that make the prior a unit ball: what the stations leave open keeps exactly its prior.
    """
    values, vectors = np.linalg.eigh(prior.root.T @ information @ prior.root)
    root = prior.root @ (vectors / np.sqrt(1 + np.maximum(values, 0.0)))
    return np.asarray(root @ root.T)


def best_fit(log: PlaneLog, setups: Sequence[Setup], priors: Sequence[Prior]) -> tuple[Fit, Prior]:
    """The likeliest of the fits from several starts, each with few and with more outliers at the beginning.

    All take their first steps; those that are then ahead go on until they settle.
    """
    fits = [
        (refine(setup, log, prior, share=share, passes=_FIRST_PASSES), prior)
        for setup, prior in zip(setups, priors, strict=True)
        for share in _TRUSTED
    ]
    fits.sort(key=lambda f: (-f[0].explains, -f[0].evidence))
    settled = [(refine(fit.setup, log, prior, law=fit.law), prior) for fit, prior in fits[:_CONTINUED]]
    return max(settled, key=lambda f: (f[0].explains, f[0].evidence))


def beam_slice(k: int) -> slice:
    """Parameters of a beam among all."""
    return slice(len(BEAM) * k, len(BEAM) * (k + 1))
