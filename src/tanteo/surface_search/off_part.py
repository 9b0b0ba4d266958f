"""What is said of readings that are not on the part that explains the others."""

from __future__ import annotations

import numpy as np

from tanteo.matching.priors import Priors
from tanteo.matching.results import Hypothesis
from tanteo.surface_search.kin import log_density_elsewhere, log_density_of_kin, shifted
from tanteo.surface_search.likelihood import densities_at
from tanteo.surface_search.mode import Mode
from tanteo.surface_search.strays import so_many
from tanteo.surface_search.touches import Touches

_NOTABLE = 0.05
"""So many strays are mentioned if they, or more, are not more probable than this; and "none of these" from this on."""


def mostly_on(best: Hypothesis, unknown: float) -> bool:
    """Whether "none of these" is more probable than a part that most of the readings, but not all, are on."""
    return best.probability < unknown and 0 < len(best.outliers) < len(best.pairings)


def not_on_it(best: Hypothesis, unknown: float) -> str:
    """What it means that "none of these" is more probable than a part that most of the readings are on."""
    n = len(best.outliers) + len(best.pairings)
    return (
        f"The closest part is {best.part}, but {len(best.outliers)} of {n} readings are not on it: it may be another "
        f"part (P = {unknown:.2f}); add its file, check the sensor's standard deviation, or expect more strays "
        "(--strays)."
    )


def left_out(best: Hypothesis, priors: Priors) -> str:
    """A warning if more readings are off the part than is expected."""
    strays = len(best.outliers)
    n = strays + len(best.pairings)
    if so_many(strays, n, priors.clutter) > _NOTABLE:
        return ""
    return f" {strays} of {n} readings are not on it, more than expected: check them, and the order of their columns."


def face_elsewhere(touches: Touches, mode: Mode, unknown: float, priors: Priors) -> str:
    """Which face of the part is elsewhere, if it may be another that differs by that one; empty if not.

    Args:
        touches: the readings.
        mode: the likeliest.
        unknown: probability of "none of these".
        priors: what is assumed beforehand.
    """
    if unknown < _NOTABLE:
        return ""
    part, T, z = mode.target.part, mode.found.Ts[[mode.k]], mode.found.z[[mode.k]]
    at = densities_at(touches, T, z, mode.target, priors)
    anywhere = log_density_elsewhere(at.log_hit, at.log_stray, priors.clutter, touches.places)
    if log_density_of_kin(at, part, priors.clutter, touches.places)[0] < anywhere[0] + np.log(2):
        return ""
    found = shifted(at, part, priors.clutter)
    k = int(np.argmax(found.log_odds))
    way = "out" if found.offsets[k] > 0 else "in"
    return (
        f" {found.counts[k]} readings agree that {part.faces[found.faces[k]].name} of {part.name} is "
        f"{1e3 * abs(found.offsets[k]):.2g} mm farther {way}."
    )
