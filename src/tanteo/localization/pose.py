"""The pose of a part from paired features: estimate, covariance, and what stays unknown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np
from scipy.special import chdtrc

from tanteo.errors import InputError
from tanteo.features import EDGE, Feature, FeatureKind, SharedError, collect_shared
from tanteo.lie import SE3, SO3
from tanteo.localization.observability import describe_motion, free_motions
from tanteo.localization.relations import Relation, relation_between
from tanteo.localization.solve import Block, Solution, gauss_newton, linearise, pose_information, take
from tanteo.localization.start import first_pose, place
from tanteo.typing import BoolArray, Covariances, FloatArray, Tangents, Transforms

_MAX_FLIPPED_EDGES = 6
_CLOSE_CHI2 = 9.21
"""Poses whose chi-square is within this of the best (1 % of two degrees of freedom) are alternatives."""


@dataclass(frozen=True, slots=True, eq=False)
class ModelFeature:
    """A feature of the part as designed.

    Attributes:
        kind: vertex, edge, plane or a curved kind.
        T_part_feature: its frame in the part ``(4, 4)``; edge frames point along either direction of the edge.
        P: tolerance of the made part over the kind's rows ``(size, size)`` [m, rad]; zero if not given.
        radius: of a cylinder, sphere or circle [m].
        name: for reports.
    """

    kind: FeatureKind
    T_part_feature: Transforms
    P: Covariances | None = None
    radius: float = 0.0
    name: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Pairing:
    """A sensed feature and the model feature that it is, or lies on."""

    sensed: Feature
    model: ModelFeature

    @property
    def relation(self) -> Relation:
        """The row of the table of relations."""
        return relation_between(self.sensed.kind, self.model.kind)


@dataclass(frozen=True, slots=True, eq=False)
class PoseEstimate:
    """Where the part is, how sure that is, and what is not known.

    Attributes:
        T_world_part: pose ``(4, 4)``.
        covariance: ``(6, 6)``, order x y z rx ry rz, part frame, right perturbation [m, rad], shared errors included.
            Free directions carry the variance of a uniform draw over ``length`` and over a full turn.
        covariance_same_robot: the same with the shared errors known: what matters for going back with the same robot.
        free: motions ``(k, 6)`` that no pairing resists, ``[v / length, w]`` in the part frame.
        unobserved: the same in words.
        chi2: joint squared Mahalanobis distance of the pairings.
        dof: its degrees of freedom.
        p_value: probability of a larger ``chi2`` if all is as stated; 1 without redundancy.
        distances: squared Mahalanobis distance of each pairing at the estimate, under its own noise.
        alternatives: other poses ``(k, 4, 4)`` that fit about as well (undirected edges, few points).
        shared: estimated shared errors by name, with their standard deviations.
        status: ``located`` or ``insufficient``.
        message: one sentence.
    """

    T_world_part: Transforms
    covariance: Covariances
    covariance_same_robot: Covariances
    free: Tangents
    unobserved: tuple[str, ...]
    chi2: float
    dof: int
    p_value: float
    distances: FloatArray
    alternatives: Transforms
    shared: dict[str, tuple[FloatArray, FloatArray]] = field(default_factory=dict)
    status: str = "located"
    message: str = ""


def build_blocks(pairings: Sequence[Pairing]) -> tuple[list[Block], FloatArray, tuple[SharedError, ...], list[int]]:
    """Pairings as solver blocks.

    Returns:
        The blocks (one per relation), the factor ``L`` with shared error ``c = L z``, the shared errors, and the
        index of each block's pairings in the input, concatenated.
    """
    errors, C, gains = collect_shared([pairing.sensed for pairing in pairings])
    values, vectors = np.linalg.eigh(C) if len(C) else (np.zeros(0), np.zeros((0, 0)))
    L = vectors * np.sqrt(np.maximum(values, 0.0))
    blocks, order = [], []
    for name in dict.fromkeys(pairing.relation.name for pairing in pairings):
        members = [i for i, pairing in enumerate(pairings) if pairing.relation.name == name]
        relation = pairings[members[0]].relation
        blocks.append(
            Block(
                relation,
                np.stack([pairings[i].sensed.T_world_feature for i in members]),
                np.stack([pairings[i].sensed.P for i in members]),
                np.stack([pairings[i].model.T_part_feature for i in members]),
                np.stack([_tolerance(pairings[i].model) for i in members]),
                np.stack([gains[i] @ L for i in members]),
                np.array([pairings[i].model.radius for i in members]),
                np.ones(len(members), dtype=bool),
            )
        )
        order += members
    return blocks, L, errors, order


def _tolerance(model: ModelFeature) -> Covariances:
    return np.zeros((model.kind.size, model.kind.size)) if model.P is None else model.P


def estimate_pose(
    pairings: Sequence[Pairing],
    *,
    prior: tuple[Transforms, Covariances] | None = None,
    start: Transforms | None = None,
    length: float | None = None,
) -> PoseEstimate:
    """Maximum-likelihood pose from pairings, full and partial, with shared errors as state (``math.md`` section 6).

    Args:
        pairings: sensed features and what they are; at least one unless there is a prior.
        prior: mean pose and covariance (part frame, right), for example from vision.
        start: where to begin; found in closed form from directions and points if not given.
        length: size of the part [m], to weigh metres against radians; from the model features if not given.

    Returns:
        The pose. Free directions stay where the start put them and are named; nothing is invented about them.

    Raises:
        InputError: without pairings, or for kinds that cannot be paired.
    """
    if not pairings and prior is None:
        raise InputError("pairings: expected at least one pairing of a sensed with a model feature, got none.")
    blocks, L, errors, order = build_blocks(pairings)
    length = length or _model_length(pairings)
    information = None if prior is None else (prior[0], np.asarray(np.linalg.inv(prior[1])))
    if start is not None:
        starts = np.asarray(start)[None]
    else:
        starts = _starts(blocks) if pairings else np.zeros((0, 4, 4))
        starts = starts if prior is None else np.concatenate([starts, prior[0][None]])
    solution, N = _best(blocks, starts, L.shape[1], information, length)
    best = int(np.argmin(solution.chi2))
    return _report(pairings, blocks, order, solution, best, N, L, errors, length)


def _model_length(pairings: Sequence[Pairing]) -> float:
    points = np.array([pairing.model.T_part_feature[:3, 3] for pairing in pairings])
    span = float(np.linalg.norm(np.ptp(points, axis=0))) if len(points) else 0.0
    return span if span > 0 else 0.1


def _starts(blocks: Sequence[Block]) -> Transforms:
    """First poses ``(k, 4, 4)``: both directions of undirected edges; many rotations where directions fix none."""
    edges = [
        (b, i)
        for b, block in enumerate(blocks)
        if block.relation.name == "edge_edge"
        for i in range(block.active.shape[-1])
    ][:_MAX_FLIPPED_EDGES]
    starts = []
    for flips in product((False, True), repeat=len(edges)):
        flipped = list(blocks)
        for (b, i), flip in zip(edges, flips, strict=True):
            if flip:
                Ts = np.array(flipped[b].Ts_part_model)
                Ts[i] = Ts[i] @ EDGE.symmetries[1]
                flipped[b] = replace(flipped[b], Ts_part_model=Ts)
        starts.append(first_pose(flipped))
    if _fixed_directions(blocks) < 2:
        starts += [SE3.from_parts(R, place(blocks, R)) for R in _rotations()]
    return np.stack(starts)


def _fixed_directions(blocks: Sequence[Block]) -> int:
    """Rank of the paired directions: two fix a rotation."""
    rows = [np.zeros((0, 3))]
    for block in blocks:
        name = block.relation.name
        if name in ("plane_plane", "edge_edge", "cylinder_cylinder", "circle_circle"):
            rows.append(block.Ts_part_model[..., :3, 2 if "plane" in name or "circle" in name else 0])
        elif name in ("vertex_vertex", "sphere_sphere"):
            p = block.Ts_part_model[..., :3, 3]
            rows.append(p[1:] - p[:1])
    D = np.concatenate(rows)
    norms = np.linalg.norm(D, axis=1, keepdims=True)
    D = D[norms[:, 0] > 0] / norms[norms[:, 0] > 0]
    return int(np.linalg.matrix_rank(D, tol=1e-3)) if len(D) else 0


def _rotations() -> FloatArray:
    """The 24 turns of a cube, each also turned by 60 degrees about its diagonal: 48 even starts."""
    turns = [SO3.exp(np.array(w) * np.pi / 2) for w in product((-1, 0, 1, 2), repeat=3)]
    unique = {tuple(np.round(R @ Q, 3).ravel()): R @ Q for R in turns for Q in turns[:8]}
    cube = np.array([R for R in unique.values() if np.all(np.isclose(np.abs(R).max(axis=0), 1.0))])
    return np.concatenate([cube, SO3.exp(np.full(3, np.pi / 3 / np.sqrt(3))) @ cube])


def _best(
    blocks: Sequence[Block],
    starts: Transforms,
    n_shared: int,
    prior: tuple[Transforms, FloatArray] | None,
    length: float,
) -> tuple[Solution, Tangents]:
    """Iterate every start, holding the motions that nothing resists."""
    solution = gauss_newton(blocks, starts, n_shared, prior=prior, iterations=15, hold=_hold(np.eye(6), length, 1e-6))
    wrong = np.any([_wrong_side(block, solution.T_world_part).any(axis=-1) for block in blocks], axis=0)
    if blocks and not wrong.all():
        solution = take(solution, ~wrong)
    best = solution.T_world_part[int(np.argmin(solution.chi2))]
    N = free_motions(blocks, best, n_shared, length) if prior is None else np.zeros((0, 6))
    hold = _hold(N, length, 1e6)
    return gauss_newton(blocks, solution.T_world_part, n_shared, prior=prior, hold=hold), N


def _wrong_side(block: Block, T_world_part: Transforms) -> BoolArray:
    """Pairs of planes ``(*batch, n)`` whose outward normals point opposite ways: their residuals do not tell."""
    if block.relation.name != "plane_plane":
        return np.zeros((*T_world_part.shape[:-2], block.active.shape[-1]), dtype=np.bool_)
    model = np.einsum("...ij,...nj->...ni", T_world_part[..., :3, :3], block.Ts_part_model[..., :3, 2])
    return np.asarray(np.sum(model * block.Ts_world_feature[..., :3, 2], axis=-1) < 0, dtype=np.bool_)


def _hold(N: Tangents, length: float, strength: float) -> FloatArray:
    """Information that keeps a step off the motions ``N`` (rows scaled by ``length``)."""
    rows = N / np.r_[np.full(3, length), np.ones(3)]
    return strength * rows.T @ rows


def _report(
    pairings: Sequence[Pairing],
    blocks: list[Block],
    order: list[int],
    solution: Solution,
    best: int,
    N: Tangents,
    L: FloatArray,
    errors: tuple[SharedError, ...],
    length: float,
) -> PoseEstimate:
    T, chi2 = solution.T_world_part[best], float(solution.chi2[best])
    distances = _distances(blocks, order, T, solution.z[best])
    chi2 = chi2 if np.all(np.isfinite(distances)) else np.inf
    information = solution.information[best]
    covariance = covariance_with_free(pose_information(information), N, length)
    dof = int(solution.equations[best]) - (6 - len(N))
    unobserved = tuple(describe_motion(xi, T, length) for xi in N)
    p_value = float(chdtrc(dof, chi2)) if dof > 0 else 1.0
    insufficient = bool(unobserved)
    return PoseEstimate(
        T_world_part=T,
        covariance=covariance,
        covariance_same_robot=covariance_with_free(information[:6, :6], N, length),
        free=N,
        unobserved=unobserved,
        chi2=chi2,
        dof=dof,
        p_value=p_value,
        distances=distances,
        alternatives=_alternatives(solution, best, covariance),
        shared=_shared_estimates(solution.z[best], information, N, L, errors, length),
        status="insufficient" if insufficient else "located",
        message=_message(unobserved, p_value),
    )


def _message(unobserved: tuple[str, ...], p_value: float) -> str:
    if unobserved:
        return f"The pairings leave {' and '.join(unobserved)} free: sense a feature that resists it."
    if p_value < 0.01:
        return f"The pairings contradict each other (p = {p_value:.2g}): check the one with the largest distance."
    return "All six directions are observed and the pairings agree."


def covariance_with_free(information: FloatArray, N: Tangents, length: float) -> Covariances:
    """Inverse of ``information`` off the free motions ``N``; along them, a uniform draw over ``length`` or a turn."""
    scale = np.r_[np.full(3, length), np.ones(3)]
    A = information * np.outer(scale, scale)
    Q = np.linalg.qr(np.concatenate([N, np.eye(6)]).T)[0][:, len(N) : 6]
    observed = Q @ np.linalg.inv(Q.T @ A @ Q) @ Q.T
    spread = np.where(np.linalg.norm(N[:, 3:], axis=1) > 1e-6, 2 * np.pi, 1.0) ** 2 / 12
    C = (observed + (N.T * spread) @ N) * np.outer(scale, scale)
    return 0.5 * (C + C.T)


def _distances(blocks: list[Block], order: list[int], T: Transforms, z: FloatArray) -> FloatArray:
    """Squared Mahalanobis distance of each pairing's residual under its own noise; infinite from the wrong side."""
    out, flat = np.zeros(len(order)), list[float]()
    for block in blocks:
        at = linearise(block, T, z)
        values = [float(f @ np.linalg.solve(S, f)) for f, S in zip(at.f, at.S, strict=True)]
        flat += list(np.where(_wrong_side(block, T), np.inf, values))
    out[order] = flat
    return out


