"""The pose of parts from one image, without a table or an initial pose; tracking of a part through images.

Every corner of the image is matched with every corner of the part (``paths.py``), every ellipse with every rim of a
hole or boss (``rims.py``). All edges score these poses. The best are refined, and the posterior has their modes.
Poses that the symmetry of the part maps onto each other are one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tanteo.defaults import TOP
from tanteo.errors import InputError
from tanteo.geometry import SE3
from tanteo.geometry.typing import FloatArray, Transforms
from tanteo.parts import Part
from tanteo.posterior import DEFAULTS, Answer, box_corners
from tanteo.vision.answers import hypothesis, judged
from tanteo.vision.camera import Camera, project
from tanteo.vision.edges import EdgeMap, cell_of, chance_hits, channel_of, find_edges, map_edges
from tanteo.vision.ellipse_fit import Ellipse
from tanteo.vision.ellipses import find_ellipses
from tanteo.vision.fit import refine
from tanteo.vision.image_edges import ImageEdges, Weights, standing
from tanteo.vision.models import VisionModel
from tanteo.vision.paths import image_paths, model_paths, poses_from_paths
from tanteo.vision.posterior import infer
from tanteo.vision.rims import poses_from_ellipses
from tanteo.vision.segments import find_corners, find_segments
from tanteo.vision.settings import EVIDENCE, SEARCH
from tanteo.vision.sight import Sight, Sighting, check_sight, image_modes, prepared, see_table, with_rims
from tanteo.vision.wireframe import Wireframe, in_camera, see_edges


def see_anywhere(
    image: FloatArray,
    camera: Camera,
    parts: Sequence[Part] | Sequence[VisionModel],
    *,
    weights: Weights | None = None,
    top: int = TOP,
) -> Sight:
    """Recognize one object in any pose, without a table.

    Args:
        image: grey levels from 0 to 255 ``(rows, columns)``.
        camera: calibrated camera; without a pose the world is its own frame.
        parts: candidates with corners, holes or bosses; parts without them are not found.
        weights: weights of the evidence.
        top: number of hypotheses.

    Returns:
        One object with its modes, or none if no corner or ellipse of the image fits a part.

    Raises:
        InputError: there are no parts, more than 200 parts, or the image has another size than the camera.
        MissingExtraError: OpenCV is not installed.
    """
    parts = check_sight(image, camera, parts)
    if len(parts) > DEFAULTS.pruning.least:
        raise InputError(
            f"parts: expected at most {DEFAULTS.pruning.least} where the pose of the camera is unknown, got "
            f"{len(parts):,}. Give the pose of the camera over the table (--marks, T_world_camera), or fewer parts."
        )
    models = [prepared(one) for one in parts]
    points = find_edges(image)
    edges = map_edges(points)
    ellipses = find_ellipses(camera, points)
    seen = ImageEdges(camera, edges, chance_hits(points), weights=weights or Weights())
    proposals, tried = propose_anywhere(image, seen, ellipses.found, models)
    # the best of many poses exceeds chance by about the logarithm of their number
    seen = replace(seen, log_unknown=float(np.log(tried)))
    posterior = infer((seen,), [(model, standing(camera) @ T) for model, T in proposals], len(models))
    hypotheses = tuple(hypothesis(mode, (seen,)) for mode in posterior.modes[:top])
    status, findings = judged(hypotheses, posterior)
    answer = Answer(status, findings, hypotheses, posterior.unknown)
    found = Sighting(
        answer,
        image_modes(posterior, camera, top),
        None,
        None,
        factors=posterior.images,
        log_known=posterior.log_known,
    )
    objects = (with_rims(found, camera, ellipses),) if found.modes else ()
    frame = "camera" if camera.T_world_camera is None else "world"
    return Sight(objects, points, standing(camera), frame, ellipses)


def _ahead(part: Part, T_camera_part: Transforms) -> Transforms:
    """Return the poses at which the whole part is in front of the camera."""
    corners = box_corners(part)
    depths = T_camera_part[:, 2, :3] @ corners.T + T_camera_part[:, 2, 3:]
    return T_camera_part[np.all(depths > 0, axis=1)]


def propose_anywhere(
    image: FloatArray, seen: ImageEdges, ellipses: tuple[Ellipse, ...], models: Sequence[VisionModel]
) -> tuple[list[tuple[VisionModel, Transforms]], int]:
    """Return poses of each part from the corners and ellipses of the image, and the number of poses that were tried.

    Args:
        image: grey levels ``(rows, columns)``.
        seen: edges of the image.
        ellipses: ellipses of the image.
        models: parts.
    """
    camera, edges = seen.camera, seen.edges
    segments = find_segments(image, camera, edges)
    paths = image_paths(segments, find_corners(segments))
    out, logs, tried = [], [], 1
    for model in models:
        by_corners = poses_from_paths(camera, paths, model_paths(model.part))
        by_rims = poses_from_ellipses(camera, ellipses, model.part)
        T = _ahead(model.part, np.concatenate([by_corners, by_rims]))
        tried += len(T)
        if len(T):
            score = coarse_scores(model.coarse, camera, edges, T)
            T = refine(
                model.coarse,
                camera,
                edges,
                T[np.argsort(-score)[: SEARCH.tried]],
                reaches=SEARCH.first_reaches,
            )
            T = _ahead(model.part, T)
            score = coarse_scores(model.frame, camera, edges, T)
            T = refine(
                model.frame,
                camera,
                edges,
                T[np.argsort(-score)[: SEARCH.kept]],
                reaches=SEARCH.last_reaches,
            )
            T = _ahead(model.part, T)
        out.append((model, T))
        logs.append(seen.sums(model, T).there)
    best = max((float(log.max()) for log in logs if len(log)), default=0.0)
    kept = [np.flatnonzero((log > best - DEFAULTS.search.drop_gap) | (log == log.max(initial=-np.inf))) for log in logs]
    return [(model, T[rows]) for (model, T), rows in zip(out, kept, strict=True)], tried


def follow(
    image: FloatArray,
    camera: Camera,
    model: VisionModel,
    T_camera_part: Transforms,
    rng: np.random.Generator,
    *,
    shift: float = 0.015,
    turn: float = np.radians(8.0),
    starts: int = 300,
) -> Transforms:
    """Track a part: return its pose in the next image.

    Args:
        image: grey levels ``(rows, columns)``.
        camera: camera of the image.
        model: part prepared for images.
        T_camera_part: pose in the previous image ``(4, 4)``.
        rng: generator of the initial poses.
        shift: standard deviation of the motion of the part's middle between two images [m].
        turn: standard deviation of the rotation about each axis between two images [rad].
        starts: number of initial poses.
    """
    edges = map_edges(find_edges(image))
    about = SE3.from_parts(np.eye(3), model.part.centroid)
    moves = rng.normal(size=(starts, 6)) * np.r_[np.full(3, shift), np.full(3, turn)]
    moves[0] = 0.0
    first = T_camera_part @ about @ SE3.exp(moves) @ SE3.inverse(about)
    T = refine(model.coarse, camera, edges, first, reaches=SEARCH.reaches(EVIDENCE.stretch, EVIDENCE.reach))
    best = T[np.argmax(coarse_scores(model.frame, camera, edges, T, cap=3.0))]
    return np.asarray(refine(model.frame, camera, edges, best[None], reaches=SEARCH.reaches(EVIDENCE.reach))[0])


def coarse_scores(frame: Wireframe, camera: Camera, edges: EdgeMap, Ts: Transforms, cap: float = 8.0) -> FloatArray:
    """Return one minus the mean capped distance of the part's edges from edges, hidden edges included ``(B,)``."""
    out = []
    for k in range(0, len(Ts), 512):
        T = Ts[k : k + 512]
        seen = see_edges(frame, T, hidden=False)
        pixels = project(camera, in_camera(T, frame.points))
        along = project(camera, in_camera(T, frame.points + 1e-3 * frame.tangents)) - pixels
        channel = channel_of(np.nan_to_num(np.stack([-along[..., 1], along[..., 0]], axis=-1)))
        row, column, inside = cell_of(edges.points.shape, pixels)
        distance = np.where(inside, np.minimum(edges.distances[channel, row, column], cap), cap)
        weight = frame.lengths * seen.shown
        out.append(1 - (distance * weight).sum(axis=1) / np.maximum(weight.sum(axis=1), 1e-12) / cap)
    return np.concatenate(out) if out else np.zeros(0)


