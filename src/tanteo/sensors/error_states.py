"""Define the errors that readings share as states: each has a prior and a column of derivatives for each reading.

The true point ``i`` is ``points[i] + sum_k columns_k[i] @ c_k``, where ``c_k`` has mean ``center * sd`` and standard
deviation ``spread * sd``. It is normal, or an amount on one side (:func:`one_sided`). An error is one class with a
name, a unit and its columns; :data:`ERROR_STATES` lists the classes for options and records. Nothing else
distinguishes errors.

The world frame itself is exact: an error that moves all readings equally is an error of that frame, and no reading
shows it.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry.limits import LARGEST, check_number
from tanteo.geometry.typing import BoolArray, Covariances, FloatArray, IntArray, Vectors
from tanteo.sensors.columns import Column
from tanteo.sensors.face_groups import divided, faces_of
from tanteo.sensors.noise import body_jacobian

MOST_STATES = 504
"""Largest number of states of all shared errors. The core has 512 unknowns, of which 7 are the pose and the noise."""


ONE_SIDED = 0.5075741599817282, 0.3025337999776922
"""Definition: mean and standard deviation of an amount on one side over its scale, see :func:`one_sided`; equal numbers
are in ``_core/solve/one_sided.hpp``."""

_KNEE, _AT_KNEE, _RATE_AT_KNEE = 1.0, 0.8413447460685429, 0.24197072451914337
"""Definition: variable from which an amount is linear, and normal distribution function and density there."""


_LEAST_AMOUNT = 1e-6
"""Numerical: least amount over its scale that a step linear in the amount reaches."""


def one_sided(z: FloatArray) -> FloatArray:
    """Return standardized amounts on one side from standard normal variables.

    The amount over its scale is the normal distribution function up to one, and its tangent above: even from none to
    0.84, normal above. One scale is exceeded with a probability of 0.05.

    Args:
        z: standard normal variables.
    """
    from scipy.special import ndtr  # slow to import

    below = np.minimum(z, _KNEE)
    amounts = ndtr(below) + _RATE_AT_KNEE * (z - below)
    return np.asarray((amounts - ONE_SIDED[0]) / ONE_SIDED[1])


def stepped_amounts(z: FloatArray, step: FloatArray) -> FloatArray:
    """Return states of amounts on one side after steps that are linear in the amounts, as the core makes them.

    Args:
        z: standard normal variables.
        step: their steps at the rate of the amounts at ``z``; a step beyond none is linear in the variable.
    """
    from scipy.special import ndtr, ndtri  # slow to import

    below = np.minimum(z, _KNEE)
    rate = np.exp(-0.5 * below**2) / math.sqrt(2 * math.pi)
    amounts = ndtr(below) + _RATE_AT_KNEE * (z - below) + rate * step
    lower = ndtri(np.clip(amounts, _LEAST_AMOUNT, _AT_KNEE))
    upper = _KNEE + (amounts - _AT_KNEE) / _RATE_AT_KNEE
    return np.asarray(np.where(amounts < _LEAST_AMOUNT, z + step, np.where(amounts < _AT_KNEE, lower, upper)))


@dataclass(frozen=True, slots=True, eq=False)
class Sensed:
    """Readings as the errors need them, in the world frame and in the order of their acquisition.

    Attributes:
        points: sensed points, or origins of free-space rays ``(n, 3)`` [m].
        aims: directions of beam or approach, else against the normal ``(n, 3)``.
        hit: mask of the readings that sensed a surface ``(n,)``.
        directions: directions of free-space rays and beams ``(n, 3)``.
        groups: value of the column ``group`` of each reading; empty for none.
        labels: label of each reading; empty for none.
        T_world_units: poses of the range sensors ``(n, 4, 4)`` [m], for readings of a rig.
        units: index of the device of each reading ``(n,)``.
        sds: standard deviation along the beam or normal ``(n,)`` [m].
        on_surface: mask of the readings that are points of one face ``(n,)``.
        Ts_world_hand: poses of the hand ``(n, 4, 4)`` [m].
    """

    points: Vectors
    aims: Column
    hit: BoolArray
    directions: Column
    groups: tuple[str, ...]
    labels: tuple[str, ...]
    T_world_units: Column
    units: IntArray
    sds: FloatArray
    on_surface: BoolArray
    Ts_world_hand: Column

    def aimed(self) -> Vectors:
        """Return the directions of the readings that sensed a surface; zero for others ``(n, 3)``."""
        return self.aims.only(self.hit).filled(0.0)


@dataclass(frozen=True, slots=True, eq=False)
class Columns:
    """Effect of one error on all readings.

    Attributes:
        points: derivative of points, and of origins of free-space rays, by the states ``(n, 3, d)``.
        names: description of each state ``(d,)``.
        turns: derivative of the directions of free-space rays ``(n, 3, d)``; None for zero.
        covs: remaining independent covariance of each point ``(n, 3, 3)`` [m^2]; None for zero.
    """

    points: FloatArray
    names: tuple[str, ...]
    turns: FloatArray | None = None
    covs: Covariances | None = None


@dataclass(frozen=True, slots=True)
class ErrorState(ABC):
    """Error that readings share, with the standard deviation of its prior.

    Attributes:
        sd: standard deviation of each state, in the unit of the class.
    """

    sd: float
    name: ClassVar[str]
    unit: ClassVar[str] = "m"
    along_aim: ClassVar[bool] = False
    """Whether the error acts along the approach; readings without one then have it as independent noise."""
    center: ClassVar[float] = 0.0
    """Mean of each state over ``sd``."""
    spread: ClassVar[float] = 1.0
    """Standard deviation of each state about its mean, over ``sd``."""
    one_sided: ClassVar[bool] = False
    """Whether each state is an amount from none on, see :func:`one_sided`."""
    by_face: ClassVar[bool] = False
    """Whether each face of the part has a state; the class has an attribute ``faces`` then."""

    def __post_init__(self) -> None:
        check_number(self.name, self.sd, self.unit)
        if not 0 < self.sd <= LARGEST:
            raise InputError(
                f"{self.name}: expected a standard deviation above 0 and up to {LARGEST:g} {self.unit}, got "
                f"{self.sd:g}. Check its unit."
            )

    def amounts(self, z: FloatArray) -> FloatArray:
        """Return the values of states from whitened ones, in the unit of the class.

        Args:
            z: whitened states, standard normal a priori.
        """
        return self.sd * (self.center + self.spread * (one_sided(z) if self.one_sided else z))

    @abstractmethod
    def columns(self, sensed: Sensed) -> Columns:
        """Return the derivative of each reading by the states.

        Args:
            sensed: the readings.
        """


@dataclass(frozen=True, slots=True)
class Offset(ErrorState):
    """Offset along the approach [m]: of the trigger point, the zero or the ball's radius.

    Approaches along z of the world have an offset of their own, since most probes, feeds and allowances differ between
    the sides and the top. A slanted approach has each offset in the measure in which it runs along its axes.

    Attributes:
        common: whether the offset is exactly the same for all directions, as that of a wrong ball radius.
    """

    common: bool = False
    name: ClassVar[str] = "offset"
    along_aim: ClassVar[bool] = True

    def columns(self, sensed: Sensed) -> Columns:
        """Return the approach directions, whole or by their parts across and along z.

        Args:
            sensed: the readings.
        """
        aims = sensed.aimed()
        if self.common:
            return Columns(aims[..., None], ("offset of all readings along the approach",))
        parts = np.array([[1.0, 1.0, 0.0], [0.0, 0.0, 1.0]]).T
        return Columns(aims[:, :, None] * parts, ("offset of approaches along xy", "offset of approaches along z"))


@dataclass(frozen=True, slots=True)
class OffsetByAxes(ErrorState):
    """Offset of approaches along some axes of the world [m], such as of a probe that triggers later in x and y.

    A slanted approach has each offset in the measure in which it runs along its axes.

    Attributes:
        axes: the axes, such as ``xy``.
    """

    axes: str = "xyz"
    name: ClassVar[str] = "offset by axes"
    along_aim: ClassVar[bool] = True

    def columns(self, sensed: Sensed) -> Columns:
        """Return the components of the approach directions along the axes.

        Args:
            sensed: the readings.
        """
        kept = np.array([axis in self.axes for axis in "xyz"])
        names = (f"offset of approaches along {self.axes}",)
        return Columns((sensed.aimed() * kept)[..., None], names)


@dataclass(frozen=True, slots=True)
class Backlash(ErrorState):
    """Backlash of each machine axis [m]: an axis stands off by it in the direction in which it moved last."""

    name: ClassVar[str] = "backlash"
    along_aim: ClassVar[bool] = True

    def columns(self, sensed: Sensed) -> Columns:
        """Return the sign of the motion of each axis, for axes that move.

        Args:
            sensed: the readings.
        """
        moved = sensed.aimed()
        sign = np.where(np.abs(moved) > 1e-3, np.sign(moved), 0.0)
        return Columns(sign[:, :, None] * np.eye(3), tuple(f"backlash of {axis}" for axis in "xyz"))


@dataclass(frozen=True, slots=True)
class Lobes(ErrorState):
    """Offset that varies with the heading of the approach about z [m], as that of a probe with three contacts.

    The states are the cosines and sines of two and three times the heading. Those of the heading itself would move all
    readings equally.
    """

    name: ClassVar[str] = "lobes"
    along_aim: ClassVar[bool] = True

    def columns(self, sensed: Sensed) -> Columns:
        """Return the harmonics, along the approach.

        Args:
            sensed: the readings.
        """
        aims = sensed.aimed()
        heading, level = np.arctan2(aims[:, 1], aims[:, 0]), np.linalg.norm(aims[:, :2], axis=1)
        waves = [wave(k * heading) for k in (2, 3) for wave in (np.cos, np.sin)]
        names = tuple(f"{wave} of {k} lobes" for k in (2, 3) for wave in ("cosine", "sine"))
        return Columns(aims[:, :, None] * (level * np.array(waves)).T[:, None, :], names)


@dataclass(frozen=True, slots=True)
class OffsetByGroup(ErrorState):
    """Offset along the approach of each value of the column ``group`` [m]: a scan line, a speed, a tool, a pass."""

    name: ClassVar[str] = "offset by group"
    along_aim: ClassVar[bool] = True

    def columns(self, sensed: Sensed) -> Columns:
        """Return the approach directions of each group.

        Args:
            sensed: the readings.

        Raises:
            InputError: no reading has a group.
        """
        named = list(dict.fromkeys(name for name, hit in zip(sensed.groups, sensed.hit, strict=True) if name and hit))
        if not named:
            raise InputError("offset by group: expected a column group (or line), got none. Add it, or omit the error.")
        members = np.array([[group == name for name in named] for group in sensed.groups], dtype=np.float64)
        return Columns(sensed.aimed()[:, :, None] * members[:, None, :], tuple(f"offset of group {n}" for n in named))


@dataclass(frozen=True, slots=True)
class Scale(ErrorState):
    """Error of all lengths about the world's origin [1]: thermal expansion, shrinkage, steps per millimetre."""

    name: ClassVar[str] = "scale"
    unit: ClassVar[str] = "1"

    def columns(self, sensed: Sensed) -> Columns:
        """Return the points.

        Args:
            sensed: the readings.
        """
        return Columns(sensed.points[..., None], ("world scale",))


