"""Two brackets, prepared once."""

from __future__ import annotations

import pytest

from viewer_scenes import brackets


@pytest.fixture(scope="session")
def targets():
    """The left one, which is the one that lies there, and the right one."""
    return brackets()
