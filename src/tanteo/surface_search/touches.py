"""Readings without correspondences as arrays: touches and beams on some surface, nobody knows where."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from tanteo.sensors import PointMeasurements
from tanteo.typing import BoolArray, Covariances, FloatArray, IntArray, Vectors

_BESIDE, _ALONG = 1e-3, float(np.cos(np.radians(1)))
"""Readings are of one beam if they are no farther beside each other [m], and by the cosine of their directions."""

_BLUNT = 0.3
"""A beam's spread across is taken as no less than this share of that along."""


@dataclass(frozen=True, slots=True, eq=False)
class Touches:
    """``n`` sensed points in the world [m].

    Attributes:
        ids: names of the readings.
        points: surface points, or centres of the tip's ball where ``radii`` is positive ``(n, 3)``.
        covs: independent covariances, part tolerance included ``(n, 3, 3)``.
        radii: distance of the point from the surface ``(n,)``.
        directions: into the material ``(n, 3)``; zero where unknown.
        normals: sensed outward normals ``(n, 3)``; zero where not sensed.
        normal_sds: sd of each tilt of the normal ``(n,)`` [rad].
        reach: length of the straight path along ``direction`` that was free up to the point ``(n,)`` [m]; 0 if unknown.
        gains: whitened shared errors, true point = point + gain z, ``(n, 3, D)``.
        sd: largest standard deviation of each point ``(n,)`` [m].
        tolerance: sd of the made surface that ``covs`` contains [m]; within a face it is one draw, not many.
        places: number of the place of each ``(n,)``, the same for readings of one beam; None where each has its own.
        directed: whether the direction of approach is known ``(n,)``; follows from ``directions``.
        oriented: whether the normal was sensed ``(n,)``; follows from ``normals``.
        variance: of every point in every direction, where it is one for all [m2]; NaN otherwise, and for no point;
            follows from ``covs``.
    """

    ids: tuple[str, ...]
    points: Vectors
    covs: Covariances
    radii: FloatArray
    directions: Vectors
    normals: Vectors
    normal_sds: FloatArray
    reach: FloatArray
    gains: FloatArray
    sd: FloatArray
    tolerance: float = 0.0
    places: IntArray | None = None
    directed: BoolArray = field(init=False, repr=False)
    oriented: BoolArray = field(init=False, repr=False)
    variance: float = field(init=False, repr=False)

    def __post_init__(self) -> None:
        v = float(self.covs[0, 0, 0]) if len(self.covs) else 0.0
        alike = bool(np.all(np.abs(self.covs - v * np.eye(3)) <= 1e-9 * v))
        object.__setattr__(self, "directed", np.any(self.directions != 0, axis=1))
        object.__setattr__(self, "oriented", np.any(self.normals != 0, axis=1))
        object.__setattr__(self, "variance", v if alike and len(self.covs) else float("nan"))

    def __len__(self) -> int:
        return len(self.ids)

    def widened(self, ratio: float) -> Touches:
        """The same with that many times the noise."""
        return replace(self, covs=ratio**2 * self.covs, sd=ratio * self.sd)

    def supposing(self, z: FloatArray) -> Touches:
        """The same if the whitened shared errors ``(D,)`` were about these: where the readings are then."""
        return replace(self, points=self.points + self.gains @ z)

    def take(self, rows: IntArray) -> Touches:
        """Some of the readings."""
        arrays = {
            name: getattr(self, name)[rows]
            for name in ("points", "covs", "radii", "directions", "normals", "normal_sds", "reach", "gains", "sd")
        }
        places = None if self.places is None else self.places[rows]
        return replace(self, ids=tuple(self.ids[i] for i in rows), places=places, **arrays)

    def placed(self) -> Touches:
        """The same, readings that were made along one beam being of one place."""
        places = np.arange(len(self))
        for k in range(1, len(self)):
            away, d = self.points[:k] - self.points[k], self.directions[k]
            beside = np.linalg.norm(away - np.outer(away @ d, d), axis=1)
            same = self.directed[:k] & self.directed[k] & (beside < _BESIDE) & (self.directions[:k] @ d > _ALONG)
            if same.any():
                places[k] = places[np.argmax(same)]
        return replace(self, places=places)


