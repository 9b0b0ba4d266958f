"""The pose of parts from one image, without a table and without a first guess; following a part through images.

Every corner of the image is tried on every corner of the part (``paths.py``), every ellipse on every rim of a hole or
boss (``rims.py``); poses are compared with all edges, the
better ones refined, and what remains is a posterior over modes; poses that the part's symmetry maps onto each other are
one.
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
from tanteo.posterior import Answer, box_corners
from tanteo.vision.answers import hypothesis, judged
from tanteo.vision.camera import Camera, project
from tanteo.vision.candidates import FAINT
from tanteo.vision.edges import EdgeMap, cell_of, channel_of, find_edges, map_edges
from tanteo.vision.ellipse_fit import Ellipse
from tanteo.vision.ellipses import find_ellipses
from tanteo.vision.fit import REACHES, refine
from tanteo.vision.image_edges import ImageEdges, Weights, chance_map, standing
from tanteo.vision.models import VisionModel
from tanteo.vision.outlines import MOST
from tanteo.vision.paths import image_paths, model_paths, poses_from_paths
from tanteo.vision.posterior import infer
from tanteo.vision.rims import poses_from_ellipses
from tanteo.vision.segments import find_corners, find_segments
from tanteo.vision.sight import Sight, Sighting, check_sight, image_modes, prepared, see_table, with_rims
from tanteo.vision.wireframe import Wireframe, in_camera, see_edges

TRIED, KEPT = 240, 48
"""Poses of each part that are refined a little, and of these to the end."""

_QUICK = (12.0, 9.0, 6.0, 4.0)
_LAST = (2.5, 1.5, 1.0, 1.0)


def see_anywhere(
    image: FloatArray,
    camera: Camera,
    parts: Sequence[Part] | Sequence[VisionModel],
    *,
    weights: Weights | None = None,
    top: int = TOP,
) -> Sight:
    """Find a part that may lie or be held in any pose: one object, no table.

    Args:
        image: rows x columns, grey levels from 0 to 255.
        camera: calibrated; the world is its own frame unless it says where it stands.
        parts: candidates with corners, holes or bosses (others have nothing to start from and are not found).
        weights: of the evidence.
        top: how many hypotheses to report.

    Returns:
        One object with its modes, or none where no corner or ellipse of the image fits any part.

    Raises:
        InputError: no parts, more than 200, or an image of another size than the camera's.
        MissingExtraError: without OpenCV.
    """
    parts = check_sight(image, camera, parts)
    if len(parts) > MOST:
        raise InputError(
            f"parts: expected at most {MOST} where the camera's place is not known, as nothing narrows them, got "
            f"{len(parts):,}. Say where the camera stands over the table (--marks, T_world_camera), or give fewer."
        )
    models = [prepared(one) for one in parts]
    points = find_edges(image)
    edges = map_edges(points)
    ellipses = find_ellipses(camera, points)
    seen = ImageEdges(camera, edges, chance_map(edges), weights=weights or Weights())
    proposals, tried = propose_anywhere(image, seen, ellipses.found, models)
    # the best of many tries is better than chance by about the logarithm of their number
    seen = replace(seen, log_unknown=float(np.log(tried)))
    posterior = infer(seen, proposals, len(models))
    hypotheses = tuple(hypothesis(mode, seen) for mode in posterior.modes[:top])
    status, findings = judged(hypotheses, posterior)
    answer = Answer(status, findings, hypotheses, posterior.unknown)
    factors = () if posterior.image is None else (posterior.image,)
    found = Sighting(
        answer, image_modes(posterior, camera, top), None, None, factors=factors, log_known=posterior.log_known
    )
    objects = (with_rims(found, camera, ellipses),) if found.modes else ()
    frame = "camera" if camera.T_world_camera is None else "world"
    return Sight(objects, points, standing(camera), frame, ellipses)


def _ahead(part: Part, T_camera_part: Transforms) -> Transforms:
    """Those poses that have the whole part in front of the camera."""
    corners = box_corners(part)
    depths = T_camera_part[:, 2, :3] @ corners.T + T_camera_part[:, 2, 3:]
    return T_camera_part[np.all(depths > 0, axis=1)]


def propose_anywhere(
    image: FloatArray, seen: ImageEdges, ellipses: tuple[Ellipse, ...], models: Sequence[VisionModel]
) -> tuple[list[tuple[VisionModel, Transforms]], int]:
    """Return poses of each part from the corners and ellipses of the image, and the number of poses that were tried.

    Args:
        image: rows x columns, grey levels.
        seen: its edges.
        ellipses: ellipses of it.
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
            T = refine(model.coarse, camera, edges, T[np.argsort(-score)[:TRIED]], reaches=_QUICK)
            T = _ahead(model.part, T)
            score = coarse_scores(model.frame, camera, edges, T)
            T = refine(model.frame, camera, edges, T[np.argsort(-score)[:KEPT]], reaches=REACHES[2:])
            T = _ahead(model.part, T)
        out.append((model, T))
        logs.append(seen.sums(model, T).there)
    best = max((float(log.max()) for log in logs if len(log)), default=0.0)
    kept = [np.flatnonzero((log > best - FAINT) | (log == log.max(initial=-np.inf))) for log in logs]
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
    """The pose in the next image, near the one in the last.

    Args:
        image: rows x columns, grey levels.
        camera: that took it.
        model: of the part.
        T_camera_part: pose in the image before ``(4, 4)``.
        rng: where to look around it.
        shift: standard deviation of the motion of its middle between two images [m].
        turn: the same of its rotation about each axis [rad].
        starts: how many poses around the last to begin from.
    """
    edges = map_edges(find_edges(image))
    about = SE3.from_parts(np.eye(3), model.part.centroid)
    moves = rng.normal(size=(starts, 6)) * np.r_[np.full(3, shift), np.full(3, turn)]
    moves[0] = 0.0
    first = T_camera_part @ about @ SE3.exp(moves) @ SE3.inverse(about)
    T = refine(model.coarse, camera, edges, first, reaches=REACHES[:8])
    best = T[np.argmax(coarse_scores(model.frame, camera, edges, T, cap=3.0))]
    return np.asarray(refine(model.frame, camera, edges, best[None], reaches=_LAST)[0])


