"""Check the installation: installed distributions, missing extras, plug-ins, and a self-test.

This module imports optional distributions only when it checks them, so that it also works in a broken installation.
"""

from __future__ import annotations

import platform
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module, metadata, util
from pathlib import Path
from typing import TYPE_CHECKING

from tanteo.errors import TanteoError

if TYPE_CHECKING:
    from tanteo.geometry.typing import Transforms
    from tanteo.parts import Part
    from tanteo.posterior import Answer, Hypothesis
    from tanteo.sensors import Readings

NEEDED = (
    "numpy",
    "scipy",
    "libigl",
    "embreex",
    "manifold3d",
    "trimesh",
    "lazy-loader",
    "lxml",
    "networkx",
    "msgspec",
    "typer",
    "rich",
)
"""Required distributions."""

EXTRAS = {
    "step": ("OCP", "STEP files, with exact faces and edges"),
    "plot": ("matplotlib", "pictures of sensors and calibrations (--picture)"),
    "vision": ("cv2", "parts in images (tanteo see)"),
    "viewer": ("viser", "the live page (tanteo view)"),
    "machines": ("serial", "machines on a serial port (tanteo probe)"),
    "bags": ("rosbags", "recordings of ROS, sessions as MCAP"),
    "urdf": ("xacro", "rigs from xacro files (--rig robot.xacro#link)"),
    "ros": ("rclpy", "a node of ROS 2 (tanteo ros)"),
    "sim": ("mujoco", "a robot arm in the simulator (tanteo sense part --cell)"),
    "arms": ("example_robot_data", "models of further arms (tanteo sense part --cell)"),
    "cluster": ("distributed", "work spread over many machines (--scheduler)"),
}
"""Module and purpose of each extra."""

SD = 5e-5
"""Standard deviation of the touches in the self-test [m]."""

_FAR = 4.0
"""Error in standard deviations above which the pose of the self-test is wrong."""


@dataclass(frozen=True, slots=True)
class Extra:
    """Optional dependency of tanteo.

    Attributes:
        name: name in ``pip install -e '.[name]'``.
        gives: features that need it.
        installed: whether it is installed.
    """

    name: str
    gives: str
    installed: bool


REGISTRIES = (
    "tanteo.parts.readers:CAD_READERS",
    "tanteo.posterior.proposals:PROPOSERS",
    "tanteo.io.logs:FORMATS",
    "tanteo.io.readings.factor_file:FACTORS",
    "tanteo.machines.programs:PROGRAMS",
    "tanteo.machines.address:MACHINES",
)
"""Registries that plug-ins add to, as module and attribute."""


@dataclass(frozen=True, slots=True)
class FoundPlugin:
    """Plug-in of another distribution.

    Attributes:
        group: group of its entry point.
        name: name of its entry point.
        distribution: name and version of the distribution.
        problem: reason for which it is not used; empty if it works.
    """

    group: str
    name: str
    distribution: str
    problem: str


@dataclass(frozen=True, slots=True)
class SelfTest:
    """Result of the self-test: recognition of a wedge from 24 simulated touches, with a block as alternative.

    Attributes:
        ok: whether the wedge was recognized at its pose.
        words: result as text.
        seconds: duration, including the reading of the parts [s].
    """

    ok: bool
    words: str
    seconds: float


@dataclass(frozen=True, slots=True)
class Examination:
    """Result of a check of the installation.

    Attributes:
        python: versions of Python and of the system.
        versions: versions of the required distributions; empty for a missing one.
        extras: optional dependencies.
        plugins: plug-ins of other distributions.
        cache: folder of the parts cache, and whether it can be written.
        test: result of the self-test.
    """

    python: str
    versions: dict[str, str]
    extras: tuple[Extra, ...]
    plugins: tuple[FoundPlugin, ...]
    cache: tuple[str, bool]
    test: SelfTest

    @property
    def ok(self) -> bool:
        """Whether all required distributions are installed and the self-test passed."""
        return all(self.versions.values()) and self.test.ok


def examine() -> Examination:
    """Check the installation; this takes about a second."""
    extras = (Extra(name, gives, util.find_spec(module) is not None) for name, (module, gives) in EXTRAS.items())
    python = f"{platform.python_version()}, {platform.system()} {platform.machine()}"
    versions = {n: _version(n) for n in NEEDED}
    return Examination(python, versions, tuple(extras), find_plugins(), _cache(), run_self_test())