@dataclass(frozen=True, slots=True)
class Drift(ErrorState):
    """Drift of the device over the run [m], in proportion to the order of the readings; the first one has none."""

    name: ClassVar[str] = "drift"

    def columns(self, sensed: Sensed) -> Columns:
        """Return the part of the run that has passed, for each axis of the world.

        Args:
            sensed: the readings.
        """
        passed = np.linspace(0.0, 1.0, len(sensed.points))
        return Columns(passed[:, None, None] * np.eye(3), tuple(f"drift along {axis}" for axis in "xyz"))


@dataclass(frozen=True, slots=True)
class TriggerDrift(ErrorState):
    """Drift of the trigger point over the run [m], along each approach."""

    name: ClassVar[str] = "trigger drift"
    along_aim: ClassVar[bool] = True

    def columns(self, sensed: Sensed) -> Columns:
        """Return the part of the run that has passed, along the approach.

        Args:
            sensed: the readings.
        """
        passed = np.linspace(0.0, 1.0, len(sensed.points))
        return Columns(passed[:, None, None] * sensed.aimed()[..., None], ("drift of the trigger point",))


@dataclass(frozen=True, slots=True)
class Form(ErrorState):
    """Smooth deviation of the part from its CAD [m]: bending, warp, shrinkage.

    A normal random field of displacements with covariance ``sd^2 exp(-d^2 / (2 length^2))`` in each axis. Its leading
    components at the readings are states, and the remainder is independent noise.

    Attributes:
        length: correlation length [m]; None for half of the extent of the points, without distant outliers.
    """

    length: float | None = None
    name: ClassVar[str] = "form"

    def columns(self, sensed: Sensed) -> Columns:
        """Return the leading components of the field at the readings, in each axis.

        Args:
            sensed: the readings.
        """
        return _field(sensed.points, np.flatnonzero(sensed.hit), self.sd, self.length)


