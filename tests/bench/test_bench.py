"""The benchmark judges fairly: known answers get known scores; a bad method is a row, never a traceback."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from tanteo.bench import generate, read_set, write_set
from tanteo.bench.running import Outcome, at_work, run
from tanteo.bench.scoring import largest_corner_error, score, with_decisions
from tanteo.bench.sets import BenchScene, BenchSet, Placement
from tanteo.bench.tables import bench_picture, read_scores, score_table, write_scores
from tanteo.errors import InputError
from tanteo.geometry import SE3
from tanteo.parts import Surface

SD = 1e-3


@pytest.fixture(scope="module")
def scenes():
    return generate("normals", 40, seed=3)


def answered(scenes, rng, *, stated=1.0, probability=0.95):
    """Return a method that is off by a normal error of its covariance, and states that times a factor."""
    out = []
    for scene in scenes.scenes:
        xi = rng.normal(size=6) * np.r_[np.full(3, SD), np.full(3, 0.01)]
        C = np.diag(np.r_[np.full(3, SD), np.full(3, 0.01)] ** 2) * stated**2
        T = scene.T_world_part @ SE3.exp(xi)
        out.append(Outcome((Placement(scene.truth, T, C, probability),), 0.01))
    return out


def test_true_covariances_score_one_and_bold_ones_low(scenes):
    rng = np.random.default_rng(1)
    wide = replace(scenes, tolerance=1.0)
    true = score(wide, "true", answered(wide, rng))
    bold = score(wide, "bold", answered(wide, rng, stated=0.3))
    low, high = chi2.ppf([0.001, 0.999], 6 * 40) / (6 * 40)
    assert low < true.nees < high
    assert true.median_nees == pytest.approx(1, abs=0.35)
    assert true.in_region > 0.85
    assert bold.in_region < 0.3
    assert bold.nees == pytest.approx(1 / 0.09, rel=0.4)
    assert true.right == 1
    assert true.claimed == pytest.approx(0.95)


def test_sure_and_wrong_several_and_among_are_counted(scenes):
    one = replace(scenes, scenes=scenes.scenes[:4])
    T, name = [s.T_world_part for s in one.scenes], scenes.parts[0].name
    far = SE3.exp(np.array([0.1, 0, 0, 0, 0, 0]))
    outcomes = [
        Outcome((Placement(name, T[0] @ far, None, 0.97),), 0.01),
        Outcome((Placement(name, T[1] @ far, None, 0.6), Placement(name, T[1], None, 0.4)), 0.01),
        Outcome((Placement(name, T[2], None, 0.99), Placement(name, T[2] @ far, None, 0.01)), 0.01),
        Outcome((), 0.0, "did not end within 1 s"),
    ]
    got = score(one, "some", outcomes)
    assert (got.right, got.among, got.sure_and_wrong) == (0.25, 0.5, 0.25)
    assert (got.several, got.declared) == (pytest.approx(1 / 3), 1.0)
    assert (got.failures, got.why) == (1, "did not end within 1 s")
    assert got.in_region is None
    assert got.nees is None


def test_an_unknown_object_is_right_where_nothing_is_claimed(scenes):
    unknown_scene = BenchScene("x", scenes.scenes[0].points, SD)
    one = BenchSet("stranger", scenes.parts, (unknown_scene,) * 3, 3e-3)
    name = scenes.parts[0].name
    results = [
        Outcome((), 0.01),
        Outcome((Placement(name, np.eye(4), None, 0.01),), 0.01),
        Outcome((Placement(name, np.eye(4), None, 0.98),), 0.01),
    ]
    got = score(one, "some", results)
    assert got.right == pytest.approx(2 / 3)
    assert got.sure_and_wrong == pytest.approx(1 / 3)


def test_corner_errors_are_up_to_symmetry(parts):
    flange, post = parts["flange"], parts["square_post"]
    turn = post.symmetry.Ts[-1]
    assert post.symmetry.order > 1
    T = SE3.exp(np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6]))
    assert largest_corner_error(post, T @ turn, T) < 1e-9
    moved = T @ SE3.exp(np.array([0, 0, 2e-3, 0, 0, 0]))
    assert largest_corner_error(flange, moved, T) == pytest.approx(2e-3)


def test_scenes_are_the_same_for_a_seed_and_whatever_the_count():
    some, more = generate("outliers", 2, seed=5), generate("outliers", 3, seed=5)
    np.testing.assert_array_equal(some.scenes[1].points, more.scenes[1].points)
    assert not np.array_equal(some.scenes[0].points, generate("outliers", 1, seed=6).scenes[0].points)
    absent = generate("unknown", 12)
    assert {scene.truth is None for scene in absent.scenes} == {True, False}
    assert len(absent.parts) == 11


def test_a_set_is_read_as_it_was_written(tmp_path):
    made = generate("unknown", 4, seed=2)
    made = replace(made, parts=made.parts[:2], scenes=tuple(s for s in made.scenes if s.truth is None)[:1])
    normal = generate("normals", 1)
    known = replace(normal.scenes[0], name="n", truth=made.parts[1].name)
    both = BenchSet("both", made.parts, (*made.scenes, known), 2e-3, 'a "set"')
    write_set(both, tmp_path / "set")
    again = read_set(tmp_path / "set")
    assert [part.name for part in again.parts] == sorted(part.name for part in both.parts)
    assert again.tolerance == pytest.approx(2e-3)
    for old in both.scenes:
        new = next(scene for scene in again.scenes if scene.name == old.name)
        np.testing.assert_allclose(new.points, old.points, atol=1e-9)
        assert new.sd == pytest.approx(old.sd)
        assert new.truth == old.truth
        if old.T_world_part is not None:
            np.testing.assert_allclose(new.T_world_part, old.T_world_part, atol=1e-9)
        if old.normals is not None:
            np.testing.assert_allclose(new.normals, old.normals, atol=1e-6)
            assert new.normal_sd == pytest.approx(old.normal_sd)
    with pytest.raises(InputError, match="Choose another"):
        write_set(both, tmp_path / "set")


@pytest.mark.parametrize("name", ["ranges", "cones"])
def test_ranges_and_free_space_are_read_as_written(tmp_path, name):
    made = generate(name, 2, seed=4)
    write_set(made, tmp_path / "set")
    again = read_set(tmp_path / "set")
    for old, new in zip(made.scenes, again.scenes, strict=True):
        np.testing.assert_allclose(new.points, old.points, atol=1e-6)
        assert new.readings.is_free.tolist() == old.readings.is_free.tolist()
        assert new.rig.sensors[0].response == old.rig.sensors[0].response
        few = old.first(3)
        assert (~few.readings.is_free).sum() == len(few.points) == 3
        # a thin beam ends on its part, a cone at its nearest place before it
        part = made.part(old.truth)
        own = SE3.apply(SE3.inverse(old.T_world_part), old.points)
        away = Surface(part.vertices, part.triangles).closest(own).distances
        reach = 0.0 if name == "ranges" else old.readings.ranges.values * np.sin(np.radians(10))
        assert (away < 4.5 * old.sd + reach).all()


@pytest.mark.parametrize(
    ("change", "results"),
    [
        (lambda f: (f / "truth.csv").unlink(), "truth.csv"),
        (lambda f: (f / "set.toml").write_text("name = ["), "TOML"),
        (lambda f: (f / "set.toml").write_text("unit = 'mm'\ntolerance_mm = '3'"), "tolerance_mm"),
        (lambda f: (f / "truth.csv").write_text("scene,part\n0,unlisted\n"), "got 'unlisted'"),
        (lambda f: (f / "truth.csv").write_text("a,b\n1,2\n"), "columns scene, part"),
        (lambda f: (f / "truth.csv").write_text("scene,part,x_mm,y_mm,z_mm,qx,qy,qz,qw\n0,,1,2,3,0,0,0,9\n"), "line 2"),
        (lambda f: (f / "scenes" / "0.csv").write_text("x_mm,y_mm,z_mm\n1,2,3\n4,5,6\n7,8,9\n"), "standard deviation"),
    ],
)
def test_a_spoiled_set_is_refused(tmp_path, change, results):
    made = generate("few", 1)
    write_set(made, tmp_path / "set")
    change(tmp_path / "set")
    with pytest.raises(InputError, match=results):
        read_set(tmp_path / "set")


METHODS = """
import os, time
import numpy as np
from tanteo.bench.sets import Placement

