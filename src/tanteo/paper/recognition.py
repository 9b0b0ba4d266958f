"""Recognize parts as the paper does: a part is accepted if an assignment passes all univariate gates.

There is no joint test, no side, no extent, no outlier and no unknown object, so mirror images are accepted too.
``docs/paper.md`` quantifies the consequences.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tanteo.defaults import SIGNIFICANCE, TOP
from tanteo.errors import InputError
from tanteo.features import Feature, Sides, collect_shared, shared_root
from tanteo.fitting.localization import (
    Block,
    ModelFeature,
    Pairing,
    estimate_pose,
    first_pose,
    gauss_newton,
    relation_between,
)
from tanteo.geometry import SE3
from tanteo.geometry.typing import FloatArray, IntArray, Transforms
from tanteo.paper.assignments import Candidates, assignments, candidates_of
from tanteo.parts import Part
from tanteo.posterior import Answer, Hypothesis, Misfit, verdict
from tanteo.posterior.answers import Clock, check_question, hypothesis_at, part_scale, without_symmetric_rotation
from tanteo.words.findings import CutShort

_KINDS = "plane", "edge", "vertex"

_SAME = 22.5
"""Squared Mahalanobis distance within which two poses count as one (0.1 % level, six degrees of freedom)."""

_HOLD = 1e-3
"""Damping information for unobserved directions, far below that of any reading."""


@dataclass(frozen=True, slots=True, eq=False)
class _Accepted:
    """A part at a pose.

    Attributes:
        part: accepted part.
        candidates: model features of the part, by kind.
        choices: index of the model feature for each sensed one ``(n,)``.
        T_world_part: pose of the part ``(4, 4)``.
    """

    part: Part
    candidates: dict[str, Candidates]
    choices: IntArray
    T_world_part: Transforms


def identify_as_published(
    features: Sequence[Sides], parts: Sequence[Part], *, significance: float = SIGNIFICANCE, top: int = TOP
) -> Answer:
    """Return the parts that pass the constraints and tests of 1991, all poses with equal weight.

    Args:
        features: sensed planes, edges and vertices in the world; the first side of a plane of unknown side.
        parts: candidate parts.
        significance: rejection percentage of each gate (25).
        top: number of hypotheses to report.

    Raises:
        InputError: there are no parts, ``significance`` is outside (0, 1), or a feature has another kind.
    """
    parts, clock = check_question(parts, significance, top, 0, None), Clock()
    sensed = [given[0] if isinstance(given, tuple) else given for given in features]
    for feature in sensed:
        if feature.kind.name not in _KINDS:
            raise InputError(
                f"feature {feature.label!r}: expected a plane, edge or vertex, got a {feature.kind.name}: the paper "
                "compares these. Remove it."
            )
    accepted, cut = list[_Accepted](), False
    for part in parts:
        candidates = candidates_of(part)
        choices, dropped = assignments(sensed, candidates, significance)
        cut |= dropped
        accepted += _poses(part, candidates, sensed, choices)
    clock.lap("search")
    hypotheses = tuple(_hypothesis(one, sensed, 1 / len(accepted)) for one in accepted[:top])
    clock.lap("locate")
    unknown = 0.0 if accepted else 1.0
    shares = [(one.part.name, 1 / len(accepted)) for one in accepted]
    status, finding = verdict(hypotheses, unknown, significance, as_published=True, shares=shares)
    findings = (finding, CutShort()) if cut else (finding,)
    return Answer(status, findings, hypotheses, unknown, clock.laps(), significance=significance)


def _poses(
    part: Part, candidates: dict[str, Candidates], sensed: Sequence[Feature], choices: IntArray
) -> list[_Accepted]:
    """Return one pose for each assignment, best first, with symmetric poses once."""
    if not len(choices):
        return []
    blocks = _blocks(candidates, sensed, choices)
    start = np.broadcast_to(first_pose(blocks), (len(choices), 4, 4))
    shared = blocks[0].shared_jacobian.shape[-1]
    solution = gauss_newton(blocks, start, shared, hold=_HOLD * np.eye(6), iterations=10, tolerance=1e-12)
    left, out = np.argsort(solution.chi2, kind="stable"), []
    while len(left):
        best = left[0]
        out.append(_Accepted(part, candidates, choices[best], solution.T_world_part[best]))
        gaps = _squared_gaps(part, solution.T_world_part[best], solution.T_world_part[left], solution.information[left])
        gaps[0] = 0.0
        left = left[gaps > _SAME]
    return out


def _blocks(candidates: dict[str, Candidates], sensed: Sequence[Feature], choices: IntArray) -> list[Block]:
    """Return the pairings of all assignments for the solver."""
    errors, _, shared_jacobian = collect_shared(sensed)
    root, out = shared_root(errors), []
    for kind in _KINDS:
        rows = [i for i, feature in enumerate(sensed) if feature.kind.name == kind]
        if not rows:
            continue
        of = sensed[rows[0]].kind
        chosen = candidates[kind].Ts_part_feature[choices[:, rows]]
        Ts = np.stack([sensed[i].T_world_feature for i in rows])
        Ps, own = np.stack([sensed[i].P for i in rows]), np.stack([shared_jacobian[i] @ root for i in rows])
        every = np.ones(chosen.shape[:2], dtype=bool)
        none = np.zeros((1, 1, 1))
        out.append(Block(relation_between(of, of), Ts, Ps, chosen, none, own, np.zeros(len(rows)), every))
    return out


def _squared_gaps(part: Part, T: Transforms, others: Transforms, information: FloatArray) -> FloatArray:
    """Squared Mahalanobis distances from poses ``(F, 4, 4)`` to one, up to the part's symmetry ``(F,)``."""
    gaps = (SE3.inverse(others) @ T) @ part.symmetry.Ts[:, None]
    xi = SE3.log(without_symmetric_rotation(part, gaps) if part.symmetry.continuous else gaps)
    return np.asarray(np.einsum("sfi,fij,sfj->sf", xi, information[:, :6, :6], xi).min(axis=0))


