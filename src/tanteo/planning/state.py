"""State of a session: the posterior of part and pose given all readings and the prior poses of a start.

Before the first reading it is the prior itself, or the posterior given the start's factors. Then
:func:`tanteo.posterior.update_posterior` updates it. Its modes are available as normal densities and as samples.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from tanteo.factors import ContactPoints, FreeRays
from tanteo.geometry.special import log_even
from tanteo.geometry.typing import BoolArray, Covariances, FloatArray, IntArray, Transforms
from tanteo.planning.start import Start
from tanteo.posterior import DEFAULTS, Mode, Posterior, PreparedPart, Problem, posterior_of_factors, update_posterior
from tanteo.posterior.fit_at_mode import goodness_of_fit
from tanteo.posterior.sampling.covariances import PoseMoves, common_tolerance, unstated_moves
from tanteo.posterior.settings import Settings
from tanteo.posterior.update import on_part
from tanteo.sensors.error_states import UnstatedError
from tanteo.values import Value, lock

_CONFIRMING = 16
"""Factor on the numbers of samples of a state near a limit. It divides the sampling error of a probability by four,
from 0.02 to 0.005 near 0.95."""

_LEAST_P = 1e-12
"""Smallest probability of a mode, so that the best pose is kept even if the object is almost certainly unknown."""


@dataclass(frozen=True, slots=True, eq=False)
class WeightedPoses:
    """Weighted samples of a posterior over part and pose.

    Attributes:
        Ts: poses ``T_world_part`` ``(N, 4, 4)``.
        mode: index of the mode of each sample ``(N,)``.
        weights: weights that sum to the probability that one of the parts is present ``(N,)``.
    """

    Ts: Transforms
    mode: IntArray
    weights: FloatArray


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SensingState(Value):
    """State of a session after some readings.

    Attributes:
        start: prior poses of the session.
        posterior: posterior of all readings and factors; None before the first reading without factors.
        unknown: posterior probability of the unknown object.
        draws: samples of the posterior; None before the first reading.
        unstated: errors that the readings are assumed to share because none are stated; :attr:`posterior` and
            :attr:`covariances` are without them.
        poses: poses of the modes, best first ``(M, 4, 4)``; before the first reading, the prior poses.
        covariances: covariances of the modes, part frame, right perturbation ``(M, 6, 6)`` [m, rad].
        part: index of the part of each mode ``(M,)``.
        weights: probabilities of the modes, which sum to one with ``unknown`` ``(M,)``.
        rows: index of the prior pose with the largest density at each mode ``(M,)``; -1 if the part has none.
        chances: cache of the probabilities of tolerances, see :func:`tanteo.planning.stopping.chance_within`.
    """

    start: Start
    posterior: Posterior | None
    unknown: float
    draws: WeightedPoses | None = None
    unstated: tuple[UnstatedError, ...] = ()
    poses: Transforms = field(init=False)
    covariances: Covariances = field(init=False)
    part: IntArray = field(init=False)
    weights: FloatArray = field(init=False)
    rows: IntArray = field(init=False)
    chances: dict[tuple[float, str | None], float] = field(init=False, repr=False, default_factory=dict)
    _moves: dict[int, PoseMoves] = field(init=False, repr=False, default_factory=dict)

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
        lock(self)

    @property
    def touches(self) -> ContactPoints | None:
        """All contact points, world frame; None before the first reading."""
        return None if self.posterior is None else self.posterior.problem.points

    @property
    def free(self) -> FreeRays:
        """All free-space rays, world frame."""
        return FreeRays.none() if self.posterior is None else self.posterior.problem.rays

    @property
    def modes(self) -> tuple[Mode, ...]:
        """Modes of the posterior, best first; none before the first reading."""
        return () if self.posterior is None else self.posterior.modes

    def of_parts(self) -> FloatArray:
        """Return the probability of every part of the start over all its poses ``(P,)``."""
        counts = np.bincount(self.part, weights=self.weights, minlength=len(self.start.targets))
        return np.asarray(counts, dtype=np.float64)

    def target(self, k: int) -> PreparedPart:
        """Return the part of a mode.

        Args:
            k: index of the mode.
        """
        return self.start.targets[self.part[k]]

    def moves(self, k: int) -> PoseMoves:
        """Return the errors of a mode's pose that its covariance does not contain.

        They are the same as in an answer: those by errors that are assumed if none are stated, and by the deviations
        within the faces of a made part.

        Args:
            k: index of the mode.
        """
        if k not in self._moves:
            found = PoseMoves.none()
            if self.touches is not None and len(self.touches) and (self.unstated or self.touches.tolerance):
                one = goodness_of_fit(self.modes[k])
                found = unstated_moves(self.touches, one, self.unstated).plus(common_tolerance(self.touches, one)[0])
            self._moves[k] = found
        return self._moves[k]

    def whole_covariance(self, k: int) -> Covariances:
        """Return the covariance of a mode's pose with the errors of :meth:`moves` ``(6, 6)`` [m, rad].

        Args:
            k: index of the mode.
        """
        return self.moves(k).widen(self.covariances[k])

    def effective_samples(self, part: int) -> float:
        """Return the effective number of samples of a part, at most the number that the sampler draws by intent.

        Args:
            part: index of the part.
        """
        if self.posterior is None or self.draws is None:
            return np.inf
        w = self.draws.weights[np.isin(self.draws.mode, np.flatnonzero(self.part == part))]
        ess = float(w.sum() ** 2 / max(float(w @ w), np.finfo(float).tiny))
        return min(ess, float(self.posterior.problem.settings.samples.enough))

    def on_part(self) -> BoolArray:
        """Return flags of the contact points that are inliers of the most probable mode ``(n,)``.

        There must be a mode.
        """
        return on_part(self.modes[0])


def _draws(posterior: Posterior) -> WeightedPoses:
    """Return the samples of all modes."""
    modes = posterior.modes
    Ts = np.concatenate([np.zeros((0, 4, 4)), *(m.Ts for m in modes)])
    mode = np.repeat(np.arange(len(modes)), [len(m.Ts) for m in modes])
    weights = np.concatenate([np.zeros(0), *(max(m.probability, _LEAST_P) * m.weights for m in modes)])
    return WeightedPoses(Ts, mode, weights)


def begin(start: Start) -> SensingState:
    """Return the state before the first reading: the prior poses, or the posterior given the start's factors.

    Args:
        start: prior poses and factors.
    """
    if not start.factors:
        return SensingState(start, None, start.priors.unknown)
    problem = Problem(ContactPoints.none(), FreeRays.none(), start.priors, pose_factors=start.factors)
    known = [start.Ts[start.part == k] for k in range(len(start.targets))]
    found = posterior_of_factors(problem, start.targets, _log_priors(start), known)
    return SensingState(start, found, found.unknown, _draws(found))


def _log_priors(start: Start) -> FloatArray:
    """Return the log prior probability of each part ``(P,)``."""
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(start.shares()) + np.log1p(-start.priors.unknown))


def update(
    before: SensingState, touches: ContactPoints, free: FreeRays, unstated: tuple[UnstatedError, ...] = ()
) -> SensingState:
    """Return the state of a session after further readings.

    Args:
        before: state before these readings.
        touches: all contact points so far, earlier ones included.
        free: all free-space rays so far, earlier ones included.
        unstated: errors that the touches are assumed to share because none are stated.
    """
    return _updated(before, touches, free, unstated, DEFAULTS, 0)


def confirmed(state: SensingState, is_clear: Callable[[SensingState], bool]) -> SensingState:
    """Return the posterior of the same readings from new samples, and from more of them unless few are enough.

    The probabilities of a state have a sampling error. A session that ends when one of them passes a limit selects
    those whose error is positive. It ends only by a confirmed state, whose error is independent, and small against the
    distance from the limit.

    Args:
        state: state after some readings.
        is_clear: function that returns whether the sampling error of a state is too small to matter.
    """
    if state.posterior is None or state.touches is None:
        return state
    own = DEFAULTS.samples
    first, enough, more = (_CONFIRMING * n for n in (own.first, own.enough, own.more))
    many = replace(DEFAULTS, samples=replace(own, first=first, enough=enough, more=more))
    few = _updated(state, state.touches, state.free, state.unstated, DEFAULTS, 2)
    return few if is_clear(few) else _updated(state, state.touches, state.free, state.unstated, many, 1)


def _updated(
    before: SensingState,
    touches: ContactPoints,
    free: FreeRays,
    unstated: tuple[UnstatedError, ...],
    settings: Settings,
    again: int,
) -> SensingState:
    start = before.start
    priors, log_priors = start.priors, _log_priors(start)
    some = np.flatnonzero(np.isfinite(log_priors))
    area = float(np.mean([target.part.area for target in start.targets]))
    problem = Problem(
        touches, free, priors, mixtures=start.mixtures(), pose_factors=start.factors, settings=settings,
        typical_area=area,
    )  # fmt: skip
    anywhere = np.log(priors.unknown) + problem.log_not_on_part.sum()
    anywhere += log_even(problem.region.log_gain_of_unknown(area))
    anywhere += len(free) * np.log1p(-priors.outlier_rate) + problem.log_factors_unknown
    # the same readings give the same posterior
    rng = np.random.default_rng((1991, len(touches), len(free), *([again] if again else [])))
    parts = [start.targets[k] for k in some]
    after = update_posterior(problem, parts, log_priors[some], before.posterior, float(anywhere), rng)
    return SensingState(start, after, after.unknown, _draws(after), unstated)
