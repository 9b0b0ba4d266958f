"""Whether poses explain the readings: with residuals of noise, of the stated size or somewhat more, and few strays."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import chdtrc

from tanteo.limits import SUSPECT
from tanteo.localization import pose_information
from tanteo.matching.priors import log_sum
from tanteo.matching.verdict import CONFIDENCE
from tanteo.surface_search.polish import Polished
from tanteo.surface_search.strays import so_many
from tanteo.surface_search.target import Target
from tanteo.typing import IntArray

_STRAYS, _PLAUSIBLE = 0.03, 1e-3
"""A pose explains the readings if as many strays as it leaves, and their chi-square, are not less likely than this."""

_ENOUGH, _MOST_SCATTER = 6, 2.0
"""Spare readings from which, and ratio up to which, scatter is put down to the stated standard deviation."""


_FEW = 20
"""Readings of which one astray raises the mean cost of the right pose above that of many wrong ones."""


def explained(found: Polished, clutter: float) -> bool:
    """Whether the best pose has the residuals of noise, and no more readings aside than clutter at that rate makes.

    Args:
        found: maxima, best first.
        clutter: rate of strays.
    """
    if not len(found.Ts):
        return False
    strays, n = int(np.sum(found.belongs[0] <= 0.5)), found.belongs.shape[1]
    if so_many(strays, n, clutter) <= _STRAYS:
        return False
    chi2, dof = chi_square(found, 0)
    return bool(dof <= 0 or chdtrc(dof, chi2) > _PLAUSIBLE)


def explains_all(found: Polished) -> bool:
    """Whether the best pose has the residuals of noise, and leaves no reading aside."""
    return explained(found, clutter=0.0)


def leaves_one_of_few(found: Polished | None, few: float = _FEW) -> bool:
    """Whether the best pose leaves a reading aside of so few that one astray may have hidden a better pose."""
    return found is not None and found.belongs.shape[1] < few and bool(np.any(found.belongs[:1] <= 0.5))


def scatter(found: Sequence[tuple[Target, Polished]]) -> float:
    """How many times more the readings scatter than stated, if the part is sure and nothing else is wrong; else 1.

    Args:
        found: maxima of each part, best first.
    """
    found = [(target, maxima) for target, maxima in found if len(maxima.Ts)]
    if not found:
        return 1.0
    mass = np.array([log_mass(target, maxima) for target, maxima in found])
    if np.exp(mass.max() - log_sum(mass)) < CONFIDENCE:
        return 1.0
    best = found[int(np.argmax(mass))][1]
    chi2, dof = _of_points(best)
    if dof < _ENOUGH or chdtrc(dof, chi2) > SUSPECT:
        return 1.0
    ratio = float(np.sqrt(chi2 / dof))
    return ratio if ratio <= _MOST_SCATTER else 1.0


def chi_square(found: Polished, k: int) -> tuple[float, int]:
    """Of the readings that a pose explains, points and sensed normals, and its degrees of freedom if none is free.

    Args:
        found: maxima.
        k: which of them.
    """
    belongs, tilts = found.belongs[k] > 0.5, found.tilts[k]
    chi2 = float(np.sum(found.residuals[k, belongs] ** 2) + np.sum(tilts[belongs] ** 2))
    return chi2, int(belongs.sum()) + 2 * int(np.count_nonzero(tilts[belongs])) - 6


def _of_points(found: Polished) -> tuple[float, float]:
    """The same of the points alone at the best pose, which sensed normals help to fix: fewer of them are used up."""
    belongs = found.belongs[0] > 0.5
    chi2, n = float(np.sum(found.residuals[0, belongs] ** 2)), int(belongs.sum())
    if not found.tilts[0].any():
        return chi2, n - 6
    J = found.rows[0, belongs]
    used = np.trace(J @ np.linalg.pinv(pose_information(found.information[0]), rcond=1e-12, hermitian=True) @ J.T)
    return chi2, n - float(np.clip(used, 0.0, 6.0))


def log_mass(target: Target, found: Polished, rows: IntArray | None = None) -> float:
    """Log evidence of some maxima of a part together, all if not given, symmetric poses included."""
    log = found.log_evidence if rows is None else found.log_evidence[rows]
    return float(log_sum(log) + np.log(target.part.symmetry.order)) if len(log) else -np.inf
