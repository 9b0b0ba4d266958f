"""Rectangular beams: zones fill the field, their means are those of many rays, and outlines move with the part."""

from dataclasses import replace

import numpy as np
import pytest

import tanteo
from bare_scenes import no_paths
from tanteo import _core
from tanteo.errors import InputError
from tanteo.factors import as_contact_points
from tanteo.geometry import SE3, SO3
from tanteo.posterior import Priors, Problem, prepare
from tanteo.sensors import Readings, Rig, RigSensor, measure
from tanteo.sensors.noise import cone_rays, equal_cone, rectangle_rays

SD = 4e-3
ZONES = """[sensors.eye]
sd_mm = 4
zones = [1, 3]
field_deg = [8, 60]
position_mm = [0, 0, 0]
quaternion_wxyz = [1, 0, 0, 0]
response = "mean"
"""


@pytest.fixture(scope="module")
def block():
    return prepare(tanteo.read_part("examples/parts/block.step"))


@pytest.fixture
def rig(tmp_path):
    (tmp_path / "rig.toml").write_text(ZONES)
    return tanteo.read_rig(tmp_path / "rig.toml")


def compiled(block, rig, name, hand, r):
    readings = Readings.from_columns(ranges=[r], sensors=[name], Ts_world_hand=hand[None])
    problem = Problem(as_contact_points(measure(readings, rig=rig)), no_paths(), replace(Priors(), radius=0.2))
    return problem.compiled(block), np.zeros((1, problem.states))


def means(block, sensor, rays, T=None):
    """Return the mean of rays in the sensor frame, even and by signal, and the fraction that hits."""
    T = np.eye(4) if T is None else T
    pose = SE3.inverse(T) @ sensor
    hits = block.surface.cast(pose[:3, 3], rays @ pose[:3, :3].T)
    hit = np.isfinite(hits.distances)
    cosines = -np.sum(block.surface.normals[np.maximum(hits.triangles, 0)] * (rays @ pose[:3, :3].T), axis=1)
    d = hits.distances[hit]
    return np.array([d.mean(), np.average(d, weights=cosines[hit] / d**2)]), hit.mean()


def over_edge(block, beside=0.0):
    """Return a device above the block whose last zone covers an edge of its top, past which it hits nothing."""
    low, high = block.part.box
    place = np.array([high[0] - 0.045 + beside, 0.5 * (low[1] + high[1]), high[2] + 0.12])
    return SE3.from_parts(np.diag([1.0, -1.0, -1.0]), place)


def test_zones_fill_the_field_of_view(rig):
    corners = []
    for zone in rig.sensors:
        axes = zone.T_hand_sensor[:3, :3]
        for x in (-1, 1):
            ray = axes @ (np.array([0, 0, 1.0]) + [x, 1] @ zone.half_axes)
            corners.append(np.degrees(np.arctan2(ray[:2], ray[2])))
    across = np.array(corners).reshape(3, 2, 2)
    np.testing.assert_allclose(across[:, :, 0], [[-30, -10], [-10, 10], [10, 30]], atol=0.5)
    np.testing.assert_allclose(across[:, :, 1], 4, atol=0.6)


def test_rigs_with_rectangles_round_trip(tmp_path, rig):
    tanteo.io.write_rig(rig, tmp_path / "again.toml")
    again = tanteo.read_rig(tmp_path / "again.toml")
    for one, other in zip(rig.sensors, again.sensors, strict=True):
        np.testing.assert_allclose(one.half_axes, other.half_axes, atol=1e-12)
        assert one.beam_half_angle == pytest.approx(equal_cone(other.half_axes))


def test_zones_of_a_stated_cone_are_circles(tmp_path):
    (tmp_path / "rig.toml").write_text(ZONES + "beam_half_angle_deg = 3\n")
    first = tanteo.read_rig(tmp_path / "rig.toml").sensors[0]
    assert first.half_axes is None
    (tmp_path / "both.toml").write_text(ZONES + 'beam_half_angle_deg = 3\nfootprint = "rectangle"\n')
    with pytest.raises(InputError, match="zones that are rectangles"):
        tanteo.read_rig(tmp_path / "both.toml")


def test_a_zone_reports_the_mean_of_its_rectangle(block, rig):
    """The zone of 20 x 8 degrees is not a cone: over an edge its mean differs from that of a cone by noises."""
    hand, zone = over_edge(block, -0.012), rig.sensors[2]
    sensor = hand @ zone.T_hand_sensor
    both, covered = means(block, sensor, rectangle_rays([0, 0, 1.0], zone.half_axes, 20000))
    turned, _ = means(
        block, sensor, rectangle_rays([0, 0, 1.0], zone.half_axes @ SO3.exp(np.array([0, 0, np.pi / 2])).T, 20000)
    )
    assert 0.3 < covered < 1
    assert abs(turned[0] - both[0]) > 1e-3
    tried = both.mean() + np.linspace(-6e-3, 6e-3, 61)
    logs = []
    for r in tried:
        core, z = compiled(block, rig, zone.name, hand, r)
        logs.append(_core.log_densities(block.shape, core, np.eye(4)[None], z)[0])
    assert abs(tried[np.argmax(logs)] - both.mean()) < 0.4e-3


def test_an_outline_in_a_small_spot_costs_no_density(block, tmp_path):
    """A device that reports a mean reports it for sure, also where the spot is as small as the noise."""
    (tmp_path / "rig.toml").write_text(ZONES.replace("sd_mm = 4", "sd_mm = 12"))
    rig, logs = tanteo.read_rig(tmp_path / "rig.toml"), []
    zone = rig.sensors[2]
    for beside in (-0.04, 0.012):
        hand = over_edge(block, beside)
        both, covered = means(block, hand @ zone.T_hand_sensor, rectangle_rays([0, 0, 1.0], zone.half_axes, 5000))
        assert covered == 1 if beside < 0 else covered < 0.35
        core, z = compiled(block, rig, zone.name, hand, both.mean())
        logs.append(_core.log_densities(block.shape, core, np.eye(4)[None], z)[0])
    assert logs[1] > logs[0] - 0.1


@pytest.mark.parametrize("shape", ["rectangle", "circle"])
def test_slopes_of_means_count_moving_outlines(block, rig, shape):
    """The outline of the part moves through the beam; without it the slopes here are wrong by 30 to 80 %."""
    zone, rays = rig.sensors[2], rectangle_rays([0, 0, 1.0], rig.sensors[2].half_axes, 40000)
    if shape == "circle":
        zone = RigSensor("eye", zone.T_hand_sensor, None, SD, 0.15, 1.0, 0.0, np.zeros((6, 6)), response="mean")
        rig, rays = Rig((zone,)), cone_rays(0.15, 40000)
    for beside in (-0.01, 0.0, 0.008):
        hand = over_edge(block, beside)
        sensor = hand @ zone.T_hand_sensor
        both, covered = means(block, sensor, rays)
        assert 0.2 < covered < 0.99
        r = both.mean() + SD
        core, z = compiled(block, rig, zone.name, hand, r)
        got = np.asarray(_core.slopes(block.shape, core, np.eye(4)[None], z)[1])[0, :3]
        expected = []
        for k in range(3):
            logs = [
                np.log(np.exp(-0.5 * ((r - means(block, sensor, rays, SE3.exp(h * np.eye(6)[k]))[0]) / SD) ** 2).sum())
                for h in (5e-4, -5e-4)
            ]
            expected.append((logs[0] - logs[1]) / 1e-3)
        assert np.linalg.norm(got - expected) < 0.15 * np.linalg.norm(expected), (got, expected)
