"""What limits an answer: the largest of the errors that all measurements share, in words."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tanteo.features import SharedError
from tanteo.fitting import pose_information
from tanteo.geometry.typing import FloatArray
from tanteo.posterior.answers.part_motions import corner_sd, part_scale, without_spins
from tanteo.posterior.fit_at_mode import GoodnessOfFit
from tanteo.posterior.sampling.modes import Mode
from tanteo.words.findings import SharedErrorLimits


def what_limits(one: GoodnessOfFit, shared: Sequence[SharedError]) -> SharedErrorLimits | None:
    """Return the largest of the errors that all measurements share, if it matters; None if not.

    Args:
        one: the answer.
        shared: the errors behind its shared states, in that order.
    """
    mode, own = one.mode, one.mode.objective.problem.settings.checks
    information, start = mode.information, 6
    total, worst, name, source = _corner_sd(mode, information), 0.0, "", ""
    if corner_sd(mode.prepared.part, mode.covariance) > own.beyond_curvature * total:
        return None  # the curvature of the maximum says little of how far off the pose may be, or why
    for error in shared:
        stop = start + len(error.covariance)
        known = np.array(information)
        known[start:stop, start:stop] += 1e12 * np.eye(stop - start)
        part_of = float(np.sqrt(max(total**2 - _corner_sd(mode, known) ** 2, 0.0)))
        if part_of > worst:
            worst, name, source = part_of, error.meaning or error.name, error.name
        start = stop
    if worst < own.limiting_share * total:
        return None
    return SharedErrorLimits(name, worst, total, float(np.sqrt(total**2 - worst**2)), source)


def _corner_sd(mode: Mode, information: FloatArray) -> float:
    """The largest corner sd [m], from the information on all states; spins of the part are no error."""
    part = mode.prepared.part
    scale = part_scale(part)
    unit = scale.T @ without_spins(part, pose_information(information)) @ scale
    return corner_sd(part, scale @ np.linalg.pinv(unit, rcond=1e-12, hermitian=True) @ scale.T)
