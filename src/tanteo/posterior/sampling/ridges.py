"""Paths between maxima along bent ridges of the posterior of one part.

Few measurements leave motions of the part free, and the poses that these lead to are a bent ridge of high density with
several maxima. A straight path between two of them leaves the ridge. Here the points of a path move to the ridge
across the path (string method, E, Ren and Vanden-Eijnden 2002), and the path is refined where it is still bent.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo import _core
from tanteo.geometry import SE3
from tanteo.geometry.limits import NOTABLE
from tanteo.geometry.special import chi2_quantile
from tanteo.geometry.typing import BoolArray, FloatArray, IntArray, Transforms
from tanteo.posterior.sampling.peaks import Objective, Peaks
from tanteo.posterior.settings import POSE_DOF

VALLEY = 0.5 * chi2_quantile(1 - NOTABLE, POSE_DOF)
"""Definition: fall of the log density from a maximum to the border of its 95 % region if it were normal [nats]."""

_REFINEMENTS = 3
"""Numerical: number of times that the steps of a path are halved; a bend then falls the density by 4^6 times less."""

_GAIN = 0.01
"""Numerical: gain of the log density that a Newton step must promise; a valley is 6 deep [nats]."""

_STEPS = 8
"""Numerical: Newton steps of a point of the path to its ridge."""


@dataclass(frozen=True, slots=True, eq=False)
class Paths:
    """Paths between pairs of poses of one part, with the other states along them.

    Attributes:
        objective: the part and the problem.
        Ts: poses of the points of each path, its ends included ``(P, K, 4, 4)``.
        zs: other states there ``(P, K, D)``.
    """

    objective: Objective
    Ts: Transforms
    zs: FloatArray

    def take(self, rows: BoolArray | IntArray) -> Paths:
        """Return some of the paths."""
        return Paths(self.objective, self.Ts[rows], self.zs[rows])

    def halved(self) -> Paths:
        """Return the paths with a further point in the middle of each step."""
        Ts, zs = self.Ts, self.zs
        half = 0.5 * SE3.log(SE3.inverse(Ts[:, :-1]) @ Ts[:, 1:])
        between = Ts[:, :-1] @ SE3.exp(half)
        count = 2 * Ts.shape[1] - 1
        new, others = np.empty((len(Ts), count, 4, 4)), np.empty((len(Ts), count, zs.shape[2]))
        new[:, ::2], new[:, 1::2] = Ts, between
        others[:, ::2], others[:, 1::2] = zs, 0.5 * (zs[:, :-1] + zs[:, 1:])
        return Paths(self.objective, new, others)

    def length(self) -> FloatArray:
        """Return the distance between the ends of each path, turns as shifts of the rim [m] ``(P,)``."""
        motions = self._motions(self.Ts[:, :1], self.Ts[:, -1:])[:, 0]
        return np.asarray(np.linalg.norm(motions / _rim(self.objective), axis=1))

    def lowest(self) -> FloatArray:
        """Return the smallest log density at the inner points of each path ``(P,)``."""
        return self._logs(np.arange(1, self.Ts.shape[1] - 1)).min(axis=1)

    def _logs(self, at: IntArray) -> FloatArray:
        """Return log densities at some points of each path ``(P, len(at))``."""
        Ts = np.ascontiguousarray(self.Ts[:, at].reshape(-1, 4, 4))
        zs = np.ascontiguousarray(self.zs[:, at].reshape(len(Ts), self.zs.shape[2]))  # there may be no states
        logs, _ = self._integrated(Ts, zs)
        return np.asarray(logs.reshape(len(self.Ts), len(at)))

    def _integrated(self, Ts: Transforms, zs: FloatArray) -> tuple[FloatArray, FloatArray]:
        shape = self.objective.prepared.shape
        return _core.marginals(shape, self.objective.core, np.ascontiguousarray(Ts), np.ascontiguousarray(zs))

    def on_ridge(self) -> Paths:
        """Return the paths after Levenberg-Marquardt steps of their inner points across the path."""
        objective, shape = self.objective, self.objective.prepared.shape
        unit = _rim(objective)
        P, D = len(self.Ts), self.zs.shape[2]
        Ts, zs = self.Ts.copy(), self.zs.copy()
        at, damping = np.ascontiguousarray(Ts[:, 1:-1].reshape(-1, 4, 4)), np.full(P * (Ts.shape[1] - 2), 1e-3)
        log, others = self._integrated(at, zs[:, 1:-1].reshape(len(at), D))
        diagonal, active = np.arange(POSE_DOF - 1), np.arange(len(at))
        for _ in range(_STEPS):
            Ts[:, 1:-1] = at.reshape(P, -1, 4, 4)
            chord = self._motions(Ts[:, 1:-1], Ts[:, 2:]) - self._motions(Ts[:, 1:-1], Ts[:, :-2])
            chord = chord.reshape(-1, 6)[active] / unit
            length = np.linalg.norm(chord, axis=1).clip(1e-300)
            across = unit[:, None] * _complement(chord / length[:, None])
            _, gradient, information = _core.slopes(shape, objective.core, at[active], others[active])
            back = np.swapaxes(across, 1, 2)
            H, pull = back @ objective.of_pose(information) @ across, back @ gradient[:, :POSE_DOF, None]
            H[:, diagonal, diagonal] *= 1 + damping[active, None]
            step = np.linalg.solve(H, pull)[..., 0]
            gain = 0.5 * np.abs(np.sum(step * pull[..., 0], axis=1))
            far = np.linalg.norm(step, axis=1) / (0.25 * length)
            x = (across @ (step / np.maximum(far, 1.0)[:, None])[..., None])[..., 0]
            moving = gain > _GAIN
            active, x = active[moving], x[moving]
            if not len(active):
                break
            moved = _core.place(at[active], x, shape.centre)
            there, followed = self._integrated(moved, others[active])
            better = there > log[active]
            at[active] = np.where(better[:, None, None], moved, at[active])
            others[active] = np.where(better[:, None], followed, others[active])
            log[active] = np.maximum(there, log[active])
            damping[active] *= np.where(better, 0.1, 10.0)
        Ts[:, 1:-1], zs[:, 1:-1] = at.reshape(P, -1, 4, 4), others.reshape(P, Ts.shape[1] - 2, D)
        return Paths(objective, Ts, zs)

    def _motions(self, bases: Transforms, Ts: Transforms) -> FloatArray:
        """Return motions about the centre of the part from poses to others ``(P, K, 6)``."""
        middle = np.eye(4)
        middle[:3, 3] = self.objective.prepared.shape.centre
        return SE3.log(SE3.inverse(bases @ middle) @ (Ts @ middle))


def log_tops(objective: Objective, peaks: Peaks) -> FloatArray:
    """Return the log densities of maxima, integrated over the other states as those of paths are ``(m,)``."""
    shape, Ts, zs = objective.prepared.shape, np.ascontiguousarray(peaks.Ts), np.ascontiguousarray(peaks.zs)
    return _core.marginals(shape, objective.core, Ts, zs)[0]


def follow(paths: Paths, least: FloatArray) -> FloatArray:
    """Return the smallest log density along the ridges that some straight paths lead to ``(P,)``.

    It is minus infinity where the ridge falls below a limit.

    Args:
        paths: straight paths, of the two ends or with points between.
        least: limit of each path ``(P,)``.
    """
    out, left = np.full(len(least), -np.inf), np.arange(len(least))
    for _ in range(_REFINEMENTS):
        if not len(left):
            break
        paths = paths.on_ridge()
        high = paths.lowest() > least[left]
        paths, left = paths.take(high).halved(), left[high]
        lowest = paths.lowest()
        done = lowest > least[left]
        out[left[done]] = lowest[done]
        paths, left = paths.take(~done), left[~done]
    return out


def regions_of_maxima(objective: Objective, peaks: Peaks) -> list[IntArray]:
    """Return the rows of the maxima of each region, the best first.

    A maximum is in the region of the nearest better one if the density is nowhere much lower on the straight path
    between them. So no maximum unites two better ones.

    Args:
        objective: the part and the problem.
        peaks: maxima, best first.
    """
    number = np.arange(len(peaks))
    if len(peaks) > 1:
        information, centre = objective.of_pose(peaks.information), objective.prepared.shape.centre
        x = np.stack([_core.offsets(T, peaks.Ts, centre) for T in peaks.Ts])
        gaps = np.einsum("kni,kij,knj->kn", x, information, x)
        nearest = np.array([int(np.argmin(gaps[:k, k])) for k in range(1, len(peaks))])
        ends = [np.stack([values[nearest], values[1:]], axis=1) for values in (peaks.Ts, peaks.zs)]
        paths = Paths(objective, *ends)
        tops = log_tops(objective, peaks)
        least = np.minimum(tops[nearest], tops[1:]) - VALLEY
        joined = paths.halved().halved().lowest() > least
        for k in np.flatnonzero(joined):
            number[k + 1] = number[nearest[k]]
    return [np.flatnonzero(number == k) for k in np.unique(number)]


def _rim(objective: Objective) -> FloatArray:
    """Return the motions that shift the rim of the part by one: turns are shifts of the rim ``(6,)``."""
    return np.r_[np.ones(3), np.full(3, 4 / objective.prepared.shape.diagonal)]


def _complement(unit: FloatArray) -> FloatArray:
    """Return orthonormal vectors across unit vectors, as columns ``(N, 6, 5)``: those of a Householder reflection."""
    v = unit.copy()
    v[:, 0] += np.where(unit[:, 0] < 0, -1.0, 1.0)
    reflected = np.eye(6) - 2 * v[:, :, None] * v[:, None] / np.sum(v * v, axis=1)[:, None, None]
    return np.asarray(reflected[:, :, 1:], dtype=np.float64)
