"""Workspace of the hand: bounds and forbidden boxes that the user states before anything is sensed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry import SE3, frozen_array
from tanteo.geometry.typing import BoolArray, FloatArray, Transforms, Vectors
from tanteo.hand.robot import Body

_STILL = 1e-12
"""Smallest component of a path along a box axis [m]; smaller ones are replaced by it to avoid a division by zero."""


@dataclass(frozen=True, slots=True, eq=False)
class ForbiddenBox:
    """Box that no part of the hand's body may enter.

    Attributes:
        name: name in messages.
        low: smallest corner ``(3,)``, box frame [m].
        high: largest corner ``(3,)``, box frame [m].
        T_world_box: pose of the box ``(4, 4)``; the world frame by default.

    Raises:
        InputError: The corners are not finite or not in order, or the pose is not rigid.
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
        """Return signed distances from the box, negative inside, and the unit directions out of it.

        Args:
            points: positions ``(*batch, 3)``, world frame [m].

        Returns:
            Distances ``(*batch,)`` [m] and directions ``(*batch, 3)``, world frame.
        """
        local = SE3.apply(SE3.inverse(self.T_world_box), points) - 0.5 * (self.low + self.high)
        beyond = np.abs(local) - 0.5 * (self.high - self.low)
        outside = np.maximum(beyond, 0.0)
        far = np.linalg.norm(outside, axis=-1)
        # inside and on the surface, the direction out is the normal of the nearest face
        nearest = np.eye(3)[np.argmax(beyond, axis=-1)]
        away = np.where((far > 0)[..., None], outside / np.where(far > 0, far, 1.0)[..., None], nearest)
        away = away * np.where(local < 0, -1.0, 1.0)
        return far + np.minimum(beyond.max(axis=-1), 0.0), np.asarray(away @ self.T_world_box[:3, :3].T)

    def crossed(self, starts: Vectors, ends: Vectors, margin: float = 0.0) -> BoolArray:
        """Return whether straight segments pass through the box enlarged on all sides; touching it does not count.

        Args:
            starts: start points ``(*batch, 3)``, world frame [m].
            ends: end points ``(*batch, 3)``, world frame [m].
            margin: enlargement of the box on every side [m].

        Returns:
            One flag per segment ``(*batch,)``.
        """
        to_box = SE3.inverse(self.T_world_box)
        here, there = SE3.apply(to_box, starts), SE3.apply(to_box, ends)
        along = np.where(np.abs(there - here) < _STILL, _STILL, there - here)
        at = (self.low - margin - here) / along, (self.high + margin - here) / along  # fractions of the segment
        enters, leaves = np.minimum(*at).max(axis=-1), np.maximum(*at).min(axis=-1)
        return np.asarray(~((enters >= leaves) | (enters >= 1) | (leaves <= 0)))  # also if an end is not a number


@dataclass(frozen=True, slots=True, eq=False)
class Workspace:
    """World-aligned box that the hand's body must stay inside, and boxes that it must stay out of.

    The lower z bound is usually the top of the table. Space that no sensor of the hand covers, above all beside the
    palm, is safe only if it is stated here.

    Attributes:
        low: smallest corner ``(3,)``, world frame [m]; may be minus infinity.
        high: largest corner ``(3,)``, world frame [m]; may be infinity.
        forbidden: forbidden boxes with unique names.

    Raises:
        InputError: The corners are not three numbers in order, or two forbidden boxes have the same name.
    """

    low: FloatArray
    high: FloatArray
    forbidden: Sequence[ForbiddenBox] = ()

    def __post_init__(self) -> None:
        low, high = _corners("workspace", self.low, self.high)
        names = [b.name for b in self.forbidden]
        if len(set(names)) < len(names):
            raise InputError(f"workspace: expected forbidden boxes with unique names, got {names}. Rename one.")
        for name, value in (("low", low), ("high", high), ("forbidden", tuple(self.forbidden))):
            object.__setattr__(self, name, value)

    @classmethod
    def everywhere(cls, forbidden: Sequence[ForbiddenBox] = ()) -> Workspace:
        """Return a workspace without outer bounds.

        Args:
            forbidden: forbidden boxes with unique names.
        """
        return cls(np.full(3, -np.inf), np.full(3, np.inf), forbidden)

    @classmethod
    def above(cls, height: float, forbidden: Sequence[ForbiddenBox] = ()) -> Workspace:
        """Return the workspace above a horizontal table.

        Args:
            height: world z of the top of the table [m].
            forbidden: forbidden boxes with unique names.
        """
        return cls(np.array([-np.inf, -np.inf, height]), np.full(3, np.inf), forbidden)

    @property
    def limits(self) -> tuple[str, ...]:
        """Return a description of each column of :meth:`margins`: the finite bounds, then the forbidden boxes."""
        ends = (("low", self.low), ("high", self.high))
        bounds = [f"the {end} end of its workspace in {'xyz'[k]}" for end, b in ends for k in _finite(b)]
        return (*bounds, *(f"the forbidden box '{b.name}'" for b in self.forbidden))

    def clearances(self, points: Vectors) -> tuple[FloatArray, Vectors]:
        """Return the signed distances of points from every limit, and the directions away from the limits.

        Args:
            points: positions ``(*batch, 3)``, world frame [m].

        Returns:
            Distances ``(*batch, m)`` [m], negative where the point is not allowed, and unit vectors
            ``(*batch, m, 3)``, with the ``m`` limits in the order of :attr:`limits`.
        """
        low, high = _finite(self.low), _finite(self.high)
        inwards = np.concatenate([np.eye(3)[low], -np.eye(3)[high]])
        margins = [points[..., low] - self.low[low], self.high[high] - points[..., high]]
        ways = [np.broadcast_to(inwards, (*points.shape[:-1], *inwards.shape))]
        for box in self.forbidden:
            far, away = box.distances(points)
            margins.append(far[..., None])
            ways.append(away[..., None, :])
        return np.concatenate(margins, axis=-1), np.concatenate(ways, axis=-2)

    def of_body(self, body: Body, Ts_world_hand: Transforms) -> FloatArray:
        """Return the distance of the whole body from every limit.

        Args:
            body: spheres of the hand.
            Ts_world_hand: poses of the hand ``(*batch, 4, 4)``.

        Returns:
            Distances ``(*batch, m)`` [m], with the ``m`` limits in the order of :attr:`limits`.
        """
        return np.asarray((self.clearances(body.placed(Ts_world_hand))[0] - body.radii[:, None]).min(axis=-2))

    def clear(self, body: Body, Ts_world_hand: Transforms) -> FloatArray:
        """Return the smallest distance of the whole body from all limits.

        Args:
            body: spheres of the hand.
            Ts_world_hand: poses of the hand ``(*batch, 4, 4)``.

        Returns:
            Distances ``(*batch,)`` [m], negative where the pose is not allowed, infinite without limits.
        """
        return np.asarray(self.of_body(body, Ts_world_hand).min(axis=-1, initial=np.inf))

    def allows(self, body: Body, Ts_world_hand: Transforms, clearance: float = 0.0) -> BoolArray:
        """Return whether the whole body keeps a clearance from all limits.

        Args:
            body: spheres of the hand.
            Ts_world_hand: poses of the hand ``(*batch, 4, 4)``.
            clearance: required distance [m].

        Returns:
            One flag per pose ``(*batch,)``.
        """
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