@dataclass(frozen=True, slots=True, eq=False)
class FreePaths:
    """``m`` straight paths on which nothing was met, in the world [m].

    Attributes:
        origins: where they start ``(m, 3)``.
        directions: unit ``(m, 3)``.
        lengths: how far they were free ``(m,)``.
        margin: how much of the end is not certain ``(m,)``.
        slopes: how far beside them they may have been, one standard deviation in either direction across, over the way
            along them ``(m,)``; zero if not given. A cone's echo comes from any of its rays.
        incidences: up to which a surface would have been met ``(m,)`` [rad]; a right angle if not given. A path on
            which one lies more obliquely says nothing.
        gains: how origins move with the whitened shared errors of the readings, true origin = origin + gain z,
            ``(m, 3, D)``; not at all if not given.
        turns: the same of directions ``(m, 3, D)``.
        moved: whether any path moves; follows from ``gains`` and ``turns``.
    """

    origins: Vectors
    directions: Vectors
    lengths: FloatArray
    margin: FloatArray
    slopes: FloatArray = field(default_factory=lambda: np.zeros(0))
    incidences: FloatArray = field(default_factory=lambda: np.zeros(0))
    gains: FloatArray = field(default_factory=lambda: np.zeros((0, 3, 0)))
    turns: FloatArray = field(default_factory=lambda: np.zeros((0, 3, 0)))
    moved: bool = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if len(self.slopes) != len(self.lengths):
            object.__setattr__(self, "slopes", np.zeros(len(self.lengths)))
        if len(self.incidences) != len(self.lengths):
            object.__setattr__(self, "incidences", np.full(len(self.lengths), np.pi / 2))
        for name in ("gains", "turns"):
            if len(getattr(self, name)) != len(self.lengths):
                object.__setattr__(self, name, np.zeros((len(self.lengths), 3, 0)))
        object.__setattr__(self, "moved", bool(self.gains.any() or self.turns.any()))

    def __len__(self) -> int:
        return len(self.lengths)

    def up_to(self, incidence: float) -> FreePaths:
        """The same of a sensor that answers to no greater incidence [rad]."""
        return replace(self, incidences=np.minimum(self.incidences, incidence))

    def take(self, rows: IntArray) -> FreePaths:
        """Some of the paths."""
        names = "origins", "directions", "lengths", "margin", "slopes", "incidences", "gains", "turns"
        return FreePaths(*(getattr(self, name)[rows] for name in names))

    def unmoved(self) -> FreePaths:
        """The same as if they were exactly where they are said to be."""
        none = np.zeros((len(self), 3, 0))
        return replace(self, gains=none, turns=none)

    def at(self, z: FloatArray) -> tuple[Vectors, Vectors]:
        """Origins and directions where the whitened shared errors are these ``(S, D)``.

        Returns:
            Both ``(S, m, 3)`` [m], or ``(m, 3)`` if nothing moves them.
        """
        if not self.moved:
            return self.origins, self.directions
        shifts, turns = (z @ J.reshape(-1, z.shape[1]).T for J in (self.gains, self.turns))
        along = self.directions + turns.reshape(len(z), len(self), 3)
        along /= np.linalg.norm(along, axis=2, keepdims=True)
        return self.origins + shifts.reshape(len(z), len(self), 3), along

    @classmethod
    def none(cls) -> FreePaths:
        """No such path."""
        return cls(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros(0))


def as_free_paths(measured: PointMeasurements, margin: float) -> FreePaths:
    """The free beams of some measurements."""
    beams, (_, gains, turns) = measured.free, measured.whitened()
    slopes = 0.5 * np.tan(beams.half_angles)  # of points even over a disc
    margins = np.full(len(beams), margin)
    lines = beams.origins, beams.directions, beams.lengths
    return FreePaths(*lines, margins, slopes, beams.max_incidences, gains, turns)


def as_touches(measured: PointMeasurements, tolerance: float = 0.0, reach: FloatArray | None = None) -> Touches:
    """Measurements as touches; labels are not used, and beams are a little blunt (decision 54).

    Args:
        measured: points in the world.
        tolerance: sd of the made surface against its CAD [m].
        reach: known free path before each point ``(n,)`` [m]: the range of a beam.
    """
    points, independent, radii = measured.centres()
    directions = np.nan_to_num(measured.directions)
    covs = _blunt(independent, directions) + tolerance**2 * np.eye(3)
    return Touches(
        measured.ids,
        points,
        covs,
        radii,
        directions,
        np.nan_to_num(measured.normals),
        np.nan_to_num(measured.normal_sds, nan=np.pi),
        np.zeros(len(measured)) if reach is None else np.nan_to_num(reach),
        measured.whitened()[0],
        np.sqrt(np.linalg.eigvalsh(covs)[:, -1]),
        tolerance,
    )


def _blunt(covs: Covariances, directions: Vectors) -> Covariances:
    """Covariances of which no beam is better known across than a share of its spread along.

    Where a thin beam slides off an edge the posterior has a cliff, at which climbs stop and off which draws fall.
    Readings without direction are left as they are.
    """
    along = np.einsum("ni,nij,nj->n", directions, covs, directions)
    across = 0.5 * (np.trace(covs, axis1=1, axis2=2) - along)
    missing = np.maximum(_BLUNT**2 * along - across, 0.0)
    beside = np.eye(3) - directions[:, :, None] * directions[:, None]
    return np.asarray(covs + missing[:, None, None] * beside)
