"""The same part read as STEP and as the mesh of it: the mesh rules must find the B-rep's planes again."""

from pathlib import Path

import numpy as np
import pytest

from tanteo.parts import read_part

pytest.importorskip("OCP", reason="the extra tanteo[step] is not installed")

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT.parent / "shared" / "data"
EXAMPLES = sorted((ROOT / "examples" / "parts").glob("*.step"))


def missing(wanted, found, size):
    """Return how many planes of the first have no equal in the second: normal, centroid and extent."""
    rows = [np.c_[p.normals, 100 * p.centroids / size, 100 * np.sqrt(p.areas) / size] for p in (wanted, found)]
    if not len(rows[1]):
        return len(rows[0])
    apart = np.linalg.norm(rows[0][:, None] - rows[1][None], axis=2)
    return int((apart.min(axis=1) > 0.1).sum())


def as_mesh(part, tmp_path, solids):
    file = solids.write_stl(tmp_path / f"{part.name}.stl", 1e3 * part.vertices, part.triangles)
    return read_part(file, unit="mm")


@pytest.mark.parametrize("file", EXAMPLES, ids=lambda file: file.stem)
def test_the_examples_have_the_same_features_as_meshes(file, tmp_path, solids):
    part = read_part(file)
    mesh = as_mesh(part, tmp_path, solids)
    assert missing(part.planes, mesh.planes, part.diagonal) == missing(mesh.planes, part.planes, part.diagonal) == 0
    assert (len(mesh.edges), len(mesh.corners)) == (len(part.edges), len(part.corners))
    np.testing.assert_allclose(np.sort(mesh.edges.lengths), np.sort(part.edges.lengths), atol=1e-7)
    np.testing.assert_allclose(np.sort(mesh.edges.dihedrals), np.sort(part.edges.dihedrals), atol=1e-4)
    assert mesh.symmetry.order == part.symmetry.order
    kinds = [sorted(face.surface for face in p.faces) for p in (part, mesh)]
    assert kinds[0] == kinds[1]


@pytest.mark.slow
@pytest.mark.skipif(not DATA.exists(), reason=f"no shared data at {DATA}")
@pytest.mark.parametrize(
    ("pattern", "step", "most_missed", "most_extra"),
    [("step_confusable/*.step", 15, 0.0, 0.0), ("step_parts/*.st*p", 6, 0.05, 0.003)],
)
def test_real_parts_have_nearly_the_same_planes_as_meshes(pattern, step, most_missed, most_extra, tmp_path, solids):
    planes = missed = extra = 0
    for file in sorted(DATA.glob(pattern))[::step]:
        part = read_part(file)
        mesh = as_mesh(part, tmp_path, solids)
        planes += len(part.planes)
        missed += missing(part.planes, mesh.planes, part.diagonal)
        extra += missing(mesh.planes, part.planes, part.diagonal)
    assert planes > 300
    assert missed <= most_missed * planes
    assert extra <= most_extra * planes
