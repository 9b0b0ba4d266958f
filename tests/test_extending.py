"""What CONTRIBUTING shows works from a package of somebody else's, and its statistics hold."""

from __future__ import annotations

import importlib.util
import json
import os
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import tanteo
from bare_scenes import box_centred_pose, inside, nees, surface_points, touches_of
from tanteo import Action, Session, at_place, plugins, read_part
from tanteo.cli import main
from tanteo.errors import InputError, PartError, PluginError
from tanteo.factors import FreeRays
from tanteo.features import Feature, SharedError, SharedTerm, relate_all
from tanteo.features.constraints import CONSTRAINT_KINDS, PAIR_RELATIONS
from tanteo.features.kinds import KINDS, PLANE
from tanteo.fitting import fit_labelled
from tanteo.fitting.fits import FITS
from tanteo.fitting.localization import RELATIONS, ModelFeature, Pairing, estimate_pose
from tanteo.geometry import SE3
from tanteo.hand import Workspace
from tanteo.io import read_readings
from tanteo.io.logs import FORMATS, register_format
from tanteo.io.readings import FACTORS, read_factor
from tanteo.machines import MachineLimits, SafeMachine, World
from tanteo.machines.address import MACHINES, opened, parse_machine
from tanteo.machines.programs import PROGRAMS, write_program
from tanteo.machines.protocol import RefusedError
from tanteo.parts import Surface
from tanteo.parts.readers import CAD_READERS
from tanteo.planning import POLICIES, Probe, Sensing, begin
from tanteo.planning.candidates import propose
from tanteo.planning.context import DecisionContext
from tanteo.planning.policies import policy_named, register_utility
from tanteo.planning.utility import UTILITIES
from tanteo.plugins import PluginWarning
from tanteo.posterior import identify_points
from tanteo.posterior.proposals import PROPOSERS
from tanteo.sensors import Readings, measure
from tanteo.sensors.presets import NoiseLaw

ROOT = Path(__file__).parents[1]
BLOCK = re.compile(r"^```python\n# (\w+)\.py\n(.*?)^```$", re.DOTALL | re.MULTILINE)


REGISTRIES = (KINDS, FITS, RELATIONS, CONSTRAINT_KINDS, PAIR_RELATIONS, UTILITIES, POLICIES)


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
    place = at_place([part], np.eye(4), np.diag([0.005] * 3 + [0.05] * 3) ** 2)
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
    place = at_place([part], np.eye(4), np.diag([0.005] * 3 + [0.05] * 3) ** 2)
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


# Found by entry point: a folder with modules and the metadata of a distribution, as pip would leave it.

POINTS = {
    "tanteo.cad_readers": {"tri": "trifile:READER"},
    "tanteo.log_formats": {"caliper": "caliper:FORMAT"},
    "tanteo.factors": {"level": "level:read"},
    "tanteo.programs": {"pendant": "pendant:LANGUAGE"},
    "tanteo.machines": {"millbox": "millbox:MACHINE"},
}
ALL = (CAD_READERS, FORMATS, FACTORS, PROGRAMS, MACHINES)


