"""The page on the safety of machines names tests that exist, in every row."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "machines_safety.md").read_text()
SOURCE = "\n".join(path.read_text() for path in sorted((ROOT / "tests").rglob("test_*.py")))
NAMED = sorted(set(re.findall(r"`(test_\w+)`", PAGE)))


@pytest.mark.parametrize("name", NAMED)
def test_a_named_test_exists(name):
    assert re.search(rf"^def {name}\(", SOURCE, re.MULTILINE)


def test_every_invariant_names_a_test():
    invariants = PAGE.split("## Hazards")[0].splitlines()
    tests = [row.split("|")[-2] for row in invariants if row.startswith("| ")]
    assert len(tests) == 20
    assert [cell for cell in tests if "`test_" not in cell and cell != " test "] == []
