"""What met edges say: information, evidence and posterior, against the same by hand, and a prior's pull."""

from __future__ import annotations

from dataclasses import fields, replace
from types import SimpleNamespace

import numpy as np
import pytest

from core.image_oracle import normal_equations
from tanteo.lie import SE3
from tanteo.vision import Narrowed, project
from tanteo.vision.answers import hypothesis
from tanteo.vision.candidates import PoseCandidates
from tanteo.vision.edges import CORRELATION
from tanteo.vision.evidence import (
    CREASE_SEEN,
    REACH,
    RIM_SEEN,
    SHARES,
    SPREADS,
    STRETCH,
    WHOLE,
    Evidence,
    Weights,
    foremost,
    of_edges,
    weigh,
)
from tanteo.vision.fit import BIAS, EdgeMatches, meet, refine
from tanteo.vision.posterior import MISSED, UNKNOWN, ImageMode, infer
from tanteo.vision.settle import settle
from vision_scenes import bracket, seen_alone


def met_of(**values):
    """What some samples met; what is not given is not looked at."""
    return EdgeMatches(**{field.name: values.get(field.name) for field in fields(EdgeMatches)})


def edges_of(*groups):
    """What evidence asks of a wireframe: which edge each sample belongs to."""
    return SimpleNamespace(groups=np.array(groups))


def test_evidence_is_the_log_ratio_against_chance():
    """A rim and a crease that are met, one of each that is missed, and one outside of the image."""
    rims, chance = np.array([True, False, True, False, True]), 0.1
    hits, inside = np.array([1, 1, 0, 0, 0], bool), np.array([1, 1, 1, 1, 0], bool)
    offsets, spans = np.array([0.3, -0.5, 0, 0, 0]), np.array([6.0, 12.0, 24.0, 12.0, 0.0])
    pixels, normals = 100.0 * np.arange(5)[:, None] * np.ones(2), np.tile([1.0, 0.0], (5, 1))
    met = met_of(
        seen=SimpleNamespace(rims=rims),
        inside=inside,
        spans=spans,
        hits=hits,
        offsets=offsets,
        pixels=pixels,
        normals=normals,
    )

    def own(d):
        return sum(
            w * np.exp(-0.5 * (d / s) ** 2) / np.sqrt(2 * np.pi) / s for w, s in zip(SHARES, SPREADS, strict=True)
        )

    anywhere = chance / (2 * REACH)
    ratios = [np.log((p * own(d) + (1 - p) * anywhere) / anywhere) for p, d in ((RIM_SEEN, 0.3), (CREASE_SEEN, -0.5))]
    missed = np.log([1 - RIM_SEEN, 1 - CREASE_SEEN])
    apart, one = weigh(edges_of(0, 1, 2, 3, 4), met, chance), weigh(edges_of(0, 0, 0, 0, 0), met, chance)
    count = spans / (1 + spans / WHOLE) / STRETCH
    assert apart.hits == pytest.approx(count[:2] @ ratios)
    assert apart.misses == pytest.approx(count[2:4] @ missed)
    # as one edge they tell less, what is met and what is missed each by its own length
    assert one.hits == pytest.approx(spans[:2] @ ratios / STRETCH / (1 + 18 / WHOLE))
    assert one.misses == pytest.approx(spans[2:4] @ missed / STRETCH / (1 + 36 / WHOLE))


