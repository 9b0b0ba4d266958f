"""How probable the sensed features are under an interpretation (``math.md`` section 10).

The measure of a sensed feature is its perturbation coordinates, and the place of its points along the free ones.
Touches fall on the surface evenly: a face is met in proportion to its area, an edge to its length.
"""

from __future__ import annotations

import numpy as np

from tanteo.answers.priors import Priors
from tanteo.localization.solve import assemble, pose_information
from tanteo.matching.freedom import NOTHING, free_projector, pose_scale
from tanteo.matching.model import PartModel
from tanteo.matching.pairings import decode, self_pairings
from tanteo.matching.sensed import Sensed
from tanteo.matching.tree import Interpretations
from tanteo.typing import BoolArray, FloatArray

_FAINT = 25.0
"""Information below this many tilts squared times the largest may be noise: the bound takes it for none."""


def direction_densities(sensed: Sensed) -> FloatArray:
    """Log density of each sensed direction if it is any ``(n,)``."""
    density = {"plane": -np.log(4 * np.pi), "edge": -np.log(2 * np.pi), "vertex": 0.0}
    return np.array([density[k] for k in sensed.kinds[: len(sensed)]])


def clutter_densities(sensed: Sensed, radius: float) -> FloatArray:
    """Log density of each sensed feature if it is anywhere in a ball of that radius ``(n,)``."""
    disc, ball, sphere = np.pi * radius**2, 4 / 3 * np.pi * radius**3, 4 * np.pi
    density = {
        "plane": -np.log(sphere * 2 * radius),
        "edge": -np.log(2 * np.pi * disc),
        "vertex": -np.log(ball),
    }
    along = {"plane": -np.log(disc), "edge": -np.log(2 * radius), "vertex": 0.0}
    kinds, placed = sensed.kinds[: len(sensed)], sensed.placed[: len(sensed)]
    return np.array([density[k] + p * along[k] for k, p in zip(kinds, placed, strict=True)])


def log_evidence(sensed: Sensed, model: PartModel, found: Interpretations, priors: Priors) -> FloatArray:
    """Log density of the sensed features under each interpretation, pose integrated out ``(F,)``.

    Laplace's approximation over the pose and the shared errors; directions of the pose that nothing resists
    contribute their whole extent (what of it puts the readings on the surface is found in :mod:`verify`). Of a family
    that is known by its directions, the density of the directions alone.
    """
    solution, choices = found.solution, found.choices
    log = -0.5 * (solution.equations * np.log(2 * np.pi) + solution.log_det + solution.chi2)
    D = solution.z.shape[-1]
    if D:
        log -= 0.5 * np.linalg.slogdet(solution.information[..., 6:, 6:])[1]
    free, _ = free_projector(sensed, model, choices, priors.radius)
    log += pose_volume(pose_information(solution.information), pose_scale(priors.radius, model.middle), free)
    clutter = _nothing_densities(sensed, model, priors)
    for i, views in enumerate(sensed.views):
        kind, chosen = sensed.kinds[i], choices[:, i]
        paired = np.zeros(len(chosen))
        if kind in model.candidates:
            density = _candidate_density(model, kind, bool(sensed.placed[i]))
            paired = density[decode(chosen, model, kind)[0]] + np.log1p(-priors.clutter) - np.log(len(views))
        log += np.where(chosen == NOTHING, clutter[i], paired)
    return log


def _candidate_density(model: PartModel, kind: str, placed: bool) -> FloatArray:
    """Log probability of a candidate, and density of the place of the points on it ``(N,)``."""
    candidates = model.candidates[kind]
    log = np.log(candidates.weights)
    return log - np.log(candidates.measures) if placed and model.has_extent else log


def _nothing_densities(sensed: Sensed, model: PartModel, priors: Priors) -> FloatArray:
    """Log probability and density of each sensed feature if it is not one of the candidates ``(n,)``."""
    densities = clutter_densities(sensed, priors.radius) if model.has_extent else direction_densities(sensed)
    return densities + np.log(priors.clutter)


def pose_volume(information: FloatArray, scale: FloatArray, free: FloatArray | None = None) -> FloatArray:
    """``log(p(T) integral exp(-x' L x / 2))`` for a pose anywhere in the extents of :func:`pose_scale`.

    Along the motions that ``free`` ``(*batch, 6, 6)`` projects on, the integral is over the whole extent.
    """
    information = scale.T @ information @ scale
    if free is not None:
        information = (np.eye(6) - free) @ information @ (np.eye(6) - free)
    values = np.linalg.eigvalsh(information)
    return np.asarray(-0.5 * np.log(np.maximum(values / (2 * np.pi), 1.0)).sum(axis=-1))


def perfect_evidence(
    sensed: Sensed, model: PartModel, priors: Priors, known: dict[bytes, float] | None = None
) -> FloatArray:
    """Log evidence if the part had exactly the sensed features, with 0, 1, 2 ... of them left out ``(n + 1,)``.

    It bounds what the part can reach with that many features left out, because the determinants of the joint estimate
    depend on the sensed features alone; those that add least are left out first.

    ``known`` remembers what does not depend on the part, for the next one; parts and families do not share it.
    """
    n = len(sensed)
    known = {} if known is None else known
    clutter = _nothing_densities(sensed, model, priors)
    density = np.full(n, -np.inf)
    for i, kind in enumerate(sensed.kinds[:n]):
        if kind in model.candidates:
            density[i] = _candidate_density(model, kind, bool(sensed.placed[i])).max() + np.log1p(-priors.clutter)
    kept = np.isfinite(density)[None]
    out = np.full(n + 1, -np.inf)
    while True:
        new = np.array([row.tobytes() not in known for row in kept])
        if new.any():
            found = _perfect(sensed, model, kept[new], priors)
            known.update((row.tobytes(), float(value)) for row, value in zip(kept[new], found, strict=True))
        values = np.array([known[row.tobytes()] for row in kept]) + np.where(kept, density, clutter).sum(axis=1)
        best = int(np.argmax(values))
        count = int(kept[best].sum())
        out[n - count] = values[best]
        if count == 0:
            return out
        kept = kept[best] & ~np.eye(n, dtype=bool)[kept[best]]


def _perfect(sensed: Sensed, model: PartModel, kept: BoolArray, priors: Priors) -> FloatArray:
    """Densities and pose volume at zero residual, for rows of kept features ``(F,)``."""
    D = sensed.gains[0].shape[1] if sensed.gains else 0
    blocks = self_pairings(sensed, model, kept)
    poses = np.broadcast_to(np.eye(4), (len(kept), 4, 4))
    at = assemble(blocks, poses, np.zeros((len(kept), D)))
    log = -0.5 * (at.equations * np.log(2 * np.pi) + at.log_det)
    if D:
        log -= 0.5 * np.linalg.slogdet(at.information[..., 6:, 6:])[1]
    information = pose_information(at.information)
    scale = pose_scale(priors.radius, sensed.middle)
    values, vectors = np.linalg.eigh(scale.T @ information @ scale)
    faint = values <= _FAINT * sensed.tilt.max(initial=0.0) ** 2 * values[:, -1:]
    free = (vectors * faint[:, None]) @ np.swapaxes(vectors, -1, -2)
    return log + pose_volume(information, scale, free)
