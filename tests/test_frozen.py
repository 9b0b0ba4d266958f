"""Values of the packages without state are frozen dataclasses."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[1] / "src" / "tanteo"
PACKAGES = [
    "bench", "catalogue", "factors", "features", "fitting", "geometry", "paper", "sensors", "vision", "words",
]  # fmt: skip
"""Packages without objects that change: no queues, sessions, connections or caches."""


@pytest.mark.parametrize("package", PACKAGES)
def test_dataclasses_are_frozen(package):
    texts = {path.relative_to(SOURCE): path.read_text(encoding="utf-8") for path in (SOURCE / package).rglob("*.py")}
    decorators = [(path, one) for path, text in texts.items() for one in re.findall(r"^\s*@dataclass\b.*", text, re.M)]
    assert decorators
    assert [(path, one) for path, one in decorators if "frozen=True" not in one] == []
