"""Built-in proposers of known poses, poses of planes, centres and assigned faces, and half turns and slides of maxima.

A nearly symmetric part after a half turn, or a part slid to the next step or wall, explains many of the same points
(decisions 51 and 52). Similar parts share their frames (decision 52).
"""

from __future__ import annotations

from dataclasses import replace
from typing import final

import numpy as np

from tanteo import _core
from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import Transforms, Vectors
from tanteo.posterior.details import details_at
from tanteo.posterior.prepared import PreparedPart
from tanteo.posterior.problem import PoseMixture, Problem
from tanteo.posterior.proposals.centre_triples import from_centres
from tanteo.posterior.proposals.plane_votes import cost_margin, plane_poses
from tanteo.posterior.proposals.proposer import BITS, EARLIER, EXHAUSTIVE, InitialPoses, Proposer, SearchState
from tanteo.posterior.proposals.sensed_planes import Planes, SensedPlanes, sensed_planes
from tanteo.posterior.sampling.peaks import Objective, Peaks, prior_sds, scores_of
from tanteo.posterior.settings import SearchSettings


@final
class KnownPoses(Proposer):
    """Proposer of the poses that earlier stages of candidate pruning found, in the first round."""

    name = "known"

    def propose(self, problem: Problem, part: PreparedPart, state: SearchState) -> InitialPoses:
        """Propose the known poses once."""
        if state.round or state.known is None:
            return InitialPoses.none()
        if state.exhaustive:
            return InitialPoses.exhaustive(state.known)
        return InitialPoses(state.known, np.full(len(state.known), EARLIER))


@final
class FactorPoses(Proposer):
    """Proposer of the poses that pose factors suggest, once and without blur, because they are near a maximum."""

    name = "factors"

    def propose(self, problem: Problem, part: PreparedPart, state: SearchState) -> InitialPoses:
        """Propose the poses of all factors of the pose in the first round."""
        if state.round or not problem.pose_factors:
            return InitialPoses.none()
        return InitialPoses.exhaustive(np.concatenate([factor.poses(part.part) for factor in problem.pose_factors]))


@final
class CentreTriples(Proposer):
    """Proposer of poses with three centres on three axes, once, because they are within the noise."""

    name = "centres"

    def propose(self, problem: Problem, part: PreparedPart, state: SearchState) -> InitialPoses:
        """Propose the poses that put three centres on three axes of holes and bosses."""
        if state.round or np.count_nonzero(problem.points.centres) < 3:
            return InitialPoses.none()
        core = state.objective.core
        known = problem.mixture(part)
        prior = np.zeros((0, 4, 4)) if known is None else known.Ts
        return InitialPoses.exhaustive(from_centres(problem.points, core, part, problem.settings.search, prior))


@final
class PlanePoses(Proposer):
    """Proposer of poses with labelled planes and sensed normals on faces, once, because these are all such poses."""

    name = "planes"

    def propose(self, problem: Problem, part: PreparedPart, state: SearchState) -> InitialPoses:
        """Propose the poses nearest to all points, unless earlier stages proposed all that planes allow."""
        if state.round or state.exhaustive or not len(state.planes.triples):
            return InitialPoses.none()
        return InitialPoses.exhaustive(poses_on_planes(state.planes, state.objective))


_NODES = 1000
"""Numerical: assignments of some of the points that are tried, about 10 ms; 3 mm and 2 degrees need about 30."""

_WIDEST_TURN = 0.2
"""Numerical: standard deviation of a turn up to which positions are nearly linear in it [rad]."""


@final
class FaceAssignments(Proposer):
    """Proposer of the poses at which all points are on faces, near the prior poses, by a tree search.

    Exact points under a coarse prior have many maxima, one for each assignment of points to faces that fits. Each is
    as narrow as the noise, so that samples of the prior rarely lead to all of them. A tree search over the assignments
    finds them (Grimson and Lozano-Perez 1984).
    """

    name = "assignments"

    def propose(self, problem: Problem, part: PreparedPart, state: SearchState) -> InitialPoses:
        """Propose these poses in the first round; if none has all points on faces, those with one outlier."""
        known = problem.mixture(part)
        if state.round or known is None or not len(state.objective.rows) or not _is_coarse(known, problem, part):
            return InitialPoses.none()
        Ts, complete = _assigned(state.objective, known, outliers=0)
        if complete and not len(Ts):
            Ts, complete = _assigned(state.objective, known, outliers=1)
        source = EXHAUSTIVE if complete else 1 << int(state.rng.integers(BITS))
        return InitialPoses.refined_poses(Ts, np.full(len(Ts), source, dtype=np.int64))


