"""Every example runs without a warning and prints its expected output; the readings are those of the script."""

from __future__ import annotations

import ast
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

import tanteo
from tanteo.geometry import SE3, SO3
from tanteo.io import read_rig

pytest.importorskip("OCP", reason="the extra tanteo[step] is not installed")

ROOT = Path(__file__).parents[1]
EXAMPLES = ROOT / "examples"
NUMBERED = sorted(EXAMPLES.glob("[0-9]*.py"))
LONG = ("08_bare_touches", "09_from_an_image", "12_a_session")
"""Their commands run in other tests as well."""

PRINTS = {
    "01_which_part": ["step_not_felt: ambiguous", "unknown_part: unknown", "too_few: insufficient", "sliding along"],
    "02_where_is_it": ["T_world_part", "ROS pose", "GTSAM sd", "excluded readings: 20"],
    "03_two_features": ["plane_angle", "upright 12 mm thick", "possible", "rejected"],
    "04_shared_errors": [
        "2 mm (1 sd) is assumed, because the readings contradict 0.3 mm",
        "Its estimate in the hand is",
        "0.3 mm: recognized",
    ],
    "05_uncertain_frames": ["a to b, from the base", "chi2"],
    "06_as_published": ["bracket_right, corrected: recognized. bracket_right"],
    "07_from_ranges": ["bias of laser", "recognized: wedge"],
    "09_from_an_image": ["three_parts: 3 object(s)", "recognized: bracket_left", "clamp at", "sense from above"],
    "08_bare_touches": ["12 touches with directions: recognized. bracket_left"],
    "10_calibrate_a_sensor": ["calibrated: Calibrated eye.", "saturated places: 6", "calibrated: table at"],
    "11_sense_without_contact": ["acquired", "edge face: plane", "to the last bit: True"],
    "13_simulate_zones": ["ranges: recognized: bracket_left", "mm from the truth"],
    "12_a_session": ["recognized: bracket_right", "a1 hit face", "most uncertain: ", "the same posterior: True"],
}


@pytest.fixture
def run(capsys, monkeypatch):
    """Run a script as the main module of this process; a warning is an error, as in all tests."""

    def call(script, *arguments):
        capsys.readouterr()
        monkeypatch.setattr(sys, "argv", [str(script), *map(str, arguments)])
        monkeypatch.syspath_prepend(str(Path(script).parent))
        runpy.run_path(str(script), run_name="__main__")
        return capsys.readouterr()

    return call


@pytest.mark.parametrize(
    "script",
    [pytest.param(s, id=s.stem, marks=[pytest.mark.slow] if s.stem in LONG else []) for s in NUMBERED],
)
def test_an_example_runs_and_is_a_page(run, script):
    text = script.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 60
    page = ast.get_docstring(ast.parse(text))
    assert page is not None
    assert f"python examples/{script.name}" in page
    done = run(script)
    assert not done.err
    for words in PRINTS[script.stem]:
        assert words in done.out


def test_every_example_has_an_expected_output():
    assert sorted(PRINTS) == [script.stem for script in NUMBERED]


def test_the_readings_are_those_of_the_script(run, tmp_path):
    run(EXAMPLES / "make_readings.py", tmp_path)
    made = {file.name: file.read_text(encoding="utf-8") for file in tmp_path.iterdir()}
    kept = {file.name: file.read_text(encoding="utf-8") for file in (EXAMPLES / "readings").glob("*.csv")}
    assert made == kept


def test_the_images_are_those_of_the_script(run, tmp_path):
    from tanteo.io import read_image

    run(EXAMPLES / "make_images.py", tmp_path)
    for kept in (EXAMPLES / "images").iterdir():
        if kept.suffix == ".png":
            # rays in single precision and OpenCV's filters may differ by a level here and there
            assert np.abs(read_image(tmp_path / kept.name) - read_image(kept)).mean() < 0.05
        else:
            assert (tmp_path / kept.name).read_text(encoding="utf-8") == kept.read_text(encoding="utf-8")


def test_the_picture_can_be_drawn(run, tmp_path):
    run(ROOT / "docs" / "pictures" / "make_pictures.py", tmp_path)
    assert (tmp_path / "from_readings_to_answer.svg").stat().st_size > 10_000


TRUTH = {  # part, position [mm] and turn about the vertical [deg], as the comments in the files have it
    "bracket_left": ("bracket_left", (420, -130, 35), 33, {}),
    "bracket_right": ("bracket_right", (455, 60, 35), -118, {}),
    "step_15mm": ("step_15mm", (380, 140, 20), -28, {}),
    "bracket_bare": ("bracket_left", (420, -130, 35), 33, {}),
    "square_post": ("square_post", (300, -60, 20), 71, {}),
    "clamp_ball_tip": ("clamp", (520, -40, 15), 140, {"tip_sd": [1.5e-3, 1.5e-3, 3e-4]}),
    "wedge_ranges": ("wedge", (410, -90, 0), 57, {"rig": read_rig(EXAMPLES / "readings" / "laser_rig.toml")}),
}


@pytest.fixture(scope="module")
def parts():
    return [tanteo.read_part(file) for file in sorted((EXAMPLES / "parts").glob("*.step"))]


@pytest.mark.parametrize("name", TRUTH)
def test_answers_are_true_within_their_covariance(name, parts):
    part, position, turn, options = TRUTH[name]
    answer = tanteo.identify(tanteo.read_readings(EXAMPLES / "readings" / f"{name}.csv"), parts, **options)
    assert answer.status == "recognized"
    best = answer.hypotheses[0]
    assert best.part == part
    truth = SE3.from_parts(SO3.exp(np.radians([0.0, 0.0, turn])), np.array(position) * 1e-3)
    poses = np.concatenate([best.T_world_part[None], best.symmetry_poses])
    xi = SE3.log(SE3.inverse(poses) @ truth)
    d2 = np.einsum("ki,ij,kj->k", xi, np.linalg.inv(best.covariance), xi)
    assert d2.min() < chi2.isf(1e-3, 6)


@pytest.mark.slow
def test_the_other_answers_are_the_right_ones(parts):
    statuses = {"step_not_felt": "ambiguous", "unknown_part": "unknown", "too_few": "insufficient"}
    for name, status in statuses.items():
        answer = tanteo.identify(tanteo.read_readings(EXAMPLES / "readings" / f"{name}.csv"), parts)
        assert answer.status == status, name
        total = answer.unknown_probability + sum(h.probability for h in answer.hypotheses)
        assert total == pytest.approx(1, abs=0.02)
