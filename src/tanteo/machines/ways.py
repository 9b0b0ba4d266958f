"""Ways between readings: back out, up, over the part, down; a tool that turns leaves along its own z."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.geometry import SE3
from tanteo.geometry.typing import Transforms
from tanteo.machines.programs.job import Job, Touch, first_way, leaves, tool_axes, transfer
from tanteo.planning import Action, Probe, Start
from tanteo.posterior import box_corners, point_moves

_SDS = 3.0
"""Standard deviations of the part's place that ways keep off it."""
_NEAR = 1e-7
"""Nearer than this two places are one [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Ways:
    """Where a probe may go, from what is known before the first reading.

    Attributes:
        job: heights and a cylinder that hold the part and all starts, wherever it may be.
        turns: the tool looks along each reading; else it points down.
    """

    job: Job
    turns: bool

    @classmethod
    def around(cls, start: Start, probe: Probe, *, turns: bool) -> Ways:
        """From the start of a session."""
        corners = list[np.ndarray]()
        for part, T, C in zip(start.part, start.Ts, start.covariances, strict=True):
            box = box_corners(start.targets[int(part)].part)
            moves = T[:3, :3] @ point_moves(box)
            sds = np.sqrt(np.einsum("kij,jl,kil->ki", moves, C, moves))
            places = SE3.apply(T, box)
            corners += [places - _SDS * sds, places + _SDS * sds]
        all_ = np.concatenate(corners)
        room = probe.clearance + probe.radius + max(probe.standoff, probe.farthest)
        centre = 0.5 * (all_.min(axis=0) + all_.max(axis=0))
        wide = float(np.linalg.norm(all_[:, :2] - centre[:2], axis=1).max()) + room
        heights = float(all_[:, 2].max()) + room, float(all_[:, 2].min()) - room
        name = start.targets[int(start.part[0])].part.name
        return cls(Job(name, "", (), probe.radius, 0.0, *heights, centre, wide), turns)

    def touch(self, action: Action) -> Touch:
        """A question as a guarded motion."""
        d, contact = action.direction, action.origin + action.expected * action.direction
        outer = leaves(action.origin, -d, self.job)
        return Touch(action.number, action.face, action.origin, d, contact, contact, outer, tool_axes(d))

    def to(self, action: Action, before: Action | None, here: np.ndarray) -> list[Transforms]:
        """Poses from where the probe is to the start of a reading, straight between them.

        Args:
            action: the reading.
            before: the one at whose start the probe is; None if it is somewhere else, from where up is free.
            here: where it is ``(3,)``.
        """
        touch = self.touch(action)
        if not self.turns:
            return self._above(touch, here)
        places = first_way(self.job, touch) if before is None else transfer(self.job, self.touch(before), touch)
        if before is not None:
            last = self.touch(before)
            places = [(last.outer, last.tool), *places]
        else:
            up = np.array([*here[:2], max(here[2], self.job.safe_height)])
            places = [(up, places[0][1]), *places]
        return _without_stays([SE3.from_parts(R, p) for p, R in [*places, (touch.start, touch.tool)]], here)

    def _above(self, touch: Touch, here: np.ndarray) -> list[Transforms]:
        height = max(self.job.safe_height, float(here[2]))
        corners = np.array([*here[:2], height]), np.array([*touch.start[:2], height]), touch.start
        return _without_stays([SE3.from_parts(touch.tool, place) for place in corners], here)


def _without_stays(poses: list[Transforms], here: np.ndarray) -> list[Transforms]:
    kept = list[Transforms]()
    for T in poses:
        before = kept[-1] if kept else None
        same = np.linalg.norm(T[:3, 3] - (here if before is None else before[:3, 3])) < _NEAR
        if not (same and (before is None or np.allclose(before[:3, :3], T[:3, :3]))):
            kept.append(T)
    return kept
