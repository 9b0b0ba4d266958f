"""A corner: the two edges of one face that meet in it (paper: vertices are computed from intersections of edges)."""

from __future__ import annotations

import numpy as np

from tanteo.errors import DegenerateError
from tanteo.features import relate_all
from tanteo.fitting import intersect_edges
from tanteo.hand.acquisition.edge import INSET, acquire_edge
from tanteo.hand.acquisition.guesses import FaceGuess, VertexGuess
from tanteo.hand.acquisition.plane import acquire_plane
from tanteo.hand.acquisition.run import Acquired, SensingRun, finish
from tanteo.hand.motion.steering import Rules
from tanteo.hand.robot import Robot
from tanteo.sensors.presets import RobotPreset
from tanteo.words.findings import EdgesMeet, EdgesPass, NotOneFeature, StepFailed

ALONG = 0.035
"""Each edge is sensed this far from the corner [m]."""


_GATE = 3.5
"""Edges that pass each other at more than so many standard deviations do not meet."""


def sense_vertex(
    robot: Robot,
    guess: VertexGuess,
    *,
    standoff: float,
    rules: Rules,
    label: str = "vertex",
    errors: RobotPreset | str | None = None,
) -> Acquired:
    """Acquire a corner of a face; face and edges are acquired with it (:attr:`Acquired.others`).

    Args:
        robot: robot with the hand in front of the face, within the range of its beams.
        guess: About where the corner is, and how the two edges of the face run.
        standoff: distance of the hand's front from the face [m], at least 1.25 times the clearance of the rules.
        rules: limits of the motions.
        label: Of the feature; readings are labelled ``<label> face``, ``<label> edge 1`` and ``<label> edge 2``.
        errors: error model of the reported poses, for the covariance.

    Raises:
        InputError: The stand-off is too small for the clearance of the rules.
    """
    run = SensingRun(robot, standoff, rules, errors)
    arriving, leaving = guess.edges(ALONG)
    middle = 0.5 * (arriving.face(INSET).point + leaving.face(INSET).point)
    status, finding, face = acquire_plane(run, FaceGuess(middle, guess.normal), f"{label} face")
    if face is None:
        return finish("vertex", run, status, StepFailed("face of the corner", finding), None)
    run.others.append(face)
    edges = []
    for number, edge_idea in enumerate((arriving, leaving), start=1):
        status, finding, edge = acquire_edge(run, face, edge_idea, f"{label} edge {number}")
        if edge is None:
            return finish("vertex", run, status, StepFailed(f"edge {number} of the corner", finding), None)
        edges.append(edge)
    run.others.extend(edges)
    try:
        vertex, _ = intersect_edges(edges, label)
    except DegenerateError as error:
        return finish("vertex", run, "unclear", NotOneFeature("corner", str(error)), None)
    gap = relate_all(edges).column("edge_gap")
    off, sd = float(gap.value[0, 0]), float(np.sqrt(gap.covariance[0, 0, 0]))
    if abs(off) > _GATE * sd:
        return finish("vertex", run, "unclear", EdgesPass(abs(off), abs(off) / sd), None)
    return finish("vertex", run, "acquired", EdgesMeet(), vertex)
