"""Three touches: the evidence of a part is the integral over all of its poses, and seeds agree."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tanteo
from tanteo import _core
from tanteo.factors import FreeRays, as_contact_points
from tanteo.geometry import SE3, SO3
from tanteo.geometry.special import log_sum
from tanteo.posterior import Priors, Problem, prepare
from tanteo.posterior.part_search import start_search
from tanteo.posterior.sampling.placements import Placements
from tanteo.sensors import measure

EXAMPLES = Path(__file__).parents[2] / "examples" / "parts"
SD = 3e-3
TOUCHES = np.array([[0.0, 0.0, 0.0], [0.05, 0.01, 0.0], [0.01, 0.04, 0.01]])


def search_of(name, noise_factor):
    """Return a search of a part before its first round, by three touches of coarse noise."""
    points = as_contact_points(measure(tanteo.Readings.from_columns(TOUCHES, sds=np.full(3, SD))))
    problem = Problem(points, FreeRays.none(), Priors(radius=0.2, noise_factor=noise_factor, outlier_rate=1e-6))
    return start_search(problem, prepare(tanteo.read_part(EXAMPLES / name)), np.random.default_rng(0))


def integral(search, count, rng):
    """Return the log of the integral over all poses at which the first touch is near the part, by even draws."""
    part, objective = search.objective.prepared.part, search.objective
    low, high = part.box[0] - 6 * SD, part.box[1] + 6 * SD
    q = rng.normal(size=(count, 4))
    R = np.array(SO3.from_quaternion(q / np.linalg.norm(q, axis=1, keepdims=True)))
    first = low + (high - low) * rng.random((count, 3))
    Ts = SE3.from_parts(R, TOUCHES[0] - np.einsum("nij,nj->ni", R, first))
    inside = np.stack([SE3.apply(SE3.inverse(Ts), np.broadcast_to(p, (count, 3))) for p in TOUCHES[1:]])
    Ts = np.ascontiguousarray(Ts[((inside > low) & (inside < high)).all(axis=(0, 2))])
    logs, _ = _core.marginals(
        objective.prepared.shape, objective.core, Ts, np.zeros((len(Ts), objective.problem.states))
    )
    return log_sum(logs) - np.log(count) + np.log(np.prod(high - low) * 8 * np.pi**2)


@pytest.mark.parametrize("name", ["block.step", "bracket_left.step"])
def test_the_evidence_of_three_touches_is_an_integral(name):
    """Even draws have a standard deviation of 0.05, placements of 0.05; edges within the noise hold up to 0.15."""
    search = search_of(name, 1)
    placed = Placements(search.objective, np.random.default_rng(1), 0.0)
    placed.draw(4000)
    assert abs(placed.log_mass - integral(search, 200_000, np.random.default_rng(2))) < 0.2


def test_the_noise_scale_is_integrated():
    """Laplace's method has it in the even draws, its prior in the placements."""
    search = search_of("block.step", 2)
    placed = Placements(search.objective, np.random.default_rng(1), 0.0)
    placed.draw(4000)
    assert abs(placed.log_mass - integral(search, 100_000, np.random.default_rng(2))) < 0.2


def test_seeds_agree_on_three_touches():
    parts = [
        tanteo.read_part(EXAMPLES / f"{name}.step") for name in ("block", "bracket_left", "bracket_right", "wedge")
    ]
    rng = np.random.default_rng(5)
    for _ in range(3):
        points = TOUCHES @ SO3.exp(rng.normal(size=3)).T + 1e-4 * rng.normal(size=(3, 3))
        readings = tanteo.Readings.from_columns(points, sds=np.full(3, 1e-4))
        answers = [tanteo.identify(readings, parts, seed=seed) for seed in range(4)]
        P = np.array([[dict(answer.parts).get(part.name, 0.0) for part in parts] for answer in answers])
        assert np.ptp(P, axis=0).max() < 0.08
        assert np.abs(P.sum(axis=1) + [answer.unknown_probability for answer in answers] - 1).max() < 1e-6
        assert {answer.status for answer in answers} == {"insufficient"}


def test_three_touches_wider_than_any_part_have_an_answer():
    readings = tanteo.Readings.from_columns(20 * TOUCHES, sds=np.full(3, 1e-4))
    answer = tanteo.identify(readings, [tanteo.read_part(EXAMPLES / "block.step")])
    assert answer.status != "recognized"
    assert answer.unknown_probability > 0.5
