"""Which part is it, where is it, how sure are we: the whole path from sensed features to the answer."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from tanteo.answers.hypothesis import hypothesis_at
from tanteo.answers.part_motions import part_scale
from tanteo.answers.priors import Priors, sized
from tanteo.answers.question import Clock, check_question
from tanteo.answers.results import Hypothesis, Recognition
from tanteo.answers.verdict import verdict
from tanteo.features import SharedError
from tanteo.lie import SE3
from tanteo.localization import ModelFeature, Pairing, estimate_pose
from tanteo.matching.belief import Mode, believe
from tanteo.matching.freedom import NOTHING
from tanteo.matching.model import PartModel, prepare
from tanteo.matching.pairings import decode
from tanteo.matching.placed import Beside, Located, place, weigh_beside
from tanteo.matching.published import believe_as_published
from tanteo.matching.sensed import Sensed, sense
from tanteo.parts import Part
from tanteo.typing import Transforms

if TYPE_CHECKING:
    from tanteo.fitting import Sides

_FITS = 0.5
"""Probability of none of the parts up to which one of them fits, before it is asked where."""


def identify_features(
    features: Sequence[Sides],
    parts: Sequence[Part] | Sequence[PartModel],
    *,
    tolerance: float = 0.0,
    alpha: float = 0.01,
    top: int = 5,
    as_published: bool = False,
    priors: Priors | None = None,
    beside: Beside | None = None,
    shared: Sequence[SharedError] = (),
) -> Recognition:
    """Which of the parts the sensed features belong to, and its pose.

    Args:
        features: sensed planes, edges and vertices in the world; a plane whose outward side is unknown as a pair of
            both.
        parts: candidates, as parts or prepared (``prepare(part)``, which is kept with the part).
        tolerance: sd of the made part's surface against its CAD [m].
        alpha: an answer whose joint test has a smaller p-value than this is not accepted.
        top: number of hypotheses to report.
        as_published: use the constraints and tests of the 1991 paper as printed, for comparison.
        priors: what is assumed beforehand; the radius is that of the largest part if not given.
        beside: log probability of something else that was seen, of a part at some poses.
        shared: errors that the features share, in the order in which ``beside`` and the hypotheses have them.

    Returns:
        The answer, whatever its status; nothing is raised for an unkind world.

    Raises:
        InputError: without parts, or for an ``alpha`` outside (0, 1).
    """
    parts = check_question(parts, alpha, top, 0, priors)
    if not features:
        return Recognition("insufficient", "There is no feature: sense three faces or more.", (), 1.0)
    clock = Clock()
    models = [part if isinstance(part, PartModel) else prepare(part) for part in parts]
    sensed = sense(features)
    priors = sized(priors, max(model.radius for model in models))
    clock.lap("prepare")
    belief = believe_as_published(sensed, models, alpha) if as_published else believe(sensed, models, priors, tolerance)
    clock.lap("search")
    modes, unknown = belief.modes, belief.unknown
    more = priors.pose is not None or beside is not None
    found = tuple(_located(sensed, mode, tolerance) for mode in (modes if more else modes[:top]))
    if priors.pose is not None:
        found, unknown = place(found, unknown, priors.pose, sensed.middle, priors.radius)
    if beside is not None:
        found, unknown = weigh_beside(found, unknown, beside, shared)
    modes = tuple(one.mode for one in found) if more else modes
    hypotheses = tuple(_hypothesis(sensed, one, tolerance, shared) for one in found[:top])
    clock.lap("locate")
    worst = _worst(sensed, modes[0], tolerance) if hypotheses and hypotheses[0].p_value < alpha else ""
    shares = [(mode.model.name, mode.probability) for mode in modes]
    status, message = verdict(
        hypotheses,
        unknown,
        alpha,
        cut=belief.cut,
        as_published=as_published,
        worst=worst,
        shares=shares,
        prior_p=found[0].prior_p if found and belief.unknown < _FITS else 1.0,
    )
    return Recognition(status, message, hypotheses, unknown, clock.laps())


def _worst(sensed: Sensed, mode: Mode, tolerance: float) -> str:
    """The label whose feature agrees least with the part, by its distance a degree of freedom."""
    assert mode.model.part is not None
    pairings = pairings_of(sensed, mode, tolerance)
    estimate = estimate_pose(pairings, start=mode.T_world_part, length=mode.model.part.diagonal)
    sizes = np.array([len(pairing.sensed.P) for pairing in pairings])
    worst = pairings[int(np.argmax(estimate.distances / sizes))]
    return f"the readings of '{worst.sensed.label}' on {worst.model.name}"


def pairings_of(sensed: Sensed, mode: Mode, tolerance: float) -> list[Pairing]:
    """The mode's interpretation as pairings of sensed with model features."""
    out = []
    for i, choice in enumerate(mode.choices):
        if choice == NOTHING:
            continue
        kind = sensed.kinds[i]
        chosen, view = (int(k) for k in decode(choice, mode.model, kind))
        feature, candidates = sensed.features[sensed.views[i][view]], mode.model.candidates[kind]
        P = np.diag((tolerance * candidates.tolerance_scale[chosen]) ** 2)
        T = candidates.Ts_part_feature[chosen]
        out.append(Pairing(feature, ModelFeature(feature.kind, T, P, 0.0, candidates.names[chosen])))
    return out


