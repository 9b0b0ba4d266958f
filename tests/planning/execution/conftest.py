from pathlib import Path

import pytest

from tanteo.parts import read_part
from tanteo.posterior import prepare

PARTS = Path(__file__).parents[3] / "examples" / "parts"


@pytest.fixture(scope="session")
def targets():
    return [prepare(read_part(PARTS / f"{name}.step")) for name in ("bracket_left", "bracket_right", "wedge")]
