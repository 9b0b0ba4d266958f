"""Pose proposals from ellipses: a rim of the part on an ellipse of the image, turned by means of a second ellipse.

An ellipse and a radius give two circles (``circles.py``), about whose axes the part may turn. The line of sight of a
second ellipse intersects the plane of a second rim. If that place is as far from the axis as the second rim, it fixes
the turn. The largest ellipses are also tried at all turns.
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
from tanteo.vision.settings import EVIDENCE, SEARCH


@dataclass(frozen=True, slots=True, eq=False)
class ModelRims:
    """Open rims of holes and bosses of a part.

    Attributes:
        T_part_rim: frames with the origin at the centre, z out of the material ``(n, 4, 4)``.
        radii: radii ``(n,)`` [m].
    """

    T_part_rim: Transforms
    radii: FloatArray


def model_rims(part: Part) -> ModelRims:
    """Return the open rims of a part, largest first."""
    rims = [rim for feature in round_features(part) for rim in feature.rims if rim.open]
    rims = sorted(rims, key=lambda rim: -rim.radius)[: SEARCH.rims]
    if not rims:
        return ModelRims(np.zeros((0, 4, 4)), np.zeros(0))
    frames = [SE3.from_parts(SO3.frame_from_axis(rim.axis, 2), rim.centre) for rim in rims]
    return ModelRims(np.stack(frames), np.array([rim.radius for rim in rims]))


def poses_from_ellipses(camera: Camera, ellipses: tuple[Ellipse, ...], part: Part) -> Transforms:
    """Return poses that put a rim of the part on an ellipse of the image ``(k, 4, 4)``.

    Args:
        camera: camera of the image.
        ellipses: ellipses of the image, largest first.
        part: candidate part.
    """
    rims, some = model_rims(part), ellipses[: SEARCH.rims]
    if not some or not len(rims.radii):
        return np.zeros((0, 4, 4))
    rays = np.array([[*(ellipse.centre - camera.centre) / camera.focal, 1.0] for ellipse in some])
    bases, turns, misses, alone = [], [], [], []
    for i, ellipse in enumerate(some):
        unit = circle_frames(camera, ellipse, 1.0)
        for a, radius in enumerate(rims.radii):
            T_rim_part = SE3.inverse(rims.T_part_rim[a])
            others = SE3.apply(T_rim_part, rims.T_part_rim[:, :3, 3])
            for frame in unit:
                T = SE3.from_parts(frame[:3, :3], radius * frame[:3, 3])
                own, miss = _turns(T, np.delete(rays, i, axis=0), others)
                bases += [(T, T_rim_part)] * len(own)
                turns.append(own)
                misses.append(miss)
                if i < SEARCH.alone:
                    alone.append(_turned(T, 2 * np.pi * np.arange(SEARCH.yaws) / SEARCH.yaws) @ T_rim_part)
    best = np.argsort(np.concatenate(misses), kind="stable")[: SEARCH.rims**2]
    every = np.concatenate(turns)
    paired = [_turned(bases[k][0], every[[k]]) @ bases[k][1] for k in best]
    return np.concatenate([np.zeros((0, 4, 4)), *paired, *alone])


def _turns(T: Transforms, rays: Vectors, others: Vectors) -> tuple[FloatArray, FloatArray]:
    """Return turns of a rim about z that bring another rim to a line of sight, and the relative distances from it.

    Args:
        T: frame of the rim, camera frame ``(4, 4)``.
        rays: lines of sight of the other ellipses ``(m, 3)``, z = 1.
        others: centres of the rims of the part in the frame of this rim ``(n, 3)`` [m].
    """
    far = np.hypot(others[:, 0], others[:, 1])
    others, far = others[far > 0], far[far > 0]  # a rim on the same axis does not fix the turn
    origin, directions = -T[:3, :3].T @ T[:3, 3], rays @ T[:3, :3]
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (others[:, 2] - origin[2]) / directions[:, 2, None]
        places = origin[:2] + along[..., None] * directions[:, None, :2]
        miss = np.abs(np.hypot(places[..., 0], places[..., 1]) / far - 1)
    turn = np.arctan2(places[..., 1], places[..., 0]) - np.arctan2(others[:, 1], others[:, 0])
    good = np.isfinite(miss) & (along > 0)
    return turn[good], miss[good]


def _turned(T: Transforms, turns: FloatArray) -> Transforms:
    return np.asarray(T @ SE3.from_parts(SO3.axis_rotation(2, turns), np.zeros(3)))


def name_ellipses(
    camera: Camera, ellipses: tuple[Ellipse, ...], part: Part, T_camera_part: Transforms
) -> tuple[str, ...]:
    """Return the name of the hole or boss whose rim each ellipse is; an empty name for an ellipse of none.

    Args:
        camera: camera of the image.
        ellipses: ellipses of the image.
        part: recognized part.
        T_camera_part: pose of the part ``(4, 4)``.
    """
    expected = [(f.name, _seen(camera, T_camera_part, rim)) for f in round_features(part) for rim in f.rims]
    shown = [(name, numbers) for name, numbers in expected if numbers is not None]
    names = []
    for ellipse in ellipses:
        off = [float(np.abs(numbers - ellipse.numbers).max()) for _, numbers in shown]
        k = int(np.argmin(off)) if off else -1
        names.append(shown[k][0] if off and off[k] < EVIDENCE.reach else "")
    return tuple(names)


def _seen(camera: Camera, T_camera_part: Transforms, rim: Rim) -> FloatArray | None:
    """Return the numbers of the ellipse of a rim ``(5,)``; None if the camera views no ellipse."""
    T = T_camera_part @ SE3.from_parts(SO3.frame_from_axis(rim.axis, 2), rim.centre)
    try:
        return project_circle(camera, T, rim.radius).numbers
    except DegenerateError:
        return None
