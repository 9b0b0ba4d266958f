"""None of these: what the sensed features look like if nobody has modelled the part.

Most unknown parts are made like the known ones: as large, their faces along three perpendicular axes and turned away
from the middle, at sizes that come up again; and one face may be met twice. A flat "anything" would make a right
corner, or two touches of one face, look like proof of whichever part has one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.special import logsumexp

from tanteo.features import Feature
from tanteo.lie import SE3, SO3
from tanteo.localization.solve import scaled_solve
from tanteo.matching.evidence import (
    OFTEN,
    Priors,
    clutter_densities,
    direction_densities,
    log_evidence,
    perfect_evidence,
)
from tanteo.matching.freedom import NOTHING
from tanteo.matching.model import Candidates, PartModel
from tanteo.matching.sensed import Sensed, sense
from tanteo.matching.tree import TURNS, decode, interpret, pair_gates
from tanteo.typing import BoolArray, FloatArray, IntArray

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
    pairs = _pairs(sensed, models, priors)
    directions = np.log(stray.clutter) + direction_densities(sensed)
    nothing = np.full((1, n), NOTHING)
    strays = [nothing == NOTHING]
    weights = [directions.sum() + _pair_gains(sensed, family, nothing, pairs)]
    bounds = perfect_evidence(sensed, family, stray) + _most(sensed, pairs)
    best, gates = float(weights[0].max()), pair_gates(sensed, family, 0.0)
    first, reserve = n, np.inf
    for left_out in range(n):
        if bounds[left_out] < best - SMALL or bounds[left_out] + reserve < bounds[first] - SMALL:
            continue  # each stray loses what its right angle would have been worth
        found = interpret(sensed, family, left_out, 0.0, gates)
        if not len(found.choices):
            continue
        gains = _pair_gains(sensed, family, found.choices, pairs)
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
    by_mask = np.array([logsumexp(weights[index.ravel() == k]) for k in range(len(masks))])
    masks = masks[by_mask > by_mask.max() - 2 * SMALL]
    by_mask = by_mask[by_mask > by_mask.max() - 2 * SMALL]
    n = len(sensed)
    most = n if n <= _ALL_SUBSETS else 2
    subsets = np.array([[i in some for i in range(n)] for k in range(most + 1) for some in combinations(range(n), k)])
    subsets = subsets[(subsets[:, None] <= masks).all(axis=2).any(axis=1)]
    lost = np.log(priors.clutter) - np.log1p(-priors.clutter) + clutter_densities(sensed, priors.radius) - directions
    given = subsets @ lost + _log_places(sensed, models, priors, ~subsets) + n * np.log1p(-priors.clutter)
    allowed = (subsets[:, None] <= masks).all(axis=2)
    return float(logsumexp(np.where(allowed, given[:, None] + by_mask, -np.inf)))


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
    return np.asarray(logsumexp(out, axis=1) - np.log(m))


@dataclass(frozen=True, slots=True)
class _Pairs:
    """How much more likely a plane is beside one that was met before, for every pair of views ``(rows, rows)``.

    Attributes:
        level: if both are one face, by their heights; 0 if they look different ways.
        beam: the same by their directions, if these could be any.
        other: if they are two faces on one axis.
        again: probability that it is the same face, for ``k = 0, 1, ...`` touches of that before.
        alike: probability that two touches meet faces that look the same way.
        spread: Dirichlet's parameter of the six sides that gives this.
    """

    level: FloatArray
    beam: FloatArray
    other: FloatArray
    again: FloatArray
    alike: float
    spread: float


def _pairs(sensed: Sensed, models: Sequence[PartModel], priors: Priors) -> _Pairs:
    n = len(sensed.kinds)
    level, beam, other = np.zeros((n, n)), np.zeros((n, n)), np.ones((n, n))
    planes = [i for i in range(n) if sensed.kinds[i] == "plane"]
    for i, j in ((i, j) for i in planes for j in planes if i != j):
        same = bool(sensed.directions[i] @ sensed.directions[j] > 0)
        d, sd = sensed.along[i, j], sensed.along_sd[i, j]
        anywhere = float(np.mean([_anywhere(model, same, d, sd) for model in models]))
        common = float(np.mean([_density(model, same, d, sd) for model in models]))
        other[i, j] = 1 - priors.common_sizes + priors.common_sizes * common / anywhere
        if same:
            level[i, j] = float(np.exp(-0.5 * (d / sd) ** 2) / (sd * np.sqrt(2 * np.pi))) / anywhere
            tilt = sensed.tilt[i] ** 2 + sensed.tilt[j] ** 2
            beam[i, j] = 4 * np.pi * np.exp(-0.5 * sensed.angle[i, j] ** 2 / tilt) / (2 * np.pi * tilt)
    again = np.mean([model.sizes.again for model in models], axis=0)
    alike = float(np.clip(np.mean([model.sizes.alike for model in models]), 1 / 6 + 0.01, 0.5))
    return _Pairs(level, beam, other, np.r_[again[:1], again], alike, (1 - alike) / (6 * alike - 1))


def _anywhere(model: PartModel, alike: bool, distance: float, sd: float) -> float:
    """Density of the distance of two parallel faces at any heights [1/m]."""
    sizes = model.sizes
    variance = 2 * max(sizes.height_sd, 1e-3 * sizes.place_sd) ** 2 + sd**2
    mean = 0.0 if alike else -2 * sizes.height
    return float(np.exp(-0.5 * (distance - mean) ** 2 / variance) / np.sqrt(2 * np.pi * variance)) + 1e-3 / model.radius


def _density(model: PartModel, same: bool, distance: float, sd: float) -> float:
    """Density of a sensed distance if it is one of the part's own [1/m]."""
    sizes = model.sizes
    values, weights = (sizes.step, sizes.step_weights) if same else (sizes.thickness, sizes.thickness_weights)
    z = (values - distance) / sd
    return float(weights @ np.exp(-0.5 * z * z)) / (sd * np.sqrt(2 * np.pi))


