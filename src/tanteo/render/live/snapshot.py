"""Session at one moment as an immutable value, and result of a run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tanteo.geometry import SE3
from tanteo.geometry.typing import BoolArray, FloatArray, IntArray
from tanteo.hand.simulator import Solid
from tanteo.parts import Surface
from tanteo.planning import Action, Done, SensingState, Session, Step
from tanteo.render.html.shapes import Shapes, shapes_of
from tanteo.render.html.words import headline
from tanteo.words.findings import ChosenByUser, TruthWithin

RIVAL_LAYERS = ("rival 1", "rival 2", "rival 3")
"""Layers of alternative parts, the most probable first."""

_MODES, _PARTS = 6, 1 + len(RIVAL_LAYERS)
"""Largest numbers of drawn modes, and of parts with a drawn mode."""

_SHOWN = 0.01
"""Smallest probability of a drawn mode; the most probable one is always drawn."""

_DECIDED = 0.5
"""Probability above which a part is more probable than all others."""

_FITS = 4.0
"""Distance from the surface above which a reading does not fit [standard deviations]."""


def by_hand(action: Action | None) -> bool:
    """Return whether the user chose an action.

    Args:
        action: action of a session, or None.
    """
    return action is not None and isinstance(action.reason, ChosenByUser)


@dataclass(frozen=True, slots=True, eq=False)
class Snapshot:
    """Session at one moment.

    Attributes:
        state: posterior of the session.
        steps: results of all steps.
        action: pending action; None if there is none.
        shapes: features of labelled readings; None without any.
    """

    state: SensingState
    steps: tuple[Step, ...]
    action: Action | None
    shapes: Shapes | None = None

    @classmethod
    def of(cls, session: Session) -> Snapshot:
        """Return the snapshot of a session at present.

        Args:
            session: running session.
        """
        now = cls(session.state, session.steps, session.pending)
        return replace(now, shapes=sensed_shapes(session, now.size))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parts in the order of the session's start."""
        return tuple(target.part.name for target in self.state.start.targets)

    @property
    def size(self) -> float:
        """Diagonal of the largest part [m]."""
        return max(target.part.diagonal for target in self.state.start.targets)

    @property
    def order(self) -> IntArray:
        """Indices of the parts, the most probable first ``(P,)``."""
        return np.argsort(-self.state.of_parts(), kind="stable")

    @property
    def decided(self) -> bool:
        """Whether one part is more probable than all others together."""
        return bool(self.state.of_parts().max(initial=0.0) > _DECIDED)

    @property
    def places(self) -> tuple[int, int]:
        """Numbers of steps whose action the policy chose, and the user chose."""
        own = sum(by_hand(step.action) for step in self.steps)
        return len(self.steps) - own, own

    def drawn_modes(self) -> IntArray:
        """Return the indices of the modes to draw, which belong to the most probable parts, most probable first."""
        b = self.state
        if not len(b.weights):
            return np.zeros(0, dtype=np.int64)
        order = np.argsort(-b.weights, kind="stable")
        shown = order[np.isin(b.part[order], self.order[:_PARTS]) & (b.weights[order] >= _SHOWN)]
        return np.asarray(shown[:_MODES] if len(shown) else order[:1])

    def layer(self, mode: int) -> str:
        """Return the layer of a mode; empty for the best pose of the most probable part, which is always visible.

        Args:
            mode: index of the mode.
        """
        rank = self.rank(int(self.state.part[mode]))
        if rank:
            return RIVAL_LAYERS[rank - 1]
        own = np.where(self.state.part == self.state.part[mode], self.state.weights, -1.0)
        return "" if mode == int(np.argmax(own)) else "overlays"

    def rank(self, part: int) -> int:
        """Return the rank of a part by probability, 0 for the most probable.

        Args:
            part: index of the part.
        """
        return int(np.flatnonzero(self.order == part)[0])

    def wrong(self) -> BoolArray:
        """Return flags of the contact points that do not fit the most probable mode ``(n,)``."""
        b = self.state
        if b.touches is None or not len(b.touches):
            return np.zeros(0, dtype=bool)
        if not len(b.weights):
            return np.ones(len(b.touches), dtype=bool)
        return np.asarray(np.abs(self._distances()) > _FITS)

    def _distances(self) -> FloatArray:
        """Return distances of the readings from the part at the most probable mode ``(n,)`` [standard deviations]."""
        b = self.state
        assert b.touches is not None
        k, touches = int(np.argmax(b.weights)), b.touches
        R, p = b.poses[k][:3, :3], b.poses[k][:3, 3]
        near = b.target(k).surface.closest((touches.points - p) @ R)
        normals = b.target(k).surface.normals[near.triangles] @ R.T
        shared = touches.shared_jacobian @ np.swapaxes(touches.shared_jacobian, 1, 2)
        variances = np.einsum("ni,nij,nj->n", normals, touches.covs + shared, normals)
        return np.asarray((near.distances - touches.radii) / np.sqrt(variances))


def ending_words(session: Session, done: Done, truth: Sequence[Solid]) -> Iterator[str]:
    """Yield the sentences at the end of a session: answer, reason for the end, and distance from the real part.

    Args:
        session: session at its end.
        done: reason for the end.
        truth: real parts, world frame; empty if unknown.
    """
    yield headline(session.answer())
    yield done.message
    if len(session.state.weights) and truth:
        yield TruthWithin(apart(session, truth)).message


def apart(session: Session, truth: Sequence[Solid]) -> float:
    """Return the largest distance between real surface and part at the most probable mode, over their vertices [m].

    Args:
        session: session with at least one mode.
        truth: real parts, world frame.
    """
    b = session.state
    k = int(np.argmax(b.weights))
    target, T = b.target(k), b.poses[k]
    starts = np.cumsum([0, *(len(s.vertices) for s in truth)])
    vertices = np.concatenate([s.vertices for s in truth])
    triangles = np.concatenate([s.triangles + n for s, n in zip(truth, starts, strict=False)])
    there = Surface(vertices, triangles).closest(SE3.apply(T, target.part.vertices)).distances
    back = target.surface.closest(SE3.apply(SE3.inverse(T), vertices)).distances
    return float(max(there.max(), back.max()))


@dataclass(frozen=True, slots=True)
class Result:
    """Result of a run.

    Attributes:
        places: number of steps.
        part: name of the most probable part; empty if no part explains the readings.
        probability: posterior probability of that part.
        corner_sd: largest corner sd [m].
        off: largest distance between real and estimated surface [m]; NaN if the real part is unknown.
    """

    places: int
    part: str
    probability: float
    corner_sd: float
    off: float


def result(session: Session, truth: Sequence[Solid]) -> Result:
    """Return the result of a session and its distance from the real part.

    Args:
        session: session at its end.
        truth: real parts, world frame; empty if unknown.
    """
    now, b = Snapshot.of(session), session.state
    if not len(b.weights):
        return Result(len(now.steps), "", 0.0, np.nan, np.nan)
    best = int(now.order[0])
    sd = now.steps[-1].corner_sd if now.steps else np.nan
    return Result(
        len(now.steps), now.names[best], float(b.of_parts()[best]), sd, apart(session, truth) if truth else np.nan
    )


def sensed_shapes(session: Session, size: float) -> Shapes | None:
    """Return the features of a session's labelled readings for a drawing; None without labels.

    Args:
        session: session with its readings.
        size: size of the view [m].
    """
    readings = session.readings
    if readings is None or not any(readings.features):
        return None
    return shapes_of(session.sensing.measured(readings), size, session.sensing.tolerance)