_MOST_COMPONENTS = 8
"""Numerical: most components of a field in one axis; with the default length these are 99 % of the variance."""

_NODES = 64
"""Numerical: most readings from which the components are computed; more change the field less than what eight
components omit."""


def _field(points: Vectors, rows: IntArray, sd: float, length: float | None) -> Columns:
    """Return the leading components of a smooth field of displacements at some readings, in each axis."""
    n, at = len(points), points[rows]
    if not len(at):
        return Columns(np.zeros((n, 3, 0)), ())
    length = length or _half_extent(at)
    some = at[np.linspace(0, len(at) - 1, min(len(at), _NODES)).round().astype(np.int64)]
    values, vectors = np.linalg.eigh(_smooth(some, some, length))
    count = min(_MOST_COMPONENTS, int(np.count_nonzero(values > 1e-9 * values[-1])))
    values, vectors = values[::-1][:count], vectors[:, ::-1][:, :count]
    field_at = _smooth(at, some, length) @ vectors / np.sqrt(values)  # Nystroem, exact where all points are used
    columns = np.zeros((n, 3, 3 * count))
    columns[rows] = np.einsum("nk,ij->nikj", field_at, np.eye(3)).reshape(len(at), 3, 3 * count)
    rest = np.zeros(n)
    rest[rows] = np.maximum(1 - np.sum(field_at**2, axis=1), 0)
    names = tuple(f"form, component {k + 1} along {axis}" for k in range(count) for axis in "xyz")
    return Columns(columns, names, covs=sd**2 * rest[:, None, None] * np.eye(3))


