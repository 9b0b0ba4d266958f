"""Planes of a part that nobody modelled, beside those met before: at a usual distance, or the same face once more."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tanteo.answers.priors import Priors
from tanteo.matching.freedom import NOTHING
from tanteo.matching.model import PartModel
from tanteo.matching.pairings import decode
from tanteo.matching.sensed import Sensed
from tanteo.typing import FloatArray, IntArray


@dataclass(frozen=True, slots=True)
class Pairs:
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


def pairs_of(sensed: Sensed, models: Sequence[PartModel], priors: Priors) -> Pairs:
    """Of all pairs of views of planes, by the sizes of the catalogue's parts."""
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
    return Pairs(level, beam, other, np.r_[again[:1], again], alike, (1 - alike) / (6 * alike - 1))


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


def pair_gains(sensed: Sensed, family: PartModel, choices: IntArray, pairs: Pairs) -> FloatArray:
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
        met, beside, alike, before, strays = (np.zeros(len(choices), dtype=np.int64) for _ in range(5))
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
            strays += both & stray
        same = np.where(stray | (alike > 0), pairs.again[np.minimum(met, len(pairs.again) - 1)], 0.0)
        same = np.where(stray, np.where(strays > 0, same * pairs.alike, 0.0), same)
        gain = same * level + (1 - same) * np.where(beside > 0, other / np.maximum(beside, 1), 1.0)
        uneven = 6 * (pairs.spread + alike) / (6 * pairs.spread + before)
        total += np.log(np.maximum(gain, 1e-300)) + np.where(stray, 0.0, np.log(uneven))
    return total


def most_gain(sensed: Sensed, pairs: Pairs) -> float:
    """A bound on the gains of any interpretation."""
    planes = _planes(sensed)
    best = np.maximum(np.maximum(pairs.level, pairs.level * pairs.beam * pairs.alike), pairs.other)
    views, total = sensed.views, 0.0
    for k, i in enumerate(planes[1:], start=1):
        total += max(0.0, *(float(np.log(best[np.ix_(views[j], views[i])].max())) for j in planes[:k]))
        total += float(np.log(6 * (pairs.spread + k) / (6 * pairs.spread + k)))
    return total


def _planes(sensed: Sensed) -> list[int]:
    """The planes in an order that does not depend on how they were given: those in the middle first."""
    n = len(sensed)
    away = sensed.distance[:n, :n].sum(axis=1)
    return sorted((i for i in range(n) if sensed.kinds[i] == "plane"), key=lambda i: float(away[i]))
