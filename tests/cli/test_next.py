"""``tanteo next``: where to sense next for a log."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("OCP", reason="reading STEP needs tanteo[step]")

EXAMPLES = Path(__file__).parents[2] / "examples"
FEW = (EXAMPLES / "readings" / "too_few.csv", "--part", EXAMPLES / "parts" / "t_slot.step")
DECIDED = (EXAMPLES / "readings" / "bracket_bare.csv", "--parts", EXAMPLES / "parts")


def test_an_undecided_log_gets_a_place_and_expected_readings(run):
    got = run("next", *FEW)
    assert got.code == 0
    for words in ("insufficient", "Next: face", "point", "direction", "expected distance", "if it is t_slot"):
        assert words in got.out


def test_the_document_has_the_same_reading(run):
    document = json.loads(run("next", *FEW, "--json").out)
    one = document["next"]
    assert document["schema"] == "tanteo.next/1"
    along = np.array(one["point_m"]) - one["start_m"]
    assert np.allclose(along / np.linalg.norm(along), one["direction"], atol=1e-6)
    assert sum(h["probability"] for h in one["hypotheses"]) <= 1
    assert len(one["hypotheses"]) > 1


def test_the_reading_is_also_a_program(run):
    got = run("next", *FEW, "--program", "linuxcnc", "--tip-radius", "1mm")
    assert got.code == 0
    assert "G38" in got.out


def test_a_decided_log_needs_a_goal(run):
    assert "No further reading is needed" in run("next", *DECIDED).out
    assert "Next: " in run("next", *DECIDED, "--goal", "0.01mm").out
    assert "within 50 mm" in run("next", *DECIDED, "--goal", "50mm").out


def test_an_undecided_answer_names_the_next_reading(run):
    got = run("locate", *FEW)
    assert got.code == 3
    assert "next, at (" in got.out
    document = json.loads(run("locate", *FEW, "--json").out)
    assert document["findings"][-1]["kind"] == "next_touch"


@pytest.fixture(scope="module")
def six_touches(tmp_path_factory):
    """Six touches of the wedge without directions, three on top, two on a side and one on another."""
    path = tmp_path_factory.mktemp("six") / "six.csv"
    points = [(10, 10, 30), (50, 5, 30), (20, 35, 30), (10, 0, 15), (50, 0, 12), (0, 20, 14)]
    path.write_text("x_mm,y_mm,z_mm\n" + "".join(f"{x},{y},{z}\n" for x, y, z in points))
    return path


def test_an_answer_and_next_name_the_same_place(run, parts, six_touches):
    """Both compare all poses that the search found, also those that the answer does not list."""
    words = six_touches, "--part", parts / "wedge.stl", "--units", "mm", "--sd", "0.1mm", "--json"
    following, answer = json.loads(run("next", *words).out)["next"], json.loads(run("locate", *words).out)
    named = next(one["values"] for one in answer["findings"] if one["kind"] == "next_touch")
    assert len(following["hypotheses"]) > len(answer["hypotheses"]) == 5
    assert named["point"] == pytest.approx(following["point_m"])
    assert named["direction"] == pytest.approx(following["direction"])


def test_undirected_touches_are_not_followed_by_one_from_below(run, parts, six_touches):
    words = six_touches, "--part", parts / "wedge.stl", "--units", "mm", "--sd", "0.1mm", "--seed", 2, "--json"
    assert json.loads(run("next", *words).out)["next"]["direction"][2] <= 1e-9


@pytest.mark.parametrize("more", [(), ("--parts", EXAMPLES / "parts")])
def test_part_or_parts_must_be_named(run, more):
    typed = FEW if more else FEW[:1]
    assert run("next", *typed, *more).code == 2


def test_a_needed_accuracy_passes_or_fails(run):
    passed = run("locate", *DECIDED[:1], "--part", EXAMPLES / "parts" / "bracket_left.step", "--need", "0.5mm")
    assert passed.code == 0
    assert "needed accuracy is reached" in passed.out
    missed = run("identify", *DECIDED, "--need", "0.05mm", "--wcs", "G54")
    assert missed.code == 3
    assert "NOT reached" in missed.err
    assert "G10" not in missed.out


def test_a_frame_states_its_error(run):
    got = run("identify", *DECIDED, "--wcs", "linuxcnc:G54", "--accept-turn-lost")
    assert "farthest corner within" in got.out


@pytest.mark.slow
@pytest.mark.parametrize(("factor", "unit"), [(1 / 25.4, "inches"), (1e-3, "m")])
def test_a_wrong_unit_is_named_and_refuses_frames(run, tmp_path, factor, unit):
    rows = [r for r in DECIDED[0].read_text().splitlines() if not r.startswith("#")]
    cells = [r.split(",")[:-1] for r in rows]  # without sd_mm
    for row in cells[1:]:
        row[1:4] = [f"{float(v) * factor:.7f}" for v in row[1:4]]
    path = tmp_path / "r.csv"
    path.write_text("\n".join(",".join(row) for row in cells) + "\n")
    got = run("locate", path, "--part", EXAMPLES / "parts" / "bracket_left.step", "--wcs", "G54")
    assert unit in got.err
    assert got.code == 3
    assert "G10" not in got.out


def test_a_forgotten_radius_refuses_frames(run, tmp_path):
    rows = [r for r in DECIDED[0].read_text().splitlines() if not r.startswith("#")]
    cells = [r.split(",") for r in rows]
    for row in cells[1:]:  # the ball's centre stays 3 mm away from where its surface touches
        d = np.array(row[4:7], dtype=float)
        row[1:4] = [f"{v:.4f}" for v in np.array(row[1:4], dtype=float) - 3.0 * d]
    path = tmp_path / "r.csv"
    path.write_text("\n".join(",".join(row) for row in cells) + "\n")
    got = run("locate", path, "--part", EXAMPLES / "parts" / "bracket_left.step", "--as", "ros")
    assert "radius" in got.err
    assert "error: --as" in got.err
    assert not got.out.strip()