def distribution(folder, modules, points, name="acme-probing"):
    """Write a distribution into a folder of its own, and return that."""
    folder = folder / name
    info = folder / f"{name.replace('-', '_')}-1.0.dist-info"
    info.mkdir(parents=True)
    for module, text in modules.items():
        (folder / f"{module}.py").write_text(text, encoding="utf-8")
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n", encoding="utf-8")
    lines = [
        line for group, found in points.items() for line in (f"[{group}]", *(f"{k} = {v}" for k, v in found.items()))
    ]
    (info / "entry_points.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder


def page_blocks():
    return dict(BLOCK.findall((ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")))


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Put distributions on the path of this process; the test forgets the loaded modules at its end."""
    for registry in (*ALL, PROPOSERS):
        monkeypatch.setattr(registry, "_loaded", {})
    monkeypatch.setattr(plugins, "_WARNED", set())
    before = set(sys.modules)

    def put(modules, points, name="acme-probing"):
        folder = distribution(tmp_path / "site", modules, points, name)
        monkeypatch.syspath_prepend(str(folder))
        return folder

    yield put
    for module in set(sys.modules) - before:
        if str(tmp_path) in str(getattr(sys.modules[module], "__file__", "")):
            del sys.modules[module]


@pytest.fixture
def acme(install):
    """The distribution of the page's blocks, in this process."""
    blocks = page_blocks()
    return install({value.partition(":")[0]: blocks[value.partition(":")[0]] for value in targets()}, POINTS)


def targets():
    return [value for found in POINTS.values() for value in found.values()]


def command(folder, *words, **more):
    """Run the command line in a process of its own, with distributions on its path."""
    paths = [str(folder)] if isinstance(folder, Path) else list(map(str, folder))
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths), **more}
    code = "from tanteo.cli import main; main()"
    return subprocess.run(
        [sys.executable, "-c", code, *map(str, words)], capture_output=True, text=True, env=environment, timeout=120
    )


@pytest.fixture
def here(acme, capsys):
    """The command line in this process, which has the distribution of the page's blocks on its path."""

    def call(*words):
        capsys.readouterr()
        with pytest.raises(SystemExit) as ended:
            main([str(word) for word in words])
        out, err = capsys.readouterr()
        return SimpleNamespace(returncode=ended.value.code or 0, stdout=out, stderr=err)

    return call


def wedge():
    """Return a prism without symmetry [mm]."""
    outline, height = [(0, 0), (60, 0), (45, 40), (0, 40)], 30
    vertices = np.array([(x, y, z) for z in (0, height) for x, y in outline], float)
    faces = [(0, 3, 2, 1), (4, 5, 6, 7), *((i, (i + 1) % 4, 4 + (i + 1) % 4, 4 + i) for i in range(4))]
    return vertices, np.array([t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))])


def write_tri(path, vertices, triangles):
    path.write_text("\n".join(" ".join(f"{v:.9g}" for v in (vertices[t] / 25.4).ravel()) for t in triangles) + "\n")
    return path


def write_caliper(path, points):
    """Points [m] as the arm writes them."""
    rows = ["T " + " ".join(f"{v:.9g}" for v in p / 0.0254) for p in points]
    path.write_text("\n".join(["CALIPER ARM 2", "warm", *rows]) + "\n")
    return path


@pytest.fixture(scope="module")
def touched(tmp_path_factory):
    """Files of one scene: a wedge as .tri, 24 touches of the arm, a level on the part, and where the part is."""
    folder, rng = tmp_path_factory.mktemp("touched"), np.random.default_rng(1991)
    vertices, triangles = wedge()
    write_tri(folder / "wedge.tri", vertices, triangles)
    write_tri(folder / "block.tri", vertices * np.where(vertices[:, :1] == 45, [60 / 45, 1, 1], 1), triangles)
    part = tanteo.part_from_mesh(vertices, triangles, unit="mm")
    points, _ = surface_points(Surface(part.vertices, part.triangles), 24, rng)
    T = SE3.exp(np.array([0.3, -0.1, 0.05, 0.2, -0.1, 0.4]))
    write_caliper(folder / "touches.arm", SE3.apply(T, points) + 1e-4 * rng.normal(size=points.shape))
    (folder / "level.txt").write_text(" ".join(f"{v:.9g}" for v in T[:3, 2]) + " 0.0002\n")
    return folder, T


def identified(out):
    document = json.loads(out)
    best = document["hypotheses"][0]
    return document["status"], best["part"], np.array(best["covariance"]["matrix"])


