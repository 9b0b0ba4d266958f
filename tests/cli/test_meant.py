"""Readings whose columns were exchanged are of the part in a mirror: that is asked, and of no others."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"
PART = EXAMPLES / "parts" / "step_15mm.step"


@pytest.fixture(autouse=True)
def _kernel():
    pytest.importorskip("OCP", reason="the extra tanteo[step] is not installed")


def exchanged(name, target, *, swap=("x_mm", "y_mm"), vectors=("dx", "dy")):
    """The readings of an example with two columns exchanged."""
    a, b = swap
    u, v = vectors
    names = {a: b, b: a, u: v, v: u}
    lines = (EXAMPLES / "readings" / name).read_text().splitlines()
    head = next(k for k, line in enumerate(lines) if not line.startswith("#"))
    lines[head] = ",".join(names.get(column, column) for column in lines[head].split(","))
    target.write_text("\n".join(lines) + "\n")
    return target


@pytest.mark.parametrize("swap", [("x_mm", "y_mm", "dx", "dy"), ("y_mm", "z_mm", "dy", "dz")])
def test_exchanged_columns_are_asked_about(run, tmp_path, swap):
    file = exchanged("step_15mm.csv", tmp_path / "r.csv", swap=swap[:2], vectors=swap[2:])
    code, out, err = run("locate", file, "--part", PART)
    assert (code, out.startswith("unknown")) == (3, True)
    assert "In a mirror the readings are of step_15mm. Are two of the columns x, y, z exchanged" in err


def test_programs_get_the_question_too(run, tmp_path):
    file = exchanged("step_15mm.csv", tmp_path / "r.csv")
    code, out, err = run("locate", file, "--part", PART, "--json")
    (warning,) = json.loads(out)["warnings"]
    assert code == 3
    assert warning.startswith("In a mirror")
    assert f"warning: {warning}" in err


def test_readings_of_no_part_are_not_asked_about(run):
    code, out, err = run("identify", EXAMPLES / "readings/unknown_part.csv", "--parts", PART, "--json")
    assert (code, json.loads(out)["status"]) == (3, "unknown")
    assert "warnings" not in json.loads(out)
    assert "mirror" not in err


@pytest.mark.parametrize("option", [["--near", "0,0,0mm 0,0,0deg +- 500mm 90deg"], ["--table", "0mm +- 500mm"]])
def test_where_the_place_is_known_nothing_is_mirrored(run, tmp_path, option):
    file = exchanged("step_15mm.csv", tmp_path / "r.csv")
    assert "mirror" not in run("locate", file, "--part", PART, *option).err


def test_readings_of_a_hand_are_not_mirrored(tmp_path):
    from tanteo import read_readings
    from tanteo.cli.meant import meant_mirrored

    def ask(readings):
        raise AssertionError("asked")

    assert meant_mirrored(read_readings(EXAMPLES / "readings/wedge_ranges.csv"), ask) == ""
