"""Iterated weighted least squares on SE(3) for a batch of hypotheses (``math.md`` section 6).

The state is the pose error ``xi`` (right, in the part frame) and the shared errors ``z``, whitened to a standard normal
prior. Every block has pairings of one relation; blocks of different relations are summed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tanteo.fitting.localization.relations import Relation
from tanteo.geometry import SE3, maximize
from tanteo.geometry.typing import BoolArray, Covariances, FloatArray, Transforms


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """Pairings of one relation, ``n`` for every hypothesis of a batch; leading axes broadcast.

    Attributes:
        relation: relation of the pairings.
        Ts_world_feature: sensed frames ``(*batch, n, 4, 4)``.
        Ps: independent covariances of the sensed features ``(*batch, n, k, k)``.
        Ts_part_model: model frames in the part ``(*batch, n, 4, 4)``.
        P_models: tolerance of the made part over the model kind's rows ``(*batch, n, km, km)``.
        shared_jacobian: whitened shared errors, ``p += gain z``, ``(*batch, n, k, D)``.
        radii: of curved model features ``(*batch, n)`` [m], 0 otherwise.
        active: pairings that count ``(*batch, n)``.
    """

    relation: Relation
    Ts_world_feature: Transforms
    Ps: Covariances
    Ts_part_model: Transforms
    P_models: Covariances
    shared_jacobian: FloatArray
    radii: FloatArray
    active: BoolArray


@dataclass(frozen=True, slots=True, eq=False)
class Linearized:
    """One block at one pose: ``f + H xi + K z + noise of covariance S``; inactive rows are zero with unit ``S``."""

    f: FloatArray
    H: FloatArray
    K: FloatArray
    S: Covariances


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """Fixed point of the iteration, one for each hypothesis.

    Attributes:
        T_world_part: poses ``(*batch, 4, 4)``.
        z: whitened shared errors ``(*batch, D)``.
        information: information over ``(xi, z)``, priors included ``(*batch, 6 + D, 6 + D)``.
        gradient: gradient ``-d(chi2 / 2)`` ``(*batch, 6 + D)``, zero at the fixed point.
        chi2: joint squared Mahalanobis distance, priors included ``(*batch)``.
        equations: number of scalar equations ``(*batch)``.
        log_det: sum of ``log |S|`` over the pairings ``(*batch)``.
        steps: squared length of the last step in standard deviations ``(*batch)``.
    """

    T_world_part: Transforms
    z: FloatArray
    information: FloatArray
    gradient: FloatArray
    chi2: FloatArray
    equations: FloatArray
    log_det: FloatArray
    steps: FloatArray


def linearize(
    block: Block, T_world_part: Transforms, z: FloatArray, Ts_model_part: Transforms | None = None
) -> Linearized:
    """Return residuals of a block and their derivatives by pose and shared errors.

    ``Ts_model_part`` are the inverse model frames, for callers with many poses.
    """
    T_part_feature = SE3.inverse(T_world_part)[..., None, :, :] @ block.Ts_world_feature
    T_model_feature = (SE3.inverse(block.Ts_part_model) if Ts_model_part is None else Ts_model_part) @ T_part_feature
    f, D = block.relation.linearize(T_model_feature, block.radii)
    H = -D @ SE3.adjoint_inverse(T_part_feature)
    G = D[..., list(block.relation.sensed.rows)]
    Gt = np.swapaxes(G, -1, -2)
    S = G @ block.Ps @ Gt
    if np.any(block.P_models):
        rows = list(block.relation.model.rows)
        G_model = -(D @ SE3.adjoint_inverse(T_model_feature))[..., rows]
        S = S + G_model @ block.P_models @ np.swapaxes(G_model, -1, -2)
    K = G @ block.shared_jacobian
    f = f + (K @ z[..., None, :, None])[..., 0]
    on = block.active[..., None]
    shape = np.broadcast_shapes(f.shape, on.shape)
    f = np.where(on, f, 0.0)
    H, K = (np.where(on[..., None], M, 0.0) for M in (H, K))
    S = np.where(on[..., None], S, np.eye(shape[-1]))
    return Linearized(np.broadcast_to(f, shape), H, K, S)


def assemble(
    blocks: Sequence[Block],
    T: Transforms,
    z: FloatArray,
    prior: tuple[Transforms, FloatArray] | None = None,
    *,
    inverses: Sequence[Transforms] | None = None,
    determinants: bool = True,
) -> Solution:
    """Return the normal equations of all blocks and priors at one state, without a step.

    ``inverses`` are the blocks' inverse model frames; without ``determinants``, ``log_det`` is left zero.
    """
    batch, D = T.shape[:-2], z.shape[-1]
    information = np.zeros((*batch, 6 + D, 6 + D))
    gradient = np.zeros((*batch, 6 + D))
    chi2, equations, log_det = (np.zeros(batch) for _ in range(3))
    for b, block in enumerate(blocks):
        at = linearize(block, T, z, None if inverses is None else inverses[b])
        J = np.concatenate([at.H, np.broadcast_to(at.K, (*at.H.shape[:-1], D))], axis=-1) if D else at.H
        W = np.linalg.inv(at.S)
        JW = np.swapaxes(J, -1, -2) @ W
        information += (JW @ J).sum(axis=-3)
        gradient -= (JW @ at.f[..., None])[..., 0].sum(axis=-2)
        chi2 += np.sum(at.f * (W @ at.f[..., None])[..., 0], axis=(-2, -1))
        if determinants:
            log_det += np.linalg.slogdet(at.S)[1].sum(axis=-1)
        equations += block.relation.size * np.broadcast_to(block.active, at.f.shape[:-1]).sum(axis=-1)
    information[..., 6:, 6:] += np.eye(D)
    gradient[..., 6:] -= z
    chi2 += np.sum(z * z, axis=-1)
    if prior is not None:
        chi2 += _add_prior(information, gradient, T, *prior)
    return Solution(T, z, information, gradient, chi2, equations, log_det, np.full(batch, np.inf))


def _add_prior(
    information: FloatArray, gradient: FloatArray, T: Transforms, T0: Transforms, L0: FloatArray
) -> FloatArray:
    """Add ``Log(T0^-1 T) ~ N(0, L0^-1)``; returns its chi-square."""
    e = SE3.log(SE3.inverse(T0) @ T)
    J = SE3.right_jacobian_inverse(e)
    JtL = np.swapaxes(J, -1, -2) @ L0
    information[..., :6, :6] += JtL @ J
    gradient[..., :6] -= (JtL @ e[..., None])[..., 0]
    return np.asarray(np.einsum("...i,...ij,...j->...", e, L0, e))


def gauss_newton(
    blocks: Sequence[Block],
    T_start: Transforms,
    n_shared: int,
    *,
    prior: tuple[Transforms, FloatArray] | None = None,
    hold: FloatArray | None = None,
    iterations: int = 50,
    tolerance: float = 1e-20,
) -> Solution:
    """Iterate from ``T_start`` ``(*batch, 4, 4)`` until steps are below ``tolerance`` squared standard deviations.

    ``S`` is re-evaluated at every pose and constant during the step. The last linearization is at the returned pose.
    ``hold`` ``(6, 6)`` is information that damps the steps but not the answer: it keeps the pose from drifting along
    unobserved directions.
    """
    inverses = [SE3.inverse(block.Ts_part_model) for block in blocks]
    damping = np.zeros((6 + n_shared, 6 + n_shared))
    damping[:6, :6] = 0.0 if hold is None else hold

    def linearize(state: tuple[Transforms, FloatArray]) -> tuple[FloatArray, FloatArray]:
        at = assemble(blocks, *state, prior, inverses=inverses, determinants=False)
        return at.information + damping, at.gradient

    def moved(state: tuple[Transforms, FloatArray], step: FloatArray) -> tuple[Transforms, FloatArray]:
        # a step is at most about a radian: far starts come in, near ones are untouched
        step = step * np.minimum(1.0, 1.0 / np.maximum(np.linalg.norm(step[..., 3:6], axis=-1), 1e-300))[..., None]
        return state[0] @ SE3.exp(step[..., :6]), state[1] + step[..., 6:]

    start = np.array(T_start), np.zeros((*T_start.shape[:-2], n_shared))
    (T, z), steps = maximize(start, linearize, moved, iterations, tolerance)
    return replace(assemble(blocks, T, z, prior, inverses=inverses), steps=steps)


def pose_information(information: FloatArray) -> FloatArray:
    """Return the information on the pose, shared errors marginalized by the Schur complement ``(*batch, 6, 6)``."""
    if information.shape[-1] == 6:
        return information
    cross = information[..., :6, 6:]
    return information[..., :6, :6] - cross @ np.linalg.solve(information[..., 6:, 6:], np.swapaxes(cross, -1, -2))


def take(solution: Solution, ok: BoolArray) -> Solution:
    """Return the hypotheses of a batch for which ``ok`` is true."""
    return Solution(
        solution.T_world_part[ok],
        solution.z[ok],
        solution.information[ok],
        solution.gradient[ok],
        solution.chi2[ok],
        solution.equations[ok],
        solution.log_det[ok],
        solution.steps[ok],
    )
