"""Search for the smallest set of readings that achieves a tolerance, first linearized, then over sampled placements."""

from __future__ import annotations

import numpy as np

from tanteo.geometry.typing import FloatArray, IntArray
from tanteo.planning.design import Design

_SWEEPS, _STARTS = 6, 12
"""Numbers of rounds of exchanges, and of random initial sets, which avoid poor local minima."""


def choose(design: Design, tolerance: float, confidence: float, max_measurements: int, *, can: bool) -> IntArray:
    """Return the smallest set of candidates that achieves the tolerance, or the best set of the allowed size.

    The set is empty if not even infinitely many readings achieve the tolerance. The candidates are in the order of
    their benefit.

    Args:
        design: linear problem of the plan.
        tolerance: tolerance [m].
        confidence: required probability of the tolerance.
        max_measurements: largest number of readings.
        can: whether all candidates together achieve the tolerance.
    """
    if design.chance(design.limit, tolerance) < confidence:
        return np.zeros(0, dtype=np.int64)
    chosen = _linear(design.steadied(), tolerance, confidence, max_measurements)
    return _ordered(design, _steady(design, chosen, tolerance, confidence, max_measurements, exchange=can))


def _linear(design: Design, tolerance: float, confidence: float, max_measurements: int) -> list[int]:
    """Return the smallest set of candidates that achieves the tolerance in the linearized problem."""
    chosen: list[int] = []
    while len(chosen) < min(max_measurements, len(design.rows)):
        starts = [_extended(design, chosen), *_drawn(len(design.rows), len(chosen) + 1)]
        chosen = min((_exchanged(design, start) for start in starts), key=design.cost_of)
        if design.chance(design.after(np.array(chosen)), tolerance) >= confidence:
            break
    return chosen


def _steady(
    design: Design, chosen: list[int], tolerance: float, confidence: float, max_measurements: int, *, exchange: bool
) -> list[int]:
    """Exchange and add readings until the tolerance is achieved over all sampled placements."""
    chosen = _exchanged_over_placements(design, chosen, tolerance) if exchange else chosen
    while (
        len(chosen) < min(max_measurements, len(design.rows)) and design.kept(np.array(chosen), tolerance) < confidence
    ):
        chosen = [*chosen, _best_with(design, chosen, tolerance)[0]]
        chosen = _exchanged_over_placements(design, chosen, tolerance) if exchange else chosen
    return chosen


def _exchanged_over_placements(design: Design, chosen: list[int], tolerance: float) -> list[int]:
    """Exchange each reading once for a better one, judged over all sampled placements."""
    for k in range(len(chosen)):
        others = chosen[:k] + chosen[k + 1 :]
        j, lost = _best_with(design, others, tolerance)
        if lost[j] < lost[chosen[k]] * (1 - 1e-3):
            chosen = [*chosen[:k], j, *chosen[k + 1 :]]
    return chosen


def _best_with(design: Design, chosen: list[int], tolerance: float) -> tuple[int, FloatArray]:
    """Return the best candidate to add, and the probability of a missed tolerance with each candidate."""
    lost = design.lost_with_each(chosen, tolerance)
    lost[chosen] = np.inf
    return int(np.argmin(lost)), lost


def _drawn(count: int, n: int) -> list[list[int]]:
    """Return reproducible random sets of ``n`` of ``count`` candidates."""
    rng = np.random.default_rng((1991, n))
    return [rng.choice(count, n, replace=False).tolist() for _ in range(_STARTS)]


def _extended(design: Design, chosen: list[int]) -> list[int]:
    cost = design.with_each(design.after(np.array(chosen, dtype=np.int64)))
    cost[chosen] = np.inf
    return [*chosen, int(np.argmin(cost))]


def _exchanged(design: Design, chosen: list[int]) -> list[int]:
    """Exchange single readings until no exchange reduces the cost."""
    cost = design.cost_of(chosen)
    for _ in range(_SWEEPS):
        before = cost
        for k in range(len(chosen)):
            others = chosen[:k] + chosen[k + 1 :]
            costs = design.with_each(design.after(np.array(others, dtype=np.int64)))
            costs[others] = np.inf
            j = int(np.argmin(costs))
            if costs[j] < cost * (1 - 1e-9):
                chosen, cost = [*chosen[:k], j, *chosen[k + 1 :]], float(costs[j])
        if cost > before * (1 - 1e-3):
            break
    return chosen


def _ordered(design: Design, chosen: list[int]) -> IntArray:
    """Return the readings in the order of their benefit."""
    order: list[int] = []
    left = list(chosen)
    while left:
        cost = design.with_each(design.after(np.array(order, dtype=np.int64)))
        order.append(min(left, key=lambda k: cost[k]))
        left.remove(order[-1])
    return np.array(order, dtype=np.int64)
