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
from tanteo.vision.answers import judged, stated
from tanteo.vision.camera import Camera, View, project
from tanteo.vision.candidates import distinct
from tanteo.vision.edges import EdgeMap, EdgePoints, cell_of, chance_hits, channel_of, find_edges, map_edges
from tanteo.vision.ellipse_fit import Ellipse
from tanteo.vision.ellipses import Ellipses, find_ellipses
from tanteo.vision.fit import pixel_length, principal_moves, refine
from tanteo.vision.image_edges import ImageEdges, Weights, standing
from tanteo.vision.models import VisionModel
from tanteo.vision.outlines import check_size
from tanteo.vision.paths import image_paths, model_paths, poses_from_paths
from tanteo.vision.posterior import infer
from tanteo.vision.rims import poses_from_ellipses
from tanteo.vision.segments import find_corners, find_segments
from tanteo.vision.settings import EVIDENCE, SEARCH
from tanteo.vision.shots import jointly
from tanteo.vision.sight import (
    Sight,
    Sighting,
    check_sight,
    in_others,
    prepared,
    see_table,
    with_rims,
)
from tanteo.vision.wireframe import Wireframe, in_camera, see_edges


def see_anywhere(
    image: FloatArray,
    camera: Camera,
    parts: Sequence[Part] | Sequence[VisionModel],
    *,
    weights: Weights | None = None,
    top: int = TOP,
    others: Sequence[View] = (),
) -> Sight:
    """Recognize one object in any pose, without a table.

    Args:
        image: grey levels from 0 to 255 ``(rows, columns)``.
        camera: calibrated camera; without a pose the world is its own frame.
        parts: candidates with corners, holes or bosses; parts without them are not found.
        weights: weights of the evidence.
        top: number of hypotheses.
        others: further images of the same object. All cameras have poses then, and all images share one posterior.

    Returns:
        One object with its modes, or none if no corner or ellipse of the image fits a part.

    Raises:
        InputError: there are no parts, more than 200 parts, an image has another size than its camera, or several
            images have a camera without a pose.
        MissingExtraError: OpenCV is not installed.
    """
    parts = check_sight(image, camera, parts)
    views = View(image, camera), *others
    for view in views:
        check_size(view.pixels, view.camera)
        if others and view.camera.T_world_camera is None:
            raise InputError(
                "camera: expected the pose of each camera (T_world_camera) with several images, got none. Give "
                "--hand-poses and --hand-eye, --marks, or a pose in the file."
            )
    if len(parts) > DEFAULTS.pruning.least:
        raise InputError(
            f"parts: expected at most {DEFAULTS.pruning.least} where the pose of the camera is unknown, got "
            f"{len(parts):,}. Give the pose of the camera over the table (--marks, T_world_camera), or fewer parts."
        )
    models = [prepared(one) for one in parts]
    found_points = [find_edges(view.pixels) for view in views]
    images, proposals, ellipses = proposed_anywhere(views, found_points, models, weights or Weights())
    points = found_points[0]
    posterior = infer(images, proposals, len(models))
    hypotheses, modes = stated(posterior, images, camera, top)
    status, findings = judged(hypotheses, posterior)
    answer = Answer(status, findings, hypotheses, posterior.unknown)
    found = Sighting(
        answer,
        modes,
        None,
        None,
        factors=posterior.images,
        log_known=posterior.log_known,
    )
    objects = (with_rims(found, camera, ellipses),) if found.modes else ()
    frame = "camera" if camera.T_world_camera is None else "world"
    sight = Sight(objects, points, standing(camera), frame, ellipses)
    return replace(
        sight, others=in_others(sight, [(v.camera, p) for v, p in zip(others, found_points[1:], strict=True)])
    )


def proposed_anywhere(
    views: Sequence[View], points: Sequence[EdgePoints], models: Sequence[VisionModel], weights: Weights
) -> tuple[tuple[ImageEdges, ...], list[tuple[VisionModel, Transforms]], Ellipses]:
    """Return images of one object as factors, poses of each part that they propose, and the ellipses of the first.

    Args:
        views: images with the poses of their cameras; the pose of a single one may be unknown.
        points: edge points of each.
        models: parts.
        weights: weights of the evidence.
    """
    images, proposals, tried, first = [], [(model, [np.zeros((0, 4, 4))]) for model in models], 0, None
    for view, own in zip(views, points, strict=True):
        ellipses = find_ellipses(view.camera, own)
        first = first or ellipses
        image = ImageEdges(view.camera, map_edges(own), chance_hits(own), weights=weights)
        found, count = propose_anywhere(view.pixels, image, ellipses.found, models)
        tried += count
        for (_, all_), (_, T) in zip(proposals, found, strict=True):
            all_.append(standing(view.camera) @ T)
        images.append(image)
    assert first is not None
    # the best of many poses exceeds chance by about the logarithm of their number
    images[0] = replace(images[0], log_unknown=float(np.log(tried)))
    every = [(model, np.concatenate(all_)) for model, all_ in proposals]
    some = [(model, Ts, np.zeros(len(Ts))) for model, Ts in every if len(Ts)]
    if len(views) == 1 or not some:
        return tuple(images), every, first
    _, kept = jointly(images, some, unknown=False)
    return tuple(images), [(model, kept.get(id(model), Ts)) for model, Ts in every], first


def _ahead(part: Part, T_camera_part: Transforms) -> Transforms:
    """Return the poses at which the whole part is in front of the camera."""
    corners = box_corners(part)
    depths = T_camera_part[:, 2, :3] @ corners.T + T_camera_part[:, 2, 3:]
    return T_camera_part[np.all(depths > 0, axis=1)]


