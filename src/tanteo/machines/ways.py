"""Plan the paths between readings: retract, rise, cross over the part, descend.

A tool that can point along any direction leaves the part along its own z.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.geometry import SE3
from tanteo.geometry.typing import Transforms
from tanteo.machines.programs.job import Job, Touch, first_way, leaves, tool_axes, transfer
from tanteo.planning import Action, Probe
from tanteo.planning.start import Start
from tanteo.posterior import box_corners
from tanteo.posterior.answers import point_moves

_SDS = 3.0
"""Clearance of the paths from the part, in standard deviations of its position."""
_NEAR = 1e-7
"""Distance below which two positions are equal [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Ways:
    """Paths of a probe around a part whose prior pose is uncertain.

    Attributes:
        job: safe height, depth, and cylinder that contains the part and all starts at any prior pose.
        turns: whether the tool points along each reading, as far as its tilt permits; otherwise it points down.
        probe: sensor that takes the readings.
    """

    job: Job
    turns: bool
    probe: Probe

    @classmethod
    def from_start(cls, start: Start, probe: Probe, *, turns: bool) -> Ways:
        """Return the paths for the prior poses of a session.

        Args:
            start: prior poses of the parts.
            probe: sensor that takes the readings.
            turns: whether the tool can point along any direction.
        """
        corners = list[np.ndarray]()
        for part, T, C in zip(start.part, start.Ts, start.covariances, strict=True):
            box = box_corners(start.targets[int(part)].part)
            moves = T[:3, :3] @ point_moves(box)
            sds = np.sqrt(np.einsum("kij,jl,kil->ki", moves, C, moves))
            places = SE3.apply(T, box)
            corners += [places - _SDS * sds, places + _SDS * sds]
        all_ = np.concatenate(corners)
        near = probe.clearance + probe.radius
        clearance = near + max(probe.standoff, probe.farthest)
        centre = 0.5 * (all_.min(axis=0) + all_.max(axis=0))
        wide = float(np.linalg.norm(all_[:, :2] - centre[:2], axis=1).max()) + clearance
        over = clearance if turns else near  # a tool that points down rises to higher starts where it needs to
        heights = float(all_[:, 2].max()) + over, float(all_[:, 2].min()) - clearance
        name = start.targets[int(start.part[0])].part.name
        return cls(Job(name, "", (), probe.radius, 0.0, *heights, centre, wide), turns, probe)

    def touch(self, action: Action) -> Touch:
        """Return the guarded motion that answers a question.

        Args:
            action: question of the session.
        """
        d, contact = action.direction, action.origin + action.expected * action.direction
        outer = leaves(action.origin, -d, self.job)
        tool = tool_axes(-self.probe.holders(d[None])[0])
        return Touch(action.number, action.face, action.origin, d, contact, contact, outer, tool)

    def to(self, action: Action, before: Action | None, here: np.ndarray) -> list[Transforms]:
        """Return the poses of a path from the probe's position to the start of a reading, with straight segments.

        Args:
            action: reading to go to.
            before: reading at whose start the probe is; None if it is elsewhere, with free space above.
            here: position of the probe ``(3,)`` [m].
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
        height = max(self.job.safe_height, float(here[2]), float(touch.start[2]))
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
