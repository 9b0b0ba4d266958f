"""How a session ended: the answer, how far it is from the truth, and who needed how many places."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from tanteo.lie import SE3
from tanteo.report import headline, length
from tanteo.session import Done, Session
from tanteo.shapes import Surface
from tanteo.simulator import Solid


def words(session: Session, done: Done, truth: Sequence[Solid]) -> Iterator[str]:
    """The answer and why it ended; how far the truth is from it."""
    yield headline(session.answer())
    yield done.why
    if len(session.state.weights) and truth:
        yield f"No place of the true surface is farther from it than {length(apart(session, truth))}."


def apart(session: Session, truth: Sequence[Solid]) -> float:
    """Largest distance of corners of the truth from the surface of the likeliest mode, and the reverse [m]."""
    b = session.state
    k = int(np.argmax(b.weights))
    target, T = b.target(k), b.poses[k]
    starts = np.cumsum([0, *(len(s.vertices) for s in truth)])
    vertices = np.concatenate([s.vertices for s in truth])
    triangles = np.concatenate([s.triangles + n for s, n in zip(truth, starts, strict=False)])
    there = Surface(vertices, triangles).closest(SE3.apply(T, target.part.vertices)).distances
    back = target.surface.closest(SE3.apply(SE3.inverse(T), vertices)).distances
    return float(max(there.max(), back.max()))


def compared(policy: int, mine: int, name: str, alone: int) -> str:
    """The person's count beside the policy's."""
    together = (
        f"You needed {mine} places" if not policy else f"Together {policy + mine} places: you {mine}, '{name}' {policy}"
    )
    return f"{together}; '{name}' alone needs {alone} on the same scene."
