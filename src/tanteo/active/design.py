"""The linear problem of a plan: what is known before, and what each reading that can be made would tell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from tanteo.active.belief import begin
from tanteo.active.candidates import Candidates, propose
from tanteo.active.places import Places, places_of
from tanteo.active.probe import Probe
from tanteo.active.samples import beams, draw, even_normals, predict
from tanteo.active.start import Start
from tanteo.lie import SE3
from tanteo.matching.verdict import observed_covariance
from tanteo.surface_search import Target
from tanteo.typing import Covariances, FloatArray, IntArray, Vectors

_CANDIDATES = 800
"""Readings among which the plan is chosen."""

_STEADY, _LEAST = 0.9, 40
"""Share of the possible poses at which a reading must meet its face; at least so many readings are kept."""

_TINY = 1e-9
"""Share of the variances that is left where nothing needs to be known."""

_EXACT = 1e-7
"""Of a robot that is exact in place or in turn, but not in the other [m, rad]."""

_POSES = 2048
"""Poses by which the chance to be within the tolerance is counted."""


@dataclass(frozen=True, slots=True, eq=False)
class Design:
    """Candidates as rows of a linear problem: perturbations of the pose, bias and robot's base, ``D`` in all.

    Bias and base are there only if the probe has them.

    Attributes:
        target: the part.
        candidates: readings that can be made.
        faces: index of the face that each meets ``(N,)``.
        points: where it does, world ``(N, 3)`` [m].
        rows: how each moves with pose, bias and base ``(N, D)``.
        variances: of what is new at each ``(N,)`` [m^2].
        prior: covariance of all of them before ``(D, D)``.
        limit: of the pose, if it were known exactly relative to the robot ``(6, 6)``.
        places: what has to be within the tolerance, corners or a feature.
        moves: how these move with the pose ``(K, 3, 6)``.
        meets: share of the poses at which each meets its face ``(N,)``.
    """

    target: Target
    candidates: Candidates
    faces: IntArray
    points: Vectors
    rows: FloatArray
    variances: FloatArray
    prior: Covariances
    limit: Covariances
    places: Places
    moves: FloatArray
    meets: FloatArray

    def after(self, chosen: IntArray) -> Covariances:
        """Covariance of pose, bias and base after some readings."""
        G = self.rows[chosen]
        return np.asarray(np.linalg.inv(np.linalg.inv(self.prior) + (G.T / self.variances[chosen]) @ G))

    def pose(self, C: Covariances) -> Covariances:
        """Of the pose in the world."""
        return C[:6, :6]

    def cost(self, squares: FloatArray) -> FloatArray:
        """Of mean square errors of the places ``(*batch, K)``: the worst count most."""
        return np.asarray(np.sum(squares**4, axis=-1) ** 0.25)

    def squares(self, C: Covariances) -> FloatArray:
        """Mean square error of every place ``(K,)``."""
        return np.einsum("cij,jk,cik->c", self.moves, self.pose(C), self.moves)

    def cost_of(self, chosen: list[int]) -> float:
        """Cost after some readings."""
        return float(self.cost(self.squares(self.after(np.array(chosen)))))

    def with_each(self, C: Covariances) -> FloatArray:
        """Cost after each of the candidates is added ``(N,)``."""
        c = self.rows @ C
        s = np.sum(c * self.rows, axis=1) + self.variances
        moved = np.einsum("cij,nj->nci", self.moves, c[:, :6])
        return self.cost(self.squares(C) - np.sum(moved**2, axis=-1) / s[:, None])

    def chance(self, C: Covariances, tolerance: float) -> float:
        """That all places are within a tolerance."""
        values, vectors = np.linalg.eigh(self.pose(C))
        xi = even_normals(_POSES) @ (vectors * np.sqrt(values.clip(0.0))).T
        off = np.linalg.norm(np.einsum("cij,sj->sci", self.moves, xi), axis=-1).max(axis=1)
        return float(np.mean(off <= tolerance))


def design_of(start: Start, probe: Probe, seed: int, feature: str | None = None) -> Design | None:
    """The problem of one part at one rough pose, linear about it; None if the probe reaches no place.

    Args:
        start: one part at one rough pose.
        probe: what senses.
        seed: of the places that are tried.
        feature: name of one that has to be within the tolerance; the corners of the part's box if not given.
    """
    belief, target, T = begin(start), start.targets[0], start.Ts[0]
    candidates = propose(belief, probe, _CANDIDATES, seed, anywhere=False)
    if not len(candidates):
        return None
    share = _steadiness(start, candidates)
    kept = share >= min(_STEADY, np.sort(share)[::-1][min(_LEAST, len(share)) - 1])
    candidates, share = candidates.take(kept), share[kept]
    ranges, cosines, faces, g = beams(target, T[None], candidates.origins, candidates.directions)
    ranges, cosines, faces, g = ranges[:, 0], cosines[:, 0], faces[:, 0], g[:, 0]
    prior = observed_covariance(target.part, start.covariances[0])
    prior = prior + _TINY * start.covariances[0]  # invertible, where a round part may spin
    rows, blocks, limit = [g], [prior], np.zeros((6, 6))
    if probe.shared_sd > 0:
        rows.append(np.ones((len(g), 1)))
        blocks.append(np.full((1, 1), probe.shared_sd**2))
    if max(probe.base_sds) > 0:  # the robot is off: all that it reads moves as if the part had moved the other way
        A = SE3.adjoint_inverse(T)
        base = (A * np.repeat(np.square(np.maximum(probe.base_sds, _EXACT)), 3)) @ A.T
        rows.append(-g)
        blocks.append(base)
        limit = prior @ np.linalg.solve(prior + base, base)
    points = candidates.origins + ranges[:, None] * candidates.directions
    own, places = probe.own_variance(ranges, cosines), places_of(target.part, feature)
    return Design(
        target, candidates, faces, points, np.concatenate(rows, axis=1), own, block_diag(*blocks), limit,
        places, places.moves, share,
    )  # fmt: skip


def _steadiness(start: Start, candidates: Candidates) -> FloatArray:
    """Share of the poses that the part may have at which each candidate meets its face ``(N,)``."""
    samples = draw(begin(start), 64)
    faces = predict(samples, candidates.origins, candidates.directions).faces
    return np.asarray((faces == candidates.face[:, None]) @ samples.weights)