def _alternatives(solution: Solution, best: int, covariance: Covariances) -> Transforms:
    """Other fixed points with about the same chi-square, each once."""
    kept = [solution.T_world_part[best]]
    weight = np.linalg.inv(covariance)
    for i in np.argsort(solution.chi2):
        if solution.chi2[i] > solution.chi2[best] + _CLOSE_CHI2 or solution.steps[i] > 1e-6:
            continue
        gaps = SE3.log(SE3.inverse(np.stack(kept)) @ solution.T_world_part[i])
        if np.all(np.einsum("ki,ij,kj->k", gaps, weight, gaps) > 16.8):  # 1 % of six degrees of freedom
            kept.append(solution.T_world_part[i])
    return np.stack(kept)[1:]


def _shared_estimates(
    z: FloatArray,
    information: FloatArray,
    N: Tangents,
    L: FloatArray,
    errors: tuple[SharedError, ...],
    length: float,
) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Posterior mean and sd of each shared error; the free motions ``N`` are held, as they say nothing about it."""
    if not errors:
        return {}
    held = np.array(information)
    held[:6, :6] += _hold(N, length, float(np.abs(information).max()))
    cross = np.linalg.solve(held[:6, :6], held[:6, 6:])
    covariance = np.linalg.inv(held[6:, 6:] - held[6:, :6] @ cross)
    c, sd = L @ z, np.sqrt(np.maximum(np.diag(L @ covariance @ L.T), 0.0))
    out, i = {}, 0
    for error in errors:
        n = len(error.covariance)
        out[error.name] = (c[i : i + n], sd[i : i + n])
        i += n
    return out
