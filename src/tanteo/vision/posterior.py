"""The posterior of an object of images, by the engine of ``posterior``.

An image proposes poses. The engine maximizes, samples and weights them with the factor of the image. An unknown object
has edges, too: its log evidence is their log density without a model (``Weights.unknown``, ``Weights.base``). How
exactly the image fixes the pose changes no probability of a part (decision 87).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tanteo.factors import ContactPoints, FreeRays
from tanteo.geometry import SE3
from tanteo.geometry.special import log_sum
from tanteo.geometry.typing import BoolArray, FloatArray, Transforms
from tanteo.parts import Part
from tanteo.posterior import (
    DEFAULTS,
    Mode,
    OnTable,
    PartSearch,
    Posterior,
    Priors,
    Problem,
    prepare,
    search_about,
    sized,
    weigh,
)
from tanteo.vision.image_edges import ImageEdges, Sums, sums_of
from tanteo.vision.models import VisionModel
from tanteo.vision.settings import EVIDENCE

_SEED = 0
"""Seed of the samples: the same image gives the same answer."""


@dataclass(frozen=True, slots=True, eq=False)
class ImagePosterior:
    """Posterior of one object of an image.

    Attributes:
        modes: modes of the posterior, best first.
        unknown: probability of the unknown object and of the excluded parts. The remainder to 1 is that of the parts in
            poses that were not proposed.
        left_out: upper bound on the probability of the excluded parts.
        count: number of excluded parts.
        log_unknown: log density of the image if the object is unknown.
        log_known: log density of the image if the object is one of the parts.
        images: the edges of the images with the constants about their poses; empty without proposed poses.
    """

    modes: tuple[Mode, ...] = ()
    unknown: float = 1.0
    left_out: float = 0.0
    count: int = 0
    log_unknown: float = 0.0
    log_known: float = -np.inf
    images: tuple[ImageEdges, ...] = ()


def levelled(
    images: Sequence[ImageEdges],
    proposals: Sequence[tuple[Part, Transforms]],
    priors: Priors,
    lying: OnTable | None = None,
) -> tuple[ImageEdges, ...]:
    """Return images with the constants about the poses of their parts, corrected by samples of the posterior.

    Args:
        images: edges of images of the object.
        proposals: candidate parts, with poses ``T_world_part`` from which maximizations start.
        priors: prior probabilities and scales.
        lying: prior of the pose on a table; any pose if not given.
    """
    images, problem, searches = searched(images, proposals, priors, lying)
    return resampled(images, problem, searches, lying)[0]


def resampled(
    images: Sequence[ImageEdges],
    problem: Problem,
    searches: Sequence[PartSearch],
    lying: OnTable | None = None,
    *,
    prior: float = 0.0,
    anywhere: float = -np.inf,
    log_left_out: float = -np.inf,
) -> tuple[tuple[ImageEdges, ...], Posterior]:
    """Return images with corrected constants, and their posterior, sampled until no correction decides.

    The samples may find a pose beside a maximum at which more edges match exactly. With the constant of the maximum it
    would have nearly all of the probability, and other parts would be dropped. Of several parts, a few samples correct
    most constants before many are drawn.

    Args:
        images: edges of images of the object, with the constants of a search.
        problem: the images and the prior of the pose.
        searches: searches of the parts.
        lying: prior of the pose on a table; any pose if not given.
        prior: log prior probability of each part.
        anywhere: log evidence of an unknown object, its prior included.
        log_left_out: log evidence of the excluded parts, their prior included.
    """
    images, priors, every = tuple(images), np.full(len(searches), prior), problem.settings
    few = replace(every, samples=replace(every.samples, rounds=1))
    starts = [(one.objective.prepared, one.peaks.Ts) for one in searches]
    for settings in (few, every) if len(searches) > 1 else (every,):
        for _ in range(1 + len(searches)):
            if problem.settings is not settings or problem.pose_factors[: len(images)] != images:
                problem = replace(
                    problem, settings=settings, pose_factors=(*images, *(() if lying is None else (lying,)))
                )
                searches = search_about(problem, starts, np.random.default_rng(_SEED))
            rng = np.random.default_rng(_SEED)
            found = weigh(problem, searches, priors, anywhere, rng, log_left_out=log_left_out)
            starts = [
                (part, np.stack([*one.peaks.Ts, *(mode.T_peak for mode in found.modes if mode.prepared is part)]))
                for one in searches
                for part in (one.objective.prepared,)
            ]
            images, most = corrected(images, found, lying, prior)
            if most < DEFAULTS.search.negligible:
                break
    return images, found


def corrected(
    images: Sequence[ImageEdges], found: Posterior, lying: OnTable | None, prior: float
) -> tuple[tuple[ImageEdges, ...], float]:
    """Return images whose constants make the integral about each pose equal to the density that edges are there.

    The constants of a search are those of a normal density about each maximum; the difference to the integral by
    samples is added to them. A mode that is near none of their poses becomes a further one.

    Args:
        images: edges of images of the object.
        found: the posterior of the images alone.
        lying: prior of the pose on a table; any pose if not given.
        prior: log prior probability of each part.

    Returns:
        The images, and the largest correction [nats].
    """
    levels, most = dict(images[0].levels or {}), 0.0
    for part in dict.fromkeys(mode.prepared.part for mode in found.modes):
        own = [mode for mode in found.modes if mode.prepared.part is part]
        Ts, zs = np.stack([mode.T_peak for mode in own]), np.stack([mode.z for mode in own])
        first, *others = sums_of(images, part, Ts, zs)
        wanted = _there(part, Ts, [first, *others], lying)
        at, constants = levels[part]
        constants = np.array(constants)
        for members in _near(part, Ts, wanted):
            mass = float(log_sum([own[k].log_mass for k in members])) - prior
            more, best = mass - wanted[members[0]], members[0]
            near = _are_near(part, Ts[best], at)
            constants[near] += more
            if not near.any():
                taken = float(first.there[best] + first.located[best] - first.log[best])
                further = _images(part, Ts[best][None], np.array([taken + more]))
                at, constants = np.concatenate([at, further[0]]), np.append(constants, further[1])
            most = max(most, more)
        levels[part] = at, constants
    return (replace(images[0], levels=levels), *images[1:]), most


def searched(
    images: Sequence[ImageEdges],
    proposals: Sequence[tuple[Part, Transforms]],
    priors: Priors,
    lying: OnTable | None = None,
) -> tuple[tuple[ImageEdges, ...], Problem, list[PartSearch]]:
    """Return images with the constants of their parts, their problem, and the maxima of parts to which poses lead.

    Args:
        images: edges of images of the object.
        proposals: candidate parts, with poses ``T_world_part`` from which maximizations start.
        priors: prior probabilities and scales.
        lying: prior of the pose on a table; any pose if not given.
    """
    others = () if lying is None else (lying,)

    def search(images: Sequence[ImageEdges], poses: Sequence[Transforms]) -> tuple[Problem, list[PartSearch]]:
        problem = Problem(ContactPoints.none(), FreeRays.none(), priors, pose_factors=(*images, *others))
        proposed = [(prepare(part), Ts) for (part, _), Ts in zip(proposals, poses, strict=True)]
        return problem, search_about(problem, proposed, np.random.default_rng(_SEED))

    poses = [np.ascontiguousarray(Ts) for _, Ts in proposals]
    known = {part: _first_levels(images, part, Ts) for (part, _), Ts in zip(proposals, poses, strict=True)}
    begun = (replace(images[0], levels=known), *images[1:])
    _, first = search(begun, poses)
    levels = {one.objective.prepared.part: _levels(begun, one, lying) for one in first if len(one.peaks)}
    levelled = (replace(images[0], levels=levels), *images[1:])
    return levelled, *search(levelled, [one.peaks.Ts for one in first])


def _first_levels(images: Sequence[ImageEdges], part: Part, Ts: Transforms) -> tuple[Transforms, FloatArray]:
    """Return poses of a part, and the largest sum of where edges are about each."""
    sums = sums_of(images, part, Ts)
    located = sum((one.located for one in sums), start=np.zeros(len(Ts)))
    groups = _near(part, Ts, sum((one.there for one in sums), start=np.zeros(len(Ts))))
    levels = np.array([located[members].max() for members in groups])
    return _images(part, Ts[[members[0] for members in groups]], levels)


def _levels(images: Sequence[ImageEdges], search: PartSearch, lying: OnTable | None) -> tuple[Transforms, FloatArray]:
    """Return poses of a part, and constants that make the integral about each the density that edges are there."""
    part, peaks = search.objective.prepared.part, search.peaks
    first, *others = sums_at(images, search)
    wanted = _there(part, peaks.Ts, [first, *others], lying)
    taken = first.there + first.located - first.log  # by the first constants
    evidence = peaks.evidence + taken + search.log_evidence - log_sum(peaks.evidence)
    groups = _near(part, peaks.Ts, wanted)
    # every peak has a constant, so that a later search begins at all of them
    levels = [np.full(len(members), log_sum(evidence[members]) - wanted[members[0]]) for members in groups]
    return _images(part, peaks.Ts[np.concatenate(groups)], np.concatenate(levels))


def _evidence(images: Sequence[ImageEdges], search: PartSearch, lying: OnTable | None) -> float:
    """Return the log evidence of a part by its maxima, which count as the modes of the posterior do."""
    part, Ts = search.objective.prepared.part, search.peaks.Ts
    wanted = _there(part, Ts, sums_at(images, search), lying)
    best = [wanted[members[0]] for members in _near(part, Ts, wanted)]
    return float(log_sum(best)) if best else -np.inf


def _images(part: Part, Ts: Transforms, levels: FloatArray) -> tuple[Transforms, FloatArray]:
    """Return poses and their constants, with all poses that the symmetry of the part makes the same."""
    turns = part.symmetry.Ts
    return np.ascontiguousarray((Ts[:, None] @ turns).reshape(-1, 4, 4)), np.repeat(levels, len(turns))


def _near(part: Part, Ts: Transforms, log: FloatArray) -> list[list[int]]:
    """Return groups of poses near one another, the most probable of each first."""
    groups: list[list[int]] = []
    left = np.argsort(-log, kind="stable")
    while len(left):
        own = _are_near(part, Ts[left[0]], Ts[left])
        own[0] = True
        groups.append(left[own].tolist())
        left = left[~own]
    return groups


def _are_near(part: Part, T: Transforms, others: Transforms) -> BoolArray:
    """Return which of other poses ``(k, 4, 4)`` are one with a pose that the image suggests ``(k,)``."""
    gaps = SE3.inverse(T) @ others
    shifts = np.linalg.norm(SE3.apply(gaps, part.centroid) - part.centroid, axis=-1)
    turns = np.linalg.norm(gaps[:, :3, :3] - np.eye(3), axis=(1, 2))  # 2 sqrt(2) times the sine of half the turn
    near = shifts < EVIDENCE.same_pose * part.diagonal
    return np.asarray(near & (turns < np.sqrt(8) * np.sin(EVIDENCE.same_turn / 2)))


def infer(
    images: Sequence[ImageEdges],
    proposals: Sequence[tuple[VisionModel, Transforms]],
    count: int,
    *,
    lying: OnTable | None = None,
    log_left_out: Callable[[FloatArray, float], float] = lambda evidence, mislead: -np.inf,
    left_out: int = 0,
) -> ImagePosterior:
    """Return the posterior of the object that images show.

    Parts that are all together less probable than a true pose that was not proposed have no modes.

    Args:
        images: edges of the images; their ``log_unknown`` is that of an unknown object.
        proposals: candidate parts, with poses ``T_world_part`` from which maximizations start.
        count: number of all parts.
        lying: prior of the pose on a table; any pose if not given.
        log_left_out: log evidence of the excluded parts, as a function of the log evidence of each candidate, prior
            included, and of a part that explains no edge.
        left_out: number of excluded parts.
    """
    rows = [k for k, (_, Ts) in enumerate(proposals) if len(Ts)]
    if not rows:
        return ImagePosterior(count=left_out)
    priors = sized(Priors(), max(0.5 * model.part.diagonal for model, _ in proposals))
    images, problem, searches = searched(images, [(proposals[k][0].part, proposals[k][1]) for k in rows], priors, lying)
    unknown = sum(image.log_unknown for image in images)
    known = float(np.log1p(-problem.priors.unknown))
    prior = known - float(np.log(count))
    evidence = np.full(len(proposals), -np.inf)
    evidence[rows] = [_evidence(images, search, lying) + prior for search in searches]
    anywhere = float(np.log(problem.priors.unknown)) + unknown
    least = float(log_sum([anywhere, *evidence])) + float(np.log(DEFAULTS.samples.region))
    likely = [s for s, own in zip(searches, evidence[rows], strict=True) if own > least or own == evidence.max()]
    excluded = log_left_out(evidence, unknown + known)
    total = float(log_sum([anywhere, excluded, *evidence]))
    modes: tuple[Mode, ...] = ()
    log_known, none = float(log_sum(evidence)), float(np.exp(log_sum([anywhere, excluded]) - total))
    left = float(np.exp(excluded - total))
    if log_known > anywhere + np.log(EVIDENCE.missed):  # otherwise samples would change no answer
        images, found = resampled(
            images, problem, likely, lying, prior=prior, anywhere=anywhere, log_left_out=excluded
        )  # fmt: skip
        modes, log_evidence = _weighed(images, found, lying, prior)
        log_left = float(np.log(found.unsearched)) + found.log_evidence if found.unsearched else -np.inf
        left = float(np.exp(log_left - log_evidence))
        none = float(np.exp(np.log(found.unknown) + found.log_evidence - log_evidence)) if found.unknown else 0.0
        log_known = float(log_sum([mode.log_mass for mode in modes]))
    # if none of the poses holds, the object is unknown, or the proposals missed the true pose
    strange = problem.priors.unknown / (problem.priors.unknown + (1 - problem.priors.unknown) * EVIDENCE.missed)
    first, *others = images
    proposed = {part: at for part, (at, _) in (first.levels or {}).items()}
    return ImagePosterior(
        modes, strange * (none - left) + left, left, left_out, unknown, log_known - known,
        (replace(first, proposed=proposed), *others),
    )  # fmt: skip


def _weighed(
    images: Sequence[ImageEdges], found: Posterior, lying: OnTable | None, prior: float
) -> tuple[tuple[Mode, ...], float]:
    """Return modes with their probabilities, by the density that edges are there, and the log evidence of the image.

    The constants about poses are those of a normal density about each maximum, and the integral of the density differs
    from that. So modes count by the density that edges are there, and those near one another count as one.

    Args:
        images: the edges of the images.
        found: the posterior.
        lying: prior of the pose on a table; any pose if not given.
        prior: log prior probability of each part.
    """
    masses: dict[int, float] = {}
    for part in dict.fromkeys(mode.prepared.part for mode in found.modes):
        rows = [k for k, mode in enumerate(found.modes) if mode.prepared.part is part]
        some = [found.modes[k] for k in rows]
        Ts = np.stack([mode.T_peak for mode in some])
        wanted = _there(part, Ts, sums_of(images, part, Ts, np.stack([mode.z for mode in some])), lying) + prior
        for members in _near(part, Ts, wanted):
            total = float(log_sum(wanted[members])) - wanted[members[0]]
            masses |= {rows[k]: float(wanted[k] - total) for k in members}
    log_none = float(np.log(found.unknown)) + found.log_evidence if found.unknown else -np.inf
    total = float(log_sum([log_none, *masses.values()]))
    modes = [
        replace(mode, log_mass=masses[k], probability=float(np.exp(masses[k] - total)))
        for k, mode in enumerate(found.modes)
    ]
    return tuple(sorted(modes, key=lambda mode: -mode.probability)), total


def as_one(modes: Sequence[Mode]) -> list[list[Mode]]:
    """Return modes of the same part that are near one another together, the most probable of each first."""
    groups: list[list[Mode]] = []
    for part in dict.fromkeys(mode.prepared.part for mode in modes):
        own = [mode for mode in modes if mode.prepared.part is part]
        near = _near(part, np.stack([mode.T_peak for mode in own]), np.array([mode.log_mass for mode in own]))
        groups += [[own[k] for k in members] for members in near]
    return sorted(groups, key=lambda group: -sum(mode.probability for mode in group))


def _there(part: Part, Ts: Transforms, every: Sequence[Sums], lying: OnTable | None) -> FloatArray:
    """Return the log density that edges are there at poses ``(k,)``, the probability of the stable pose included."""
    rests = np.zeros(len(Ts)) if lying is None else np.array([lying.log_probability(part, T) for T in Ts])
    return np.asarray(sum((sums.there for sums in every), start=rests))


def sums_at(images: Sequence[ImageEdges], search: PartSearch) -> list[Sums]:
    """Return the sums of each image at the maxima of a part."""
    return sums_of(images, search.objective.prepared.part, search.peaks.Ts, search.peaks.zs)
