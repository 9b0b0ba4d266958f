"""None of these: what the sensed features look like if nobody has modelled the part.

Most unknown parts are made like the known ones: their faces run along three perpendicular axes, at sizes that come up
again. A flat "anything" would make a right corner look like proof of whichever part has one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import logsumexp

from tanteo.lie import SE3, SO3
from tanteo.matching.evidence import Priors, clutter_densities, log_evidence, perfect_evidence
from tanteo.matching.model import Candidates, PartModel
from tanteo.matching.sensed import Sensed
from tanteo.matching.tree import NOTHING, TURNS, decode, interpret
from tanteo.typing import FloatArray, IntArray

SMALL = 5.0
"""Log odds below which a way of being right-angled is not looked for: the evidence needs no more than a percent."""


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


def log_unknown(sensed: Sensed, models: Sequence[PartModel], priors: Priors) -> float:
    """Log evidence of a part that nobody modelled: right-angled in the main, of common sizes in part.

    Args:
        sensed: the sensed features.
        models: the catalogue, for the sizes that are common.
        priors: shares of right angles and common sizes; the rest is anywhere.
    """
    n = len(sensed)
    if not n:
        return 0.0
    family = right_angled_family(priors.radius)
    stray = Priors(priors.unknown, 1 - priors.right_angled, priors.radius)
    terms = [float(clutter_densities(sensed, priors.radius).sum()) + n * np.log(1 - priors.right_angled)]
    bounds = perfect_evidence(sensed, family, stray)
    gains = _size_gains(sensed, models, priors)
    for left_out in range(n):
        if bounds[left_out] < max(terms) - SMALL:
            continue
        found = interpret(sensed, family, left_out)
        weights = log_evidence(sensed, family, found, stray) + _common(sensed, family, found.choices, gains)
        if len(weights):
            terms.append(float(logsumexp(weights)) + np.log(TURNS))
    return float(logsumexp(terms))


def _size_gains(sensed: Sensed, models: Sequence[PartModel], priors: Priors) -> FloatArray:
    """Log of how much more likely each pair's distance is for common sizes than for any size ``(rows, rows)``."""
    n = len(sensed.kinds)
    gains = np.zeros((n, n))
    for i in range(n):
        for j in range(n):
            if i == j or sensed.kinds[i] != "plane" or sensed.kinds[j] != "plane":
                continue
            same = bool(sensed.directions[i] @ sensed.directions[j] > 0)
            density = np.mean([_density(model, same, sensed.along[i, j], sensed.along_sd[i, j]) for model in models])
            gains[i, j] = np.log1p(priors.common_sizes * (2 * priors.radius * float(density) - 1))
    return gains


def _density(model: PartModel, same: bool, distance: float, sd: float) -> float:
    """Density of a sensed distance if it is one of the part's own [1/m]."""
    sizes = model.sizes
    values, weights = (sizes.step, sizes.step_weights) if same else (sizes.thickness, sizes.thickness_weights)
    z = (values - distance) / sd
    return float(weights @ np.exp(-0.5 * z * z)) / (sd * np.sqrt(2 * np.pi))


def _common(sensed: Sensed, family: PartModel, choices: IntArray, gains: FloatArray) -> FloatArray:
    """Sum of the gains over each interpretation's parallel planes, each against the first on its axis ``(F,)``."""
    total = np.zeros(len(choices))
    planes = [i for i in range(len(sensed)) if sensed.kinds[i] == "plane"]
    for axis in range(3):
        first = np.full(len(choices), NOTHING)
        for i in planes:
            side, view = decode(choices[:, i], family, "plane")
            row = np.array(sensed.views[i])[view]
            here = (side != NOTHING) & (side % 3 == axis)
            total += np.where(here & (first != NOTHING), gains[first, row], 0.0)
            first = np.where(here & (first == NOTHING), row, first)
    return total
