"""What else is known, put to poses that sensed features gave: weights, poses and covariances.

What was known of the pose beforehand moves poses and weighs them; paths on which nothing was met weigh them. The
features' estimate stands for their likelihood, as a normal density about it; directions that they leave free have the
variance of a uniform draw there, and take what the prior says of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tanteo.answers.part_motions import part_scale
from tanteo.answers.pose_prior import PosePrior, log_density_within, prior_rows
from tanteo.features import SharedError, shared_root, stacked_covariance
from tanteo.inference.unknown_place import log_place_of_unknown
from tanteo.lie import SE3, SO3
from tanteo.localization import PoseEstimate, SharedGiven
from tanteo.matching.belief import Mode
from tanteo.matching.box import SURE, left_by
from tanteo.matching.model import PartModel
from tanteo.parts import Part
from tanteo.special import chi2_survival, log_sum
from tanteo.typing import Covariances, FloatArray, Tangents, Transforms, Vectors

_STEPS, _SETTLED = 20, 1e-9
"""Steps at most; squared length of a step, in standard deviations, that ends them."""

_CONTRADICTED = 1e-4
"""Share of a pose's distribution in a box below which they contradict each other: the pose stays where it was felt."""

_DRAWS = 64
"""Of a pose, over which what else is known is averaged."""

Beside = Callable[[PartModel, Transforms, FloatArray], FloatArray]
"""Log probability ``(S,)`` of something, given a part at poses ``(S, 4, 4)`` and whitened shared errors ``(S, D)``."""

_LEAST = 1e-300
"""Of a probability: what underflowed is not impossible."""

_SPINS = 36
"""Turns about the axis of a solid of revolution from which the one that a rough pose names is looked for."""


@dataclass(frozen=True, slots=True, eq=False)
class Located:
    """A mode with its pose.

    Attributes:
        mode: the part and what of it the features are.
        estimate: from the features alone.
        T_world_part: pose, with all that is known ``(4, 4)``.
        covariance: of it ``(6, 6)``, part frame, right perturbation [m, rad].
        covariance_same_robot: the same with shared errors known.
        free: motions that nothing resists ``(k, 6)``, part frame [m, rad].
        chi2: joint squared Mahalanobis distance of features and prior.
        dof: its degrees of freedom.
        prior_p: p-value of what was known beforehand, beside the features.
    """

    mode: Mode
    estimate: PoseEstimate
    T_world_part: Transforms
    covariance: Covariances
    covariance_same_robot: Covariances
    free: Tangents
    chi2: float
    dof: int
    prior_p: float = 1.0

    @classmethod
    def by_features(cls, mode: Mode, estimate: PoseEstimate) -> Located:
        """Where the features alone put the part."""
        known = estimate.covariance, estimate.covariance_same_robot, estimate.free, estimate.chi2, estimate.dof
        return cls(mode, estimate, estimate.T_world_part, *known)

    def shared_given(self, errors: Sequence[SharedError]) -> SharedGiven:
        """Errors that readings share, whitened and in this order, given the pose; those of no feature are as stated."""
        own, covariance = self.estimate.shared_given, stacked_covariance(errors)
        names = np.repeat([error.name for error in errors], [len(error.covariance) for error in errors])
        rows = np.concatenate([np.flatnonzero(names == name) for name in ["", *self.estimate.shared]])
        mean, follows = np.zeros(len(names)), np.zeros((len(names), 6))
        mean[rows], follows[rows], covariance[np.ix_(rows, rows)] = own.mean, own.follows, own.covariance
        white = np.asarray(np.linalg.pinv(shared_root(errors)), dtype=np.float64)
        moved = SE3.log(SE3.inverse(self.estimate.T_world_part) @ self.T_world_part)
        return SharedGiven(mean, follows, covariance).mapped(white).about(moved)


def place(
    found: Sequence[Located], unknown: float, prior: PosePrior, middle: Vectors, radius: float
) -> tuple[tuple[Located, ...], float]:
    """Weigh poses by what was known beforehand, and move them to what both say together.

    Args:
        found: from the features alone, all that matter.
        unknown: probability of none of the parts, by the features.
        prior: what was known.
        middle: of what was sensed, in the world ``(3,)`` [m].
        radius: of the workspace [m], of which the features' probabilities take any place as likely.

    Returns:
        The same, best first, with their probabilities, and that of none of the parts.
    """
    if not found:
        return (), unknown
    placed, logs = zip(*(_placed(one, prior, radius) for one in found), strict=True)
    centroid = np.mean([one.mode.model.middle for one in found], axis=0)
    return _reweighed(placed, unknown, np.array(logs), log_place_of_unknown(prior, centroid, middle, radius))


def weigh_beside(
    found: Sequence[Located], unknown: float, beside: Beside, shared: Sequence[SharedError] = ()
) -> tuple[tuple[Located, ...], float]:
    """Weigh poses by something else that depends on them, averaged over their distributions.

    Args:
        found: poses, all that matter.
        unknown: probability of none of the parts.
        beside: log probability of it, of a part at poses; none of the parts takes it as it is.
        shared: errors that move what was seen as they move the readings.

    Returns:
        As of :func:`place`.
    """
    rng, logs = np.random.default_rng(1991), []
    draws, others = (rng.normal(size=(_DRAWS, d)) for d in (6, len(stacked_covariance(shared))))
    for one in found:
        xi = draws @ np.linalg.cholesky(one.covariance).T
        z = one.shared_given(shared).drawn(xi, others)
        logs.append(float(log_sum(beside(one.mode.model, one.T_world_part @ SE3.exp(xi), z)) - np.log(_DRAWS)))
    return _reweighed(found, unknown, np.array(logs), 0.0)


