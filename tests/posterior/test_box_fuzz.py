"""A box that may exclude the truth gives an answer or a sentence, never a numerical error."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

import tanteo
from bare_scenes import box_centred_pose, surface_points
from tanteo.geometry import SE3
from tanteo.posterior import PosePrior, Priors, prepare

PARTS = Path(__file__).parents[2] / "examples" / "parts"
NAMES = "bracket_right", "block", "step_12mm"


@cache
def target(name):
    return prepare(tanteo.read_part(PARTS / f"{name}.step"))


def boxed(k):
    """Answer touches of a part whose box ends near the truth, on either side of it, or is nearly empty."""
    rng = np.random.default_rng((55, k))
    own, T = target(NAMES[k % len(NAMES)]), box_centred_pose(rng, 0.3)
    p, n = surface_points(own, int(rng.integers(3, 13)), rng)
    points = SE3.apply(T, p) + 1e-4 * rng.normal(size=p.shape)
    size = own.part.diagonal * 10.0 ** rng.uniform(-4, 0.5)
    middle = SE3.apply(T, own.part.centroid) + rng.uniform(-0.6, 0.6, 3) * size * 10.0 ** rng.uniform(-1, 0.3)
    box = np.stack([middle - 0.5 * size, middle + 0.5 * size])
    directions = -n @ T[:3, :3].T if rng.integers(2) else None
    readings = tanteo.Readings.from_columns(points, directions=directions, sds=np.full(len(p), 1e-4))
    return tanteo.locate(readings, own.part, priors=Priors(pose=PosePrior(box=box)), conventions=False, seed=k)


@pytest.mark.parametrize("first", [0, pytest.param(6, marks=pytest.mark.slow)])
def test_any_box_gives_an_answer_or_a_sentence(first):
    for k in range(first, 6 if not first else 1000):
        answer = boxed(k)
        assert answer.message
        for h in answer.hypotheses:
            assert np.isfinite(h.covariance).all()
            assert np.linalg.eigvalsh(h.covariance).min() > -1e-12
