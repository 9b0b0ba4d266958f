"""Expected gain of a reading, against simulation."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sensing_scenes import LASER, beam_hits, new_session, rough, sense, true_range
from tanteo.errors import InputError
from tanteo.geometry import SE3
from tanteo.hand import Workspace
from tanteo.parts import read_part
from tanteo.planning import POLICIES, Probe, Sensing, Session, Stop, begin, discriminate, probe_of
from tanteo.planning.candidates import propose
from tanteo.planning.predictions import predict
from tanteo.planning.samples import draw
from tanteo.planning.shared import SharedAhead
from tanteo.planning.start import Start, at_pose
from tanteo.planning.utility import about_mode, about_pose, expected_information
from tanteo.posterior import Priors, prepare
from tanteo.sensors.presets import NoiseLaw, robot_preset, sensor_preset

PARTS = Path(__file__).parents[2] / "examples" / "parts"


@pytest.fixture(scope="module")
def bracket():
    return prepare(read_part(PARTS / "bracket_left.step"))


def at(target, sds, T=None):
    return at_pose(target, np.eye(4) if T is None else T, np.diag(np.repeat(sds, 3) ** 2))


def test_derivatives_of_ranges_against_differences(bracket):
    start = at(bracket, (1e-3, 1e-2), SE3.exp(np.array([0.1, 0.2, 0, 0.3, 0.1, -0.2])))
    c = propose(begin(start), LASER, 60)
    samples = draw(begin(start), 1)
    p = predict(samples, c.origins, c.directions)
    moved = np.zeros((len(c), 6))
    for k, e in enumerate(1e-6 * np.eye(6)):
        ends = (replace(samples, Ts=start.Ts @ SE3.exp(s * e)) for s in (1, -1))
        plus, minus = (predict(end, c.origins, c.directions).ranges[:, 0] for end in ends)
        moved[:, k] = (plus - minus) / 2e-6
    along = predict(replace(samples, whole=np.eye(6)[None]), c.origins, c.directions).spreads[:, 0]
    np.testing.assert_allclose(along, np.sum(moved**2, axis=1), rtol=2e-4)  # of a pose unknown by as much in all
    L = np.linalg.cholesky(start.covariances[0])
    np.testing.assert_allclose(p.spreads[:, 0], np.sum((moved @ L) ** 2, axis=1), rtol=2e-4)
    assert np.isfinite(p.ranges).all()
    assert (p.faces[:, 0] == c.face).all()


def test_pose_information_is_half_a_log_ratio_of_determinants(bracket):
    """For a pose known so well that all is linear, against the determinant of the covariance after the reading."""
    start = at(bracket, (2e-5, 2e-4))
    c = propose(begin(start), LASER, 40)
    samples = draw(begin(start), 1)
    got = expected_information(samples, predict(samples, c.origins, c.directions), LASER)
    d, cosine, _, g = beam_hits(bracket, start.Ts, c.origins, c.directions)
    R, C = LASER.variance(d, cosine)[:, 0], start.covariances[0]
    for k in range(len(c)):
        after = np.linalg.inv(np.linalg.inv(C) + np.outer(g[k, 0], g[k, 0]) / R[k])
        gain = 0.5 * (np.linalg.slogdet(C)[1] - np.linalg.slogdet(after)[1])
        assert got[k] == pytest.approx(gain, rel=1e-9)


def test_samples_have_the_covariance_of_the_belief(bracket):
    """That between them and that of their own together."""
    state = begin(at(bracket, (2e-3, 2e-2)))
    samples = draw(state, 512)
    xi = SE3.log(SE3.inverse(state.poses[0]) @ samples.Ts)
    total = xi.T @ xi / len(xi) + samples.covariances.mean(axis=0)
    s = np.sqrt(np.diag(state.covariances[0]))
    np.testing.assert_allclose(total / np.outer(s, s), np.eye(6), atol=0.05)


def test_shared_errors_of_all_readings_reduce_the_gain():
    """A bias along the beam; the base's place in any direction, so more of it at a slanted surface."""
    own = Probe("laser", NoiseLaw.of(1e-4))
    off = replace(own, shared_sd=3e-4, base_sds=(1e-3, 0.0))
    d, cosine = np.array([0.1, 0.1]), np.array([1.0, 0.5])
    np.testing.assert_allclose(off.variance(d, cosine) - own.variance(d, cosine), [9e-8 + 1e-6, 9e-8 + 4e-6])


