"""Data of the drawing of a report: parts, readings, beams, distances and overlays, world frame [mm]."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tanteo.geometry.typing import FloatArray, IntArray, Transforms, Vectors
from tanteo.parts import Part
from tanteo.posterior import Hypothesis
from tanteo.render.html.contacts import Contacts, Sensed
from tanteo.render.html.part_drawn import draw_part
from tanteo.render.html.shapes import Shapes, shapes_of
from tanteo.render.html.ways import Way
from tanteo.render.html.words import MM

_ARM = 0.14
"""Length of a beam with unknown origin, and largest drawn distance, as a fraction of the part's size."""

MOST_READINGS = 4000
"""Largest number of drawn readings."""


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """Hypothesis with the data that a report shows.

    Attributes:
        hypothesis: hypothesis of the answer.
        part: part of the hypothesis.
        contacts: residuals of the readings for the hypothesis.
        ways: principal errors of the pose.
        enlarged: magnification of the overlays in ``ways``.
    """

    hypothesis: Hypothesis
    part: Part
    contacts: Contacts
    ways: tuple[Way, ...]
    enlarged: int


def shapes_shown(candidates: Sequence[Candidate], sensed: Sensed) -> Shapes:
    """Return the features of labelled readings, magnified for the size of the best hypothesis' part.

    Args:
        candidates: hypotheses, best first.
        sensed: readings of the answer.
    """
    return shapes_of(sensed.measured, _extent(candidates, sensed.measured.points)[1], sensed.tolerance)


def scene_document(candidates: Sequence[Candidate], sensed: Sensed, shapes: Shapes) -> dict[str, Any]:
    """Return all data of the drawing; world coordinates are relative to its ``centre``.

    Args:
        candidates: hypotheses, best first.
        sensed: readings of the answer.
        shapes: features of labelled readings.
    """
    measured = sensed.measured
    centre, size = _extent(candidates, measured.points)
    parts = list(dict.fromkeys(c.part.name for c in candidates))
    shown = {c.part.name: c.part for c in candidates}
    rows = _chosen_rows(len(measured), candidates)
    reach = sensed.reach.filled(_ARM * size)
    starts = measured.points - np.nan_to_num(measured.directions) * reach[:, None]
    free = measured.free
    ends = free.origins + free.directions * free.lengths[:, None]
    return {
        **view_document(centre, size),
        "seen": packed(_seen(candidates, measured.points) - centre),
        "parts": [part_document(shown[name], len(parts)) for name in parts],
        "readings": {
            "names": [measured.ids[i] for i in rows],
            "labels": [measured.features[i] for i in rows],
            "points": packed((measured.points - centre)[rows]),
            "radii": packed(measured.radii[rows]),
            "starts": packed((starts - centre)[rows]),
        },
        "features": {
            "names": list(shapes.names),
            "lines": packed(shapes.lines - centre),
            "off": packed(shapes.off - centre),
        },
        "free": packed(np.stack([free.origins - centre, ends - centre], axis=1)[:MOST_READINGS]),
        "hypotheses": [_hypothesis(c, parts.index(c.part.name), centre, rows, measured.points) for c in candidates],
    }


