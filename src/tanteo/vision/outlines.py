"""Outlines of resting parts from straight above, computed once from the CAD, and which of them a region is like.

A first look, as the paper's vision system takes it: it knows nothing of perspective, shadows and what is in the way, so
it ranks and decides nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from tanteo.lie import SE3
from tanteo.shapes import Surface
from tanteo.vision.cv import opencv
from tanteo.vision.descriptors import NAMES, Descriptors, describe
from tanteo.vision.resting import Rest

if TYPE_CHECKING:
    from tanteo.vision.models import VisionModel

_ACROSS = 600
"""Pixels of the drawing across the part."""

_COMPARED = ("area", "perimeter", "long_axis", "short_axis")

SLACK = 0.1
"""Relative error of lengths that perspective and shadows make."""


def outline_from_above(surface: Surface, rest: Rest) -> Descriptors:
    """Descriptors [m] of the silhouette of a part at rest, seen from straight above; holes are filled.

    Args:
        surface: of the part.
        rest: how it lies.
    """
    cv2 = opencv()
    flat = SE3.apply(rest.T_table_part, surface.vertices)[:, :2]
    low = flat.min(axis=0)
    step = float(np.ptp(flat, axis=0).max()) / _ACROSS
    up = SE3.apply(rest.T_table_part[:3, :3], surface.normals)[:, 2] > 0
    scaled = (flat - low) / step + 2.0
    mask = np.zeros((_ACROSS + 5, _ACROSS + 5), dtype=np.uint8)
    for polygon in np.rint(scaled[surface.triangles[up]] * 16).astype(np.int32):
        cv2.fillConvexPoly(mask, polygon, 1, lineType=cv2.LINE_8, shift=4)
    found, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_TC89_KCOS)
    points = max(found, key=cv2.contourArea)[:, 0].astype(np.float64)
    tangents = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
    tangents /= np.maximum(np.linalg.norm(tangents, axis=1, keepdims=True), 1e-9)
    normals = np.stack([tangents[:, 1], -tangents[:, 0]], axis=1)
    return describe((points - 2.0) * step + low, normals, np.full(len(points), 0.5 * step))


def like_outline(
    outline: Descriptors, models: Sequence[VisionModel], slack: float = SLACK
) -> list[tuple[VisionModel, int, float]]:
    """Parts and stable poses by how like their outlines are to one on the table, the likest first.

    Area, perimeter and axes are compared as logarithms, with the covariance of the outline and a relative slack.

    Args:
        outline: of a region, on the table [m].
        models: the parts.
        slack: relative standard deviation of lengths.

    Returns:
        Part, number of its stable pose, squared distance in standard deviations (four degrees of freedom).
    """
    rows = [NAMES.index(name) for name in _COMPARED]
    powers = np.array([2.0, 1.0, 1.0, 1.0])
    relative = outline.covariance[np.ix_(rows, rows)] / np.outer(outline.values[rows], outline.values[rows])
    # one error of scale, which all share, and one of each
    S = relative + slack**2 * (0.5 * np.outer(powers, powers) + 0.5 * np.diag(powers**2))
    out = []
    for model in models:
        for k, known in enumerate(model.outlines):
            gap = np.log(outline.values[rows] / known.values[rows])
            out.append((model, k, float(gap @ np.linalg.solve(S, gap))))
    return sorted(out, key=lambda row: row[2])