def test_the_command_line_uses_plug_ins(acme, here, touched):
    folder, _ = touched
    words = ["identify", folder / "touches.arm", "--parts", folder / "wedge.tri", folder / "block.tri", "--sd", "0.1mm"]
    plain = here(*words, "--radius", "0mm", "--json")
    assert plain.returncode == 0, plain.stderr
    assert identified(plain.stdout)[:2] == ("recognized", "wedge")
    assert "1 remarks were skipped." in plain.stderr
    level = here(*words, "--radius", "0mm", "--json", "--factor", f"level={folder / 'level.txt'}")
    assert level.returncode == 0, level.stderr
    assert identified(level.stdout)[:2] == ("recognized", "wedge")
    for k in (3, 4):
        assert identified(level.stdout)[2][k, k] < 0.5 * identified(plain.stdout)[2][k, k]
    without = command([], *words, "--radius", "0mm")
    assert without.returncode in (1, 2)
    assert "expected one of .step, .stp" in without.stderr or "expected" in without.stderr


def test_the_interface_uses_them_too(acme, touched):
    folder, T = touched
    parts = tanteo.read_parts([folder / "wedge.tri", folder / "block.tri"])
    assert parts.failures == ()
    assert [part.unit for part in parts] == ["in", "in"]
    assert tanteo.read_part(folder / "wedge.tri").volume == pytest.approx(parts["wedge"].volume)
    assert {part.name for part in tanteo.read_parts(folder)} == {"wedge", "block"}
    readings = tanteo.read_readings(folder / "touches.arm", radius=0.0)
    answer = tanteo.identify(readings, parts, sd=1e-4, factors=[read_factor("level", folder / "level.txt")])
    assert (answer.status, answer.best.part) == ("recognized", "wedge")
    error = SE3.log(SE3.inverse(answer.pose) @ T)
    assert error @ np.linalg.solve(answer.covariance, error) < 25


def test_cached_parts_are_read_again_when_the_reader_changes(acme, touched, tmp_path, monkeypatch):
    monkeypatch.setenv("TANTEO_CACHE", str(tmp_path / "cache"))
    folder, _ = touched
    first = tanteo.read_parts(folder / "wedge.tri")["wedge"]
    entries = set((tmp_path / "cache").rglob("*.part"))
    assert len(entries) == 1
    tanteo.read_parts(folder / "wedge.tri")
    assert set((tmp_path / "cache").rglob("*.part")) == entries
    # another length, too: bytecode of the same second and length would count as that of the new text
    (acme / "trifile.py").write_text((acme / "trifile.py").read_text().replace('unit="in"', 'unit="cm" '))
    second = tanteo.read_parts(folder / "wedge.tri", workers=1)["wedge"]
    assert second.volume == pytest.approx(first.volume / 2.54**3)


def test_a_damaged_file_of_a_plug_in_is_one_sentence(acme, tmp_path):
    (tmp_path / "bad.tri").write_text("1 2 3 four\n")
    write_tri(tmp_path / "good.tri", *wedge())
    parts = tanteo.read_parts(tmp_path)
    assert [part.name for part in parts] == ["good"]
    assert parts.failures[0].reason == "bad.tri: expected nine numbers a line, got others. Export it again."
    (tmp_path / "nan.tri").write_text("0 0 0 1 0 0 0 1 nan\n")
    with pytest.raises(PartError, match="expected finite coordinates"):
        tanteo.read_part(tmp_path / "nan.tri")


def test_a_format_of_ones_own_is_recognised(acme, tmp_path):
    path = tmp_path / "arm.txt"
    path.write_text("CALIPER ARM 2\nT 1 2 3\nwarm\nT 4 5 6\n")
    with pytest.raises(InputError, match=r"expected --radius with a log of the caliper arm.*--radius 1\.5mm"):
        read_readings(path)
    readings = read_readings(path, radius=0.001)
    np.testing.assert_allclose(readings.points, np.array([[1, 2, 3], [4, 5, 6]]) * 0.0254)
    assert readings.notes == ("1 remarks were skipped.",)
    assert len(read_readings(path, radius=0.001, format="caliper")) == 2
    with pytest.raises(InputError, match="which is taken"):
        register_format(FORMATS.builtin["grbl"])
    with pytest.raises(InputError, match="which is taken"):
        register_format(FORMATS.find("caliper"))


