"""Which poses are one: against every pair, symmetric images and information of any size."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bare_scenes import SENSORS, box_centred_pose, no_paths, scene
from tanteo.lie import SE3
from tanteo.matching import Priors
from tanteo.matching.belief import equivalent
from tanteo.parts import read_part
from tanteo.surface_search import prepare_target
from tanteo.surface_search.distinct import SAME_MAXIMUM, _same, distinct_maxima
from tanteo.surface_search.polish import polish

PARTS = Path(__file__).parents[2] / "examples" / "parts"


@pytest.mark.parametrize("name", ["bracket_left", "block", "flange"])
@pytest.mark.parametrize("away", [0.0, 30.0])
def test_the_bound_excludes_no_pair_that_is_one(name, away):
    """Poses in clumps about each other's symmetric images, near and tens of metres from the origin."""
    part, rng = read_part(PARTS / f"{name}.step"), np.random.default_rng(3)
    base = np.stack([box_centred_pose(rng) for _ in range(4)])
    base[:, :3, 3] += away
    images = part.symmetry.Ts[rng.integers(len(part.symmetry.Ts), size=60)]
    xi = rng.normal(size=(60, 6)) * [1e-3, 1e-3, 1e-3, 0.02, 0.02, 0.02] * rng.choice([0.1, 1.0, 5.0], (60, 1))
    Ts = base[rng.integers(4, size=60)] @ images @ SE3.exp(xi)
    A = rng.normal(size=(60, 6, 9)) / np.array([1e-3, 1e-3, 1e-3, 0.02, 0.02, 0.02])[:, None]
    information = A @ np.swapaxes(A, 1, 2) * rng.choice([1e-3, 0.1, 1.0], (60, 1, 1))
    information[:5, :, 3:] = information[:5, 3:] = 0.0  # nothing resists a turn
    _, vectors = np.linalg.eigh(information[5:25])
    information[5:25] = vectors[:, :, 2:] @ (vectors[:, :, 2:].swapaxes(1, 2) @ information[5:25])  # or two screws
    information[5:25] = 0.5 * (information[5:25] + information[5:25].swapaxes(1, 2))
    every = np.stack([equivalent(part, T, Ts, information, SAME_MAXIMUM) for T in Ts])
    np.fill_diagonal(every, True)
    same = _same(part, Ts, information)
    assert 0.02 < np.triu(every, 1).mean() < 0.9
    np.testing.assert_array_equal(same, np.triu(every))
    apart = rng.integers(-1, 2, size=60)
    known = (apart[:, None] == apart) & (apart >= 0) & ~np.eye(60, dtype=bool)
    assert np.triu(every & known, 1).any()
    np.testing.assert_array_equal(_same(part, Ts, information, apart), np.triu(every & ~known))


def test_what_met_is_kept_once_with_all_groups_that_led_there():
    target, rng = prepare_target(read_part(PARTS / "bracket_left.step")), np.random.default_rng(4)
    T = box_centred_pose(rng)
    touches, _, _ = scene(target, T, SENSORS[1], 15, rng)
    near = T @ SE3.exp(1e-4 * rng.normal(size=(3, 6)))
    far = T @ target.turns[:1]
    found = polish(
        touches, no_paths(), np.concatenate([near, far]), target, Priors(radius=0.1), groups=np.array([1, 2, 2, 4])
    )
    one = distinct_maxima(found, target)
    assert sorted(one.groups.tolist())[-1] in (3, 4)
    assert 3 in one.groups
    assert len(one.Ts) <= 2
    assert one.log_evidence[0] == found.log_evidence.max()
    none = distinct_maxima(replace(found.take(np.array([], dtype=int))), target)
    assert not len(none.Ts)