def honest(candidates):
    print("many", "lines" * 999)
    def solve(scene):
        assert scene.truth is None and scene.T_world_part is None
        T = np.eye(4); T[:3, 3] = scene.points.mean(axis=0)
        return [Placement(candidates[0].name, T, np.eye(6), 0.5)]
    return solve

def raises(candidates):
    return lambda scene: 1 / 0

def ends(candidates):
    return lambda scene: os._exit(7)

def waits(candidates):
    return lambda scene: time.sleep(60)

def other(candidates):
    return lambda scene: [np.eye(4)]

def strange(candidates):
    return lambda scene: [Placement("got 'unlisted'", np.eye(4))]

def mirrored(candidates):
    return lambda scene: [Placement(candidates[0].name, np.diag([1.0, 1, -1, 1]))]

def unprepared(candidates):
    raise ImportError("no such package")
"""


@pytest.mark.parametrize(
    ("name", "results"),
    [
        ("honest", ""),
        ("raises", "ZeroDivisionError"),
        ("ends", "exit code 7"),
        ("waits", "did not end within 2 s"),
        ("other", "expected Placement"),
        ("strange", "got 'unlisted'"),
        ("mirrored", "rigid motion"),
        ("unprepared", "could not be prepared: ImportError: no such package"),
    ],
)
def test_whatever_a_method_does_is_a_row(tmp_path, scenes, name, results):
    (tmp_path / "mine.py").write_text(METHODS)
    one = replace(scenes, scenes=scenes.scenes[:2])
    outcomes = run(f"{tmp_path / 'mine.py'}:{name}", one, patience=2.0)
    assert [results in outcome.failure for outcome in outcomes] == [True, True]
    assert [bool(outcome.failure) for outcome in outcomes] == [bool(results)] * 2
    got = score(one, name, outcomes)
    assert got.failures == (2 if results else 0)
    assert got.right == 0


def test_decisions_come_with_more_readings(scenes):
    one = replace(scenes, scenes=scenes.scenes[:2])
    name = one.parts[0].name

    def answer_scene(scene):
        truth = next(s.T_world_part for s in one.scenes if s.name == scene.name)
        return Outcome((Placement(name, truth, None, 0.95 if len(scene.points) >= 8 else 0.5),), 0.01)

    got = with_decisions(
        score(one, "some", [answer_scene(s) for s in one.scenes]), one, answer_scene, lambda done, total: None
    )
    assert (got.readings, got.decided, got.decided_right) == (8, 1.0, 1.0)


def test_tanteo_itself_is_right_and_its_scores_are_kept(tmp_path, scenes):
    one = replace(scenes, scenes=scenes.scenes[:3])
    got = score(one, "tanteo", run("tanteo", one))
    assert got.right == 1
    assert got.failures == 0
    write_scores([got], tmp_path / "scores.json")
    assert read_scores(tmp_path / "scores.json") == [got]
    assert len(score_table([got])) == 2
    bench_picture([got], tmp_path / "picture.png")
    assert (tmp_path / "picture.png").stat().st_size > 5000
    (tmp_path / "scores.json").write_text(json.dumps({"kind": "other"}))
    with pytest.raises(InputError, match="scores that tanteo bench"):
        read_scores(tmp_path / "scores.json")


def test_a_worker_that_ended_is_begun_anew(tmp_path, scenes):
    (tmp_path / "mine.py").write_text(
        METHODS + "\ndef sometimes(candidates):\n"
        "    return lambda scene: os._exit(3) if scene.name == '0' else honest(candidates)(scene)\n"
    )
    with at_work(f"{tmp_path / 'mine.py'}:sometimes", scenes, 20.0) as answer_scene:
        assert "exit code 3" in answer_scene(scenes.scenes[0]).failure
        assert answer_scene(scenes.scenes[1]).failure == ""