def test_errors_shared_with_earlier_readings_reduce_the_gain(bracket):
    """The reference is determinants of pose and shared errors together; the same side again informs about noise
    alone."""
    start = at(bracket, (1e-3, 1e-2))
    session = Session(start, LASER, Sensing(sd=3e-4, bias_sd=2e-3), POLICIES["information"], Stop(None, least_gain=0.0))
    for _ in range(8):
        action = session.ask()
        session.tell(action.read(true_range(bracket, np.eye(4), action)))
    state, c = session.state, propose(session.state, LASER, 40)
    assert len(state.modes) == 1
    mode = state.modes[0]
    jacobians = 2e-3 * c.directions[:, :, None]
    shared = SharedAhead.of(state, jacobians, np.zeros(1, dtype=np.int64))
    whole = np.linalg.inv(mode.information)[:7, :7]
    samples = replace(draw(state, 1), Ts=mode.T_peak[None], whole=whole[None, :6, :6], useful=whole[None, :6, :6])
    got = about_pose(samples, predict(samples, c.origins, c.directions, LASER, shared), LASER)
    d, cosine, _, g = beam_hits(bracket, mode.T_peak[None], c.origins, c.directions)
    own, h = LASER.own_variance(d, cosine)[:, 0], np.concatenate([g[:, 0], np.full((len(c), 1), -2e-3)], axis=1)
    given = np.linalg.inv(mode.information[6:, 6:])[0, 0]
    for k in range(len(c)):
        rest = 4e-6 * given + own[k]
        assert got[k] == pytest.approx(0.5 * np.log((h[k] @ whole @ h[k] + own[k]) / rest), rel=1e-6)
    o, u = (np.array([getattr(step.action, name) for step in session.steps]) for name in ("origin", "direction"))
    shared = SharedAhead.of(state, 2e-3 * u[:, :, None], np.zeros(1, dtype=np.int64))
    assert about_pose(samples, predict(samples, o, u, LASER, shared), LASER).max() <= 0.5 * np.log(2) + 1e-6


def test_the_ball_of_a_probe_stops_before_the_surface(bracket):
    start, ball = at(bracket, (2e-5, 2e-4)), replace(LASER, contact=True, radius=2e-3)
    c, samples = propose(begin(start), LASER, 40), draw(begin(start), 8)
    point, centre = (predict(samples, c.origins, c.directions, probe) for probe in (LASER, ball))
    hit = point.hit
    np.testing.assert_allclose((point.ranges - centre.ranges)[hit], (2e-3 / point.cosines)[hit], rtol=1e-9)
    assert np.isinf(centre.ranges[~hit]).all()
    for probe, words in ((replace(LASER, contact=True), "no larger than the clearance"), (LASER, "0 for a beam")):
        with pytest.raises(InputError, match=words):
            replace(probe, radius=2e-3 if probe is LASER else 2e-2)


def test_the_largest_face_is_not_sensed_for_ever(bracket):
    goal = {"probability": None, "tolerance": 1e-9, "max_measurements": 6, "least_gain": 0.0}
    session = new_session(at(bracket, (1e-3, 1e-2)), policy="largest-face", **goal)
    sense(session, bracket, np.eye(4), np.random.default_rng(0))
    faces = [step.action.face for step in session.steps]
    largest = max(bracket.part.faces, key=lambda face: face.area).name
    assert faces[0] == largest
    assert len(set(faces)) >= 3


def test_what_exceeds_no_tolerance_is_worth_nothing(bracket):
    start = at(bracket, (2e-5, 2e-4))
    c = propose(begin(start), LASER, 40)
    gains = []
    for tolerance in (None, 1e-6, 1e-2):
        samples = draw(begin(start), 1, tolerance)
        gains.append(about_pose(samples, predict(samples, c.origins, c.directions), LASER))
    np.testing.assert_allclose(gains[0], gains[1], rtol=1e-3)
    assert (gains[2] < 1e-3 * gains[0]).all()