def _best_distinct(
    model: VisionModel, Ts: Transforms, scores: FloatArray, most: int, slack: float | None = None
) -> Transforms:
    """Return the best of the poses that differ, best first ``(k, 4, 4)``.

    Args:
        model: the part.
        Ts: poses ``(B, 4, 4)``.
        scores: score of each ``(B,)``; poses with minus infinity are excluded.
        most: number of poses at most.
        slack: distance between places of equal poses [m]; that of poses that are one if not given.
    """
    rows = np.flatnonzero(distinct(model, Ts, scores, slack) & (scores > -np.inf))
    return np.ascontiguousarray(Ts[rows[np.argsort(-scores[rows], kind="stable")[:most]]])


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
    first, tried = [], 1
    for model in models:
        by_corners = poses_from_paths(camera, paths, model_paths(model.part))
        by_rims = poses_from_ellipses(camera, ellipses, model.part)
        T = _ahead(model.part, np.concatenate([by_corners, by_rims]))
        tried += len(T)
        score = coarse_scores(model.coarse, camera, edges, T)
        some = T[np.argsort(-score)[: SEARCH.tried]]
        T = _ahead(model.part, refine(model.coarse, camera, edges, some, reaches=SEARCH.first_reaches))
        some = _best_distinct(model, T, seen.sums(model, T, coarse=True).there, SEARCH.kept)
        T = _ahead(model.part, refine(model.frame, camera, edges, some, reaches=SEARCH.last_reaches))
        first.append((T, seen.sums(model, T).there))
    best = max((float(log.max()) for _, log in first if len(log)), default=0.0)
    return [
        (model, _with_moved(seen, model, T, log, best)) for model, (T, log) in zip(models, first, strict=True)
    ], tried


def _with_moved(seen: ImageEdges, model: VisionModel, Ts: Transforms, log: FloatArray, best: float) -> Transforms:
    """Return the likely poses of a part, and poses beside those that may be the best.

    Where a shadow or a second edge is next to an edge, edges match at several poses.

    Args:
        seen: edges of the image.
        model: the part.
        Ts: poses ``T_camera_part`` ``(B, 4, 4)``.
        log: log density of the image at each ``(B,)``.
        best: largest log density at a pose of any part.
    """
    camera, edges, kept = seen.camera, seen.edges, [np.zeros((0, 4, 4))]
    for one in _best_distinct(model, Ts, np.where(log > best - SEARCH.likely, log, -np.inf), SEARCH.kept):
        near = principal_moves(model.frame, camera, edges, one)
        near = refine(model.frame, camera, edges, near, reaches=SEARCH.reaches(SEARCH.beside))
        kept.append(_ahead(model.part, near))
    moved = np.concatenate(kept)
    more = seen.sums(model, moved).there
    likely = (log > best - DEFAULTS.search.drop_gap) | (log == log.max(initial=-np.inf))
    more = np.where(more > best - SEARCH.likely, more, -np.inf)
    every, logs = np.concatenate([Ts[likely], moved]), np.concatenate([log[likely], more])
    slack = EVIDENCE.spread * pixel_length(camera, every[0], model.part.centroid) if len(every) else 0.0
    return _best_distinct(model, every, logs, SEARCH.kept, slack)


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
    """Return one minus the mean capped distance of the part's edges from edges ``(B,)``."""
    out = []
    for k in range(0, len(Ts), 512):
        T = Ts[k : k + 512]
        seen = see_edges(frame, T)
        pixels = project(camera, in_camera(T, frame.points))
        along = project(camera, in_camera(T, frame.points + 1e-3 * frame.tangents)) - pixels
        channel = channel_of(np.nan_to_num(np.stack([-along[..., 1], along[..., 0]], axis=-1)))
        row, column, inside = cell_of(edges.points.shape, pixels)
        distance = np.where(inside, np.minimum(edges.distances[channel, row, column], cap), cap)
        weight = frame.lengths * seen.shown
        out.append(1 - (distance * weight).sum(axis=1) / np.maximum(weight.sum(axis=1), 1e-12) / cap)
    return np.concatenate(out) if out else np.zeros(0)


def see(
    image: FloatArray,
    camera: Camera,
    parts: Sequence[Part] | Sequence[VisionModel],
    *,
    others: Sequence[View] = (),
    on_table: bool = True,
    top: int = TOP,
) -> Sight:
    """Recognize the parts that images show: part, pose, and the touch that decides between answers.

    Args:
        image: grey levels from 0 to 255 ``(rows, columns)``; see :func:`tanteo.read_image`.
        camera: calibrated camera. With its pose ``T_world_camera`` parts lie on the table z = 0 of the world
            (:func:`tanteo.vision.see_table`). Without it one part may have any pose in the frame of the camera
            (:func:`tanteo.vision.see_anywhere`).
        parts: candidates.
        others: further images of the same scene, each with the pose of its camera in the same world. All images share
            one posterior; so do errors of the poses of cameras with one :class:`~tanteo.vision.camera.Mounting`.
        on_table: whether the parts lie on the table z = 0 of the world; if not, one part may have any pose.
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
        >>> sight.frame, [seen.answer.status for seen in sight.objects]  # one view without a table: several poses
        ('camera', ['ambiguous'])
    """
    recognize = see_table if on_table and camera.T_world_camera is not None else see_anywhere
    return recognize(image, camera, parts, top=top, others=others)
