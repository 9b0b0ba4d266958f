"""Ranges of wide beams that contain the part and furniture beside it."""

import numpy as np
import pytest

import tanteo
from bare_scenes import no_paths
from tanteo import _core
from tanteo.factors import as_contact_points
from tanteo.geometry import SE3, SO3
from tanteo.posterior import Furniture, Priors, Problem, Table, prepare
from tanteo.sensors import Readings, Rig, RigSensor, measure
from tanteo.sensors.noise import cone_rays
from tanteo.sensors.presets import SensorPreset

DOWN = np.diag([1.0, -1.0, -1.0, 1.0])
HALF_ANGLE, HEIGHT, SD = 0.15, 0.25, 1e-3


@pytest.fixture(scope="module")
def block():
    return prepare(tanteo.read_part("examples/parts/block.step"))


def density_at(block, response, sensor, ranges, *, preset=None, furniture=()):
    """Return the density of each range on the part over that of an outlier."""
    n = len(ranges)
    readings = Readings.from_columns(ranges=ranges, sensors=["eye"] * n, Ts_world_hand=np.array([sensor] * n))
    eye = RigSensor("eye", np.eye(4), preset, SD, HALF_ANGLE, 1.0, 0.0, np.zeros((6, 6)), response=response)
    points = as_contact_points(measure(readings, rig=Rig((eye,))))
    problem = Problem(points, no_paths(), Priors(radius=0.5, furniture=furniture))
    z = np.zeros((1, problem.states))
    return _core.details(block.shape, problem.compiled(block), np.eye(4)[None], z)[0][0, :, 0]


def on_table(block, response, sensor, ranges):
    """Return the same with the table."""
    table = Furniture.of_table(Table(point=np.zeros(3), normal=np.array([0, 0, 1.0]), sd=1e-4), np.zeros(3), 0.5)
    return density_at(block, response, sensor, ranges, furniture=(table,))


def seen(block, sensor):
    """Return ranges of 1000 rays to the part or the table, their signals, and which are on the part."""
    rays = cone_rays(HALF_ANGLE, 1000) @ sensor[:3, :3].T
    hits = block.surface.cast(sensor[:3, 3], rays).distances
    d = np.minimum(hits, -sensor[2, 3] / rays[:, 2])
    return d, -rays[:, 2] / d**2, np.isfinite(hits)


def over_edge(block, share):
    """Return a sensor above an edge of the part, whose cone has a share of its rays on the part."""
    low, high = block.part.box
    inside, outside = 0.5 * (low[0] + high[0]), high[0] + 0.05
    for _ in range(12):
        x = 0.5 * (inside + outside)
        sensor = SE3.from_parts(DOWN[:3, :3], np.array([x, 0.5 * (low[1] + high[1]), high[2] + HEIGHT]))
        inside, outside = (x, outside) if seen(block, sensor)[2].mean() > share else (inside, x)
    return sensor


@pytest.mark.parametrize("share", [0.3, 0.6])
def test_a_mean_is_between_part_and_table(block, share):
    sensor = over_edge(block, share)
    d, signals, on_part = seen(block, sensor)
    assert d[~on_part].mean() - d[on_part].mean() > 0.03
    ranges = np.linspace(d.min() - 0.01, d.max() + 0.01, 150)
    density = on_table(block, "mean", sensor, ranges)
    means = np.array([d.mean(), np.average(d, weights=signals)])
    of_means = on_table(block, "mean", sensor, means)
    assert np.all(of_means > 0.2 * density.max())
    away = np.abs(ranges[:, None] - means).min(axis=1) > 6e-3
    assert np.all(density[away] < 0.05 * density.max())


def test_a_table_that_returns_most_is_reported(block):
    """The range of the part is likely only where the part returns most of the signal."""
    of_part = []
    for share in (0.1, 0.9):
        sensor = over_edge(block, share)
        d, _, on_part = seen(block, sensor)
        of_part.append(on_table(block, "strongest", sensor, np.array([d[on_part].mean()]))[0])
    assert of_part[0] < 1e-2 * of_part[1]


@pytest.mark.parametrize("response", ["ray", "mean", "strongest"])
def test_an_echo_beyond_the_incidence_limit_is_an_echo(block, response):
    """There was an echo, so that the limit of a device excludes no face: it was the only one in the cone."""
    top = np.array([*0.5 * (block.part.box[0] + block.part.box[1])[:2], block.part.box[1][2]])
    aim = np.array([np.sin(1.1), 0.0, -np.cos(1.1)])
    sensor = SE3.from_parts(SO3.frame_from_axis(aim, 2), top - 0.2 * aim)
    preset = SensorPreset("short_sighted", max_incidence=0.8)
    assert density_at(block, response, sensor, np.array([0.2]), preset=preset)[0] > 0.1
