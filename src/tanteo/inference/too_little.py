"""What to sense where so little was measured that any part fits it."""

from __future__ import annotations

import numpy as np

from tanteo.factors import AxisCentre
from tanteo.inference.problem import Problem
from tanteo.inference.settings import FEWEST
from tanteo.measurements import ContactPoints
from tanteo.typing import FloatArray


def too_little(problem: Problem) -> str:
    """What to do if nothing tells the points from those of a line, or from one point; empty if there is enough."""
    if problem.pose_factors and len(problem.points):  # an image fixes the pose, too
        return ""
    points, named = problem.points.take(problem.around.others), problem.priors.pose is not None
    if not len(points) and len(problem.points):
        of = problem.around.names[problem.around.which[0]]
        return f"All {len(problem.points)} readings are on the {of}: sense the part, on several sides."
    if not len(points):
        return f"No reading met anything: sense {FEWEST} places or more, better eight, on several sides."
    line = ", slid along its axis" if any(isinstance(f, AxisCentre) for f in points.factors) else ""
    if len(points) == 1 and points.centres.any():
        return (
            f"One centre fits every hole, boss or sphere of its size, and leaves free how the part is tilted, turned "
            f"about it{line}: sense a second one, and a face."
        )
    if len(points) == 2 and points.centres.all() and not (named or points.oriented.any()):
        line = " and slid along its holes" if line else ""
        return (
            f"Two centres leave free how the part is turned about their line{line}: sense a face, at three places, or "
            "a third centre that is not in line with them."
        )
    if points.held < FEWEST:
        few = "1 reading fits" if len(points) == 1 else f"{len(points)} readings fit"
        return f"{few} any part: sense {FEWEST} places or more, better eight, on several sides."
    if named or points.oriented.any() or np.count_nonzero(points.centres) > 1:
        return ""
    along, across = np.linalg.svd(points.points - points.points.mean(axis=0), compute_uv=False)[:2]
    sd = float(np.median(_along(points)))
    if across > sd * np.sqrt(len(points)):
        return ""
    if along > problem.settings.search.unusual_sds * sd * np.sqrt(len(points)):
        return "The readings lie on one line within their noise: sense places beside it, on several sides."
    noise, what = f"{1e3 * sd:.4g} mm", "standard deviation"
    if points.tolerance > 0:
        noise, what = f"{noise} with the tolerance", "standard deviation, tolerance"
    return (
        f"The noise of the readings (sd {noise}) is as large as the whole set of them, so nothing can be told: check "
        f"{what} and their units, or sense places farther apart."
    )


def _along(points: ContactPoints) -> FloatArray:
    """Standard deviation of each point along its direction, where that is known: a beam's cone is across ``(n,)``."""
    along = np.sqrt(np.einsum("ni,nij,nj->n", points.directions, points.covs, points.directions))
    return np.asarray(np.where(points.directed, along, points.sd))
