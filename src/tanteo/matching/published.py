"""Recognition as the 1991 paper describes it: every constraint by itself against every value of the model, (25).

Only for teaching and comparison. There is no joint test, no side, no extent, no clutter and no "none of these": a part
is accepted if some assignment passes all univariate gates, a mirrored part as well as the true one. What this costs is
measured in ``docs/paper.md``.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tanteo.constraints import gate, published
from tanteo.features import feature_covariance
from tanteo.localization import gauss_newton
from tanteo.localization.start import first_pose
from tanteo.matching.belief import Belief, Mode, equivalent
from tanteo.matching.freedom import NOTHING
from tanteo.matching.model import PartModel
from tanteo.matching.pairings import build
from tanteo.matching.sensed import Sensed
from tanteo.matching.tree import MAX_PARTIAL
from tanteo.typing import BoolArray, FloatArray, IntArray

_PARALLEL = 1e-6


def believe_as_published(sensed: Sensed, models: Sequence[PartModel], alpha: float) -> Belief:
    """All parts and assignments that pass the gates, with equal weight.

    Args:
        sensed: planes, edges and vertices; the paper has no constraint for vertices, so they may be anything.
        models: the catalogue.
        alpha: rejection percentage of each gate (25).
    """
    accepted, cut = [], False
    for model in models:
        choices, dropped = _assignments(sensed, model, alpha)
        cut |= dropped
        accepted += _modes(sensed, model, choices)
    weight = 1 / max(len(accepted), 1)
    modes = tuple(Mode(m.model, m.choices, m.T_world_part, weight, m.information) for m in accepted)
    return Belief(modes, 0.0 if modes else 1.0, cut)


def _assignments(sensed: Sensed, model: PartModel, alpha: float) -> tuple[IntArray, bool]:
    """Assignments of all features whose pairs all pass; level by level."""
    n = len(sensed)
    choices, cut = np.full((1, n), NOTHING), False
    if any(kind not in model.candidates for kind in sensed.kinds[:n]):
        return choices[:0], False
    for i in range(n):
        count = len(model.candidates[sensed.kinds[i]])
        ok = np.ones((len(choices), count), dtype=bool)
        for j in range(i):
            ok &= _pair_gate(sensed, j, i, model, alpha)[choices[:, j]]
        which, candidate = np.nonzero(ok)
        choices = choices[which]
        choices[:, i] = candidate
        if len(choices) > MAX_PARTIAL:
            choices, cut = choices[:MAX_PARTIAL], True
    return choices, cut


def _pair_gate(sensed: Sensed, i: int, j: int, model: PartModel, alpha: float) -> BoolArray:
    """Gates (25) of one sensed pair against all pairs of the model ``(Ni, Nj)``."""
    a, b = sensed.kinds[i], sensed.kinds[j]
    A, B = model.candidates[a], model.candidates[b]
    if a != b or a == "vertex":
        return np.ones((len(A), len(B)), dtype=bool)
    first, second = sensed.features[i], sensed.features[j]
    T1, T2 = first.T_world_feature, second.T_world_feature
    C1, C2 = feature_covariance(first), feature_covariance(second)
    angle = model.table(a, b).angle
    assert angle is not None
    if a == "edge":
        angle = np.minimum(angle, np.pi - angle)  # "the smallest angle which fits" (16)
    parallel = (angle < _PARALLEL) | (angle > np.pi - _PARALLEL)
    with np.errstate(divide="ignore", invalid="ignore"):
        measure = published.angle_planes if a == "plane" else published.angle_edges
        found = measure(T1, C1, T2, C2)
        value = np.minimum(found.value, np.pi - found.value) if a == "edge" else found.value
        ok = _passes(value, found.variance, angle, alpha)
        relation = published.parallel_planes if a == "plane" else published.parallel_edges
        cosine, distance = relation(T1, C1, T2, C2)
        beside = _passes(np.abs(cosine.value), cosine.variance, np.ones_like(angle), alpha)
        beside &= _passes(np.abs(distance.value), distance.variance, _distances(model, a), alpha)
    return np.where(parallel, beside, ok)


def _passes(value: FloatArray, variance: FloatArray, model: FloatArray, alpha: float) -> BoolArray:
    """(25); a variance of 0/0, which (21) has at its extremum, passes only the exact value."""
    safe = np.where(np.isfinite(variance) & (variance > 0), variance, 1e-300)
    return np.asarray(gate(np.nan_to_num(value), safe, model, alpha).accept, dtype=np.bool_)


def _distances(model: PartModel, kind: str) -> FloatArray:
    """Distance of parallel model features: ``|p_z|`` (24), or across for edges (section 4.4)."""
    candidates = model.candidates[kind]
    gap = candidates.Ts_part_feature[None, :, :3, 3] - candidates.Ts_part_feature[:, None, :3, 3]
    along = np.einsum("aj,abj->ab", candidates.directions, gap)
    if kind == "plane":
        return np.abs(along)
    return np.sqrt(np.maximum((gap**2).sum(axis=-1) - along**2, 0.0))


def _modes(sensed: Sensed, model: PartModel, choices: IntArray) -> list[Mode]:
    """One pose an assignment, symmetric and equal ones merged."""
    if not len(choices):
        return []
    blocks = build(sensed, model, choices, 0.0)
    n_shared = sensed.gains[0].shape[1]
    start = np.broadcast_to(first_pose(blocks), (len(choices), 4, 4))
    solution = gauss_newton(blocks, start, n_shared, hold=1e-3 * np.eye(6), iterations=10, tolerance=1e-12)
    information = solution.information[:, :6, :6]
    left, modes = np.argsort(solution.chi2, kind="stable"), []
    while len(left):
        top = left[0]
        assert model.part is not None
        same = equivalent(model.part, solution.T_world_part[top], solution.T_world_part[left], information[left])
        same[0] = True
        modes.append(Mode(model, choices[top], solution.T_world_part[top], 1.0, information[top]))
        left = left[~same]
    return modes
