"""What may stand in the hand's way: all that the belief holds, all that no reading has contradicted, and the bounds."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from tanteo.active import SensingState, Start
from tanteo.answers import box_corners
from tanteo.errors import InputError
from tanteo.hand import Body, Workspace
from tanteo.inference import PreparedPart
from tanteo.lie import SE3
from tanteo.measurements import ContactPoints, FreeRays
from tanteo.typing import BoolArray, FloatArray, IntArray, Transforms, Vectors

_DRAWN = 1000
"""Poses of every part that are looked at: of a prior pose as wide as a hand, one is then within 10 mm of the true."""

OFF = 0.010
"""A reading contradicts a pose that puts the surface farther from it, or material deeper into its way [m]."""

_STRAYS = 1
"""Readings that may contradict a pose that is still allowed: one may be wrong."""

_PACE, _MOST = 0.008, 12
"""From point to point on the way of a beam [m], back from its end, and how many of them."""

_APART = 0.005
"""Allowed poses of which every corner of the part's box is nearer than this to another's stand for each other [m]."""


def allowed(state: SensingState, most: int) -> tuple[Transforms, IntArray]:
    """Poses ``(K, 4, 4)``, at most about so many, spread over all that is allowed; and the part of each ``(K,)``.

    What the start and the readings say counts, probabilities do not; one of each part that has one is among them.
    """
    start, Ts, part = state.start, [np.zeros((0, 4, 4))], [np.zeros(0, dtype=np.int64)]
    left = {int(k): _uncontradicted(start, int(k), state.touches, state.free) for k in np.unique(start.part)}
    alive = [k for k, poses in left.items() if len(poses)]
    for k in alive:
        Ts.append(_spread(start.targets[k], left[k], max(1, most // len(alive))))
        part.append(np.full(len(Ts[-1]), k))
    return np.concatenate(Ts), np.concatenate(part)


def _uncontradicted(start: Start, part: int, touches: ContactPoints | None, free: FreeRays) -> Transforms:
    target, Ts = start.targets[part], start.drawn(part, _DRAWN)
    wrong = np.zeros(len(Ts), dtype=np.int64)
    if touches is not None and len(touches):
        wrong += (np.abs(_distances(target, Ts, touches.points) - touches.radii) > OFF).sum(axis=1)
        Ts, wrong = Ts[wrong <= _STRAYS], wrong[wrong <= _STRAYS]
        wrong += _crossed(target, Ts, touches.points, touches.directions, touches.reach)
    wrong += _crossed(target, Ts, free.origins + free.lengths[:, None] * free.directions, free.directions, free.lengths)
    return Ts[wrong <= _STRAYS]


def _crossed(
    target: PreparedPart, Ts: Transforms, ends: FloatArray, along: FloatArray, lengths: FloatArray
) -> IntArray:
    """How many ways, free over some lengths up to their ends, lead deep through the part at each pose ``(S,)``."""
    steps = _PACE * np.arange(1, 1 + _MOST)
    points = ends[:, None] - steps[:, None] * along[:, None]
    deep = _distances(target, Ts, points.reshape(-1, 3)).reshape(len(Ts), len(ends), _MOST) < -OFF
    return np.asarray((deep & (steps < lengths[:, None])).any(axis=2).sum(axis=1))


def _distances(target: PreparedPart, Ts: Transforms, points: FloatArray) -> FloatArray:
    """Of points ``(n, 3)`` from the part at poses ``(S, 4, 4)``, negative inside ``(S, n)`` [m]."""
    return target.field(SE3.apply(SE3.inverse(Ts)[:, None], points))[0]


def _spread(target: PreparedPart, Ts: Transforms, most: int) -> Transforms:
    """At most so many of some poses, each the one whose corners are farthest from those of the ones before."""
    corners = SE3.apply(Ts[:, None], box_corners(target.part))
    chosen, gaps = [0], np.full(len(Ts), np.inf)
    while True:
        np.minimum(gaps, np.linalg.norm(corners - corners[chosen[-1]], axis=-1).max(axis=1), out=gaps)
        if len(chosen) == most or gaps.max() < _APART:
            return Ts[chosen]
        chosen.append(int(np.argmax(gaps)))


_STEP, FAR = 0.008, 0.045
"""Of the grid [m], and the distance beyond which it says no more than that."""

_NODES = 5e7
"""The most nodes of a grid: what it takes is 400 MB."""


@dataclass(frozen=True, slots=True, eq=False)
class Occupied:
    """Least distance from some parts at poses, on a grid.

    Attributes:
        origin: its first node ``(3,)`` in the world [m].
        table: distances at its nodes, negative inside, :data:`FAR` where it is that or more ``(nx, ny, nz)`` [m].
    """

    origin: FloatArray
    table: FloatArray

    @classmethod
    def by(cls, targets: tuple[PreparedPart, ...], part: IntArray, Ts: Transforms) -> Occupied:
        """By parts at poses ``(K, 4, 4)``; a bit less than it is, by half a cell of the parts' own grids."""
        if not len(Ts):
            return cls(np.zeros(3), np.full((1, 1, 1), FAR))
        ends = np.array([_reach(targets[k], T) for k, T in zip(part, Ts, strict=True)])
        origin = ends[:, 0].min(axis=0)
        first = np.floor((ends[:, 0] - origin) / _STEP).astype(np.int64)
        last = np.ceil((ends[:, 1] - origin) / _STEP).astype(np.int64) + 1
        if np.prod(last.max(axis=0).astype(np.float64)) > _NODES:
            size = " x ".join(f"{v:.3g}" for v in ends[:, 1].max(axis=0) - origin)
            raise InputError(
                f"prior pose: expected the parts within some metres, got {size} m in which they may be. Say better "
                "where they are ([prior] of the scene, --pose-prior, or an image)."
            )
        table = np.full(last.max(axis=0), FAR)
        for k, T, a, b in zip(part, Ts, first, last, strict=True):
            axes = [origin[i] + _STEP * np.arange(a[i], b[i]) for i in range(3)]
            nodes, own = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1), targets[k].field
            block = table[a[0] : b[0], a[1] : b[1], a[2] : b[2]]
            np.minimum(block, own(SE3.apply(SE3.inverse(T), nodes))[0] - 0.5 * own.step, out=block)
        return cls(origin, table)

    def __call__(self, points: Vectors) -> FloatArray:
        """Distances at ``(*batch, 3)``, linear between the nodes ``(*batch,)`` [m]."""
        from scipy.ndimage import map_coordinates  # slow to import

        at = np.moveaxis((points - self.origin) / _STEP, -1, 0)
        return np.asarray(map_coordinates(self.table, at, order=1, mode="constant", cval=FAR, prefilter=False))


