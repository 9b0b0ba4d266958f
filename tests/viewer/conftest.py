"""Two brackets, prepared once."""

from __future__ import annotations

import pytest

from viewer_scenes import brackets


@pytest.fixture(scope="session")
def targets():
    """The left one, which is the one that lies there, and the right one."""
    return brackets()


@pytest.fixture(scope="session")
def browser(launch):
    """A headless Chromium that puts its windows together without the graphics card that is not there: half the work."""
    started = launch("--disable-gpu-compositing")
    yield started
    started.close()
