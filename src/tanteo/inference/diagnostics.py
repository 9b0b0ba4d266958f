"""What is said of measurements that are not on the part that explains the others, or scatter more than stated."""

from __future__ import annotations

import numpy as np

from tanteo.answers import Hypothesis, Priors
from tanteo.inference.fit_at_mode import GoodnessOfFit
from tanteo.inference.near_variants import log_density_by_surfaces, log_density_of_near_variant, shifted
from tanteo.inference.outliers import so_many
from tanteo.measurements import ContactPoints
from tanteo.special import binomial_cdf

_NOTABLE = 0.05
"""So many outliers are mentioned if they, or more, are not more probable than this; the unknown object from this on."""

_FEW = 3
"""So many outliers are named."""

_CONTRADICTED = 1e-3
"""So improbable a number of outliers among labelled points contradicts the part that explains the others."""


def mostly_on(best: Hypothesis, unknown: float) -> bool:
    """Whether the unknown object is more probable than a part that most of the points, but not all, are on."""
    return best.probability < unknown and 0 < len(best.outliers) < len(best.pairings)


def not_on_it(best: Hypothesis, unknown: float) -> str:
    """What it means that the unknown object is more probable than a part that most of the points are on."""
    n = len(best.outliers) + len(best.pairings)
    return (
        f"The closest part is {best.part}, but {len(best.outliers)} of {n} readings are not on it: it may be another "
        f"part (P = {unknown:.2f}); add its file, check the sensor's standard deviation, or expect more outliers "
        "(--outlier-rate)."
    )


def against_labels(one: GoodnessOfFit, priors: Priors) -> str:
    """What it means that more labelled points are off the part than labels are wrong; empty if not.

    A sensor may make more outliers than is stated, and then the rate is found out; but labels come from a person.
    """
    off, n = int(np.sum(one.outliers & (one.at.groups >= 0))), int(np.sum(one.at.groups >= 0))
    if not off or binomial_cdf(off - 1, n, np.array([priors.outlier_rate]))[0] < 1 - _CONTRADICTED:
        return ""
    name = one.mode.prepared.part.name
    return (
        f"{name} fits best, but {off} of {n} labelled readings are not on it, more than expected: it may be another "
        "part. Check these labels, and sense more of it."
    )


def left_out(best: Hypothesis, priors: Priors) -> str:
    """Which points are off the part, if few are; a warning if these are more than is expected."""
    outliers = len(best.outliers)
    n = outliers + len(best.pairings)
    if not outliers:
        return ""
    if so_many(outliers, n, priors.outlier_rate) <= _NOTABLE:
        return (
            f" {outliers} of {n} readings are not on it, more than expected: check them, and the order of their "
            "columns."
        )
    if outliers > _FEW:
        return f" {outliers} of {n} readings are not on it."
    named = [
        f"{name} ({1e3 * abs(off):.2g} mm off)" for name, off in zip(best.outliers, best.outlier_distances, strict=True)
    ]
    if outliers == 1:
        return f" Reading {named[0]} is not on it, and was left aside: check it."
    return f" Readings {', '.join(named[:-1])} and {named[-1]} are not on it, and were left aside: check them."


def face_elsewhere(points: ContactPoints, one: GoodnessOfFit, unknown: float, priors: Priors) -> str:
    """Which face of the part is elsewhere, if it may be a near variant that differs by that one; empty if not.

    Args:
        points: the measurements.
        one: the likeliest mode.
        unknown: probability of the unknown object.
        priors: what is assumed beforehand.
    """
    if unknown < _NOTABLE:
        return ""
    part, at = one.mode.prepared.part, one.at
    anywhere = log_density_by_surfaces(at, priors.outlier_rate)
    if log_density_of_near_variant(at, part, priors.outlier_rate)[0] < anywhere[0] + np.log(2):
        return ""
    found = shifted(at, part, priors.outlier_rate)
    k = int(np.argmax(found.log_odds))
    way = "out" if found.offsets[k] > 0 else "in"
    agree = f"{found.counts[k]} readings agree" if found.counts[k] > 1 else "One reading says"
    return (
        f" {agree} that {part.faces[found.faces[k]].name} of {part.name} is "
        f"{1e3 * abs(found.offsets[k]):.2g} mm farther {way}."
    )


def around_words(one: GoodnessOfFit) -> str:
    """How many points are of what stands around; empty if none is."""
    around, on_it = one.mode.objective.problem.around, one.on_furniture
    counts = [(int(np.sum(on_it & (around.which == k))), name) for k, name in enumerate(around.names)]
    words = [f"{count} on the {name}" for count, name in counts if count]
    return f" Of {len(on_it)} readings {' and '.join(words)}." if words else ""


def scattered(best: Hypothesis, worst: str) -> str:
    """That the points scatter more or less than stated, if that is sure, and the worst of them."""
    scale, low, high = best.noise_scale
    if low <= 1 <= high:
        return ""
    says = (
        f" The readings scatter {scale:.2g} times as much as stated (95 %: {low:.2g} to {high:.2g}), and the "
        "covariance is of that."
    )
    if scale < 1:
        return says
    says += (
        " If an error that all of them share is behind it (tip, radius, calibration), the pose is less sure: state it."
    )
    return says + (f" The worst is {worst} even so." if worst else "")
