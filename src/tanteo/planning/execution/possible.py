"""Free space of the hand: the possible poses of the parts are obstacles.

A pose is possible if the posterior has it, or if the prior has it and the readings do not contradict it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from tanteo.errors import InputError
from tanteo.factors import ContactPoints, FreeRays
from tanteo.geometry import SE3
from tanteo.geometry.typing import BoolArray, FloatArray, IntArray, Transforms, Vectors
from tanteo.hand import Body, Workspace
from tanteo.hand.simulator.arm import Reach
from tanteo.planning.start import Start
from tanteo.planning.state import SensingState
from tanteo.posterior import PreparedPart, box_corners

_DRAWN = 1000
"""Number of sampled prior poses of each part that are checked. If the prior is as wide as a hand, one sample is within
10 mm of the true pose."""

OFF = 0.010
"""Distance between reading and surface beyond which the reading contradicts a pose [m]."""

_STRAYS = 1
"""Number of readings that may contradict a possible pose, because one may be an outlier."""

_PACE, _MOST = 0.008, 12
"""Spacing [m] and largest number of the points that are checked along the free part of a beam, from its end
backward."""

_APART = 0.005
"""Largest distance between the corners of the part's box at two poses up to which the poses count as equal [m]."""


def allowed(state: SensingState, most: int) -> tuple[Transforms, IntArray]:
    """Return prior poses that the readings do not contradict, as different from each other as possible.

    Probabilities are not used. Every part with such a pose has at least one in the result.

    Args:
        state: posterior of the session with its prior poses and readings.
        most: approximate largest number of poses.

    Returns:
        Poses ``T_world_part`` ``(K, 4, 4)`` and the index of the part of each ``(K,)``.
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
    """Return the number of free segments that pass deep through the part at each pose ``(S,)``."""
    steps = _PACE * np.arange(1, 1 + _MOST)
    points = ends[:, None] - steps[:, None] * along[:, None]
    deep = _distances(target, Ts, points.reshape(-1, 3)).reshape(len(Ts), len(ends), _MOST) < -OFF
    return np.asarray((deep & (steps < lengths[:, None])).any(axis=2).sum(axis=1))


def _distances(target: PreparedPart, Ts: Transforms, points: FloatArray) -> FloatArray:
    """Return signed distances of points ``(n, 3)`` from the part at poses ``(S, 4, 4)``, ``(S, n)`` [m]."""
    return target.field(SE3.apply(SE3.inverse(Ts)[:, None], points))[0]


def _spread(target: PreparedPart, Ts: Transforms, most: int) -> Transforms:
    """Select at most ``most`` poses by farthest-point sampling of the corners of the part's box."""
    corners = SE3.apply(Ts[:, None], box_corners(target.part))
    chosen, gaps = [0], np.full(len(Ts), np.inf)
    while True:
        np.minimum(gaps, np.linalg.norm(corners - corners[chosen[-1]], axis=-1).max(axis=1), out=gaps)
        if len(chosen) == most or gaps.max() < _APART:
            return Ts[chosen]
        chosen.append(int(np.argmax(gaps)))


_STEP, FAR = 0.008, 0.045
"""Spacing of the distance grid [m], and distance at which its values are truncated [m]."""

_NODES = 5e7
"""Largest number of nodes of a grid, which limits the memory to 400 MB."""


