"""Paths between maxima follow bent ridges, and modes of few touches hardly depend on the seed of the search."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tanteo
from bare_scenes import box_centred_pose, surface_points
from tanteo import _core
from tanteo.factors import FreeRays, as_contact_points
from tanteo.geometry import SE3
from tanteo.posterior import PosePrior, Priors, Problem, prepare
from tanteo.posterior.part_search import start_search
from tanteo.posterior.proposals import InitialPoses
from tanteo.posterior.sampling.peaks import Peaks
from tanteo.posterior.sampling.ridges import Paths, follow, regions_of_maxima
from tanteo.posterior.sampling.sampler import Sampler
from tanteo.sensors import measure

EXAMPLES = Path(__file__).parents[2] / "examples" / "parts"
SD = 1e-4
TOP = np.array([[0.3, 0.4], [0.7, 0.3], [0.6, 0.7], [0.35, 0.65]])
"""Places of four touches on the top of the block, over its length and width."""


@pytest.fixture(scope="module")
def search():
    """Return a search of four touches of the top of the block and one of a side: a turn and a slide are free."""
    block = prepare(tanteo.read_part(EXAMPLES / "block.step"))
    low, high = block.part.box
    top = np.column_stack([TOP * (high - low)[:2] + low[:2], np.full(4, high[2])])
    points = as_contact_points(measure(tanteo.Readings.from_columns(np.vstack([top, side(block)]), sds=np.full(5, SD))))
    search = start_search(Problem(points, FreeRays.none(), Priors(radius=0.2)), block, np.random.default_rng(0))
    search.add(InitialPoses.exhaustive(np.eye(4)[None]))
    return search


def side(block):
    low, high = block.part.box
    return np.array([high[0], 0.5 * (low[1] + high[1]), 0.4 * low[2] + 0.6 * high[2]])


def turned(search, angles, slides):
    """Return poses of the block after slides along its touched side, and turns about the touch there."""
    about = side(search.objective.prepared)
    R = SE3.exp(np.column_stack([np.zeros((len(angles), 5)), angles]))[:, :3, :3]
    return SE3.from_parts(R, about - R @ about + slides[:, None] * R[:, :, 1])


def joined(search, ends):
    """Return whether the straight path between two poses, and the path along the ridge, are high everywhere."""
    zs = np.zeros((1, 2, search.objective.problem.states))
    straight = Paths(search.objective, ends[None], zs).halved().halved()
    shape, core = search.objective.prepared.shape, search.objective.core
    least = _core.marginals(shape, core, np.ascontiguousarray(ends), zs[0])[0].min(keepdims=True) - 3.0
    return bool((straight.lowest() > least)[0]), bool((follow(straight, least) > least)[0])


def test_maxima_on_one_ridge_are_one_region(search):
    """The block may slide along its touched side, but upside down it is in another region."""
    objective, middle = search.objective, np.eye(4)
    middle[:3, 3] = search.objective.prepared.part.box.mean(axis=0)
    over = middle @ SE3.exp(np.array([0, 0, 0, np.pi, 0, 0])) @ SE3.inverse(middle)
    Ts = np.concatenate([turned(search, np.zeros(3), np.array([0.0, 1e-3, 2e-3])), over[None]])
    zs = np.zeros((4, objective.problem.states))
    logs, _, information = _core.slopes(objective.prepared.shape, objective.core, Ts, zs)
    rows = np.arange(4)
    regions = regions_of_maxima(objective, Peaks(Ts, zs, logs, information, logs, 1 << rows))
    assert [list(own) for own in regions] == [[0, 1, 2], [3]]


def test_a_path_follows_a_bent_ridge(search):
    """On the straight path between two turns, one with a slide, the side leaves its touch: it is an outlier there."""
    ends = turned(search, np.array([-0.25, 0.25]), np.array([0.0, 0.005]))
    assert joined(search, ends) == (False, True)


def test_no_path_joins_two_sides_of_a_part(search):
    """Half a turn about an axis along the top leaves all touches on the way."""
    over, (low, high) = np.diag([1.0, -1.0, -1.0, 1.0]), search.objective.prepared.part.box
    over[1:3, 3] = (low + high)[1:]
    assert joined(search, np.stack([np.eye(4), over])) == (False, False)


def test_samples_in_pieces_scatter_little():
    """Six touches leave bent ridges: log masses have an sd of 0.08, and 0.25 with components about maxima alone."""
    own, rng = prepare(tanteo.read_part(EXAMPLES / "wedge.step")), np.random.default_rng(5)
    points = SE3.apply(box_centred_pose(rng), surface_points(own, 6, rng)[0]) + SD * rng.normal(size=(6, 3))
    touches = as_contact_points(measure(tanteo.Readings.from_columns(points, sds=np.full(6, SD))))
    problem = Problem(touches, FreeRays.none(), Priors(radius=0.2))
    found = start_search(problem, own, np.random.default_rng(0))
    found.restart()
    logs = []
    for seed in range(4):
        sampler = Sampler(found.objective, found.peaks, np.random.default_rng(seed), 0.0)
        sampler.sample(np.full(len(found.peaks), 24))
        sampler.in_pieces[:] = True
        for _ in range(2):
            mass = sampler.masses()[0]
            sampler.sample(np.round(2000 * np.exp(mass - np.logaddexp.reduce(mass))).astype(np.int64))
        logs.append(np.logaddexp.reduce(sampler.masses()[0]))
    assert np.std(logs) < 0.15


@pytest.mark.slow
@pytest.mark.parametrize("scene", [8, 9])
def test_the_status_near_a_prior_does_not_depend_on_the_seed(scene):
    """Two ways to assign six touches are two poses: maxima at the pass between them are no way across."""
    part, rng = tanteo.read_part(EXAMPLES / "block.step"), np.random.default_rng(scene)
    spread = np.diag(np.r_[np.full(3, 5e-3), np.full(3, np.radians(5))] ** 2)
    T = SE3.exp(np.sqrt(np.diag(spread)) * rng.normal(size=6))
    points = SE3.apply(T, surface_points(prepare(part), 6, rng)[0]) + 3e-4 * rng.normal(size=(6, 3))
    readings, priors = (
        tanteo.Readings.from_columns(points, sds=np.full(6, 3e-4)),
        Priors(pose=PosePrior(np.eye(4), spread)),
    )
    answers = [tanteo.locate(readings, part, priors=priors, seed=seed) for seed in range(3)]
    assert {answer.status for answer in answers} == {"ambiguous"}
    assert np.ptp([answer.hypotheses[0].probability for answer in answers]) < 0.1
