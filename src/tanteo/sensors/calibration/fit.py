"""Fit geometry, noise and outliers of a calibration jointly, from several starts, and keep the most likely fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from tanteo.geometry import maximize
from tanteo.geometry.typing import FloatArray
from tanteo.sensors.calibration.geometry import Prediction, Prior, Setup, aimed, facing, predict
from tanteo.sensors.calibration.log import PlaneLog, mixture_log_likelihood, outlier_probabilities
from tanteo.sensors.calibration.noise import PlaceLaw, first_law, law_step, place_basis

_FIRST_PASSES, _PASSES = 25, 300
_CONTINUED = 3
_TRUSTED = (0.5, 0.2)
_BEYOND = 0.1
"""Fraction of places beyond the largest incidence of a device from which a fit is implausible."""

_CONVERGED = 0.01
"""Length of a step below which a fit has converged, in standard deviations of the estimate.

A step shorter than 1 % of a standard deviation in the metric of the information moves no parameter, and no linear
function of the parameters, by more than 1 % of its standard deviation (Cauchy-Schwarz). An error of that size raises
the root mean square error of the estimate by less than ``0.01**2 / 2`` of it."""


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """Joint fit of geometry, noise and outliers.

    Attributes:
        setup: beams and planes.
        law: variances of the places.
        prediction: predictions of all stations.
        residuals: measured minus predicted ranges ``(m,)`` [m].
        variances: variances of the residuals without outliers ``(m,)`` [m^2].
        outlier: outlier probability of each station ``(m,)``.
        cov: covariance of all parameters ``(size, size)``.
        evidence: log evidence of the stations under the mixture, by Laplace's method over the setup; comparable between
            fits of one log.
        gain: log likelihood minus that of uniformly distributed readings, minus one for each effective parameter
            (Akaike's criterion); below zero the log contains no information.
        converged: whether the iteration converged.
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
    converged: bool

    @property
    def explains(self) -> bool:
        """Whether most stations are no outliers, and the fit explains them better than chance."""
        return bool(np.mean(self.outlier > 0.5) < 0.5) and self.gain > 0


def refine(
    setup: Setup, log: PlaneLog, prior: Prior, *, share: float = 0.5, law: PlaceLaw | None = None, passes: int = _PASSES
) -> Fit:
    """Return the joint fit of setup, noise and outliers that :func:`tanteo.geometry.maximize` reaches from one start.

    Args:
        setup: start of beams and planes.
        log: stations.
        prior: prior of the parameters.
        share: fraction of the smallest residuals from which the first noise law is estimated (:func:`first_law`).
        law: first noise law; None to estimate it.
        passes: largest number of steps.
    """
    if law is None:
        now = predict(setup, log)
        law = first_law(log, log.ranges - now.ranges, place_basis(log.ranges, now.incidences), share)
    start: tuple[Setup, PlaceLaw] = setup, law
    linearize = partial(_linearized, log=log, prior=prior)
    (end, noise), squared = maximize(start, linearize, _moved, passes, _CONVERGED**2)
    return _result(end, log, prior, noise, bool(squared < _CONVERGED**2))


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
    # with the prior covariance as identity, the inverse is accurate even for undetermined parameters
    unit = J @ prior.root
    hat = np.sum((unit @ np.linalg.inv(np.eye(n) + prior.root.T @ information @ prior.root)) * unit, axis=1)
    step, curvature = law_step(law, log, residuals, weights, basis, hat)
    H = np.diag(np.concatenate([np.zeros(n), curvature]))
    off, aims = aimed(setup, log)
    aims_weighted = aims.T * np.repeat(weights, 2)[: len(off)]
    H[:n, :n] = information + aims_weighted @ aims + prior.precision
    pull = weighted.T @ residuals - aims_weighted @ off - prior.precision @ prior.deviation(setup)
    return H, np.concatenate([pull, curvature * step])


def _moved(state: tuple[Setup, PlaceLaw], step: FloatArray) -> tuple[Setup, PlaceLaw]:
    """Return setup and law after a step, which is shortened for the setup."""
    setup, law = state
    return setup.moved(_bounded(step[: setup.size])), law.moved(step[setup.size :])


def _result(setup: Setup, log: PlaneLog, prior: Prior, law: PlaceLaw, converged: bool) -> Fit:
    setup = facing(setup, log)
    now = predict(setup, log)
    residuals = log.ranges - now.ranges
    v = law.variances(log, place_basis(log.ranges, now.incidences))
    outlier = _outlier_probabilities(log, residuals, v)
    J = now.jacobian
    off, aims = aimed(setup, log)
    good = np.repeat(1 - outlier, 2)[: len(off)]
    cov = _covariance((J * ((1 - outlier) / v)[:, None]).T @ J + (aims.T * good) @ aims, prior)
    likelihood = sum(
        mixture_log_likelihood(residuals[mine], v[mine], log.widths[k])
        for k in range(len(log.devices))
        if (mine := log.of == k).any()
    )
    deviation = prior.deviation(setup)
    evidence = likelihood - 0.5 * float(deviation @ prior.precision @ deviation) - 0.5 * float(good @ off**2)
    evidence += 0.5 * float(np.linalg.slogdet(cov)[1] + np.linalg.slogdet(prior.precision)[1])
    chance = -float(np.sum(np.log(log.widths[log.of])))
    # every parameter that the log determines, variances as well, gains half a unit by fitting and as much again by
    # luck (Akaike; effective number of parameters of Spiegelhalter et al. 2002)
    effective = setup.size - float(np.trace(prior.precision @ cov))
    gain = likelihood - chance - effective - law.squares.size
    return Fit(setup, law, now, residuals, v, outlier, cov, evidence, gain, converged)


def _outlier_probabilities(log: PlaneLog, residuals: FloatArray, v: FloatArray) -> FloatArray:
    """Return the outlier probabilities of the stations, with an outlier fraction for each device."""
    out = np.zeros(len(log))
    for k in range(len(log.devices)):
        mine = log.of == k
        out[mine] = outlier_probabilities(residuals[mine], v[mine], log.widths[k])
    return out


def _bounded(step: FloatArray) -> FloatArray:
    """Return a step limited to 0.3 in every parameter [m, rad], so that distant starts do not diverge."""
    return np.asarray(step * min(1.0, 0.3 / max(float(np.max(np.abs(step))), 1e-12)))


def _covariance(information: FloatArray, prior: Prior) -> FloatArray:
    """Return the covariance of all parameters from the information of the stations and the prior.

    In coordinates with the prior covariance as identity, undetermined directions keep exactly their prior variance.
    """
    values, vectors = np.linalg.eigh(prior.root.T @ information @ prior.root)
    root = prior.root @ (vectors / np.sqrt(1 + np.maximum(values, 0.0)))
    return np.asarray(root @ root.T)


def best_fit(
    log: PlaneLog, setups: Sequence[Setup], priors: Sequence[Prior], max_incidence: float = np.pi / 2
) -> tuple[Fit, Prior]:
    """Return the most likely of the fits from several starts, each with few and with more initial outliers.

    All fits take their first steps; the best of them continue until they converge. Fits in which fewer places are
    beyond the largest incidence of the device come first.

    Args:
        log: stations.
        setups: starts.
        priors: prior for each start.
        max_incidence: largest incidence at which the device answers [rad].
    """

    def rank(fit: Fit) -> tuple[bool, bool, float]:
        beyond = fit.prediction.incidences[fit.outlier <= 0.5] > max_incidence
        return fit.explains, not len(beyond) or float(np.mean(beyond)) <= _BEYOND, fit.evidence

    fits = [
        (refine(setup, log, prior, share=share, passes=_FIRST_PASSES), prior)
        for setup, prior in zip(setups, priors, strict=True)
        for share in _TRUSTED
    ]
    fits.sort(key=lambda f: rank(f[0]), reverse=True)
    continued = [(refine(fit.setup, log, prior, law=fit.law), prior) for fit, prior in fits[:_CONTINUED]]
    return max(continued, key=lambda f: rank(f[0]))
