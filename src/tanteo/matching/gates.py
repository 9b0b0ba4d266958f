"""Which pairs of model features a sensed pair may be: gates that hold before any pose is known."""

from __future__ import annotations

import numpy as np

from tanteo.matching.candidates import Candidates
from tanteo.matching.model import PairTable, PartModel
from tanteo.matching.sensed import Sensed
from tanteo.typing import BoolArray, FloatArray

GATE_SDS = 4.3
"""Half width of the pruning gates in (bounds of) standard deviations: ``alpha = 1e-4`` with two degrees of freedom.

Bounds are scalar upper bounds of the true deviations, so a true pair is lost less often than that.
"""


def large_enough(sensed: Sensed, i: int, model: PartModel, tolerance: float) -> BoolArray:
    """Gate of one sensed feature: candidates that its points fit on ``(N,)``."""
    candidates = model.candidates[sensed.kinds[i]]
    noise = np.sqrt(max(len(sensed.features[i].support), 1) * sensed.shift[i] ** 2 + tolerance**2)
    room = 2 * GATE_SDS * noise
    return (candidates.spans + room >= sensed.span[i]) & (candidates.widths + room >= sensed.width[i])


def compatible(sensed: Sensed, i: int, j: int, model: PartModel, tolerance: float) -> BoolArray:
    """Gate of the sensed pair ``(i, j)`` for all pairs of candidates ``(Ni, Nj)``.

    Args:
        sensed: the sensed features.
        i: first of the pair.
        j: second of the pair.
        model: the part.
        tolerance: sd of the made surface against its CAD [m].
    """
    a, b = sensed.kinds[i], sensed.kinds[j]
    A, B = model.candidates[a], model.candidates[b]
    table = model.table(a, b)
    ok = np.ones((len(A), len(B)), dtype=bool)
    if table.angle is not None:
        sd = np.sqrt(
            sensed.tilt[i] ** 2
            + sensed.tilt[j] ** 2
            + _tilt_tolerance(A, tolerance)[:, None]
            + _tilt_tolerance(B, tolerance)
        )
        ok &= np.abs(table.angle - sensed.angle[i, j]) <= GATE_SDS * sd
    if not model.has_extent:
        return ok
    slack = tolerance * np.sqrt(2.0)
    if a == "plane":
        ok &= _along(sensed, i, j, table, A, slack, tolerance)
    if b == "plane":
        ok &= _along(sensed, j, i, model.table(b, a), B, slack, tolerance).T
    if sensed.placed[i] and sensed.placed[j]:
        margin = GATE_SDS * np.sqrt(sensed.shift[i] ** 2 + sensed.shift[j] ** 2 + slack**2)
        ok &= (sensed.distance[i, j] >= table.near - margin) & (sensed.distance[i, j] <= table.far + margin)
    return ok


def _tilt_tolerance(A: Candidates, tolerance: float) -> FloatArray:
    """Variance of the direction that the tolerance allows ``(N,)`` [rad2]."""
    return (tolerance * A.tolerance_scale[:, 1:].max(axis=1)) ** 2 if tolerance else np.zeros(len(A))


def _along(
    sensed: Sensed, i: int, j: int, table: PairTable, A: Candidates, slack: float, tolerance: float
) -> BoolArray:
    """Whether ``x_j`` lies along the normal of plane ``i`` where candidate ``b`` has points."""
    assert table.low is not None
    assert table.high is not None
    tilt = _tilt_tolerance(A, tolerance)[:, None] * sensed.distance[i, j] ** 2
    margin = GATE_SDS * np.sqrt(sensed.along_sd[i, j] ** 2 + slack**2 + tilt)
    if sensed.placed[j]:
        low, high = table.low, table.high
    else:  # its points are anywhere along it: only candidates at one height say something
        level = table.high - table.low < 1e-9
        low, high = np.where(level, table.low, -np.inf), np.where(level, table.high, np.inf)
    return (sensed.along[i, j] >= low - margin) & (sensed.along[i, j] <= high + margin)
