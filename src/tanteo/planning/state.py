"""The belief while sensing goes on: the posterior of all readings, under the prior poses of a start.

Before the first reading it is the start itself, or the posterior of its factors. After that
:func:`tanteo.posterior.update_posterior` leads from one posterior to the next, and what is asked of a belief are its
modes, as normal densities or by their samples.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tanteo.factors import ContactPoints, FreeRays
from tanteo.geometry.typing import BoolArray, Covariances, FloatArray, IntArray, Transforms
from tanteo.planning.start import Start
from tanteo.posterior import Mode, Posterior, PreparedPart, Problem, on_part, posterior_of_factors, update_posterior

_LEAST_P = 1e-12
"""Probability of a mode at least: where the object is only like a part, it is kept as the place of that."""


@dataclass(frozen=True, slots=True, eq=False)
class WeightedPoses:
    """Samples of a belief.

    Attributes:
        Ts: ``(N, 4, 4)``.
        mode: index of the mode of each ``(N,)``.
        weights: ``(N,)``, summing to the probability of all parts.
    """

    Ts: Transforms
    mode: IntArray
    weights: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class SensingState:
    """What is known after some readings.

    Attributes:
        start: what was assumed beforehand.
        posterior: of all readings and factors; None before the first reading without factors.
        unknown: probability of the unknown object.
        draws: samples of all of it; None before the first reading.
        poses: where the part may be, best first ``(M, 4, 4)``: the modes, or the prior poses before the first reading.
        covariances: of them ``(M, 6, 6)``.
        part: index of the part of each ``(M,)``.
        weights: probability of each ``(M,)``; sums to one with ``unknown``.
        rows: prior pose of the start from which each most probably is ``(M,)``.
        chances: of being within tolerances, see :func:`tanteo.planning.chance_within`, as far as they were asked for.
    """

    start: Start
    posterior: Posterior | None
    unknown: float
    draws: WeightedPoses | None = None
    poses: Transforms = field(init=False)
    covariances: Covariances = field(init=False)
    part: IntArray = field(init=False)
    weights: FloatArray = field(init=False)
    rows: IntArray = field(init=False)
    chances: dict[tuple[float, str | None], float] = field(init=False, repr=False, default_factory=dict)

    def __post_init__(self) -> None:
        start, modes = self.start, self.modes
        if self.posterior is None:
            values = start.Ts, start.covariances, start.part, start.weights * (1 - self.unknown), np.arange(len(start))
        else:
            poses = np.array([m.T_world_part for m in modes]).reshape(-1, 4, 4)
            part = np.array([start.targets.index(m.prepared) for m in modes], dtype=np.int64)
            values = (
                poses,
                np.array([m.covariance for m in modes]).reshape(-1, 6, 6),
                part,
                np.array([max(m.probability, _LEAST_P) for m in modes]),
                np.array([start.likeliest(k, T) for k, T in zip(part, poses, strict=True)], dtype=np.int64),
            )
        for name, value in zip(("poses", "covariances", "part", "weights", "rows"), values, strict=True):
            object.__setattr__(self, name, value)

    @property
    def touches(self) -> ContactPoints | None:
        """All readings that met something; None before the first reading."""
        return None if self.posterior is None else self.posterior.problem.points

    @property
    def free(self) -> FreeRays:
        """The paths on which nothing was met."""
        return FreeRays.none() if self.posterior is None else self.posterior.problem.rays

    @property
    def modes(self) -> tuple[Mode, ...]:
        """Parts at poses with their probabilities, best first; none before the first reading."""
        return () if self.posterior is None else self.posterior.modes

    def of_parts(self) -> FloatArray:
        """Probability of every part of the start, whatever its pose."""
        counts = np.bincount(self.part, weights=self.weights, minlength=len(self.start.targets))
        return np.asarray(counts, dtype=np.float64)

    def target(self, k: int) -> PreparedPart:
        """The part of mode ``k``."""
        return self.start.targets[self.part[k]]

    def on_part(self) -> BoolArray:
        """Which readings the likeliest mode is met by, rather than outliers ``(n,)``; it takes a mode."""
        return on_part(self.modes[0])


def _draws(posterior: Posterior) -> WeightedPoses:
    """The samples of all modes."""
    modes = posterior.modes
    Ts = np.concatenate([np.zeros((0, 4, 4)), *(m.Ts for m in modes)])
    mode = np.repeat(np.arange(len(modes)), [len(m.Ts) for m in modes])
    weights = np.concatenate([np.zeros(0), *(max(m.probability, _LEAST_P) * m.weights for m in modes)])
    return WeightedPoses(Ts, mode, weights)


def begin(start: Start) -> SensingState:
    """The belief before the first reading: the prior poses of the start, or the posterior of its factors."""
    if not start.factors:
        return SensingState(start, None, start.priors.unknown)
    problem = Problem(ContactPoints.none(), FreeRays.none(), start.priors, pose_factors=start.factors)
    found = posterior_of_factors(problem, start.targets, _log_priors(start))
    return SensingState(start, found, found.unknown, _draws(found))


def _log_priors(start: Start) -> FloatArray:
    """Log prior of each part that may be there ``(P,)``."""
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(start.shares()) + np.log1p(-start.priors.unknown))


def update(before: SensingState, touches: ContactPoints, free: FreeRays) -> SensingState:
    """The belief after readings.

    Args:
        before: the belief before them.
        touches: all readings so far that met something, the old ones included.
        free: all paths so far on which nothing was met.
    """
    start = before.start
    priors, log_priors = start.priors, _log_priors(start)
    some = np.flatnonzero(np.isfinite(log_priors))
    problem = Problem(touches, free, priors, mixtures=start.mixtures(), pose_factors=start.factors)
    anywhere = np.log(priors.unknown) + problem.log_not_on_part.sum()
    anywhere += len(free) * np.log1p(-priors.outlier_rate) + problem.log_factors_unknown
    rng = np.random.default_rng((1991, len(touches), len(free)))  # the same belief of the same readings every time
    parts = [start.targets[k] for k in some]
    after = update_posterior(problem, parts, log_priors[some], before.posterior, float(anywhere), rng)
    return SensingState(start, after, after.unknown, _draws(after))