def coarse_scores(frame: Wireframe, camera: Camera, edges: EdgeMap, Ts: Transforms, cap: float = 8.0) -> FloatArray:
    """How well the part's edges fall on edges: one minus the mean capped distance ``(B,)``; hidden ones count."""
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
    """Which parts an image shows, where they are, and what a touch should settle.

    Args:
        image: grey levels from 0 to 255 ``(rows, columns)``; see :func:`tanteo.read_image`.
        camera: calibrated. Where it says where it stands (``T_world_camera``), parts lie on the table z = 0 of the
            world (:func:`tanteo.vision.see_table`); where it does not, one part in any pose is looked for, in the
            frame of the camera (:func:`tanteo.vision.see_anywhere`).
        parts: candidates.
        top: number of hypotheses for each object.

    Returns:
        The objects that were seen, each with its answer: part, pose with covariance, probability.

    Raises:
        InputError: no parts, or an image of another size than the camera's.
        MissingExtraError: without OpenCV (the extra ``vision``).

    Example:
        >>> image = tanteo.read_image("images/twins.png")
        >>> camera = tanteo.read_camera("images/camera.yaml")
        >>> sight = tanteo.see(image, camera, [tanteo.read_part("parts/step_12mm.step")])
        >>> sight.frame, [seen.answer.status for seen in sight.objects]
        ('camera', ['ambiguous'])
    """
    look = see_anywhere if camera.T_world_camera is None else see_table
    return look(image, camera, parts, top=top)
