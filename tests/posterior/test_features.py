"""What is answered: the right part, no mirrored one, ambiguity where there is some, and the unknown object."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from random_parts import write_off
from scenes import clutter_touch, random_pose, sensed_edge, sensed_planes, sensed_vertex
from tanteo.errors import InputError
from tanteo.features import Feature
from tanteo.features.kinds import HALF_EDGE, PLANE
from tanteo.geometry import SE3
from tanteo.parts import read_part
from tanteo.posterior import Priors, identify_features, prepare

SD = 1e-4
FLIP = SE3.exp(np.array([0, 0, 0, np.pi, 0, 0]))


def usable(part):
    """Planes that a probe can feel."""
    return np.flatnonzero(part.planes.gyration[:, 1] > 1e-3)


def all_planes(part, T, rng, sd=SD):
    return sensed_planes(part, T, usable(part), sd, rng)


def total(answer):
    return answer.unknown_probability + sum(h.probability for h in answer.hypotheses)


def by_part(answer):
    out = {}
    for h in answer.hypotheses:
        out[h.part] = out.get(h.part, 0.0) + h.probability
    return out


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_every_example_is_recognised_among_all(models, seed):
    for name, model in models.items():
        rng = np.random.default_rng([41, seed])
        T = random_pose(rng)
        answer = identify_features(all_planes(model.part, T, rng), list(models.values()))
        best = answer.hypotheses[0]
        assert (best.part, best.outliers) == (name, ())
        assert best.probability > 0.95
        assert answer.status in ("recognized", "insufficient")
        assert total(answer) == pytest.approx(1.0, abs=1e-3)
        if answer.status == "recognized":
            poses = np.concatenate([best.T_world_part[None], best.symmetry_poses])
            gaps = SE3.log(SE3.inverse(poses) @ T)
            assert np.linalg.norm(gaps[:, :3], axis=1).min() < 8 * best.corner_sd


def test_a_copy_under_another_name_fits_equally(models):
    part, rng = models["bracket_left"].part, np.random.default_rng(43)
    answer = identify_features(all_planes(part, random_pose(rng), rng), [part, replace(part, name="copy")])
    assert answer.status == "ambiguous"
    assert answer.message.startswith("It may be bracket_left or copy.")
    assert "bracket_left and copy have the same shape: if they are one part, remove one of them." in answer.message
    assert answer.message.endswith("Sense a face where they differ.")


def differing(part, other):
    """Planes of ``part`` that ``other`` does not have, and those that it has, in the common frame."""
    same = [
        np.any((other.planes.normals @ n > 1 - 1e-9) & (np.abs((other.planes.centroids - c) @ n) < 1e-6))
        for n, c in zip(part.planes.normals, part.planes.centroids, strict=True)
    ]
    felt = usable(part)
    return [p for p in felt if not same[p]], [p for p in felt if same[p]]


def test_the_step_alone_distinguishes_near_twins(models):
    pair = [models["step_12mm"], models["step_15mm"]]
    for name, other in (("step_12mm", "step_15mm"), ("step_15mm", "step_12mm")):
        part, rng = models[name].part, np.random.default_rng(42)
        own, common = differing(part, models[other].part)
        assert own
        T = random_pose(rng)
        answer = identify_features(sensed_planes(part, T, [*common, *own], SD, rng), pair)
        assert answer.status == "recognized"
        assert answer.hypotheses[0].part == name


def test_near_twins_are_ambiguous_without_the_step(models):
    pair = [models["step_12mm"], models["step_15mm"]]
    part, rng = models["step_12mm"].part, np.random.default_rng(43)
    _, common = differing(part, models["step_15mm"].part)
    answer = identify_features(sensed_planes(part, random_pose(rng), common, SD, rng), pair)
    shares = by_part(answer)
    assert answer.status == "ambiguous"
    assert min(shares.values()) > 0.2
    assert "step_12mm" in answer.message
    assert "step_15mm" in answer.message
    assert "alike" not in answer.message


def test_a_mirrored_part_is_refused(models):
    """Every unsigned pairwise constraint agrees; the pose that all of them need does not exist."""
    pair = [models["bracket_left"], models["bracket_right"]]
    for true, false in (("bracket_left", "bracket_right"), ("bracket_right", "bracket_left")):
        part, rng = models[true].part, np.random.default_rng(44)
        big = np.argsort(-part.planes.areas)[:9]
        features = sensed_planes(part, random_pose(rng), big, SD, rng)
        answer = identify_features(features, pair)
        assert answer.status == "recognized"
        assert answer.hypotheses[0].part == true
        assert by_part(answer).get(false, 0.0) < 1e-3
        assert identify_features(features, [models[false]]).status in ("unknown", "ambiguous")


@pytest.mark.parametrize(("name", "order"), [("square_post", 4), ("hex_spacer", 12), ("block", 4), ("t_slot", 2)])
def test_symmetry_is_reported_not_shared_out(models, name, order):
    part, rng = models[name].part, np.random.default_rng(45)
    T = random_pose(rng)
    answer = identify_features(all_planes(part, T, rng), [models[name]])
    assert len([h for h in answer.hypotheses if h.probability > 1e-3]) == 1
    best = answer.hypotheses[0]
    assert best.probability > 0.95
    assert best.symmetry_order == order
    assert best.symmetry_poses.shape == (order - 1, 4, 4)
    gaps = SE3.log(SE3.inverse(np.concatenate([best.T_world_part[None], best.symmetry_poses])) @ T)
    assert np.sum(np.linalg.norm(gaps, axis=1) < 0.02) == 1


def test_a_solid_of_revolution_may_spin(tmp_path):
    """Two faces of a disc leave two slides; the rotation about its own axis does not matter."""
    n, r, h = 64, 30.0, 12.0
    angles = 2 * np.pi * np.arange(n) / n
    ring = np.column_stack([r * np.cos(angles), r * np.sin(angles)])
    vertices = np.concatenate(
        [np.column_stack([ring, np.zeros(n)]), np.column_stack([ring, np.full(n, h)]), [[0, 0, 0], [0, 0, h]]]
    )
    k, after = np.arange(n), (np.arange(n) + 1) % n
    triangles = np.concatenate(
        [
            np.column_stack([k, after, after + n]),
            np.column_stack([k, after + n, k + n]),
            np.column_stack([np.full(n, 2 * n), after, k]),
            np.column_stack([np.full(n, 2 * n + 1), k + n, after + n]),
        ]
    )
    write_off(tmp_path / "disc.off", vertices, triangles)
    part = read_part(tmp_path / "disc.off", unit="mm")
    assert part.symmetry.continuous
    rng = np.random.default_rng(46)
    answer = identify_features(sensed_planes(part, random_pose(rng), [0, 1], SD, rng), [prepare(part)])
    best = answer.hypotheses[0]
    assert answer.status == "insufficient"
    assert len(best.unobserved) == 2
    assert all(words.startswith("sliding") for words in best.unobserved)
    assert len([h for h in answer.hypotheses if h.probability > 1e-3]) == 1


def test_clutter_is_named(models):
    for seed in range(10):
        rng = np.random.default_rng([47, seed])
        part = models["housing"].part
        features = all_planes(part, random_pose(rng, 0.02), rng)[:7]
        at = int(rng.integers(len(features) + 1))
        features.insert(at, clutter_touch(part.radius, rng, "outlier"))
        answer = identify_features(features, list(models.values()))
        assert answer.hypotheses[0].part == "housing"
        assert answer.hypotheses[0].outliers == ("outlier",)


@pytest.mark.parametrize(
    "absent", ["clamp", *(pytest.param(name, marks=pytest.mark.slow) for name in ("housing", "t_slot", "bracket_left"))]
)
def test_an_absent_part_is_unknown(models, absent):
    rng = np.random.default_rng(48)
    others = [m for n, m in models.items() if n != absent]
    answer = identify_features(all_planes(models[absent].part, random_pose(rng), rng), others)
    assert answer.status == "unknown"
    assert answer.unknown_probability > 0.95 or answer.hypotheses[0].p_value < 0.01


def test_nothing_that_fits_is_no_exception(models):
    rng = np.random.default_rng(49)
    outliers = [clutter_touch(0.5, rng, f"c{k}") for k in range(5)]
    answer = identify_features(outliers, [models["wedge"]])
    assert answer.status in ("unknown", "insufficient")  # one outlier may lie on the part, the rest be outliers
    assert answer.message


def both_sides(feature):
    A = PLANE.B @ SE3.adjoint_inverse(FLIP) @ PLANE.B.T
    return feature, replace(feature, T_world_feature=feature.T_world_feature @ FLIP, P=A @ feature.P @ A.T)


def test_planes_of_unknown_side(models):
    """A pair stands for one plane seen from either side: the true side is found, whichever comes first."""
    for name in ("clamp", "wedge", "bracket_left"):
        rng = np.random.default_rng(50)
        T = random_pose(rng)
        features = all_planes(models[name].part, T, rng)
        pairs = [both_sides(f) if k % 2 else both_sides(f)[::-1] for k, f in enumerate(features)]
        answer = identify_features(pairs, [models[name], models["block"]])
        assert answer.hypotheses[0].part == name
        sure = identify_features(features, [models[name], models["block"]])
        best = answer.hypotheses[0]
        gap = SE3.log(SE3.inverse(best.T_world_part) @ sure.hypotheses[0].T_world_part)
        assert gap @ np.linalg.solve(best.covariance, gap) < 0.1**2


def test_too_few_readings_are_insufficient_with_free_motions(models):
    part, rng = models["wedge"].part, np.random.default_rng(51)
    n = part.planes.normals
    pairs = [(i, j) for i in range(len(n)) for j in range(i) if abs(n[i] @ n[j]) < 0.01]
    i, j = max(pairs, key=lambda pair: part.planes.areas[list(pair)].min())
    answer = identify_features(sensed_planes(part, np.eye(4), [i, j], SD, rng), [models["wedge"]], top=1)
    assert answer.hypotheses[0].unobserved
    assert answer.hypotheses[0].unobserved[0].startswith("sliding along")
    assert answer.status in ("insufficient", "unknown")


@pytest.mark.parametrize("names", [("clamp",), pytest.param(("housing", "wedge"), marks=pytest.mark.slow)])
def test_edges_and_corners_with_planes(models, names):
    for name in names:
        part, rng = models[name].part, np.random.default_rng(52)
        T = random_pose(rng)
        long = np.argsort(-part.edges.lengths)[:3]
        corners = rng.choice(len(part.corners), size=3, replace=False)
        features = [
            *(sensed_edge(part, T, e, SD, rng, f"e{e}") for e in long),
            *(sensed_vertex(part, T, c, SD, rng, f"v{c}") for c in corners),
            *sensed_planes(part, T, usable(part)[:2], SD, rng),
        ]
        answer = identify_features(features, list(models.values()))
        assert answer.status == "recognized"
        best = answer.hypotheses[0]
        assert (best.part, best.outliers) == (name, ())
        assert np.linalg.norm(SE3.log(SE3.inverse(best.T_world_part) @ T)[:3]) < 8 * best.corner_sd
        assert dict(best.pairings)[f"v{corners[0]}"] == f"vertex {corners[0]}"


def test_order_does_not_matter_and_twice_is_the_same(models):
    rng = np.random.default_rng(53)
    part = models["clamp"].part
    features = [*all_planes(part, random_pose(rng), rng)[:6], clutter_touch(part.radius, rng, "c")]
    some = [models[n] for n in ("clamp", "housing", "block", "step_12mm")]
    first = identify_features(features, some)
    again = identify_features(features, some)
    shuffled = identify_features([features[i] for i in rng.permutation(7)], some[::-1])
    for a, b, tolerance in ((first, again, 0.0), (first, shuffled, 1e-6)):
        assert a.status == b.status
        assert b.unknown_probability == pytest.approx(a.unknown_probability, rel=tolerance, abs=1e-12)
        for h, g in zip(a.hypotheses, b.hypotheses, strict=True):
            assert h.part == g.part
            assert g.probability == pytest.approx(h.probability, rel=tolerance, abs=1e-12)
            gap = SE3.log(SE3.inverse(h.T_world_part) @ g.T_world_part)
            assert gap @ np.linalg.solve(h.covariance, gap) < (0.1 if tolerance else 1e-6) ** 2


def test_another_world_gives_the_same_answer_there(models):
    rng = np.random.default_rng(54)
    part, W = models["housing"].part, random_pose(rng, 2.0)
    features = all_planes(part, np.eye(4), rng)[:6]
    moved = [replace(f, T_world_feature=W @ f.T_world_feature, support=SE3.apply(W, f.support)) for f in features]
    here, there = (identify_features(f, list(models.values())) for f in (features, moved))
    assert here.status == there.status
    assert there.hypotheses[0].probability == pytest.approx(here.hypotheses[0].probability, rel=1e-6)
    assert there.hypotheses[0].chi2 == pytest.approx(here.hypotheses[0].chi2, rel=1e-5)
    np.testing.assert_allclose(there.hypotheses[0].T_world_part, W @ here.hypotheses[0].T_world_part, atol=1e-7)


def test_misuse(models):
    features = sensed_planes(models["block"].part, np.eye(4), [0, 1, 2], SD, np.random.default_rng(55))
    with pytest.raises(InputError, match="parts"):
        identify_features(features, [])
    with pytest.raises(InputError, match="significance"):
        identify_features(features, [models["block"]], significance=1.5)
    half = Feature(HALF_EDGE, np.eye(4), 1e-8 * np.eye(5), "half")
    with pytest.raises(InputError, match="half"):
        identify_features([half], [models["block"]])


def test_what_parts_are_like_is_a_share():
    assert Priors(right_angled=0.0).right_angled == 0
    for value in (1.0, -0.1, np.nan):
        with pytest.raises(InputError, match=rf"priors, right_angled: .* got {value}"):
            Priors(right_angled=value)


@pytest.mark.parametrize("name", ["unknown", "outlier_rate", "near_variant"])
def test_what_is_assumed_is_a_probability(name):
    for value in (0.0, 1.0, -0.1, np.nan):
        with pytest.raises(InputError, match=rf"priors, {name}: .* got {value}. A tiny"):
            Priors(**{name: value})


def test_a_radius_is_a_length_and_clutter_leaves_something():
    with pytest.raises(InputError, match=r"at most 0\.99, got 0\.995"):
        Priors(outlier_rate=0.995)
    for value in (-0.1, np.inf, np.nan):
        with pytest.raises(InputError, match=rf"priors, radius: .* got {value} m\."):
            Priors(radius=value)


@pytest.mark.parametrize("rare", [1e-300, 1e-9])
def test_tiny_probabilities_are_taken_as_they_are(models, rare):
    """Nothing overflows, and what is not assumed is not found."""
    part, rng = models["bracket_left"].part, np.random.default_rng(8)
    priors = Priors(unknown=rare, outlier_rate=rare, right_angled=rare, near_variant=rare)
    answer = identify_features(all_planes(part, random_pose(rng), rng), [*models.values()], priors=priors)
    assert answer.hypotheses[0].part == part.name
    assert answer.unknown_probability <= 10 * rare


def test_unknown_prior_counts(models):
    """The more probable an unknown part beforehand, the more probable afterwards."""
    part, rng = models["block"].part, np.random.default_rng(56)
    features = sensed_planes(part, random_pose(rng), [0, 1, 2, 3], 1e-3, rng)
    before = np.array([0.01, 0.1, 0.5, 0.9])
    priors = [Priors(unknown=u, radius=0.08) for u in before]
    values = np.array([identify_features(features, [models["block"]], priors=p).unknown_probability for p in priors])
    assert np.all(np.diff(values) > 0)
    odds = values / (1 - values) / (before / (1 - before))
    np.testing.assert_allclose(odds, odds[0], rtol=1e-3)


def test_excess_noise_is_reported_and_widens_covariance(parts):
    rng = np.random.default_rng(12)
    part = parts["bracket_left"]
    features = all_planes(part, random_pose(rng), rng)
    true = identify_features(features, [part]).hypotheses[0]
    bold = identify_features([replace(f, P=f.P / 1.6**2) for f in features], [part])
    assert bold.status == "recognized"
    assert "The readings scatter 1." in bold.message
    assert bold.hypotheses[0].corner_sd == pytest.approx(true.corner_sd, rel=0.3)


def test_nothing_sensed_is_not_enough(parts):
    answer = identify_features([], [parts["block"]])
    assert (answer.status, answer.hypotheses) == ("insufficient", ())
    assert "Sense three places or more" in answer.message
