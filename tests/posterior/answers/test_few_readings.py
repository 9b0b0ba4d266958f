"""The verdict on readings that leave a motion free: poses along it are pieces of one region."""

from types import SimpleNamespace

import pytest

from tanteo.posterior import verdict


@pytest.mark.parametrize(("free", "status"), [(("shift",), "insufficient"), ((), "unknown")])
def test_poses_along_a_free_motion_count_together(free, status):
    one = SimpleNamespace(part="block", probability=0.09, p_value=0.5, unobserved=free, advice="", corner_sd=1e-3)
    shares = [("block", 0.09)] * 10
    assert verdict((one,) * 10, 0.1, 0.01, shares=shares)[0] == status


def test_a_probable_unknown_object_stays_unknown():
    one = SimpleNamespace(part="block", probability=0.04, p_value=0.5, unobserved=("shift",), advice="", corner_sd=1e-3)
    assert verdict((one,) * 10, 0.6, 0.01, shares=[("block", 0.04)] * 10)[0] == "unknown"