def test_information_about_the_mode_against_simulation(bracket):
    """Two poses that are likely, ranges drawn from the belief: mutual information by the posterior's mean entropy."""
    T = np.stack([np.eye(4), SE3.exp(np.array([4e-4, 0, 3e-4, 0, 0.004, 0]))])
    C = np.tile(np.diag(np.repeat([1e-4, 1e-3], 3) ** 2), (2, 1, 1))
    start = Start((bracket,), np.zeros(2, dtype=int), T, C, np.array([0.7, 0.3]), Priors())
    c = propose(begin(start), LASER, 60)
    samples = draw(begin(start), 200)
    gain = about_mode(samples, predict(samples, c.origins, c.directions), LASER)
    d, cosine, _, g = beam_hits(bracket, T, c.origins, c.directions)
    both = np.isfinite(d).all(axis=1)
    d, cosine, g = d[both], cosine[both], g[both]
    gain, p = gain[both], predict(samples, c.origins[both], c.directions[both])
    sd = np.sqrt(np.einsum("csi,sij,csj->cs", g, C, g) + LASER.variance(d, cosine))
    rng = np.random.default_rng(0)
    flat = np.flatnonzero((p.faces == p.faces[:, :1]).all(axis=1))  # away from edges the predictions are normal
    exact = np.array([simulated_information(d[k], sd[k], np.array([0.7, 0.3]), rng) for k in flat])
    assert len(flat) > 10
    assert np.corrcoef(gain[flat], exact)[0, 1] > 0.97
    assert (gain[flat] < exact + 0.03).all()  # a bound from below, but for the samples
    assert exact[np.argmax(gain[flat])] > exact.max() - 0.05  # its choice is nearly the best


def simulated_information(means, sds, weights, rng, n=40000):
    """Mutual information of which normal density it is and a draw, by the posterior's mean entropy."""
    which = (rng.uniform(size=n) >= weights[0]).astype(int)
    y = means[which] + sds[which] * rng.normal(size=n)
    log = -0.5 * ((y[:, None] - means) / sds) ** 2 - np.log(sds) + np.log(weights)
    post = np.exp(log - np.logaddexp(*log.T)[:, None])
    entropy = -np.sum(post * np.log(np.maximum(post, 1e-300)), axis=1).mean()
    return -np.sum(weights * np.log(weights)) - entropy


def test_a_hit_or_a_miss_distinguishes_two_parts(bracket):
    """One part is there, the other is far away: a beam at the first decides everything."""
    T = np.stack([np.eye(4), SE3.exp(np.array([1.0, 0, 0, 0, 0, 0]))])
    C = np.tile(np.diag(np.repeat([1e-4, 1e-3], 3) ** 2), (2, 1, 1))
    start = Start((bracket,), np.zeros(2, dtype=int), T, C, np.ones(2), Priors())
    c = propose(begin(start), LASER, 60)
    samples = draw(begin(start), 64)
    gain = about_mode(samples, predict(samples, c.origins, c.directions), LASER)
    seen = predict(samples, c.origins, c.directions)
    hit = LASER.answers(seen.ranges, seen.cosines)
    sure = np.all(
        [hit[:, samples.mode == m].all(axis=1) | ~hit[:, samples.mode == m].any(axis=1) for m in (0, 1)], axis=0
    )
    assert sure.sum() > 40  # the others may pass an edge
    np.testing.assert_allclose(gain[sure], np.log(2), atol=1e-3)
    assert (gain < np.log(2) + 1e-3).all()


def test_candidates_can_be_made(bracket):
    """Inside the workspace, within the cone, clear of the part on the path, and with a hit on the planned face."""
    down = np.array([0.0, 0.0, -1.0])
    probe = replace(LASER, approach=down, cone=np.radians(40), workspace=Workspace.above(0.05), clearance=0.015)
    start = rough([bracket], (1e-3, 1e-2))
    c = propose(begin(start), probe, 300)
    assert len(c) > 20
    assert (c.directions @ down >= np.cos(np.radians(40)) - 1e-9).all()
    assert (c.origins[:, 2] >= 0.05 + probe.clearance - 1e-9).all()
    for back in (0.0, 0.05, 0.1):
        local = SE3.apply(SE3.inverse(start.Ts[0]), c.origins - back * c.directions)
        assert (bracket.surface.closest(local).distances >= probe.clearance - 1e-4).all()
        assert not bracket.surface.inside(local).any()
    ranges, cosines, faces, _ = beam_hits(bracket, start.Ts, c.origins, c.directions)
    np.testing.assert_allclose(ranges[:, 0], probe.standoff, rtol=1e-3)
    assert (faces[:, 0] == c.face).all()
    assert (cosines[:, 0] >= np.cos(probe.max_incidence)).all()


def test_the_variance_of_a_probe_is_that_of_the_measurement():
    """Against ``measure``: the same range, direction and preset; along the surface's normal, over the cosine."""
    from tanteo.sensors import Readings, measure

    preset, robot = sensor_preset("vl53l4cd"), robot_preset("abb_irb1600_uncalibrated")
    probe = probe_of(preset, robot)
    distance = 0.08
    readings = Readings.from_columns(
        np.array([[0.0, 0.0, -distance]]), directions=np.array([[0.0, 0.0, -1.0]]), ranges=np.array([distance])
    )
    measured = measure(readings, sensor=preset, robot=robot)
    for angle in (0.0, 0.5):
        n = np.array([np.sin(angle), 0.0, np.cos(angle)])
        along = float(n @ measured.covs[0] @ n) / np.cos(angle) ** 2
        own = float(probe.own_variance(np.array(distance), np.array(np.cos(angle))))
        assert own == pytest.approx(along, rel=0.02)


