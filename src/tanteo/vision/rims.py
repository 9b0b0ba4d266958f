"""Pose proposals from ellipses: a rim of the part on an ellipse of the image, turned until another rim meets its own.

An ellipse and a radius leave two circles (``circles.py``); about the axis the part may still turn. The line of sight of
a second ellipse meets the height of a second rim at some place: where that is as far from the axis as the part has it,
the turn is known. Where no second one is found, all turns are proposed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.errors import DegenerateError
from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import FloatArray, Transforms, Vectors
from tanteo.parts import Part, Rim, round_features
from tanteo.vision.camera import Camera
from tanteo.vision.circles import circle_frames, project_circle
from tanteo.vision.ellipse_fit import Ellipse

_ELLIPSES, _RIMS = 12, 24
"""How many ellipses of the image and rims of the part are tried, largest first."""

_AS_FAR = 0.12
"""A second rim is as far from the axis as the part has it, within this share."""

_APART = 0.5
"""A second rim is farther from the axis than this, in radii of the first: a nearer one does not tell the turn."""

_ITS_OWN = 2.5
"""An ellipse is a rim's if none of its five numbers is farther off than this [px]."""

_PAIRED, _ALONE, _TURNS = 600, 2, 48
"""Poses by two rims that are kept, best first; how many ellipses are tried without a second one, at how many turns."""


@dataclass(frozen=True, slots=True, eq=False)
class ModelRims:
    """Open rims of holes and bosses of a part.

    Attributes:
        T_part_rim: origin at the centre, z out of the material ``(n, 4, 4)``.
        radii: ``(n,)`` [m].
    """

    T_part_rim: Transforms
    radii: FloatArray


def model_rims(part: Part) -> ModelRims:
    """The open rims of a part, largest first."""
    rims = [rim for feature in round_features(part) for rim in feature.rims if rim.open]
    rims = sorted(rims, key=lambda rim: -rim.radius)[:_RIMS]
    if not rims:
        return ModelRims(np.zeros((0, 4, 4)), np.zeros(0))
    frames = [SE3.from_parts(SO3.frame_from_axis(rim.axis, 2), rim.centre) for rim in rims]
    return ModelRims(np.stack(frames), np.array([rim.radius for rim in rims]))


def poses_from_ellipses(camera: Camera, ellipses: tuple[Ellipse, ...], part: Part) -> Transforms:
    """Poses that put a rim of the part on an ellipse of the image ``(k, 4, 4)``.

    Args:
        camera: that took the image.
        ellipses: of it, largest first.
        part: to be looked for.
    """
    rims, some = model_rims(part), ellipses[:_ELLIPSES]
    if not some or not len(rims.radii):
        return np.zeros((0, 4, 4))
    rays = np.array([[*(ellipse.centre - camera.centre) / camera.focal, 1.0] for ellipse in some])
    paired, misses, alone = [], [], []
    for i, ellipse in enumerate(some):
        unit = circle_frames(camera, ellipse, 1.0)
        for a, radius in enumerate(rims.radii):
            T_rim_part = SE3.inverse(rims.T_part_rim[a])
            others = SE3.apply(T_rim_part, rims.T_part_rim[:, :3, 3])
            for frame in unit:
                T = SE3.from_parts(frame[:3, :3], radius * frame[:3, 3])
                turns, miss = _turns(T, np.delete(rays, i, axis=0), others, float(radius))
                paired.append(_turned(T, turns) @ T_rim_part)
                misses.append(miss)
                if i < _ALONE:
                    alone.append(_turned(T, 2 * np.pi * np.arange(_TURNS) / _TURNS) @ T_rim_part)
    best = np.argsort(np.concatenate(misses), kind="stable")[:_PAIRED]
    return np.concatenate([np.concatenate(paired)[best], *alone])


def _turns(T: Transforms, rays: Vectors, others: Vectors, radius: float) -> tuple[FloatArray, FloatArray]:
    """Turns about z of a rim at ``T`` that bring another rim under a line of sight, and by how much that is missed.

    Args:
        T: of the rim, camera frame ``(4, 4)``.
        rays: lines of sight of the other ellipses ``(m, 3)``, z = 1.
        others: centres of the part's rims as this rim sees them ``(n, 3)`` [m].
        radius: of the rim [m].
    """
    far = np.hypot(others[:, 0], others[:, 1])
    others, far = others[far > _APART * radius], far[far > _APART * radius]
    origin, directions = -T[:3, :3].T @ T[:3, 3], rays @ T[:3, :3]
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (others[:, 2] - origin[2]) / directions[:, 2, None]
        places = origin[:2] + along[..., None] * directions[:, None, :2]
        miss = np.abs(np.hypot(places[..., 0], places[..., 1]) / far - 1)
    turn = np.arctan2(places[..., 1], places[..., 0]) - np.arctan2(others[:, 1], others[:, 0])
    good = (miss < _AS_FAR) & (along > 0)
    return turn[good], miss[good]


def _turned(T: Transforms, turns: FloatArray) -> Transforms:
    return np.asarray(T @ SE3.from_parts(SO3.axis_rotation(2, turns), np.zeros(3)))


def name_ellipses(
    camera: Camera, ellipses: tuple[Ellipse, ...], part: Part, T_camera_part: Transforms
) -> tuple[str, ...]:
    """Of which hole or boss each ellipse is a rim, for a part at a pose; an empty name if of none.

    Args:
        camera: that took the image.
        ellipses: of it.
        part: that was found.
        T_camera_part: where ``(4, 4)``.
    """
    expected = [(f.name, _seen(camera, T_camera_part, rim)) for f in round_features(part) for rim in f.rims]
    shown = [(name, numbers) for name, numbers in expected if numbers is not None]
    names = []
    for ellipse in ellipses:
        off = [float(np.abs(numbers - ellipse.numbers).max()) for _, numbers in shown]
        k = int(np.argmin(off)) if off else -1
        names.append(shown[k][0] if off and off[k] < _ITS_OWN else "")
    return tuple(names)


def _seen(camera: Camera, T_camera_part: Transforms, rim: Rim) -> FloatArray | None:
    """The five numbers of a rim's ellipse; None if it is behind the camera or seen from the side."""
    T = T_camera_part @ SE3.from_parts(SO3.frame_from_axis(rim.axis, 2), rim.centre)
    try:
        return project_circle(camera, T, rim.radius).numbers
    except DegenerateError:
        return None
