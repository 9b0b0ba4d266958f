"""The shared error that contributes most to the uncertainty of an answer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from tanteo.features import SharedError
from tanteo.fitting.localization import pose_information
from tanteo.geometry.typing import FloatArray
from tanteo.posterior.answers.part_motions import corner_sd, part_scale, without_symmetry
from tanteo.posterior.fit_at_mode import GoodnessOfFit
from tanteo.posterior.sampling.modes import Mode
from tanteo.sensors.error_states import Drift, Form, Scale
from tanteo.words.findings import SharedErrorLimits


def dominant_shared_error(
    one: GoodnessOfFit, shared: Sequence[SharedError], reported: float
) -> SharedErrorLimits | None:
    """Return the finding about the shared error that contributes most to the uncertainty; None if none dominates.

    Args:
        one: the answer.
        shared: shared errors, in the order of the states.
        reported: largest corner sd of the answer, which also contains unstated errors and the scatter [m].
    """
    mode, own = one.mode, one.mode.objective.problem.settings.checks
    information, start = mode.information, 6
    total, worst, name, source = _corner_sd(mode, information), 0.0, "", ""
    if corner_sd(mode.prepared.part, mode.covariance) > own.beyond_curvature * total:
        return None  # the curvature does not describe the uncertainty
    for error in shared:
        stop = start + len(error.covariance)
        known = np.array(information)
        known[start:stop, start:stop] += 1e12 * np.eye(stop - start)
        part_of = float(np.sqrt(max(total**2 - _corner_sd(mode, known) ** 2, 0.0)))
        if part_of > worst:
            worst, name, source = part_of, error.title, error.name
        start = stop
    worst = min(worst, reported)  # a small scatter may make the answer more certain than its stated noise
    if worst < own.limiting_share * reported:
        return None
    return SharedErrorLimits(name, worst, reported, float(np.sqrt(reported**2 - worst**2)), source)


_ASSUMED = {
    Scale.name: "an assumed scale error of the world",
    Drift.name: "an assumed drift over the run",
    Form.name: "an assumed warp of the part",
}


def unstated_errors_limit(
    corner_sd: float, without: float, share: float, only: Mapping[str, float] | None = None
) -> SharedErrorLimits | None:
    """Return the finding that unstated errors dominate the uncertainty; None if they do not.

    Args:
        corner_sd: largest corner sd of the pose [m].
        without: largest corner sd of the pose without these errors [m].
        share: contribution over the largest corner sd from which an error is named.
        only: largest corner sd with each error alone, by its name [m], to name the largest; None to name all.
    """
    part_of = float(np.sqrt(max(corner_sd**2 - without**2, 0.0)))
    if part_of < share * corner_sd:
        return None
    if not only:
        what = "an assumed scale error, drift and warp"
        return SharedErrorLimits(what, part_of, corner_sd, without, "unstated")
    worst = max(only, key=lambda name: only[name])
    own = float(np.sqrt(max(only[worst] ** 2 - without**2, 0.0)))
    return SharedErrorLimits(_ASSUMED[worst], own, corner_sd, without, f"unstated {worst}")


def _corner_sd(mode: Mode, information: FloatArray) -> float:
    """Return the largest corner sd from the information on all states [m]; symmetries are no error."""
    part = mode.prepared.part
    scale = part_scale(part)
    unit = scale.T @ without_symmetry(part, pose_information(information)) @ scale
    return corner_sd(part, scale @ np.linalg.pinv(unit, rcond=1e-12, hermitian=True) @ scale.T)
