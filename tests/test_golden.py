"""Recorded answers of seeded scenes: ``benchmarks/golden.py`` answers them again."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("OCP", reason="reading STEP needs tanteo[step]")
pytest.importorskip("cv2", reason="the extra tanteo[vision] is not installed")

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))

import golden

FEW = [
    *(f"{row}/{k}" for row in ("touch", "laser", "prior", "hard_prior_6") for k in range(2)),
    *("tip_shared/0", "free_rays/0", "hard_normals/0", "hard_bias/0", "thin_sheet/0", "twins/0"),
    *("features/0", "features/1", "example/bracket_bare", "example/square_post"),
]


def test_few_answers_are_those_that_were_recorded():
    assert list(golden.compared(golden.read(), FEW)) == []


@pytest.mark.slow
def test_all_answers_are_those_that_were_recorded():
    assert list(golden.compared(golden.read(), [])) == []


@pytest.fixture(scope="module")
def block():
    return {part.name: part for part in golden.examples()}


def answer_of(**more):
    T = [float(x) for x in np.eye(4)[:3].ravel()]
    same = {"status": "recognized", "part": "clamp", "P": 0.9, "T": T, "log_det": -90.0, "corner_sd": 1e-4}
    return same | {"unknown": 0.05, "message": ""} | more


@pytest.mark.parametrize(
    ("more", "names"),
    [
        ({}, []),
        ({"P": 0.85}, ["P"]),
        ({"status": "ambiguous"}, ["status"]),
        ({"part": "wedge"}, ["part"]),
        ({"log_det": -91.0, "corner_sd": 1.1e-4}, ["log_det", "log_corner_sd"]),
        ({"T": [1, 0, 0, 1e-5, 0, 1, 0, 0, 0, 0, 1, 0]}, []),
        ({"T": [1, 0, 0, 1e-4, 0, 1, 0, 0, 0, 0, 1, 0]}, ["pose"]),
        ({"message": "other"}, ["message"]),
        ({"message": "0.4 mm"}, ["message"]),
    ],
)
def test_differences_are_named(block, more, names):
    found = golden.differences([answer_of()], answer_of(**more), None, block)
    assert [name for name, _ in found] == names


def test_seeds_of_the_search_widen_what_is_accepted(block):
    known = [answer_of(message="0.40 mm"), answer_of(P=0.8, status="ambiguous", message="It may be 2.")]
    assert list(golden.differences(known, answer_of(P=0.74, message="0.5 mm"), None, block)) == []
    assert [name for name, _ in golden.differences(known, answer_of(P=0.6, message="1 mm"), None, block)] == ["P"]
