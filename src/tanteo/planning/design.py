"""Linear problem of a plan: the prior, and the information of each candidate reading."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from tanteo.geometry import SE3
from tanteo.geometry.typing import Covariances, FloatArray, IntArray, Rotations, Transforms, Vectors
from tanteo.planning.assumed import assumed_errors, drawn_ranges, stated_columns
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
from tanteo.sensors.error_states import ErrorState, UnstatedError

_CANDIDATES = 800
"""Number of candidates of a plan."""

_LEAST = 40
"""Smallest number of candidates that are kept even if they often miss their faces."""

_TINY = 1e-9
"""Fraction of the variance that is kept along motions that the symmetry of the part makes irrelevant."""

_EXACT = 1e-7
"""Smallest standard deviation of the robot's position and rotation, so that covariances are invertible [m, rad]."""

_NEGLIGIBLE = 1e-8
"""Numerical: factor on the variances of all candidates that stands for infinitely many readings."""

_POSES = 2048
"""Number of sampled poses for the probability of the tolerance."""


@dataclass(frozen=True, slots=True, eq=False)
class Design:
    """Linear model of a plan: each candidate reading measures one combination of ``D`` states.

    The states are the perturbation of the pose, the bias of the sensor, the error of the robot base and the offset of
    each face of the made part. All but the pose are states only if the probe has these errors.

    Attributes:
        target: the part.
        probe: sensor model.
        candidates: candidate readings.
        faces: index of the face of each candidate ``(N,)``.
        points: points at which the candidates hit the surface, world frame ``(N, 3)`` [m].
        rows: Jacobian of each range over the states ``(N, D)``.
        variances: variance of the independent error of each candidate ``(N,)`` [m^2].
        prior: prior covariance of the states ``(D, D)``.
        limit: covariance of the pose in the limit of infinitely many readings ``(6, 6)``.
        places: points to which the tolerance applies.
        moves: Jacobian of these points over the pose ``(K, 3, 6)``.
        rotation: expected rotation of the part ``(3, 3)``.
        chosen_by: sampled placements by which readings are chosen.
        judged_by: independent placements by which the choice is evaluated.
        stated: further stated errors that the readings share.
        sources: source of each state ``(D,)``: ``pose``, ``bias``, ``robot``, ``form``, or the name of a stated error.
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
    rotation: Rotations
    chosen_by: Placements
    judged_by: Placements
    stated: tuple[ErrorState, ...] = ()
    sources: tuple[str, ...] = ()

    def after(self, chosen: IntArray) -> Covariances:
        """Return the covariance of the states after the readings of some candidates ``(D, D)``.

        Args:
            chosen: rows of the candidates.
        """
        G = self.rows[chosen]
        return np.asarray(np.linalg.inv(np.linalg.inv(self.prior) + (G.T / self.variances[chosen]) @ G))

    def pose(self, C: Covariances) -> Covariances:
        """Return the covariance of the pose, the first block of a covariance of the states ``(6, 6)``.

        Args:
            C: covariance of the states ``(D, D)``.
        """
        return C[:6, :6]

    def cost(self, squares: FloatArray) -> FloatArray:
        """Return the 4-norm of the points' mean square errors ``(*batch, K)``, in which the worst has most weight.

        Args:
            squares: mean square error of every point ``(*batch, K)`` [m^2].
        """
        return np.asarray(np.sum(squares**4, axis=-1) ** 0.25)

    def squares(self, C: Covariances) -> FloatArray:
        """Return the mean square error of every point for a covariance of the states ``(K,)`` [m^2].

        Args:
            C: covariance of the states ``(D, D)``.
        """
        return np.einsum("cij,jk,cik->c", self.moves, self.pose(C), self.moves)

    def cost_of(self, chosen: list[int]) -> float:
        """Return the cost after the readings of some candidates.

        Args:
            chosen: rows of the candidates.
        """
        return float(self.cost(self.squares(self.after(np.array(chosen)))))

    def with_each(self, C: Covariances) -> FloatArray:
        """Return the cost for a covariance of the states after each candidate is added ``(N,)``.

        Args:
            C: covariance of the states ``(D, D)``.
        """
        c = self.rows @ C
        s = np.sum(c * self.rows, axis=1) + self.variances
        moved = np.einsum("cij,nj->nci", self.moves, c[:, :6])
        return self.cost(self.squares(C) - np.sum(moved**2, axis=-1) / s[:, None])

    def chance(self, C: Covariances, tolerance: float) -> float:
        """Return the probability that all points are within a tolerance, for a covariance of the states.

        Args:
            C: covariance of the states ``(D, D)``.
            tolerance: largest allowed displacement of a point [m].
        """
        return float(np.mean(self._errors(C) <= tolerance))

    def least_goal(self, C: Covariances, confidence: float) -> float:
        """Return the smallest tolerance that all points keep with a probability, for a covariance of the states [m].

        Args:
            C: covariance of the states ``(D, D)``.
            confidence: probability.
        """
        return float(np.quantile(self._errors(C), confidence))

    def _errors(self, C: Covariances) -> FloatArray:
        """Return the largest displacement of a point at poses that are sampled from a covariance of the states [m]."""
        values, vectors = np.linalg.eigh(self.pose(C))
        return self._off(even_normals(_POSES) @ (vectors * np.sqrt(values.clip(0.0))).T)

    def limit_without(self, sources: Collection[str]) -> Covariances:
        """Return the covariance of the pose after infinitely many readings without some errors ``(6, 6)``.

        Args:
            sources: sources of these errors.
        """
        kept = np.flatnonzero([source not in sources for source in self.sources])
        return _limit(self.rows[:, kept], self.variances, self.prior[np.ix_(kept, kept)])

    def kept(self, chosen: IntArray, tolerance: float, *, assumed: bool = False) -> float:
        """Return the probability of the tolerance over the placements; only readings that hit their faces count.

        Args:
            chosen: rows of the candidates.
            tolerance: largest allowed displacement of a point [m].
            assumed: whether the readings also have the errors that :func:`tanteo.locate` assumes if none are stated.
        """
        out, known, total = self.judged_by, np.linalg.inv(self.prior), 0.0
        for hit, k in out.patterns(chosen):
            C = self.after(chosen[hit])
            rest = C @ known  # part of the prior error that no reading observes
            values, vectors = np.linalg.eigh(C - rest @ C)
            noise = out.noise[k] @ (vectors * np.sqrt(values.clip(0.0))).T
            xi = (noise - (out.errors[k] @ rest.T)[:, None])[..., :6]
            if assumed and hit.any():
                xi = xi + self._moved_by_assumed(C, chosen[hit], k, out.noise.shape[1])
            total += np.sum(self._off(xi) <= tolerance)
        return float(total / (len(out) * out.noise.shape[1]))

    def _moved_by_assumed(self, C: Covariances, rows: IntArray, placements: IntArray, draws: int) -> FloatArray:
        """Return errors of the pose by assumed errors, which its estimate ignores ``(k, draws, 6)`` [m, rad]."""
        errors = self._assumed(rows)
        normals = self.rows[rows, :3] @ self.rotation.T
        gain = C[:6] @ (self.rows[rows].T / self.variances[rows])
        return np.asarray(drawn_ranges(errors, normals, placements, draws) @ gain.T)

    def _assumed(self, rows: IntArray) -> tuple[UnstatedError, ...]:
        """Return the errors that are assumed for some candidates because they are not stated."""
        c = self.candidates
        return assumed_errors(self.points[rows], c.directions[rows], c.ranges[rows], self.probe, self.stated)

    def _off(self, xi: FloatArray) -> FloatArray:
        """Return the largest displacement of a point at perturbations of the pose ``(*batch, 6)`` [m]."""
        return np.asarray(np.linalg.norm(np.einsum("cij,...j->...ci", self.moves, xi), axis=-1).max(axis=-1))

    def lost_with_each(self, chosen: list[int], tolerance: float) -> FloatArray:
        """Return the approximate probability of a missed tolerance after each candidate is added ``(N,)``.

        Args:
            chosen: rows of the candidates chosen so far.
            tolerance: largest allowed displacement of a point [m].
        """
        by, lost = self.chosen_by, np.zeros(len(self.rows))
        rows = np.array(chosen, dtype=np.int64)
        for hit, k in by.patterns(rows):
            C, meets = self.after(rows[hit]), by.meets[k].sum(axis=0)
            without = self._lost(self.cost(self.squares(C)), tolerance)
            lost += meets * self._lost(self.with_each(C), tolerance) + (len(k) - meets) * without
        return lost / len(by)

    def _lost(self, costs: FloatArray, tolerance: float) -> FloatArray:
        """Return the probability that an isotropic error in space with given mean squares exceeds the tolerance."""
        from scipy.special import gammaincc  # slow to import

        return np.asarray(gammaincc(1.5, 1.5 * tolerance**2 / costs))

    def promise(self, chosen: IntArray, tolerance: float) -> Promise:
        """Return the probabilities of success of some candidates, see :class:`Promise`.

        Args:
            chosen: rows of the candidates.
            tolerance: largest allowed displacement of a point [m].
        """
        if_all_hit = self.chance(self.after(chosen), tolerance)
        fractions = (of[:, chosen].all(axis=1).mean() for of in (self.judged_by.meets, self.judged_by.clear))
        assumed = self.kept(chosen, tolerance, assumed=True) if self._assumed(chosen) else math.nan
        return Promise(self.kept(chosen, tolerance), assumed, if_all_hit, *map(float, fractions))

    def best(self, tolerance: float) -> float:
        """Return the probability of the tolerance with all candidates together.

        Args:
            tolerance: largest allowed displacement of a point [m].
        """
        return self.kept(np.arange(len(self.rows)), tolerance)

    def steadied(self) -> Design:
        """Return the problem with each variance divided by the squared fraction of hits, which prefers sure hits."""
        share = np.maximum(self.chosen_by.meets.mean(axis=0), 1 / len(self.chosen_by))
        return replace(self, variances=self.variances / share**2)


def design_of(
    start: Start,
    probe: Probe,
    seed: int,
    feature: str | None = None,
    stated: tuple[ErrorState, ...] = (),
    *,
    steady: float = 0.9,
    clear: float = 0.98,
) -> Design | None:
    """Return the linear model of a plan for one part at one prior pose, or None if no candidate is reachable.

    Args:
        start: one part at one prior pose.
        probe: sensor model.
        seed: seed of the random surface points.
        feature: feature to which the tolerance applies; None for the corners of the part's box.
        stated: further stated errors that the readings share.
        steady: fraction of the placements at which a candidate must hit its face; less if few candidates satisfy this.
        clear: fraction of the placements at which its approach must be clear; less if few candidates satisfy this.
    """
    target, T = start.targets[0], start.Ts[0]
    candidates = propose(begin(start), probe, _CANDIDATES, seed, anywhere=False)
    if not len(candidates):
        return None
    aimed = np.unique(candidates.face) if probe.face_variance > 0 else np.zeros(0, dtype=np.int64)
    points, normals = candidates.aims, _normals(target, T, candidates)
    effects, rest, names = stated_columns(points, candidates.directions, normals, stated)
    prior = _prior(start, probe, len(aimed), effects.shape[1])
    chosen_by, judged_by = placements(target, T, prior, candidates, probe)
    kept = _steadiest(chosen_by, steady, clear)
    candidates, effects, rest = candidates.take(kept), effects[kept], rest[kept]
    ranges, cosines, faces, g = beams(target, T[None], candidates.origins, candidates.directions)
    ranges, cosines, faces, g = ranges[:, 0], cosines[:, 0], faces[:, 0], g[:, 0]
    rows, sources = [g], ["pose"] * 6
    if probe.shared_sd > 0:
        rows.append(np.ones((len(g), 1)))
        sources.append("bias")
    if max(probe.base_sds) > 0:  # an error of the robot acts like the inverse motion of the part
        rows.append(-g)
        sources += ["robot"] * 6
    if len(aimed):
        rows.append(np.where(faces[:, None] == aimed, -1 / cosines[:, None], 0.0))
        sources += ["form"] * len(aimed)
    rows.append(effects)
    points = candidates.origins + ranges[:, None] * candidates.directions
    own, places = probe.own_variance(ranges, cosines) + rest, places_of(target.part, feature)
    of_states = np.concatenate(rows, axis=1)
    return Design(
        target, probe, candidates, faces, points, of_states, own, prior, _limit(of_states, own, prior), places,
        places.moves, T[:3, :3], chosen_by.take(kept), judged_by.take(kept), stated,
        (*sources, *names),
    )  # fmt: skip


def _steadiest(among: Placements, steady: float, clear: float) -> IntArray:
    """Return the rows of the candidates that reach both fractions of the placements, or the best ones if few do."""
    margin = np.minimum(among.meets.mean(axis=0) - steady, among.clear.mean(axis=0) - clear)
    return np.flatnonzero(margin >= min(0.0, np.sort(margin)[::-1][min(_LEAST, len(margin)) - 1]))


def _normals(target: PreparedPart, T: Transforms, candidates: Candidates) -> Vectors:
    """Return the normals at the candidates over the cosine of the incidence, world frame ``(N, 3)``."""
    g = beams(target, T[None], candidates.origins, candidates.directions)[3][:, 0]
    return np.asarray(g[:, :3] @ T[:3, :3].T)


def _prior(start: Start, probe: Probe, faces: int, others: int) -> Covariances:
    """Return the prior covariance of the states for numbers of aimed faces and of states of other stated errors."""
    from scipy.linalg import block_diag  # slow to import

    pose = observed_covariance(start.targets[0].part, start.covariances[0])
    blocks = [pose + _TINY * start.covariances[0]]  # invertible also for the spin of a round part
    if probe.shared_sd > 0:
        blocks.append(np.full((1, 1), probe.shared_sd**2))
    if max(probe.base_sds) > 0:
        A = SE3.adjoint_inverse(start.Ts[0])
        blocks.append((A * np.repeat(np.square(np.maximum(probe.base_sds, _EXACT)), 3)) @ A.T)
    blocks += [probe.face_variance * np.eye(faces), np.eye(others)]
    return np.asarray(block_diag(*blocks))


def _limit(rows: FloatArray, variances: FloatArray, prior: Covariances) -> Covariances:
    """Return the covariance of the pose in the limit of infinitely many readings at all candidates ``(6, 6)``."""
    information = np.linalg.inv(prior) + (rows.T / (_NEGLIGIBLE * variances)) @ rows
    return np.asarray(np.linalg.inv(information)[:6, :6])