def test_of_a_longer_edge_less_and_less_is_told():
    long = np.full((4, 600), [[0.1], [0.2], [0.4], [1.0]])
    told = of_edges(np.zeros(600, dtype=int), long, long)
    assert told == pytest.approx([60 / 2, 120 / 3, 240 / 5, 600 / 11])
    halves = of_edges(np.arange(600) // 300, long, long)
    assert np.all(halves > told)
    assert np.all(halves <= long.sum(axis=1))


def lines(*offsets, turn=0.0):
    """Samples of lines up the image that meet its edge at 0 px from so far off, the last of them turned."""
    along, off = np.arange(0.0, 120.0, 3.0), np.repeat(offsets, 40)
    pixels = np.stack([-off, np.tile(along, len(offsets))], axis=-1)
    normals = np.tile([1.0, 0.0], (len(off), 1))
    normals[-40:] = np.cos(turn), np.sin(turn)
    return met_of(
        pixels=pixels, normals=normals, offsets=off, spans=np.full(len(off), 3.0), hits=np.ones(len(off), bool)
    )


def test_an_edge_of_the_image_is_explained_once():
    """Of two lines that meet one edge the nearer explains it; one that crosses it, or met none, takes nothing."""
    two, pair = np.repeat([0, 1], 40), lines(0.5, -1.0)
    assert foremost(two, pair).tolist() == [True] * 40 + [False] * 40
    assert foremost(two, lines(-1.0, 0.5)).tolist() == [False] * 40 + [True] * 40
    assert foremost(np.zeros(80, dtype=int), pair).all()
    assert foremost(two[:40], lines(0.5)).all()
    assert foremost(two, lines(0.5, -1.0, turn=1.2))[:40].all()
    missed = replace(pair, hits=np.arange(80) >= 40)
    assert foremost(two, missed).tolist() == [False] * 40 + [True] * 40
    # each pose for itself
    fields_of = {f.name: getattr(pair, f.name) for f in fields(EdgeMatches)}
    both = met_of(**{n: None if v is None else np.stack([v, getattr(missed, n)]) for n, v in fields_of.items()})
    assert foremost(two, both).tolist() == [foremost(two, pair).tolist(), foremost(two, missed).tolist()]


@pytest.fixture(scope="module")
def model():
    return bracket()


@pytest.fixture(scope="module")
def seen(model):
    """Camera, edges of an image of the part on the table, and its pose in the camera."""
    camera, _, edges, T = seen_alone(model, 0.6)
    return camera, edges, T


def test_probabilities_are_those_of_the_weighted_evidence(model):
    weights = Weights(spilled=-0.2)
    Ts = np.stack([np.eye(4), SE3.exp(np.array([0.1, 0, 0, 0, 0, 0]))])
    area = np.array([0.0, 288.0])
    evidence = Evidence(np.array([40.0, 30.0]), np.array([-3.0, -2.0]), area)
    found = PoseCandidates(model, Ts, np.array([0, 0]), np.log([0.5, 0.25]), evidence)
    none = np.zeros(0, dtype=int)
    posterior = infer([found], 15.0, weights, [model] * 4, Narrowed(np.arange(4), none))
    # that none of the poses holds is shared by what is strange and what was missed, as often as they are beforehand
    none = posterior.unknown * (1 + (1 - UNKNOWN) * MISSED / UNKNOWN)
    assert sum(m.probability for m in posterior.modes) + none == pytest.approx(1)
    a, b = posterior.modes
    log = [weights.hits * h + weights.misses * m + more for h, m, more in ((40, -3, 0.0), (30, -2, -0.2 * 2))]
    assert a.probability / b.probability == pytest.approx(2 * np.exp(log[0] - log[1]))
    odds = UNKNOWN / ((1 - UNKNOWN) / 4 * 0.5) * np.exp(weights.base + weights.unknown * 15.0 - log[0])
    assert none / a.probability == pytest.approx(odds)


def test_edges_and_prior_balance_where_the_pose_comes_to_rest(model, seen):
    camera, edges, T = seen
    start = T @ SE3.exp(np.array([1e-3, -1e-3, 5e-4, 0.0, 0.0, 0.004]))
    reaches = (2.5,) * 12
    prior = 0.3 * settle(model, camera, edges, T).information
    end = refine(model.frame, camera, edges, start[None], prior=prior[None], reaches=reaches)[0]
    pull = normal_equations(meet(model.frame, camera, edges, end, 2.5), 2.5, BIAS, CORRELATION)[1]
    back = prior @ SE3.log(SE3.inverse(start) @ end)
    scale = np.r_[np.full(3, model.frame.diagonal), np.ones(3)]
    assert np.linalg.norm(scale * pull) > 0
    assert np.linalg.norm(scale * (pull - back)) < 0.05 * np.linalg.norm(scale * pull)


def test_the_camera_s_own_error_moves_the_part_with_it(model, seen):
    camera, edges, T = seen
    rng = np.random.default_rng(3)
    A = rng.normal(size=(6, 6)) * np.r_[np.full(3, 1e-3), np.full(3, 5e-3)][:, None]
    mode = ImageMode(model, 0, T, 0.0, 0.9)
    settled = settle(model, camera, edges, T)
    plain, moved = (
        hypothesis(mode, camera.T_world_camera, c, settled) for c in (camera, replace(camera, covariance=A @ A.T))
    )
    # T_world_camera exp(e) T = T_world_part exp(G e)
    h = 1e-6
    G = np.stack([SE3.log(SE3.inverse(T) @ SE3.exp(h * e) @ T) / h for e in np.eye(6)], axis=1)
    np.testing.assert_allclose(moved.covariance - plain.covariance, G @ A @ A.T @ G.T, rtol=1e-4, atol=1e-12)


def test_the_table_counts_as_three_equations(model, seen):
    camera, edges, T = seen
    mode = ImageMode(model, 0, T, 0.0, 0.9)
    settled = settle(model, camera, edges, T)
    alone, lying = (hypothesis(mode, camera.T_world_camera, camera, settled, lying=lies) for lies in (False, True))
    assert lying.dof == alone.dof + 3
    # at the part's distance, some tenths of a pixel
    middle = SE3.apply(T, model.part.centroid)
    pixels = project(camera, middle + np.array([alone.rms, 0.0, 0.0])) - project(camera, middle)
    off = settled.met.offsets[settled.met.hits]
    assert np.linalg.norm(pixels) == pytest.approx(np.sqrt(np.mean(off**2)), rel=0.02)


@pytest.mark.parametrize("share", [0.4, 3.0])
def test_the_cov_is_widened_by_what_not_fit_and_never_narrowed(model, seen, share):
    camera, edges, T = seen
    settled = settle(model, camera, edges, T)
    chi2 = share * (round(settled.equations) - 6)
    h = hypothesis(ImageMode(model, 0, T, 0.0, 0.9), camera.T_world_camera, camera, replace(settled, chi2=chi2))
    assert h.chi2 == pytest.approx(chi2)
    assert h.dof == round(settled.equations) - 6
    scale = np.r_[np.full(3, model.frame.diagonal), np.ones(3)]
    expected = np.linalg.inv(settled.information) * max(1.0, share)
    np.testing.assert_allclose(h.covariance / np.outer(scale, scale), expected / np.outer(scale, scale), rtol=1e-6)