def test_a_format_is_registered_in_one_process(added, tmp_path, monkeypatch):
    monkeypatch.setattr(FORMATS, "registered", {})
    path = tmp_path / "arm.txt"
    path.write_text("CALIPER ARM 2\nT 1 2 3\n")
    register_format(added["caliper"].FORMAT)
    assert len(read_readings(path, radius=0.001)) == 1


def test_a_plan_is_written_in_a_language_of_ones_own(here, touched):
    folder, _ = touched
    words = ["plan", "--part", folder / "wedge.tri", "--goal", "0.5mm", "--sd", "0.05mm", "--tip-radius", "1mm"]
    words += ["--pose-prior", "0,0,0mm 0,0,0deg +- 1mm 1deg"]
    found = here(*words, "--program", "pendant")
    assert found.returncode == 0, found.stderr
    lines = found.stdout.splitlines()
    assert lines[0].startswith("; wedge: ")
    touches = [line for line in lines if line.startswith("TOUCH ")]
    assert len(touches) >= 6
    for line in touches:  # from above or from the side
        start, stop = (np.array(part.split(), float) for part in line[6:].partition(" SPEED ")[0].split(" TO "))
        assert stop[2] <= start[2] + 1e-6
    assert "pendant" in here(*words, "--program", "pendent").stderr


@pytest.mark.slow
def test_a_machine_of_ones_own_places_a_part(here, touched, tmp_path):
    folder, _ = touched
    words = ["probe", "--machine", "fake:millbox", "--part", folder / "wedge.tri", "--goal", "0.3mm"]
    found = here(*words, "--record", tmp_path / "run.json", "--json")
    assert found.returncode == 0, found.stderr
    document = json.loads(found.stdout)
    assert document["status"] == "recognized"
    assert document["sensing"]["reached"]
    assert parse_machine("millbox://192.168.0.7").ports == ()
    assert parse_machine("millbox://192.168.0.7:99").ports == (99,)
    with pytest.raises(InputError, match="expected an address"):
        parse_machine("millbox:/dev/ttyUSB0")


def test_a_custom_machine_respects_the_limits(acme):
    there = World(Surface(*wedge_in_metres()), np.eye(4), 1e-3)
    with opened(parse_machine("fake:millbox"), there, np.array([0.02, 0.02, 0.1])) as driver:
        safe = SafeMachine(driver, MachineLimits(Workspace(np.zeros(3), np.full(3, 0.2)), 1e-3))
        with pytest.raises(RefusedError):
            safe.move(SE3.from_parts(np.diag([1.0, -1.0, -1.0]), np.array([0.02, 0.02, 0.3])))
        safe.move(SE3.from_parts(np.diag([1.0, -1.0, -1.0]), np.array([0.02, 0.02, 0.06])))
        assert safe.sense(np.array([0.0, 0.0, -1.0]), 0.05).distance == pytest.approx(0.029, abs=1e-5)


def wedge_in_metres():
    vertices, triangles = wedge()
    return 1e-3 * vertices, triangles


@pytest.mark.slow
def test_the_conformance_suite_runs_on_a_driver_of_ones_own(acme):
    environment = {**os.environ, "PYTHONPATH": str(acme), "TANTEO_DRIVERS": "fake:millbox"}
    suite = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-rA",
        "-p",
        "no:cacheprovider",
        "tests/machines/test_conformance.py",
    ]
    found = subprocess.run(suite, cwd=ROOT, capture_output=True, text=True, env=environment, timeout=240)
    assert found.returncode == 0, found.stdout[-2000:]
    assert found.stdout.count("[fake:millbox]") > 12
    assert "fake:direct" not in found.stdout