@final
class NearbyAssignments(Proposer):
    """Proposer of the poses at which all points are on faces, about best maxima with unexpected outliers.

    The region of a maximum is as wide as the spacing of proposals, or as the prior where this is narrower.
    """

    name = "reassigned"

    def propose(self, problem: Problem, part: PreparedPart, state: SearchState) -> InitialPoses:
        """Propose these poses with the sources of the best maximum, so that they are found as surely."""
        best, objective, count = state.best, state.objective, state.effort.moved
        if not (count and len(best) and len(objective.scales.blurs) and state.is_doubtful()):
            return InitialPoses.none()
        if best.groups[0] == EXHAUSTIVE:  # all assignments near a prior were tried
            return InitialPoses.none()
        return near_assignments(objective, best.take(np.arange(min(count, len(best)))), objective.scales.blur)


def near_assignments(objective: Objective, peaks: Peaks, width: float) -> InitialPoses:
    """Return the poses about some maxima at which all points are on faces, with the sources of the best maximum.

    Args:
        objective: the part and the measurements.
        peaks: the maxima, at least one, best first.
        width: standard deviation of the places about the maxima, or of the prior where this is narrower [m].
    """
    problem, part, Ts = objective.problem, objective.prepared, peaks.Ts
    if not len(objective.rows):
        return InitialPoses.none()
    turn, known = min(width / (0.25 * part.part.diagonal), _WIDEST_TURN), problem.mixture(part)
    information = np.tile(np.diag(np.repeat([width, turn], 3) ** -2.0), (len(Ts), 1, 1))
    if known is not None:
        gaps, of_prior = SE3.log(SE3.inverse(known.Ts)[:, None] @ Ts), np.linalg.inv(known.covariances)
        information += of_prior[np.argmin(np.einsum("kni,kij,knj->kn", gaps, of_prior, gaps), axis=0)]
    covariances = np.asarray(np.linalg.inv(information), dtype=np.float64)
    near = PoseMixture(Ts, covariances, -np.arange(len(Ts), dtype=np.float64))
    found, _ = _assigned(objective, near, outliers=0)
    return InitialPoses.refined_poses(found, np.full(len(found), peaks.groups[0]))


def _is_coarse(known: PoseMixture, problem: Problem, part: PreparedPart) -> bool:
    """Return whether a prior is wide relative to the noise, and narrow enough for linear covariances of positions.

    Samples of a prior that is hardly wider than the noise lead to all maxima.
    """
    turn = float(np.sqrt(np.linalg.eigvalsh(known.covariances[:, 3:, 3:])[:, -1].max()))
    noise = problem.settings.search.gate * float(np.median(problem.points.residual_sd))
    return turn < _WIDEST_TURN and float(prior_sds(known.covariances, part).max()) > noise


def _assigned(objective: Objective, known: PoseMixture, *, outliers: int) -> tuple[Transforms, bool]:
    """Return the poses of assignments near the prior poses, best first, and whether these are all assignments."""
    problem, part = objective.problem, objective.prepared
    own, centre = problem.settings.search, part.shape.centre
    about_centre = np.eye(6)
    about_centre[:3, 3:] = SO3.hat(centre)
    noise, left, complete, Ts, scores = float(np.exp(own.noise_fraction * problem.scale_sd)), _NODES, True, [], []
    for k in np.argsort(-known.log_weights, kind="stable"):
        information = about_centre.T @ np.linalg.inv(known.covariances[k]) @ about_centre
        poses, score, nodes, whole = _core.assigned_poses(
            part.shape, objective.core, objective.rows, np.ascontiguousarray(known.Ts[k]),
            np.ascontiguousarray(information), own.gate, 5 * own.cost_point, 2 * own.drop_gap, noise, outliers, left,
            own.maximized,
        )  # fmt: skip
        Ts.append(poses)
        scores.append(score)
        left, complete = left - nodes, complete and whole
        if not complete:
            break
    best = np.argsort(-np.concatenate(scores), kind="stable")[: own.maximized]
    return np.ascontiguousarray(np.concatenate(Ts)[best]), complete


def poses_on_planes(planes: SensedPlanes, objective: Objective) -> Transforms:
    """Return the poses with planes on faces of a part that are nearest to all points ``(S, 4, 4)``.

    Args:
        planes: the planes.
        objective: the part and the measurements.
    """
    problem, part, count = objective.problem, objective.prepared, objective.problem.settings.search.maximized
    if not len(objective.rows):
        return np.zeros((0, 4, 4))
    Ts = np.ascontiguousarray(plane_poses(planes, part, problem.settings))
    if len(Ts) > count:
        costs = scores_of(problem, objective.core, part, objective.rows, Ts, objective.scales)
        Ts = Ts[np.argsort(costs, kind="stable")[:count]]
    return Ts