@pytest.mark.parametrize(
    "bad", [{"standoff": 0.0}, {"max_incidence": 2.0}, {"standoff": 9.0}, {"approach": np.zeros(3)}]
)
def test_a_probe_that_makes_no_sense_is_refused(bad):
    with pytest.raises(InputError, match="probe"):
        Probe("p", NoiseLaw.of(1e-4), **bad)


CONE = replace(LASER, beam_half_angle=np.radians(8), max_incidence=np.radians(75), standoff=0.08, clearance=0.005)


def random_rays(target, T, origin, direction, rng, n=3000):
    """Return which random rays, uniform in the spot of the cone, are answered, and their axial depths."""
    slope, turn = np.tan(CONE.beam_half_angle) * np.sqrt(rng.uniform(size=n)), rng.uniform(0, 2 * np.pi, n)
    u, v = np.linalg.svd(direction[None])[2][1:]
    rays = direction + slope[:, None] * (np.cos(turn)[:, None] * u + np.sin(turn)[:, None] * v)
    long = np.sqrt(1 + slope**2)
    d, cosine, _, _ = beam_hits(target, T[None], np.tile(origin, (n, 1)), rays / long[:, None])
    return CONE.answers(d[:, 0], cosine[:, 0]), d[:, 0] / long


def test_the_echo_of_a_cone_comes_from_any_of_its_rays(bracket):
    """Share, mean and variance against rays at random, also where the spot crosses an edge."""
    start, rng = at(bracket, (1e-4, 1e-3)), np.random.default_rng(8)
    c = propose(begin(start), CONE, 80)
    samples = draw(begin(start), 32)
    p = predict(samples, c.origins, c.directions, CONE)
    echo = np.where(CONE.answers(p.ranges, p.cosines), p.shares, 0.0) @ samples.weights
    drawn = [random_rays(bracket, start.Ts[0], o, d, rng) for o, d in zip(c.origins, c.directions, strict=True)]
    truth = np.array([answers.mean() for answers, _ in drawn])
    assert (truth < 0.95).sum() > 10
    assert np.abs(echo - truth).max() < 0.15
    assert np.abs(echo - truth).mean() < 0.02
    sure = truth > 0.3
    sds = np.array([depths[answers].std() if answers.any() else 0.0 for answers, depths in drawn])
    got = np.sqrt(
        (p.scatter + CONE.cone_variance(np.where(p.hit, p.ranges, 0.1), np.maximum(p.cosines, 0.1))) @ samples.weights
    )
    assert (np.abs(got - sds) < 2e-3 + 0.35 * sds)[sure].mean() > 0.95


def test_a_thin_beam_is_one_ray_and_on_a_plane_so_is_a_cone(bracket):
    start = at(bracket, (1e-4, 1e-3))
    c, samples = propose(begin(start), LASER, 60), draw(begin(start), 16)
    plain, thin, wide = (predict(samples, c.origins, c.directions, p) for p in (None, LASER, CONE))
    for name in ("ranges", "cosines", "variances", "shares", "scatter"):
        np.testing.assert_array_equal(getattr(plain, name), getattr(thin, name))
    flat = (wide.shares == 1) & (wide.scatter < 1e-10) & (plain.cosines > 0.999)
    assert flat.sum() > 50
    assert (np.abs(wide.ranges - plain.ranges)[flat] < 1e-3 * plain.ranges[flat]).mean() > 0.9  # but for low steps
    np.testing.assert_allclose(wide.variances[flat], plain.variances[flat], rtol=1e-9)


@pytest.mark.slow
def test_hit_or_miss_of_a_wide_cone_is_no_discrimination():
    """Steps 3 mm apart, past the edge: for the axis a sure hit and a sure miss, for the cone neither."""
    pair = [prepare(read_part(PARTS / f"step_{k}mm.step")) for k in (12, 15)]
    wide = probe_of(sensor_preset("vl53l0x"))
    found = discriminate(*pair, wide)
    assert found.information < 0.15
    assert "% of the time" in found.message
    assert discriminate(*pair, replace(wide, beam_half_angle=0.0)).discriminates