@dataclass(frozen=True, slots=True, eq=False)
class Occupied:
    """Grid of the distance from the nearest of several parts at given poses, in the world frame.

    Attributes:
        origin: position of the first node ``(3,)``, world frame [m].
        table: distances at the nodes ``(nx, ny, nz)`` [m], negative inside and at most :data:`FAR`.
    """

    origin: FloatArray
    table: FloatArray

    @classmethod
    def by(cls, targets: tuple[PreparedPart, ...], part: IntArray, Ts: Transforms) -> Occupied:
        """Create the grid for parts at poses.

        Distances are smaller than the exact ones by up to half a cell of the parts' own grids.

        Args:
            targets: prepared parts.
            part: index of the part of each pose ``(K,)``.
            Ts: poses ``T_world_part`` ``(K, 4, 4)``.

        Raises:
            InputError: the grid is too large, because the poses are spread too widely.
        """
        if not len(Ts):
            return cls(np.zeros(3), np.full((1, 1, 1), FAR))
        ends = np.array([_reach(targets[k], T) for k, T in zip(part, Ts, strict=True)])
        origin = ends[:, 0].min(axis=0)
        first = np.floor((ends[:, 0] - origin) / _STEP).astype(np.int64)
        last = np.ceil((ends[:, 1] - origin) / _STEP).astype(np.int64) + 1
        if np.prod(last.max(axis=0).astype(np.float64)) > _NODES:
            size = " x ".join(f"{v:.3g}" for v in ends[:, 1].max(axis=0) - origin)
            raise InputError(
                f"prior pose: expected the parts within some metres, got {size} m in which they may be. State more "
                "precisely where they are ([prior] of the scene, --pose-prior, or an image)."
            )
        table = np.full(last.max(axis=0), FAR)
        for k, T, a, b in zip(part, Ts, first, last, strict=True):
            axes = [origin[i] + _STEP * np.arange(a[i], b[i]) for i in range(3)]
            nodes, own = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1), targets[k].field
            block = table[a[0] : b[0], a[1] : b[1], a[2] : b[2]]
            np.minimum(block, own(SE3.apply(SE3.inverse(T), nodes))[0] - 0.5 * own.step, out=block)
        return cls(origin, table)

    def __call__(self, points: Vectors) -> FloatArray:
        """Return the interpolated distances ``(*batch,)`` [m] at world points ``(*batch, 3)`` [m]."""
        from scipy.ndimage import map_coordinates  # slow to import

        at = np.moveaxis((points - self.origin) / _STEP, -1, 0)
        return np.asarray(map_coordinates(self.table, at, order=1, mode="constant", cval=FAR, prefilter=False))


def _reach(target: PreparedPart, T: Transforms) -> FloatArray:
    """Return the world-aligned box, as corners ``(2, 3)`` [m], that contains all points nearer to the part than FAR."""
    corners = SE3.apply(T, box_corners(target.part))
    return np.stack([corners.min(axis=0) - FAR, corners.max(axis=0) + FAR])


_PROBABLE = 0.003
"""Smallest probability of a mode that is an obstacle."""

CONFIRMED = 0.999
"""Probability of a part from which only the poses of the posterior are obstacles."""

_DRAWS, _ALLOWED = 24, 120
"""Numbers of poses sampled from the posterior, and of prior poses that the readings do not contradict."""


@dataclass(frozen=True, slots=True, eq=False)
class PossiblePoses:
    """Poses at which parts may be, with the distance from all of them.

    Attributes:
        targets: prepared parts.
        part: index of the part of each pose ``(K,)``.
        Ts: poses ``T_world_part`` ``(K, 4, 4)``, most probable modes first.
        occupied: grid of the distance from the nearest part at any of the poses.
    """

    targets: tuple[PreparedPart, ...]
    part: IntArray
    Ts: Transforms
    occupied: Occupied = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "occupied", Occupied.by(self.targets, self.part, self.Ts))

    @classmethod
    @lru_cache(maxsize=1)  # the checks of candidates and of paths use the same state in turn
    def of(cls, state: SensingState) -> PossiblePoses:
        """Return the probable modes, samples of the posterior, and prior poses that no reading contradicts.

        The posterior alone is not safe: if it is wrong, the hand collides with the part.

        Args:
            state: posterior of the session.
        """
        probable = np.flatnonzero(state.weights >= _PROBABLE)
        probable = probable[np.argsort(-state.weights[probable], kind="stable")]
        Ts, part = [state.poses[probable]], [state.part[probable]]
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
        """Return lower bounds of the distances of points from the nearest part at any pose ``(*batch,)`` [m].

        Args:
            points: points, world frame ``(*batch, 3)`` [m].
        """
        return self.occupied(points)

    def box(self) -> tuple[FloatArray, FloatArray]:
        """Return the smallest and the largest corner of the parts at all poses ``(3,)``, world frame [m]."""
        if not len(self.Ts):
            return np.full(3, np.inf), np.full(3, -np.inf)
        corners = [SE3.apply(T, box_corners(self.targets[k].part)) for k, T in zip(self.part, self.Ts, strict=True)]
        return np.min(corners, axis=(0, 1)), np.max(corners, axis=(0, 1))

    def top(self) -> float:
        """Return the largest z of a part at any pose, world frame [m]; minus infinity without poses."""
        heights = [
            float((T[2, :3] @ self.targets[k].part.vertices.T).max() + T[2, 3])
            for k, T in zip(self.part, self.Ts, strict=True)
        ]
        return max(heights, default=-np.inf)


