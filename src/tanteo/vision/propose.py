"""Pose proposals of a part on the table: each stable pose at each yaw, translated until its edges fall on edges.

A small table has the distances to edges by direction (chamfer matching; Barrow and others 1977, Shotton and
others 2008). The edges of a part are drawn once for each yaw, in the middle of the region. Refinement corrects the
perspective.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo import _core
from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import FloatArray, IntArray, Transforms
from tanteo.vision.camera import Camera, meet_plane, rays
from tanteo.vision.edges import EdgeMap, map_edges
from tanteo.vision.models import VisionModel
from tanteo.vision.regions import Region, surroundings
from tanteo.vision.settings import EDGES, EVIDENCE, SEARCH


@dataclass(frozen=True, slots=True, eq=False)
class Proposal:
    """Pose proposals of one part in one region.

    Attributes:
        T_camera_part: poses ``(k, 4, 4)``.
        rests: number of the stable pose of each ``(k,)``.
        costs: mean cost of edge samples of the part ``(k,)`` [px].
    """

    T_camera_part: Transforms
    rests: IntArray
    costs: FloatArray


def edge_costs(edges: EdgeMap, chance: FloatArray) -> np.ndarray:
    """Return costs of edge samples on a coarse grid with a margin ``(channels, rows, columns)``, single precision.

    A sample on an edge that is as rare as possible has the cost 0. The cost grows with the distance up to a cap, which
    is the cost of a sample without an edge. An edge with the chance ``c`` reduces the cost by ``log c / log c_rarest``
    times as much. Where edges of other objects are frequent, those of the part are, too, and still count.

    Args:
        edges: map of all edge points of the image.
        chance: probability of a random edge like each edge point ``(n,)``.
    """
    cap, cell = EVIDENCE.shortest, EDGES.cell
    # a rare edge may lie beyond a frequent one
    maps = (edges, map_edges(edges.points, chance < EVIDENCE.rare))
    evidence = np.append(np.log(chance) / np.log(EVIDENCE.rarest), 0.0)
    saved = [
        evidence[one.nearest[:, ::cell, ::cell]] * (cap - np.minimum(one.distances[:, ::cell, ::cell], cap))
        for one in maps
    ]
    costs = (cap - np.maximum(*saved)).astype(np.float32)
    margin = _margin(edges.points.shape)
    return np.pad(costs, ((0, 0), (margin, margin), (margin, margin)), constant_values=cap)


def _margin(shape: tuple[int, ...]) -> int:
    """Return the margin of the grid about an image, as wide as the image is high or wide at least [cells]."""
    return min(shape) // EDGES.cell


@dataclass(frozen=True, slots=True, eq=False)
class Slides:
    """Possible places of the centre of a part in a region: a grid over its pixels.

    Attributes:
        pixels: places ``(S, 2)`` [px].
        rays: rays through the places ``(S, 3)``, camera frame, z = 1.
        middle: number of the place nearest to the centre of the region.
    """

    pixels: FloatArray
    rays: FloatArray
    middle: int


def _step() -> int:
    """Return the step by which a part is moved over a region [px]: the cap of distances."""
    return int(EVIDENCE.shortest)


def slides(region: Region, camera: Camera) -> Slides:
    """Return the places of a region to which parts are translated.

    Args:
        region: region of an object.
        camera: camera of the image.
    """
    near = surroundings(region)
    rows, columns = np.nonzero(near)
    x, y = np.meshgrid(
        np.arange(columns.min(), columns.max() + 1, _step()), np.arange(rows.min(), rows.max() + 1, _step())
    )
    on = near[y, x]
    pixels = np.stack([x[on], y[on]], axis=-1).astype(np.float64)
    middle = int(np.argmin(np.linalg.norm(pixels - region.centre, axis=1))) if len(pixels) else 0
    return Slides(pixels, rays(camera, pixels), middle)


def propose(
    model: VisionModel,
    ways: IntArray,
    camera: Camera,
    T_camera_table: Transforms,
    costs: np.ndarray,
    places: Slides,
) -> Proposal:
    """Return pose proposals of a part in a region, the cheapest ones of the stable poses in ``ways``.

    Args:
        model: part.
        ways: numbers of the stable poses that are tried.
        camera: camera of the image.
        T_camera_table: frame of the table ``(4, 4)``.
        costs: costs of edge samples, of :func:`edge_costs`.
        places: places to which the part is moved.
    """
    found = []
    if not len(places.pixels):
        return Proposal(np.zeros((0, 4, 4)), np.zeros(0, dtype=np.int64), np.zeros(0))
    for k in ways.tolist():
        rest = model.rests[k]
        turned = SO3.axis_rotation(2, 2 * np.pi * np.arange(SEARCH.yaws) / SEARCH.yaws)
        Ts = SE3.from_parts(turned, np.zeros(3)) @ rest.T_table_part
        lift = float((Ts[0, :3, :3] @ model.part.centroid + Ts[0, :3, 3])[2])
        plane = T_camera_table @ SE3.from_parts(np.eye(3), np.array([0.0, 0.0, lift]))
        at = meet_plane(places.rays, plane)
        middle = at[places.middle]
        if not np.all(np.isfinite(at)):
            continue
        shifted = SE3.from_parts(np.eye(3), np.array([middle[0], middle[1], 0.0]))
        yaw, place, cost = _core.slide_edges(
            model.coarse.compiled, camera.numbers, T_camera_table @ shifted @ Ts, model.part.centroid, costs,
            places.pixels, EDGES.cell, _margin(camera.size), SEARCH.coarse, _step(), SEARCH.tried // 4,
        )  # fmt: skip
        move = SE3.from_parts(np.eye(3), np.concatenate([at[place, :2], np.zeros((len(place), 1))], axis=1))
        found.append((T_camera_table @ move @ Ts[yaw], np.full(len(yaw), k), cost))
    if not found:
        return Proposal(np.zeros((0, 4, 4)), np.zeros(0, dtype=np.int64), np.zeros(0))
    poses, which, sums = (np.concatenate(column) for column in zip(*found, strict=True))
    best = np.argsort(sums, kind="stable")[: SEARCH.tried]
    return Proposal(poses[best], which[best], sums[best])
