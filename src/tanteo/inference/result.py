"""From a mode of the posterior to a hypothesis: pose, covariance, what is unobserved, which measurements do not fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tanteo import _core
from tanteo.answers import (
    Hypothesis,
    Misfit,
    PosePrior,
    corner_sd,
    hypothesis_at,
    part_scale,
    prior_rows,
    spins,
    without_spins,
)
from tanteo.features import SharedError
from tanteo.inference.details import Details, details_at
from tanteo.inference.modes import Mode, to_origin
from tanteo.lie import SE3, SO3
from tanteo.localization import SharedGiven, covariance_with_free, pose_information, weak_motions
from tanteo.measurements import ContactPoints, FreeRays, directions_met
from tanteo.parts import Part, round_features
from tanteo.typing import Covariances, FloatArray, Tangents

_NOTABLE = 0.5
"""Share of the largest corner sd from which an error that all measurements share is worth a sentence."""

_ALIKE = 1.5
"""Times the standard deviation from the curvature that the whole posterior may have, to be explained by its parts."""

_REMARKABLE = 2.0
"""A measurement that is off by fewer standard deviations is not what contradicts a pose."""

_LESSENED = {
    "robot base": "; more readings do not lessen it, but the same robot, when it goes back, is off by the same",
    "tip offset": ", or turn the hand more between readings",
    "mounting": ", or turn the hand more between readings",
    "bias": ", or sense from more sides, opposite ones best",
    "scale": ", or sense from nearer, or from opposite sides",
}
"""What else can be done about an error that all measurements share, by what its name begins with."""


_HELD, _TOLD = 0.05, 24
"""Standard deviation over the size of the part up to which samples say that the ends of faces hold a motion; so many
samples say it."""


@dataclass(frozen=True, slots=True, eq=False)
class GoodnessOfFit:
    """A mode with the measurements at its maximum.

    Attributes:
        mode: the mode.
        at: the measurements there, one pose.
        per_stated_sd: one over the stated standard deviation of each along its normal ``(n,)`` [1/m].
        free: motions that nothing resists, those of the part's symmetry first, over ``part_scale`` ``(m, 6)``.
    """

    mode: Mode
    at: Details
    per_stated_sd: FloatArray
    free: Tangents

    @property
    def belongs(self) -> np.ndarray:
        """Which points are on the part ``(n,)``."""
        return np.asarray(self.at.belongs[0] > 0.5)

    @property
    def on_furniture(self) -> np.ndarray:
        """Which points are of what stands around ``(n,)``: not on the part, and no outliers."""
        problem = self.mode.objective.problem
        return np.asarray(~self.belongs & (problem.around.over_outlier > problem.priors.outlier_rate))

    @property
    def outliers(self) -> np.ndarray:
        """Which points nothing explains ``(n,)``."""
        return np.asarray(~self.belongs & ~self.on_furniture)

    @property
    def log_noise_factor(self) -> float:
        """How well the noise was known: log of the factor."""
        return self.mode.objective.problem.scale_sd

    def misfit(self) -> Misfit:
        """Of the points that belong and their normals, against what was stated."""
        belongs, tilts, kinds = self.belongs, self.at.tilts[0], self.mode.objective.problem.points.kinds
        points = float(np.sum((self.at.distances[0] * self.per_stated_sd)[belongs] ** 2))
        across = sum(directions_met(kind) for kind, on in zip(kinds, belongs, strict=True) if on)
        told = 2 * int(np.count_nonzero(tilts[belongs]))
        tilted = float(np.sum(tilts[belongs] ** 2))
        return Misfit(points, tilted, across + told - 6, self.log_noise_factor, across - 6)

    def told_beside(self, rows: FloatArray) -> float:
        """How many states not the points tell but priors (of shared errors, of the pose by ``rows``) or nothing.

        Args:
            rows: derivatives of what was known of the pose, standardised ``(m, 6)``.
        """
        objective = self.mode.objective
        states = 6 + objective.problem.points.shared_jacobian.shape[2]
        information = objective.regular(self.mode.information)[:states, :states]
        known = np.eye(states)
        known[:6, :6] = rows.T @ rows
        return len(self.free) - (states - 6) + float(np.trace(np.linalg.solve(information, known)))


def goodness_of_fit(mode: Mode) -> GoodnessOfFit:
    """The mode with the measurements at its maximum."""
    part, T = mode.prepared.part, mode.T_peak[None]
    at = details_at(mode.objective, T, mode.z[None])
    information = without_spins(part, pose_information(mode.information))
    scaled = mode.objective.problem.scale_sd > 0
    stated = details_at(mode.objective, T, np.r_[mode.z[:-1], 0.0][None]) if scaled else at
    return GoodnessOfFit(mode, at, stated.per_sd[0], _free(mode, information))


def _free(mode: Mode, information: FloatArray) -> Tangents:
    """Motions that nothing resists at the maximum, but for those that the ends of faces hold nearly as well."""
    part = mode.prepared.part
    scale, known = part_scale(part), spins(part)
    told = without_spins(part, np.asarray(np.linalg.inv(mode.covariance), dtype=np.float64))
    if mode.maxima > 1 and mode.ess >= _TOLD:  # each maximum by itself seems to hold what all together leave free
        return weak_motions(told, scale, fixed=known)
    free = weak_motions(information, scale, fixed=known)
    if len(free) == len(known) or mode.ess < _TOLD:
        return free
    held = weak_motions(told, scale, _HELD, fixed=known)
    return held if len(held) < len(free) else free


def as_hypothesis(points: ContactPoints, one: GoodnessOfFit, pose: PosePrior | None = None) -> Hypothesis:
    """The hypothesis: the pose of the mode with the covariance of its samples.

    Args:
        points: the measurements.
        one: the mode.
        pose: what was known of it beforehand; the joint test asks whether the measurements agree with that, too.
    """
    mode, part, belongs = one.mode, one.mode.prepared.part, one.belongs
    free, distances = one.free, one.at.distances[0]
    covariance, given = _covariances(one)
    common, common_given = _common_tolerance(points, one)
    known, known_rows = (of[0] for of in prior_rows(pose, part, mode.T_peak[None]))
    errors = mode.z[: points.shared_jacobian.shape[2]]
    named = pose is not None and pose.T_world_part is not None  # a prior names one of the spins, too
    more = len(known) + len(free) - (len(spins(part)) if named else 0)
    rest = float(np.sum(errors**2) + np.sum(known**2))
    misfit = one.misfit().beside(rest, more, one.told_beside(known_rows))
    names = face_names(one)
    return hypothesis_at(
        part,
        mode.T_world_part,
        covariance + common,
        free=free,
        probability=mode.probability,
        misfit=misfit,
        rms=float(np.sqrt(np.mean(distances[belongs] ** 2))) if belongs.any() else 0.0,
        outliers=tuple(name for name, off in zip(points.ids, one.outliers, strict=True) if off),
        pairings=tuple((i, f) for i, f, off in zip(points.ids, names, one.outliers, strict=True) if not off),
        outlier_distances=tuple(float(d) for d, off in zip(distances, one.outliers, strict=True) if off),
        covariance_relative=None if given is None else given + common_given,
        shared=_shared_given(mode),
    )


def face_names(one: GoodnessOfFit) -> list[str]:
    """What each point is nearest to, in words."""
    part = one.mode.prepared.part
    around, furniture = one.mode.objective.problem.around, one.on_furniture
    names = [_name_of(part, int(f)) for f in one.at.faces[0]]
    return [around.names[around.which[k]] if furniture[k] else name for k, name in enumerate(names)]


def _name_of(part: Part, number: int) -> str:
    """What the core calls by a number: a face, or beyond -1 an edge, a vertex, then a hole or boss."""
    k, edges, corners = -2 - number, len(part.edges), len(part.corners)
    if number >= 0:
        return part.faces[number].name
    if k < edges:
        return f"edge {k}"
    return f"vertex {k - edges}" if k < edges + corners else round_features(part)[k - edges - corners].name


def information_by_point(mode: Mode) -> FloatArray:
    """What each point adds to the information on the pose at the maximum, shared errors as known ``(n, 6, 6)``.

    Part frame, right perturbation [m, rad]. Each is looked at alone: a point that the others make an outlier counts as
    far as it is none by itself.
    """
    objective, problem = mode.objective, mode.objective.problem
    out = np.zeros((len(problem.points), 6, 6))
    nothing = replace(problem, rays=FreeRays.none(), priors=replace(problem.priors, pose=None), mixtures={})
    T, z = np.ascontiguousarray(mode.T_peak[None]), np.ascontiguousarray(mode.z[None])
    for k in range(len(out)):
        alone = replace(nothing, points=problem.points.take(np.array([k])))
        information = _core.slopes(objective.prepared.shape, alone.compiled(objective.prepared), T, z)[2][0]
        out[k] = to_origin(objective, information)[:6, :6]
    return out


def _covariances(one: GoodnessOfFit) -> tuple[Covariances, Covariances | None]:
    """Of the pose, uniform along unobserved directions; and the same if the shared errors were known."""
    mode, part = one.mode, one.mode.prepared.part
    scale = part_scale(part)
    whole = without_spins(part, pose_information(mode.information))
    covariance = _with_free(mode.covariance if mode.ess > 1 else None, whole, one.free, scale)
    if not mode.objective.problem.points.shared_jacobian.shape[2]:
        return covariance, None
    known = without_spins(part, mode.information[:6, :6])
    if len(one.free) > len(spins(part)):
        return covariance, _with_free(None, known, one.free, scale)
    if len(weak_motions(whole, scale, fixed=spins(part))) > len(one.free):
        return covariance, covariance  # only samples know it, and they do not part the two
    # by how much the samples differ from the curvature is of the pose, whether the shared errors are known or not
    curved = _with_free(None, whole, one.free, scale)
    given = _with_free(None, known, one.free, scale)
    return covariance, given * min(_times(curved, covariance), _times(given, covariance))


def _times(one: Covariances, other: Covariances) -> float:
    """By how much the second is larger, on average over the motions; those that are exact to rounding do not count."""
    size = np.sqrt(np.diag(one).clip(1e-300))
    inverse = np.linalg.pinv(one / np.outer(size, size), rcond=1e-13, hermitian=True)
    return float(np.trace(inverse @ (other / np.outer(size, size)))) / 6


def _with_free(
    covariance: Covariances | None, information: FloatArray, free: Tangents, scale: FloatArray
) -> Covariances:
    if covariance is not None:
        to_unit = np.linalg.inv(scale)
        unit = to_unit @ covariance @ to_unit.T
        unit += 1e-10 * np.trace(unit) * np.eye(6)  # few samples agree in some directions
        information = to_unit.T @ np.linalg.inv(unit) @ to_unit
    out = covariance_with_free(information, free, scale)
    if np.diag(out).min() < 0:  # by rounding, of exact readings beside an unobserved direction
        values, vectors = np.linalg.eigh(out)
        out = np.asarray((vectors * values.clip(0)) @ vectors.T, dtype=np.float64)
    return out


def _shared_given(mode: Mode) -> SharedGiven | None:
    """The shared errors given the pose that is the answer; None without any."""
    D = mode.objective.problem.points.shared_jacobian.shape[2]
    if not D:
        return None
    given = SharedGiven.at(mode.z[:D], mode.information[: 6 + D, : 6 + D])
    return given.about(SE3.log(SE3.inverse(mode.T_peak) @ mode.T_world_part))


def _common_tolerance(points: ContactPoints, one: GoodnessOfFit) -> tuple[Covariances, Covariances]:
    """What the covariances lack because a made face deviates as a whole, not anew at every point, twice ``(6, 6)``.

    The estimate weighs points as if their deviations were independent; for that estimator, points of one face with one
    deviation of sd ``tolerance`` add ``A^-1 J' W (one draw - many) W J A^-1``. First with the shared errors that are
    estimated beside the pose, then as if these were known.
    """
    if points.tolerance == 0:
        return np.zeros((6, 6)), np.zeros((6, 6))
    mode, at, part = one.mode, one.at, one.mode.prepared.part
    n, p, w, per_sd = at.normals[0], at.in_part[0], at.belongs[0], at.per_sd[0]
    shared = np.einsum("ni,nid->nd", n @ mode.T_peak[:3, :3].T, points.shared_jacobian)
    J = np.concatenate([-n, SO3.cross(n, p), shared], axis=1)
    J = np.pad(J, ((0, 0), (0, len(mode.information) - J.shape[1])))
    weighted = J * (w * points.tolerance * per_sd**2)[:, None]
    rows = one.free @ np.linalg.inv(part_scale(part))
    held = np.array(mode.information)
    held[:6, :6] += 1e9 * np.abs(held).max() * rows.T @ rows
    extra = -weighted.T @ weighted
    for face in np.unique(at.faces[0]):
        together = weighted[at.faces[0] == face].sum(axis=0)
        extra = extra + np.outer(together, together)
    shared_jacobian = (_inverse(A) for A in (held, held[:6, :6]))
    return _gained(next(shared_jacobian)[:6], extra), _gained(next(shared_jacobian), extra[:6, :6])


def _inverse(A: FloatArray) -> FloatArray:
    """Inverse of an information matrix; directions that it says nothing of have none of it."""
    size = np.sqrt(np.maximum(np.diag(A), 1e-300))
    return np.asarray(np.linalg.pinv(A / np.outer(size, size), rcond=1e-12, hermitian=True) / np.outer(size, size))


def _gained(gain: FloatArray, extra: FloatArray) -> Covariances:
    """``gain extra gain'``, without what is negative of it."""
    values, vectors = np.linalg.eigh(gain @ extra @ gain.T)
    return np.asarray((vectors * values.clip(0.0)) @ vectors.T)