def _reweighed(
    found: Sequence[Located], unknown: float, logs: FloatArray, log_of_unknown: float
) -> tuple[tuple[Located, ...], float]:
    """Best first, with probabilities that have these factors more, and that of none of the parts."""
    log = np.log([max(one.mode.probability, _LEAST) for one in found]) + logs
    log_unknown = np.log(max(unknown, _LEAST)) + log_of_unknown
    total = float(log_sum(np.append(log, log_unknown)))
    P = np.exp(log - total)
    order = [k for k in np.argsort(-log, kind="stable") if P[k] > 0 or k == np.argmax(log)]
    answers = tuple(replace(found[k], mode=replace(found[k].mode, probability=float(P[k]))) for k in order)
    return answers, float(np.exp(log_unknown - total))


def _placed(one: Located, prior: PosePrior, radius: float) -> tuple[Located, float]:
    """The pose with the prior, and the log of how much more probable that makes it."""
    part = one.mode.model.part
    assert part is not None
    P = np.asarray(np.linalg.inv(one.covariance), dtype=np.float64)
    T, H, chi2 = _fused(part, prior, _start(part, prior, one.T_world_part), one.T_world_part, P)
    _, J = prior_rows(prior, part, T[None])
    free, fixed = _still_free(part, one, J[0])
    log = -0.5 * chi2 + 0.5 * np.linalg.slogdet(P)[1] - 0.5 * np.linalg.slogdet(H)[1]
    covariance = np.asarray(np.linalg.inv(H), dtype=np.float64)
    log += float(log_density_within(prior, radius))
    same = np.asarray(np.linalg.inv(np.linalg.inv(one.covariance_same_robot) + J[0].T @ J[0]), dtype=np.float64)
    prior_p = chi2_survival(chi2, max(J.shape[1] - fixed, 1)) if J.shape[1] else 1.0
    out = replace(
        one, T_world_part=T, covariance=covariance, covariance_same_robot=same, free=free,
        chi2=one.chi2 + chi2, dof=one.dof + J.shape[1] - fixed, prior_p=prior_p,
    )  # fmt: skip
    return _in_box(part, prior, out, log)


def _in_box(part: Part, prior: PosePrior, one: Located, log: float) -> tuple[Located, float]:
    """The pose with what a box leaves of its distribution, and the log of how much more probable that makes it."""
    if prior.box is None:
        return one, log
    Ts, Cs = np.stack([one.T_world_part] * 2), np.stack([one.covariance, one.covariance_same_robot])
    left = left_by(prior.box, part, Ts, Cs)
    log, share = log + float(left.log_share[0]), float(np.exp(left.log_share[0]))
    if share > SURE or len(one.free):
        return one, log
    p = min(one.prior_p, share)
    if share < _CONTRADICTED:  # what it leaves is of poses that nothing was felt at
        return replace(one, prior_p=p), log
    T, (C, same) = Ts[0] @ SE3.exp(left.means[0]), left.covariances
    return replace(one, T_world_part=T, covariance=C, covariance_same_robot=same, prior_p=p), log


def _fused(
    part: Part, prior: PosePrior, T: Transforms, T0: Transforms, P: FloatArray
) -> tuple[Transforms, FloatArray, float]:
    """Pose of least squared distance from ``T0`` under information ``P`` and from the prior; information, distance."""
    for _ in range(_STEPS):
        d = SE3.log(SE3.inverse(T0) @ T)
        Jd, (r, J) = SE3.right_jacobian_inverse(d), prior_rows(prior, part, T[None])
        H = Jd.T @ P @ Jd + J[0].T @ J[0]
        step = -np.linalg.solve(H, Jd.T @ P @ d + J[0].T @ r[0])
        if step @ H @ step < _SETTLED:
            break
        T = T @ SE3.exp(step)
    return T, H, float(d @ P @ d + r[0] @ r[0])


def _start(part: Part, prior: PosePrior, T: Transforms) -> Transforms:
    """The pose turned as a rough pose names it, where the part's continuous symmetry leaves that open."""
    if prior.T_world_part is None or not part.symmetry.continuous:
        return T
    gap = SE3.inverse(T) @ prior.T_world_part
    if part.symmetry.spherical:
        turns, centre = gap[None, :3, :3], part.centroid
    else:
        assert part.symmetry.axis is not None
        centre, axis = part.symmetry.axis
        turns = SO3.exp((2 * np.pi / _SPINS * np.arange(_SPINS))[:, None] * axis)
    spun = T @ SE3.from_parts(turns, centre - turns @ centre)
    r, _ = prior_rows(prior, part, spun)
    return np.asarray(spun[np.argmin(np.sum(r * r, axis=1))])


def _still_free(part: Part, one: Located, J: FloatArray) -> tuple[Tangents, int]:
    """Motions that the prior does not resist either ``(k, 6)``, and how many it does.

    It resists what it knows to less than the uniform draw that stands for not knowing.
    """
    if not len(one.free):
        return one.free, 0
    along = np.linalg.pinv(one.free.T)
    wide = np.linalg.cholesky(along @ one.covariance @ along.T).T @ one.free
    _, resisted, turn = np.linalg.svd(J @ wide.T)
    resisted = np.pad(resisted, (0, len(turn) - len(resisted)))
    scale, left = part_scale(part), turn[resisted < 1] @ wide
    basis, _ = np.linalg.qr(np.linalg.solve(scale, left.T))
    return np.asarray((scale @ basis).T, dtype=np.float64), int(np.sum(resisted >= 1))
