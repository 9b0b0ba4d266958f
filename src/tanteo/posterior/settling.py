"""Poses that lay exact places on the surface of a part."""

from __future__ import annotations

import numpy as np

from tanteo import _core
from tanteo.geometry.typing import FloatArray, Transforms
from tanteo.posterior.prepared import PreparedPart
from tanteo.posterior.problem import Problem


def settle(problem: Problem, part: PreparedPart, Ts: Transforms, scales: FloatArray) -> Transforms:
    """Robust Gauss-Newton of the points of a problem on the surface, one step a scale; nothing else counts.

    Args:
        problem: its points.
        part: the part.
        Ts: poses to start from ``(S, 4, 4)``.
        scales: distances from which points lose their weight, one for each step ``(K,)`` [m].
    """
    rows = np.arange(len(problem.points), dtype=np.int32)
    return _core.settle(part.shape, problem.compiled(part), rows, np.asarray(scales), np.ascontiguousarray(Ts))[0]