# Plug-ins that do not work.

BROKEN = "import nothing_of_this_name\n"


def touched_wedge():
    """Return a wedge and contact points on it."""
    part = tanteo.part_from_mesh(*wedge(), unit="mm")
    p, _ = surface_points(Surface(part.vertices, part.triangles), 16, np.random.default_rng(3))
    return part, touches_of(p, 1e-4)


def test_a_proposer_of_ones_own_takes_part(install, monkeypatch):
    install({"quarter": page_blocks()["quarter"]}, {"tanteo.proposals": {"quarter": "quarter:PROPOSER"}})
    part, points = touched_wedge()
    proposer, rounds = PROPOSERS.find("quarter"), []
    own = type(proposer).propose

    def propose(self, problem, part, state):
        found = own(self, problem, part, state)
        rounds.append((state.round, len(found), len(state.best)))
        return found

    monkeypatch.setattr(type(proposer), "propose", propose)
    answer = identify_points(points, FreeRays.none(), [part])
    assert answer.status == "recognized"
    assert np.linalg.norm(SE3.log(answer.pose)[:3]) < 1e-3
    assert [number for number, _, _ in rounds] == list(range(len(rounds)))
    assert rounds[0][1] == 6 * min(rounds[0][2], 3) > 0


@pytest.mark.parametrize(
    ("body", "got"),
    [("return 5", "TypeError: expected InitialPoses, got int"), ("raise KeyError('no axis')", "KeyError: 'no axis'")],
)
def test_a_proposer_that_fails_is_named(install, body, got, request):
    module = "failing_" + request.node.callspec.id.encode().hex()[:20]
    text = (
        "from tanteo.posterior.proposals import Proposer\nclass Own(Proposer):\n    name = 'own'\n"
        f"    def propose(self, problem, part, state):\n        {body}\nPROPOSER = Own()\n"
    )
    install({module: text}, {"tanteo.proposals": {"own": f"{module}:PROPOSER"}}, "own-kit")
    part, points = touched_wedge()
    with pytest.raises(PluginError, match=re.escape("own-kit 1.0, entry point 'own = ")) as error:
        identify_points(points, FreeRays.none(), [part])
    assert got in str(error.value)


def test_an_import_error_is_named_where_the_plug_in_is_used(install, tmp_path):
    points = {group: {f"bad{k}": "broken_one:ITEM"} for k, group in enumerate(POINTS)}
    install({"broken_one": BROKEN}, points, "broken-kit")
    text = (
        r"^broken-kit 1\.0, entry point 'bad{k} = broken_one:ITEM' of {group}: expected a plug-in that can be "
        r"imported, got ModuleNotFoundError: No module named 'nothing_of_this_name'\. Repair or uninstall it\.$"
    )
    (tmp_path / "a.bad0").write_text("x")
    calls = {
        0: lambda: tanteo.read_part(tmp_path / "a.bad0"),
        1: lambda: tanteo.read_readings(tmp_path / "a.bad0", format="bad1"),
        2: lambda: read_factor("bad2", tmp_path / "a.bad0"),
        3: lambda: write_program("bad3", None),
        4: lambda: parse_machine("bad4://here"),
    }
    for k, group in enumerate(POINTS):
        for _ in range(2):  # the second time, too
            with pytest.raises(PluginError, match=text.format(k=k, group=re.escape(group))):
                calls[k]()
    assert tanteo.read_parts(tmp_path / "a.bad0").failures[0].reason.startswith("broken-kit 1.0, entry point")


