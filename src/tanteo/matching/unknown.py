"""None of these: what the sensed features look like if nobody has modelled the part.

Most unknown parts are made like the known ones: as large, their faces along three perpendicular axes and turned away
from the middle, at sizes that come up again; and one face may be met twice. A flat "anything" would make a right
corner, or two touches of one face, look like proof of whichever part has one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from tanteo.answers.priors import OFTEN, Priors
from tanteo.features import Feature
from tanteo.lie import SE3, SO3
from tanteo.localization.solve import scaled_solve
from tanteo.matching.candidates import Candidates
from tanteo.matching.evidence import clutter_densities, direction_densities, log_evidence, perfect_evidence
from tanteo.matching.freedom import NOTHING
from tanteo.matching.model import PartModel
from tanteo.matching.sensed import Sensed, sense
from tanteo.matching.tree import TURNS, interpret, pair_gates
from tanteo.matching.unknown_pairs import most_gain, pair_gains, pairs_of
from tanteo.special import log_sum
from tanteo.typing import BoolArray, FloatArray

SMALL = 5.0
"""Log odds below which a way of being right-angled is not looked for: the evidence needs no more than a percent."""

_ALL_SUBSETS = 6
"""Up to this many features any of them may be clutter; of more, two."""

_COMPACT = 0.5 * np.log(2 * np.pi * np.e / 12)
"""How much denser, on the average of the log, an even spread over a stretch is than a normal one of the same sd."""


def right_angled_family(radius: float) -> PartModel:
    """Any part whose faces and edges run along three perpendicular axes: what most unknown parts look like."""
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    candidates = {
        "plane": _directions_only(axes, 2, 3, "side"),
        "edge": _directions_only(axes, 0, 4, "side"),
    }
    return PartModel("any right-angled part", None, candidates, radius)


def _directions_only(directions: FloatArray, axis: int, size: int, name: str) -> Candidates:
    n = len(directions)
    Ts = SE3.from_parts(SO3.frame_from_axis(directions, axis), np.zeros((n, 3)))
    weights = np.full(n, 1 / len(np.unique(np.abs(directions), axis=0)) / (2 if axis == 2 else 1))
    names = tuple(f"{name} {i}" for i in range(n))
    sizes = (np.zeros(n), np.full(n, np.inf), np.full(n, np.inf))
    return Candidates(
        Ts, directions, weights, np.ones(n), np.zeros((n, size)), *sizes, np.zeros((n, 3)), np.arange(n), names
    )


def log_unknown(sensed: Sensed, models: Sequence[PartModel], priors: Priors, tolerance: float = 0.0) -> float:
    """Log evidence of a part that nobody modelled: as large as the known ones, right-angled in the main.

    Args:
        sensed: the sensed features.
        models: the catalogue, for what parts are like: their sizes, and how far out their faces lie.
        priors: shares of right angles and common sizes.
        tolerance: sd of the made surface [m]: unknown parts are made no better than known ones.
    """
    n = len(sensed)
    if not n:
        return 0.0
    sides = (len(sensed.features) - n) * np.log(2.0)
    sensed = sense(_as_made(_outward(sensed), models, tolerance))
    family = right_angled_family(priors.radius)
    stray = replace(priors, clutter=min(1 - priors.right_angled, OFTEN))
    pairs = pairs_of(sensed, models, priors)
    directions = np.log(stray.clutter) + direction_densities(sensed)
    nothing = np.full((1, n), NOTHING)
    strays = [nothing == NOTHING]
    weights = [directions.sum() + pair_gains(sensed, family, nothing, pairs)]
    bounds = perfect_evidence(sensed, family, stray) + most_gain(sensed, pairs)
    best, gates = float(weights[0].max()), pair_gates(sensed, family, 0.0)
    first, reserve = n, np.inf
    for left_out in range(n):
        if bounds[left_out] < best - SMALL or bounds[left_out] + reserve < bounds[first] - SMALL:
            continue  # each stray loses what its right angle would have been worth
        found = interpret(sensed, family, left_out, 0.0, gates)
        if not len(found.choices):
            continue
        gains = pair_gains(sensed, family, found.choices, pairs)
        weights.append(log_evidence(sensed, family, found, stray) + gains + np.log(TURNS))
        strays.append(found.choices == NOTHING)
        best = max(best, float(weights[-1].max()))
        if first == n:
            first, reserve = left_out, 0.5 * float(found.solution.chi2.min())
    total = _with_clutter(sensed, models, priors, np.concatenate(strays), np.concatenate(weights), directions)
    return total - float(sides)


def _outward(sensed: Sensed) -> list[Feature]:
    """One view of each feature: of planes whose side is unknown the one that looks away from the middle.

    The others have half the prior and next to none of the evidence: faces of a part look outwards.
    """
    middle = sensed.points.mean(axis=0)
    away = np.sum(sensed.directions * (sensed.points - middle), axis=1)
    return [sensed.features[max(rows, key=lambda row: away[row])] for rows in sensed.views]


def _as_made(features: Sequence[Feature], models: Sequence[PartModel], tolerance: float) -> list[Feature]:
    """The features with the tolerance of faces (edges) as large as the catalogue's in their covariance."""
    if not tolerance:
        return list(features)
    out = []
    for feature in features:
        kind = feature.kind.name
        scales = [m.candidates[kind] for m in models if kind in m.candidates]
        usual = [np.exp(np.average(np.log(c.tolerance_scale), axis=0, weights=c.weights)) for c in scales]
        scale = np.exp(np.mean(np.log(usual), axis=0)) if usual else np.r_[1.0, np.zeros(feature.kind.size - 1)]
        out.append(replace(feature, P=feature.P + np.diag((tolerance * scale) ** 2)))
    return out


