"""``tanteo calibrate hand-eye``: tables, files of other programs, the written result, refusals."""

from __future__ import annotations

import json

import numpy as np
import pytest

from tanteo.geometry import SE3, SO3


@pytest.fixture
def rng():
    return np.random.default_rng(57)


@pytest.fixture
def samples(rng):
    """Poses of hand and target, and the pose of the camera in the hand."""
    X = SE3.exp(np.array([0.05, -0.02, 0.1, 0.1, 0.2, 0.3]))
    Y = SE3.exp(np.array([0.5, 0.1, 0.0, 0.0, 0.0, 1.0]))
    A = SE3.exp(rng.normal(size=(10, 6)) * [0.1, 0.1, 0.1, 0.4, 0.4, 0.4])
    B = SE3.inverse(A @ X) @ Y @ SE3.exp(rng.normal(size=(10, 6)) * 2e-4)
    return A, B, X


def table(A, B):
    columns = ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")
    names = [f"{which}_{name}" for which in ("hand", "target") for name in columns]
    rows = []
    for hand, target in zip(A, B, strict=True):
        cells = [[*(1e3 * T[:3, 3]), *SO3.as_quaternion(T[:3, :3])] for T in (hand, target)]
        rows.append(",".join(f"{value:.9f}" for row in cells for value in row))
    return "\n".join([",".join(names), *rows]) + "\n"


def ros(T):
    w, x, y, z = SO3.as_quaternion(T[:3, :3]).tolist()
    p = T[:3, 3].tolist()
    return {"translation": dict(zip("xyz", p, strict=True)), "rotation": {"x": x, "y": y, "z": z, "w": w}}


def forms(A, B):
    pairs = list(zip(A, B, strict=True))
    return {
        "table.csv": table(A, B),
        "easy_handeye2.yaml": json.dumps({"samples": [{"robot": ros(a), "tracking": ros(b)} for a, b in pairs]}),
        "easy_handeye.yaml": json.dumps(
            [{"robot": {"transform": ros(a)}, "optical": {"transform": ros(b)}} for a, b in pairs]
        ),
        "moveit.yaml": json.dumps(
            [{"effector_wrt_world": a.ravel().tolist(), "object_wrt_sensor": b.ravel().tolist()} for a, b in pairs]
        ),
        "opencv.json": json.dumps({"gripper2base": A.tolist(), "target2cam": B.tolist()}),
    }


@pytest.mark.parametrize("name", ["table.csv", "easy_handeye2.yaml", "easy_handeye.yaml", "moveit.yaml", "opencv.json"])
def test_samples_of_programs_are_read(run, tmp_path, samples, name):
    A, B, X = samples
    (tmp_path / name).write_text(forms(A, B)[name])
    done = run("calibrate", "hand-eye", tmp_path / name, "--json")
    assert done.code == 0, done.err
    document = json.loads(done.out)
    assert document["schema"] == "tanteo.hand_eye/1"
    np.testing.assert_allclose(document["camera"]["pose"]["matrix"], X, atol=2e-3)


def test_the_written_result_is_a_rig(run, tmp_path, samples):
    A, B, _ = samples
    (tmp_path / "s.csv").write_text(table(A, B))
    done = run("calibrate", "hand-eye", tmp_path / "s.csv", "--write", tmp_path / "eye.yaml")
    assert done.code == 0, done.err
    assert "calibrated: camera in the hand" in done.out
    shown = run("sensor", "rig", f"{tmp_path / 'eye.yaml'}#tool0/camera:z", "--sensor", "vl53l4cd")
    assert shown.code == 0, shown.err


def test_motions_about_one_axis_are_refused_in_words(run, tmp_path, samples, rng):
    _, _, X = samples
    Y = SE3.exp(np.array([0.5, 0.1, 0.0, 0.0, 0.0, 1.0]))
    A = SE3.from_parts(SO3.axis_rotation(2, np.linspace(-1, 1, 8)), rng.normal(size=(8, 3)) * 0.1)
    (tmp_path / "s.csv").write_text(table(A, SE3.inverse(A @ X) @ Y))
    done = run("calibrate", "hand-eye", tmp_path / "s.csv", "--write", tmp_path / "eye.yaml")
    assert done.code == 3
    assert "position along" in done.out
    assert not (tmp_path / "eye.yaml").exists()


@pytest.mark.parametrize(
    ("name", "text", "word"),
    [
        ("s.csv", "", "header line"),
        ("s.csv", "a,b\n1,2\n", "hand_x_mm"),
        ("s.csv", "hand_x_mm,hand_y_mm\n1,2\n", "hand_z_mm"),
        ("s.yaml", "a: 1\n", "list of samples"),
        ("s.yaml", "- {hand: [1, 2], target: [3]}\n", "16 finite numbers"),
        ("s.json", '[{"hand": 1}]', "16 finite numbers"),
        ("none.csv", None, "No such file"),
    ],
)
def test_other_files_are_refused_with_what_to_do(run, tmp_path, name, text, word):
    if text is not None:
        (tmp_path / name).write_text(text)
    done = run("calibrate", "hand-eye", tmp_path / name)
    assert done.code == 1
    assert word in done.err
    assert "Traceback" not in done.err
