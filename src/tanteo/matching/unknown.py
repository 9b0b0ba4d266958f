"""None of these: what the sensed features look like if nobody has modelled the part.

Most unknown parts are made like the known ones: as large, their faces along three perpendicular axes and turned away
from the middle, at sizes that come up again; and one face may be met twice. A flat "anything" would make a right
corner, or two touches of one face, look like proof of whichever part has one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from tanteo.lie import SE3, SO3
from tanteo.matching.evidence import Priors, direction_densities, log_evidence, perfect_evidence
from tanteo.matching.freedom import NOTHING
from tanteo.matching.model import Candidates, PartModel
from tanteo.matching.sensed import Sensed
from tanteo.matching.tree import TURNS, decode, interpret
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
    """Log evidence of a part that nobody modelled: as large as the known ones, right-angled in the main.

    Args:
        sensed: the sensed features.
        models: the catalogue, for what parts are like: their sizes, and how far out their faces lie.
        priors: shares of right angles and common sizes.
    """
    n = len(sensed)
    if not n:
        return 0.0
    family = right_angled_family(priors.radius)
    stray = replace(priors, clutter=1 - priors.right_angled)
    pairs = _pairs(sensed, models, priors)
    loose = n * np.log(stray.clutter) + float(direction_densities(sensed).sum())
    nothing = np.full((1, n), NOTHING)
    terms = [loose + float(_pair_gains(sensed, family, nothing, pairs)[0])]
    bounds = perfect_evidence(sensed, family, stray) + _most(sensed, pairs)
    for left_out in range(n):
        if bounds[left_out] < max(terms) - SMALL:
            continue
        found = interpret(sensed, family, left_out)
        weights = log_evidence(sensed, family, found, stray) + _pair_gains(sensed, family, found.choices, pairs)
        if len(weights):
            terms.append(float(logsumexp(weights)) + np.log(TURNS))
    return float(logsumexp(terms)) + _log_places(sensed, models, priors)


def _log_places(sensed: Sensed, models: Sequence[PartModel], priors: Priors) -> float:
    """Log density of where the features are, by the directions that they have.

    A point of the surface is ``c + height n`` give or take, for a centre ``c`` that is anywhere; height and spread are
    those of a known part, each as likely as the others.
    """
    n = len(sensed)
    sizes = [model.sizes for model in models]
    height, height_sd, place_sd = (
        np.array([getattr(size, name) for size in sizes]) for name in ("height", "height_sd", "place_sd")
    )
    height_sd = np.maximum(height_sd, 1e-3 * place_sd)
    log = np.zeros(len(sizes))
    W, Wy, yWy = (np.zeros((len(sizes), *shape)) for shape in ((3, 3), (3,), ()))
    for i in range(n):
        u, kind = sensed.directions[i], sensed.kinds[i]
        along, across = np.outer(u, u), np.eye(3) - np.outer(u, u)
        mean = sensed.points[i] - height[:, None] * u if kind == "plane" else np.tile(sensed.points[i], (len(sizes), 1))
        precise = (height_sd**-2 if kind == "plane" else place_sd**-2)[:, None, None]
        spread = place_sd[:, None, None] ** -2
        w = {
            "plane": precise * along + spread * across * sensed.placed[i],
            "edge": precise * across + spread * along * sensed.placed[i],
            "vertex": spread * np.eye(3),
        }[kind]
        values = np.linalg.eigvalsh(w)
        log += 0.5 * np.where(values > 1e-9 * values[:, -1:], np.log(np.maximum(values, 1e-300) / (2 * np.pi)), 0).sum(
            1
        )
        W += w
        Wy += (w @ mean[..., None])[..., 0]
        yWy += np.einsum("mi,mij,mj->m", mean, w, mean)
    extent = np.eye(3) / (2 * priors.radius) ** 2 * 2 * np.pi  # where nothing else says so, the centre is anywhere
    values = np.linalg.eigvalsh(W + 1e-9 * extent)
    log += 0.5 * np.log(2 * np.pi / np.maximum(values, 2 * np.pi / (2 * priors.radius) ** 2)).sum(axis=1)
    log -= 3 * np.log(2 * priors.radius)
    log -= 0.5 * (yWy - np.einsum("mi,mi->m", Wy, np.linalg.solve(W + 1e-9 * extent, Wy[..., None])[..., 0]))
    return float(logsumexp(log) - np.log(len(sizes)))


@dataclass(frozen=True, slots=True)
class _Pairs:
    """How much more likely a pair is if it has something in common, for every pair of views ``(rows, rows)``.

    Attributes:
        parallel: of faces on one axis of a right-angled part: one and the same face, or at a common distance.
        same: of faces in any direction: one and the same, normal included.
    """

    parallel: FloatArray
    same: FloatArray


def _pairs(sensed: Sensed, models: Sequence[PartModel], priors: Priors) -> _Pairs:
    n = len(sensed.kinds)
    parallel, same = np.ones((n, n)), np.ones((n, n))
    again = float(np.mean([model.sizes.again for model in models]))
    planes = [i for i in range(n) if sensed.kinds[i] == "plane"]
    for i, j in ((i, j) for i in planes for j in planes if i != j):
        alike = bool(sensed.directions[i] @ sensed.directions[j] > 0)
        d, sd = sensed.along[i, j], sensed.along_sd[i, j]
        anywhere = np.mean([_anywhere(model, alike, d, sd) for model in models])
        common = float(np.mean([_density(model, alike, d, sd) for model in models]))
        ratio = 1 - priors.common_sizes + priors.common_sizes * common / anywhere
        if alike:
            level = float(np.exp(-0.5 * (d / sd) ** 2) / (sd * np.sqrt(2 * np.pi))) / anywhere
            tilt = sensed.tilt[i] ** 2 + sensed.tilt[j] ** 2
            beam = 4 * np.pi * np.exp(-0.5 * sensed.angle[i, j] ** 2 / tilt) / (2 * np.pi * tilt)
            ratio = again * level + (1 - again) * ratio
            same[i, j] = 1 - again + again * level * beam
        parallel[i, j] = ratio
    return _Pairs(np.maximum(parallel, 1e-300), same)


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
    """Log gains of each interpretation ``(F,)``: every plane against those before it on its axis, strays too."""
    total = np.zeros(len(choices))
    planes = [i for i in range(len(sensed)) if sensed.kinds[i] == "plane"]
    rows, axes = np.zeros_like(choices), np.full_like(choices, 3)
    for i in planes:
        side, view = decode(choices[:, i], family, "plane")
        rows[:, i] = np.array(sensed.views[i])[view]
        axes[:, i] = np.where(side == NOTHING, 3, side % 3)
    for k, i in enumerate(planes):
        gain, count = np.zeros(len(choices)), np.zeros(len(choices))
        for j in planes[:k]:
            together = axes[:, i] == axes[:, j]
            table = np.where(
                axes[:, i] == 3, pairs.same[rows[:, j], rows[:, i]], pairs.parallel[rows[:, j], rows[:, i]]
            )
            gain += np.where(together, table, 0.0)
            count += together
        total += np.log(np.where(count > 0, gain / np.maximum(count, 1), 1.0))
    return total


def _most(sensed: Sensed, pairs: _Pairs) -> float:
    """A bound on the gains of any interpretation."""
    planes = [i for i in range(len(sensed)) if sensed.kinds[i] == "plane"]
    best = np.log(np.maximum(pairs.parallel, pairs.same))
    views, total = sensed.views, 0.0
    for k, i in enumerate(planes[1:], start=1):
        total += max(0.0, *(float(best[np.ix_(views[j], views[i])].max()) for j in planes[:k]))
    return total