def _hypothesis(one: _Accepted, sensed: Sequence[Feature], probability: float) -> Hypothesis:
    pairings = []
    for feature, choice in zip(sensed, one.choices, strict=True):
        of = one.candidates[feature.kind.name]
        model = ModelFeature(feature.kind, of.Ts_part_feature[choice], np.zeros(2 * (feature.kind.size,)), 0.0)
        pairings.append((Pairing(feature, model), of.names[choice]))
    estimate = estimate_pose(
        [pairing for pairing, _ in pairings], start=one.T_world_part, length=one.part.diagonal, middle=one.part.centroid
    )
    return hypothesis_at(
        one.part,
        estimate.T_world_part,
        estimate.covariance,
        free=np.asarray(np.linalg.solve(part_scale(one.part), estimate.free.T).T, dtype=np.float64),
        probability=probability,
        misfit=Misfit(0.0, estimate.chi2, estimate.dof),
        rms=_rms(estimate.T_world_part, [pairing for pairing, _ in pairings]),
        outliers=(),
        pairings=tuple((r, name) for p, name in pairings for r in p.sensed.readings or (p.sensed.label,)),
        outlier_distances=(),
        covariance_relative=estimate.covariance_relative if estimate.shared else None,
    )


def _rms(T_world_part: Transforms, pairings: Sequence[Pairing]) -> float:
    """Root mean square distance of the sensed points from the model features they are paired with [m]."""
    squared = [np.zeros(0)]
    for pairing in pairings:
        local = SE3.apply(SE3.inverse(T_world_part @ pairing.model.T_part_feature), pairing.sensed.support)
        squared.append(np.sum(local[:, [i for i in pairing.model.kind.rows if i < 3]] ** 2, axis=1))
    total = np.concatenate(squared)
    return float(np.sqrt(total.mean())) if len(total) else 0.0
