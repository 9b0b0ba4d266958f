"""Results of a machine in a session as lines of text."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tanteo.geometry.typing import Covariances
from tanteo.planning import Action, Done, Step
from tanteo.posterior import Answer
from tanteo.render.text.answers import answer_lines
from tanteo.render.text.layout import PLAIN, Layout, printable

_AXES = ("x", "y", "z", "rx", "ry", "rz")


def turn_line(action: Action, distance: float | None, step: Step | None, leader: str, note: str) -> str:
    """Return an action of a machine and its result as one line.

    Args:
        action: action of the session.
        distance: measured distance [m], infinite if nothing was hit; None without a reading.
        step: posterior after the reading; None without a reading.
        leader: name of the most probable part after the reading.
        note: remarks for the user.
    """
    words = f"{action.number:3}  {action.aim}"
    if distance is not None and np.isfinite(distance):
        off = 1e3 * (distance - action.expected)
        words += f": hit after {1e3 * distance:.3f} mm, {off:+.3f} mm from the expected distance"
    if step is not None and step.ids and step.part >= 0:
        words += f"; {leader} P = {step.probabilities[step.part]:.3f}, largest corner sd {1e3 * step.corner_sd:.3f} mm"
    return printable(words + (f" ({note})" if note else ""))


def probed_lines(
    answer: Answer, end: Done, machine: str, count: int, *, verbose: bool = False, layout: Layout = PLAIN
) -> list[str]:
    """Return the answer of a session with a machine as lines of text, with its covariance.

    Args:
        answer: answer of the session.
        end: end of the session.
        machine: name of the machine.
        count: number of readings.
        verbose: whether to add the pose as a matrix and the pairings.
        layout: width and style of the output.
    """
    headline, *rest = answer_lines(answer, verbose=verbose, layout=layout)
    cost = f"  cost        {count} readings of {printable(machine)}"
    covariance = covariance_lines(answer.hypotheses[0].covariance) if answer.hypotheses else []
    return [headline, cost, *rest, *covariance, printable(end.message)]


def covariance_lines(C: Covariances) -> Sequence[str]:
    """Return the upper triangle of a pose covariance as lines of text [mm, deg].

    Args:
        C: covariance, order x y z rx ry rz, part frame, right perturbation ``(6, 6)`` [m, rad].
    """
    scale = np.array([1e3] * 3 + [np.degrees(1.0)] * 3)
    scaled = C * np.outer(scale, scale)
    rows = [
        "    " + f"{name:3}" + " " * 11 * k + "".join(f"{v:11.2e}" for v in scaled[k, k:])
        for k, name in enumerate(_AXES)
    ]
    return ["  covariance  of x y z rx ry rz in the part frame [mm, deg]:", *rows]