@pytest.mark.slow
def test_the_rest_works_beside_a_broken_plug_in(install, tmp_path):
    points = {group: {"zzz": "broken_two:ITEM"} for group in POINTS}
    folder = install({"broken_two": BROKEN}, points, "broken-kit-2")
    np.savetxt(tmp_path / "points.xyz", np.random.default_rng(0).random((9, 3)))
    with pytest.warns(PluginWarning, match=r"broken-kit-2 1\.0, entry point 'zzz = broken_two:ITEM'") as warned:
        assert len(tanteo.read_readings(tmp_path / "points.xyz", unit="mm")) == 9
    assert len(warned) == 1
    assert parse_machine("grbl://h").kind == "grbl"
    found = command(folder, "doctor")
    assert found.returncode == 0, found.stderr
    assert found.stdout.count("got ModuleNotFoundError: No module named 'nothing_of_this_name'") == 5
    document = json.loads(command(folder, "doctor", "--json").stdout)
    assert [plugin["name"] for plugin in document["plugins"]] == ["zzz"] * 5
    (tmp_path / "wedge.off").write_text(off(*wedge()))
    found = command(
        folder, "identify", tmp_path / "points.xyz", "--units", "mm", "--sd", "1mm", "--parts", tmp_path / "wedge.off"
    )
    assert found.returncode in (0, 3)
    assert found.stderr.count("warning: broken-kit-2 1.0, entry point") == 1
    assert "Traceback" not in found.stderr


def off(vertices, triangles):
    rows = [f"OFF\n{len(vertices)} {len(triangles)} 0", *(" ".join(map(str, v)) for v in vertices.tolist())]
    return "\n".join([*rows, *(f"3 {a} {b} {c}" for a, b, c in triangles.tolist())]) + "\n"


@pytest.mark.parametrize(
    ("text", "got"),
    [
        ("ITEM = 5\n", "got one of type int"),
        ("raise SystemExit('stop')\n", "got SystemExit: stop"),
        ("", "got AttributeError: module 'wrong_{k}' has no attribute 'ITEM'"),
        ("ITEM = 1/0\n", "got ZeroDivisionError: division by zero"),
        ("def (\n", "got SyntaxError"),
    ],
)
def test_what_is_no_entry_is_refused(install, text, got, request):
    k = request.node.callspec.id.encode().hex()[:40]
    points = {group: {"odd": f"wrong_{k}:ITEM"} for group in POINTS}
    install({f"wrong_{k}": text}, points, "wrong-kit")
    for registry in ALL:
        with pytest.raises(PluginError, match=re.escape(got.format(k=k))) as raised:
            registry.find("odd")
        assert str(raised.value).startswith(f"wrong-kit 1.0, entry point 'odd = wrong_{k}:ITEM' of {registry.group}")


def test_a_name_that_is_built_in_stays_built_in(install, tmp_path):
    text = (
        "from tanteo.io.logs import Log, LogFormat\nfrom tanteo.parts.readers import CadReader\n"
        "READER = CadReader('mine', None)\nFORMAT = LogFormat('asc', 'mine', lambda c: True, lambda c: Log())\n"
    )
    points = {"tanteo.cad_readers": {"off": "clash:READER"}, "tanteo.log_formats": {"asc": "clash:FORMAT"}}
    folder = install({"clash": text}, points, "clash-kit")
    (tmp_path / "wedge.off").write_text(off(*wedge()))
    assert len(tanteo.read_part(tmp_path / "wedge.off", unit="mm").planes) == 6
    np.savetxt(tmp_path / "points.xyz", np.random.default_rng(0).random((9, 3)))
    with pytest.warns(PluginWarning, match="expected a new name, got that of a built-in one, which is used"):
        assert len(tanteo.read_readings(tmp_path / "points.xyz", unit="mm")) == 9
    assert "clash" not in sys.modules
    found = command(folder, "doctor")
    assert found.stdout.count("got that of a built-in one, which is used. Rename the entry point.") == 2


def test_two_plug_ins_of_one_name_are_named_both(install):
    for name in ("first-kit", "second-kit"):
        install({f"{name[:5]}_m": "READER = 1\n"}, {"tanteo.cad_readers": {"dup": f"{name[:5]}_m:READER"}}, name)
    with pytest.raises(PluginError, match=r"expected one plug-in, got those of .*-kit 1\.0 and .*-kit 1\.0"):
        CAD_READERS.find("dup")


