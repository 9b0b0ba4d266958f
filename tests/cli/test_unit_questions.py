"""Mixed-up units raise a question on the command line."""

from __future__ import annotations


def touches(tmp_path, unit):
    """Touches of the wedge all around, the columns named after a unit."""
    points = [[20, 20, 30], [40, 10, 30], [10, 30, 30], [0, 20, 10], [0, 10, 20], [30, 0, 15], [50, 0, 20],
              [20, 40, 10], [30, 40, 25], [30, 20, 0], [10, 10, 0]]  # fmt: skip
    path = tmp_path / "touches.csv"
    header = ",".join(f"{axis}_{unit}" for axis in "xyz")
    path.write_text(header + "\n" + "".join(",".join(map(str, p)) + "\n" for p in points))
    return path


def test_millimetres_stated_as_inches_raise_a_question(run, parts, tmp_path):
    path = touches(tmp_path, "in")
    result = run("locate", path, "--part", parts / "wedge.stl", "--units", "mm", "--sd", "0.1mm")
    assert result.code == 1
    assert "Did you mean --units in or columns in mm (x_mm)?" in result.err


def test_a_part_in_inches_raises_a_question_if_nothing_fits(run, parts, tmp_path):
    path = touches(tmp_path, "mm")
    wrong = run("locate", path, "--part", parts / "wedge.stl", "--units", "in", "--sd", "0.1mm")
    assert wrong.code == 3
    assert "Did you mean --units mm" in wrong.err
    right = run("locate", path, "--part", parts / "wedge.stl", "--units", "mm", "--sd", "0.1mm")
    assert "Did you mean" not in right.err


def test_it_warns_once(run, parts, tmp_path):
    path = touches(tmp_path, "um")
    result = run("locate", path, "--part", parts / "wedge.stl", "--units", "mm", "--sd", "0.1um")
    assert result.err.count("Did you mean") == 1
