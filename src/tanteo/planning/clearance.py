"""Clearance of candidate readings: approach paths against the workspace and the possible poses of the parts."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

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

Paths: TypeAlias = tuple[Vectors, FloatArray]
"""Points of approach paths, and the space that each point needs beyond the clearance."""

_STYLUS = 0.5
"""Numerical: a sphere of a tool's body belongs to the stylus if its radius is at most this fraction above the ball's,
because :func:`tanteo.machines.tool_body` widens the spheres of a chain until they enclose its cylinder."""

_LEAST_PROBABILITY = 0.003
"""Smallest probability of a mode, given that a part is present, for which approaches must be clear."""

_STEPS, _BESIDE_WALLS = 4, 10
"""Numbers of checked points on an approach path, without and with a stylus; a stylus may move between walls."""

_SAME = 1e-9
"""Numerical: distance from the end of the workspace that rounding may exceed [m]."""

_DRAWS, _LEAST_DRAWS = 64, 8
"""Number of sampled poses of which an approach path must be clear, and smallest number for each mode."""

_SPREADS, _ENOUGH = (1.5, 1.0), 0.25
"""Spreads of the sampled poses, as multiples of the posterior's, and fraction of the paths that must stay clear for the
wider spread to be used."""


def has_clearance(state: SensingState, candidates: Candidates, probe: Probe, *, anywhere: bool = True) -> BoolArray:
    """Return flags of the candidates whose approach is in the workspace and clear of the part at all modes ``(C,)``.

    Args:
        state: posterior of the session.
        candidates: readings to check.
        probe: sensor model with its clearance [m].
        anywhere: whether the path must also be clear of sampled poses of every mode.
    """
    path, wider = _approach_paths(candidates, probe)
    free = probe.workspace.clearances(path)[0].min(axis=-1, initial=np.inf) - wider
    for surface in probe.obstacles:
        free = np.minimum(free, surface.closest(path).distances - wider)
    ok: BoolArray = np.all(free >= probe.clearance, axis=1)
    ok &= _clear_of_boxes(candidates, probe)
    ok &= _clear_of_obstacles(candidates, probe)
    modes = np.flatnonzero(state.weights >= _LEAST_PROBABILITY * state.weights.sum())
    gaps = np.zeros((len(modes), *path.shape[:2]))
    for gap, k in zip(gaps, modes, strict=True):
        rows = np.flatnonzero(ok)
        gap[rows] = _distances(state.target(int(k)), SE3.inverse(state.poses[k]), path[rows], probe) - wider
        ok[rows] = gap[rows].min(axis=1) >= probe.clearance
    return _clear_anywhere(state, modes, (path, wider), gaps, ok, probe) if anywhere else ok


def _clear_anywhere(
    state: SensingState, modes: IntArray, paths: Paths, gaps: FloatArray, ok: BoolArray, probe: Probe
) -> BoolArray:
    """Return flags of the paths that are also clear of sampled poses of all modes ``(C,)``.

    The samples are spread more widely than the posterior if enough paths stay clear, otherwise as widely.
    """
    w = state.weights[modes] / max(state.weights.sum(), 1e-300)
    counts = np.maximum(_LEAST_DRAWS, np.round(_DRAWS * w)).astype(np.int64)
    clear = ok
    for spread in _SPREADS:
        clear = ok.copy()
        for gap, k, count in zip(gaps, modes, counts, strict=True):
            xi = spread * even_normals(int(count))
            clear[clear] = _clear_of_draws(state, int(k), xi, (paths[0][clear], paths[1]), gap[clear], probe)
        if clear.sum() >= _ENOUGH * ok.sum():
            break
    return clear


def _clear_of_boxes(candidates: Candidates, probe: Probe) -> BoolArray:
    """Return flags of the candidates without a forbidden box between retreat, start and aim ``(C,)``.

    For a beam, the path of the sensor is checked with its clearance, and the beam as a line. A touch probe needs its
    clearance up to that distance from the part; from there only its tip counts, so that a thin part may lie on a
    forbidden table.
    """
    c, boxes = candidates, probe.workspace.forbidden
    aims, last = c.aims, np.maximum(c.ranges - probe.clearance, 0.0) if probe.contact else np.zeros(len(c))
    near = c.origins + last[:, None] * c.directions
    retreated = c.origins + _retreats(c, probe)
    tip = aims - probe.radius * c.directions
    crossed = [box.crossed(retreated, near, probe.clearance) | box.crossed(near, tip, probe.radius) for box in boxes]
    ok = ~np.any(crossed, axis=0) if boxes else np.ones(len(c), dtype=bool)
    if probe.contact:
        ok &= np.all(probe.workspace.clearances(near)[0] >= probe.clearance, axis=1)
        ok &= np.all(probe.workspace.clearances(aims)[0] >= 0.0, axis=1)
    return np.asarray(ok)


def _clear_of_draws(
    state: SensingState, k: int, xi: FloatArray, paths: Paths, gaps: FloatArray, probe: Probe
) -> BoolArray:
    """Return flags of the paths that are clear of a mode's part at all sampled poses ``(n,)``.

    Args:
        state: posterior of the session.
        k: index of the mode.
        xi: perturbations in standard deviations ``(D, 6)``.
        paths: points of each path ``(n, P, 3)``, and the space that they need beyond the clearance ``(P,)`` [m].
        gaps: distances of the points from the part at the mode's pose ``(n, P)`` [m].
        probe: sensor model with its clearance.
    """
    (path, wider), target, T = paths, state.target(k), state.poses[k]
    values, vectors = np.linalg.eigh(state.covariances[k])
    Ts = T @ SE3.exp(xi @ (vectors * np.sqrt(values.clip(0.0))).T)
    corners = box_corners(target.part)
    farthest = np.linalg.norm(SE3.apply(Ts[:, None], corners) - SE3.apply(T, corners), axis=-1).max()
    ok = np.ones(len(path), dtype=bool)
    rows, places = np.nonzero(gaps < probe.clearance + farthest)  # nothing moves farther than a corner of the box
    least = _distances(target, SE3.inverse(Ts)[:, None], path[rows, places], probe).min(axis=0) - wider[places]
    ok[rows[least < probe.clearance]] = False
    return ok


def clear_at(target: PreparedPart, T: Transforms, Ts: Transforms, candidates: Candidates, probe: Probe) -> BoolArray:
    """Return whether each approach path is clear of a part at each of several similar poses ``(S, C)``.

    Args:
        target: the part.
        T: central pose ``T_world_part`` ``(4, 4)``, from which the distances are computed first.
        Ts: poses ``T_world_part`` ``(S, 4, 4)``.
        candidates: readings to check.
        probe: sensor model with its clearance [m].
    """
    path, wider = _approach_paths(candidates, probe)
    gaps, corners = _distances(target, SE3.inverse(T), path, probe) - wider, box_corners(target.part)
    farthest = np.linalg.norm(SE3.apply(Ts[:, None], corners) - SE3.apply(T, corners), axis=-1).max(axis=1)
    s, c, p = np.nonzero(gaps < probe.clearance + farthest[:, None, None])
    near = _distances(target, SE3.inverse(Ts[s]), path[c, p], probe) - wider[p] < probe.clearance
    ok = np.ones((len(Ts), len(candidates)), dtype=bool)
    ok[s[near], c[near]] = False
    return ok


def _approach_paths(candidates: Candidates, probe: Probe) -> Paths:
    """Return points on the approach paths, and the space that each needs beyond the clearance.

    The points are those of the ball from the start back to the retreat. A tool with a body adds the centres of its
    spheres at the contact, the start and the retreat; those of the stylus are checked by rays.

    Returns:
        Points, world frame ``(C, P, 3)`` [m], and lengths, negative where less space is needed ``(P,)`` [m].
    """
    back = np.linspace(0.0, 1.0, _STEPS if probe.stylus is None else _BESIDE_WALLS)
    path = candidates.origins[:, None] + back[:, None] * _retreats(candidates, probe)[:, None]
    if probe.body is None:
        return path, np.zeros(len(back))
    tool = probe.body.radii > probe.radius * (1 + _STYLUS)
    depths, radii = -probe.body.centres[tool, 2], probe.body.radii[tool]
    places = np.stack([candidates.aims, path[:, 0], path[:, -1]], axis=1)
    spheres = places[:, :, None] + depths[:, None] * probe.holders(candidates.directions)[:, None, None]
    spheres = spheres.reshape(len(path), -1, 3)
    wider = np.tile(radii - probe.clearance, places.shape[1])
    return np.concatenate([path, spheres], axis=1), np.concatenate([np.zeros(len(back)), wider])


def _clear_of_obstacles(candidates: Candidates, probe: Probe) -> BoolArray:
    """Return flags of the candidates whose motion to the aim does not meet a known surface ``(C,)``."""
    ok = np.ones(len(candidates), dtype=bool)
    for surface in probe.obstacles:
        ok &= surface.cast(candidates.origins, candidates.directions).distances > candidates.ranges
        ok &= surface.closest(candidates.aims).distances >= probe.radius
    return ok


def _retreats(candidates: Candidates, probe: Probe) -> Vectors:
    """Return the retreats ``(C, 3)`` [m]: straight back, or along the stylus, as out of a bore.

    Along the stylus they end where the workspace ends, because a machine rises no farther.
    """
    if probe.stylus is None:
        return -probe.retreat * candidates.directions
    up, origins, within = probe.stylus, candidates.origins, probe.workspace
    ends = np.where(up > 0, within.high - probe.clearance, within.low + probe.clearance)
    with np.errstate(divide="ignore", invalid="ignore"):
        length = np.where(up != 0, (ends - origins) / up, np.inf).min(axis=1)
    return np.clip(length - _SAME, 0.0, probe.retreat)[:, None] * up


def _distances(target: PreparedPart, to_part: Transforms, points: Vectors, probe: Probe) -> FloatArray:
    """Return lower bounds of the distances of world points from the surface, negative inside [m].

    They are the values of the distance grid minus its error. For a stylus, the exact distance replaces them where the
    error of the grid matters for the clearance.
    """
    local = SE3.apply(to_part, points)
    distances = np.asarray(target.field(local)[0] - 0.5 * target.field.step)
    if probe.stylus is not None:
        short = probe.clearance - distances
        open_ = (short > 0) & (short <= target.field.step)
        distances[open_] = signed_distance(target.surface, local[open_])[0]
    return distances
