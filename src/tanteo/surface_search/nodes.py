"""Heavy-tailed densities about many poses that readings allow, all in the coordinates of one rough pose.

Few readings leave a rough pose on sheets: exact where faces were met, as vague as before along them, bent, and cut
where a face ends. A density about every maximum does not cover those; densities about poses all over them do. The
poses are draws of the rough pose, each moved to the nearest pose that the readings allow (randomize, then optimize:
Bardsley et al. 2014); a density is as wide along the sheet as some of them lie apart.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np
from scipy.special import gammaln

from tanteo.lie import SE3
from tanteo.localization import motions_about, pose_information
from tanteo.matching.prior import PosePrior, prior_rows
from tanteo.matching.priors import Priors
from tanteo.surface_search.given_pose import GivenPose, Posterior
from tanteo.surface_search.likelihood import explain, normal_equations
from tanteo.surface_search.refine import refine
from tanteo.surface_search.shared_start import bend, start_of
from tanteo.surface_search.target import Target
from tanteo.surface_search.touches import Touches
from tanteo.typing import Covariances, FloatArray, IntArray, Tangents, Transforms, Vectors

_COUNT = 512
"""Draws of the rough pose."""

_NARROWER = 2.0
"""A density is so many times narrower than the rough pose where the readings say nothing."""

_STEPS = 6
"""Steps from a draw to the readings."""

DRAWS, _TAIL = 1024, 5
"""Draws in a round, degrees of freedom of the densities."""

_EVEN = 0.1
"""Share of the draws that goes to all of them evenly."""

_AT_ONCE = 256
"""Draws whose densities are computed at once: what the processor's cache holds."""


@dataclass(frozen=True, slots=True, eq=False)
class Nodes:
    """Densities over the perturbation of a rough pose, as that of a frame at the part's middle.

    Attributes:
        T: the rough pose of that frame ``(4, 4)``.
        middle: of the part, in its own frame ``(3,)`` [m].
        x: where the densities are ``(K, 6)``.
        roots: of their covariances ``(K, 6, 6)``.
        shares: of the draws ``(K,)``.
        z: whitened shared errors that are expected there ``(K, D)``.
        follows: how these move with the pose ``(K, D, 6)``.
    """

    T: Transforms
    middle: Vectors
    x: Tangents
    roots: FloatArray
    shares: FloatArray
    z: FloatArray
    follows: FloatArray

    def first(self, count: int) -> Nodes:
        """The first of the densities, all alike in their share."""
        kept = (getattr(self, name)[:count] for name in ("x", "roots", "shares", "z", "follows"))
        x, roots, shares, z, follows = kept
        return Nodes(self.T, self.middle, x, roots, np.full_like(shares, 1 / max(count, 1)), z, follows)

    def poses(self, x: Tangents) -> Transforms:
        """Of the part at perturbations ``(S, 6)``: ``(S, 4, 4)``."""
        return np.asarray(self.T @ SE3.exp(x) @ SE3.from_parts(np.eye(3), -self.middle))

    def perturbations(self, Ts: Transforms) -> Tangents:
        """The other way round: of poses of the part ``(S, 4, 4)``: ``(S, 6)``."""
        return SE3.log(SE3.inverse(self.T) @ Ts @ SE3.from_parts(np.eye(3), self.middle))

    def of_part(self, k: int) -> FloatArray:
        """Root of the covariance of one density, as that of the part's own perturbation there ``(6, 6)``."""
        return np.asarray(motions_about(self.middle) @ SE3.right_jacobian(self.x[k]) @ self.roots[k])

    def draw(self, round_: int) -> tuple[Tangents, FloatArray]:
        """Perturbations ``(S, 6)``, and the shared errors to be expected there ``(S, D)``."""
        normal, factor = _chance(round_)
        which = np.searchsorted(np.cumsum(self.shares), (np.arange(DRAWS) + 0.5) / DRAWS).clip(max=len(self.x) - 1)
        step = factor[:, None] * (self.roots[which] @ normal[..., None])[..., 0]
        return self.x[which] + step, self.z[which] + (self.follows[which] @ step[..., None])[..., 0]

    def log_density(self, x: Tangents) -> FloatArray:
        """Of all of them together, at perturbations ``(S, 6)``: ``(S,)``."""
        each = (np.log(np.exp(log).sum(axis=0)) + top for log, top in map(_topped, self._each(x)))
        return np.concatenate([np.zeros(0), *each])

    def nearest(self, x: Tangents) -> IntArray:
        """Which of them is densest at perturbations ``(S, 6)``: ``(S,)``."""
        return np.concatenate([np.zeros(0, dtype=np.int64), *(each.argmax(axis=0) for each in self._each(x))])

    def _each(self, x: Tangents) -> Iterator[FloatArray]:
        """Log density of each, shares included, some draws at a time ``(K, s)``."""
        white = np.linalg.inv(self.roots)
        constant = gammaln(0.5 * (_TAIL + 6)) - gammaln(0.5 * _TAIL) - 3 * np.log(_TAIL * np.pi)
        peaks = constant + np.linalg.slogdet(white)[1] + np.log(self.shares)
        middle, rows = (white @ self.x[..., None]), white.reshape(-1, 6)
        for k in range(0, len(x), _AT_ONCE):
            gaps = (rows @ x[k : k + _AT_ONCE].T).reshape(len(white), 6, -1) - middle
            yield peaks[:, None] - 0.5 * (_TAIL + 6) * np.log1p(np.einsum("kis,kis->ks", gaps, gaps) / _TAIL)


