"""Images of the object of readings, as factors of one posterior with the readings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tanteo.geometry.typing import Transforms, Vectors
from tanteo.parts import Part
from tanteo.posterior import Priors
from tanteo.vision.camera import View
from tanteo.vision.edges import find_edges
from tanteo.vision.image_edges import ImageEdges, Weights
from tanteo.vision.outlines import region_of_readings
from tanteo.vision.posterior import levelled
from tanteo.vision.shots import image_candidates
from tanteo.vision.sight import prepared, shot_of
from tanteo.vision.solid import proposed_anywhere
from tanteo.vision.table import TableErrors


def view_factors(
    views: Sequence[View],
    points: Vectors,
    parts: Sequence[Part],
    priors: Priors,
    *,
    T_world_table: Transforms | None = None,
) -> tuple[ImageEdges, ...]:
    """Return views of the object of readings as factors of one posterior.

    The images propose poses of parts; the factors hold whether a part lies on a table or not.

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
    if all(view.on_table for view in views):
        shots, regions = [], []
        for view in views:
            shot = shot_of(view, parts, T_world_table, TableErrors())
            region, _, _ = region_of_readings(view.pixels, view.camera, points, shot.points)
            regions.append(region)
            shots.append(shot)
        images, own = image_candidates(models, shots, regions)
        proposed = {model.part: own[id(model)] for model in models if id(model) in own}
    else:
        edges = [find_edges(view.pixels) for view in views]
        for view, found in zip(views, edges, strict=True):
            region_of_readings(view.pixels, view.camera, points, found)
        images, poses, _ = proposed_anywhere(views, edges, models, Weights())
        proposed = {model.part: Ts for model, Ts in poses}
    suggested = [(part, np.ascontiguousarray(proposed.get(part, np.zeros((0, 4, 4))))) for part in parts]
    first, *others = levelled(images, suggested, priors)
    return replace(first, proposed=dict(suggested)), *others
