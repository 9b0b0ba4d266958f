"""The answer of an image: hypotheses with pose and covariance, the status, and the touch that decides between two."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tanteo.geometry import SE3
from tanteo.geometry.typing import Covariances, FloatArray, Transforms, Vectors
from tanteo.parts import Surface
from tanteo.posterior import DEFAULTS, Answer, Hypothesis, Misfit, Mode, Status, verdict
from tanteo.posterior.answers import hypothesis_at
from tanteo.posterior.fit_at_mode import GoodnessOfFit, goodness_of_fit
from tanteo.posterior.sampling.covariances import mode_covariances
from tanteo.vision.camera import Camera
from tanteo.vision.image_edges import ImageEdges, Sums, standing, sums_of
from tanteo.vision.models import VisionModel, prepare_vision
from tanteo.vision.posterior import ImagePosterior, as_one
from tanteo.vision.settings import EVIDENCE
from tanteo.words import Finding
from tanteo.words.findings import (  # fmt: skip
    DecidingTouch,
    EdgesFitBadly,
    NotSearched,
    OutlineCut,
    SimilarOutlines,
    UnknownInImage,
)
from tanteo.words.sentences import touch_words


@dataclass(frozen=True, slots=True, eq=False)
class ImageMode:
    """A part at a pose, with its probability.

    Attributes:
        model: the part.
        T_camera_part: pose ``(4, 4)``.
        probability: posterior probability.
    """

    model: VisionModel
    T_camera_part: Transforms
    probability: float


def hypothesis(
    mode: Mode, images: Sequence[ImageEdges], *, beside: Sequence[Mode] = (), lying: bool = False
) -> Hypothesis:
    """Return the hypothesis of a mode: pose and covariance in the world, free directions, fit of the edges.

    A part on a table has three more equations. With other modes of the part that count as one with the mode, the
    covariance is the second moment of all of them about its pose.

    Args:
        mode: mode of the engine's posterior.
        images: the edges of the images, all of them.
        beside: less probable modes that count as one with it.
        lying: whether the part lies on a table.
    """
    part = mode.prepared.part
    fit = goodness_of_fit(mode)
    every, covariance, misfit = _fitted(mode, fit, images, 3 if lying else 6)
    probability = mode.probability + sum(other.probability for other in beside)
    if beside and probability > 0:
        covariance = covariance * (mode.probability / probability)
        for other in beside:
            off = SE3.log(SE3.inverse(mode.T_peak) @ other.T_peak)
            own = _fitted(other, goodness_of_fit(other), images, 3 if lying else 6)[1]
            covariance += (other.probability / probability) * (own + np.outer(off, off))
    middle = SE3.apply(mode.T_world_part, part.centroid)
    pixels = [SE3.apply(SE3.inverse(standing(one.camera)), middle)[2] / one.camera.focal.mean() for one in images]
    squares = sum(float(sums.squares[0]) * pixel**2 for sums, pixel in zip(every, pixels, strict=True))
    matched = sum(float(sums.matched[0]) for sums in every)
    return hypothesis_at(
        part,
        mode.T_world_part,
        covariance,
        free=fit.free,
        probability=probability,
        misfit=misfit,
        rms=float(np.sqrt(squares / max(matched, 1.0))),
    )


def _fitted(
    mode: Mode, fit: GoodnessOfFit, images: Sequence[ImageEdges], fixed: int
) -> tuple[list[Sums], Covariances, Misfit]:
    """Return the sums of each image at a mode, the covariance of its pose, and its misfit; some motions are fitted."""
    every = sums_of(images, mode.prepared.part, mode.T_peak[None], mode.z[None])
    dof = max(round(sum(float(sums.freedom[0]) for sums in every)) - fixed, 1)
    chi2 = sum(float(sums.chi2[0]) for sums in every)
    return every, mode_covariances(fit)[0] * max(1.0, chi2 / dof), Misfit(0.0, chi2, dof)


def stated(
    posterior: ImagePosterior, images: Sequence[ImageEdges], camera: Camera, top: int, *, lying: bool = False
) -> tuple[tuple[Hypothesis, ...], tuple[ImageMode, ...]]:
    """Return the hypotheses of a posterior, and the same as parts in the frame of a camera.

    Args:
        posterior: posterior of the images.
        images: the edges of the images, all of them.
        camera: the camera.
        top: number of hypotheses.
        lying: whether the part lies on a table.
    """
    groups = as_one(posterior.modes)[:top]
    hypotheses = tuple(hypothesis(best, images, beside=others, lying=lying) for best, *others in groups)
    T_camera_world = SE3.inverse(standing(camera))
    modes = tuple(
        ImageMode(prepare_vision(best.prepared.part), T_camera_world @ best.T_world_part, one.probability)
        for (best, *_), one in zip(groups, hypotheses, strict=True)
    )
    return hypotheses, modes


def judged(hypotheses: Sequence[Hypothesis], posterior: ImagePosterior) -> tuple[Status, tuple[Finding, ...]]:
    """Return the status and the findings of an answer from images.

    Args:
        hypotheses: hypotheses, most probable first.
        posterior: posterior of the images.
    """
    status, finding = verdict(tuple(hypotheses), posterior.unknown, 0.0)
    findings: tuple[Finding, ...] = (finding,)
    best = hypotheses[0] if hypotheses else None
    if status == "unknown" and posterior.left_out > 0.5 * posterior.unknown:
        return "ambiguous", (SimilarOutlines("" if best is None else best.part, posterior.count),)
    if status == "unknown":
        unknown = posterior.unknown
        findings = (UnknownInImage(unknown) if best is None else UnknownInImage(unknown, best.part, best.probability),)
    elif best is not None and best.p_value < np.exp(-DEFAULTS.search.negligible):
        findings = (*findings, EdgesFitBadly(best.p_value))
    if status != "recognized" and posterior.left_out > EVIDENCE.missed:
        findings = (*findings, NotSearched(posterior.count, posterior.left_out))
    return status, findings


def too_many(parts: int) -> Answer:
    """Return the answer for an object whose outline selects none of more parts than can be searched."""
    return Answer("insufficient", (OutlineCut(parts),), (), 1.0)


@dataclass(frozen=True, slots=True, eq=False)
class Question:
    """A place on the surface to touch from above, at which two answers have different heights.

    Attributes:
        point: place on the surface that the first answer predicts, world ``(3,)`` [m].
        heights: heights of the surface above the table by the first and the second answer ``(2,)`` [m].
        answers: names of the parts of the two answers.
    """

    point: Vectors
    heights: FloatArray
    answers: tuple[str, str]

    @property
    def finding(self) -> DecidingTouch:
        """The touch as a finding."""
        x, y = map(float, self.point[:2])
        first, second = map(float, self.heights)
        return DecidingTouch(self.answers, (x, y), (first, second))

    @property
    def words(self) -> str:
        """The touch as a clause for a person."""
        return touch_words(self.finding)


def heights(surface: Surface, T_table_part: Transforms, places: FloatArray) -> FloatArray:
    """Return the height of a part's surface over places ``(n, 2)`` of the table, 0 beside the part ``(n,)`` [m]."""
    T = SE3.inverse(T_table_part)
    top = 1.0 + float(np.abs(surface.vertices).max()) + float(np.abs(T_table_part[2, 3]))
    starts = np.concatenate([places, np.full((len(places), 1), top)], axis=1)
    hits = surface.cast(SE3.apply(T, starts), np.broadcast_to(-T[:3, 2], starts.shape))
    return np.where(np.isfinite(hits.distances), top - hits.distances, 0.0)


