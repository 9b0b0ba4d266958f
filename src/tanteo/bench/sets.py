"""Define scenes with known truth, and the answers of methods."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry import frozen_array
from tanteo.geometry.typing import Covariances, FloatArray, IntArray, Transforms, Vectors
from tanteo.parts import Part
from tanteo.sensors import Readings, Rig
from tanteo.sensors.presets import NoiseLaw


@dataclass(frozen=True, slots=True, eq=False)
class BenchScene:
    """Readings of one part, in the world.

    Attributes:
        name: name of the scene.
        points: noisy points of the surface, of ranges the places on the axes of the beams ``(n, 3)`` [m].
        sd: stated standard deviation of a coordinate [m].
        normals: sensed outward normals ``(n, 3)``, or None.
        normal_sd: stated standard deviation of each tilt [rad].
        truth: name of the true part; None for an unknown object.
        T_world_part: true pose ``(4, 4)``; None if unknown.
        readings: ranges and free-space rays of sensors on a hand, of which the points are the hits; None for touches.
        rig: sensors of the ranges; None for touches.

    Raises:
        InputError: shapes do not match, or numbers are not finite.
    """

    name: str
    points: Vectors
    sd: float
    normals: Vectors | None = None
    normal_sd: float = float(np.pi)
    truth: str | None = None
    T_world_part: Transforms | None = None
    readings: Readings | None = None
    rig: Rig | None = None

    def __post_init__(self) -> None:
        points = frozen_array(self.points)
        if points.ndim != 2 or points.shape[1:] != (3,) or not len(points) or not np.isfinite(points).all():
            raise InputError(f"scene {self.name!r}, points: expected n x 3 finite lengths [m], got {points.shape}.")
        if not (np.isfinite(self.sd) and self.sd > 0):
            raise InputError(f"scene {self.name!r}, sd: expected a positive length [m], got {self.sd}.")
        object.__setattr__(self, "points", points)
        if self.normals is not None:
            normals = frozen_array(self.normals)
            if normals.shape != points.shape or not np.isfinite(normals).all():
                raise InputError(f"scene {self.name!r}, normals: expected {points.shape}, got {normals.shape}.")
            object.__setattr__(self, "normals", normals)
        if self.T_world_part is not None:
            object.__setattr__(self, "T_world_part", frozen_array(self.T_world_part))

    def first(self, count: int) -> BenchScene:
        """Return the scene with its first readings only, and the free-space rays among them.

        Args:
            count: number of readings that hit the part.
        """
        normals = None if self.normals is None else self.normals[:count]
        readings = self.readings
        if readings is not None:
            readings = readings.take(np.cumsum(~readings.is_free) <= count)
        return replace(self, points=self.points[:count], normals=normals, readings=readings)


def range_scene(
    name: str, readings: Readings, rig: Rig, truth: str | None = None, T_world_part: Transforms | None = None
) -> BenchScene:
    """Return the scene of ranges of sensors on a hand.

    Args:
        name: name of the scene.
        readings: ranges and free-space rays with the hand's pose.
        rig: sensors of the ranges.
        truth: name of the true part; None for an unknown object.
        T_world_part: true pose ``(4, 4)``; None if unknown.

    Raises:
        InputError: a sensor of the readings is not in the rig, or nothing was hit.
    """
    sensors = {sensor.name: sensor for sensor in rig.sensors}
    hit = np.flatnonzero(~readings.is_free)
    strange = [one for one in readings.sensors if one not in sensors]
    if strange or not len(hit):
        got = f"'{strange[0]}'" if strange else "no range"
        raise InputError(f"scene {name!r}: expected ranges of {', '.join(sensors)}, got {got}. Correct the scene.")
    mounts = np.array([sensors[readings.sensors[k]].T_hand_sensor for k in hit])
    Ts = readings.Ts_world_hand[:][hit] @ mounts
    points = Ts[:, :3, 3] + readings.ranges.values[:, None] * Ts[:, :3, 2]
    sds = [
        (sensor.preset.law if np.isnan(sensor.sd) and sensor.preset else NoiseLaw.of(sensor.sd, sensor.sd_prop)).sigma(
            r
        )
        for sensor, r in zip((sensors[readings.sensors[k]] for k in hit), readings.ranges.values, strict=True)
    ]
    sd = float(np.sqrt(np.mean(np.square(sds))))
    return BenchScene(name, points, sd, truth=truth, T_world_part=T_world_part, readings=readings, rig=rig)


@dataclass(frozen=True, slots=True, eq=False)
class BenchSet:
    """Scenes of the parts of a catalogue.

    Attributes:
        name: name of the set.
        parts: candidate parts.
        scenes: scenes of these parts.
        tolerance: largest displacement of a corner of the part at a correct pose [m].
        words: sentence that describes the scenes.

    Raises:
        InputError: there are no parts or two of one name, a true part is unknown, or the tolerance is not positive.
    """

    name: str
    parts: tuple[Part, ...]
    scenes: tuple[BenchScene, ...]
    tolerance: float
    words: str = ""

    def __post_init__(self) -> None:
        names = [part.name for part in self.parts]
        if not names or len(set(names)) < len(names):
            raise InputError(f"set {self.name!r}, parts: expected parts with names of their own, got {names}.")
        if not (np.isfinite(self.tolerance) and self.tolerance > 0):
            raise InputError(f"set {self.name!r}, tolerance: expected a positive length [m], got {self.tolerance}.")
        for scene in self.scenes:
            if scene.truth is not None and scene.truth not in names:
                raise InputError(
                    f"set {self.name!r}, scene {scene.name!r}: expected one of {', '.join(names)}, got "
                    f"'{scene.truth}'. Leave the part empty for an unknown object."
                )

    def part(self, name: str) -> Part:
        """Return the part with a name."""
        return next(part for part in self.parts if part.name == name)


@dataclass(frozen=True, slots=True, eq=False)
class Placement:
    """One answer of a method: a part at a pose.

    Attributes:
        part: name of the part.
        T_world_part: pose ``(4, 4)`` [m].
        covariance: covariance of the pose ``(6, 6)``, part frame, right perturbation, x y z rx ry rz [m, rad], or None.
        probability: probability of this part at about this pose, or None.

    Example:
        >>> tanteo.bench.sets.Placement("cube", np.eye(4), probability=0.9).covariance is None
        True
    """

    part: str
    T_world_part: Transforms
    covariance: Covariances | None = None
    probability: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """Candidate part as a method receives it.

    Attributes:
        name: name of the part.
        vertices: vertices of the mesh ``(V, 3)``, part frame [m].
        triangles: vertex indices, counter-clockwise from outside ``(T, 3)``.
        part: part with planes and exact round faces.
    """

    name: str
    vertices: FloatArray = field(repr=False)
    triangles: IntArray = field(repr=False)
    part: Part
