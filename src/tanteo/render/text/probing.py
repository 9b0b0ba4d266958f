"""What a machine sensed for a session, in words."""

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
    """One question of a machine and what came of it.

    Args:
        action: what was asked.
        distance: where something was met [m], infinite for nothing; None where nothing was sensed.
        step: what it told; None if there is nothing.
        leader: name of the likeliest part then.
        note: what a person should know.
    """
    words = f"{action.number:3}  {action.face} of {action.part}"
    if distance is not None and np.isfinite(distance):
        off = 1e3 * (distance - action.expected)
        words += f": met after {1e3 * distance:.3f} mm, {off:+.3f} mm from what was expected"
    if step is not None and step.ids and step.part >= 0:
        words += f"; {leader} P = {step.probabilities[step.part]:.3f}, largest corner sd {1e3 * step.corner_sd:.3f} mm"
    return printable(words + (f" ({note})" if note else ""))


def probed_lines(
    answer: Answer, end: Done, machine: str, count: int, *, verbose: bool = False, layout: Layout = PLAIN
) -> list[str]:
    """The answer of a session that a machine carried out, with its covariance.

    Args:
        answer: what was found.
        end: why it ended.
        machine: that sensed.
        count: of the readings.
        verbose: also the matrix and the pairings.
        layout: where they are shown.
    """
    headline, *rest = answer_lines(answer, verbose=verbose, layout=layout)
    cost = f"  cost        {count} readings of {printable(machine)}"
    covariance = covariance_lines(answer.hypotheses[0].covariance) if answer.hypotheses else []
    return [headline, cost, *rest, *covariance, printable(end.message)]


def covariance_lines(C: Covariances) -> Sequence[str]:
    """A covariance of a pose, upper half: mm and degrees, part frame, right perturbation."""
    scale = np.array([1e3] * 3 + [np.degrees(1.0)] * 3)
    scaled = C * np.outer(scale, scale)
    rows = [
        "    " + f"{name:3}" + " " * 11 * k + "".join(f"{v:11.2e}" for v in scaled[k, k:])
        for k, name in enumerate(_AXES)
    ]
    return ["  covariance  of x y z rx ry rz in the part's own axes [mm, deg]:", *rows]