def deciding_touch(
    first: tuple[str, Surface, Transforms], second: tuple[str, Surface, Transforms], T_world_table: Transforms
) -> Question | None:
    """Return the place at which the heights of two answers differ most.

    Args:
        first: name, surface and pose ``T_table_part`` of the first answer.
        second: name, surface and pose of the second answer.
        T_world_table: frame of the table ``(4, 4)``.

    Returns:
        The middle of a patch where the heights differ; None if they are the same everywhere.
    """
    corners = [SE3.apply(T, surface.vertices)[:, :2] for _, surface, T in (first, second)]
    low, high = np.concatenate(corners).min(axis=0), np.concatenate(corners).max(axis=0)
    step = float((high - low).max()) * EVIDENCE.same_pose
    shape = tuple(int(n) for n in np.ceil((high - low) / step).astype(int) + 1)
    x, y = np.meshgrid(low[0] + step * np.arange(shape[0]), low[1] + step * np.arange(shape[1]), indexing="ij")
    places = np.stack([x, y], axis=-1).reshape(-1, 2)
    z = np.stack([heights(surface, T, places).reshape(shape) for _, surface, T in (first, second)])
    gap = np.pad(np.abs(z[0] - z[1]), 1)
    # a touch may be a cell off: the smallest difference of the neighbours counts
    safe = np.min([np.roll(gap, s, axis=(0, 1)) for s in ((i, j) for i in (-1, 0, 1) for j in (-1, 0, 1))], axis=0)
    safe = safe[1:-1, 1:-1]
    k = int(np.argmax(safe))
    if safe.flat[k] < 1e-4:
        return None
    both = z.reshape(2, -1)[:, k]
    point = SE3.apply(T_world_table, np.array([*places[k], both[0]]))
    return Question(point, both, (first[0], second[0]))