def worst_reading(points: ContactPoints, one: GoodnessOfFit) -> str:
    """The point, or sensed normal, that agrees least among those on the part; empty if none is far off."""
    off = np.stack([np.abs(one.at.residuals[0]), one.at.tilts[0]]) * one.belongs
    tilted, i = np.unravel_index(int(np.argmax(off)), off.shape)
    if off[tilted, i] < _REMARKABLE:
        return ""
    return f"{'the normal of ' if tilted else ''}reading {points.ids[i]}, {off[tilted, i]:.1f} sd off"


def what_limits(one: GoodnessOfFit, shared: Sequence[SharedError]) -> str:
    """A sentence on the largest of the errors that all measurements share, if it matters; empty if not.

    Args:
        one: the answer.
        shared: the errors behind its shared states, in that order.
    """
    mode, part = one.mode, one.mode.prepared.part
    information, start = mode.information, 6
    total, worst, name, lessened = _corner_sd(mode, information), 0.0, "", ""
    if corner_sd(part, mode.covariance) > _ALIKE * total:
        return ""  # the curvature of the maximum says little of how far off the pose may be, or why
    for error in shared:
        stop = start + len(error.covariance)
        known = np.array(information)
        known[start:stop, start:stop] += 1e12 * np.eye(stop - start)
        part_of = float(np.sqrt(max(total**2 - _corner_sd(mode, known) ** 2, 0.0)))
        if part_of > worst:
            worst, name, lessened = part_of, error.meaning or error.name, _lessened(error)
        start = stop
    if worst < _NOTABLE * total:
        return ""
    known_well = float(np.sqrt(total**2 - worst**2))
    what = f"{name}, which all readings share: {1e3 * worst:.2g} mm of the {1e3 * total:.2g} mm"
    says = f"What limits it is not the readings but {what}" if worst > known_well else f"Part of it is {what}"
    return f" {says}. Calibrate it ({1e3 * known_well:.2g} mm are left then){lessened}."


def _corner_sd(mode: Mode, information: FloatArray) -> float:
    """The largest corner sd [m], from the information on all states; spins of the part are no error."""
    part = mode.prepared.part
    scale = part_scale(part)
    unit = scale.T @ without_spins(part, pose_information(information)) @ scale
    return corner_sd(part, scale @ np.linalg.pinv(unit, rcond=1e-12, hermitian=True) @ scale.T)


def _lessened(error: SharedError) -> str:
    """How measurements can lessen that error; empty if nothing is known of it."""
    return next((advice for source, advice in _LESSENED.items() if error.name.startswith(source)), "")