def _pair_gains(sensed: Sensed, family: PartModel, choices: IntArray, pairs: _Pairs) -> FloatArray:
    """Log gains of each interpretation ``(F,)``: every plane beside those before it, strays among themselves."""
    total = np.zeros(len(choices))
    planes = _planes(sensed)
    rows, sides = np.zeros_like(choices), np.full_like(choices, NOTHING)
    for i in planes:
        sides[:, i], view = decode(choices[:, i], family, "plane")
        rows[:, i] = np.array(sensed.views[i])[view]
    for k, i in enumerate(planes):
        stray = sides[:, i] == NOTHING
        level, other = np.zeros(len(choices)), np.zeros(len(choices))
        met, beside, alike, before = (np.zeros(len(choices), dtype=np.int64) for _ in range(4))
        for j in planes[:k]:
            pair = rows[:, j], rows[:, i]
            both = stray == (sides[:, j] == NOTHING)
            axis = both & (stray | (sides[:, i] % 3 == sides[:, j] % 3))
            ratio = np.where(axis, pairs.level[pair] * np.where(stray, pairs.beam[pair], 1.0), 0.0)
            met += ratio > 1
            level = np.maximum(level, ratio)
            other += np.where(axis & ~stray, pairs.other[pair], 0.0)
            beside += axis & ~stray
            alike += axis & ~stray & (sides[:, i] == sides[:, j])
            before += both & ~stray
        same = np.where(stray | (alike > 0), pairs.again[np.minimum(met, len(pairs.again) - 1)], 0.0)
        same = np.where(stray, same * pairs.alike, same)
        gain = same * level + (1 - same) * np.where(beside > 0, other / np.maximum(beside, 1), 1.0)
        uneven = 6 * (pairs.spread + alike) / (6 * pairs.spread + before)
        total += np.log(np.maximum(gain, 1e-300)) + np.where(stray, 0.0, np.log(uneven))
    return total


def _planes(sensed: Sensed) -> list[int]:
    """The planes in an order that does not depend on how they were given: those in the middle first."""
    n = len(sensed)
    away = sensed.distance[:n, :n].sum(axis=1)
    return sorted((i for i in range(n) if sensed.kinds[i] == "plane"), key=lambda i: float(away[i]))


def _most(sensed: Sensed, pairs: _Pairs) -> float:
    """A bound on the gains of any interpretation."""
    planes = _planes(sensed)
    best = np.maximum(np.maximum(pairs.level, pairs.level * pairs.beam * pairs.alike), pairs.other)
    views, total = sensed.views, 0.0
    for k, i in enumerate(planes[1:], start=1):
        total += max(0.0, *(float(np.log(best[np.ix_(views[j], views[i])].max())) for j in planes[:k]))
        total += float(np.log(6 * (pairs.spread + k) / (6 * pairs.spread + k)))
    return total
