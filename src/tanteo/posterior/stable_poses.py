"""Prior of a part that lies on a table in one of its stable poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo import _core
from tanteo.catalogue import known_stable_poses
from tanteo.factors import PoseFactor
from tanteo.geometry import SE3, freeze
from tanteo.geometry.typing import FloatArray, Transforms
from tanteo.parts import Part

_SAME = 1e-3
"""Numerical: difference of directions below which they are equal by symmetry [rad]; the symmetry of parts has the same
tolerance."""


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

    def term(self, part: Part, first: int) -> _core.PoseTerm:
        """Compile the prior for one part; it adds no shared error."""
        rests, symmetry = known_stable_poses(part), part.symmetry
        ups, heights, logs = [], [], []
        for rest in rests:
            some = _images(part, rest.T_table_part[2, :3])
            ups.append(some)
            heights += [float(SE3.apply(rest.T_table_part, part.centroid)[2])] * len(some)
            logs += [np.log(rest.probability / len(some))] * len(some)
        freedom = 2 if symmetry.spherical else int(symmetry.axis is not None)
        axis = np.array([0.0, 0.0, 1.0]) if symmetry.axis is None else symmetry.axis[1]
        return _core.stable_poses(
            np.ascontiguousarray(np.concatenate(ups)), np.array(heights), np.array(logs), part.centroid, freedom,
            np.ascontiguousarray(axis), np.ascontiguousarray(self.T_world_table), self.height_sd, self.tilt_sd,
            self.area,
        )  # fmt: skip

    def log_probability(self, part: Part, T_world_part: Transforms) -> float:
        """Return the log probability of the stable pose that is nearest to a pose ``(4, 4)``."""
        rests, symmetry = known_stable_poses(part), part.symmetry
        up = T_world_part[:3, :3].T @ self.T_world_table[:3, 2]
        nearest = np.zeros(len(rests))
        if symmetry.axis is not None:
            axis = symmetry.axis[1]
            ups = [symmetry.Ts[:, :3, :3] @ rest.T_table_part[2, :3] @ axis for rest in rests]
            nearest = np.array([np.abs(own - up @ axis).min() for own in ups])
        elif not symmetry.spherical:
            nearest = np.array([-(_images(part, rest.T_table_part[2, :3]) @ up).max() for rest in rests])
        return float(np.log(rests[int(np.argmin(nearest))].probability))


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
