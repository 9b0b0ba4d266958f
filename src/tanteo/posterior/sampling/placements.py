"""Integral of the posterior of one part over all of its poses, by placements of three touches on its surface.

Touches that are too few for a pose leave a bent sheet of poses on many sets of faces. Components about its maxima cover
a small part of it, which differs from part to part: their mass was a tenth of the integral. Here each draw places three
of the touches: the first evenly on the surface, the second where a random great circle about the first crosses the
surface, and the third at all crossings as the part turns about the line of both. The density of these draws is known,
so that the mean of posterior over density is the integral (importance sampling). No maximum is needed, and none can be
missed.

Errors that the touches share and the noise scale are drawn from their priors. Poses at which a touch is an outlier are
not drawn: two touches alone fit any part.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from tanteo import _core
from tanteo.factors import SurfacePoint
from tanteo.geometry import SE3
from tanteo.geometry.special import log_sum, softmax
from tanteo.geometry.typing import FloatArray, Transforms
from tanteo.posterior.problem import Problem
from tanteo.posterior.proposals.proposer import BITS
from tanteo.posterior.sampling.density import Density
from tanteo.posterior.sampling.modes import Mode, beyond_normal, covariance_of_samples, from_centre, to_origin
from tanteo.posterior.sampling.peaks import Objective, Peaks, point_scales
from tanteo.posterior.settings import FEWEST
from tanteo.posterior.symmetry import folded
from tanteo.threads import for_each

_FIRST, _MOST = 1000, 32_000
"""Numerical: first and largest number of draws of a part; a draw takes some microseconds."""

_NEGLIGIBLE = 1e-6
"""Numerical: weight of a pose over the largest one below which it does not count for the shape."""

_LOG_SCALE_NORM = float(np.log(4 * math.gamma(1.25) / np.sqrt(2 * np.pi)))
"""Definition: log of the integral of the density of the noise scale in the core, over that of a unit normal one."""


def are_placeable(problem: Problem) -> bool:
    """Return whether the measurements are three touches of the surface alone, not on one line and without a prior.

    Few placements of three touches fit a fourth one.
    """
    points, priors = problem.points, problem.priors
    if len(points) != FEWEST or len(problem.furniture.others) != FEWEST or len(problem.rays):
        return False
    bare = all(isinstance(f, SurfacePoint) for f in points.factors) and not points.oriented.any()
    alone = priors.pose is None and not problem.mixtures and not problem.pose_factors
    across = np.linalg.svd(points.points - points.points.mean(axis=0), compute_uv=False)[1]
    return (
        bare
        and not points.one_sided.any()
        and alone
        and bool(across > problem.settings.search.gate * point_scales(problem).wide)
    )


@dataclass(slots=True, eq=False)
class Placements:
    """Weighted poses of one part at which touches are on its surface.

    Attributes:
        objective: the part and the problem.
        rng: generator of all draws.
        log_constant: log of the constant factors of the prior.
        count: number of draws so far.
        Ts: poses ``(N, 4, 4)``.
        zs: other states there ``(N, D)``.
        log_weights: log of the weights ``(N,)``.
    """

    objective: Objective
    rng: np.random.Generator
    log_constant: float
    count: int = 0
    Ts: Transforms = field(init=False)
    zs: FloatArray = field(init=False)
    log_weights: FloatArray = field(init=False)
    _density: Density = field(init=False)

    def __post_init__(self) -> None:
        problem = self.objective.problem
        self.Ts, self.zs = np.zeros((0, 4, 4)), np.zeros((0, problem.states))
        self.log_weights = np.zeros(0)
        self._density = Density.about(self.objective, np.eye(4), self.log_constant)

    def draw(self, count: int) -> None:
        """Draw further placements, each with errors that the touches share and a noise scale from their priors."""
        problem, prepared = self.objective.problem, self.objective.prepared
        points, D = problem.points, problem.shared_errors
        zs = self.rng.normal(size=(count, problem.states))
        variances = np.broadcast_to(points.residual_sd**2, (count, len(points)))
        if problem.scale_sd > 0:
            # density exp(-z^4 / 16) of the core
            zs[:, D] = 2 * np.sign(zs[:, D]) * self.rng.gamma(0.25, size=count) ** 0.25
            fixed = points.tolerance**2 + points.rounding**2
            variances = np.exp(2 * problem.scale_sd * zs[:, D:]) * (variances - fixed) + fixed
        shifts = np.einsum("nid,kd->kni", points.shared_jacobian, zs[:, :D])
        places = np.ascontiguousarray(points.points + shifts)
        sds, seed = np.sqrt(variances), int(self.rng.integers(2**63))
        Ts, log_weights, draws = _core.placements(prepared.shape, places, points.radii, sds, seed)
        zs = np.ascontiguousarray(zs[draws])
        log = _core.log_densities(prepared.shape, self.objective.core, Ts, zs) + 0.5 * np.sum(zs[:, :D] ** 2, axis=1)
        if problem.scale_sd > 0:
            log += zs[:, D] ** 4 / 16 + _LOG_SCALE_NORM
        log = self._density.touched(log)
        self.Ts, self.zs = np.concatenate([self.Ts, Ts]), np.concatenate([self.zs, zs])
        self.log_weights = np.concatenate([self.log_weights, log + log_weights])
        self.count += count

    @property
    def log_mass(self) -> float:
        """Return the log of the integral of the posterior over all poses; -inf without a placement."""
        return float(log_sum(self.log_weights) - np.log(self.count)) if len(self.log_weights) else -np.inf

    @property
    def weights(self) -> FloatArray:
        """Return the weights of the poses, which sum to one ``(N,)``."""
        return softmax(self.log_weights)

    @property
    def ess(self) -> float:
        """Return the effective number of placements."""
        return float(1 / np.sum(self.weights**2)) if len(self.log_weights) else 0.0

    def maxima(self) -> Peaks:
        """Return the maxima to which the poses of most weight lead, best first."""
        rows = np.argsort(-self.log_weights)[: self.objective.problem.settings.search.kept]
        return self.objective.maximize(np.ascontiguousarray(self.Ts[rows]), self.zs[rows], fine=True)

    def mode(self, peaks: Peaks) -> Mode:
        """Return all poses of the part as one mode: the motions that the touches leave free join most of them.

        Args:
            peaks: maxima of the part, best first.
        """
        objective, w = self.objective, self.weights
        keep = w > _NEGLIGIBLE * w.max()
        T, w = peaks.Ts[0], w[keep] / w[keep].sum()
        Ts = folded(objective.prepared, np.ascontiguousarray(self.Ts[keep]), T[None], named=False)
        xi = SE3.log(SE3.inverse(T) @ Ts)
        curved = from_centre(objective, objective.of_pose(peaks.information[0]))
        own = objective.problem.settings.samples
        covariance = covariance_of_samples((w[:, None] * xi).T @ xi, curved, self.ess, own.min_fraction)
        covariance = covariance * beyond_normal(xi, w, covariance)
        return Mode(
            objective, T, covariance, T, peaks.zs[0], to_origin(objective, peaks.information[0]), self.log_mass, 0.0,
            Ts, w, self.ess, False, 1, BITS,
        )  # fmt: skip


def integrate(all_parts: Sequence[Placements], log_none: float) -> None:
    """Draw placements of all parts until the probability of each part is as exact as that of other answers.

    The probability ``P`` of a part with ``n`` effective draws has the standard deviation ``P (1 - P) / sqrt(n)``.

    Args:
        all_parts: the parts.
        log_none: log-evidence of the unknown object, its prior included.
    """
    counts = [_FIRST] * len(all_parts)
    while any(counts):
        for_each(lambda one: one[0].draw(one[1]), [both for both in zip(all_parts, counts, strict=True) if both[1]])
        masses = np.array([one.log_mass for one in all_parts])
        P = np.exp(masses - log_sum([log_none, *masses]))
        counts = [_further(one, float(p)) for one, p in zip(all_parts, P, strict=True)]


def _further(one: Placements, P: float) -> int:
    """Return the number of further draws of a part of a probability: as many as before, or none."""
    own = one.objective.problem.settings.samples
    need = max((P * (1 - P) / own.probability_sd) ** 2, own.shape * (own.min_probability < P))
    return one.count if one.ess < need and one.count < _MOST else 0
