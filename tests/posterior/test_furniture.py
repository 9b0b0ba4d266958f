"""What stands around the part: readings on it are explained by it, and say where the part is not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bare_scenes import box_centred_pose, nees, surface_points
from tanteo import Furniture, InputError, Priors, Readings, locate, read_part
from tanteo.geometry import SE3

PARTS = Path(__file__).parents[2] / "examples" / "parts"
SD = 2e-4


@pytest.fixture(scope="module")
def parts():
    pytest.importorskip("OCP", reason="the extra tanteo[step] is not installed")
    return {name: read_part(PARTS / f"{name}.step") for name in ("bracket_left", "block")}


def scene(parts, seed, n=14, on_furniture=6):
    """Touches of a bracket, and of a block beside it, with directions."""
    from tanteo.posterior import prepare

    rng = np.random.default_rng(seed)
    T, T_block = box_centred_pose(rng), box_centred_pose(rng)
    T_block[:3, 3] = SE3.apply(T, parts["bracket_left"].centroid) + np.array([0.16, 0.0, 0.0])
    rows = []
    for name, pose, count in (("bracket_left", T, n), ("block", T_block, on_furniture)):
        p, normals = surface_points(prepare(parts[name]), count, rng)
        rows.append((SE3.apply(pose, p) + SD * rng.normal(size=p.shape), -normals @ pose[:3, :3].T))
    points, directions = (np.concatenate(some) for some in zip(*rows, strict=True))
    readings = Readings.from_columns(points=points, directions=directions, sds=np.full(len(points), SD))
    return T, T_block, readings


@pytest.mark.parametrize("seed", range(3))
def test_readings_on_an_adjacent_block_are_reported_there(parts, seed):
    T, T_block, readings = scene(parts, seed)
    block = Furniture.of_part(parts["block"], T_block, sd=SD, name="vise")
    answer = locate(readings, parts["bracket_left"], priors=Priors(furniture=(block,)))
    best = answer.best
    assert answer.status == "recognized"
    assert nees(parts["bracket_left"], best.T_world_part, best.covariance, T)[0] < 40
    assert sum(feature == "vise" for _, feature in best.pairings) >= 5
    assert "on the vise" in answer.message
    assert not best.outliers


def test_readings_on_furniture_alone_are_too_little(parts):
    _, T_block, readings = scene(parts, 1, n=0, on_furniture=8)
    block = Furniture.of_part(parts["block"], T_block, sd=SD, name="vise")
    answer = locate(readings, parts["bracket_left"], priors=Priors(furniture=(block,)))
    assert answer.status == "insufficient"
    assert "All 8 readings are on the vise" in answer.message


def test_a_furniture_without_a_spread_is_refused(parts):
    with pytest.raises(InputError, match="furniture, sd"):
        Furniture.of_part(parts["block"], np.eye(4), sd=0.0)


def test_the_command_line_reads_it(parts, tmp_path):
    from tanteo.io.poses import read_furniture

    found = read_furniture(f"{PARTS / 'block.step'}@100,0,20mm 0,0,90deg +- 0.5mm")
    assert found.name == "block"
    assert found.sd == pytest.approx(5e-4)
    np.testing.assert_allclose(
        found.vertices.mean(axis=0)[2] - parts["block"].vertices.mean(axis=0)[2], 0.02, atol=1e-9
    )
    with pytest.raises(InputError, match="one positive sd"):
        read_furniture(f"{PARTS / 'block.step'} +- 1mm,2mm")
