"""The interpretation tree as an array program: all partial interpretations of a level at once.

An interpretation gives every sensed feature a model feature or nothing. A level adds one sensed feature to all
partial interpretations together; pairs are gated by tables, and as soon as three features are paired the joint
chi-square of the pose they imply prunes what no single pose explains (``math.md`` section 9).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tanteo.localization.scaling import motions_about
from tanteo.localization.solve import Block, Solution, gauss_newton, take
from tanteo.localization.start import first_pose
from tanteo.matching.freedom import NOTHING, free_projector, pose_scale
from tanteo.matching.gates import compatible, large_enough
from tanteo.matching.model import PartModel
from tanteo.matching.pairings import build
from tanteo.matching.sensed import Sensed
from tanteo.typing import BoolArray, FloatArray, IntArray

ALPHA_JOINT = 1e-4
"""A true interpretation is lost by one joint prefix test with this probability."""

TURNS = 6
"""Directions of a right-angled family that the first paired feature may have, all alike: one is searched."""

MAX_PARTIAL = 40_000
"""More partial interpretations than this on one level are cut: the answer says so."""

_TEST_ABOVE = 64
"""Levels with more partial interpretations than this are pruned by the joint test before they grow."""

_CHUNK = 2_000_000


@dataclass(frozen=True, slots=True, eq=False)
class Interpretations:
    """Complete interpretations of the sensed features by one part, with the pose that each implies.

    Attributes:
        choices: candidate of each sensed feature, or :data:`NOTHING` ``(F, n)``.
        solution: the joint estimate of each.
        cut: whether the search dropped partial interpretations because there were too many.
    """

    choices: IntArray
    solution: Solution
    cut: bool


Gates = tuple[dict[tuple[int, int], BoolArray], dict[int, BoolArray]]
"""For each pair of sensed features, which candidates go together; and for each feature, which it may be at all."""


def pair_gates(sensed: Sensed, model: PartModel, tolerance: float) -> Gates:
    """All gates that hold before any pose is known."""
    members = [i for i in range(len(sensed)) if sensed.kinds[i] in model.candidates]
    views = sensed.views
    gates = {
        (i, j): np.block([[compatible(sensed, a, b, model, tolerance) for b in views[j]] for a in views[i]])
        for i in members
        for j in members
        if i < j
    }
    fits = {i: np.concatenate([large_enough(sensed, a, model, tolerance) for a in views[i]]) for i in members}
    for (i, j), gate in gates.items():
        gate &= fits[i][:, None] & fits[j]
    return gates, fits


def interpret(
    sensed: Sensed, model: PartModel, n_nothing: int, tolerance: float = 0.0, gates: Gates | None = None
) -> Interpretations:
    """All interpretations with exactly ``n_nothing`` features left out that pairs and poses allow.

    Args:
        sensed: the sensed features.
        model: the part, or a family known by its directions.
        n_nothing: how many sensed features are clutter.
        tolerance: sd of the made surface against its CAD [m].
        gates: of :func:`pair_gates`, if they are known already.

    Returns:
        The interpretations; of a family known by its directions one in :data:`TURNS` that are alike.
    """
    members = [i for i in range(len(sensed)) if sensed.kinds[i] in model.candidates]
    missing = len(sensed) - len(members)  # features of kinds that the part does not have are clutter already
    choices, cut = np.full((1, len(sensed)), NOTHING), False
    if missing > n_nothing:
        choices = choices[:0]
        members = []
    pairs, fits = gates or pair_gates(sensed, model, tolerance)
    done: list[int] = []
    for i in _order(members, pairs) if len(choices) else ():
        if len(choices) > _TEST_ABOVE and len(done) > 2:
            choices, _ = prune(sensed, model, choices, tolerance)
        choices = _expand(choices, done, i, fits[i], pairs, n_nothing - missing)
        if not model.has_extent:  # all six directions look alike: the first one chosen may as well be the first
            turned = (choices[:, i] != NOTHING) & (choices[:, i] % TURNS > 0)
            choices = choices[~(turned & np.all(choices[:, done] == NOTHING, axis=1))]
        done.append(i)
        if not len(choices):
            break
        if len(choices) > MAX_PARTIAL:
            choices, cut = choices[np.linspace(0, len(choices) - 1, MAX_PARTIAL).astype(np.int64)], True
    left_out = (choices == NOTHING).sum(axis=1)
    choices, solution = prune(sensed, model, choices[left_out == n_nothing], tolerance, iterations=20)
    return Interpretations(choices, solution, cut)


def _order(members: Sequence[int], gates: dict[tuple[int, int], BoolArray]) -> list[int]:
    """Sensed features, the one that leaves fewest partial interpretations next."""
    if len(members) < 3:
        return list(members)
    share = {pair: np.log(max(float(ok.mean()), 1e-12)) for pair, ok in gates.items()}
    sizes = {}
    for (i, j), ok in gates.items():
        sizes[i], sizes[j] = np.log(ok.shape[0]), np.log(ok.shape[1])

    def pair_share(i: int, j: int) -> float:
        return share[min(i, j), max(i, j)]

    first = min(gates, key=lambda pair: sizes[pair[0]] + sizes[pair[1]] + share[pair])
    order = [*first]
    while len(order) < len(members):
        rest = [i for i in members if i not in order]
        order.append(min(rest, key=lambda i: sizes[i] + sum(pair_share(i, j) for j in order)))
    return order


def _expand(
    choices: IntArray, done: list[int], i: int, fits: BoolArray, gates: dict[tuple[int, int], BoolArray], allowed: int
) -> IntArray:
    """Every partial interpretation with every candidate of feature ``i`` that its choices so far allow, or nothing."""
    grown = []
    step = max(1, _CHUNK // max(len(fits), 1))
    for rows in (choices[k : k + step] for k in range(0, len(choices), step)):
        ok = np.tile(fits, (len(rows), 1))
        for j in done:
            gate = gates[j, i] if (j, i) in gates else gates[i, j].T
            chosen = rows[:, j]
            ok &= gate[chosen] | (chosen == NOTHING)[:, None]
        which, candidate = np.nonzero(ok)
        new = rows[which]
        new[:, i] = candidate
        grown.append(new)
        if allowed > 0:
            grown.append(rows[(rows[:, done] == NOTHING).sum(axis=1) < allowed])
    return np.concatenate(grown) if grown else choices


def prune(
    sensed: Sensed, model: PartModel, choices: IntArray, tolerance: float, iterations: int = 4
) -> tuple[IntArray, Solution]:
    """Drop interpretations that no single pose explains: joint chi-square, and normals the right way round."""
    if not len(choices):
        return choices, _no_solution(sensed.gains[0].shape[1] if sensed.gains else 0)
    blocks = build(sensed, model, choices, tolerance)
    start = first_pose(blocks) if blocks else np.tile(np.eye(4), (len(choices), 1, 1))
    start = np.broadcast_to(start, (len(choices), 4, 4))
    choices, solution = _test(
        sensed, model, choices, blocks, start, min(iterations, _FEW), 2.0 if iterations > _FEW else 1.0
    )
    if iterations > _FEW and len(choices):
        blocks = build(sensed, model, choices, tolerance)
        choices, solution = _test(sensed, model, choices, blocks, solution.T_world_part, iterations)
    return choices, solution


def _no_solution(D: int) -> Solution:
    none = np.zeros(0)
    square = np.zeros((0, 6 + D, 6 + D))
    return Solution(np.zeros((0, 4, 4)), np.zeros((0, D)), square, np.zeros((0, 6 + D)), none, none, none, none)


def _test(
    sensed: Sensed,
    model: PartModel,
    choices: IntArray,
    blocks: Sequence[Block],
    start: FloatArray,
    iterations: int,
    slack: float = 1.0,
) -> tuple[IntArray, Solution]:
    """Iterate, and keep what passes the joint test with ``slack`` times its gate."""
    from scipy.special import chdtri  # slow to import

    n_shared = sensed.gains[0].shape[1] if sensed.gains else 0
    free, n_free = free_projector(sensed, model, choices, model.radius)
    to_units, to_middle = np.linalg.inv(pose_scale(model.radius, model.middle)), motions_about(-model.middle)
    hold = to_middle.T @ _HOLD @ to_middle + _STIFF * to_units.T @ free @ to_units
    solution = gauss_newton(blocks, start, n_shared, hold=hold, iterations=iterations, tolerance=1e-12)
    dof = np.maximum(solution.equations - (6 - n_free), 1.0)
    ok = solution.chi2 <= slack * chdtri(dof, ALPHA_JOINT)
    ok &= _same_side(blocks, solution.T_world_part)
    return choices[ok], take(solution, ok)


_FEW = 4
"""Iterations after which what is far from consistent is dropped."""

_HOLD = np.diag([1e-2] * 3 + [1e-4] * 3)
"""Keeps steps small where little resists; far below any real information."""

_STIFF = 1e8
"""Information, in units of the part, that keeps the pose where it is along motions that nothing resists."""


def _same_side(blocks: Sequence[Block], T_world_part: FloatArray) -> BoolArray:
    """Paired normals and edge directions agree in sign (``math.md`` section 5, side conditions)."""
    ok = np.ones(len(T_world_part), dtype=bool)
    for block in blocks:
        axis = {"plane": 2, "edge": 0}.get(block.relation.sensed.name)
        if axis is None:
            continue
        model = np.einsum("fij,fnj->fni", T_world_part[:, :3, :3], block.Ts_part_model[..., :3, axis])
        cosine = np.sum(model * block.Ts_world_feature[..., :3, axis], axis=-1)
        ok &= np.all((cosine > 0) | ~block.active, axis=-1)
    return ok
