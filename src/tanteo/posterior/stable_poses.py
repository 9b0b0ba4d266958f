"""Prior of a part that lies on a table in one of its stable poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tanteo import _core
from tanteo.catalogue import known_stable_poses
from tanteo.catalogue.stability import StablePose
from tanteo.factors import PoseFactor
from tanteo.geometry import SE3, freeze
from tanteo.geometry.typing import FloatArray, Transforms, Vectors
from tanteo.parts import Part
from tanteo.posterior.answers.pose_prior import Table

_SAME = 1e-3
"""Numerical: difference of directions below which they are equal by symmetry [rad]; the symmetry of parts has the same
tolerance."""

_POLE = 0.9987
"""Numerical: cosine of the angle to the axis of revolution above which a direction is along it, as in the core."""

FLUSH = 2
"""Definition: number of planes with a density of the attitude; faces that are flush with two planes fix it."""

_ANY_HEIGHT = 1e6
"""Numerical: standard deviation of a height that is not compared [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class OnTable(PoseFactor):
    """Prior of a part on a table: stable poses with their probabilities, uniform position and yaw.

    Attributes:
        T_world_table: frame of the table, its plane z = 0, the part above it ``(4, 4)``.
        height_sd: standard deviation of the part's height over the table [m].
        tilt_sd: standard deviation of its tilt about each direction of the table [rad].
        area: area of the table in which its centroid may be [m^2].
    """

    T_world_table: Transforms
    height_sd: float
    tilt_sd: float
    area: float

    def __post_init__(self) -> None:
        freeze(self, "T_world_table")

    @property
    def is_pose_prior(self) -> bool:
        """Return True: the factor is a prior density of the pose."""
        return True

    def term(self, part: Part, first: int, common: int = 0) -> _core.PoseTerm:
        """Compile the prior for one part; it adds no shared error."""
        return _term(part, self.T_world_table, self.height_sd, self.tilt_sd, self.area)

    def log_probability(self, part: Part, T_world_part: Transforms) -> float:
        """Return the log probability of the stable pose that is nearest to a pose ``(4, 4)``."""
        rests, k, _ = nearest_stable_pose(part, self.T_world_table[:3, 2], T_world_part)
        return float(np.log(rests[k].probability))


def resting(table: Table, part: Part) -> _core.PoseTerm:
    """Compile the density of the attitude of a part on a table, over that of uniform attitudes.

    It is a mixture: a stable pose, tilted by the error of the table's height over a quarter of the part, or any
    attitude if the part leans. The height over the table is a prior of its own.

    Args:
        table: the table.
        part: the part.
    """
    attitude = np.log(4 * np.pi) + np.log(2 * np.pi) + np.log(np.sqrt(2 * np.pi) * _ANY_HEIGHT)
    lying = _term(part, table.frame, _ANY_HEIGHT, _tilt_sd(table, part), 1.0, log_factor=float(attitude))
    if table.leaning == 1:
        return _core.alternatives([[]], np.zeros(1))
    return _core.alternatives([[lying], []], np.log([1 - table.leaning, table.leaning]))


def log_flush(planes: Sequence[Table], part: Part) -> float:
    """Return the log of the mean, over uniform attitudes, of the product of the attitude densities on two planes.

    Each density has the mean 1. Faces that can be flush with both planes at once make their product larger, and the
    prior of the attitude is the product over its mean. For directions ``u`` and ``v`` of the part, ``a`` apart, that
    point along normals ``b`` apart, with a variance ``s^2`` of the tilt, the mean is ``2 N(a - b; 0, s^2) / sin b``.
    A part of revolution has its axis at angles to both normals, and ``2 / (pi |det(axis, n, m)|)``.

    Args:
        planes: planes that the part touches; those after the second change no attitude.
        part: the part.
    """
    if len(planes) < FLUSH:
        return 0.0
    first, p = second, q = upward_directions(part)
    one, other = planes[:FLUSH]
    between = float(np.arccos(np.clip(one.normal @ other.normal, -1, 1)))
    s = float(np.hypot(_tilt_sd(one, part), _tilt_sd(other, part)))

    def at(angle: FloatArray) -> FloatArray:
        return np.asarray(np.exp(-0.5 * ((angle - between) / s) ** 2) / (np.sqrt(2 * np.pi) * s))

    if part.symmetry.spherical:
        together = np.ones((len(p), len(q)))
    elif part.symmetry.axis is None:
        together = 2 * at(np.arccos(np.clip(first @ second.T, -1, 1))) / np.sin(between)
    else:
        axis = part.symmetry.axis[1]
        a, b = (np.clip(own @ axis, -1, 1) for own in (first, second))
        c = float(np.cos(between))
        square = 1 - a[:, None] ** 2 - b**2 - c**2 + 2 * c * a[:, None] * b
        together = np.where(square > 0, 2 / (np.pi * np.sqrt(np.maximum(square, s**2))), 0.0)
        poles, sides = np.abs(a) > _POLE, np.abs(b) > _POLE
        upright = 2 * at(np.arccos(np.sign(a)[:, None] * b)) / np.sqrt(np.maximum(1 - b**2, s**2))
        lying = 2 * at(np.arccos(a[:, None] * np.sign(b))) / np.sqrt(np.maximum(1 - a[:, None] ** 2, s**2))
        together = np.where(poles[:, None], np.where(sides, 0.0, upright), np.where(sides, lying, together))
    flush = (1 - one.leaning) * (1 - other.leaning)
    return float(np.log(1 - flush + flush * float(p @ (together @ q))))


def upward_directions(part: Part) -> tuple[FloatArray, FloatArray]:
    """Return the upward directions of the stable poses with their symmetric images ``(k, 3)``, and probabilities.

    Args:
        part: the part; directions on one circle about an axis of revolution count once.
    """
    rests = known_stable_poses(part)
    ups = [_images(part, rest.T_table_part[2, :3]) for rest in rests]
    shares = [np.full(len(own), rest.probability / len(own)) for own, rest in zip(ups, rests, strict=True)]
    return np.concatenate(ups), np.concatenate(shares)


def _tilt_sd(table: Table, part: Part) -> float:
    """Return the standard deviation of the tilt of a part: the error of the plane over a quarter of the part [rad]."""
    return table.sd / (0.25 * part.diagonal)


def _term(
    part: Part, T_world_table: Transforms, height_sd: float, tilt_sd: float, area: float, *, log_factor: float = 0.0
) -> _core.PoseTerm:
    symmetry = part.symmetry
    ups, heights, logs = [], [], []
    for rest in known_stable_poses(part):
        some = _images(part, rest.T_table_part[2, :3])
        ups.append(some)
        heights += [float(SE3.apply(rest.T_table_part, part.centroid)[2])] * len(some)
        logs += [log_factor + np.log(rest.probability / len(some))] * len(some)
    freedom = 2 if symmetry.spherical else int(symmetry.axis is not None)
    axis = np.array([0.0, 0.0, 1.0]) if symmetry.axis is None else symmetry.axis[1]
    return _core.stable_poses(
        np.ascontiguousarray(np.concatenate(ups)), np.array(heights), np.array(logs), part.centroid, freedom,
        np.ascontiguousarray(axis), np.ascontiguousarray(T_world_table), height_sd, tilt_sd, area,
    )  # fmt: skip


def nearest_stable_pose(
    part: Part, normal: Vectors, T_world_part: Transforms
) -> tuple[tuple[StablePose, ...], int, float]:
    """Return the stable poses of a part, the index of the one nearest to a pose, and its tilt from that one [rad].

    Args:
        part: the part.
        normal: normal of the table in the world ``(3,)``.
        T_world_part: the pose ``(4, 4)``.
    """
    rests, symmetry = known_stable_poses(part), part.symmetry
    up = T_world_part[:3, :3].T @ normal
    if symmetry.spherical:
        return rests, 0, 0.0
    if symmetry.axis is not None:
        axis = symmetry.axis[1]
        ups = [symmetry.Ts[:, :3, :3] @ rest.T_table_part[2, :3] @ axis for rest in rests]
        angles = np.array([np.abs(np.arccos(np.clip(own, -1, 1)) - np.arccos(up @ axis)).min() for own in ups])
    else:
        angles = np.array([np.arccos(np.clip(_images(part, r.T_table_part[2, :3]) @ up, -1, 1)).min() for r in rests])
    k = int(np.argmin(angles))
    return rests, k, float(angles[k])


def _images(part: Part, up: FloatArray) -> FloatArray:
    """Return the directions to which symmetry maps a direction of the part, each once ``(k, 3)``."""
    images = up @ part.symmetry.Ts[:, :3, :3]
    if part.symmetry.axis is not None:  # of directions on one circle about the axis the core needs one
        along = images @ part.symmetry.axis[1]
        return images[np.unique(np.round(along / _SAME), return_index=True)[1]]
    kept: list[FloatArray] = []
    for one in images:
        if all(np.linalg.norm(one - other) > _SAME for other in kept):
            kept.append(one)
    return np.array(kept)
