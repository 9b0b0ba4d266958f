"""From a maximum of the surface search to a hypothesis: pose, covariance, what is free, what does not fit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tanteo.features import SharedError
from tanteo.lie import SE3
from tanteo.localization import SharedGiven, pose_information
from tanteo.matching.hypothesis import hypothesis_at
from tanteo.matching.part_motions import corner_sd, part_scale, spins, without_spins
from tanteo.matching.prior import PosePrior, prior_rows
from tanteo.matching.results import Hypothesis
from tanteo.surface_search.explained import chi_square
from tanteo.surface_search.mode import Mode
from tanteo.surface_search.touches import Touches
from tanteo.typing import Covariances, FloatArray, IntArray

_NOTABLE = 0.5
"""Share of the worst corner's standard deviation from which an error that all readings share is worth a sentence."""

_ALIKE = 1.5
"""Times the standard deviation from the curvature that the whole posterior may have, to be explained by its parts."""

_REMARKABLE = 2.0
"""A reading that is off by fewer standard deviations is not what contradicts a pose."""

_LESSENED = {
    "robot base": "; more readings do not lessen it, but the same robot, when it goes back, is off by the same",
    "tip offset": ", or turn the hand more between readings",
    "mounting": ", or turn the hand more between readings",
    "bias": ", or sense from more sides, opposite ones best",
    "scale": ", or sense from nearer, or from opposite sides",
}
"""What else can be done about an error that all readings share, by what its name begins with (``sensors.measure``)."""


def as_hypothesis(touches: Touches, mode: Mode, pose: PosePrior | None = None) -> Hypothesis:
    """The hypothesis: the pose at the maximum, with the covariance of the posterior about it.

    Of what a box leaves of it the mean is the answer; what is said of readings and faces is of the maximum.

    Args:
        touches: the readings.
        mode: where they are on a part.
        pose: what was known of it beforehand; the joint test asks whether the readings agree with that, too.
    """
    part, found, k = mode.target.part, mode.found, mode.k
    T, free, faces = mode.T_world_part, mode.free, faces_met(touches, mode)
    common, common_given = _common_tolerance(touches, mode, faces)
    given = mode.covariance_given_shared
    belongs, names = found.belongs[k] > 0.5, [part.faces[f].name for f in faces]
    known = prior_rows(pose, part, found.Ts[[k]])[0][0]
    chi2, fixed = chi_square(found, k)
    chi2 += float(np.sum(found.z[k] ** 2) + np.sum(known**2))
    named = pose is not None and pose.T_world_part is not None  # a rough pose names one of the spins, too
    dof = fixed + len(known) + len(free) - (len(spins(part)) if named else 0)
    return hypothesis_at(
        part,
        T,
        mode.covariance + common,
        free=free,
        probability=mode.probability,
        chi2=chi2,
        dof=dof,
        rms=float(np.sqrt(np.mean(found.distances[k, belongs] ** 2))) if belongs.any() else 0.0,
        outliers=tuple(name for name, ok in zip(touches.ids, belongs, strict=True) if not ok),
        pairings=tuple((i, f) for i, f, ok in zip(touches.ids, names, belongs, strict=True) if ok),
        outlier_distances=tuple(float(d) for d, ok in zip(found.distances[k], belongs, strict=True) if not ok),
        covariance_same_robot=None if given is None else given + common_given,
        shared=_shared_given(mode),
    )


def _shared_given(mode: Mode) -> SharedGiven | None:
    """The shared errors given the pose that is the answer; None without any."""
    found, k = mode.found, mode.k
    if not found.z.shape[1]:
        return None
    given = SharedGiven.at(found.z[k], found.information[k])
    return given if mode.shift is None else given.about(mode.shift)


def worst_reading(touches: Touches, mode: Mode) -> str:
    """The reading, or sensed normal, that agrees least among those on the part; empty if none is far off."""
    found, k = mode.found, mode.k
    off = np.stack([np.abs(found.residuals[k]), found.tilts[k]]) * (found.belongs[k] > 0.5)
    tilted, i = np.unravel_index(int(np.argmax(off)), off.shape)
    if off[tilted, i] < _REMARKABLE:
        return ""
    return f"{'the normal of ' if tilted else ''}reading {touches.ids[i]}, {off[tilted, i]:.1f} sd off"


def faces_met(touches: Touches, mode: Mode) -> IntArray:
    """Index of the face that each reading is nearest to ``(n,)``."""
    points = touches.points + touches.gains @ mode.found.z[mode.k]
    near = mode.target.surface.closest(SE3.apply(SE3.inverse(mode.found.Ts[mode.k]), points))
    return mode.target.part.triangle_face[near.triangles]


def _common_tolerance(touches: Touches, mode: Mode, faces: IntArray) -> tuple[Covariances, Covariances]:
    """What the covariances lack because a made face deviates as a whole, not anew at every reading, twice ``(6, 6)``.

    The estimate weighs readings as if their deviations were independent; for that estimator, readings of one face
    with one deviation of sd ``tolerance`` add ``A^-1 J' W (one draw - many) W J A^-1``. First with the shared errors
    that are estimated beside the pose, then as if these were known.
    """
    if touches.tolerance == 0:
        return np.zeros((6, 6)), np.zeros((6, 6))
    found, k, free = mode.found, mode.k, mode.free
    J, w, R = found.rows[k], found.belongs[k], found.Ts[k][:3, :3]
    sd = 1 / np.linalg.norm(J[:, :3], axis=1)  # the translation part of a row is the normal over its sd
    shared = -np.einsum("ni,nid->nd", J[:, :3] @ R.T, touches.gains)
    weighted = np.concatenate([J, shared], axis=1) * (w * touches.tolerance / sd)[:, None]
    rows = free @ np.linalg.inv(part_scale(mode.target.part))
    hold = 1e9 * np.abs(found.information[k]).max()
    held = np.array(found.information[k])
    held[:6, :6] += hold * rows.T @ rows
    extra = -weighted.T @ weighted
    for face in np.unique(faces):
        together = weighted[faces == face].sum(axis=0)
        extra = extra + np.outer(together, together)
    return _gained(np.linalg.inv(held)[:6], extra), _gained(np.linalg.inv(held[:6, :6]), extra[:6, :6])


def _gained(gain: FloatArray, extra: FloatArray) -> Covariances:
    """``gain extra gain'``, without what is negative of it."""
    values, vectors = np.linalg.eigh(gain @ extra @ gain.T)
    return np.asarray((vectors * values.clip(0.0)) @ vectors.T)


def what_limits(mode: Mode, shared: Sequence[SharedError]) -> str:
    """A sentence on the largest of the errors that all readings share, if it matters; empty if not.

    Args:
        mode: the answer.
        shared: the errors behind its ``z``, in that order.
    """
    part, information, start = mode.target.part, mode.found.information[mode.k], 6
    total, worst, name, lessened = _corner_sd(mode, information), 0.0, "", ""
    if mode.moments is not None and corner_sd(part, mode.moments.covariance) > _ALIKE * total:
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
    """Of the worst corner [m], from the information on pose and shared errors; spins of the part are no error."""
    part, scale = mode.target.part, part_scale(mode.target.part)
    unit = scale.T @ without_spins(part, pose_information(information)) @ scale
    return corner_sd(part, scale @ np.linalg.pinv(unit, rcond=1e-12, hermitian=True) @ scale.T)


def _lessened(error: SharedError) -> str:
    """How readings can lessen that error; empty if nothing is known of it."""
    return next((advice for source, advice in _LESSENED.items() if error.name.startswith(source)), "")
