"""What CONTRIBUTING shows works from a package of somebody else's, and its statistics hold."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

import numpy as np
import pytest

from bare_scenes import box_centred_pose, inside, nees, surface_points
from tanteo import Action, Session, around, read_part
from tanteo.active import POLICIES, UTILITIES, DecisionContext, Probe, begin, policy_named, propose, register_utility
from tanteo.constraints import CONSTRAINT_KINDS, PAIR_RELATIONS, relate_all
from tanteo.errors import InputError
from tanteo.features import KINDS, PLANE, Feature, SharedError, SharedTerm
from tanteo.fitting import FITS, fit_labelled
from tanteo.inference import identify_points
from tanteo.io import read_readings
from tanteo.lie import SE3
from tanteo.localization import RELATIONS, ModelFeature, Pairing, estimate_pose
from tanteo.logs import FORMATS, register_format
from tanteo.measurements import FreeRays
from tanteo.sensors import NoiseLaw, Readings, measure
from tanteo.session import Sensing
from tanteo.shapes import Surface

ROOT = Path(__file__).parents[1]
BLOCK = re.compile(r"^```python\n# (\w+)\.py\n(.*?)^```$", re.DOTALL | re.MULTILINE)


REGISTRIES = (KINDS, FITS, RELATIONS, CONSTRAINT_KINDS, PAIR_RELATIONS, UTILITIES, POLICIES, FORMATS)


@pytest.fixture
def added(tmp_path, monkeypatch):
    """Modules of the page's blocks, by name; what they register is forgotten after the test."""
    for registry in REGISTRIES:
        for name, entry in registry.items():
            monkeypatch.setitem(registry, name, list(entry) if isinstance(entry, list) else entry)
    known = [set(registry) for registry in REGISTRIES]
    yield import_blocks(tmp_path)
    for registry, names in zip(REGISTRIES, known, strict=True):
        for name in set(registry) - names:
            del registry[name]


def import_blocks(tmp_path):
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


CENTRES = np.array([[0.0, 0.0, 0.0], [0.2, 0.0, 0.0], [0.0, 0.15, 0.05]])


def felt_balls(rng, T, sd, spoiled=()):
    """Points on three reference balls; those of these rows are a centimetre off."""
    out = rng.normal(size=(3, 12, 3))
    out *= 0.02 / np.linalg.norm(out, axis=-1, keepdims=True)
    points = SE3.apply(T, (CENTRES[:, None] + out).reshape(-1, 3)) + sd * rng.normal(size=(36, 3))
    points[list(spoiled)] += 0.01
    labels = np.repeat(["ball 1", "ball 2", "ball 3"], 12).tolist()
    return measure(Readings.from_columns(points, sds=np.full(36, sd), features=labels, kinds=["ball"] * 36))


def test_a_kind_of_feature_of_ones_own_gives_a_calibrated_pose(added):
    BALL, sd, values = added["balls"].BALL, 1e-4, []
    models = [ModelFeature(BALL, SE3.from_parts(np.eye(3), c)) for c in CENTRES]
    for seed in range(60):
        rng = np.random.default_rng((334, seed))
        T = SE3.exp(np.r_[rng.uniform(-1, 1, 3), rng.normal(size=3)])
        fitted = fit_labelled(felt_balls(rng, T, sd))
        assert [f.kind for f in fitted.features] == [BALL] * 3
        column = relate_all(fitted.features).column("point_distance")
        lengths = [np.linalg.norm(CENTRES[i] - CENTRES[j]) for i, j in column.pairs]
        np.testing.assert_allclose(column.value[:, 0], lengths, atol=8e-4)
        got = estimate_pose([Pairing(f, m) for f, m in zip(fitted.features, models, strict=True)])
        e = SE3.log(SE3.inverse(got.T_world_part) @ T)
        values.append(e @ np.linalg.solve(got.covariance, e))
    assert inside(np.sum(values), 6 * len(values), level=0.9995)
    assert not inside(np.sum(values), 6 * len(values), level=0.0005)


def test_a_wrong_reading_of_a_kind_of_ones_own_is_named(added):
    rng = np.random.default_rng(1991)
    measured = felt_balls(rng, np.eye(4), 1e-4, spoiled=[14])
    assert fit_labelled(measured).rejected == (measured.ids[14],)


def test_a_relation_of_ones_own_is_calibrated(added):
    """Planes that are square are refused as often as stated; what moves both of them together does not count."""
    rng, rejected, trials = np.random.default_rng(334), 0, 2000
    base = SharedError("base", 1e-2 * np.eye(6))
    P = np.diag([1e-4, 1e-3, 2e-3]) ** 2
    turn = SE3.exp(np.array([0.1, 0.2, 0.3, np.pi / 2, 0.0, 0.0]))
    for _ in range(trials):
        T = SE3.exp(rng.normal(size=6))
        planes = []
        for exact in (T, T @ turn):
            sensed = exact @ SE3.exp(PLANE.B.T @ np.linalg.cholesky(P) @ rng.normal(size=3))
            shared = (SharedTerm(base, PLANE.B @ SE3.adjoint_inverse(sensed)),)
            planes.append(Feature(PLANE, sensed, P, shared=shared))
        (found,) = (c for c in relate_all(planes) if c.kind.name == "plane_squareness")
        rejected += found.p_value() < 0.05
    assert abs(rejected - 0.05 * trials) < 3.3 * np.sqrt(0.05 * 0.95 * trials)
    parallel = relate_all([Feature(PLANE, np.eye(4), P), Feature(PLANE, np.eye(4), P)])
    assert not parallel.column("plane_squareness").present.any()


def test_a_utility_of_ones_own_chooses(added, part):
    place = around([part], np.eye(4), np.diag([0.005] * 3 + [0.05] * 3) ** 2)
    laser = Probe("laser", NoiseLaw.of(3e-4), max_range=0.4, standoff=0.15)
    state = begin(place)
    context = DecisionContext(state, propose(state, laser, 300), laser, None, None, 0, 0)
    seen = []
    register_utility("seen", lambda ahead: seen.append(ahead) or added["upright"].upright(ahead))
    plain, chosen, same = (policy_named(name).choose(context) for name in ("information", "upright", "seen"))
    cosines = seen[0].predicted.cosines @ seen[0].samples.weights
    assert chosen == same
    assert chosen.gain < plain.gain
    assert cosines[chosen.index] > cosines[plain.index]
    session = Session(place, laser, Sensing(sd=3e-4), policy=policy_named("upright"))
    surface, to_part = Surface(part.vertices, part.triangles), SE3.inverse(place.Ts[0])
    for _ in range(2):
        action = session.ask()
        origin, along = SE3.apply(to_part, action.origin), to_part[:3, :3] @ action.direction
        hit = surface.cast(origin[None], along[None])
        session.tell(action.read(float(hit.distances[0])))
    assert session.count == 2


def test_a_format_of_ones_own_is_recognised_and_read(added, tmp_path):
    path = tmp_path / "arm.txt"
    path.write_text("CALIPER ARM 2\nT 1 2 3\nwarm\nT 4 5 6\n")
    with pytest.raises(InputError, match=r"expected --radius with a log of the caliper arm.*--radius 1\.5mm"):
        read_readings(path)
    readings = read_readings(path, radius=0.001)
    np.testing.assert_allclose(readings.points, np.array([[1, 2, 3], [4, 5, 6]]) * 0.0254)
    assert readings.notes == ("1 remarks were left out.",)
    with pytest.raises(InputError, match="which is taken"):
        register_format(FORMATS["grbl"])