def _chosen_rows(n: int, candidates: Sequence[Candidate]) -> IntArray:
    """Return the rows of the readings to draw: all, or a regular selection and outliers of the best hypothesis."""
    if n <= MOST_READINGS:
        return np.arange(n)
    wrong = np.flatnonzero(~candidates[0].contacts.used) if candidates else np.zeros(0, dtype=np.int64)
    even = np.linspace(0, n - 1, MOST_READINGS // 2).astype(np.int64)
    return np.unique(np.concatenate([even, wrong[: MOST_READINGS // 2]]))


def _extent(candidates: Sequence[Candidate], points: FloatArray) -> tuple[FloatArray, float]:
    """Return centre and size of the best hypothesis' part, or of the readings."""
    if candidates:
        best = candidates[0]
        T, box = best.hypothesis.T_world_part, best.part.box
        return T[:3, :3] @ box.mean(axis=0) + T[:3, 3], best.part.diagonal
    if not len(points):
        return np.zeros(3), 0.1
    low, high = points.min(axis=0), points.max(axis=0)
    return 0.5 * (low + high), max(float(np.linalg.norm(high - low)), 1e-3)


_DIRECTIONS = 64
"""Number of directions in which the farthest vertices of a part frame the view."""


def _seen(candidates: Sequence[Candidate], points: FloatArray) -> FloatArray:
    """Return points that the view must contain, of the best hypothesis' part or of the readings ``(k, 3)`` [m]."""
    if not candidates:
        return points if len(points) else 0.05 * np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]])
    best = candidates[0]
    z = 1 - 2 * (np.arange(_DIRECTIONS) + 0.5) / _DIRECTIONS
    azimuth = np.pi * (1 + 5**0.5) * np.arange(_DIRECTIONS)
    directions = np.stack([np.cos(azimuth) * np.sqrt(1 - z**2), np.sin(azimuth) * np.sqrt(1 - z**2), z])
    vertices = best.part.vertices
    farthest = vertices[np.unique(np.argmax(vertices @ directions, axis=0))]
    T = best.hypothesis.T_world_part
    return np.asarray(farthest @ T[:3, :3].T + T[:3, 3])


def view_document(centre: Vectors, size: float) -> dict[str, Any]:
    """Return centre and size of the view as data of the drawing.

    Args:
        centre: centre of the view, world frame ``(3,)`` [m].
        size: size of the view [m].
    """
    return {"centre_mm": [float(v) for v in centre * MM], "size_mm": float(size * MM)}


def part_document(part: Part, count: int) -> dict[str, Any]:
    """Return a part as data of the drawing.

    Args:
        part: part to draw.
        count: number of parts on the page.
    """
    drawn = draw_part(part, count)
    return {
        "name": part.name,
        "vertices": packed(drawn.vertices),
        "triangles": base64_of(drawn.triangles.astype("<u4")),
        "lines": packed(drawn.lines),
        "coarse": drawn.coarse,
    }


def _hypothesis(
    candidate: Candidate, part: int, centre: FloatArray, rows: IntArray, points: FloatArray
) -> dict[str, Any]:
    contacts = candidate.contacts
    size = candidate.part.diagonal
    enlarged = distance_enlarged(candidate)
    away = points - contacts.feet
    away /= np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-12)
    drawn = np.clip(np.abs(contacts.distances) * enlarged, 0.0, _ARM * size)
    sticks = np.stack([contacts.feet, contacts.feet + away * drawn[:, None]], axis=1) - centre
    return {
        "part": part,
        "pose": pose_numbers(candidate.hypothesis.T_world_part, centre),
        "met": [contacts.faces[i] for i in rows],
        "off_mm": [round(float(contacts.distances[i]) * MM, 5) for i in rows],
        "sd_mm": [round(float(contacts.sds[i]) * MM, 5) for i in rows],
        "wrong": [int(not contacts.used[i]) for i in rows],
        "sticks": packed(sticks[rows]),
        "overlays": overlay_numbers(candidate.ways, centre),
    }


def distance_enlarged(candidate: Candidate) -> int:
    """Return the magnification of the drawn distances to the surface, 1, 2, 5, 10, ....

    With it the distances of fitting readings are at most 6 % of the size of the part.

    Args:
        candidate: hypothesis with the residuals.
    """
    contacts = candidate.contacts
    fitting = np.abs(contacts.distances[contacts.used])
    wanted = 0.06 * candidate.part.diagonal / max(float(fitting.max(initial=0.0)), 1e-9)
    return max((m * 10**e for e in range(4) for m in (1, 2, 5) if m * 10**e <= wanted), default=1)


def pose_numbers(T: Transforms, centre: Vectors) -> list[float]:
    """Return the 16 numbers of a pose by columns, with the position relative to the centre [mm].

    Args:
        T: pose, world frame ``(4, 4)`` [m].
        centre: centre of the view, world frame ``(3,)`` [m].
    """
    M = np.array(T)
    M[:3, 3] = (M[:3, 3] - centre) * MM
    return [round(float(v), 9) for v in M.T.ravel()]


def packed(metres: FloatArray) -> str:
    """Return lengths in metres as base64 text of 32-bit floats in millimetres.

    Args:
        metres: lengths [m].
    """
    return base64_of((np.asarray(metres) * MM).astype("<f4"))


def base64_of(array: np.ndarray) -> str:
    """Return the bytes of an array as base64 text.

    Args:
        array: array of the type that the script of the page expects.
    """
    return base64.b64encode(np.ascontiguousarray(array).tobytes()).decode("ascii")


def overlay_numbers(ways: Sequence[Way], centre: Vectors) -> list[list[list[list[float]]]]:
    """Return the poses of the overlays, nested by principal error, level and sign.

    Args:
        ways: principal errors of the pose.
        centre: centre of the view, world frame ``(3,)`` [m].
    """
    return [[[pose_numbers(T, centre) for T in level] for level in way.Ts_world_part] for way in ways]
