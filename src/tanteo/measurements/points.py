"""Contact points and beam hits as arrays: what the likelihood reads of sensed points, world frame, metres."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from tanteo.errors import InputError
from tanteo.features import label_kind
from tanteo.sensors import APEX, CENTRES, WALLS, PointMeasurements
from tanteo.typing import BoolArray, Covariances, FloatArray, IntArray, Vectors

_BESIDE, _ALONG = 1e-3, float(np.cos(np.radians(1)))
"""Readings are of one beam if they are no farther beside each other [m], and by the cosine of their directions."""

_BLUNT = 0.3
"""A beam's spread across is taken as no less than this share of that along."""


_OF_CIRCLES = (*WALLS, "cone", "sphere")
"""Kinds of contact points on a wall that is not flat, as labels name it."""

MADE = 1e-4
"""To how much a radius tells what hole or boss it is [m]: they are made no more exactly, or modelled as threads."""

MADE_ANGLE = 0.01
"""To how much the half angle of a cone tells which it is [rad]."""


def directions_met(kind: str) -> int:
    """In how many directions a point of that kind is held by what it was sensed on."""
    return CENTRES.get(kind, 1 if kind in _OF_CIRCLES else label_kind(kind).faces)


def is_round(kind: str) -> bool:
    """Whether points of that kind are on a wall that is not flat, or of one label share one."""
    return kind in _OF_CIRCLES


