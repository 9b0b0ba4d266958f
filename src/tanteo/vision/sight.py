"""Recognition of the objects on a table in an image: part, pose, and the touch that decides what the image cannot."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from tanteo.defaults import TOP
from tanteo.errors import InputError
from tanteo.factors import PoseFactor
from tanteo.geometry import SE3
from tanteo.geometry.typing import BoolArray, FloatArray, Transforms
from tanteo.parts import Part, StoredParts, as_parts
from tanteo.posterior import Answer, OnTable
from tanteo.values import Value
from tanteo.vision.answers import ImageMode, Question, deciding_touch, judged, stated, too_many
from tanteo.vision.camera import Camera, View, on_plane
from tanteo.vision.descriptors import Descriptors, describe
from tanteo.vision.edges import EdgePoints, chance_hits, find_edges, map_edges
from tanteo.vision.ellipses import Ellipses, find_ellipses
from tanteo.vision.image_edges import ImageEdges, Weights, edge_information, standing
from tanteo.vision.models import VisionModel, prepare_vision
from tanteo.vision.outlines import check_size, narrowed, seen_outline
from tanteo.vision.posterior import ImagePosterior, infer
from tanteo.vision.propose import edge_costs
from tanteo.vision.regions import Region, dilated, find_regions, silhouette, surroundings
from tanteo.vision.rims import name_ellipses
from tanteo.vision.settings import EDGES, EVIDENCE
from tanteo.vision.shots import Shot, image_candidates, same_objects
from tanteo.vision.table import TableErrors, seen_table


def check_sight(image: FloatArray, camera: Camera, parts: Any) -> Sequence[Any]:
    """Check that there are parts and that the image has the size of the camera; return the parts, stored ones unopened.

    Raises:
        InputError: there are no parts, or the sizes differ.
    """
    parts = as_parts("parts", parts)
    if not len(parts):
        raise InputError("parts: expected at least one part, got none.")
    check_size(image, camera)
    return parts


def prepared(one: Part | VisionModel) -> VisionModel:
    """Return a part prepared for images."""
    return one if isinstance(one, VisionModel) else prepare_vision(one)


def part_of(one: Any) -> Part:
    """Return the part of a prepared part, or the part itself if it is not prepared."""
    found: Part = getattr(one, "part", one)
    return found


def check_place(camera: Camera, T_camera_table: Transforms, parts: Sequence[Any]) -> None:
    """Check that the camera is above the table, not too far for parts of this size, and points at the table.

    Raises:
        InputError: it is not, or it does not.
    """
    height = float(SE3.inverse(T_camera_table)[2, 3])
    size = _largest(parts)
    corners = np.array([[0, 0], [1, 0], [0, 1], [1, 1]]) * (np.array(camera.size) - 1.0)
    if height <= 0:
        got = f"a camera {-1e3 * height:.0f} mm below. Are x and y of the marks exchanged, or its pose inverted?"
    elif size * camera.focal.mean() / height < EVIDENCE.stretch:
        got = f"a camera {height:.4g} m above, for parts of {size:.2g} m. Are its pose or the marks in another unit?"
    elif not np.any(np.isfinite(on_plane(camera, corners, T_camera_table))):
        got = "a camera that points away. Is its pose inverted, or written column by column?"
    else:
        return
    raise InputError(f"camera: expected a camera above the table that points at it, got {got}")


def _largest(parts: Sequence[Any]) -> float:
    """Return the largest diagonal of the parts [m]."""
    if isinstance(parts, StoredParts):
        return float(np.linalg.norm(parts.numbers[:, 11:14] - parts.numbers[:, 8:11], axis=1).max())
    return max(float(part_of(one).diagonal) for one in parts)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Sighting(Value):
    """One object in an image.

    Attributes:
        answer: answer, in the form of answers from readings.
        modes: modes of the hypotheses, in the same order.
        question: most useful touch; None if no touch from above decides between answers.
        region: region of the object in the first image; None without a table or where another image shows it.
        outline: descriptors of the outline of the region on the table, shadow included [m]; None without a region.
        similar: names of the parts with the likeliest outlines, the likeliest first.
        rims: for each ellipse of the image the hole or boss of the best answer whose rim it is; empty for none.
        factors: the image as factors of a posterior, with the prior of a part on a table if there is one; none without
            an answer.
        log_known: log density of the image if the object is one of the parts.
    """

    answer: Answer
    modes: tuple[ImageMode, ...]
    question: Question | None
    region: Region | None
    outline: Descriptors | None = None
    similar: tuple[str, ...] = ()
    rims: tuple[str, ...] = ()
    factors: tuple[PoseFactor, ...] = ()
    log_known: float = -np.inf


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Sight(Value):
    """The objects of one image, with its edges and ellipses.

    Attributes:
        objects: objects, largest first.
        edges: edge points.
        T_world_camera: pose of the camera; the identity if it is unknown.
        frame: frame of the poses, ``"world"``, or ``"camera"`` if the pose of the camera is unknown.
        ellipses: ellipses of the image, and refused arcs.
        others: the same objects in further images, with poses in their cameras.
    """

    objects: tuple[Sighting, ...]
    edges: EdgePoints
    T_world_camera: Transforms
    frame: str = "world"
    ellipses: Ellipses = field(default_factory=lambda: Ellipses((), ()))
    others: tuple[Sight, ...] = ()


def see_table(
    image: FloatArray,
    camera: Camera,
    parts: Sequence[Part] | Sequence[VisionModel],
    *,
    T_world_table: Transforms | None = None,
    table: TableErrors | None = None,
    weights: Weights | None = None,
    top: int = TOP,
    ignore: BoolArray | None = None,
    others: Sequence[View] = (),
) -> Sight:
    """Recognize the objects on a table.

    Args:
        image: grey levels from 0 to 255 ``(rows, columns)``.
        camera: calibrated camera with its pose ``camera.T_world_camera``.
        parts: candidates, as parts or prepared by ``prepare_vision``. Outlines select among more than 64 parts, and
            the answer states where the excluded parts decide.
        T_world_table: frame whose plane z = 0 is the table; the world if not given.
        table: errors of the table.
        weights: weights of the evidence.
        top: number of hypotheses for each object.
        ignore: pixels of known objects ``(rows, columns)``. A region that is mostly theirs is excluded.
        others: further images of the same table, each with the pose of its camera. All images share one posterior.

    Returns:
        One sighting for each object: a recognized part, or a region whose edges neither the table nor parts explain.

    Raises:
        InputError: there are no parts, the image has another size, or the pose of the camera is unknown or impossible.
        MissingExtraError: OpenCV is not installed.
    """
    parts, begun = check_sight(image, camera, parts), time.perf_counter()
    T_world_table, table = np.eye(4) if T_world_table is None else T_world_table, table or TableErrors()
    shots = [shot_of(view, parts, T_world_table, table) for view in (View(image, camera, ignore=ignore), *others)]
    return see_shots(shots, parts, T_world_table=T_world_table, table=table, weights=weights, top=top, begun=begun)


def see_shots(
    shots: Sequence[Shot],
    parts: Sequence[Part] | Sequence[VisionModel],
    *,
    T_world_table: Transforms,
    table: TableErrors,
    weights: Weights | None = None,
    top: int = TOP,
    begun: float | None = None,
) -> Sight:
    """Recognize the objects on a table in evaluated images, as :func:`see_table` does.

    Poses that an image proposes stay with its shot: a further image does not propose those of earlier ones again.

    Args:
        shots: evaluated images of one table, of :func:`shot_of`.
        parts: candidates.
        T_world_table: frame whose plane z = 0 is the table.
        table: errors of the table.
        weights: weights of the evidence.
        top: number of hypotheses for each object.
        begun: time from which the duration counts (``time.perf_counter``); now if not given.
    """
    start, camera, weights = begun or time.perf_counter(), shots[0].camera, weights or Weights()
    objects: list[Sighting] = []
    for regions in same_objects(shots):
        if _explained(objects, regions[0], camera, shots[0]):
            continue
        shown = next(k for k, region in enumerate(regions) if region is not None)
        shot, region = shots[shown], regions[shown]
        assert region is not None
        drawn = outline_on_table(shot.camera, region, shot.T_camera_table)
        chosen = narrowed(seen_outline(shot.camera, region, shot.T_camera_table, T_world_table), parts)
        if not len(chosen.rows):
            objects.append(Sighting(too_many(len(parts)), (), None, regions[0], drawn))
            continue
        models = [prepared(parts[int(row)]) for row in chosen.rows]
        images, own = image_candidates(models, shots, regions, chosen.rests, weights)
        area = area_of(region, shot.camera, shot.T_camera_table)
        # the camera's error is a state of the images: the table has its own alone
        lying = OnTable(T_world_table, table.height, table.tilt, area)
        posterior = infer(
            images,
            [(model, own.get(id(model), np.zeros((0, 4, 4)))) for model in models],
            len(parts),
            lying=lying,
            log_left_out=chosen.log_left_out,
            left_out=chosen.left_out,
        )
        seen = sighting(posterior, images, regions[0], T_world_table, top)
        names = tuple(dict.fromkeys(part_of(parts[int(row)]).name for row in chosen.similar))
        factors = (*posterior.images, lying) if posterior.images else ()
        seen = replace(seen, factors=factors, log_known=posterior.log_known)
        objects.append(replace(seen, outline=drawn, similar=names))
    points, chance = shots[0].points, shots[0].chance
    objects = separate(objects, camera, points, chance)
    ellipses = find_ellipses(camera, points.only(points.inside(of_objects(objects, camera))))
    seconds = {"total": time.perf_counter() - start}
    timed = [replace(o, answer=replace(o.answer, elapsed=seconds)) for o in objects]
    named = tuple(with_rims(seen, camera, ellipses) for seen in timed)
    sight = Sight(named, points, standing(camera), ellipses=ellipses)
    return replace(sight, others=in_others(sight, [(shot.camera, shot.points) for shot in shots[1:]]))


def shot_of(view: View, parts: Sequence[Any], T_world_table: Transforms, errors: TableErrors) -> Shot:
    """Return what an image of a table shows.

    Raises:
        InputError: the image has another size than its camera, or the pose of the camera is unknown or impossible.
    """
    camera = view.camera
    check_size(view.pixels, camera)
    if camera.T_world_camera is None:
        raise InputError("camera: expected its pose (T_world_camera), got none. Fit it with fit_camera.")
    T_camera_table = SE3.inverse(camera.T_world_camera) @ T_world_table
    check_place(camera, T_camera_table, parts)
    points = find_edges(view.pixels)
    chance = chance_hits(points)
    regions = find_regions(view.pixels, points, chance)
    regions = _alone(regions, points, chance)
    errors = seen_table(errors, camera, T_world_table)
    if view.ignore is not None:
        regions = tuple(one for one in regions if (one.mask & view.ignore).sum() <= 0.5 * one.mask.sum())
    edges = map_edges(points)
    costs = edge_costs(edges, chance)
    return Shot(camera, T_camera_table, errors, points, edges, chance, tuple(regions), costs)


def _alone(regions: Sequence[Region], points: EdgePoints, chance: FloatArray) -> tuple[Region, ...]:
    """Return the regions with enough rare edges for an object, their own or those beside them, and the largest.

    Texture makes many regions of few edges. The edges around one region count for no further one, unless they are its
    own.

    Args:
        regions: regions of the image, largest first.
        points: edge points of the image.
        chance: probability of a random edge like each ``(n,)``.
    """
    kept: list[Region] = []
    covered = np.zeros(points.shape, dtype=np.bool_)
    for region in regions:
        near = surroundings(region)
        own, beside = (
            edge_information(points, chance, mask) >= EVIDENCE.least_object
            for mask in (dilated(region.mask), near & ~covered)
        )
        if own or not kept or beside:
            kept.append(region)
            covered |= near
    return tuple(kept)


def in_others(sight: Sight, others: Sequence[tuple[Camera, EdgePoints]]) -> tuple[Sight, ...]:
    """Return the objects of a result in other images, with poses in their cameras, to draw them."""
    out = []
    for camera, points in others:
        T = SE3.inverse(standing(camera)) @ sight.T_world_camera
        moved = [
            tuple(replace(mode, T_camera_part=T @ mode.T_camera_part) for mode in seen.modes) for seen in sight.objects
        ]
        objects = [replace(seen, modes=modes, region=None) for seen, modes in zip(sight.objects, moved, strict=True)]
        out.append(Sight(tuple(objects), points, standing(camera), sight.frame))
    return tuple(out)


def _explained(objects: Sequence[Sighting], region: Region | None, camera: Camera, shot: Shot) -> bool:
    """Return whether recognized parts explain most edges of a region: those of a shadow or of a face are not searched.

    Args:
        objects: objects so far.
        region: region of the first image; None for an object of another image.
        camera: camera of the first image.
        shot: the first image.
    """
    explained = np.zeros(shot.points.shape, dtype=np.bool_)
    for seen in objects:
        if seen.answer.status == "recognized":
            explained |= _explains(seen, camera)
    if region is None or not explained.any():
        return False
    own = dilated(region.mask)
    left = edge_information(shot.points, shot.chance, own & ~explained)
    return 2 * left < edge_information(shot.points, shot.chance, own)


def _explains(seen: Sighting, camera: Camera) -> BoolArray:
    """Return the pixels whose edges a part explains: its own, and those of its region, with the shadow beside it."""
    covers = silhouette(seen.modes[0].model.frame.surface, camera, seen.modes[0].T_camera_part)
    return dilated(covers if seen.region is None else covers | seen.region.mask)


def separate(objects: Sequence[Sighting], camera: Camera, points: EdgePoints, chance: FloatArray) -> list[Sighting]:
    """Return the objects whose edges no better object explains, largest first.

    Shadows, texture and faces of one part may make several regions. The most probable part explains the edges that it
    covers; a region without enough rare edges of its own is no object.

    Args:
        objects: one sighting for each region, largest region first.
        camera: camera of the image.
        points: edge points of the image.
        chance: probability of a random edge like each ``(n,)``.
    """
    kept: list[tuple[int, Sighting]] = []
    explained = np.zeros(points.shape, dtype=np.bool_)
    known = [sum(mode.probability for mode in seen.modes) for seen in objects]
    for k in sorted(range(len(objects)), key=lambda k: (-known[k], k)):
        seen = objects[k]
        covers = np.zeros(points.shape, dtype=np.bool_) if seen.region is None else seen.region.mask
        if known[k] > 0.5:
            covers = silhouette(seen.modes[0].model.frame.surface, camera, seen.modes[0].T_camera_part)
        information = edge_information(points, chance, dilated(covers) & ~explained)
        left = edge_information(points, chance, dilated(covers))
        if 2 * information < left or (known[k] <= 0.5 and information < EVIDENCE.least_object):
            continue
        kept.append((k, seen))
        if known[k] > 0.5:
            explained |= _explains(seen, camera)
    return [seen for _, seen in sorted(kept, key=lambda one: one[0])]


def of_objects(objects: Sequence[Sighting], camera: Camera) -> BoolArray:
    """Return the pixels of the best answer of each object, or of its region ``(rows, columns)``."""
    mask = np.zeros(camera.size[::-1], dtype=np.bool_)
    for seen in objects:
        if seen.modes:
            mask |= silhouette(seen.modes[0].model.frame.surface, camera, seen.modes[0].T_camera_part)
        elif seen.region is not None:
            mask |= seen.region.mask
    return dilated(mask)


def with_rims(seen: Sighting, camera: Camera, ellipses: Ellipses) -> Sighting:
    """Return a sighting with the names of the ellipses that are rims of its best answer."""
    if not seen.modes:
        return seen
    best = seen.modes[0]
    return replace(seen, rims=name_ellipses(camera, ellipses.found, best.model.part, best.T_camera_part))


def outline_on_table(camera: Camera, region: Region, T_camera_table: Transforms) -> Descriptors | None:
    """Return descriptors of the outline of a region on the table [m]; None if the region leaves the table."""
    points, beside = (
        on_plane(camera, pixels, T_camera_table)[:, :2] for pixels in (region.contour, region.contour + region.normals)
    )
    if not np.all(np.isfinite(points)):
        return None
    scale = np.linalg.norm(beside - points, axis=1)
    return describe(points, (beside - points) / scale[:, None], region.sds * scale, EDGES.bias * float(scale.mean()))


def area_of(region: Region, camera: Camera, T_camera_table: Transforms) -> float:
    """Return the area of a region on the table [m^2], by the size of a pixel in its middle."""
    corners = region.centre + np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    a, b, c = on_plane(camera, corners, T_camera_table)[:, :2]
    pixel = abs(float((b - a)[0] * (c - a)[1] - (b - a)[1] * (c - a)[0]))
    return float(region.mask.sum()) * (pixel if np.isfinite(pixel) else 1.0)


def sighting(
    posterior: ImagePosterior, images: Sequence[ImageEdges], region: Region | None, T_world_table: Transforms, top: int
) -> Sighting:
    """Return the answer of a posterior of images of an object on a table; poses are in the first camera.

    Args:
        posterior: posterior of the object.
        images: edges of the images, all of them.
        region: region of the object in the first image.
        T_world_table: frame of the table ``(4, 4)``.
        top: number of hypotheses.
    """
    camera = images[0].camera
    hypotheses, modes = stated(posterior, images, camera, top, lying=True)
    status, findings = judged(hypotheses, posterior)
    question = _question(modes, T_world_table, standing(camera))
    if status == "ambiguous" and question is not None:
        findings = (question.finding,)
    answer = Answer(status, findings, hypotheses, posterior.unknown)
    return Sighting(answer, modes, question, region)


def _question(modes: Sequence[ImageMode], T_world_table: Transforms, T_world_camera: Transforms) -> Question | None:
    """Return the touch that decides between the best answer and the most probable one with another surface."""
    T_table_camera = SE3.inverse(T_world_table) @ T_world_camera
    answers = [
        (mode.model.part.name, mode.model.frame.surface, T_table_camera @ mode.T_camera_part)
        for mode in modes
        if mode.probability > EVIDENCE.missed
    ]
    for other in answers[1:]:
        question = deciding_touch(answers[0], other, T_world_table)
        if question is not None:
            return question
    return None