def smooth_correlation(points: Vectors) -> FloatArray:
    """Return the correlation of a smooth field at points, whose length is half of their extent ``(n, n)``.

    Args:
        points: the points ``(n, 3)`` [m].
    """
    return _smooth(points, points, _half_extent(points))


_DISTANT = 10.0
"""Numerical: distance from the median of the points, over the median of such distances, beyond which a point is no part
of their extent. Of even points on a box, a rod or a sheet none is beyond 3."""


def _half_extent(points: Vectors) -> float:
    """Return half of the diagonal of the box of some points without distant outliers [m]."""
    away = np.linalg.norm(points - np.median(points, axis=0), axis=1)
    points = points[away <= max(_DISTANT * float(np.median(away)), float(away.min()))]
    return max(0.5 * float(np.linalg.norm(np.ptp(points, axis=0))), 1e-6)


def _smooth(a: Vectors, b: Vectors, length: float) -> FloatArray:
    """Return the correlation of a smooth field at points ``a`` and ``b``."""
    squares = (a**2).sum(axis=1)[:, None] + (b**2).sum(axis=1) - 2 * a @ b.T
    return np.asarray(np.exp(-0.5 * np.maximum(squares, 0.0) / length**2))


@dataclass(frozen=True, slots=True)
class Fan(ErrorState):
    """Error of the beams' angles of each range sensor [rad]: three turns about its origin, and its opening."""

    name: ClassVar[str] = "fan"
    unit: ClassVar[str] = "rad"

    def columns(self, sensed: Sensed) -> Columns:
        """Return the displacement of points and ray directions by each angle.

        Args:
            sensed: the readings.

        Raises:
            InputError: there are no ranges of a rig.
        """
        n, given = len(sensed.points), sensed.T_world_units.given
        if not given.any():
            raise InputError("fan: expected ranges of a sensor on a rig, got none. Omit the error, or give the rig.")
        Ts = sensed.T_world_units.filled(0.0)
        points, turns, names = [], [], []
        for unit in np.unique(sensed.units[given]):
            rows = np.flatnonzero(given & (sensed.units == unit))
            rays = rows[~sensed.hit[rows]]
            J, W = np.zeros((n, 3, 4)), np.zeros((n, 3, 4))
            axes = Ts[rows][:, :3, :3]
            own = np.einsum("nij,ni->nj", axes, sensed.directions[rows])
            middle = own.mean(axis=0) / np.linalg.norm(own.mean(axis=0))
            outward = own - (own @ middle)[:, None] * middle
            widest = float(np.linalg.norm(outward, axis=1).max())
            J[rows, :, :3] = body_jacobian(Ts[rows], sensed.points[rows])[..., 3:]
            if widest > 1e-6:
                beyond = np.einsum("nij,nj->ni", axes, outward / widest)
                reach = np.linalg.norm(sensed.points[rows] - Ts[rows][:, :3, 3], axis=1)
                J[rows, :, 3] = reach[:, None] * beyond
                W[rows, :, 3] = beyond
            ahead = sensed.points[rays] + sensed.directions[rays]
            W[rays, :, :3] = body_jacobian(Ts[rays], ahead)[..., 3:] - J[rays, :, :3]
            W[rows[sensed.hit[rows]]] = 0.0
            J[rays, :, 3] = 0.0
            points.append(J)
            turns.append(W)
            names += [*(f"turn of the beams about {axis}" for axis in "xyz"), "opening of the beams"]
        return Columns(np.concatenate(points, axis=2), tuple(names), np.concatenate(turns, axis=2))