def test_a_format_is_named_as_its_entry_point(install):
    named = "FORMAT = LogFormat('other', 'x', lambda c: False, lambda c: Log())\n"
    text = f"from tanteo.io.logs import Log, LogFormat\n{named}"
    install({"othername": text}, {"tanteo.log_formats": {"this": "othername:FORMAT"}}, "name-kit")
    with pytest.raises(PluginError, match="expected an entry of the same name, got 'other'"):
        FORMATS.find("this")


FAILING = """
from pathlib import Path

import numpy as np

import tanteo
from tanteo.io.logs import Log, LogFormat
from tanteo.machines.address import MachineKind
from tanteo.parts.readers import CadMesh, CadReader
from tanteo.machines.programs import ProgramLanguage


def fail(*args, **more):
    raise KeyError("inner")


READER = CadReader("x", fail)
SHAPE = CadReader("x", lambda path: CadMesh(np.zeros((3, 2)), [[0, 1, 2]], "mm"))
ITEM = CadReader("x", lambda path: 5)
RECOGNISE = LogFormat("recognise", "x", fail, fail)
READ = LogFormat("read", "x", lambda c: False, fail)
NOLOG = LogFormat("nolog", "x", lambda c: False, lambda c: None)
RAGGED = LogFormat("ragged", "x", lambda c: False, lambda c: Log(points=np.zeros((4, 2)), unit="mm"))
LANGUAGE = ProgramLanguage(fail)
NOTEXT = ProgramLanguage(lambda job: b"bytes")
MACHINE = MachineKind((1,), False, False, fail, fail)
NODRIVER = MachineKind((1,), False, False, lambda address: object())


def factor(path):
    return tanteo.PythonFactor(name="dense", log_density=fail)


def nofactor(path):
    return 5
"""


