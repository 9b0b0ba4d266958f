"""The linear problem of a plan: what is known before, and what each reading that can be made would tell."""

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
from tanteo.posterior import PreparedPart, observed_covariance

_CANDIDATES = 800
"""Readings among which the plan is chosen."""

_LEAST = 40
"""So many readings are kept at least, however rarely they meet their faces."""

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
        probe: what senses.
        candidates: readings that can be made.
        faces: index of the face that each meets ``(N,)``.
        points: where it does, world ``(N, 3)`` [m].
        rows: how each moves with pose, bias and base ``(N, D)``.
        variances: of what is new at each ``(N,)`` [m^2].
        prior: covariance of all of them before ``(D, D)``.
        limit: of the pose, if it were known exactly relative to the robot ``(6, 6)``.
        places: what has to be within the tolerance, corners or a feature.
        moves: how these move with the pose ``(K, 3, 6)``.
        chosen_by: placements by which readings are chosen.
        judged_by: others, by which the choice is judged.
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
        return float(np.mean(self._off(xi) <= tolerance))

    def kept(self, chosen: IntArray, tolerance: float) -> float:
        """Share of the placements at which all places are within a tolerance, by the readings that meet their faces."""
        out, known, total = self.judged_by, np.linalg.inv(self.prior), 0.0
        for met, k in out.patterns(chosen):
            C = self.after(chosen[met])
            rest = C @ known  # what of the first error no reading has seen
            values, vectors = np.linalg.eigh(C - rest @ C)
            noise = out.noise[k] @ (vectors * np.sqrt(values.clip(0.0))).T
            total += np.sum(self._off((noise - (out.errors[k] @ rest.T)[:, None])[..., :6]) <= tolerance)
        return float(total / (len(out) * out.noise.shape[1]))

    def _off(self, xi: FloatArray) -> FloatArray:
        """How far the worst place is off at perturbations of the pose ``(*batch, 6)`` [m]."""
        return np.asarray(np.linalg.norm(np.einsum("cij,...j->...ci", self.moves, xi), axis=-1).max(axis=-1))

    def lost_with_each(self, chosen: list[int], tolerance: float) -> FloatArray:
        """About the share of the placements where the tolerance is lost, each of the candidates added ``(N,)``."""
        by, lost = self.chosen_by, np.zeros(len(self.rows))
        rows = np.array(chosen, dtype=np.int64)
        for met, k in by.patterns(rows):
            C, meets = self.after(rows[met]), by.meets[k].sum(axis=0)
            without = self._lost(self.cost(self.squares(C)), tolerance)
            lost += meets * self._lost(self.with_each(C), tolerance) + (len(k) - meets) * without
        return lost / len(by)

    def _lost(self, costs: FloatArray, tolerance: float) -> FloatArray:
        """Chance that an error in space of such mean squares is larger than the tolerance."""
        from scipy.special import gammaincc  # slow to import

        return np.asarray(gammaincc(1.5, 1.5 * tolerance**2 / costs))

    def promise(self, chosen: IntArray, tolerance: float) -> Promise:
        """What some readings bring."""
        if_met = self.chance(self.after(chosen), tolerance)
        shares = (of[:, chosen].all(axis=1).mean() for of in (self.judged_by.meets, self.judged_by.room))
        return Promise(self.kept(chosen, tolerance), if_met, *map(float, shares))

    def best(self, tolerance: float) -> float:
        """Share of the placements at which all that can be sensed, together, keeps the tolerance."""
        return self.kept(np.arange(len(self.rows)), tolerance)

    def steadied(self) -> Design:
        """With readings that count the less, the less often they meet their faces."""
        share = np.maximum(self.chosen_by.meets.mean(axis=0), 1 / len(self.chosen_by))
        return replace(self, variances=self.variances / share**2)


def design_of(
    start: Start, probe: Probe, seed: int, feature: str | None = None, steady: float = 0.9, room: float = 0.98
) -> Design | None:
    """The problem of one part at one prior pose, linear about it; None if the probe reaches no place.

    Args:
        start: one part at one prior pose.
        probe: what senses.
        seed: of the places that are tried.
        feature: name of one that has to be within the tolerance; the corners of the part's box if not given.
        steady: share of the placements at which a reading must meet its face; less if few do.
        room: share of them at which the probe must have room for it; less if it rarely has.
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
    if max(probe.base_sds) > 0:  # the robot is off: all that it reads moves as if the part had moved the other way
        rows.append(-g)
    points = candidates.origins + ranges[:, None] * candidates.directions
    own, places = probe.own_variance(ranges, cosines), places_of(target.part, feature)
    return Design(
        target, probe, candidates, faces, points, np.concatenate(rows, axis=1), own, prior, limit, places,
        places.moves, chosen_by.take(kept), judged_by.take(kept),
    )  # fmt: skip


def _steadiest(among: Placements, steady: float, room: float) -> IntArray:
    """Candidates that reach both shares of the placements, or so many that come nearest."""
    margin = np.minimum(among.meets.mean(axis=0) - steady, among.room.mean(axis=0) - room)
    return np.flatnonzero(margin >= min(0.0, np.sort(margin)[::-1][min(_LEAST, len(margin)) - 1]))


def _prior(start: Start, probe: Probe) -> tuple[Covariances, Covariances]:
    """Covariance of pose, bias and base, and that of the pose if it were known exactly relative to the robot."""
    from scipy.linalg import block_diag  # slow to import

    pose = observed_covariance(start.targets[0].part, start.covariances[0])
    pose = pose + _TINY * start.covariances[0]  # invertible, where a round part may spin
    blocks, limit = [pose], np.zeros((6, 6))
    if probe.shared_sd > 0:
        blocks.append(np.full((1, 1), probe.shared_sd**2))
    if max(probe.base_sds) > 0:
        A = SE3.adjoint_inverse(start.Ts[0])
        base = (A * np.repeat(np.square(np.maximum(probe.base_sds, _EXACT)), 3)) @ A.T
        blocks.append(base)
        limit = pose @ np.linalg.solve(pose + base, base)
    return block_diag(*blocks), limit
