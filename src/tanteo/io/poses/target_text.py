"""Read a known target of a calibration from text: a plane, a ball, a point or a part, with pose and uncertainty."""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry import SE3
from tanteo.geometry.typing import FloatArray, Transforms, Vectors
from tanteo.io.documents.part_files import read_one
from tanteo.io.poses.pose_syntax import parse_pose
from tanteo.io.poses.prior_text import value_and_sd
from tanteo.io.readings.units import parse_length, parse_lengths, parse_lengths_angles
from tanteo.parts import Surface
from tanteo.parts.faces import exact_faces
from tanteo.parts.readers import is_unitless
from tanteo.parts.shapes.revolved import Revolved
from tanteo.sensors.calibration.targets import Ball, Flat, Point, Target

_FORMS = {
    "plane": "plane 0,0,0mm 0,0,0deg +- 0.2mm 0.1deg",
    "ball": "ball 12.7mm@400,200,50mm +- 0.1mm",
    "point": "point 400,200,0mm +- 0.1mm 0.2mm",
    "part": "part bracket.step@400,200,0mm 0,0,90deg +- 0.2mm 0.1deg",
}
"""Definition: examples of the accepted texts."""

_ANYWHERE = 1.0
"""Definition: standard deviation of a place that is not stated [m]."""

_REFINED = 3
"""Steps of Newton's method from a facet to the exact surface; the error is squared at each."""


@dataclass(frozen=True, slots=True, eq=False)
class PartSurface:
    """Surface of a part as a target.

    Attributes:
        surface: its mesh for rays.
        exact: its exact round faces; None for a part without.
    """

    surface: Surface
    exact: Revolved | None

    def cast(self, origins: Vectors, directions: Vectors) -> tuple[FloatArray, Vectors]:
        """Return the ranges of beams and outward normals where they hit the part.

        Args:
            origins: origins of the beams in the part frame ``(m, 3)`` [m].
            directions: unit directions ``(m, 3)``.
        """
        surface = self.surface
        hits = surface.cast(origins, directions)
        hit = np.isfinite(hits.distances)
        ranges, triangles = np.array(hits.distances), np.maximum(hits.triangles, 0)
        normals = np.array(surface.normals[triangles])
        hit &= np.sum(normals * directions, axis=1) < 0
        ranges = np.where(hit, ranges, 0.0)
        for _ in range(_REFINED):
            if self.exact is not None:
                off = np.zeros(len(ranges))
                self.exact.replace(origins + ranges[:, None] * directions, triangles, off, normals)
                ranges = ranges - off / np.minimum(np.sum(normals * directions, axis=1), -0.1)
        return np.where(hit, ranges, np.inf), normals


def parse_target(text: str, unit: str | None = None, name: str = "target") -> Target | None:
    """Return the known target of a text such as ``'ball 12.7mm@400,200,50mm +- 0.1mm'``.

    ``plane`` is the plane z = 0 of a pose, ``ball`` has a radius and a centre, ``point`` is where all beams are aimed,
    and ``part`` is a CAD file at a pose. After ``+-`` stand the standard deviations: of position and rotation, of the
    centre, or of position and aim. A ball or point without a place is found from the log.

    Args:
        text: target.
        unit: length unit of CAD formats that carry none; None if not needed.
        name: name of the input, for messages.

    Returns:
        The target; None for a plane without a pose, which any calibration finds.

    Raises:
        InputError: the text has another form.
        PartError: the file of the part cannot be read.
        UnitError: a unit is missing or unknown.
    """
    form, _, rest = text.strip().partition(" ")
    if form not in _FORMS:
        listed = "; ".join(_FORMS.values())
        raise InputError(f"{name}: expected a plane, ball, point or part, got '{text}'. Write it as one of: {listed}.")
    if form == "plane":
        return _posed(Flat(), rest, name, form) if rest.strip() else None
    if form == "part":
        path, _, where = rest.partition("@")
        needed = unit if is_unitless(os.path.splitext(path.strip())[1]) else None
        part = read_one(path.strip(), needed)
        mesh = Surface(part.vertices, part.triangles)
        return _posed(PartSurface(mesh, exact_faces(part, mesh.normals)), where, name, form)
    if form == "ball":
        size, _, where = rest.partition("@")
        radius = parse_length(size.strip(), name)
        if not radius > 0:
            raise InputError(f"{name}: expected a positive radius of the ball, got '{size}'. Write: {_FORMS[form]}.")
        T, sds = _place(where, name, form)
        return _centred(Ball(radius), T, sds[0], form)
    T, sds = _place(rest, name, form)
    return _centred(Point(sds[-1]), T, sds[0], form)


def _posed(surface: Flat | PartSurface, text: str, name: str, form: str) -> Target:
    """Return a target with position and rotation."""
    pose, spread = value_and_sd(text, name, _FORMS[form])
    lengths, angles = parse_lengths_angles(spread, name)
    if len(lengths) != 1 or len(angles) != 1 or min(*lengths, *angles) < 0:
        raise InputError(f"{name}: expected one length and one angle after +-, got '{spread}'. Write: {_FORMS[form]}.")
    sds = np.repeat([lengths[0], angles[0]], 3)
    return Target(surface, parse_pose(pose, name), np.diag(sds**2), form)


def _place(text: str, name: str, form: str) -> tuple[Transforms | None, list[float]]:
    """Return the pose of a target without attitude, None for an unknown one, and the lengths after ``+-``."""
    if not text.strip() and form == "ball":
        return None, [_ANYWHERE]
    if text.strip().startswith("+-") and form == "point":
        return None, [_ANYWHERE, *_lengths(text.strip()[2:], name, form)]
    place, spread = value_and_sd(text, name, _FORMS[form])
    at = parse_lengths(place, name)
    if len(at) != 3:
        raise InputError(f"{name}: expected x, y and z, got '{place}'. Write: {_FORMS[form]}.")
    return SE3.from_parts(np.eye(3), np.array(at)), _lengths(spread, name, form)


def _lengths(text: str, name: str, form: str) -> list[float]:
    values = [value for word in text.split() for value in parse_lengths(word, name)]
    if not 1 <= len(values) <= (2 if form == "point" else 1) or min(values) <= 0:
        raise InputError(f"{name}: expected positive lengths after +-, got '{text}'. Write: {_FORMS[form]}.")
    return values


def _centred(surface: Ball | Point, T: Transforms | None, sd: float, form: str) -> Target:
    return Target(surface, T, np.diag(np.r_[np.full(3, sd**2), np.zeros(3)]), form)