def _reach(target: PreparedPart, T: Transforms) -> FloatArray:
    """Corners of the box in the world outside of which the part is farther away than :data:`FAR` ``(2, 3)`` [m]."""
    corners = SE3.apply(T, box_corners(target.part))
    return np.stack([corners.min(axis=0) - FAR, corners.max(axis=0) + FAR])


_LIVE = 0.003
"""Modes of at least this probability are kept clear of."""

CONFIRMED = 0.999
"""Probability of a part from which the hand goes by the belief."""

_DRAWS, _ALLOWED = 24, 120
"""Poses drawn from the belief, and of all that no reading has contradicted."""


@dataclass(frozen=True, slots=True, eq=False)
class Possible:
    """Where parts may be, as poses.

    Attributes:
        targets: the parts.
        part: index of the part of each pose ``(K,)``.
        Ts: ``T_world_part`` ``(K, 4, 4)``, the likeliest first.
        occupied: distances from all of them.
    """

    targets: tuple[PreparedPart, ...]
    part: IntArray
    Ts: Transforms
    occupied: Occupied = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "occupied", Occupied.by(self.targets, self.part, self.Ts))

    @classmethod
    @lru_cache(maxsize=1)  # candidates and ways ask in turn
    def of(cls, state: SensingState) -> Possible:
        """Every live mode, samples from all of them, and what the prior allows and no reading contradicts.

        A belief may be wrong, and a hand that went by it alone would find out by touching.
        """
        live = np.flatnonzero(state.weights >= _LIVE)
        live = live[np.argsort(-state.weights[live], kind="stable")]
        Ts, part = [state.poses[live]], [state.part[live]]
        if state.draws is not None and len(state.draws.weights):
            w = np.cumsum(state.draws.weights)
            rows = np.unique(np.searchsorted(w, w[-1] * (np.arange(_DRAWS) + 0.5) / _DRAWS).clip(0, len(w) - 1))
            Ts.append(state.draws.Ts[rows])
            part.append(state.part[state.draws.mode[rows]])
        if state.of_parts().max(initial=0.0) < CONFIRMED:
            more, of = allowed(state, _ALLOWED)
            Ts.append(more)
            part.append(of)
        return cls(state.start.targets, np.concatenate(part), np.concatenate(Ts))

    def distances(self, points: Vectors) -> FloatArray:
        """Least distance of points ``(*batch, 3)`` from any of them ``(*batch,)`` [m]; a bit less, negative inside."""
        return self.occupied(points)

    def top(self) -> float:
        """Greatest height of any of them in the world [m]."""
        heights = [
            float((T[2, :3] @ self.targets[k].part.vertices.T).max() + T[2, 3])
            for k, T in zip(self.part, self.Ts, strict=True)
        ]
        return max(heights, default=-np.inf)


@dataclass(frozen=True, slots=True, eq=False)
class Room:
    """Whether the whole hand has room at some poses.

    Attributes:
        body: of the hand.
        workspace: where it may be.
        possible: what it must keep clear of.
        clearance: by how much [m].
        slack: more than that from the bounds of the workspace, where the guard of the motions slows down [m].
    """

    body: Body
    workspace: Workspace
    possible: Possible
    clearance: float
    slack: float = 2e-3

    def within(self, Ts_world_hand: Transforms) -> BoolArray:
        """Whether the workspace allows poses ``(*batch, 4, 4)``, ``(*batch,)``."""
        return self.workspace.allows(self.body, Ts_world_hand, self.clearance + self.slack)

    def gaps(self, Ts_world_hand: Transforms) -> FloatArray:
        """Least distance of the body from all that is possible at poses ``(*batch, 4, 4)``: ``(*batch,)`` [m]."""
        centres = self.body.placed(Ts_world_hand)
        return np.asarray((self.possible.distances(centres) - self.body.radii).min(axis=-1))

    def allows(self, Ts_world_hand: Transforms) -> BoolArray:
        """Whether there is room at poses ``(n, 4, 4)``: ``(n,)``."""
        ok = self.within(Ts_world_hand)
        ok[ok] = self.gaps(Ts_world_hand[ok]) >= self.clearance
        return ok

    def along(self, way: Transforms) -> bool:
        """Whether there is room on a way ``(n, 4, 4)``, or as much as at its beginning, which may be narrow."""
        here = self.workspace.of_body(self.body, way[0])
        bounds = np.minimum(self.clearance + self.slack, here - 1e-3)
        if not (self.workspace.of_body(self.body, way) >= bounds).all():
            return False
        gaps = self.gaps(way)
        return bool((gaps >= min(self.clearance, gaps[0] - 1e-3)).all())