@dataclass(frozen=True, slots=True)
class Stock(ErrorState):
    """Material left on the CAD surface [m]: each face has its own amount, from none to about the stated one and more.

    The prior of each amount is even from none to 0.84 of the stated amount, and normal above: more than the stated
    amount has a probability of 0.05, less than none has none. Readings are grouped by face
    (:func:`~tanteo.sensors.face_groups.faces_of`).

    Attributes:
        uniform: whether all faces have the same amount.
        faces: index of the face of each reading in an assumed pose, as in :class:`FaceOffset`; empty for no pose.
    """

    uniform: bool = False
    faces: tuple[int, ...] = ()
    name: ClassVar[str] = "stock"
    along_aim: ClassVar[bool] = True
    center: ClassVar[float] = ONE_SIDED[0]
    spread: ClassVar[float] = ONE_SIDED[1]
    one_sided: ClassVar[bool] = True
    by_face: ClassVar[bool] = True

    def columns(self, sensed: Sensed) -> Columns:
        """Return the approach directions of each face.

        Args:
            sensed: the readings.
        """
        aims = sensed.aimed()
        if self.uniform:
            return Columns(aims[:, :, None], ("stock",))
        return _columns_of_faces(aims, *_groups(sensed, 0.0, self.faces), "stock")


@dataclass(frozen=True, slots=True)
class FaceOffset(ErrorState):
    """Offset of each face of the made part from its CAD [m], which all readings of the face share.

    See :func:`made_surface`. The offsets of two faces are independent, also if the faces lie in one plane, like two
    bosses of a casting. The readings alone do not distinguish such faces; ``faces`` does. The faces of readings without
    an approach are unknown: these readings have a smooth field of displacements instead, see :class:`Form`. Centres of
    round features have the offset as independent noise.

    Attributes:
        faces: index of the face of each reading in an assumed pose of the part, -1 if unknown, in the order of the
            readings; empty for no pose. Readings of two faces never share an offset, unless they share a label.
    """

    faces: tuple[int, ...] = ()
    name: ClassVar[str] = "face offset"
    by_face: ClassVar[bool] = True

    def columns(self, sensed: Sensed) -> Columns:
        """Return the approach directions of each face, and the field at readings without one.

        Args:
            sensed: the readings.
        """
        numbers, aims = _groups(sensed, self.sd, self.faces)
        of_faces = _columns_of_faces(sensed.aimed(), numbers, aims, "offset")
        bare = sensed.hit & sensed.on_surface & ~sensed.aims.given
        field = _field(sensed.points, np.flatnonzero(bare), self.sd, None)
        alone = self.sd**2 * ((numbers < 0) & ~bare)[:, None, None] * np.eye(3)
        covs = alone if field.covs is None else alone + field.covs
        return Columns(
            np.concatenate([of_faces.points, field.points], axis=2), (*of_faces.names, *field.names), covs=covs
        )


