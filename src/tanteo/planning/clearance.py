"""Clearance of candidates: start and approach path against the workspace and all possible poses of the parts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tanteo.geometry import SE3
from tanteo.geometry.typing import BoolArray, FloatArray, IntArray, Transforms, Vectors
from tanteo.parts import signed_distance
from tanteo.planning.probe import Probe
from tanteo.planning.samples import even_normals
from tanteo.planning.state import SensingState
from tanteo.posterior import PreparedPart, box_corners

if TYPE_CHECKING:
    from tanteo.planning.candidates import Candidates

_LIVE = 0.003
"""Least probability of a mode, given that a part is present, that approaches must clear."""

_STEPS, _BESIDE_WALLS = 4, 10
"""Number of checked points on an approach path, without and with a stylus, which may move between walls."""

_DRAWS, _LEAST_DRAWS = 64, 8
"""Number of sampled poses that an approach path must clear, and least number for each mode."""

_BEYOND, _ENOUGH = (1.5, 1.0), 0.25
"""Spreads of the samples, as multiples of the posterior's, and least fraction of paths that must stay for the wider
one."""


def has_room(state: SensingState, candidates: Candidates, probe: Probe, *, anywhere: bool = True) -> BoolArray:
    """Return whether the approach path of each candidate is inside the workspace and clear of all modes ``(C,)``.

    Args:
        state: posterior of the session.
        candidates: readings to check.
        probe: sensor model with its clearance.
        anywhere: whether the path must also clear sampled poses of every mode.
    """
    way = _way(candidates, probe)
    ok: BoolArray = np.all(probe.workspace.clearances(way)[0] >= probe.clearance, axis=(1, 2))
    ok &= _reached_freely(candidates, probe)
    live = np.flatnonzero(state.weights >= _LIVE * state.weights.sum())
    gaps = np.zeros((len(live), *way.shape[:2]))
    for gap, k in zip(gaps, live, strict=True):
        rows = np.flatnonzero(ok)
        gap[rows] = _distances(state.target(int(k)), SE3.inverse(state.poses[k]), way[rows], probe)
        ok[rows] = gap[rows].min(axis=1) >= probe.clearance
    return _clear_anywhere(state, live, way, gaps, ok, probe) if anywhere else ok


def _clear_anywhere(
    state: SensingState, live: IntArray, way: Vectors, gaps: FloatArray, ok: BoolArray, probe: Probe
) -> BoolArray:
    """Return which clear paths also clear sampled poses of all modes ``(C,)``.

    The samples are wider than the posterior if enough paths remain; otherwise they have its spread.
    """
    w = state.weights[live] / max(state.weights.sum(), 1e-300)
    counts = np.maximum(_LEAST_DRAWS, np.round(_DRAWS * w)).astype(np.int64)
    clear = ok
    for beyond in _BEYOND:
        clear = ok.copy()
        for gap, k, count in zip(gaps, live, counts, strict=True):
            xi = beyond * even_normals(int(count))
            clear[clear] = _clear_of_draws(state, int(k), xi, way[clear], gap[clear], probe)
        if clear.sum() >= _ENOUGH * ok.sum():
            break
    return clear


def _reached_freely(candidates: Candidates, probe: Probe) -> BoolArray:
    """Return whether no forbidden box is on the path from the retreat over the start to the aim ``(C,)``.

    A beam is a line. A touch needs its clearance until its distance from the part equals it; from there only the tip
    counts, so that a thin part may lie on a forbidden table.
    """
    c, boxes = candidates, probe.workspace.forbidden
    aims, last = c.aims, np.maximum(c.ranges - probe.clearance, 0.0) if probe.contact else np.zeros(len(c))
    near = c.origins + last[:, None] * c.directions
    behind = c.origins + probe.retreat * _back(c, probe)
    tip = aims - probe.radius * c.directions
    met = [box.crossed(behind, near, probe.clearance) | box.crossed(near, tip, probe.radius) for box in boxes]
    ok = ~np.any(met, axis=0) if boxes else np.ones(len(c), dtype=bool)
    if probe.contact:
        ok &= np.all(probe.workspace.clearances(near)[0] >= probe.clearance, axis=1)
        ok &= np.all(probe.workspace.clearances(aims)[0] >= 0.0, axis=1)
    return np.asarray(ok)


def _clear_of_draws(
    state: SensingState, k: int, xi: FloatArray, way: Vectors, gaps: FloatArray, probe: Probe
) -> BoolArray:
    """Return whether paths are clear of a mode's part at sampled poses ``(n,)``.

    Args:
        state: posterior of the session.
        k: index of the mode.
        xi: perturbations in standard deviations ``(D, 6)``.
        way: points of each path ``(n, P, 3)`` [m].
        gaps: distances of the points from the part at the mode's pose ``(n, P)`` [m].
        probe: sensor model with its clearance.
    """
    target, T = state.target(k), state.poses[k]
    values, vectors = np.linalg.eigh(state.covariances[k])
    Ts = T @ SE3.exp(xi @ (vectors * np.sqrt(values.clip(0.0))).T)
    corners = box_corners(target.part)
    farthest = np.linalg.norm(SE3.apply(Ts[:, None], corners) - SE3.apply(T, corners), axis=-1).max()
    ok = np.ones(len(way), dtype=bool)
    rows, places = np.nonzero(gaps < probe.clearance + farthest)  # nothing moves farther than a corner of the box
    least = _distances(target, SE3.inverse(Ts)[:, None], way[rows, places], probe).min(axis=0)
    ok[rows[least < probe.clearance]] = False
    return ok


def clear_at(target: PreparedPart, T: Transforms, Ts: Transforms, candidates: Candidates, probe: Probe) -> BoolArray:
    """Return whether the approach paths are clear of a part at poses ``(S, 4, 4)`` near ``T``, as flags ``(S, C)``."""
    way = _way(candidates, probe)
    gaps, corners = _distances(target, SE3.inverse(T), way, probe), box_corners(target.part)
    farthest = np.linalg.norm(SE3.apply(Ts[:, None], corners) - SE3.apply(T, corners), axis=-1).max(axis=1)
    s, c, p = np.nonzero(gaps < probe.clearance + farthest[:, None, None])
    near = _distances(target, SE3.inverse(Ts[s]), way[c, p], probe) < probe.clearance
    ok = np.ones((len(Ts), len(candidates)), dtype=bool)
    ok[s[near], c[near]] = False
    return ok


def _way(candidates: Candidates, probe: Probe) -> Vectors:
    """Return points on the approach paths, the start first ``(C, P, 3)`` [m]."""
    back = np.linspace(0.0, probe.retreat, _STEPS if probe.stylus is None else _BESIDE_WALLS)
    return candidates.origins[:, None] + back[:, None] * _back(candidates, probe)[:, None]


def _back(candidates: Candidates, probe: Probe) -> Vectors:
    """Return the directions of retreat ``(C, 3)``: straight back, or along a stylus, as out of a bore."""
    return -candidates.directions if probe.stylus is None else np.broadcast_to(probe.stylus, candidates.origins.shape)


def _distances(target: PreparedPart, to_part: Transforms, points: Vectors, probe: Probe) -> FloatArray:
    """Return lower bounds of the distances of world points from the surface, negative inside [m].

    They are those of the grid less its error. For a stylus they are exact where the grid does not decide the clearance.
    """
    local = SE3.apply(to_part, points)
    distances = np.asarray(target.field(local)[0] - 0.5 * target.field.step)
    if probe.stylus is not None:
        short = probe.clearance - distances
        open_ = (short > 0) & (short <= target.field.step)
        distances[open_] = signed_distance(target.surface, local[open_])[0]
    return distances
