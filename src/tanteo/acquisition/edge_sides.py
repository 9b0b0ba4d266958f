"""Whether what was met beside an edge is as it has to be: the face up to it, and nothing of the face right beyond it.

Three places of three edges are on one line by chance now and then, and then control each other. What the crossings met
between these places tells: there the face ends before that line, or goes on beyond it.
"""

from __future__ import annotations

import numpy as np

from tanteo.acquisition.cloud import Cloud, cloud_of
from tanteo.acquisition.session import Session
from tanteo.features import Feature
from tanteo.typing import FloatArray, Vectors

_SPOT, _PLACE = 1.2, 1e-3
"""Within so many radii of its spot, and so far more [m], a beam beside an edge may meet the face or miss it."""

_BEFORE, _BEYOND, _LEAST = 3.0, 2.0, 2e-3
"""A crossing takes care of so many radii before an edge and beyond it, and so far more [m]: farther off there may be
another edge of the same face."""

_DROP = 0.15
"""A range that is longer by this share of the stand-off is off the face."""

_OFTEN = 3
"""Beams that speak against an edge, one of which may be by chance."""


def against(session: Session, face: Feature, edge: Feature, crossed: Vectors, outwards: FloatArray) -> str:
    """What the crossings met that cannot be beside an edge of a face; empty if all can be.

    Args:
        session: The acquisition.
        face: As sensed.
        edge: As made of events.
        crossed: Where these were ``(n, 3)`` [m].
        outwards: Out of the face, across the edge ``(3,)``.
    """
    cloud = cloud_of(session.hand, [m for m in session.motions if m.name == "cross edge"])
    cloud = cloud.keep(cloud.ahead)
    foot, way = _on_face(cloud, face)
    spot, slack = way * cloud.slopes, np.maximum(_DROP * session.standoff, 6 * cloud.sds)
    met = cloud.met & (np.abs(cloud.ranges - way) < slack)
    missed = ~cloud.met | (cloud.ranges > way + slack)
    origin, along = edge.T_world_feature[:3, 3], edge.T_world_feature[:3, 0]
    x, y, places = (foot - origin) @ along, (foot - origin) @ outwards, (crossed - origin) @ along
    between = (x > places.min() + spot) & (x < places.max() - spot)
    clear = between & (np.abs(y) > _SPOT * spot + _PLACE)
    ends = clear & missed & (y < 0) & (-y < _BEFORE * spot + _LEAST)
    goes_on = clear & met & (y > 0) & (y < _BEYOND * spot + _LEAST)
    for wrong, words in ((ends, "ends before that line"), (goes_on, "goes on beyond that line")):
        if np.count_nonzero(wrong) >= _OFTEN:
            return f"what was crossed is not one edge: between the places where it was met the face {words}"
    return ""


def _on_face(cloud: Cloud, face: Feature) -> tuple[Vectors, FloatArray]:
    """Where the axes of the beams meet a plane ``(n, 3)``, and after which way ``(n,)`` [m]."""
    point, normal = face.T_world_feature[:3, 3], face.T_world_feature[:3, 2]
    way = ((point - cloud.starts) @ normal) / np.minimum(cloud.beams @ normal, -1e-6)
    return cloud.starts + way[:, None] * cloud.beams, way
