from pathlib import Path

import pytest

from tanteo.parts import read_part
from tanteo.surface_search import prepare_target

PARTS = Path(__file__).parents[2] / "examples" / "parts"


@pytest.fixture(scope="session")
def targets():
    return [prepare_target(read_part(PARTS / f"{name}.step")) for name in ("bracket_left", "bracket_right", "wedge")]
