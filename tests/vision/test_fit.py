"""What met edges say: information, evidence and posterior, against the same by hand, and a prior's pull."""

from __future__ import annotations

from dataclasses import fields, replace
from types import SimpleNamespace

import numpy as np
import pytest

from tanteo.lie import SE3
from tanteo.vision.belief import UNKNOWN, Candidates, Mode, Weights, believe
from tanteo.vision.camera import project
from tanteo.vision.evidence import CREASE_SEEN, REACH, RIM_SEEN, SHARES, SPREADS, STRETCH, Evidence, weigh
from tanteo.vision.fit import Met, _normal_equations, meet, refine
from tanteo.vision.settle import settle
from tanteo.vision.sight import hypothesis
from vision_scenes import bracket, seen_alone


def met_of(**values):
    """What some samples met; what is not given is not looked at."""
    return Met(**{field.name: values.get(field.name) for field in fields(Met)})


def test_evidence_is_the_log_ratio_against_chance():
    """A rim and a crease that are met, one of each that is missed, and one outside of the image."""
    rims, chance = np.array([True, False, True, False, True]), 0.1
    hits, inside = np.array([1, 1, 0, 0, 0], bool), np.array([1, 1, 1, 1, 0], bool)
    offsets, spans = np.array([0.3, -0.5, 0, 0, 0]), np.array([6.0, 12.0, 24.0, 12.0, 0.0])
    met = met_of(seen=SimpleNamespace(rims=rims), inside=inside, spans=spans, hits=hits, offsets=offsets)
    got = weigh(None, met, chance, np.ones(1000, bool))

    def own(d):
        return sum(
            w * np.exp(-0.5 * (d / s) ** 2) / np.sqrt(2 * np.pi) / s for w, s in zip(SHARES, SPREADS, strict=True)
        )

    anywhere = chance / (2 * REACH)
    ratios = [np.log((p * own(d) + (1 - p) * anywhere) / anywhere) for p, d in ((RIM_SEEN, 0.3), (CREASE_SEEN, -0.5))]
    assert got.hits == pytest.approx(spans[:2] @ ratios / STRETCH)
    assert got.misses == pytest.approx((24 * np.log(1 - RIM_SEEN) + 12 * np.log(1 - CREASE_SEEN)) / STRETCH)
    assert (got.explained, got.met, got.shown) == pytest.approx((18, 18, 54))


@pytest.fixture(scope="module")
def model():
    return bracket()


@pytest.fixture(scope="module")
def seen(model):
    """Camera, edges of an image of the part on the table, and its pose in the camera."""
    camera, _, edges, T = seen_alone(model, 0.6)
    return camera, edges, T


def test_probabilities_are_those_of_the_weighted_evidence(model):
    weights, zero = Weights(spilled=-0.2), np.zeros(2)
    Ts = np.stack([np.eye(4), SE3.exp(np.array([0.1, 0, 0, 0, 0, 0]))])
    area = np.array([0.0, 288.0])
    evidence = Evidence(np.array([40.0, 30.0]), np.array([-3.0, -2.0]), np.array([120.0, 60.0]), zero, zero, area)
    found = Candidates(model, Ts, np.array([0, 0]), np.log([0.5, 0.25]), evidence)
    belief = believe([found], 15.0, weights, 4)
    assert sum(m.probability for m in belief.modes) + belief.unknown == pytest.approx(1)
    a, b = belief.modes
    log = [weights.hits * h + weights.misses * m + weights.explained * e / STRETCH + more
           for h, m, e, more in ((40, -3, 120, 0.0), (30, -2, 60, -0.2 * 2))]  # fmt: skip
    assert a.probability / b.probability == pytest.approx(2 * np.exp(log[0] - log[1]))
    odds = UNKNOWN / ((1 - UNKNOWN) / 4 * 0.5) * np.exp(weights.base + weights.unknown * 15.0 - log[0])
    assert belief.unknown / a.probability == pytest.approx(odds)


def test_edges_and_prior_balance_where_the_pose_comes_to_rest(model, seen):
    camera, edges, T = seen
    start = T @ SE3.exp(np.array([1e-3, -1e-3, 5e-4, 0.0, 0.0, 0.004]))
    reaches = (2.5,) * 12
    prior = 0.3 * settle(model, camera, edges, T).information
    end = refine(model.frame, camera, edges, start[None], prior=prior[None], reaches=reaches)[0]
    pull = _normal_equations(meet(model.frame, camera, edges, end, 2.5), 2.5)[1]
    back = prior @ SE3.log(SE3.inverse(start) @ end)
    scale = np.r_[np.full(3, model.frame.diagonal), np.ones(3)]
    assert np.linalg.norm(scale * pull) > 0
    assert np.linalg.norm(scale * (pull - back)) < 0.05 * np.linalg.norm(scale * pull)


def test_the_camera_s_own_error_moves_the_part_with_it(model, seen):
    camera, edges, T = seen
    rng = np.random.default_rng(3)
    A = rng.normal(size=(6, 6)) * np.r_[np.full(3, 1e-3), np.full(3, 5e-3)][:, None]
    mode = Mode(model, 0, T, 0.0, 0.9)
    settled = settle(model, camera, edges, T)
    plain, moved = (
        hypothesis(mode, camera.T_world_camera, c, settled) for c in (camera, replace(camera, covariance=A @ A.T))
    )
    # T_world_camera exp(e) T = T_world_part exp(G e)
    h = 1e-6
    G = np.stack([SE3.log(SE3.inverse(T) @ SE3.exp(h * e) @ T) / h for e in np.eye(6)], axis=1)
    np.testing.assert_allclose(moved.covariance - plain.covariance, G @ A @ A.T @ G.T, rtol=1e-4, atol=1e-12)


def test_the_table_counts_as_three_equations_and_the_fit_is_told_in_metres(model, seen):
    camera, edges, T = seen
    mode = Mode(model, 0, T, 0.0, 0.9)
    settled = settle(model, camera, edges, T)
    alone, lying = (hypothesis(mode, camera.T_world_camera, camera, settled, lying=lies) for lies in (False, True))
    assert lying.dof == alone.dof + 3
    # at the part's distance, some tenths of a pixel
    middle = SE3.apply(T, model.part.centroid)
    pixels = project(camera, middle + np.array([alone.rms, 0.0, 0.0])) - project(camera, middle)
    off = settled.met.offsets[settled.met.hits]
    assert np.linalg.norm(pixels) == pytest.approx(np.sqrt(np.mean(off**2)), rel=0.02)


@pytest.mark.parametrize("share", [0.4, 3.0])
def test_the_covariance_is_widened_by_what_does_not_fit_and_never_narrowed(model, seen, share):
    camera, edges, T = seen
    settled = settle(model, camera, edges, T)
    chi2 = share * (round(settled.equations) - 6)
    h = hypothesis(Mode(model, 0, T, 0.0, 0.9), camera.T_world_camera, camera, replace(settled, chi2=chi2))
    assert h.chi2 == pytest.approx(chi2)
    assert h.dof == round(settled.equations) - 6
    scale = np.r_[np.full(3, model.frame.diagonal), np.ones(3)]
    expected = np.linalg.inv(settled.information) * max(1.0, share)
    np.testing.assert_allclose(h.covariance / np.outer(scale, scale), expected / np.outer(scale, scale), rtol=1e-6)
