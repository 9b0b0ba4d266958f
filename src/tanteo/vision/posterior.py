"""The posterior of what an image shows, asked of the one engine (``inference``).

An image proposes poses; the engine maximizes, samples and weighs them with the image's factor. An unknown object has
edges, too, and a pose of its own that they determine as sharply as the best part's: its evidence is the log density
that its edges have without a model (``Weights.unknown``, ``Weights.base``), times the share of the prior that the image
leaves to that pose (decision 87).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from tanteo import _core
from tanteo.answers import Priors, sized
from tanteo.inference import Mode, PartSearch, PreparedPart, Problem, prepare, search_about, weigh
from tanteo.measurements import ContactPoints, FreeRays, OnTable
from tanteo.typing import FloatArray, Transforms
from tanteo.vision.image_edges import ImageEdges, Sums, standing
from tanteo.vision.models import VisionModel

MISSED = 0.04
"""Probability that the true pose is not among those proposed: 3 of 74 (``python benchmarks/vision_fit.py 102``)."""

_SEED = 0
"""Seed of the samples: the same image gives the same answer."""


@dataclass(frozen=True, slots=True, eq=False)
class ImagePosterior:
    """Posterior of one object of an image.

    Attributes:
        modes: modes of the engine's posterior, best first.
        unknown: probability of the unknown object, and of parts that were not looked for. What is missing to 1 belongs
            to the parts in poses that were not proposed.
        left_out: probability of the parts that were not looked for, at most.
        count: number of these.
        log_unknown: log density of the image if the object is unknown, the share of its prior included.
    """

    modes: tuple[Mode, ...] = ()
    unknown: float = 1.0
    left_out: float = 0.0
    count: int = 0
    log_unknown: float = 0.0


def searched(
    image: ImageEdges, proposals: Sequence[tuple[VisionModel, Transforms]], lying: OnTable | None = None
) -> tuple[Problem, list[PartSearch]]:
    """Return the question of an image, and the maxima of parts to which poses lead.

    Args:
        image: the edges of the image.
        proposals: parts that are looked for, with poses ``T_camera_part`` from which maximizations start.
        lying: prior of the pose on a table; any pose if not given.
    """
    priors = sized(Priors(), max(0.5 * model.part.diagonal for model, _ in proposals))
    factors = (image,) if lying is None else (image, lying)
    problem = Problem(ContactPoints.none(), FreeRays.none(), priors, pose_factors=tuple(factors))
    T_world_camera = standing(image.camera)
    proposed = [(prepare(model.part), np.ascontiguousarray(T_world_camera @ Ts)) for model, Ts in proposals]
    return problem, search_about(problem, proposed, np.random.default_rng(_SEED))


def infer(
    image: ImageEdges,
    proposals: Sequence[tuple[VisionModel, Transforms]],
    count: int,
    *,
    lying: OnTable | None = None,
    log_left_out: Callable[[FloatArray, float], float] = lambda evidence, mislead: -np.inf,
    left_out: int = 0,
) -> ImagePosterior:
    """Return the posterior of the object that an image shows.

    Args:
        image: the edges of the image; their ``log_unknown`` is that of an unknown object whose pose is known.
        proposals: parts that are looked for, with poses ``T_camera_part`` from which maximizations start.
        count: number of all parts.
        lying: prior of the pose on a table; any pose if not given.
        log_left_out: log evidence of parts that are not looked for, from that of each part that is, priors included,
            and that of a part that explains no edge, its share of the prior excluded.
        left_out: number of parts that are not looked for.
    """
    if not any(len(Ts) for _, Ts in proposals):
        return ImagePosterior(count=left_out)
    problem, searches = searched(image, proposals, lying)
    best = max(searches, key=lambda search: search.log_evidence)
    unknown = image.log_unknown + log_share(image, best)
    known = float(np.log1p(-problem.priors.unknown))
    prior = known - float(np.log(count))
    evidence = np.array([search.log_evidence + prior for search in searches])
    found = weigh(
        problem, searches, np.full(len(searches), prior), float(np.log(problem.priors.unknown)) + unknown,
        np.random.default_rng(_SEED), log_left_out=log_left_out(evidence, unknown + known),
    )  # fmt: skip
    # that none of the poses holds is a strange part's doing, or of the proposals that missed the true one
    strange = problem.priors.unknown / (problem.priors.unknown + (1 - problem.priors.unknown) * MISSED)
    none = strange * (found.unknown - found.left_out) + found.left_out
    return ImagePosterior(found.modes, none, found.left_out, left_out, unknown)


def log_share(image: ImageEdges, search: PartSearch) -> float:
    """Return the log of the share of the prior that an image leaves of the pose of a part, at its best maximum."""
    at_best = sums_at(image, search.objective.prepared, search.peaks.Ts[:1], search.peaks.zs[:1])
    return search.log_evidence - float(at_best.log[0])


def sums_at(image: ImageEdges, prepared: PreparedPart, Ts: Transforms, zs: FloatArray) -> Sums:
    """Return the sums of an image at poses ``T_world_part`` and shared errors, those of the image first."""
    term = image.term(prepared.part, 0)
    return Sums(*_core.image_sums(term, np.ascontiguousarray(Ts), np.ascontiguousarray(zs)).T)
