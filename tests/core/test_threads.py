"""As many threads as there are: the numbers are those of one, to the last bit."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

SCRIPT = """
import sys
import numpy as np
from core.bodies import flat_bodies
from core.questions import point_question, near_pose, random_pose, with_shared
import tanteo
from tanteo import _core

rng, body, T = np.random.default_rng(3), flat_bodies()["bracket"], random_pose(np.random.default_rng(4))
p = rng.uniform(-0.03, 0.03, size=(200, 3))
q = with_shared(point_question(p @ T[:3, :3].T + T[:3, 3], 3e-3), 2, rng)
Ts = np.stack([near_pose(T, rng, 5e-3, 0.1) for _ in range(120)])
shape, core, zs = body.shape(), q.core(), np.zeros((120, 2))
out = [
    _core.log_densities(shape, core, Ts, zs),
    *_core.slopes(shape, core, Ts, zs),
    *_core.marginals(shape, core, Ts, zs),
    *_core.refine_poses(shape, core, np.arange(200, dtype=np.int32), np.array([0.01, 3e-3, 1e-3]), Ts),
    *_core.maximize(shape, core, Ts, zs, np.array([6e-3]), 10, 1e-3, 1e6),
]
parts = [
    tanteo.part_from_mesh(one.vertices, one.triangles, unit="m", name=name)
    for name, one in list(flat_bodies().items())[:4]
]
points = body.surface_points(12, rng)[0] @ T[:3, :3].T + T[:3, 3]
readings = tanteo.Readings.from_columns(points=points, sds=np.full(12, 3e-4))
for one in tanteo.identify(readings, parts, top=9).hypotheses:
    out += [one.T_world_part, one.covariance, np.array(one.probability)]
np.savez(sys.argv[1], *out)
"""


@pytest.mark.parametrize("counts", [("1", "3"), pytest.param(("1", "2", "many"), marks=pytest.mark.slow)])
def test_threads_change_no_number(tmp_path, counts):
    answers = []
    for threads in counts:
        path = tmp_path / f"{threads}.npz"
        paths = os.pathsep.join([str(Path(__file__).parents[1]), *sys.path])
        environment = {**os.environ, "OMP_NUM_THREADS": threads, "PYTHONPATH": paths}
        subprocess.run([sys.executable, "-c", SCRIPT, str(path)], check=True, env=environment)
        with np.load(path) as file:
            answers.append([file[name] for name in file.files])
    for other in answers[1:]:
        for mine, theirs in zip(answers[0], other, strict=True):
            np.testing.assert_array_equal(mine, theirs)
