"""The measured effects that ``docs/paper.md`` quotes: published formulas miss, corrected ones hit."""

from __future__ import annotations

from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import pytest

SPEC = spec_from_file_location("effects", Path(__file__).with_name("effects.py"))
effects = module_from_spec(SPEC)
SPEC.loader.exec_module(effects)


@pytest.mark.parametrize(("psi", "slide"), [(0, 0), (45, 0), (90, 0), (90, 100)])
def test_printed_coplanarity_is_wrong_off_psi_zero(psi, slide):
    found = effects.coplanarity(np.radians(psi), slide)
    assert 0.045 < found["joint"] < 0.055
    assert found["printed either"] > 0.08
    assert (found["printed p_z"] > 0.08) == (psi > 0)


def test_printed_corner_blows_up_as_the_frame_turns():
    found = [effects.intersection(np.radians(p)) for p in (90, 45, 15, 5)]
    np.testing.assert_allclose([f["corrected"] for f in found], found[0]["corrected"], rtol=1e-9)
    ratios = [f["printed (9)"] / f["corrected"] for f in found]
    np.testing.assert_allclose(ratios[1:], [np.sqrt(3), 5.37, 16.2], rtol=0.01)


@pytest.mark.parametrize(
    ("corners", "low", "high"), [((90, 90), 0.98, 1.02), ((60, 60), 0.7, 0.76), ((60, 120), 1.24, 1.32)]
)
def test_lengths_with_the_common_edge_counted_twice(corners, low, high):
    found = effects.length(np.radians(corners), 2, 0.5)
    assert low < found["NEES independent ends"] < high
    assert 0.97 < found["NEES corrected"] < 1.03
    assert 0.045 < found["rejected corrected"] < 0.055


def test_lengths_of_edges_that_share_a_robot_base():
    found = effects.shared_length()
    assert found["NEES independent"] < 0.2
    assert found["rejected independent"] == 0
    assert 0.97 < found["NEES corrected"] < 1.03


def test_printed_parallelism_hardly_ever_rejects():
    assert effects.parallelism(0)["printed"] < 0.001  # nominal 0.05
    assert 0.045 < effects.parallelism(0)["corrected"] < 0.055
    found = effects.parallelism(4)
    assert found["printed"] < 0.62
    assert found["corrected"] > 0.94


def test_angles_and_distances_at_zero_are_rayleigh():
    found = effects.rayleigh()
    np.testing.assert_allclose([found["angle 0"], found["distance 0"]], np.exp(-3.8415 / 2), atol=0.006)
    assert found["mean angle / sd"] == pytest.approx(np.sqrt(np.pi / 2), rel=0.01)
    assert 0.045 < found["collinearity"] < 0.055


def test_printed_distance_depends_on_where_the_origins_are():
    found = [effects.distance(s) for s in (0, 60, 150)]
    assert found[2]["printed"] > 10 * found[0]["printed"]
    assert found[2]["corrected"] < 1.2 * found[0]["corrected"]


def test_unsigned_offset_of_planes_is_folded():
    found = effects.folded(0)
    assert found["printed"] == pytest.approx(np.sqrt(2 / np.pi), abs=0.01)
    assert abs(found["corrected"]) < 0.02


def test_the_printed_plus_doubles_what_should_cancel():
    found = effects.sign_of_26()
    assert found["minus (corrected)"] == pytest.approx(found["true"], rel=0.02)
    assert found["plus (printed)"] > 4 * found["true"]


def test_univariate_gates_multiply_and_do_not_see_mirror_images():
    found = effects.families(4, n=2000)
    assert found["rejected univariate"] > 0.2
    assert 0.035 < found["rejected Sidak"] < 0.065
    assert 0.035 < found["rejected joint"] < 0.065
    assert found["mirror accepted univariate"] > 0.7
    assert found["mirror accepted joint"] < 0.01


def test_end_points_alone_know_the_plane_half_as_well():
    found = effects.plane_of_scan_lines(20)
    assert found["printed"] > 2 * found["corrected"]


def test_six_numbers_do_not_exist_in_gimbal_lock():
    found = effects.gimbal_lock()
    assert min(found["psi"], found["phi"]) > 1.5
    assert found["theta"] < 0.01