@dataclass(frozen=True, slots=True, eq=False)
class ContactPoints:
    """``n`` sensed points in the world [m].

    Attributes:
        ids: names of the readings.
        points: surface points, or centres of the tip's ball where ``radii`` is positive ``(n, 3)``.
        covs: independent covariances, part tolerance included ``(n, 3, 3)``.
        radii: distance of the point from the surface; of an apex, how far along its axis it is from there ``(n,)``.
        directions: into the material ``(n, 3)``; zero where unknown.
        normals: sensed outward normals ``(n, 3)``; zero where not sensed.
        normal_sds: sd of each tilt of the normal ``(n,)`` [rad].
        reach: length of the straight path along ``direction`` that was free up to the point ``(n,)`` [m]; 0 if unknown.
        shared_jacobian: whitened shared errors, true point = point + gain z, ``(n, 3, D)``.
        sd: largest standard deviation of each point ``(n,)`` [m].
        tolerance: sd of the made surface that ``covs`` contains [m]; within a face it is one draw, not many.
        places: number of the place of each ``(n,)``, the same for readings of one beam; None where each has its own.
        labels: names of what the points were sensed on ``(n,)``, '' for none: points of one label share one face.
        kinds: of what was sensed: ``point`` or ``plane`` for faces, ``circle`` and ``cylinder`` for walls of holes and
            bosses, ``edge``, ``vertex``; ``centre`` for points on the axis of a hole or boss, whose normal, if any, is
            the axis with either sign; ``sphere_centre``; ``apex`` of a cone, whose normal is the axis into it.
        circles: of centres, the radius [m], half angle [rad] of an apex, or 0; its standard deviation; and 1 for a
            hole, -1 for a boss, 0 where nobody knows ``(n, 3)``; zero elsewhere, or if not given.
        sides: about outward, where only the side of the material is known ``(n, 3)``; zero elsewhere, or if not given.
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
    shared_jacobian: FloatArray
    sd: FloatArray
    tolerance: float = 0.0
    places: IntArray | None = None
    labels: tuple[str, ...] = ()
    kinds: tuple[str, ...] = ()
    sides: Vectors = field(default_factory=lambda: np.zeros((0, 3)))
    circles: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    directed: BoolArray = field(init=False, repr=False)
    oriented: BoolArray = field(init=False, repr=False)
    variance: float = field(init=False, repr=False)

    def __post_init__(self) -> None:
        v = float(self.covs[0, 0, 0]) if len(self.covs) else 0.0
        alike = bool(np.all(np.abs(self.covs - v * np.eye(3)) <= 1e-9 * v))
        for name, none in (("labels", ""), ("kinds", "point")):
            object.__setattr__(self, name, getattr(self, name) or (none,) * len(self.ids))
        for name in ("sides", "circles"):
            if len(getattr(self, name)) != len(self.ids):
                object.__setattr__(self, name, np.zeros((len(self.ids), 3)))
        object.__setattr__(self, "directed", np.any(self.directions != 0, axis=1))
        object.__setattr__(self, "oriented", np.any(self.normals != 0, axis=1))
        object.__setattr__(self, "variance", v if alike and len(self.covs) else float("nan"))

    @classmethod
    def none(cls) -> ContactPoints:
        """Return a set of no points."""
        no, vectors = np.zeros(0), np.zeros((0, 3))
        matrices, jacobian = np.zeros((0, 3, 3)), np.zeros((0, 3, 0))
        return cls((), vectors, matrices, no, vectors, vectors, no, no, jacobian, no)

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def centres(self) -> BoolArray:
        """Which are centres of circles or spheres, or apexes ``(n,)``: beside the surface, not on it."""
        return np.array([kind in CENTRES for kind in self.kinds], dtype=np.bool_)

    @property
    def held(self) -> int:
        """In how many directions all of them hold the part, a centre in two or three, others in one at least."""
        return len(self) + sum(CENTRES[kind] - 1 for kind in self.kinds if kind in CENTRES)

    @property
    def inward(self) -> Vectors:
        """Into the material, as far as directions or sides say ``(n, 3)``; zero where nothing does."""
        return np.where(self.directed[:, None], self.directions, -self.sides)

    def take(self, rows: IntArray) -> ContactPoints:
        """Some of the readings."""
        arrays = {
            name: getattr(self, name)[rows]
            for name in (
                "points",
                "covs",
                "radii",
                "directions",
                "sides",
                "normals",
                "normal_sds",
                "reach",
                "shared_jacobian",
                "sd",
                "circles",
            )
        }
        places = None if self.places is None else self.places[rows]
        names = {name: tuple(getattr(self, name)[i] for i in rows) for name in ("ids", "labels", "kinds")}
        fields: dict[str, Any] = {**names, **arrays}
        return replace(self, places=places, **fields)

    def placed(self) -> ContactPoints:
        """The same, readings that were made along one beam being of one place."""
        places, d = np.arange(len(self)), self.directions
        later, earlier = np.nonzero(np.tril(d @ d.T > _ALONG, -1))
        away, d = self.points[earlier] - self.points[later], d[later]
        beside = np.linalg.norm(away - np.sum(away * d, axis=1, keepdims=True) * d, axis=1)
        later, earlier = later[beside < _BESIDE], earlier[beside < _BESIDE]
        for row, k in zip(*np.unique(later, return_index=True), strict=True):
            places[row] = places[earlier[k]]
        return replace(self, places=places)


def as_contact_points(
    measured: PointMeasurements, tolerance: float = 0.0, reach: FloatArray | None = None
) -> ContactPoints:
    """Measurements as contact points; beams are a little blunt (decision 54).

    Args:
        measured: points in the world.
        tolerance: sd of the made surface against its CAD [m].
        reach: known free-space ray before each point ``(n,)`` [m]: the range of a beam.

    Raises:
        InputError: a ball's contact with an edge or corner, which may be anywhere on it.
    """
    points, independent, radii = measured.centres()
    for label, kind, radius in zip(measured.features, measured.kinds, radii, strict=True):
        if kind not in CENTRES and directions_met(kind) > 1 and radius > 0:
            raise InputError(
                f"{kind} {label!r}: expected surface points, got centres of a ball of {1e3 * radius:g} mm, whose "
                f"contact on an edge is unknown. Sense the two faces beside it, or give points of the {kind} itself."
            )
    directions = np.nan_to_num(measured.directions)
    centres = np.array([kind in CENTRES for kind in measured.kinds], dtype=np.bool_)
    directions[centres] = 0.0  # how a device came to a centre says nothing of it
    reach = np.zeros(len(measured)) if reach is None else np.where(centres, 0.0, np.nan_to_num(reach))
    covs = _blunt(independent, directions) + tolerance**2 * np.eye(3)
    sd = np.sqrt(np.linalg.eigvalsh(covs)[:, -1])
    made = np.where([kind == APEX for kind in measured.kinds], MADE_ANGLE, np.hypot(sd, MADE))
    return ContactPoints(
        measured.ids,
        points,
        covs,
        radii,
        directions,
        np.nan_to_num(measured.normals),
        np.nan_to_num(measured.normal_sds, nan=np.pi),
        reach,
        measured.whitened()[0],
        sd,
        tolerance,
        labels=measured.features,
        kinds=measured.kinds,
        circles=np.column_stack([measured.circles[:, 0], made * (measured.circles[:, 0] > 0), measured.circles[:, 1]]),
    )


def _blunt(covs: Covariances, directions: Vectors) -> Covariances:
    """Covariances of which no beam is better known across than a share of its spread along.

    Where a thin beam slides off an edge the posterior has a cliff, at which maximizations stop and off which draws
    fall. Readings without direction are left as they are.
    """
    along = np.einsum("ni,nij,nj->n", directions, covs, directions)
    across = 0.5 * (np.trace(covs, axis1=1, axis2=2) - along)
    missing = np.maximum(_BLUNT**2 * along - across, 0.0)
    beside = np.eye(3) - directions[:, :, None] * directions[:, None]
    return np.asarray(covs + missing[:, None, None] * beside)
