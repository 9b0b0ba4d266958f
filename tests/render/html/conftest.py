"""Two parts that are nearly equal."""

from __future__ import annotations

import pytest

from report_scenes import prism_text
from tanteo.parts import read_part


@pytest.fixture(scope="session")
def wedge(tmp_path_factory):
    """A 60 x 40 x 30 mm block with one slanted side: no symmetry."""
    path = tmp_path_factory.mktemp("parts") / "wedge.off"
    path.write_text(prism_text([(0, 0), (60, 0), (45, 40), (0, 40)], 30))
    return read_part(path, unit="mm")


@pytest.fixture(scope="session")
def near_wedge(tmp_path_factory):
    """The same with a side that slants a little more."""
    path = tmp_path_factory.mktemp("parts") / "near_wedge.off"
    path.write_text(prism_text([(0, 0), (60, 0), (44.9, 40), (0, 40)], 30))
    return read_part(path, unit="mm")