def test_what_fails_later_is_named_too(install, tmp_path):
    points = {
        "tanteo.cad_readers": {"keyed": "failing:READER", "shape": "failing:SHAPE", "thing": "failing:ITEM"},
        "tanteo.log_formats": {k: f"failing:{k.upper()}" for k in ("recognise", "read", "nolog", "ragged")},
        "tanteo.factors": {"fail": "failing:fail", "factor": "failing:factor", "nofactor": "failing:nofactor"},
        "tanteo.programs": {"lang": "failing:LANGUAGE", "notext": "failing:NOTEXT"},
        "tanteo.machines": {"machine": "failing:MACHINE", "nodriver": "failing:NODRIVER"},
    }
    folder = install({"failing": FAILING}, points, "failing-kit")
    for suffix in ("keyed", "shape", "thing"):
        (tmp_path / f"a.{suffix}").write_text("x")
    inner = r"^failing-kit 1\.0, entry point .*got KeyError: 'inner'\. Repair or uninstall it\.$"
    with pytest.raises(PluginError, match=inner):
        tanteo.read_part(tmp_path / "a.keyed")
    with pytest.raises(PartError, match=r"a\.shape: expected vertices \(V, 3\), got shape \(3, 2\)"):
        tanteo.read_part(tmp_path / "a.shape")
    with pytest.raises(PluginError, match=r"expected a CadMesh of a\.thing, got int"):
        tanteo.read_part(tmp_path / "a.thing")
    np.savetxt(tmp_path / "points.xyz", np.random.default_rng(0).random((9, 3)))
    with pytest.warns(PluginWarning, match=r"expected contents to be recognised, got KeyError"):
        assert len(tanteo.read_readings(tmp_path / "points.xyz", unit="mm")) == 9
    with pytest.raises(PluginError, match=inner):
        tanteo.read_readings(tmp_path / "points.xyz", format="read")
    with pytest.raises(PluginError, match=r"expected a Log of .*, got NoneType"):
        tanteo.read_readings(tmp_path / "points.xyz", format="nolog")
    with pytest.raises((PluginError, InputError)):
        tanteo.read_readings(tmp_path / "points.xyz", format="ragged")
    with pytest.raises(PluginError, match=inner):
        read_factor("fail", tmp_path / "points.xyz")
    with pytest.raises(PluginError, match=r"expected a PoseFactor of .*, got int"):
        read_factor("nofactor", tmp_path / "points.xyz")
    part = tanteo.part_from_mesh(*wedge(), unit="mm")
    points = np.random.default_rng(3).uniform(0, 0.03, (12, 3)) * [1, 1, 0]
    readings = tanteo.Readings.from_columns(points, sds=np.full(12, 1e-4))
    with pytest.raises(PluginError, match=r"expected the factor 'dense' to be evaluated, got KeyError: 'inner'"):
        tanteo.identify(readings, [part], factors=[read_factor("factor", tmp_path / "points.xyz")])
    job = SimpleNamespace(touches=())
    with pytest.raises(PluginError, match=inner):
        write_program("lang", job)
    with pytest.raises(PluginError, match="expected a program as text, got bytes"):
        write_program("notext", job)
    for url, text in (("machine://h", inner), ("nodriver://h", "expected a Machine with all its methods, got object")):
        with pytest.raises(PluginError, match=text), opened(parse_machine(url)):
            pass
    there = World(Surface(*wedge_in_metres()), np.eye(4), 1e-3)
    with pytest.raises(PluginError, match=inner), opened(parse_machine("fake:machine"), there, np.zeros(3)):
        pass
    with pytest.raises(InputError, match="expected a kind with a fake"):
        parse_machine("fake:nodriver")
    found = command(folder, "part", "show", tmp_path / "a.keyed")
    assert found.returncode == 1
    assert found.stderr.startswith("error: failing-kit 1.0, entry point 'keyed = failing:READER' of tanteo.cad_readers")
    assert "Traceback" not in found.stderr


@pytest.mark.parametrize(
    ("word", "text"),
    [
        ("level", "as NAME=FILE"),
        ("level=", "as NAME=FILE"),
        ("level=nowhere.txt", "which does not exist"),
        ("levle={file}", "Did you mean 'level'?"),
    ],
)
def test_factors_that_cannot_be_meant_are_refused(here, touched, word, text):
    folder, _ = touched
    words = ["identify", folder / "touches.arm", "--parts", folder / "wedge.tri", "--sd", "0.1mm", "--radius", "0mm"]
    found = here(*words, "--factor", word.format(file=folder / "level.txt"))
    assert found.returncode in (1, 2)
    assert text in found.stderr
    assert "Traceback" not in found.stderr


def test_without_plug_ins_a_factor_names_what_is_missing(tmp_path):
    (tmp_path / "level.txt").write_text("0 0 1 0.1")
    with pytest.raises(InputError, match="expected a plug-in that reads factors to be installed, got 'level'"):
        read_factor("level", tmp_path / "level.txt")


def test_nothing_is_imported_before_it_is_used(acme, touched):
    folder, _ = touched
    code = (
        "import sys, tanteo, tanteo.parts, tanteo.machines, tanteo.io\n"
        "tanteo.machines.address.MACHINES, tanteo.parts.readers.CAD_READERS.names()\n"
        f"tanteo.read_parts({str(folder / 'wedge.tri')!r}, cache=False, workers=0)\n"
        "print([m for m in ('trifile', 'caliper', 'level', 'pendant', 'millbox') if m in sys.modules])\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(acme)}
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=True)
    assert found.stdout.strip() == "['trifile']"
    code = (
        "import sys, tanteo.cli.app, tanteo.parts\ntanteo.parts.readers.CAD_READERS.find('stl')\n"
        "print('importlib.metadata' in sys.modules)"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=True)
    assert found.stdout.strip() == "False"
