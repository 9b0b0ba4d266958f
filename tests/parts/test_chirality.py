"""The sign of the handedness of a part."""

from __future__ import annotations

from pathlib import Path

import pytest

import tanteo
from tanteo.parts.readers import mirror_part
from tanteo.parts.symmetry import chirality

PARTS = Path(__file__).parents[2] / "examples" / "parts"


@pytest.mark.parametrize("name", ["bracket_left", "clamp", "housing", "step_15mm"])
def test_a_mirror_image_has_the_opposite_chirality(name):
    pytest.importorskip("OCP", reason="reading STEP needs tanteo[step]")
    part = tanteo.read_part(PARTS / f"{name}.step")
    assert abs(chirality(part)) > 1e-4
    assert chirality(mirror_part(part)) == pytest.approx(-chirality(part), rel=1e-6)


@pytest.mark.parametrize("name", ["block", "flange", "wedge"])
def test_a_part_that_is_its_own_mirror_image_has_none(name):
    pytest.importorskip("OCP", reason="reading STEP needs tanteo[step]")
    assert abs(chirality(tanteo.read_part(PARTS / f"{name}.step"))) < 1e-6
