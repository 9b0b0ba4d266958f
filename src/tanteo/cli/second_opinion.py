"""Read the poses of a detector for ``identify``, and state whether the answer confirms or refutes each."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tanteo import posterior
from tanteo.cli.printing import complain
from tanteo.words.findings import SecondOpinion

if TYPE_CHECKING:
    from tanteo.cli.answer import Given
    from tanteo.posterior.detections import Detections

_REFUTED = 0.01
"""Probability of a detection below which it is refuted."""


def factor_of(path: str | None, given: Given) -> Detections | None:
    """Return the detections of a file as a factor; None without a file.

    Args:
        path: file of the detections.
        given: readings and candidate parts.

    Raises:
        InputError: the file cannot be read, or names none of the parts.
    """
    if path is None:
        return None
    from tanteo.errors import InputError
    from tanteo.io.poses.detections_file import read_detections
    from tanteo.posterior.detections import Detections, named

    found, others = named(read_detections(path), given.parts)
    if not found:
        raise InputError(
            f"{path}: expected detections of candidate parts, got {', '.join(others)}, not {given.parts[0].name} .... "
            "Use the names of the CAD files."
        )
    if others:
        complain("warning", f"{path}: detections of {', '.join(others)} are not used, no candidate has such a name.")
    spread = np.ptp([one.T_world_part[:3, 3] for one in found], axis=0).max(initial=0.0)
    radius = max(part.diagonal for part in given.parts) + float(spread)
    return Detections(found, len(given.parts), radius)


def judged(answer: posterior.Answer, opinion: Detections | None, given: Given) -> posterior.Answer:
    """Return an answer with a finding for each detection: whether it holds.

    Args:
        answer: answer of the readings and the detections.
        opinion: detections; None without any.
        given: readings and candidate parts.
    """
    from tanteo.posterior.detections import agreement

    if opinion is None:
        return answer
    parts = {part.name: part for part in given.parts}
    for one in opinion.found:
        part, total, nearest = parts[one.part], 0.0, (np.inf, np.inf)
        for h in answer.hypotheses:
            if h.part != one.part:
                continue
            shift, turn, inside = agreement(one, part, h.T_world_part, h.covariance)
            if inside:
                total += h.probability
                nearest = min(nearest, (shift, turn))
        state = "holds" if total > 0.5 else "refuted" if total < _REFUTED else "open"
        shift, turn = nearest if np.isfinite(nearest[0]) else (0.0, 0.0)
        answer = answer.adding(SecondOpinion(one.part, one.score, state, total, shift, turn))
    return answer
