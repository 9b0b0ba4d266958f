"""Images of the object of readings, as factors of one posterior with the readings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tanteo.geometry import SE3
from tanteo.geometry.typing import FloatArray, Transforms, Vectors
from tanteo.parts import Part
from tanteo.posterior import Priors
from tanteo.vision.camera import Camera
from tanteo.vision.candidates import candidates_in
from tanteo.vision.edges import chance_hits, find_edges, map_edges
from tanteo.vision.image_edges import ImageEdges, standing
from tanteo.vision.outlines import region_of_readings
from tanteo.vision.posterior import levelled
from tanteo.vision.regions import bare_table, hulls
from tanteo.vision.sight import check_place, prepared
from tanteo.vision.table import TableErrors, seen_table


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """One image and its camera.

    Attributes:
        pixels: grey levels from 0 to 255 ``(rows, columns)``; see :func:`tanteo.read_image`.
        camera: calibrated camera with its pose in the world of the readings (``T_world_camera``).
    """

    pixels: FloatArray
    camera: Camera


def view_factors(
    views: Sequence[View],
    points: Vectors,
    parts: Sequence[Part],
    priors: Priors,
    *,
    T_world_table: Transforms | None = None,
) -> tuple[ImageEdges, ...]:
    """Return views of the object of readings as factors of one posterior.

    The images propose poses of parts that lie on a table; the factors hold whether the part lies there or not.

    Args:
        views: images with their cameras.
        points: sensed points of the readings in the world ``(n, 3)`` [m].
        parts: candidates.
        priors: prior probabilities and scales, with the radius of the workspace.
        T_world_table: frame whose plane z = 0 is the table; the world if not given.

    Raises:
        InputError: the pose of a camera is unknown, or the readings or their object are not in its image.
    """
    T_world_table = np.eye(4) if T_world_table is None else T_world_table
    models = [prepared(part) for part in parts]
    images, proposed = [], dict[Part, list[Transforms]]()
    for view in views:
        edges = find_edges(view.pixels)
        region, _, _ = region_of_readings(view.pixels, view.camera, points, edges)
        T_camera_table = SE3.inverse(standing(view.camera)) @ T_world_table
        check_place(view.camera, T_camera_table, parts)
        image = ImageEdges(view.camera, map_edges(edges), chance_hits(edges))
        errors = seen_table(TableErrors(), view.camera, T_world_table)
        bare = bare_table(hulls([region]))
        image, candidates = candidates_in(models, image, T_camera_table, region, bare, errors)
        for found in candidates:
            Ts = standing(view.camera) @ found.T_camera_part
            proposed.setdefault(found.model.part, []).append(Ts)
        images.append(image)
    suggested = [(part, np.concatenate(proposed.get(part, [np.zeros((0, 4, 4))]))) for part in parts]
    first, *others = levelled(images, suggested, priors)
    poses = {part: np.ascontiguousarray(Ts) for part, Ts in suggested}
    return replace(first, proposed=poses), *others
