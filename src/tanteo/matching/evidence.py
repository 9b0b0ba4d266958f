"""How probable the sensed features are under an interpretation (``math.md`` section 10).

The measure of a sensed feature is its perturbation coordinates, and the place of its points along the free ones.
Touches fall on the surface evenly: a face is met in proportion to its area, an edge to its length.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.localization.solve import assemble, pose_information
from tanteo.matching.model import PartModel
from tanteo.matching.sensed import Sensed
from tanteo.matching.tree import NOTHING, Interpretations, decode, self_pairings
from tanteo.typing import BoolArray, FloatArray


@dataclass(frozen=True, slots=True)
class Priors:
    """What is assumed before anything is sensed.

    Attributes:
        unknown: probability that the object is none of the parts.
        clutter: probability that a sensed feature does not belong to the part.
        radius: of the ball in which the part lies [m]: the largest part of the catalogue.
        right_angled: of the faces of an unknown part, the share that runs along three perpendicular axes.
        common_sizes: of the distances between its parallel faces, the share that the catalogue's parts have too: one
            workshop uses the same stock and the same round numbers again and again.
    """

    unknown: float = 0.05
    clutter: float = 0.02
    radius: float = 0.1
    right_angled: float = 0.8
    common_sizes: float = 0.5


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
    contribute their whole extent, so their prior cancels.
    """
    solution, choices = found.solution, found.choices
    log = -0.5 * (solution.equations * np.log(2 * np.pi) + solution.log_det + solution.chi2)
    D = solution.z.shape[-1]
    if D:
        log -= 0.5 * np.linalg.slogdet(solution.information[..., 6:, 6:])[1]
    log += pose_volume(pose_information(solution.information), priors.radius)
    clutter = clutter_densities(sensed, priors.radius) + np.log(priors.clutter)
    for i, views in enumerate(sensed.views):
        kind, chosen = sensed.kinds[i], choices[:, i]
        paired = np.zeros(len(chosen))
        if kind in model.candidates:
            density = _candidate_density(model, kind, bool(sensed.placed[i]), priors)
            paired = density[decode(chosen, model, kind)[0]] + np.log1p(-priors.clutter) - np.log(len(views))
        log += np.where(chosen == NOTHING, clutter[i], paired)
    return log


def _candidate_density(model: PartModel, kind: str, placed: bool, priors: Priors) -> FloatArray:
    """Log probability of a candidate, and density of the place of the points on it ``(N,)``."""
    candidates = model.candidates[kind]
    log = np.log(candidates.weights)
    if model.has_extent:
        return log - np.log(candidates.measures) if placed else log
    offset = {"plane": np.log(2 * priors.radius), "edge": np.log(np.pi * priors.radius**2)}[kind]
    along = {"plane": np.log(np.pi * priors.radius**2), "edge": np.log(2 * priors.radius)}[kind]
    return log - offset - (along if placed else 0.0)


def pose_volume(information: FloatArray, radius: float) -> FloatArray:
    """``log(p(T) integral exp(-x' L x / 2))`` for a pose anywhere in a cube of ``2 radius`` and any attitude."""
    scale = np.r_[np.full(3, 2 * radius), np.full(3, (8 * np.pi**2) ** (1 / 3))]
    values = np.linalg.eigvalsh(information * np.outer(scale, scale))
    return np.asarray(-0.5 * np.log(np.maximum(values / (2 * np.pi), 1.0)).sum(axis=-1))


def perfect_evidence(sensed: Sensed, model: PartModel, priors: Priors) -> FloatArray:
    """Log evidence if the part had exactly the sensed features, with 0, 1, 2 ... of them left out ``(n + 1,)``.

    It bounds what the part can reach with that many features left out, because the determinants of the joint estimate
    depend on the sensed features alone; those that add least are left out first.
    """
    n = len(sensed)
    clutter = clutter_densities(sensed, priors.radius) + np.log(priors.clutter)
    density = np.full(n, -np.inf)
    for i, kind in enumerate(sensed.kinds[:n]):
        if kind in model.candidates:
            density[i] = _candidate_density(model, kind, bool(sensed.placed[i]), priors).max() + np.log1p(
                -priors.clutter
            )
    kept = np.isfinite(density)[None]
    out = np.full(n + 1, -np.inf)
    while True:
        values = _perfect(sensed, model, kept, priors) + np.where(kept, density, clutter).sum(axis=1)
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
    return log + pose_volume(pose_information(at.information), priors.radius)
