"""Linear problem of a plan: the prior, and the information of each candidate reading."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tanteo.geometry import SE3
from tanteo.geometry.typing import Covariances, FloatArray, IntArray, Vectors
from tanteo.planning.candidates import Candidates, propose
from tanteo.planning.placements import Placements, Promise, placements
from tanteo.planning.places import Places, places_of
from tanteo.planning.predictions import beams
from tanteo.planning.probe import Probe
from tanteo.planning.samples import even_normals
from tanteo.planning.start import Start
from tanteo.planning.state import begin
from tanteo.posterior import PreparedPart
from tanteo.posterior.answers import observed_covariance

_CANDIDATES = 800
"""Number of candidates of a plan."""

_LEAST = 40
"""Least number of candidates that stay although they rarely meet their faces."""

_TINY = 1e-9
"""Fraction of the variances that stays along motions that symmetry makes irrelevant."""

_EXACT = 1e-7
"""Standard deviation in place of zero, if a robot is exact in position or in rotation only [m, rad]."""

_POSES = 2048
"""Number of poses for the probability of the tolerance."""


@dataclass(frozen=True, slots=True, eq=False)
class Design:
    """Candidates as rows of a linear problem in pose perturbation, bias and robot base, ``D`` states in all.

    Bias and base are states only if the probe has these errors.

    Attributes:
        target: the part.
        probe: sensor model.
        candidates: candidate readings.
        faces: index of the face of each candidate ``(N,)``.
        points: met points, world frame ``(N, 3)`` [m].
        rows: Jacobian over pose, bias and base ``(N, D)``.
        variances: independent variance of each candidate ``(N,)`` [m^2].
        prior: prior covariance of the states ``(D, D)``.
        limit: covariance of the pose in the limit of infinitely many readings ``(6, 6)``.
        places: places that have to keep the tolerance.
        moves: Jacobian of these places over the pose ``(K, 3, 6)``.
        chosen_by: placements for the choice of readings.
        judged_by: independent placements for the evaluation of the choice.
    """

    target: PreparedPart
    probe: Probe
    candidates: Candidates
    faces: IntArray
    points: Vectors
    rows: FloatArray
    variances: FloatArray
    prior: Covariances
    limit: Covariances
    places: Places
    moves: FloatArray
    chosen_by: Placements
    judged_by: Placements

    def after(self, chosen: IntArray) -> Covariances:
        """Return the covariance of the states after some readings."""
        G = self.rows[chosen]
        return np.asarray(np.linalg.inv(np.linalg.inv(self.prior) + (G.T / self.variances[chosen]) @ G))

    def pose(self, C: Covariances) -> Covariances:
        """Return the covariance of the pose."""
        return C[:6, :6]

    def cost(self, squares: FloatArray) -> FloatArray:
        """Return the cost of mean square errors of the places ``(*batch, K)``, which weights the worst most."""
        return np.asarray(np.sum(squares**4, axis=-1) ** 0.25)

    def squares(self, C: Covariances) -> FloatArray:
        """Return the mean square error of every place ``(K,)`` [m^2]."""
        return np.einsum("cij,jk,cik->c", self.moves, self.pose(C), self.moves)

    def cost_of(self, chosen: list[int]) -> float:
        """Return the cost after some readings."""
        return float(self.cost(self.squares(self.after(np.array(chosen)))))

    def with_each(self, C: Covariances) -> FloatArray:
        """Return the cost after each candidate is added ``(N,)``."""
        c = self.rows @ C
        s = np.sum(c * self.rows, axis=1) + self.variances
        moved = np.einsum("cij,nj->nci", self.moves, c[:, :6])
        return self.cost(self.squares(C) - np.sum(moved**2, axis=-1) / s[:, None])

    def chance(self, C: Covariances, tolerance: float) -> float:
        """Return the probability that all places keep a tolerance."""
        values, vectors = np.linalg.eigh(self.pose(C))
        xi = even_normals(_POSES) @ (vectors * np.sqrt(values.clip(0.0))).T
        return float(np.mean(self._off(xi) <= tolerance))

    def kept(self, chosen: IntArray, tolerance: float) -> float:
        """Return the probability of the tolerance over all placements; only readings that meet their faces count."""
        out, known, total = self.judged_by, np.linalg.inv(self.prior), 0.0
        for met, k in out.patterns(chosen):
            C = self.after(chosen[met])
            rest = C @ known  # part of the prior error that no reading observes
            values, vectors = np.linalg.eigh(C - rest @ C)
            noise = out.noise[k] @ (vectors * np.sqrt(values.clip(0.0))).T
            total += np.sum(self._off((noise - (out.errors[k] @ rest.T)[:, None])[..., :6]) <= tolerance)
        return float(total / (len(out) * out.noise.shape[1]))

    def _off(self, xi: FloatArray) -> FloatArray:
        """Return the largest displacement of a place at perturbations of the pose ``(*batch, 6)`` [m]."""
        return np.asarray(np.linalg.norm(np.einsum("cij,...j->...ci", self.moves, xi), axis=-1).max(axis=-1))

    def lost_with_each(self, chosen: list[int], tolerance: float) -> FloatArray:
        """Return the approximate probability that the tolerance is missed after each candidate is added ``(N,)``."""
        by, lost = self.chosen_by, np.zeros(len(self.rows))
        rows = np.array(chosen, dtype=np.int64)
        for met, k in by.patterns(rows):
            C, meets = self.after(rows[met]), by.meets[k].sum(axis=0)
            without = self._lost(self.cost(self.squares(C)), tolerance)
            lost += meets * self._lost(self.with_each(C), tolerance) + (len(k) - meets) * without
        return lost / len(by)

    def _lost(self, costs: FloatArray, tolerance: float) -> FloatArray:
        """Return the probability that an error in space with given mean squares exceeds the tolerance."""
        from scipy.special import gammaincc  # slow to import

        return np.asarray(gammaincc(1.5, 1.5 * tolerance**2 / costs))

    def promise(self, chosen: IntArray, tolerance: float) -> Promise:
        """Return the probabilities of some readings, see :class:`Promise`."""
        if_met = self.chance(self.after(chosen), tolerance)
        shares = (of[:, chosen].all(axis=1).mean() for of in (self.judged_by.meets, self.judged_by.room))
        return Promise(self.kept(chosen, tolerance), if_met, *map(float, shares))

    def best(self, tolerance: float) -> float:
        """Return the probability of the tolerance with all candidates together."""
        return self.kept(np.arange(len(self.rows)), tolerance)

    def steadied(self) -> Design:
        """Return the problem with larger variances for candidates that often miss their faces."""
        share = np.maximum(self.chosen_by.meets.mean(axis=0), 1 / len(self.chosen_by))
        return replace(self, variances=self.variances / share**2)


def design_of(
    start: Start, probe: Probe, seed: int, feature: str | None = None, steady: float = 0.9, room: float = 0.98
) -> Design | None:
    """Return the linear problem of one part at one prior pose, or None if the probe reaches no place.

    Args:
        start: one part at one prior pose.
        probe: sensor model.
        seed: seed of the candidate places.
        feature: feature that has to keep the tolerance; None for the corners of the part's box.
        steady: least fraction of the placements at which a candidate must meet its face; lower if few do.
        room: least fraction of the placements at which its approach must be clear; lower if few are.
    """
    target, T = start.targets[0], start.Ts[0]
    candidates = propose(begin(start), probe, _CANDIDATES, seed, anywhere=False)
    if not len(candidates):
        return None
    prior, limit = _prior(start, probe)
    chosen_by, judged_by = placements(target, T, prior, candidates, probe)
    kept = _steadiest(chosen_by, steady, room)
    candidates = candidates.take(kept)
    ranges, cosines, faces, g = beams(target, T[None], candidates.origins, candidates.directions)
    ranges, cosines, faces, g = ranges[:, 0], cosines[:, 0], faces[:, 0], g[:, 0]
    rows = [g]
    if probe.shared_sd > 0:
        rows.append(np.ones((len(g), 1)))
    if max(probe.base_sds) > 0:  # an error of the robot acts like the inverse motion of the part
        rows.append(-g)
    points = candidates.origins + ranges[:, None] * candidates.directions
    own, places = probe.own_variance(ranges, cosines), places_of(target.part, feature)
    return Design(
        target, probe, candidates, faces, points, np.concatenate(rows, axis=1), own, prior, limit, places,
        places.moves, chosen_by.take(kept), judged_by.take(kept),
    )  # fmt: skip


def _steadiest(among: Placements, steady: float, room: float) -> IntArray:
    """Return the candidates that reach both fractions of the placements, or those nearest to them."""
    margin = np.minimum(among.meets.mean(axis=0) - steady, among.room.mean(axis=0) - room)
    return np.flatnonzero(margin >= min(0.0, np.sort(margin)[::-1][min(_LEAST, len(margin)) - 1]))


def _prior(start: Start, probe: Probe) -> tuple[Covariances, Covariances]:
    """Return the prior covariance of the states, and the pose covariance in the limit of infinitely many readings."""
    from scipy.linalg import block_diag  # slow to import

    pose = observed_covariance(start.targets[0].part, start.covariances[0])
    pose = pose + _TINY * start.covariances[0]  # invertible also for the spin of a round part
    blocks, limit = [pose], np.zeros((6, 6))
    if probe.shared_sd > 0:
        blocks.append(np.full((1, 1), probe.shared_sd**2))
    if max(probe.base_sds) > 0:
        A = SE3.adjoint_inverse(start.Ts[0])
        base = (A * np.repeat(np.square(np.maximum(probe.base_sds, _EXACT)), 3)) @ A.T
        blocks.append(base)
        limit = pose @ np.linalg.solve(pose + base, base)
    return block_diag(*blocks), limit