def see(image: FloatArray, camera: Camera, parts: Sequence[Part] | Sequence[VisionModel], *, top: int = TOP) -> Sight:
    """Recognize the parts that an image shows: part, pose, and the touch that decides between answers.

    Args:
        image: grey levels from 0 to 255 ``(rows, columns)``; see :func:`tanteo.read_image`.
        camera: calibrated camera. With its pose ``T_world_camera`` parts lie on the table z = 0 of the world
            (:func:`tanteo.vision.see_table`). Without it one part may have any pose in the frame of the camera
            (:func:`tanteo.vision.see_anywhere`).
        parts: candidates.
        top: number of hypotheses for each object.

    Returns:
        The objects of the image with their answers: part, pose with covariance, probability.

    Raises:
        InputError: there are no parts, or the image has another size than the camera.
        MissingExtraError: OpenCV (the extra ``vision``) is not installed.

    Example:
        >>> image = tanteo.read_image("images/twins.png")
        >>> camera = tanteo.read_camera("images/camera.yaml")
        >>> sight = tanteo.see(image, camera, [tanteo.read_part("parts/step_12mm.step")])
        >>> sight.frame, [seen.answer.status for seen in sight.objects]
        ('camera', ['ambiguous'])
    """
    recognize = see_anywhere if camera.T_world_camera is None else see_table
    return recognize(image, camera, parts, top=top)