def find_plugins() -> tuple[FoundPlugin, ...]:
    """Return all plug-ins of other distributions; this imports each."""
    found = list[FoundPlugin]()
    for place in REGISTRIES:
        module, _, name = place.partition(":")
        try:
            registry = getattr(import_module(module), name)
        except ImportError:  # a required distribution is missing, which the versions show
            continue
        found += [FoundPlugin(p.group, p.name, p.distribution, registry.problem(p)) for p in registry.plugins()]
    return tuple(found)


def run_self_test() -> SelfTest:
    """Write two parts, simulate touches on one of them, and recognize it."""
    start = time.perf_counter()
    try:
        ok, words = _recognize_wedge()
    except (TanteoError, ImportError) as error:
        ok, words = False, str(error)
    return SelfTest(ok, words, time.perf_counter() - start)


def _recognize_wedge() -> tuple[bool, str]:
    import numpy as np

    from tanteo.geometry import SE3, SO3
    from tanteo.recognition import identify

    with tempfile.TemporaryDirectory() as folder:
        wedge = _prism(Path(folder) / "wedge.off", [(0, 0), (60, 0), (45, 40), (0, 40)], 30)
        block = _prism(Path(folder) / "block.off", [(0, 0), (60, 0), (60, 40), (0, 40)], 30)
    truth = SE3.from_parts(SO3.exp(np.array([0.1, -0.2, 0.7])), np.array([0.4, -0.13, 0.05]))
    return _judge(identify(_touches(wedge, truth), [block, wedge]), truth)


def _judge(answer: Answer, truth: Transforms) -> tuple[bool, str]:
    if answer.status != "recognized" or answer.hypotheses[0].part != "wedge":
        return False, f"expected the wedge, got {answer.status}: {answer.message}"
    best = answer.hypotheses[0]
    far, off = _off(best, truth)
    words = f"wedge recognized, {1e3 * off:.2g} mm off where {1e3 * best.corner_sd:.2g} mm are stated"
    return far < _FAR, words


def _off(best: Hypothesis, truth: Transforms) -> tuple[float, float]:
    """Return the error of the pose in standard deviations for each direction, and that of the position [m]."""
    import numpy as np

    from tanteo.geometry import SE3

    xi = SE3.log(SE3.inverse(best.T_world_part) @ truth)
    return float(np.sqrt(xi @ np.linalg.solve(best.covariance, xi) / 6)), float(np.linalg.norm(xi[:3]))


def _touches(part: Part, T_world_part: Transforms) -> Readings:
    """Return four labelled touches on every face, with noise from a fixed seed."""
    import numpy as np

    from tanteo.geometry import SE3
    from tanteo.sensors import Readings

    rng = np.random.default_rng(1991)
    points, labels = [], []
    for k, face in enumerate(part.planes.faces):
        corners = part.vertices[np.unique(part.triangles[part.triangle_face == face])]
        middle = corners.mean(axis=0)
        points.append(middle + 0.8 * (corners[:4] - middle) + SD * rng.normal(size=(4, 1)) * part.planes.normals[k])
        labels += [f"side {k}"] * 4
    normals = np.repeat(part.planes.normals, 4, axis=0) @ T_world_part[:3, :3].T
    return Readings.from_columns(
        points=SE3.apply(T_world_part, np.concatenate(points)), directions=-normals, sds=np.full(len(labels), SD),
        features=labels, kinds=["plane"] * len(labels), source="self-test",
    )  # fmt: skip


def _prism(path: Path, corners: Sequence[tuple[float, float]], height: float) -> Part:
    """Write a right prism over four corners [mm] to a file, and read it as a part."""
    from tanteo.parts import read_part

    vertices = [(x, y, z) for z in (0, height) for x, y in corners]
    faces = [(0, 3, 2, 1), (4, 5, 6, 7), *((i, (i + 1) % 4, 4 + (i + 1) % 4, 4 + i) for i in range(4))]
    triangles = [t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))]
    lines = ["OFF", f"{len(vertices)} {len(triangles)} 0"]
    lines += [" ".join(map(str, p)) for p in vertices] + [" ".join(map(str, (3, *t))) for t in triangles]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return read_part(path, unit="mm")


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return ""


def _cache() -> tuple[str, bool]:
    """Return the folder of the parts cache, and whether it, or its nearest existing parent, is writable."""
    try:
        from tanteo.catalogue.cache import cache_folder
    except ImportError:
        return "", False
    folder = cache_folder()
    there = next(p for p in (folder, *folder.absolute().parents) if p.exists())
    try:
        with tempfile.TemporaryFile(dir=there):
            return str(folder), True
    except OSError:
        return str(folder), False
