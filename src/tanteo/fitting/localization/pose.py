"""Pose of a part from paired features: estimate, covariance, and unobserved directions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from tanteo.defaults import SIGNIFICANCE
from tanteo.errors import InputError
from tanteo.features import SharedError
from tanteo.fitting.localization.observability import describe_motion, unobserved_directions
from tanteo.fitting.localization.pairing import Pairing, build_blocks, model_length, model_middle
from tanteo.fitting.localization.scaling import motion_scale
from tanteo.fitting.localization.shared_given import SharedGiven
from tanteo.fitting.localization.solve import Block, Solution, gauss_newton, pose_information, take
from tanteo.fitting.localization.start import first_poses
from tanteo.fitting.localization.summary import (
    alternatives,
    covariance_with_free,
    hold_motions,
    pairing_distances,
    shared_estimates,
    wrong_side,
)
from tanteo.geometry import check_covariances, check_transforms
from tanteo.geometry.limits import LEAST_SD, check_length
from tanteo.geometry.special import chi2_survival
from tanteo.geometry.typing import Covariances, FloatArray, Tangents, Transforms, Vectors
from tanteo.words import Finding
from tanteo.words.findings import PairingsAgree, PairingsContradict, PairingsFree

_AGREE = PairingsAgree()


@dataclass(frozen=True, slots=True, eq=False)
class PoseEstimate:
    """Estimated pose with covariance and unobserved directions.

    Attributes:
        T_world_part: pose ``(4, 4)``.
        covariance: covariance ``(6, 6)``, order x y z rx ry rz, part frame, right perturbation [m, rad], shared errors
            included. Free directions have the variance of a uniform density over ``length`` and over a full turn.
        covariance_relative: covariance given the shared errors. If these are the robot's base alone, it is the
            repeatability with the same robot.
        free: motions ``(k, 6)`` that no pairing constrains, part frame, pure translations first [m, rad].
        unobserved: the unobserved directions in words.
        chi2: joint squared Mahalanobis distance of the pairings, and of the prior if there is one.
        dof: degrees of freedom of ``chi2``: equations of the pairings, six more with a prior, less the six of the pose
            without the free ones.
        p_value: probability of a larger ``chi2`` if all is as stated; 1 without redundancy.
        distances: squared Mahalanobis distance of each pairing at the estimate, under its own noise; infinite if sides
            contradict (a plane from behind, a bore with a boss).
        alternatives: other poses ``(k, 4, 4)`` that fit about as well (undirected edges, few points).
        shared: estimated shared errors by name, with their standard deviations.
        shared_given: the shared errors given the pose.
        status: ``located`` or ``insufficient``.
        finding: whether the pairings fix the pose and agree.
    """

    T_world_part: Transforms
    covariance: Covariances
    covariance_relative: Covariances
    free: Tangents
    unobserved: tuple[str, ...]
    chi2: float
    dof: int
    p_value: float
    distances: FloatArray
    alternatives: Transforms
    shared: dict[str, tuple[FloatArray, FloatArray]] = field(default_factory=dict)
    shared_given: SharedGiven = field(default_factory=SharedGiven.none)
    status: str = "located"
    finding: Finding = _AGREE

    @property
    def message(self) -> str:
        """Return the finding in words."""
        return self.finding.message


def estimate_pose(
    pairings: Sequence[Pairing],
    *,
    prior: tuple[Transforms, Covariances] | None = None,
    start: Transforms | None = None,
    length: float | None = None,
    middle: Vectors | None = None,
) -> PoseEstimate:
    """Estimate the pose from pairings by maximum likelihood, with shared errors as states (``math.md`` section 6).

    Args:
        pairings: sensed features with their model features; at least one without a prior.
        prior: mean pose ``T_world_part`` ``(4, 4)`` and covariance ``(6, 6)``, order x y z rx ry rz, part frame, right
            perturbation [m, rad], positive definite; for example from an image.
        start: initial pose ``T_world_part`` ``(4, 4)``; by default in closed form from directions and points.
        length: size of the part [m], the scale of rotations; by default from the model features.
        middle: middle of the part in its frame ``(3,)`` [m], the centre of rotations; by default from the model
            features.

    Returns:
        The pose. Free directions stay where the start put them and are named; nothing is invented about them.

    Raises:
        InputError: without pairings, for kinds that cannot be paired, a prior or start that is no rigid motion, or a
            prior without spread in some direction.
    """
    if prior is not None:
        prior = _checked(*prior)
    if start is not None:
        start = check_transforms("start", start)
    if length is not None:
        check_length("length", length, LEAST_SD)
    if not pairings and prior is None:
        raise InputError("pairings: expected at least one pairing of a sensed with a model feature, got none.")
    blocks, L, errors, order = build_blocks(pairings)
    scale = motion_scale(length or model_length(pairings), model_middle(pairings) if middle is None else middle)
    information = None if prior is None else (prior[0], np.asarray(np.linalg.inv(prior[1])))
    if start is not None:
        starts = np.asarray(start)[None]
    else:
        starts = first_poses(blocks) if pairings else np.zeros((0, 4, 4))
        starts = starts if prior is None else np.concatenate([starts, prior[0][None]])
    solution, N = _best(blocks, starts, L.shape[1], information, scale)
    best = int(np.argmin(solution.chi2))
    return _report(pairings, blocks, order, solution, best, N, L, errors, scale, of_prior=6 * (prior is not None))


def _checked(T_world_part: Transforms, covariance: Covariances) -> tuple[Transforms, Covariances]:
    """Return a valid prior."""
    T = check_transforms("prior, T_world_part", T_world_part)
    C = check_covariances("prior, covariance", covariance, 6)
    if T.shape != (4, 4) or C.shape != (6, 6):
        raise InputError(f"prior: expected one pose and one covariance, got shapes {T.shape} and {C.shape}.")
    if np.linalg.eigvalsh(C)[0] <= 0:
        raise InputError("prior, covariance: expected a positive variance in every direction, got zero.")
    return T, C


def _best(
    blocks: Sequence[Block],
    starts: Transforms,
    n_shared: int,
    prior: tuple[Transforms, FloatArray] | None,
    scale: FloatArray,
) -> tuple[Solution, Tangents]:
    """Iterate from every start, with the unobserved directions held."""
    solution = gauss_newton(
        blocks, starts, n_shared, prior=prior, iterations=15, hold=hold_motions(np.eye(6), scale, 1e-6)
    )
    wrong = np.any([wrong_side(block, solution.T_world_part).any(axis=-1) for block in blocks], axis=0)
    if blocks and not wrong.all():
        solution = take(solution, ~wrong)
    best = solution.T_world_part[int(np.argmin(solution.chi2))]
    N = unobserved_directions(blocks, best, n_shared, scale) if prior is None else np.zeros((0, 6))
    hold = hold_motions(N, scale, 1e6)
    return gauss_newton(blocks, solution.T_world_part, n_shared, prior=prior, hold=hold), N


def _report(
    pairings: Sequence[Pairing],
    blocks: list[Block],
    order: list[int],
    solution: Solution,
    best: int,
    N: Tangents,
    L: FloatArray,
    errors: tuple[SharedError, ...],
    scale: FloatArray,
    *,
    of_prior: int,
) -> PoseEstimate:
    T, chi2 = solution.T_world_part[best], float(solution.chi2[best])
    distances = pairing_distances(blocks, order, T, solution.z[best])
    distances[[pairing.other_side for pairing in pairings]] = np.inf
    chi2 = chi2 if np.all(np.isfinite(distances)) else np.inf
    information = solution.information[best]
    covariance = covariance_with_free(pose_information(information), N, scale)
    dof = int(solution.equations[best]) + of_prior - (6 - len(N))
    unobserved = tuple(str(describe_motion(xi, T, scale)) for xi in N)
    p_value = chi2_survival(chi2, dof) if dof > 0 else 1.0
    insufficient = bool(unobserved)
    return PoseEstimate(
        T_world_part=T,
        covariance=covariance,
        covariance_relative=covariance_with_free(information[:6, :6], N, scale),
        free=N @ scale.T,
        unobserved=unobserved,
        chi2=chi2,
        dof=dof,
        p_value=p_value,
        distances=distances,
        alternatives=alternatives(solution, best, covariance),
        shared=shared_estimates(solution.z[best], information, N, L, errors, scale),
        shared_given=SharedGiven.at(solution.z[best], information).mapped(L),
        status="insufficient" if insufficient else "located",
        finding=_finding(unobserved, p_value),
    )


def _finding(unobserved: tuple[str, ...], p_value: float) -> Finding:
    if unobserved:
        return PairingsFree(unobserved)
    return PairingsContradict(p_value) if p_value < SIGNIFICANCE else PairingsAgree()
