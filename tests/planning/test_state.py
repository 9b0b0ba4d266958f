"""The posterior while sensing: the result of Bayes' rule, where it can be computed independently."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import betabinom, binom, multivariate_normal, multivariate_t

from altered import altered
from bare_scenes import SENSORS, no_paths, scene
from sensing_scenes import drawn_truth, log_densities, log_variants, rough
from tanteo.errors import InputError
from tanteo.factors import FreeRays
from tanteo.geometry import SE3
from tanteo.parts import read_part
from tanteo.planning import at_place, begin, update
from tanteo.planning.start import Start, at_pose, from_hypotheses
from tanteo.planning.stopping import chance_within, corner_distances
from tanteo.posterior import Priors, identify_points, prepare
from tanteo.posterior.furniture_points import outlier_log_density

PARTS = Path(__file__).parents[2] / "examples" / "parts"
LASER = SENSORS[1]


@pytest.fixture(scope="module")
def targets():
    return [prepare(read_part(PARTS / f"{name}.step")) for name in ("bracket_left", "bracket_right", "wedge")]


def readings(target, T, n, rng, sensing=LASER):
    return scene(target, T, sensing, n, rng)[0]


def test_before_the_first_reading_it_is_the_start(targets):
    start = rough(targets, priors=Priors(noise_factor=1.0, unknown=0.1))
    state = begin(start)
    np.testing.assert_allclose(state.of_parts(), 0.3)
    assert state.unknown == pytest.approx(0.1)
    np.testing.assert_array_equal(state.poses, start.Ts)


def test_a_place_puts_the_centroid_of_every_part_there(targets):
    T = SE3.exp(np.array([0.3, -0.2, 0.1, 0.2, 0.4, -0.3]))
    start = at_place(targets, T, np.diag(np.repeat([0.01, 0.1], 3) ** 2))
    for k, target in enumerate(targets):
        np.testing.assert_allclose(SE3.apply(start.Ts[k], target.part.centroid), T[:3, 3], atol=1e-12)
        J = np.hstack([np.eye(3), -_hat(target.part.centroid)])
        np.testing.assert_allclose(J @ start.covariances[k] @ J.T, 1e-4 * np.eye(3), atol=1e-12)


def _hat(v):
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


@pytest.mark.slow
@pytest.mark.parametrize(("n", "unknown"), [(2, 0.5), (2, 0.9), (5, 0.01)])
def test_masses_are_those_of_plain_importance_sampling(targets, n, unknown):
    """Probability of each part against the likelihood averaged over many samples of the prior; a coarse sensor."""
    coarse = replace(LASER, sd=5.8e-3)  # not 6: of a face just two sd wide the likelihood itself takes a step
    start = rough(targets, (0.008, 0.06), Priors(noise_factor=1.0, unknown=unknown))
    rng = np.random.default_rng(3)
    touches = readings(targets[2], start.Ts[2] @ SE3.exp(0.5 * np.repeat([0.008, 0.06], 3)), n, rng, coarse)
    state = update(begin(start), touches, no_paths())
    log, near_variant = [], []
    for k, target in enumerate(targets):
        xi = np.linalg.cholesky(start.covariances[k]) @ rng.normal(size=(20000, 6, 1))
        Ts = start.Ts[k] @ SE3.exp(xi[..., 0])
        each = log_densities(touches, target, start.priors, Ts)
        log.append(logsumexp(each) - np.log(len(Ts)) + np.log((1 - start.priors.unknown) / 3))
        like = log_variants(touches, target, start.priors, Ts)
        near_variant.append(logsumexp(like) - np.log(len(Ts)) - np.log(3))
    anywhere = outlier_log_density(touches, start.priors).sum()
    log.append(np.log(start.priors.unknown) + np.logaddexp(logsumexp(near_variant), anywhere) - np.log(2))
    expected = np.exp(log - logsumexp(log))
    np.testing.assert_allclose([*state.of_parts(), state.unknown], expected, atol=0.04)


@pytest.mark.slow
@pytest.mark.parametrize("seeds", [1, 3])
def test_precise_readings_of_prior_not_rule_out_what_they_are_of(targets, seeds):
    """A sheet 8 um thin in a place of 15 mm: samples off it had no information, and the unknown object got it all."""
    start, log, unknown = rough(targets, (0.015, 0.15)), [], []
    for seed in range(seeds):
        rng = np.random.default_rng((7, seed))
        k, T = drawn_truth(start, rng, seed % 3)
        touches, state = readings(targets[k], T, 4, rng, replace(LASER, sd=8e-6)), begin(start)
        for n in range(1, 5):
            state = update(state, touches.take(np.arange(n)), no_paths())
        log.append(np.log(state.of_parts()[k]))
        unknown.append(state.unknown)
    assert np.mean(log) > -0.7
    assert np.mean(unknown) < 0.1


def test_many_readings_give_what_identify_gives(targets):
    start, rng = rough(targets), np.random.default_rng(1)
    T = start.Ts[0] @ SE3.exp(0.5 * np.repeat([0.015, 0.15], 3))
    touches = readings(targets[0], T, 25, rng)
    state = update(begin(start), touches, no_paths())
    answer = identify_points(touches, no_paths(), targets).hypotheses[0]
    xi = SE3.log(SE3.inverse(answer.T_world_part) @ state.poses[0])
    assert xi @ np.linalg.solve(answer.covariance, xi) < 0.3  # means of 150 effective samples each: 0.08 by chance
    ratio = np.linalg.eigvals(np.linalg.solve(answer.covariance, state.covariances[0])).real
    assert 0.5 < ratio.min() <= ratio.max() < 2.0  # both by samples, of which 150 count
    near_variant = (
        0.05 / 2 / 0.95 / 26 / betabinom(25, 0.5, 24.5).pmf(0)
    )  # a similar part without a reading on its other face
    assert state.weights[0] == pytest.approx(1 - near_variant, abs=2e-4)


@pytest.mark.slow
def test_the_region_holds_the_truth(targets):
    """NEES over scenes drawn from the start, five readings: few enough that the posterior is often bent."""
    start, inside, total = rough(targets[2:]), 0, 30
    for seed in range(total):
        rng = np.random.default_rng((4, seed))
        T = start.Ts[0] @ SE3.exp(np.linalg.cholesky(start.covariances[0]) @ rng.normal(size=6))
        state = update(begin(start), readings(targets[2], T, 8, rng), no_paths())
        off = corner_distances(state, 0, T[None])[0]
        inside += chance_within(state, off) < 0.9  # the corners' true error is within the 90 % ball
    assert inside >= binom.ppf(0.001, total, 0.9)


def test_free_paths_speak_against_what_blocks_them(targets):
    start = rough(targets[2:], (0.02, 0.1))
    T = start.Ts[0]
    along = np.array([[0.0, 0.0, -1.0]])
    over = SE3.apply(T, targets[2].part.centroid) + np.array([[0.0, 0.0, 0.2]])
    touches = readings(targets[2], T, 3, np.random.default_rng(2))
    free = FreeRays(over, along, np.array([0.4]), np.zeros(1))
    beside = FreeRays(over + 1.0, along, np.array([0.4]), np.zeros(1))
    through = update(begin(start), touches, free)
    assert through.unknown > 3 * update(begin(start), touches, beside).unknown


def test_a_symmetric_part_is_one_answer_and_no_more_probable():
    """A block fits its own place in several ways; a prior pose selects one."""
    pair = [prepare(read_part(PARTS / f"{name}.step")) for name in ("square_post", "wedge")]
    assert pair[0].part.symmetry.order > 1
    start = rough(pair, (0.005, 0.05))
    far = readings(pair[0], SE3.exp(np.array([3.0, 0, 0, 0, 0, 0])), 3, np.random.default_rng(0))
    blank = altered(far, covs=np.tile(1e4 * np.eye(3), (3, 1, 1)), sd=np.full(3, 1e2), reach=np.zeros(3))
    state = update(begin(start), blank, no_paths())  # uninformative readings leave the start unchanged
    P = state.of_parts() / state.of_parts().sum()
    areas = np.array([t.part.area for t in pair])
    assert areas.all()
    np.testing.assert_allclose(P, 0.5, atol=0.1)


def two_places(target):
    """Return a part at one of two places 0.1 m apart, with unequal probabilities and covariances."""
    Ts = SE3.exp(np.array([[0, 0, 0, 0, 0, 0], [0.1, 0, 0, 0, 0, 0.3]]))
    C = np.stack([np.diag(np.repeat(sds, 3) ** 2) for sds in ((1e-3, 0.01), (2e-3, 0.02))])
    return Start((target,), np.zeros(2, dtype=np.int64), Ts, C, np.array([0.9, 0.1]), Priors(noise_factor=1.0))


def test_prior_poses_keep_their_odds_without_information(targets):
    start = two_places(targets[2])
    some = readings(targets[2], np.eye(4), 3, np.random.default_rng(0))
    blank = altered(some, covs=np.tile(1e4 * np.eye(3), (3, 1, 1)), sd=np.full(3, 1e2), reach=np.zeros(3))
    state = update(begin(start), blank, no_paths())
    near = np.linalg.norm(state.poses[:, :3, 3] - start.Ts[0, :3, 3], axis=1) < 0.05
    share = state.weights[near].sum() / state.weights.sum()
    assert share == pytest.approx(0.9, abs=0.03)


def test_two_prior_poses_at_one_place_add_their_mass(targets):
    pair = targets[0], targets[2]
    C = np.tile(np.diag(np.repeat([1e-3, 0.01], 3) ** 2), (3, 1, 1))
    start = Start(
        pair,
        np.array([0, 0, 1]),
        np.tile(np.eye(4), (3, 1, 1)),
        C,
        np.array([0.25, 0.25, 0.5]),
        Priors(noise_factor=1.0, unknown=1e-7),  # an improbable part has too few samples for a ratio
    )
    some = readings(targets[2], np.eye(4), 3, np.random.default_rng(0))
    blank = altered(some, covs=np.tile(1e4 * np.eye(3), (3, 1, 1)), sd=np.full(3, 1e2), reach=np.zeros(3))
    P = update(begin(start), blank, no_paths()).of_parts()
    assert P[0] / P[1] == pytest.approx(1.0, abs=0.01)


def test_the_density_of_the_start_is_mixture_of_its_prior_poses(targets):
    """As the likelihood has it of no reading at all."""
    start, rng = two_places(targets[2]), np.random.default_rng(1)
    Ts = start.Ts[np.arange(20) % 2] @ SE3.exp(0.01 * rng.normal(size=(20, 6)))
    expected = np.zeros(20)
    for T, C, w in zip(start.Ts, start.covariances, start.weights, strict=True):
        expected += w * multivariate_normal(np.zeros(6), C).pdf(SE3.log(SE3.inverse(T) @ Ts))
    nothing = readings(targets[2], start.Ts[0], 1, rng).take(np.zeros(0, dtype=int))
    log = log_densities(nothing, targets[2], start.priors, Ts, mixtures=start.mixtures())
    np.testing.assert_allclose(log, np.log(expected), rtol=1e-9)
    nearest = [start.likeliest(0, T) for T in start.Ts]
    assert nearest == [0, 1]


def test_an_answer_can_be_a_start(targets):
    touches = readings(targets[0], np.eye(4), 12, np.random.default_rng(6))
    answer = identify_points(touches, no_paths(), targets)
    start = from_hypotheses(answer.hypotheses, targets)
    assert start.targets[start.part[0]].part.name == answer.hypotheses[0].part
    with pytest.raises(InputError, match="parts among"):
        from_hypotheses(answer.hypotheses, targets[2:])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"weights": np.array([-1.0])}, "probabilities"),
        ({"covariances": np.zeros((1, 6, 6))}, "positive variance"),
        ({"targets": ()}, "a part"),
        ({"weights": np.ones(2)}, "as many"),
    ],
)
def test_a_start_that_makes_no_sense_is_refused(targets, change, words):
    start = at_pose(targets[0], np.eye(4), 1e-4 * np.eye(6))
    with pytest.raises(InputError, match=words):
        replace(start, **change)


def test_a_mode_without_draws_counts_by_its_covariance(targets):
    """Of a mode that hardly matters no draw may be left among those that are kept."""
    start = rough(targets)
    touches = readings(targets[0], start.Ts[0], 2, np.random.default_rng(3))
    state = update(begin(start), touches, no_paths())
    curved = [k for k, mode in enumerate(state.modes) if not mode.normal]
    assert curved
    assert state.draws is not None
    keep = ~np.isin(state.draws.mode, curved)
    bare = replace(state.draws, **{name: getattr(state.draws, name)[keep] for name in ("Ts", "mode", "weights")})
    chances = [chance_within(replace(state, draws=bare), tolerance) for tolerance in (1e-4, 0.02, 1.0)]
    assert chances == sorted(chances)
    assert chances[-1] == pytest.approx(state.of_parts()[state.part[0]])


def test_free_beams_alone_leave_start_where_they_did_not_pass(targets):
    """There is no hit and no touch to weigh, only paths; beside the part they have no information."""
    start = rough(targets, sd=(1e-3, 1e-2))
    far = FreeRays(np.array([[1.0, 0.0, 0.5]]), np.array([[0.0, 0.0, -1.0]]), np.array([0.4]), np.zeros(1))
    state = update(
        begin(start), readings(targets[0], np.eye(4), 1, np.random.default_rng(1)).take(np.zeros(0, int)), far
    )
    P = state.of_parts()
    np.testing.assert_allclose(P / P.sum(), 1 / 3, atol=0.05)
    assert state.unknown == pytest.approx(start.priors.unknown, rel=0.05)


@pytest.mark.parametrize("bias", [-1.5, 0.5, 2.0])
def test_a_shared_error_may_explain_apparent_outliers(targets, bias):
    """A place known sharply, a reading of 0.1 mm off by a bias of 3 mm sd: odds from draws of both pose and bias."""
    start, rng, n = (
        rough(targets[2:], (2e-4, 2e-3), Priors(noise_factor=1.0, unknown=0.5)),
        np.random.default_rng(6),
        40000,
    )
    touches = readings(targets[2], start.Ts[0], 2, rng, replace(LASER, sd=1e-4))
    gains = 3e-3 * touches.directions[:, :, None]
    touches = altered(touches, shared_jacobian=gains, points=touches.points + bias * gains[:, :, 0])
    state = update(begin(start), touches, no_paths())
    Ts = start.Ts[0] @ SE3.exp((np.linalg.cholesky(start.covariances[0]) @ rng.normal(size=(n, 6, 1)))[..., 0])
    z = rng.normal(size=(n, 1))
    each = log_densities(touches, targets[2], start.priors, Ts, z) + 0.5 * np.sum(z * z, axis=1)
    like = logsumexp(log_variants(touches, targets[2], start.priors, Ts, z)) - np.log(n)
    anywhere = outlier_log_density(touches, start.priors).sum()
    log = [logsumexp(each) - np.log(n), np.logaddexp(like, anywhere) - np.log(2)]
    assert state.unknown == pytest.approx(np.exp(log[1] - logsumexp(log)), rel=0.25)  # plain draws know it to 7 %


@pytest.mark.slow
def test_a_discarded_part_is_searched_again_before_certainty(targets):
    """Few coarse readings of the right bracket, which the left one explains alone: it is found again, with its odds."""
    rng, spread = np.random.default_rng(38), (0.015, 0.15)
    even = rough(targets[:2], spread, Priors(noise_factor=1.0, unknown=1e-9))
    without = replace(even, weights=np.array([1 - 1e-12, 1e-12]))
    for n in (4, 5):
        T = even.Ts[1] @ SE3.exp(np.repeat(spread, 3) * rng.normal(size=6))
        touches = readings(targets[1], T, n, rng, replace(LASER, sd=3e-3))
        blind = update(begin(without), touches, no_paths())
        assert blind.of_parts()[1] < 1e-6
        half = tuple(replace(mode, probability=0.5 * mode.probability) for mode in blind.modes)
        before = replace(blind, start=even, posterior=replace(blind.posterior, modes=half), unknown=0.5)
        odds = [
            b.of_parts()[1] for b in (update(before, touches, no_paths()), update(begin(even), touches, no_paths()))
        ]
        np.testing.assert_allclose(odds[0], odds[1], atol=0.1)  # each is known to 0.04 from the samples of two ridges
        assert odds[0] > 0.1


def test_parts_without_a_prior_pose_are_never_searched(targets):
    """An image excludes some parts: a second search of the others does not include these."""
    start = replace(rough(targets), part=np.array([2, 2, 2]))
    touches = readings(targets[2], start.Ts[2], 5, np.random.default_rng(9))
    state = update(begin(start), touches, no_paths())
    assert state.of_parts()[2] > 0.99
    np.testing.assert_array_equal(state.of_parts()[:2], 0.0)


def test_a_skipped_part_is_searched_when_no_other_fits(targets):
    """Readings of the wedge, while only the brackets were thought of; then all three are allowed again."""
    even = rough(targets, (5e-3, 0.05))
    without = replace(even, weights=np.array([0.5, 0.5, 1e-300]))
    touches = readings(targets[2], even.Ts[2], 12, np.random.default_rng(3))
    blind = update(begin(without), touches, no_paths())
    assert blind.unknown > 0.2
    again = update(replace(blind, start=even), touches, no_paths())
    assert again.of_parts()[2] > 0.99


@pytest.mark.slow
def test_what_is_left_of_rival_is_weighed_like_leading_part():
    """The t-slot's probability where the clamp leads, against samples of the prior, and others about the heavy ones."""
    parts = [prepare(read_part(PARTS / f"{name}.step")) for name in ("t_slot", "block", "clamp")]
    start, rng = rough(parts, (0.005, 0.15)), np.random.default_rng((3, 2))
    k, T = drawn_truth(start, rng)
    touches = readings(parts[k], T, int(rng.integers(6, 13)), rng, SENSORS[2])
    state = update(begin(start), touches, no_paths())
    log = [_evidence(start, part, touches, rng) for part in (0, 2)]
    found = state.of_parts()
    assert found[2] > 0.98
    assert found[0] / found[2] == pytest.approx(np.exp(log[0] - log[1]), rel=0.4)


def _evidence(start, part, touches, rng):
    """Log of the mean likelihood of one part over its prior pose: population Monte Carlo (Cappe et al. 2004)."""
    prior = multivariate_normal(np.zeros(6), start.covariances[part])

    def likelihood(xi):
        Ts = start.Ts[part] @ SE3.exp(xi)
        return log_densities(touches, start.targets[part], start.priors, Ts)

    xi, of = prior.rvs(10000, random_state=rng), None
    for _ in range(4):
        log = likelihood(xi) + prior.logpdf(xi) - (prior.logpdf(xi) if of is None else of.logpdf(xi))
        w = np.exp(log - logsumexp(log))
        centre = w @ xi
        spread = (xi - centre).T @ (w[:, None] * (xi - centre)) + 0.02 * start.covariances[part]
        of = multivariate_t(centre, spread, df=3)
        xi = of.rvs(10000, random_state=rng)
    log = likelihood(xi) + prior.logpdf(xi) - of.logpdf(xi)
    return logsumexp(log) - np.log(len(xi))
