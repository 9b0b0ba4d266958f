"""A peak on a plain: readings near edges alone constrain a pose as the posterior beyond the peak does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from bare_scenes import box_centred_pose, no_paths, surface_points, touches_of
from tanteo.geometry import SE3, SO3
from tanteo.parts import read_part
from tanteo.posterior import identify_points, prepare

SD = 1e-4
EXAMPLES = Path(__file__).parents[2] / "examples" / "parts"


@pytest.fixture(scope="module")
def bar(tmp_path_factory):
    path = tmp_path_factory.mktemp("bar") / "bar.stl"
    trimesh.creation.cylinder(radius=10, height=60, sections=64).export(path)
    return prepare(read_part(path, unit="mm"))


def on_its_side(bar, seed):
    """25 touches of the side of a bar, none of its ends."""
    rng = np.random.default_rng((77, seed))
    T = box_centred_pose(rng)
    p, n = surface_points(bar, 750, rng)
    p = p[np.abs(n[:, 2]) < 0.1][:25]
    return touches_of(SE3.apply(T, p) + SD * rng.normal(size=p.shape), SD)


def test_the_same_in_another_frame(bar):
    """The plain leads along no axis of the coordinates."""
    touches, turn = on_its_side(bar, 14), SO3.exp(np.array([0.4, -0.8, 0.5]))
    first = identify_points(touches, no_paths(), [bar]).hypotheses[0]
    other = touches_of(touches.points @ turn.T + 0.3, SD)
    second = identify_points(other, no_paths(), [bar]).hypotheses[0]
    assert second.corner_sd == pytest.approx(first.corner_sd, rel=0.2)


@pytest.mark.parametrize(("seed", "orders"), [(0, 2), *(pytest.param(k, 4, marks=pytest.mark.slow) for k in range(3))])
def test_order_of_coarse_points_does_not_change_the_evidence(seed, orders):
    """With noise of a tenth of the part faces swap readings; the samples have to find the same mass each time."""
    parts = [prepare(read_part(EXAMPLES / f"{name}.step")) for name in ("step_12mm", "step_15mm")]
    rng = np.random.default_rng((5, seed))
    p, _ = surface_points(parts[0], 21, rng)
    points = SE3.apply(box_centred_pose(rng), p) + 3e-3 * rng.normal(size=p.shape)
    stated = []
    for _ in range(orders):
        answer = identify_points(touches_of(points[rng.permutation(21)], 3e-3), no_paths(), parts)
        stated.append([sum(h.probability for h in answer.hypotheses if h.part == t.part.name) for t in parts])
    np.testing.assert_allclose(stated, stated[:1] * orders, atol=0.05)
