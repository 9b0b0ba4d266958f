"""Units that were mixed up are guessed, and only then."""

from __future__ import annotations

import numpy as np
import pytest

from tanteo.cli.scale import Scale, check_spread, meant_directions, meant_units, scale_of
from tanteo.parts import read_part

UNITS = {"mm": 1e-3, "m": 1.0, "um": 1e-6, "in": 0.0254}


@pytest.mark.parametrize("meant", UNITS)
@pytest.mark.parametrize("said", UNITS)
@pytest.mark.parametrize("size", [0.02, 0.2, 1.0])
def test_the_right_unit_of_the_columns_is_among_the_guesses(meant, said, size):
    """Beside a part whose file says its unit."""
    question = meant_units(Scale(0.6 * size * UNITS[said] / UNITS[meant], (size,), said, ""))
    if meant == said:
        assert question == ""
    else:
        assert f"columns in {meant} (x_{meant})" in question
        assert "--units" not in question


@pytest.mark.parametrize("meant", ["mm", "in"])
@pytest.mark.parametrize("said", UNITS)
def test_the_right_unit_of_the_parts_is_among_the_guesses(meant, said):
    """Beside readings whose columns might be wrong as well."""
    question = meant_units(Scale(0.12, (0.2 * UNITS[said] / UNITS[meant],), "mm", said))
    assert (f"--units {meant}" in question) == (meant != said)


def test_sizes_are_named():
    words = meant_units(Scale(210.0, (0.2,), "m", ""))
    assert words == "The part is 0.2 m wide and the readings span about 210 m: did you mean columns in mm (x_mm)?"


@pytest.mark.parametrize("span", [0.0, 0.05, 0.19, 0.23])
def test_readings_that_fit_and_none_at_all_ask_nothing(span):
    assert meant_units(Scale(span, (0.2, 3.0), "mm", "mm")) == ""


def test_a_difference_that_no_unit_explains_asks_nothing():
    assert meant_units(Scale(0.2 * 150, (0.2,), "mm", "")) == ""


@pytest.mark.parametrize(
    ("header", "unit"),
    [
        ("# made in inches\nid,x_mm,y_mm,z_mm\n", "mm"),
        ("range_um,sensor\n", "um"),
        ("sd_mm, x_in ,y_in,z_in\n", "in"),
        ("hand_x_mm,max_m,x_m\n", "m"),
        ("nothing", ""),
    ],
)
def test_the_unit_is_that_of_the_columns(header, unit, wedge_part):
    assert scale_of(np.zeros((5, 3)), [wedge_part], header, None).column == unit


@pytest.fixture
def wedge_part(parts):
    return read_part(parts / "wedge.stl", unit="mm")


def touches(tmp_path, unit):
    """Touches of the wedge all around, the columns named after a unit."""
    points = [[20, 20, 30], [40, 10, 30], [10, 30, 30], [0, 20, 10], [0, 10, 20], [30, 0, 15], [50, 0, 20],
              [20, 40, 10], [30, 40, 25], [30, 20, 0], [10, 10, 0]]  # fmt: skip
    path = tmp_path / "touches.csv"
    header = ",".join(f"{axis}_{unit}" for axis in "xyz")
    path.write_text(header + "\n" + "".join(",".join(map(str, p)) + "\n" for p in points))
    return path


def test_inches_that_are_millimetres_are_an_error_that_asks(run, parts, tmp_path):
    path = touches(tmp_path, "in")
    result = run("locate", path, "--part", parts / "wedge.stl", "--units", "mm", "--sd", "0.1mm")
    assert result.code == 1
    assert "did you mean --units in or columns in mm (x_mm)?" in result.err


def test_a_part_read_in_inches_is_asked_about_when_nothing_fits(run, parts, tmp_path):
    path = touches(tmp_path, "mm")
    wrong = run("locate", path, "--part", parts / "wedge.stl", "--units", "in", "--sd", "0.1mm")
    assert wrong.code == 3
    assert "did you mean --units mm" in wrong.err
    right = run("locate", path, "--part", parts / "wedge.stl", "--units", "mm", "--sd", "0.1mm")
    assert "did you mean" not in right.err


def test_it_warns_once(run, parts, tmp_path):
    path = touches(tmp_path, "um")
    result = run("locate", path, "--part", parts / "wedge.stl", "--units", "mm", "--sd", "0.1um")
    assert result.err.count("did you mean") == 1


@pytest.mark.parametrize(
    ("sd", "words"), [(0.05, "50 mm, which is 25% of the largest"), (5e-8, "finer than any sensor")]
)
def test_a_noise_of_another_unit_is_noticed(capsys, sd, words):
    assert check_spread(np.tile(sd**2 * np.eye(3), (4, 1, 1)), Scale(0.1, (0.02, 0.2), "mm", ""))
    assert words in capsys.readouterr().err


def test_the_noise_of_a_sensor_is_none(capsys):
    for sd in (1e-6, 5e-5, 0.01):
        assert not check_spread(np.tile(sd**2 * np.eye(3), (4, 1, 1)), Scale(0.1, (0.2,), "mm", ""))
    assert not check_spread(np.zeros((0, 3, 3)), Scale(0.0, (0.2,), "mm", ""))
    assert capsys.readouterr().err == ""


def test_directions_out_of_the_material_are_noticed():
    rng = np.random.default_rng(4)
    out = rng.normal(size=(12, 3))
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    points = np.array([0.4, 0.1, 0.0]) + 0.05 * out
    assert "Did you mean the opposite" in meant_directions(points, out)
    assert meant_directions(points, -out) == ""
    assert meant_directions(points, np.full((12, 3), np.nan)) == ""
    assert meant_directions(points, np.tile([0.0, 0.0, -1.0], (12, 1))) == ""  # all from above
