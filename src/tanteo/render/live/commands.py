"""Commands of the user, and the reading that a click chooses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.geometry import SE3
from tanteo.geometry.typing import IntArray, Vectors
from tanteo.planning import Action, Probe, SensingState, Session, has_clearance
from tanteo.planning.candidates import Candidates, within_cone
from tanteo.words.findings import ChosenByUser, ClickFailed


@dataclass(frozen=True, slots=True)
class Go:
    """Run without stops."""


@dataclass(frozen=True, slots=True)
class Pause:
    """Pause before the next reading."""


@dataclass(frozen=True, slots=True)
class Advance:
    """Make one reading."""


@dataclass(frozen=True, slots=True)
class Restart:
    """Restart with the chosen policy and seed."""


@dataclass(frozen=True, slots=True)
class Contest:
    """Restart as a contest: the user chooses all readings, while the policy senses the same scene, hidden."""


@dataclass(frozen=True, slots=True)
class AnswerNow:
    """End the session with the current answer."""


@dataclass(frozen=True, slots=True)
class Quit:
    """Close the player."""


@dataclass(frozen=True, slots=True)
class Choose:
    """Choose another policy, seed or speed (multiple of real time); None keeps the present one."""

    policy: str | None = None
    seed: int | None = None
    speed: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Click:
    """Click into the picture.

    Attributes:
        eye: position of the viewer, world frame ``(3,)`` [m].
        ray: direction from the viewer to the clicked point, world frame ``(3,)``.
        hidden: layers that are not visible and therefore cannot be clicked.
    """

    eye: Vectors
    ray: Vectors
    hidden: frozenset[str] = frozenset()


Command = Go | Pause | Advance | Restart | Contest | AnswerNow | Quit | Choose | Click


class Left(Exception):  # noqa: N818
    """Exception that ends a run early: to restart, to answer, or to close.

    Attributes:
        how: command that ends the run.
    """

    def __init__(self, how: Restart | Contest | AnswerNow | Quit) -> None:
        self.how = how


def leave(command: Command) -> None:
    """Raise :class:`Left` if a command ends the run.

    Args:
        command: command of the user.

    Raises:
        Left: the command ends the run.
    """
    if isinstance(command, Restart | Contest | AnswerNow | Quit):
        raise Left(command)


_TILTS = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Tilts from the normal toward the axis of the probe's cone that are tried in this order, as fractions."""


def picked(session: Session, modes: IntArray, eye: Vectors, ray: Vectors, number: int) -> Action | ClickFailed:
    """Return the reading that a click chooses, or the reason why it is impossible.

    The reading is along the inward normal of the clicked surface, or the nearest allowed direction with a clear
    approach.

    Args:
        session: running session.
        modes: indices of the visible modes.
        eye: position of the viewer, world frame ``(3,)`` [m].
        ray: direction of the click, world frame ``(3,)``.
        number: number of the action.
    """
    hit = _first(session.state, modes, eye, ray / np.linalg.norm(ray))
    if hit is None:
        return ClickFailed("nothing")
    mode, face, point, inward = hit
    found = _click_candidates(session.probe, mode, face, point, inward)
    found = found.take(has_clearance(session.state, found, session.probe, anywhere=False))
    if not len(found):
        return ClickFailed("space")
    if session.able is not None:
        found = found.take(session.able(session.state, found))
    if not len(found):
        return ClickFailed("reach")
    part, probe = session.state.target(mode).part, session.probe
    name = part.faces[face].name if face >= 0 else "a place beside it"
    return Action(
        number, found.origins[0], found.directions[0], probe.max_range, float(found.ranges[0]), part.name, name, np.nan,
        ChosenByUser(),
    )  # fmt: skip


def _click_candidates(probe: Probe, mode: int, face: int, point: Vectors, inward: Vectors) -> Candidates:
    """Return candidates for a clicked point, best first: along its normal, or tilted toward the probe's cone."""
    tilted = [inward] if probe.approach is None else [(1 - t) * inward + t * probe.approach for t in _TILTS]
    lengths = np.linalg.norm(tilted, axis=1, keepdims=True)
    directions = within_cone((tilted / np.maximum(lengths, 1e-9))[lengths[:, 0] > 1e-3], probe)
    good = directions @ inward > np.cos(0.95 * probe.max_incidence)
    good[0] = True
    n = len(probe.standoffs)
    directions, ranges = np.repeat(directions[good], n, axis=0), np.tile(probe.standoffs, int(good.sum()))
    origins = point - ranges[:, None] * directions
    return Candidates(origins, directions, np.full(len(ranges), mode), np.full(len(ranges), face), ranges)


def _first(
    state: SensingState, modes: IntArray, eye: Vectors, ray: Vectors
) -> tuple[int, int, Vectors, Vectors] | None:
    """Return mode, face, point and inward normal of a click; beside the part, the ray's point nearest to its centre."""
    best: tuple[float, tuple[int, int, Vectors, Vectors]] | None = None
    for k in modes.tolist():
        target, T = state.target(k), state.poses[k]
        to_part = SE3.inverse(T)
        hits = target.surface.cast(SE3.apply(to_part, eye)[None], (to_part[:3, :3] @ ray)[None])
        distance, triangle = float(hits.distances[0]), int(hits.triangles[0])
        if np.isfinite(distance) and (best is None or distance < best[0]):
            inward = -T[:3, :3] @ target.surface.normals[triangle]
            best = distance, (k, int(target.part.triangle_face[triangle]), eye + distance * ray, inward)
    if best is not None or not len(modes):
        return None if best is None else best[1]
    k = int(modes[0])
    part, T = state.target(k).part, state.poses[k]
    middle = SE3.apply(T, part.centroid)
    point = eye + max(float((middle - eye) @ ray), 0.0) * ray
    return (k, -1, point, ray) if np.linalg.norm(point - middle) < part.diagonal else None