WITHIN_FACE = 1 / 3
"""Standard deviation of a surface within one face, over that of the face as a whole: ISO 2768 pairs each class of sizes
with flatness of a third of it (63 to 100 mm: class f, 0.3 mm, with H, 0.1 mm; class m, 0.6 mm, with K, 0.2 mm)."""


def on_faces(errors: Sequence[ErrorState], faces: tuple[int, ...]) -> tuple[ErrorState, ...]:
    """Return errors whose states by face are divided by the faces of the part in an assumed pose.

    Args:
        errors: the errors.
        faces: index of the face of each reading, -1 if unknown.
    """
    return tuple(replace(one, faces=faces) if one.by_face else one for one in errors)  # type: ignore[call-arg]


def made_surface(sd: float, faces: tuple[int, ...] = ()) -> tuple[tuple[ErrorState, ...], float]:
    """Return the error states of a made part's surface, and the standard deviation that each point has alone [m].

    Each face deviates from its CAD as a whole (:class:`FaceOffset`), so that many touches do not average its deviation,
    and by :data:`WITHIN_FACE` of that within itself.

    Args:
        sd: standard deviation of the surface from its CAD [m]; 0 for an exact part.
        faces: index of the face of each reading, see :class:`FaceOffset`; empty for no assumed pose.
    """
    return ((FaceOffset(sd, faces),) if sd > 0 else ()), sd * WITHIN_FACE


def _groups(sensed: Sensed, sd: float, faces: tuple[int, ...]) -> tuple[IntArray, Vectors]:
    """Return the number of the face of each reading, and an approach to each face.

    Args:
        sensed: the readings.
        sd: standard deviation of the offset of a face [m], which varies by :data:`WITHIN_FACE` of it within the face.
        faces: index of the face of each reading in an assumed pose; empty for no pose.
    """
    own = np.sqrt((WITHIN_FACE * sd) ** 2 + sensed.sds**2)
    found = faces_of(sensed.points, sensed.aimed(), sensed.on_surface, own, sensed.labels)
    return divided(*found, faces, sensed.labels)


def _columns_of_faces(aims: Vectors, numbers: IntArray, of_faces: Vectors, what: str) -> Columns:
    """Return the columns of one state for each face."""
    members = (numbers[:, None] == np.arange(len(of_faces))[None]).astype(np.float64)
    names = tuple(f"{what} of the face approached along ({', '.join(f'{v:.2f}' for v in aim)})" for aim in of_faces)
    return Columns(aims[:, :, None] * members[:, None, :], names)


MOUNTED = math.radians(0.5) / math.sqrt(3)
"""Assumed standard deviation of the angles of a range sensor [rad]. A bracket whose shorter leg has 10 to 50 mm is
within half a degree (ISO 2768-1, classes f and m); angles are even within it."""

ANGLES = "mounting angles of "
"""Beginning of the name of an assumed error of angles, before the name of the device."""

ERROR_STATES: dict[str, type[ErrorState]] = {
    one.name: one
    for one in (
        Offset,
        OffsetByAxes,
        Backlash,
        Lobes,
        OffsetByGroup,
        Scale,
        Drift,
        TriggerDrift,
        Form,
        Fan,
        Stock,
        FaceOffset,
    )
}
"""Errors by name."""

