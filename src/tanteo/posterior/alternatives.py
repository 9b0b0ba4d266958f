"""Pose factors that are mixtures: groups of factors of which exactly one applies, and normal densities of the pose.

An image may show another object than the part that is sensed. Then the factor of the image does not apply, and the
prior of the pose without the image does. ``Alternatives`` is the mixture of both; ``_core/factors/alternatives.hpp``
has the formula.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tanteo import _core
from tanteo.factors import ContactPoints, FreeRays, PoseFactor
from tanteo.factors.factor import leaf_columns, state_columns
from tanteo.geometry import SE3
from tanteo.geometry.special import log_sum
from tanteo.geometry.typing import BoolArray, FloatArray, Transforms
from tanteo.parts import Part
from tanteo.posterior.answers.part_motions import part_scale, symmetry_motions
from tanteo.posterior.problem import PoseMixture, Problem
from tanteo.posterior.sampling.modes import Mode
from tanteo.posterior.settings import DEFAULTS


@dataclass(frozen=True, slots=True, eq=False)
class NormalPoses(PoseFactor):
    """Normal densities of the pose of each part; all poses that are equal by symmetry have the same density.

    Attributes:
        mixtures: densities of each part. The weights of a part sum to its probability relative to the prior of the
            parts.
        count: number of samples of the densities of a part from which a search starts.
        seed: seed of these samples.
    """

    mixtures: Mapping[Part, PoseMixture]
    count: int = DEFAULTS.samples.widely
    seed: int = 0

    @property
    def is_pose_prior(self) -> bool:
        """Return True: the factor is a prior density of the pose."""
        return True

    def poses(self, part: Part) -> Transforms:
        """Return means and samples of the normal densities of a part ``(K, 4, 4)``, from which a search starts."""
        if part not in self.mixtures:
            return np.zeros((0, 4, 4))
        known = self.mixtures[part]
        rng = np.random.default_rng(self.seed)
        shares = np.exp(known.log_weights - log_sum(known.log_weights))
        rows = rng.choice(len(shares), size=self.count, p=shares / shares.sum())
        L = np.asarray(np.linalg.cholesky(known.covariances))[rows]
        drawn = known.Ts[rows] @ SE3.exp((L @ rng.normal(size=(self.count, 6, 1)))[..., 0])
        return np.concatenate([known.Ts, drawn])

    def term(self, part: Part, first: int, common: int = 0) -> _core.PoseTerm:
        """Compile the densities for one part; they add no shared error."""
        if part not in self.mixtures:
            return _core.normal_poses(np.zeros((0, 4, 4)), np.zeros((0, 6, 6)), np.zeros(0))
        known, turns = self.mixtures[part], part.symmetry.Ts
        back = SE3.inverse(turns)  # log(T0^-1 T S) = Ad(S^-1) log((T0 S^-1)^-1 T)
        roots, logs = zip(*(_root(part, C) for C in known.covariances), strict=True)
        means = (known.Ts[:, None] @ back).reshape(-1, 4, 4)
        own = (np.stack(roots)[:, None] @ SE3.adjoint(back)).reshape(-1, 6, 6)
        log = np.repeat(known.log_weights + np.array(logs) - np.log(len(turns)), len(turns))
        return _core.normal_poses(np.ascontiguousarray(means), np.ascontiguousarray(own), log)


def _root(part: Part, covariance: FloatArray) -> tuple[FloatArray, float]:
    """Return a root R of the information ``R'R``, without the continuous symmetry, and the log normalization.

    The density is uniform over turns about the axis of a part of revolution, or about the centre of a ball.
    """
    rows, S = symmetry_motions(part), part_scale(part)
    unit = np.linalg.inv(S)
    keep = (np.eye(6) - rows.T @ rows) @ unit
    values, vectors = np.linalg.eigh(keep @ covariance @ keep.T)
    values, vectors = values[len(rows) :], vectors[:, len(rows) :]
    root = np.zeros((6, 6))
    root[: len(values)] = (vectors.T / np.sqrt(values)[:, None]) @ unit
    turns = {0: 0.0, 1: np.log(2 * np.pi), 3: np.log(8 * np.pi**2)}[len(rows)]
    turns -= float(np.sum(np.log(np.linalg.norm((rows @ S.T)[:, 3:], axis=1))))  # lengths of the rows for a radian
    log = -0.5 * len(values) * np.log(2 * np.pi) - 0.5 * np.sum(np.log(values)) - np.linalg.slogdet(S)[1] - turns
    return root, float(log)


@dataclass(frozen=True, slots=True, eq=False)
class Alternatives(PoseFactor):
    """Mixture over groups of factors: exactly one group applies.

    Attributes:
        groups: groups of factors; the likelihood of a group is the product of the densities of its factors.
        log_weights: log of the prior probability of each group, plus the log density of the measurements that only
            other groups explain ``(k,)``.
        log_unknown: log density of all measurements if the object is unknown.
    """

    groups: tuple[tuple[PoseFactor, ...], ...]
    log_weights: FloatArray
    log_unknown: float = 0.0

    @property
    def states(self) -> int:
        """Return the number of shared errors of all factors, those in common once."""
        return state_columns(self._factors, 0)[1]

    @property
    def _factors(self) -> tuple[PoseFactor, ...]:
        return tuple(factor for group in self.groups for factor in group)

    @property
    def is_pose_prior(self) -> bool:
        """Return whether each group has a prior density of the pose."""
        return all(any(factor.is_pose_prior for factor in group) for group in self.groups)

    def poses(self, part: Part) -> Transforms:
        """Return the poses of a part that any factor suggests ``(K, 4, 4)``."""
        return np.concatenate([factor.poses(part) for group in self.groups for factor in group])

    def alternatives(self) -> tuple[tuple[PoseFactor, ...], ...]:
        """Return the groups of factors."""
        return self.groups

    def term(self, part: Part, first: int, common: int = 0) -> _core.PoseTerm:
        """Compile the mixture for one part; shared errors follow one another, group by group."""
        at = iter(state_columns(self._factors, first)[0])
        groups = [[factor.term(part, *next(at)) for factor in group] for group in self.groups]
        return _core.alternatives(groups, np.ascontiguousarray(self.log_weights, dtype=np.float64))


def first_applies(problem: Problem, modes: Sequence[Mode]) -> BoolArray:
    """Return flags of the modes at which the first group of each mixture is the most probable one ``(M,)``.

    Args:
        problem: problem of the modes.
        modes: modes of its posterior.
    """
    flags = np.ones(len(modes), dtype=np.bool_)
    columns = leaf_columns(problem.pose_factors, problem.points.shared_jacobian.shape[2])
    for factor in problem.pose_factors:
        if not isinstance(factor, Alternatives):
            continue
        for k, mode in enumerate(modes):
            logs = factor.log_weights + [_log_density(group, problem, mode, columns) for group in factor.groups]
            flags[k] &= int(np.argmax(logs)) == 0
    return flags


def _log_density(
    group: tuple[PoseFactor, ...], problem: Problem, mode: Mode, columns: Mapping[int, list[int]]
) -> float:
    """Return the log density of a group of factors alone at a mode, with the prior of its shared errors."""
    alone = Problem(ContactPoints.none(), FreeRays.none(), problem.priors, pose_factors=group)
    z = np.zeros((1, alone.states))
    for one, places in leaf_columns(group, 0).items():
        z[0, places] = mode.z[columns[one]]
    part = mode.prepared
    return float(_core.log_densities(part.shape, alone.compiled(part), np.ascontiguousarray(mode.T_peak[None]), z)[0])