@dataclass(frozen=True, slots=True, eq=False)
class FreeSpace:
    """Free space of the whole hand between the bounds of the workspace and the possible parts.

    Attributes:
        body: model of the hand as spheres.
        workspace: bounds and forbidden boxes.
        possible: possible poses of the parts.
        clearance: required distance from parts and bounds [m].
        slack: additional distance from the bounds [m], below which the steering slows the hand down.
        reach: joints that carry the hand; None for a hand that can be everywhere.
    """

    body: Body
    workspace: Workspace
    possible: PossiblePoses
    clearance: float
    slack: float = 2e-3
    reach: Reach | None = None

    def within(self, Ts_world_hand: Transforms) -> BoolArray:
        """Return flags of the hand poses at which the body is inside the workspace bounds ``(*batch,)``.

        Args:
            Ts_world_hand: poses ``(*batch, 4, 4)``.
        """
        return self.workspace.allows(self.body, Ts_world_hand, self.clearance + self.slack)

    def links_free(self, centres: Vectors, radii: FloatArray) -> BoolArray:
        """Return whether links keep the clearance from bounds and from the box of all possible parts ``(*batch,)``.

        Args:
            centres: centres of the spheres that enclose the links ``(*batch, k, 3)``, world frame [m].
            radii: their radii ``(k,)`` [m].
        """
        bounds = (self.workspace.clearances(centres)[0].min(axis=-1, initial=np.inf) - radii).min(axis=-1)
        low, high = self.possible.box()
        beyond = np.maximum(np.maximum(low - centres, centres - high), 0.0)
        gaps = (np.linalg.norm(beyond, axis=-1) - radii).min(axis=-1)
        return np.asarray((bounds >= self.clearance) & (gaps >= self.clearance))

    def reaches(self, Ts_world_hand: Transforms) -> BoolArray:
        """Return flags of the hand poses that the joints allow ``(n,)``.

        Args:
            Ts_world_hand: poses ``(n, 4, 4)``.
        """
        if self.reach is None or not len(Ts_world_hand):
            return np.ones(len(Ts_world_hand), dtype=bool)
        return self.reach.reaches(Ts_world_hand, self.links_free)

    def follows(self, path: Transforms) -> bool:
        """Return whether the joints can follow a path from the present pose.

        Args:
            path: hand poses of the path, dense ``(n, 4, 4)``.
        """
        return self.reach is None or self.reach.follows(path, self.links_free)

    def gaps(self, Ts_world_hand: Transforms) -> FloatArray:
        """Return the distance of the body from the nearest possible part at each hand pose ``(*batch,)`` [m].

        Args:
            Ts_world_hand: poses ``(*batch, 4, 4)``.
        """
        centres = self.body.placed(Ts_world_hand)
        return np.asarray((self.possible.distances(centres) - self.body.radii).min(axis=-1))

    def allows(self, Ts_world_hand: Transforms) -> BoolArray:
        """Return flags of the hand poses with the clearance from bounds and possible parts ``(n,)``.

        Args:
            Ts_world_hand: poses ``(n, 4, 4)``.
        """
        ok = self.within(Ts_world_hand)
        ok[ok] = self.gaps(Ts_world_hand[ok]) >= self.clearance
        return ok

    def along(self, path: Transforms) -> bool:
        """Return whether a path has the clearance, or at least nowhere less than the distance at its start.

        Args:
            path: hand poses of the path, dense ``(n, 4, 4)``.
        """
        here = self.workspace.of_body(self.body, path[0])
        bounds = np.minimum(self.clearance + self.slack, here - 1e-3)
        if not (self.workspace.of_body(self.body, path) >= bounds).all():
            return False
        gaps = self.gaps(path)
        return bool((gaps >= min(self.clearance, gaps[0] - 1e-3)).all())