def _topped(log: FloatArray) -> tuple[FloatArray, FloatArray]:
    top = log.max(axis=0)
    return log - top, top


@dataclass(frozen=True, slots=True, eq=False)
class Rough:
    """A part with readings, and a normal density that is as wide as what is looked for: a rough pose, or a region.

    Attributes:
        touches: all readings that met something.
        target: the part.
        priors: rate of clutter, the size of the workspace, and what is known of the pose.
        posterior: of the part, what is known of the pose counted in.
        T: the pose ``T_world_part`` in the middle of the density ``(4, 4)``.
        covariance: of it ``(6, 6)``, order x y z rx ry rz, part frame, right perturbation [m, rad].
    """

    touches: Touches
    target: Target
    priors: Priors
    posterior: Posterior
    T: Transforms
    covariance: Covariances

    @classmethod
    def of_prior(cls, touches: Touches, target: Target, priors: Priors, posterior: Posterior) -> Rough:
        """All that the one rough pose leaves of which the priors know."""
        pose = priors.pose
        assert pose is not None
        assert pose.T_world_part is not None
        assert pose.covariance is not None
        return cls(touches, target, priors, posterior, pose.T_world_part, pose.covariance)

    @property
    def root(self) -> FloatArray:
        """Of the inverse of the covariance ``(6, 6)``."""
        return np.asarray(np.linalg.cholesky(np.linalg.inv(self.covariance))).T


def of_rough_pose(rough: Rough, also: Transforms) -> tuple[Nodes, GivenPose]:
    """Densities all over what the readings leave of a rough pose, and the posterior at each.

    Args:
        rough: the part, with its readings.
        also: further poses about which there is to be a density, first: maxima ``(J, 4, 4)``.
    """
    touches, target = rough.touches, rough.target
    drawn = rough.T @ SE3.exp(_first() @ np.linalg.cholesky(rough.covariance).T)
    own = PosePrior(drawn, rough.covariance)
    end = max(3.0, bend(touches))
    scales = np.geomspace(max(_misfit(rough) / float(np.median(touches.sd)), 2 * end), end, _STEPS)
    Ts, _ = refine(touches, drawn, target, scales, 0.0, partial(prior_rows, own, target.part))
    Ts, _ = start_of(touches, Ts, target, replace(rough.priors, pose=own))
    return about(rough, np.concatenate([also, Ts]))


def about(rough: Rough, Ts: Transforms) -> tuple[Nodes, GivenPose]:
    """Densities about poses ``(K, 4, 4)``, and the posterior at each."""
    touches, target = rough.touches, rough.target
    middle = target.part.centroid
    T_part_middle, M = SE3.from_parts(np.eye(3), middle), motions_about(middle)
    T = rough.T @ T_part_middle
    at = rough.posterior(Ts, np.zeros((len(Ts), touches.gains.shape[-1])))
    A, _ = normal_equations(touches, explain(touches, Ts, at.z, target, rough.priors), at.z)
    x = SE3.log(SE3.inverse(T) @ Ts @ T_part_middle)
    J, root = M @ SE3.right_jacobian(x), _NARROWER * rough.root @ M
    information = np.swapaxes(J, 1, 2) @ pose_information(A) @ J + root.T @ root
    scale = 1 / np.sqrt(np.einsum("sii->si", information))
    unit = information * scale[:, :, None] * scale[:, None, :] + 1e-10 * np.eye(6)
    roots = scale[:, :, None] * np.swapaxes(np.linalg.inv(np.linalg.cholesky(unit)), 1, 2)
    follows = -np.asarray(np.linalg.solve(A[:, 6:, 6:], A[:, 6:, :6])) @ J
    mass = 0.5 * (at.log + np.linalg.slogdet(roots)[1])  # tempered: it is that of the density, not of what it is in
    shares = np.exp(mass - mass.max())
    shares = _EVEN / len(x) + (1 - _EVEN) * shares / shares.sum()
    return Nodes(T, middle, x, roots, shares, at.z, follows), at


def _misfit(rough: Rough) -> float:
    """How far the surface may be from where the rough pose has it [m], 1 sd."""
    part = rough.target.part
    to_middle = np.linalg.inv(motions_about(part.centroid))
    C = to_middle @ rough.covariance @ to_middle.T
    return float(np.sqrt(np.trace(C[:3, :3]) / 3 + np.trace(C[3:, 3:]) / 3 * part.radius**2))


@cache
def _first() -> FloatArray:
    """The same standard normal draws every time, so that an answer can be repeated."""
    half = np.random.default_rng((1991, 7)).normal(size=(_COUNT // 2, 6))
    return np.concatenate([half, -half])


@cache
def _chance(round_: int) -> tuple[FloatArray, FloatArray]:
    """Standard normal draws and heavy-tailed factors, likewise."""
    rng = np.random.default_rng((1991, 8, round_))
    return rng.normal(size=(DRAWS, 6)), np.sqrt(_TAIL / rng.chisquare(_TAIL, DRAWS))
