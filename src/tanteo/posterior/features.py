"""From sensed features to the answer: as labelled points, like every other measurement."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tanteo.defaults import SIGNIFICANCE, TOP
from tanteo.factors import FreeRays, as_labelled_points
from tanteo.features import Sides, collect_shared
from tanteo.parts import Part
from tanteo.posterior.answers.priors import Priors
from tanteo.posterior.answers.results import Answer, Hypothesis
from tanteo.posterior.prepared import PreparedPart
from tanteo.posterior.recognition import identify_points


def identify_features(
    features: Sequence[Sides],
    parts: Sequence[Part] | Sequence[PreparedPart],
    *,
    tolerance: float = 0.0,
    significance: float = SIGNIFICANCE,
    top: int = TOP,
    priors: Priors | None = None,
) -> Answer:
    """Which of the parts the sensed features belong to, and its pose.

    A feature counts as the points that it is as good as, which share one face, edge or corner of the part (or are of
    something else). Where the points themselves are at hand, :func:`tanteo.identify` is better: they are all there is.

    Args:
        features: sensed planes, edges, vertices, circles, cylinders, spheres and cones in the world; a plane whose
            outward side is unknown as a pair of both.
        parts: candidates, as parts or prepared.
        tolerance: sd of the made part's surface against its CAD [m].
        significance: an answer whose joint test has a smaller p-value than this is not accepted.
        top: number of hypotheses to report.
        priors: what is assumed beforehand; the radius is that of the largest part if not given.

    Returns:
        The answer, whatever its status; nothing is raised for an unkind world. Pairings and outliers are named by the
        readings of a feature, or by its label.

    Raises:
        InputError: without parts, for a ``significance`` outside (0, 1), or another kind of feature.
    """
    points = as_labelled_points(features, tolerance)
    firsts = [given[0] if isinstance(given, tuple) else given for given in features]
    shared = collect_shared(firsts)[0]
    answer = identify_points(
        points, FreeRays.none(), parts, shared=shared, significance=significance, top=top, priors=priors
    )
    readings = {name: f.readings or (name,) for name, f in zip(dict.fromkeys(points.ids), firsts, strict=True)}
    return replace(answer, hypotheses=tuple(_by_feature(h, readings) for h in answer.hypotheses))


def _by_feature(hypothesis: Hypothesis, readings: dict[str, tuple[str, ...]]) -> Hypothesis:
    """Pairings and outliers by the readings of each feature instead of the points that stand for it.

    A feature of which most points are off is an outlier.
    """
    paired, off = dict[str, list[str]](), dict[str, list[float]]()
    for name, face in hypothesis.pairings:
        paired.setdefault(name, []).append(face)
    for name, distance in zip(hypothesis.outliers, hypothesis.outlier_distances, strict=True):
        off.setdefault(name, []).append(distance)
    out = {name: float(np.mean(d)) for name, d in off.items() if len(d) > len(paired.get(name, []))}
    on = {name: max(faces, key=faces.count) for name, faces in paired.items() if name not in out}
    return replace(
        hypothesis,
        pairings=tuple((r, face) for name, face in on.items() for r in readings[name]),
        outliers=tuple(r for name in out for r in readings[name]),
        outlier_distances=tuple(d for name, d in out.items() for _ in readings[name]),
    )
