"""Laws of stock on the faces of a part: estimated by face where it is stated, named where it is not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tanteo
from bare_scenes import beams
from tanteo.geometry import SE3, SO3
from tanteo.posterior import prepare
from tanteo.sensors.error_states import OffsetByAxes, Stock
from tanteo.words.findings import OffsetQuestion, SharedEstimates

PARTS = Path(__file__).parents[2] / "examples" / "parts"
SD = 2e-5
T = SE3.from_parts(SO3.axis_rotation(2, 0.4), np.array([0.3, 0.15, 0.02]))

NEAR = tanteo.PosePrior(T_world_part=T, covariance=np.diag(np.repeat([5e-3, 0.03], 3)) ** 2)


@pytest.fixture(scope="module")
def block():
    return prepare(tanteo.read_part(PARTS / "block.step"))


def touches(block, amounts, seed, n=30):
    """Return touches along the normals of a block whose faces carry material, and the amount at each [m]."""
    rng = np.random.default_rng(seed)
    p = beams(block, n, rng, tilt=0.0)[0]
    faces = block.surface.closest(p)
    normals = block.surface.normals[faces.triangles]
    middle = block.part.box.mean(axis=0)
    p = middle + (p - middle) * np.where(np.abs(normals) > 0.5, 1.0, 0.8)  # beyond the edges there is stock, too
    off = np.array([amounts.get(tuple(np.round(normal).astype(int)), 0.0) for normal in normals])
    points = SE3.apply(T, p + off[:, None] * normals) + SD * rng.normal(size=p.shape)
    return tanteo.Readings.from_columns(points, directions=-normals @ T[:3, :3].T, sds=np.full(n, SD)), off


AMOUNTS = {(1, 0, 0): 2e-3, (-1, 0, 0): 1e-3, (0, 0, 1): 3e-3, (0, 1, 0): 1.5e-3, (0, -1, 0): 0.5e-3}


def test_stated_stock_is_estimated_by_face(block):
    readings, off = touches(block, AMOUNTS, 1)
    answer = tanteo.locate(readings, block, shared_errors=(Stock(3e-3),), priors=tanteo.Priors(pose=NEAR))
    found = next(one for one in answer.findings if isinstance(one, SharedEstimates))
    assert answer.status == "recognized"
    assert all(name.startswith("stock of face ") for name in found.names)
    of_face = {f"stock of {face}": off[int(k) - 1] for k, face in answer.best.pairings}
    for name, value, sd in zip(found.names, found.values, found.sds, strict=True):
        assert abs(value - of_face[name]) < 3 * sd


def test_a_face_alone_is_as_uncertain_as_its_stock(block):
    """Where no opposite face was touched, the pose has the distribution of the stock on one side."""
    rng = np.random.default_rng(5)
    p = beams(block, 400, rng, tilt=0.0)[0]
    normals = block.surface.normals[block.surface.closest(p).triangles]
    top = np.flatnonzero(normals[:, 2] > 0.9)[:5]
    points = SE3.apply(T, p[top]) + SD * rng.normal(size=(5, 3))
    readings = tanteo.Readings.from_columns(points, directions=np.tile([0, 0, -1.0], (5, 1)), sds=np.full(5, SD))
    known = tanteo.PosePrior(T_world_part=T, covariance=np.diag([1e-5, 1e-5, 0.1, 1e-5, 1e-5, 1e-5]) ** 2)
    answer = tanteo.locate(readings, block, shared_errors=(Stock(3e-3),), priors=tanteo.Priors(pose=known))
    lower = T[2, 3] - answer.best.T_world_part[2, 3]
    assert lower == pytest.approx(Stock.center * 3e-3, rel=0.15)
    assert np.sqrt(answer.best.covariance[2, 2]) == pytest.approx(Stock.spread * 3e-3, rel=0.15)


@pytest.mark.slow
def test_stock_that_is_not_stated_is_named_by_face(block):
    answer = tanteo.locate(touches(block, AMOUNTS, 2)[0], block, priors=tanteo.Priors(pose=NEAR))
    found = next(one for one in answer.findings if isinstance(one, OffsetQuestion))
    assert answer.status == "unknown"
    assert len(found.faces) >= 4
    assert "carry stock" in found.message
    assert "--stock" in found.message


@pytest.mark.slow
def test_a_bent_part_carries_no_stock(block):
    rng = np.random.default_rng(3)
    p, d = beams(block, 30, rng, tilt=0.0)
    bent = p + 2e-3 * (p[:, :1] / np.abs(p[:, 0]).max()) ** 2 * [0.0, 0.0, 1.0]
    readings = tanteo.Readings.from_columns(
        SE3.apply(T, bent) + SD * rng.normal(size=p.shape), directions=d @ T[:3, :3].T, sds=np.full(30, SD)
    )
    answer = tanteo.locate(readings, block)
    assert not any(isinstance(one, OffsetQuestion) for one in answer.findings)


def test_an_offset_by_axes_is_estimated(block):
    readings, _ = touches(block, {}, 4)
    d = readings.directions.filled(0.0)
    late = tanteo.Readings.from_columns(
        readings.points.values + 2e-4 * d * [1, 1, 0], directions=d, sds=readings.sds.values
    )
    answer = tanteo.locate(late, block, shared_errors=(OffsetByAxes(3e-4, "xy"),))
    found = next(one for one in answer.findings if isinstance(one, SharedEstimates))
    assert found.values[0] == pytest.approx(-2e-4, abs=4 * found.sds[0])
    assert found.sds[0] < 3e-5