def _with_clutter(
    sensed: Sensed,
    models: Sequence[PartModel],
    priors: Priors,
    strays: BoolArray,
    weights: FloatArray,
    directions: FloatArray,
) -> float:
    """Add where the features are, and let those that run along no axis ``(F, n)`` be no part of it at all."""
    masks, index = np.unique(strays, axis=0, return_inverse=True)
    by_mask = np.array([log_sum(weights[index.ravel() == k]) for k in range(len(masks))])
    masks = masks[by_mask > by_mask.max() - 2 * SMALL]
    by_mask = by_mask[by_mask > by_mask.max() - 2 * SMALL]
    n = len(sensed)
    most = n if n <= _ALL_SUBSETS else 2
    subsets = np.array([[i in some for i in range(n)] for k in range(most + 1) for some in combinations(range(n), k)])
    subsets = subsets[(subsets[:, None] <= masks).all(axis=2).any(axis=1)]
    lost = np.log(priors.clutter) - np.log1p(-priors.clutter) + clutter_densities(sensed, priors.radius) - directions
    given = subsets @ lost + _log_places(sensed, models, priors, ~subsets) + n * np.log1p(-priors.clutter)
    allowed = (subsets[:, None] <= masks).all(axis=2)
    return float(log_sum(np.where(allowed, given[:, None] + by_mask, -np.inf)))


def _log_places(sensed: Sensed, models: Sequence[PartModel], priors: Priors, kept: BoolArray) -> FloatArray:
    """Log density of where the features of each row of ``kept`` ``(S, n)`` are, by the directions that they have.

    A point of the surface is ``c + height n`` give or take, for a centre ``c`` that is anywhere; height and spread are
    those of a known part, each as likely as the others.
    """
    n, m = len(sensed), len(models)
    height, height_sd, place_sd = np.array(
        [(s.height, max(s.height_sd, 1e-3 * s.place_sd), s.place_sd) for s in (model.sizes for model in models)]
    ).T
    log, yWy, Wy, W = np.zeros((n, m)), np.zeros((n, m)), np.zeros((n, m, 3)), np.zeros((n, m, 3, 3))
    for i in range(n):
        u, kind = sensed.directions[i], sensed.kinds[i]
        along, placed = np.outer(u, u), bool(sensed.placed[i])
        rows = {"plane": (1, 2 * placed), "edge": (placed, 2), "vertex": (0, 3)}[kind]
        sds = (height_sd if kind == "plane" else place_sd, place_sd)
        mean = sensed.points[i] - (height[:, None] * u if kind == "plane" else 0.0)
        W[i] = sum((rows[k] > 0) * sds[k][:, None, None] ** -2 * P for k, P in enumerate((along, np.eye(3) - along)))
        log[i] = -sum(r * (np.log(sd) + 0.5 * np.log(2 * np.pi) - _COMPACT) for r, sd in zip(rows, sds, strict=True))
        Wy[i] = (W[i] @ np.broadcast_to(mean, (m, 3))[..., None])[..., 0]
        yWy[i] = np.sum(mean * Wy[i], axis=-1)
    total_W, total_Wy = np.einsum("sn,nmij->smij", kept, W), np.einsum("sn,nmi->smi", kept, Wy)
    least = 2 * np.pi / (2 * priors.radius) ** 2  # where nothing says more, the centre is anywhere
    values = np.linalg.eigvalsh(total_W)
    centre = scaled_solve(total_W, total_Wy)
    out = kept @ log - 0.5 * (kept @ yWy - np.sum(total_Wy * centre, axis=-1))
    out -= (0.5 * np.log(np.maximum(values / least, 1.0)) + _COMPACT * (values > least)).sum(axis=-1)
    return np.asarray(log_sum(out, axis=1) - np.log(m))
