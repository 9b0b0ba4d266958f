"""Findings about measurements that are off the part, or whose scatter differs from the stated noise."""

from __future__ import annotations

import numpy as np

from tanteo.factors import ContactPoints
from tanteo.geometry.limits import NOTABLE, SUSPECT
from tanteo.geometry.special import binomial_cdf, chi2_quantile
from tanteo.posterior.answers.priors import Priors
from tanteo.posterior.answers.results import Hypothesis
from tanteo.posterior.fit_at_mode import GoodnessOfFit
from tanteo.posterior.near_variants import log_density_by_surfaces, log_density_of_design, shifted
from tanteo.posterior.outliers import beta_binomial_tail
from tanteo.words.findings import (  # fmt: skip
    CorrelatedReadings,
    FaceDisplaced,
    LabelsContradicted,
    MostlyOnPart,
    OnFurniture,
    Outliers,
    Scatter,
    WorstReading,
)


def mostly_on(best: Hypothesis, unknown: float) -> bool:
    """Return whether the unknown object is more probable than a part with most, but not all, points on it."""
    return best.probability < unknown and 0 < len(best.outliers) < len(best.pairings)


def mostly_on_part(best: Hypothesis, unknown: float) -> MostlyOnPart:
    """Return the finding that an unknown object is more probable than the part that has most points on it."""
    return MostlyOnPart(best.part, unknown, best.outliers, len(best.outliers) + len(best.pairings))


def against_labels(one: GoodnessOfFit, priors: Priors) -> LabelsContradicted | None:
    """Return the finding that more labelled points are off the part than wrong labels explain; None if they are not.

    The outlier rate of a sensor is estimated and may exceed the stated one. Labels come from a person, so the stated
    rate holds for them.
    """
    off, n = int(np.sum(one.outliers & (one.at.groups >= 0))), int(np.sum(one.at.groups >= 0))
    if not off or binomial_cdf(off - 1, n, np.array([priors.outlier_rate]))[0] < 1 - SUSPECT:
        return None
    return LabelsContradicted(one.mode.prepared.part.name, off, n)


def outlier_finding(best: Hypothesis, priors: Priors) -> Outliers | None:
    """Return the finding about points off the part, and whether so many are expected; None if there are none."""
    outliers, n = len(best.outliers), len(best.outliers) + len(best.pairings)
    if not outliers:
        return None
    expected = beta_binomial_tail(outliers, n, priors.outlier_rate) > NOTABLE
    return Outliers(best.outliers, best.outlier_distances, n, expected)


def face_elsewhere(points: ContactPoints, one: GoodnessOfFit, unknown: float, priors: Priors) -> FaceDisplaced | None:
    """Return the finding that the object may be the part with one displaced face; None if it is improbable.

    Args:
        points: the measurements.
        one: the most probable mode.
        unknown: probability of the unknown object.
        priors: priors of the inference.
    """
    if unknown < NOTABLE:
        return None
    part, at = one.mode.prepared.part, one.at.of_design(int(np.argmax(one.at.designs[:, 0])))
    anywhere = log_density_by_surfaces(at, priors.outlier_rate)
    if log_density_of_design(at, part, priors.outlier_rate)[0] < anywhere[0] + np.log(2):
        return None
    found = shifted(at, part, priors.outlier_rate)
    k = int(np.argmax(found.log_odds))
    face = part.faces[found.faces[k]].name
    return FaceDisplaced(part.name, face, float(found.offsets[k]), int(found.counts[k]))


def on_furniture(one: GoodnessOfFit) -> OnFurniture | None:
    """Return the finding that points are on furniture, with their number by name; None if there are none."""
    furniture, on_it = one.mode.objective.problem.furniture, one.on_furniture
    counts = [(name, int(np.sum(on_it & (furniture.which == k)))) for k, name in enumerate(furniture.names)]
    found = tuple((name, count) for name, count in counts if count)
    return OnFurniture(len(on_it), found) if found else None


_MANY = 30
"""Definition: number of readings from which the correlation of neighbours is tested: a scan, not single touches."""


def correlated_readings(one: GoodnessOfFit) -> CorrelatedReadings | None:
    """Return the finding that residuals of neighbouring points are correlated; None if they are not.

    The number of independent points is that of a first-order autoregressive process (Priestley 1981, sec. 5.3.2).
    """
    residuals = (one.at.distances[0] * one.per_stated_sd)[one.inliers]
    n = len(residuals)
    if n < _MANY:
        return None
    off = residuals - residuals.mean()
    correlation = float(off[1:] @ off[:-1] / max(float(off @ off), 1e-300))
    independent = max(round(n * (1 - correlation) / (1 + correlation)), 1)
    if correlation < 0 or n * correlation**2 < chi2_quantile(1 - SUSPECT, 1) or 2 * independent > n:
        return None
    return CorrelatedReadings(correlation, n, independent)


def scattered(best: Hypothesis, worst: WorstReading | None, *, unknown: bool = False) -> Scatter | None:
    """Return the finding that the points scatter more or less than stated; None if that is not certain.

    Args:
        best: the most probable hypothesis.
        worst: reading with the largest residual; None if no reading is far off.
        unknown: whether the answer is ``unknown``. Then only a larger scatter about the closest part matters.
    """
    scale, low, high = best.noise_scale
    if low <= 1 <= high or (unknown and scale < 1):
        return None
    return Scatter(scale, low, high, worst if scale >= 1 and not unknown else None, best.part if unknown else "")
