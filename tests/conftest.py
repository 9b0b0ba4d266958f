"""The example parts, read once."""

from __future__ import annotations

from pathlib import Path

import pytest

from tanteo.matching import prepare
from tanteo.parts import read_part

PARTS = Path(__file__).parents[1] / "examples" / "parts"


@pytest.fixture(scope="session")
def models():
    """Prepared example parts by name."""
    pytest.importorskip("OCP", reason="reading STEP needs tanteo[step]")
    return {path.stem: prepare(read_part(path)) for path in sorted(PARTS.glob("*.step"))}


@pytest.fixture(scope="session")
def parts(models):
    """The same, not prepared."""
    return {name: model.part for name, model in models.items()}
