"""What may stand in the hand's way: every pose that the belief still allows, and the bounds of the workspace."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.active import Belief
from tanteo.hand import Body, Workspace
from tanteo.lie import SE3
from tanteo.surface_search import Target
from tanteo.typing import BoolArray, FloatArray, IntArray, Transforms, Vectors

_LIVE = 0.003
"""Modes of at least this probability are kept clear of."""

_BEFORE = 6
"""Poses drawn of each rough pose before the first reading, itself apart."""


@dataclass(frozen=True, slots=True, eq=False)
class Possible:
    """Where parts may be, as poses drawn from a belief.

    Attributes:
        targets: the parts.
        part: index of the part of each pose ``(K,)``.
        Ts: ``T_world_part`` ``(K, 4, 4)``, the likeliest first.
    """

    targets: tuple[Target, ...]
    part: IntArray
    Ts: Transforms

    @classmethod
    def of(cls, belief: Belief, count: int) -> Possible:
        """Every mode that is alive, and about so many draws from all of them."""
        live = np.flatnonzero(belief.weights >= _LIVE)
        live = live[np.argsort(-belief.weights[live], kind="stable")]
        if belief.draws is None:
            Ts, part = _rough(belief, live, max(1, min(_BEFORE, count // max(len(live), 1))))
        else:
            w = np.cumsum(belief.draws.weights)
            some = np.searchsorted(w, w[-1] * (np.arange(count) + 0.5) / count).clip(0, len(w) - 1) if len(w) else []
            rows = np.unique(np.asarray(some, dtype=np.int64))
            Ts, part = belief.draws.Ts[rows], belief.part[belief.draws.mode[rows]]
        return cls(
            belief.start.targets, np.concatenate([belief.part[live], part]), np.concatenate([belief.poses[live], Ts])
        )

    def distances(self, points: Vectors) -> FloatArray:
        """Least distance of points ``(*batch, 3)`` from any of them ``(*batch,)`` [m]; a bit less, negative inside."""
        out = np.full(points.shape[:-1], np.inf)
        for k, T in zip(self.part, self.Ts, strict=True):
            field, local = self.targets[k].field, SE3.apply(SE3.inverse(T), points)
            np.minimum(out, field(local)[0] - 0.5 * field.step, out=out)
        return out

    def top(self) -> float:
        """Greatest height of any of them in the world [m]."""
        heights = [
            float((T[2, :3] @ self.targets[k].part.vertices.T).max() + T[2, 3])
            for k, T in zip(self.part, self.Ts, strict=True)
        ]
        return max(heights, default=-np.inf)


def _rough(belief: Belief, live: IntArray, each: int) -> tuple[Transforms, IntArray]:
    """Draws from the rough poses, as many of each, somewhat beyond what the start says."""
    start = belief.start
    drawn = [(start.drawn(int(k), each * int(np.sum(belief.part[live] == k))), int(k)) for k in set(belief.part[live])]
    Ts = np.concatenate([np.zeros((0, 4, 4)), *(T for T, _ in drawn)])
    return Ts, np.concatenate([np.zeros(0, dtype=np.int64), *(np.full(len(T), k) for T, k in drawn)])


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