SCALE_PER_NOISE = 4.0
"""Assumed standard deviation of the world scale over that of the noise [1/m]. An industrial robot is off by 0.97 mm
over 1.45 m with a noise of 0.05 to 0.1 mm (Nubiola and Bonev 2013): 7 to 13 times. Row scale of
``benchmarks/shared_errors.py``: 4 times cover it, and widen answers to accurate machines less. Steel 0.35 K warmer is
off by 4 um/m, beside a probe of 1 um."""

LARGEST_SCALE = 7e-4
"""Largest assumed standard deviation of the world scale: that of a robot without calibration (Nubiola and Bonev
2013)."""

MACHINE = 3.0
"""Reach of large industrial robots [m]. If the origin of the world is farther from the readings, it is no machine's."""

BENDS: dict[type[ErrorState], dict[float, float]] = {
    Drift: {0.0: 0.95, 1.0: 0.02, 3.0: 0.02, 10.0: 0.01},
    Form: {0.4: 0.84, 3.0: 0.12, 10.0: 0.04},
}
"""Prior probabilities of the sd of drift and warp over that of the noise, up to what one reading reveals. No part is
exactly its CAD, and twenty readings do not distinguish a small warp from a larger noise: its smallest size is not zero.
Rows none, drift and warp of ``benchmarks/shared_errors.py``: at least 0.85 covered with either, about 0.99 without."""


@dataclass(frozen=True, slots=True, eq=False)
class UnstatedError:
    """Error that readings may share although it is not stated.

    A precise device also has small systematic errors. They are therefore assumed in proportion to the noise.

    Attributes:
        name: name of the error.
        noise: typical standard deviation of a reading [m].
        sensed: the readings.
        sizes: possible standard deviations of the states with their prior probabilities.
    """

    name: str
    noise: float
    sensed: Sensed
    sizes: Mapping[float, float]

    def columns(self, used: BoolArray | None = None) -> FloatArray:
        """Return the derivative of each point by the states, whose unit is the noise ``(n, 3, d)`` [m].

        The scale acts about the origin of the world, or about the readings if that is farther away than any machine
        reaches.

        Args:
            used: mask of the points on the part ``(n,)``; others have no part in extent and middle. None for all.
        """
        rows = np.flatnonzero(self.sensed.hit)
        used = np.ones(len(rows), dtype=np.bool_) if used is None else used
        points = self.sensed.points[rows]
        if self.name == Scale.name:
            middle = points[used].mean(axis=0)
            origin = middle if float(np.linalg.norm(middle)) > MACHINE else np.zeros(3)
            out = min(SCALE_PER_NOISE * self.noise, LARGEST_SCALE) * (points - origin)[..., None]
        else:
            hit = np.zeros(len(self.sensed.hit), dtype=np.bool_)
            hit[rows[used]] = True
            columns = ERROR_STATES[self.name](self.noise).columns(replace(self.sensed, hit=hit))
            out = self.noise * columns.points[rows]
        return np.where(used[:, None, None], out, 0.0)


def unstated_errors(
    sensed: Sensed, noise: float, stated: Sequence[ErrorState], *, machine: bool = False
) -> tuple[UnstatedError, ...]:
    """Return the errors that readings are assumed to share: scale of the world, drift over the run, warp of the part.

    A stated error replaces the assumed one.

    Args:
        sensed: the readings.
        noise: typical standard deviation of a reading [m].
        stated: errors that the user states.
        machine: whether the errors of the machine are stated, and with them its scale.
    """
    if not sensed.hit.any():
        return ()
    known = {error.name for error in stated}
    assumed: dict[type[ErrorState], dict[float, float]] = {**({} if machine else {Scale: {1.0: 1.0}}), **BENDS}
    unstated = [(cls.name, sizes) for cls, sizes in assumed.items() if cls.name not in known]
    return tuple(UnstatedError(name, noise, sensed, sizes) for name, sizes in unstated)
