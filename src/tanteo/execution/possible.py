"""What may stand in the hand's way: all that the belief holds, all that no reading has contradicted, and the bounds."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from tanteo.active import SensingState
from tanteo.execution.allowed import allowed
from tanteo.execution.occupied import Occupied
from tanteo.hand import Body, Workspace
from tanteo.inference import PreparedPart
from tanteo.typing import BoolArray, FloatArray, IntArray, Transforms, Vectors

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
    def of(cls, state: SensingState) -> Possible:
        """Every live mode, samples from all of them, and what the prior allows and no reading contradicts.

        A belief may be wrong, and a hand that went by it alone would find out by touching.
        """
        return _possible(state)

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


@lru_cache(maxsize=1)
def _possible(state: SensingState) -> Possible:
    """The same for one belief every time: candidates and ways ask in turn."""
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
    return Possible(state.start.targets, np.concatenate(part), np.concatenate(Ts))


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
