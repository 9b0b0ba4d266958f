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


@pytest.mark.parametrize("more", [(), ("--parts", EXAMPLES / "parts")])
def test_part_or_parts_must_be_named(run, more):
    typed = FEW if more else FEW[:1]
    assert run("next", *typed, *more).code == 2
