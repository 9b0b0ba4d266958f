"""Units that were mixed up are guessed, and only then."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tanteo
from bare_scenes import surface_points
from tanteo import Readings, locate, read_part
from tanteo.parts import Surface
from tanteo.posterior import prepare
from tanteo.posterior.findings import Scale, about_directions, about_spread, about_units

PARTS = Path(__file__).parents[2] / "examples" / "parts"
UNITS = {"mm": 1e-3, "m": 1.0, "um": 1e-6, "in": 0.0254}


@pytest.mark.parametrize("meant", UNITS)
@pytest.mark.parametrize("stated", UNITS)
@pytest.mark.parametrize("size", [0.02, 0.2, 1.0])
def test_the_right_unit_of_the_columns_is_among_the_guesses(meant, stated, size):
    """Beside a part whose file states its unit."""
    question = about_units(Scale(0.6 * size * UNITS[stated] / UNITS[meant], (size,), stated, ""))
    if meant == stated:
        assert question is None
    else:
        assert question.kind == "units"
        assert f"columns in {'inches' if meant == 'in' else meant} (x_{meant})" in question.message
        assert "--units" not in question.message


@pytest.mark.parametrize("meant", ["mm", "in"])
@pytest.mark.parametrize("stated", UNITS)
def test_the_right_unit_of_the_parts_is_among_the_guesses(meant, stated):
    """Beside readings whose columns might be wrong as well."""
    question = about_units(Scale(0.12, (0.2 * UNITS[stated] / UNITS[meant],), "mm", stated))
    words = "" if question is None else question.message
    assert (f"--units {meant}" in words) == (meant != stated)


def test_sizes_are_named():
    words = about_units(Scale(210.0, (0.2,), "m", "")).message
    assert words == "The part is 0.2 m wide and the readings span about 210 m. Did you mean columns in mm (x_mm)?"


@pytest.mark.parametrize("span", [0.0, 0.05, 0.19, 0.23])
def test_good_readings_and_none_at_all_raise_no_question(span):
    assert about_units(Scale(span, (0.2, 3.0), "mm", "mm")) is None


def test_a_difference_that_no_unit_explains_raises_no_question():
    assert about_units(Scale(0.2 * 150, (0.2,), "mm", "")) is None


@pytest.mark.parametrize(
    ("sd", "words"), [(0.05, "50 mm, which is 25% of the largest"), (5e-8, "finer than any sensor")]
)
def test_a_noise_of_another_unit_is_noticed(sd, words):
    found = about_spread(np.tile(sd**2 * np.eye(3), (4, 1, 1)), Scale(0.1, (0.02, 0.2), "mm", ""))
    assert found.kind == "spread"
    assert words in found.message


def test_the_noise_of_a_sensor_is_none():
    for sd in (1e-6, 5e-5, 0.01):
        assert not about_spread(np.tile(sd**2 * np.eye(3), (4, 1, 1)), Scale(0.1, (0.2,), "mm", ""))
    assert not about_spread(np.zeros((0, 3, 3)), Scale(0.0, (0.2,), "mm", ""))


def test_directions_out_of_the_material_are_noticed():
    rng = np.random.default_rng(4)
    out = rng.normal(size=(12, 3))
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    points = np.array([0.4, 0.1, 0.0]) + 0.05 * out
    assert "Did you mean the opposite" in about_directions(points, out).message
    assert about_directions(points, -out) is None
    assert about_directions(points, np.full((12, 3), np.nan)) is None
    assert about_directions(points, np.tile([0.0, 0.0, -1.0], (12, 1))) is None  # all from above


@pytest.mark.slow
def test_an_answer_in_python_carries_typed_findings():
    part, rng = read_part(PARTS / "bracket_left.step"), np.random.default_rng(5)
    points, normals = surface_points(Surface(part.vertices, part.triangles), 20, rng)
    for sign, kinds in ((1, ["directions"]), (-1, [])):
        readings = Readings.from_columns(points=points, directions=sign * normals, sds=np.full(20, 1e-4))
        assert [one.kind for one in locate(readings, part).findings if one.role == "question"] == kinds


@pytest.mark.parametrize(("jitter", "named"), [(5e-4, True), (0.0, False)])
def test_an_error_of_each_scan_line_is_noticed(jitter, named):
    part, rng = read_part(PARTS / "housing.step"), np.random.default_rng(4)
    points, normals = surface_points(Surface(part.vertices, part.triangles), 72, rng)
    order = np.lexsort((points[:, 1], np.round(points[:, 0], 2)))
    points, normals = points[order], normals[order]
    lines = np.repeat(np.arange(12), 6)
    moved = points + (jitter * rng.normal(size=12)[lines] + 1e-4 * rng.normal(size=72))[:, None] * normals
    near = tanteo.PosePrior(T_world_part=np.eye(4), covariance=np.diag(np.repeat([1e-3, 0.01], 3)) ** 2)
    answer = locate(Readings.from_columns(points=moved, sds=np.full(72, 1e-4)), part, priors=tanteo.Priors(pose=near))
    assert any(one.kind == "correlated_readings" for one in answer.findings) == named


def test_readings_beside_a_part_that_fits_are_named():
    part, rng = read_part(PARTS / "block.step"), np.random.default_rng(2)
    points, normals = surface_points(Surface(part.vertices, part.triangles), 13, rng)
    points = np.concatenate([points + 1e-3 * rng.normal(size=(13, 3)), points[:2] + 0.1 * normals[:2]])
    normals = np.concatenate([normals, normals[:2]])
    readings = Readings.from_columns(
        points=points, normals=normals, normal_sds=np.full(15, 0.09), sds=np.full(15, 1e-3)
    )
    answer = locate(readings, part)
    assert answer.status == "ambiguous"
    assert "and 1 reading more contradict it. They are outliers, or the object is a variant" in answer.message
    assert answer.message.endswith("Touch near reading 15 again.")


@pytest.mark.slow
def test_gaps_of_the_file_are_named_where_no_part_fits(tmp_path):
    """A bracket without every seventh triangle; with them its touches fit, and no gaps are named."""
    part = read_part(PARTS / "bracket_left.step")
    points, normals = surface_points(prepare(part), 30, np.random.default_rng(4))
    readings = Readings.from_columns(points, directions=-normals, sds=np.full(30, 5e-5))
    triangles = part.triangles[np.arange(len(part.triangles)) % 7 > 0]
    lines = [f"OFF {len(part.vertices)} {len(triangles)} 0", *(" ".join(map(str, p)) for p in part.vertices)]
    (tmp_path / "torn.off").write_text("\n".join([*lines, *(" ".join(map(str, (3, *t))) for t in triangles)]))
    assert "The surface of torn is open" in locate(readings, read_part(tmp_path / "torn.off", unit="m")).message
    assert "gaps" not in locate(readings, part).message
