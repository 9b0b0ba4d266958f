"""Several images of one scene: which regions show the same object, and the poses that all images support."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import astuple, dataclass, field, replace

import numpy as np

from tanteo.geometry import SE3
from tanteo.geometry.typing import FloatArray, IntArray, Transforms
from tanteo.posterior import DEFAULTS
from tanteo.vision.camera import Camera, on_plane, opencv
from tanteo.vision.candidates import PoseCandidates, candidates_in
from tanteo.vision.edges import EdgeMap, EdgePoints
from tanteo.vision.image_edges import ImageEdges, Weights, standing
from tanteo.vision.models import VisionModel
from tanteo.vision.regions import Region
from tanteo.vision.table import TableErrors


@dataclass(frozen=True, slots=True, eq=False)
class Shot:
    """One image of a table: what is found in it before parts are compared.

    Attributes:
        camera: its camera.
        T_camera_table: frame of the table ``(4, 4)``.
        errors: errors of the table in the camera's frame.
        points: edge points.
        edges: map of the edge points.
        chance: probability of a random edge like each ``(n,)``.
        regions: regions of objects, largest first.
        costs: costs of edge samples, of :func:`tanteo.vision.propose.edge_costs`.
        proposed: edges and poses by region and parts; empty before they are computed.
        image: the edges as a factor, of no region.
    """

    camera: Camera
    T_camera_table: Transforms
    errors: TableErrors
    points: EdgePoints
    edges: EdgeMap
    chance: FloatArray
    regions: tuple[Region, ...]
    costs: np.ndarray
    proposed: dict[Hashable, tuple[ImageEdges, list[PoseCandidates]]] = field(default_factory=dict)
    image: ImageEdges = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "image", ImageEdges(self.camera, self.edges, self.chance))


def same_objects(shots: Sequence[Shot]) -> list[tuple[Region | None, ...]]:
    """Return the objects on the table: for each one its region in each image, or None where it has no region.

    Regions of two images show one object if their outlines overlap on the plane of the table, the largest overlap
    first. Outlines of high parts are shifted there by the perspective, but their feet overlap.
    """
    objects: list[list[Region | None]] = [[region] for region in shots[0].regions]
    places = [_footprint(shots[0], region) for region in shots[0].regions]
    for count, shot in enumerate(shots[1:], start=1):
        prints = [_footprint(shot, region) for region in shot.regions]
        areas = np.array([[_overlap(one, place) for place in places] for one in prints]).reshape(
            len(prints), len(places)
        )
        matched: dict[int, int] = {}
        for flat in np.argsort(-areas, axis=None, kind="stable"):
            row, column = divmod(int(flat), len(places))
            if areas[row, column] <= 0:
                break
            if column not in matched and row not in matched.values():
                matched[column] = row
        for column, regions in enumerate(objects):
            regions.append(shot.regions[matched[column]] if column in matched else None)
        for row, region in enumerate(shot.regions):
            if row not in matched.values():
                objects.append([*(None,) * count, region])
                places.append(prints[row])
    return [tuple(regions) for regions in objects]


def _footprint(shot: Shot, region: Region) -> FloatArray | None:
    """Return the convex hull of a region on the table ``(n, 2)`` [m]; None if the region leaves the table."""
    at = on_plane(shot.camera, region.contour, shot.T_camera_table)[:, :2]
    if not np.all(np.isfinite(at)):
        return None
    return np.asarray(opencv().convexHull(at.astype(np.float32))[:, 0])


def _overlap(one: FloatArray | None, other: FloatArray | None) -> float:
    """Return the area that two convex outlines have in common [m^2]."""
    if one is None or other is None:
        return 0.0
    return float(opencv().intersectConvexConvex(one, other)[0])


def image_candidates(
    models: Sequence[VisionModel],
    shots: Sequence[Shot],
    regions: Sequence[Region | None],
    ways: Sequence[IntArray] = (),
    weights: Weights | None = None,
) -> tuple[tuple[ImageEdges, ...], dict[int, Transforms]]:
    """Return the images of an object as factors, and poses of each part that any of them proposes.

    Every image proposes poses in its region of the object, and rates those of the others. An unknown object has the
    edges that the best pose explains.

    Args:
        models: candidate parts.
        shots: images, all of one table.
        regions: region of the object in each.
        ways: numbers of the stable poses of each part that are tried; all of them if not given.
        weights: weights of the evidence.

    Returns:
        The edges of each image, and poses ``T_world_part`` by the id of the prepared part.
    """
    images, proposed = [], dict[int, list[tuple[Transforms, FloatArray]]]()
    for shot, region in zip(shots, regions, strict=True):
        image = replace(shot.image, weights=weights or Weights())
        if region is not None:
            key = id(region), astuple(image.weights), tuple(map(id, models)), tuple(own.tobytes() for own in ways)
            if key not in shot.proposed:
                place = shot.T_camera_table, region, shot.costs, shot.errors
                shot.proposed[key] = candidates_in(models, image, *place, ways)
            image, found = shot.proposed[key]
            for one in found:
                prior = np.log([one.model.rests[k].probability for k in one.rests])
                proposed.setdefault(id(one.model), []).append((standing(shot.camera) @ one.T_camera_part, prior))
        images.append(image)
    own = {
        key: (np.concatenate([T for T, _ in all_]), np.concatenate([p for _, p in all_]))
        for key, all_ in proposed.items()
    }
    if len(shots) == 1 or not own:
        return tuple(images), {key: Ts for key, (Ts, _) in own.items()}
    return jointly(images, [(model, *own[id(model)]) for model in models if id(model) in own], unknown=True)


def jointly(
    images: Sequence[ImageEdges],
    proposals: Sequence[tuple[VisionModel, Transforms, FloatArray]],
    *,
    unknown: bool = True,
) -> tuple[tuple[ImageEdges, ...], dict[int, Transforms]]:
    """Return images of an object with the log density of an unknown object, and the poses that all of them support.

    Args:
        images: edges of the images.
        proposals: parts with poses ``T_world_part`` ``(k, 4, 4)`` and their log prior probabilities ``(k,)``.
        unknown: whether an unknown object has the edges that the best pose explains; if not, its log densities stay.
    """
    logs = []
    for model, Ts, prior in proposals:
        every = [image.sums(model, SE3.inverse(standing(image.camera)) @ Ts).there for image in images]
        logs.append(np.sum(every, axis=0) + prior)
    model, Ts, _ = proposals[max(range(len(logs)), key=lambda k: float(logs[k].max(initial=-np.inf)))]
    best = Ts[int(np.argmax(max(logs, key=lambda log: float(log.max(initial=-np.inf)))))]
    if unknown:
        images = [image.with_unknown(model, SE3.inverse(standing(image.camera)) @ best) for image in images]
    top = max(float(log.max()) for log in logs)
    kept = {}
    for (model, Ts, _), log in zip(proposals, logs, strict=True):
        rows = np.flatnonzero((log > top - DEFAULTS.search.drop_gap) | (log == log.max()))
        kept[id(model)] = np.ascontiguousarray(Ts[rows])
    return tuple(images), kept
