"""Where the hand may be: what a person knows of the cell before anything is sensed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from tanteo.errors import InputError
from tanteo.frames import frozen_array
from tanteo.hand.robot import Body
from tanteo.lie import SE3
from tanteo.typing import BoolArray, FloatArray, Transforms, Vectors

_STILL = 1e-12
"""A way along which a coordinate changes less than this is square to it [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class ForbiddenBox:
    """A box that the hand's body stays out of, fingers and palm.

    Attributes:
        name: In messages.
        low: Corner in the box's frame ``(3,)`` [m].
        high: Corner ``(3,)`` [m].
        T_world_box: Where its frame is ``(4, 4)``; the world's if left out.

    Raises:
        InputError: Corners that are not three finite numbers in order, or no rigid pose.
    """

    name: str
    low: FloatArray
    high: FloatArray
    T_world_box: Transforms = field(default_factory=lambda: np.eye(4))

    def __post_init__(self) -> None:
        low, high = _corners(f"forbidden box '{self.name}'", self.low, self.high)
        T = frozen_array(self.T_world_box)
        if not (np.isfinite(low).all() and np.isfinite(high).all()):
            raise InputError(f"forbidden box '{self.name}': expected finite corners, got others. Bound the workspace.")
        if T.shape != (4, 4) or not np.allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-6):
            raise InputError(f"forbidden box '{self.name}': expected a rigid pose (4, 4), got another. Correct it.")
        for name, value in (("low", low), ("high", high), ("T_world_box", T)):
            object.__setattr__(self, name, value)

    def distances(self, points: Vectors) -> tuple[FloatArray, Vectors]:
        """How far points ``(*batch, 3)`` are outside ``(*batch,)`` [m], negative inside, and the unit way out."""
        local = SE3.apply(SE3.inverse(self.T_world_box), points) - 0.5 * (self.low + self.high)
        beyond = np.abs(local) - 0.5 * (self.high - self.low)
        outside = np.maximum(beyond, 0.0)
        far = np.linalg.norm(outside, axis=-1)
        # inside, and on the surface, the nearest face is the way out
        nearest = np.eye(3)[np.argmax(beyond, axis=-1)]
        away = np.where((far > 0)[..., None], outside / np.where(far > 0, far, 1.0)[..., None], nearest)
        away = away * np.where(local < 0, -1.0, 1.0)
        return far + np.minimum(beyond.max(axis=-1), 0.0), np.asarray(away @ self.T_world_box[:3, :3].T)

    def crossed(self, starts: Vectors, ends: Vectors, room: float = 0.0) -> BoolArray:
        """Whether straight ways ``(*batch, 3)`` lead through the box, ``room`` larger on all sides ``(*batch,)``.

        A way that only touches it does not.
        """
        to_box = SE3.inverse(self.T_world_box)
        here, there = SE3.apply(to_box, starts), SE3.apply(to_box, ends)
        along = np.where(np.abs(there - here) < _STILL, _STILL, there - here)
        at = (self.low - room - here) / along, (self.high + room - here) / along  # shares of the way
        enters, leaves = np.minimum(*at).max(axis=-1), np.maximum(*at).min(axis=-1)
        return np.asarray((enters < leaves) & (enters < 1) & (leaves > 0))


