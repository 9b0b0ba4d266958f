"""A few of the spoiled files that ``make fuzz`` has ten thousand of."""

from __future__ import annotations

import numpy as np
import pytest

from fuzz.__main__ import run
from fuzz.mutate import mutated

pytest.importorskip("cv2", reason="the extra tanteo[vision] is not installed")


def test_spoiled_files_are_read_or_refused():
    kinds = ["readings", "rig", "prior", "record", "camera", "marks", "image", "mesh", "cache", "catalogue"]
    table, slowest, bad = run(200, 5, kinds, workers=1)
    assert bad == []
    assert sum(row.total() for row in table.values()) == 200
    assert sum(row["read"] for row in table.values()) > 10
    assert sum(row["refused"] for row in table.values()) > 50
    assert max(slowest.values()) < 20


def test_an_input_can_be_made_again():
    content = b"x_mm,y_mm,z_mm\n1,2,3\n" * 9
    once, again, other = (mutated(content, np.random.default_rng((1, k))) for k in (7, 7, 8))
    assert once == again
    assert once not in (content, other)