def _located(sensed: Sensed, mode: Mode, tolerance: float) -> Located:
    part = mode.model.part
    assert part is not None
    pairings = pairings_of(sensed, mode, tolerance)
    estimate = estimate_pose(pairings, start=mode.T_world_part, length=part.diagonal, middle=part.centroid)
    return Located.by_features(mode, estimate)


def _hypothesis(sensed: Sensed, one: Located, tolerance: float, shared: Sequence[SharedError]) -> Hypothesis:
    mode, part = one.mode, one.mode.model.part
    assert part is not None
    pairings = pairings_of(sensed, mode, tolerance)
    outliers, distances = _outliers(sensed, mode, one.T_world_part)
    return hypothesis_at(
        part,
        one.T_world_part,
        one.covariance,
        free=np.asarray(np.linalg.solve(part_scale(part), one.free.T).T, dtype=np.float64),
        probability=mode.probability,
        chi2=one.chi2,
        dof=one.dof,
        rms=_rms(one.T_world_part, pairings),
        outliers=outliers,
        pairings=tuple((r, p.model.name) for p in pairings for r in p.sensed.readings or (p.sensed.label,)),
        outlier_distances=distances,
        covariance_same_robot=one.covariance_same_robot if one.estimate.shared else None,
        shared=one.shared_given(shared) if shared else None,
    )


def _outliers(sensed: Sensed, mode: Mode, T_world_part: Transforms) -> tuple[tuple[str, ...], tuple[float, ...]]:
    """Readings of the features that were left out, and how far from the part's surface they are [m]."""
    names, distances = list[str](), list[float]()
    for i in np.flatnonzero(mode.choices == NOTHING):
        feature = sensed.features[i]
        local = SE3.apply(SE3.inverse(T_world_part), feature.support)
        distances += list(map(float, mode.model.surface.closest(local).distances)) or [float("nan")]
        names += feature.readings or (feature.label,)
    return tuple(names), tuple(distances) if len(distances) == len(names) else (float("nan"),) * len(names)


def _rms(T_world_part: Transforms, pairings: Sequence[Pairing]) -> float:
    """Root mean square distance of the sensed points from the model features they are paired with [m]."""
    squared = [np.zeros(0)]
    for pairing in pairings:
        T_world_model = T_world_part @ pairing.model.T_part_feature
        local = SE3.apply(SE3.inverse(T_world_model), pairing.sensed.support)
        across = [i for i in pairing.model.kind.rows if i < 3]
        squared.append(np.sum(local[:, across] ** 2, axis=1))
    total = np.concatenate(squared)
    return float(np.sqrt(total.mean())) if len(total) else 0.0