@dataclass(frozen=True, slots=True, eq=False)
class Workspace:
    """A box in the world that the hand's body stays inside, and boxes that it stays out of.

    The table's top is usually the floor. What no sensor of the hand looks at, above all what is beside its palm, is
    safe only if it is stated here.

    Attributes:
        low: Corner ``(3,)`` [m]; may be minus infinity.
        high: Corner ``(3,)`` [m]; may be infinity.
        forbidden: Boxes to stay out of; names are unique.

    Raises:
        InputError: Corners that are not three numbers in order, or two forbidden boxes of one name.
    """

    low: FloatArray
    high: FloatArray
    forbidden: Sequence[ForbiddenBox] = ()

    def __post_init__(self) -> None:
        low, high = _corners("workspace", self.low, self.high)
        names = [b.name for b in self.forbidden]
        if len(set(names)) < len(names):
            raise InputError(f"workspace: expected forbidden boxes with names of their own, got {names}. Rename one.")
        for name, value in (("low", low), ("high", high), ("forbidden", tuple(self.forbidden))):
            object.__setattr__(self, name, value)

    @classmethod
    def everywhere(cls, forbidden: Sequence[ForbiddenBox] = ()) -> Workspace:
        """No outer bound."""
        return cls(np.full(3, -np.inf), np.full(3, np.inf), forbidden)

    @classmethod
    def above(cls, height: float, forbidden: Sequence[ForbiddenBox] = ()) -> Workspace:
        """Everything above a horizontal table [m]."""
        return cls(np.array([-np.inf, -np.inf, height]), np.full(3, np.inf), forbidden)

    @property
    def limits(self) -> tuple[str, ...]:
        """What each column of :meth:`rooms` is, in words: the finite bounds, then the forbidden boxes."""
        ends = (("low", self.low), ("high", self.high))
        bounds = [f"the {end} end of its workspace in {'xyz'[k]}" for end, b in ends for k in _finite(b)]
        return (*bounds, *(f"the forbidden box '{b.name}'" for b in self.forbidden))

    def rooms(self, points: Vectors) -> tuple[FloatArray, Vectors]:
        """Distances of points ``(*batch, 3)`` from every limit and the directions away from it.

        Returns:
            ``(*batch, m)`` [m], negative where the point may not be, and unit vectors ``(*batch, m, 3)``, with the
            ``m`` limits in the order of :attr:`limits`.
        """
        low, high = _finite(self.low), _finite(self.high)
        inwards = np.concatenate([np.eye(3)[low], -np.eye(3)[high]])
        rooms = [points[..., low] - self.low[low], self.high[high] - points[..., high]]
        ways = [np.broadcast_to(inwards, (*points.shape[:-1], *inwards.shape))]
        for box in self.forbidden:
            far, away = box.distances(points)
            rooms.append(far[..., None])
            ways.append(away[..., None, :])
        return np.concatenate(rooms, axis=-1), np.concatenate(ways, axis=-2)

    def of_body(self, body: Body, Ts_world_hand: Transforms) -> FloatArray:
        """Distances of the whole body from every limit with the hand at poses ``(*batch, 4, 4)``: ``(*batch, m)``."""
        return np.asarray((self.rooms(body.placed(Ts_world_hand))[0] - body.radii[:, None]).min(axis=-2))

    def clear(self, body: Body, Ts_world_hand: Transforms) -> FloatArray:
        """Least distance of the whole body from all limits with the hand at poses ``(*batch, 4, 4)``.

        Returns:
            ``(*batch,)`` [m]: negative where the hand may not be, infinite where there are no limits.
        """
        return np.asarray(self.of_body(body, Ts_world_hand).min(axis=-1, initial=np.inf))

    def allows(self, body: Body, Ts_world_hand: Transforms, clearance: float = 0.0) -> BoolArray:
        """At which poses ``(*batch, 4, 4)`` the whole body keeps a clearance [m] from all limits ``(*batch,)``."""
        return np.asarray(self.clear(body, Ts_world_hand) >= clearance)


def _finite(corner: FloatArray) -> list[int]:
    return [k for k in range(3) if np.isfinite(corner[k])]


def _corners(what: str, low: FloatArray, high: FloatArray) -> tuple[FloatArray, FloatArray]:
    low, high = frozen_array(low), frozen_array(high)
    if low.shape != (3,) or high.shape != (3,) or not (low < high).all():
        raise InputError(
            f"{what}: expected a low and a high corner of three numbers, got {low.tolist()} and {high.tolist()}. Put "
            "the smaller first."
        )
    return low, high