def planes_at(objective: Objective, peaks: Peaks) -> SensedPlanes:
    """Return the touched planar faces at the best maximum of a part, as sensed planes.

    A point on an edge touches both of its faces. The planes cost nothing at this maximum, which limits the cost of
    other poses.

    Args:
        objective: the part and the measurements.
        peaks: maxima of the part, at least one.
    """
    problem, part, T = objective.problem, objective.prepared.part, peaks.Ts[0]
    points, own, edges = problem.points, problem.settings.search, part.edges
    at = details_at(objective, peaks.Ts[:1], peaks.zs[:1])
    turn = np.sqrt(np.linalg.eigvalsh(np.linalg.inv(objective.of_pose(peaks.information[:1]))[0, 3:, 3:])[-1])
    touched: dict[int, list[int]] = {}
    for row in np.flatnonzero(at.inlier_probability[0] > 0.5):
        element = int(at.faces[0, row])
        edge = -2 - element
        faces = [element] if element >= 0 else edges.faces[edge].tolist() if 0 <= edge < len(edges) else []
        for face in faces:
            touched.setdefault(face, []).append(int(row))
    which = np.array([k for k, face in enumerate(part.planes.faces) if int(face) in touched], dtype=np.int64)
    rows = tuple(np.array(touched[int(part.planes.faces[k])]) for k in which)
    normals = part.planes.normals[which] @ T[:3, :3].T
    middles = np.array([points.points[own_rows].mean(axis=0) for own_rows in rows]).reshape(-1, 3)
    spans = [float(np.linalg.norm(points.points[r] - m, axis=1).max()) for r, m in zip(rows, middles, strict=True)]
    tilt, count = float(np.clip(turn, own.tilt_as_made, own.plane_normal_sd)), len(which)
    planes = Planes(
        normals, np.sum(normals * middles, axis=1), middles, np.array(spans),
        np.array([points.radii[r].mean() for r in rows]), np.full(count, tilt), np.ones(count, dtype=bool),
        np.array([points.sd[r].mean() for r in rows]), rows,
    )  # fmt: skip
    return replace(sensed_planes(problem, points, planes), limit=cost_margin(problem.settings))


@final
class HalfTurnsAndSlides(Proposer):
    """Proposer of half turns and slides of the best maxima, more of them if the right one is hard to find."""

    name = "moves"

    def propose(self, problem: Problem, part: PreparedPart, state: SearchState) -> InitialPoses:
        """Propose half turns and random slides of the best maxima so far."""
        effort = state.effort
        hard = bool(effort.moved_hard) and (len(state.objective.scales.blurs) > 1 or state.is_doubtful())
        count = effort.moved_hard if hard else effort.moved
        if not len(state.best) or not count:
            return InitialPoses.none()
        return moved(part, state.best.take(np.arange(min(count, len(state.best)))), state.rng, problem.settings.search)


def moved(prepared: PreparedPart, peaks: Peaks, rng: np.random.Generator, settings: SearchSettings) -> InitialPoses:
    """Return poses after half turns about axes through the part's middle, and after slides along its axes.

    All half turns are tried, so that they are found as surely as the maximum itself. A slide is a random sample. It has
    one source of the maximum, so that slides back to the maximum add no source.

    Args:
        prepared: the part.
        peaks: maxima.
        rng: generator of the slides.
        settings: settings of the search.
    """
    turned, slid = rotated(prepared, peaks.Ts), translated(prepared, peaks.Ts, rng, settings.spins // 2)
    bits = np.left_shift(1, np.arange(BITS + 1))
    found = np.asarray(peaks.groups[:, None] & bits, dtype=bool)
    which = np.argmax(found[:, None] * rng.random((len(peaks), len(slid) // len(peaks), len(bits))), axis=-1)
    one = np.where((peaks.groups != 0)[:, None], bits[which], 0)
    sources = np.concatenate([np.repeat(peaks.groups, len(turned) // len(peaks)), one.ravel()])
    return InitialPoses(np.concatenate([turned, slid]), sources)


def translated(prepared: PreparedPart, Ts: Transforms, rng: np.random.Generator, count: int) -> Transforms:
    """Return poses after random slides along axes of the part by up to half its length, ``count`` for each pose."""
    axes, size = _axes(prepared), np.ptp(prepared.part.box, axis=0)
    which = rng.integers(len(axes), size=(len(Ts), count))
    lengths = rng.uniform(-0.5, 0.5, size=which.shape) * (np.abs(axes) @ size)[which]
    slides = np.tile(np.eye(4), (*which.shape, 1, 1))
    slides[..., :3, 3] = lengths[..., None] * axes[which]
    return np.ascontiguousarray((Ts[:, None] @ slides).reshape(-1, 4, 4))


def _axes(prepared: PreparedPart) -> Vectors:
    """Return the axes of the part frame and the principal axes of its surface ``(6, 3)``."""
    return np.concatenate([np.eye(3), np.linalg.eigh(np.cov(prepared.samples.T))[1].T])


def rotated(prepared: PreparedPart, Ts: Transforms) -> Transforms:
    """Return poses after half turns about axes through the middle of the part."""
    part = prepared.part
    axes = _axes(prepared)
    middles = np.stack([part.box.mean(axis=0), prepared.samples.mean(axis=0)]).repeat(3, axis=0)
    R = 2 * axes[:, :, None] * axes[:, None] - np.eye(3)
    turns = SE3.from_parts(R, middles - SE3.apply(R, middles))
    return np.ascontiguousarray((Ts[:, None] @ turns).reshape(-1, 4, 4))
