"""From a click into the picture to the reading that the person means: at a right angle to what they pointed at."""

from __future__ import annotations

import numpy as np

from tanteo.active import Belief, Candidates
from tanteo.active.candidates import has_room, within_cone
from tanteo.lie import SE3
from tanteo.session import Action, Session
from tanteo.typing import IntArray, Vectors
from tanteo.viewer.snapshot import BY_HAND


def picked(session: Session, modes: IntArray, eye: Vectors, ray: Vectors, number: int) -> Action | str:
    """The reading of a click, or why there is none.

    It looks along the inward normal of what was pointed at, or as near to that as the probe may.

    Args:
        session: what is known, and what senses.
        modes: those that are drawn ``(M,)``.
        eye: from where the person looks, world ``(3,)`` [m].
        ray: in which direction, ``(3,)``.
        number: of the question.
    """
    hit = _first(session.belief, modes, eye, ray / np.linalg.norm(ray))
    if hit is None:
        return "There is nothing where you clicked: click on a part or near one."
    mode, face, point, inward = hit
    probe = session.probe
    direction = within_cone(inward[None], probe)[0]
    origin = point - probe.standoff * direction
    wanted = Candidates(origin[None], direction[None], np.array([mode]), np.array([face]), np.array([probe.standoff]))
    if not has_room(session.belief, wanted, probe)[0]:
        return "There is no room to sense from there: click on another place."
    if session.able is not None and not session.able(session.belief, wanted)[0]:
        return "The hand cannot come to where it would sense that: click on another place."
    part = session.belief.target(mode).part
    name = part.faces[face].name if face >= 0 else "a place beside it"
    return Action(number, origin, direction, probe.max_range, probe.standoff, part.name, name, np.nan, BY_HAND)


def _first(belief: Belief, modes: IntArray, eye: Vectors, ray: Vectors) -> tuple[int, int, Vectors, Vectors] | None:
    """Mode, face, place and inward normal of what is met first; beside the part, the place nearest to its middle."""
    best: tuple[float, tuple[int, int, Vectors, Vectors]] | None = None
    for k in modes.tolist():
        target, T = belief.target(k), belief.poses[k]
        to_part = SE3.inverse(T)
        hits = target.surface.cast(SE3.apply(to_part, eye)[None], (to_part[:3, :3] @ ray)[None])
        distance, triangle = float(hits.distances[0]), int(hits.triangles[0])
        if np.isfinite(distance) and (best is None or distance < best[0]):
            inward = -T[:3, :3] @ target.surface.normals[triangle]
            best = distance, (k, int(target.part.triangle_face[triangle]), eye + distance * ray, inward)
    if best is not None or not len(modes):
        return None if best is None else best[1]
    k = int(modes[0])
    part, T = belief.target(k).part, belief.poses[k]
    middle = SE3.apply(T, part.centroid)
    point = eye + max(float((middle - eye) @ ray), 0.0) * ray
    return (k, -1, point, ray) if np.linalg.norm(point - middle) < part.diagonal else None
