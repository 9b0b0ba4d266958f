"""What the picture of an undecided answer shows: faces where the hypotheses differ, and the next touch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tanteo.geometry import SE3
from tanteo.geometry.limits import NOTABLE
from tanteo.geometry.typing import BoolArray, IntArray
from tanteo.parts import Surface
from tanteo.posterior import Answer
from tanteo.render.html.scene import Candidate, base64_of, packed
from tanteo.render.html.words import MM
from tanteo.words.findings import NextTouch

_SDS, _SIZE = 3.0, 0.01
"""Numerical: distance from the other hypothesis beyond which a place differs: standard deviations of the farthest
corner, and fraction of the part's size."""

_INSIDE = np.array([[1, 1, 1], [4, 1, 1], [1, 4, 1], [1, 1, 4]]) / np.array([[3], [6], [6], [6]])
"""Numerical: barycentric coordinates of the places of a triangle that are compared."""

_MOST = 20_000
"""Numerical: largest number of triangles that are compared."""


@dataclass(frozen=True, slots=True, eq=False)
class Distinction:
    """Touch that an undecided answer lacks, and faces by which its hypotheses differ.

    Attributes:
        touch: next touch; None if the answer names none.
        faces: for each hypothesis, indices of the faces where the most probable other hypothesis has no surface; empty
            for a decided answer.
    """

    touch: NextTouch | None
    faces: tuple[IntArray, ...]


def distinction_of(answer: Answer, candidates: Sequence[Candidate]) -> Distinction:
    """Return what distinguishes the hypotheses of an answer.

    Args:
        answer: answer to report.
        candidates: hypotheses of the answer, best first.
    """
    touch = next((one for one in answer.findings if isinstance(one, NextTouch)), None)
    several = len(candidates) > 1 and candidates[1].hypothesis.probability > NOTABLE
    if not several or answer.status not in ("ambiguous", "insufficient"):
        return Distinction(touch, ())
    others = [candidates[1], *(candidates[0] for _ in candidates[1:])]
    return Distinction(touch, tuple(_faces(one, other) for one, other in zip(candidates, others, strict=True)))


def with_distinction(
    document: dict[str, Any], candidates: Sequence[Candidate], distinction: Distinction
) -> dict[str, Any]:
    """Return the data of the drawing with the next touch and the faces that differ.

    Args:
        document: data of the drawing.
        candidates: hypotheses of the answer, best first.
        distinction: what distinguishes the hypotheses.
    """
    touch, more = distinction.touch, dict[str, Any]()
    if touch is not None:
        ends = np.array([touch.start, touch.point]) - np.array(document["centre_mm"]) / MM
        more["next"] = {"start": packed(ends[0]), "point": packed(ends[1])}
    own = [
        {"differs": base64_of(c.part.triangles[np.isin(c.part.triangle_face, faces)].astype("<u4"))}
        if len(faces) and not document["parts"][one["part"]]["coarse"]
        else {}
        for one, c, faces in zip(document["hypotheses"], candidates, distinction.faces, strict=False)
    ]
    if own:
        more["hypotheses"] = [one | of_one for one, of_one in zip(document["hypotheses"], own, strict=True)]
    return document | more


def _faces(one: Candidate, other: Candidate) -> IntArray:
    """Return the faces of a hypothesis most of whose area is off the surface of another."""
    part = one.part
    if len(part.triangles) > _MOST or len(other.part.triangles) > _MOST:
        return np.zeros(0, dtype=np.int64)
    corners = part.vertices[part.triangles]
    places = np.einsum("pk,tki->tpi", _INSIDE, corners)
    T_other_one = SE3.inverse(other.hypothesis.T_world_part) @ one.hypothesis.T_world_part
    surface = Surface(other.part.vertices, other.part.triangles)
    off = surface.closest(SE3.apply(T_other_one, places.reshape(-1, 3))).distances.reshape(len(places), -1)
    sd = max(one.hypothesis.corner_sd, other.hypothesis.corner_sd)
    differs: BoolArray = off > max(_SDS * sd, _SIZE * part.diagonal)
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    whole = np.bincount(part.triangle_face, areas)
    own = np.bincount(part.triangle_face, areas * differs.mean(axis=1))
    return np.flatnonzero(own > 0.5 * whole)
