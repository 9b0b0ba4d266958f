from pathlib import Path

import pytest

from tanteo.inference import prepare
from tanteo.parts import read_part

PARTS = Path(__file__).parents[2] / "examples" / "parts"


@pytest.fixture(scope="session")
def targets():
    return [prepare(read_part(PARTS / f"{name}.step")) for name in ("bracket_left", "bracket_right", "wedge")]
