"""What CONTRIBUTING shows works from a package of somebody else's, and its statistics hold."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

import numpy as np
import pytest

from bare_scenes import box_centred_pose, inside, nees, surface_points
from tanteo import Action, Session, around, read_part
from tanteo.active import Probe
from tanteo.inference import identify_points
from tanteo.lie import SE3
from tanteo.measurements import FreeRays
from tanteo.sensors import NoiseLaw
from tanteo.session import Sensing
from tanteo.shapes import Surface

ROOT = Path(__file__).parents[1]
BLOCK = re.compile(r"^```python\n# (\w+)\.py\n(.*?)^```$", re.DOTALL | re.MULTILINE)


@pytest.fixture
def added(tmp_path):
    """Modules of the page's blocks, by name."""
    found = {}
    for name, body in BLOCK.findall((ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")):
        path = tmp_path / f"{name}.py"
        path.write_text(body)
        spec = importlib.util.spec_from_file_location(name, path)
        found[name] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(found[name])
    return found


@pytest.fixture(scope="module")
def part():
    pytest.importorskip("OCP", reason="the extra tanteo[step] is not installed")
    return read_part(ROOT / "examples" / "parts" / "bracket_left.step")


def test_a_policy_of_ones_own_chooses(added, part):
    place = around([part], np.eye(4), np.diag([0.005] * 3 + [0.05] * 3) ** 2)
    laser = Probe("laser", NoiseLaw.of(3e-4), max_range=0.4, standoff=0.15)
    session = Session(place, laser, Sensing(sd=3e-4), policy=added["nearest"].NearestFirst())
    surface = Surface(part.vertices, part.triangles)
    to_part = SE3.inverse(place.Ts[0])
    for _ in range(3):
        action = session.ask()
        assert isinstance(action, Action)
        origin, along = SE3.apply(to_part, action.origin), to_part[:3, :3] @ action.direction
        session.tell(action.read(float(surface.cast(origin[None], along[None]).distances[0])))
    assert session.count == 3


def test_a_measurement_of_ones_own_is_calibrated(added, part):
    """NEES of the pose over scenes with unequal, slanted covariances."""
    surface, values = Surface(part.vertices, part.triangles), []
    for seed in range(12):
        rng = np.random.default_rng((33, seed))
        T = box_centred_pose(rng)
        points, normals = surface_points(surface, 25, rng)
        roots = 2e-4 * rng.normal(size=(25, 3, 3))
        covs = roots @ np.swapaxes(roots, 1, 2) + 1e-8 * np.eye(3)
        noise = np.einsum("nij,nj->ni", np.linalg.cholesky(covs), rng.normal(size=(25, 3)))
        patches = added["patches"].from_patches(SE3.apply(T, points) + noise, covs, -normals @ T[:3, :3].T)
        answer = identify_points(patches, FreeRays.none(), [part])
        assert answer.status == "recognized"
        values.append(nees(part, answer.pose, answer.covariance, T)[0])
    total, dof = np.sum(values), 6 * len(values)
    assert inside(total, dof, level=0.9995)
    assert not inside(total, dof, level=0.0005)
