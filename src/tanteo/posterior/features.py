"""Recognition from sensed features, which count as labelled points."""

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
    """Identify the part on which features were sensed, and estimate its pose.

    Each feature is replaced by points with the same information, which share one face, edge or corner of the part (or
    are on another object). If the points themselves are available, :func:`tanteo.identify` is better: they carry all
    the information.

    Args:
        features: sensed planes, edges, vertices, circles, cylinders, spheres and cones in the world; a plane whose
            outward side is unknown is a pair of both sides.
        parts: candidate parts, prepared or not.
        tolerance: standard deviation of the made part's surface from its CAD [m].
        significance: p-value below which the joint test rejects an answer.
        top: number of hypotheses to report.
        priors: priors; by default the radius is that of the largest part.

    Returns:
        The answer. If no part fits, its status states it; no exception is raised. Pairings and outliers are named by
        the readings of a feature, or by its label.

    Raises:
        InputError: no part, ``significance`` outside (0, 1), or an unsupported kind of feature.
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
    """Return a hypothesis with readings of features instead of the points that represent these.

    A feature is an outlier if most of its points are off the part.
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
