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

from tanteo.answers import Answer, box_corners
from tanteo.errors import InputError
from tanteo.lie import SE3
from tanteo.limits import TOP
from tanteo.parts import Part
from tanteo.special import log_sum
from tanteo.typing import FloatArray, Transforms
from tanteo.vision.answers import hypothesis, judged
from tanteo.vision.camera import Camera, project
from tanteo.vision.edges import EdgeMap, cell_of, channel_of, find_edges, map_edges
from tanteo.vision.ellipse_fit import Ellipse
from tanteo.vision.ellipses import find_ellipses
from tanteo.vision.evidence import REACH, Weights, chance_hits, chance_map, log_weight, weigh
from tanteo.vision.fit import REACHES, meet, refine
from tanteo.vision.models import VisionModel
from tanteo.vision.outlines import MOST
from tanteo.vision.paths import image_paths, model_paths, poses_from_paths
from tanteo.vision.posterior import UNKNOWN, ImageMode, ImagePosterior, distinct_poses
from tanteo.vision.rims import poses_from_ellipses
from tanteo.vision.segments import find_corners, find_segments
from tanteo.vision.settle import settle
from tanteo.vision.sight import Sight, Sighting, check_sight, prepared, see_table, with_rims
from tanteo.vision.wireframe import Wireframe, in_camera, see_edges

TRIED, KEPT = 240, 48
"""Poses of each part that are refined a little, and of these to the end."""

_LOST = 0.5
"""A settled pose that has less than this share of the refined one's log weight has lost edges: those that neighbours
pull count in that weight, and not in the settled pose."""

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
    T_world_camera = np.eye(4) if camera.T_world_camera is None else camera.T_world_camera
    ellipses = find_ellipses(camera, points)
    posterior = search(image, camera, edges, ellipses.found, models, weights or Weights())
    modes, hypotheses = [], []
    for mode in posterior.modes[:top]:
        T = refine(mode.model.frame, camera, edges, mode.T_camera_part[None], reaches=_LAST)[0]
        settled = settle(mode.model, camera, edges, T)
        told = _better(mode.model, camera, edges, T, settled.T_camera_part, weights or Weights())
        modes.append(replace(mode, T_camera_part=told))
        hypotheses.append(hypothesis(modes[-1], T_world_camera, camera, settled))
    status, message = judged(hypotheses, posterior)
    answer = Answer(status, message, tuple(hypotheses), posterior.unknown)
    found = Sighting(answer, tuple(modes), None, None)
    objects = (with_rims(found, camera, ellipses),) if modes else ()
    frame = "camera" if camera.T_world_camera is None else "world"
    return Sight(objects, points, T_world_camera, frame, ellipses)


def _better(
    model: VisionModel,
    camera: Camera,
    edges: EdgeMap,
    refined: Transforms,
    settled: Transforms,
    weights: Weights,
) -> Transforms:
    """The settled pose of a part with rims, which blur moves in the refined one, unless it lost edges.

    Where no table holds the part, it may wander off to other edges: of 44 real images of a cube it did in three.
    """
    if not np.any(model.frame.bends):
        return refined
    met = meet(model.frame, camera, edges, np.stack([refined, settled]), REACH)
    log = log_weight(weigh(model.frame, met, chance_hits(edges.points, np.ones(len(edges.points), np.bool_))), weights)
    return settled if log[1] > _LOST * log[0] else refined


def _ahead(part: Part, T_camera_part: Transforms) -> Transforms:
    """Those poses that have the whole part in front of the camera."""
    corners = box_corners(part)
    depths = T_camera_part[:, 2, :3] @ corners.T + T_camera_part[:, 2, 3:]
    return T_camera_part[np.all(depths > 0, axis=1)]


def search(
    image: FloatArray,
    camera: Camera,
    edges: EdgeMap,
    ellipses: tuple[Ellipse, ...],
    models: Sequence[VisionModel],
    weights: Weights,
) -> ImagePosterior:
    """Posterior over parts and poses, from the corners and ellipses of the image."""
    segments = find_segments(image, camera, edges)
    paths = image_paths(segments, find_corners(segments))
    chance = chance_map(edges)
    modes: list[ImageMode] = []
    tried = 1
    for model in models:
        by_corners = poses_from_paths(camera, paths, model_paths(model.part))
        by_rims = poses_from_ellipses(camera, ellipses, model.part)
        first = _ahead(model.part, np.concatenate([by_corners, by_rims]))
        tried += len(first)
        if not len(first):
            continue
        score = coarse_scores(model.coarse, camera, edges, first)
        T = _ahead(model.part, refine(model.coarse, camera, edges, first[np.argsort(-score)[:TRIED]], reaches=_QUICK))
        score = coarse_scores(model.frame, camera, edges, T)
        T = _ahead(model.part, refine(model.frame, camera, edges, T[np.argsort(-score)[:KEPT]], reaches=REACHES[2:]))
        if not len(T):
            continue
        met = meet(model.frame, camera, edges, T, REACH)
        evidence = weigh(model.frame, met, chance.at(met.normals, met.pixels))
        log = log_weight(evidence, weights) + np.log((1 - UNKNOWN) / len(models))
        modes += [ImageMode(model, -1, T[k], float(log[k])) for k in distinct_poses(model.part, T, log)]
    # the best of many tries is better than chance by about the logarithm of their number
    none = np.log(UNKNOWN) + np.log(tried)
    modes.sort(key=lambda mode: -mode.log)
    total = float(log_sum([none, *(mode.log for mode in modes)]))
    scored = tuple(replace(mode, probability=float(np.exp(mode.log - total))) for mode in modes)
    return ImagePosterior(scored, float(np.exp(none - total)))


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
        ('camera', ['recognized'])
    """
    look = see_anywhere if camera.T_world_camera is None else see_table
    return look(image, camera, parts, top=top)
