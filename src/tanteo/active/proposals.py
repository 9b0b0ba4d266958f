"""Heavy-tailed densities about the maxima of a posterior, from which poses are drawn, and how they learn from draws."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.special import gammaln

from tanteo.lie import SE3
from tanteo.localization import pose_information
from tanteo.matching.priors import log_sum
from tanteo.surface_search.polish import Polished
from tanteo.typing import FloatArray, Tangents, Transforms

_DRAWS, _TAIL = 256, 5
"""Draws in a round, degrees of freedom of the proposals."""


@dataclass(frozen=True, slots=True, eq=False)
class Proposals:
    """Heavy-tailed densities about maxima, over perturbations of their poses.

    Attributes:
        Ts: the maxima ``(J, 4, 4)``.
        z: whitened shared errors there ``(J, D)``.
        follows: how the shared errors that are expected move with the pose ``(J, D, 6)``.
        means: of the densities ``(J, 6)``.
        roots: of their covariances ``(J, 6, 6)``.
        shares: of the draws ``(J,)``.
    """

    Ts: Transforms
    z: FloatArray
    follows: FloatArray
    means: Tangents
    roots: FloatArray
    shares: FloatArray

    @classmethod
    def at(cls, found: Polished, masses: FloatArray) -> Proposals:
        """With the curvature of the maxima; half of the draws evenly, half by (tempered) mass."""
        A = found.information
        information = pose_information(A)
        scale = 1 / np.sqrt(np.einsum("sii->si", information))
        unit = information * scale[:, :, None] * scale[:, None, :] + 1e-10 * np.eye(6)
        roots = scale[:, :, None] * np.swapaxes(np.linalg.inv(np.linalg.cholesky(unit)), 1, 2)
        follows = -np.asarray(np.linalg.solve(A[:, 6:, 6:], A[:, 6:, :6]))
        tempered = np.exp(0.5 * (masses - masses.max()))
        shares = 0.5 / len(masses) + 0.5 * tempered / tempered.sum()
        return cls(found.Ts, found.z, follows, np.zeros((len(masses), 6)), roots, shares)

    def coordinates(self, Ts: Transforms) -> Tangents:
        """Perturbations from every maximum ``(J, S, 6)``."""
        return SE3.log(SE3.inverse(self.Ts)[:, None] @ Ts)

    def log_density(self, x: Tangents) -> FloatArray:
        """Of draws by each of them, shares included ``(J, S)``."""
        white = (x - self.means[:, None]) @ np.swapaxes(np.linalg.inv(self.roots), 1, 2)
        constant = gammaln(0.5 * (_TAIL + 6)) - gammaln(0.5 * _TAIL) - 3 * np.log(_TAIL * np.pi)
        log = constant - np.linalg.slogdet(self.roots)[1] + np.log(self.shares)
        return np.asarray(log[:, None] - 0.5 * (_TAIL + 6) * np.log1p(np.sum(white * white, axis=-1) / _TAIL))

    def draw(self, round_: int) -> tuple[Transforms, FloatArray]:
        """Poses, and the shared errors that are expected there."""
        normal, factor = _chance(round_)
        which = np.searchsorted(np.cumsum(self.shares), (np.arange(_DRAWS) + 0.5) / _DRAWS)
        which = np.minimum(which, len(self.shares) - 1)
        x = self.means[which] + factor[:, None] * (self.roots[which] @ normal[..., None])[..., 0]
        return self.Ts[which] @ SE3.exp(x), self.z[which] + (self.follows[which] @ x[..., None])[..., 0]

    def adapted(self, x: Tangents, w: FloatArray, log: FloatArray) -> Proposals:
        """With moments and shares of the weighted draws that each is responsible for, by its log density ``(J, S)``."""
        own = np.exp(log - log_sum(log, axis=0)) * w
        mass = own.sum(axis=1)
        share = mass / mass.sum()
        weight = own / np.maximum(mass, 1e-300)[:, None]
        means = np.einsum("js,jsi->ji", weight, x)
        gap = x - means[:, None]
        C = np.einsum("js,jsi,jsk->jik", weight, gap, gap)
        old = self.roots @ np.swapaxes(self.roots, 1, 2)
        few = 1 / np.maximum(np.sum(weight**2, axis=1), 1e-300) < 3 * x.shape[-1]
        C = np.where(few[:, None, None], old, C + 0.05 * old)
        means = np.where(few[:, None], self.means, means)
        shares = 0.1 / len(share) + 0.9 * share
        return replace(self, means=means, roots=np.asarray(np.linalg.cholesky(C)), shares=shares)


@cache
def _chance(round_: int) -> tuple[FloatArray, FloatArray]:
    """The same standard normal draws and heavy-tailed factors every time, so that an answer can be repeated."""
    rng = np.random.default_rng((1991, 6, round_))
    half = _DRAWS // 2
    normal, factor = rng.normal(size=(half, 6)), np.sqrt(_TAIL / rng.chisquare(_TAIL, half))
    order = rng.permutation(_DRAWS)
    return np.concatenate([normal, -normal])[order], np.concatenate([factor, factor])[order]
