"""Readings without correspondences on one bracket: ours beside programs for registration, same scenes for all."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from common import Table, version

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import registration
from registration import Scene, Solver

from bare_scenes import box_centred_pose, nees, off, surface_points
from tanteo.lie import SE3, SO3
from tanteo.parts import Part, read_part
from tanteo.shapes import Surface

BRACKET = Path(__file__).parents[2] / "shared" / "data" / "bracket" / "bracket.stl"
POSES, FEW = 200, 2
"""Scenes of each kind, and for a program that takes seconds for one."""

SD, NORMAL_SD = 5e-4, np.radians(3)
CLOSE = 3e-3, np.radians(5)
"""A pose this near the truth is right [m, rad]; the bracket has no symmetry."""

KINDS = (("30 points", 30, False), ("10 points", 10, False), ("10 points with normals", 10, True))

TEXT = f"""\
A bracket of 80 x 60 x 50 mm with 22 planes and no symmetry, at random poses; readings even by area, {1e3 * SD:g} mm a
coordinate, normals {np.degrees(NORMAL_SD):g} degrees a tilt; no first guess. {POSES} scenes of each kind, the same for
every program ({FEW} for CHSEL); small_gicp, trimesh and CHSEL have no use for sensed normals. Right: the first pose is
within {1e3 * CLOSE[0]:g} mm and {np.degrees(CLOSE[1]):g} degrees. "Among" counts the scenes with such a pose anywhere
in the answer; beside it the number of poses in the answer. Process time of one thread, preparation of the part left
out. NEES over the six degrees of freedom, mean (median) of right answers; small_gicp gives a Hessian, which was scaled
with the true standard deviation. "Sure" are answers given as the only one, and how many of those are right."""

COLUMNS = (
    "readings", "program", "right", "among", "poses", "ms, median", "ms, mean", "NEES / 6", "sure, right",
)  # fmt: skip


@dataclass(frozen=True)
class Contestant:
    name: str
    package: str
    make: Callable[[Part, Path], Solver]
    needs_normals: bool = False
    slow: bool = False


CONTESTANTS = (
    Contestant("tanteo", "tanteo", registration.tanteo),
    Contestant("tanteo, maximizing from the truth", "tanteo", registration.told),
    Contestant("small_gicp, 50 starts", "small_gicp", registration.small_gicp(50)),
    Contestant("small_gicp, 500 starts", "small_gicp", registration.small_gicp(500)),
    Contestant(
        "OpenCV surface matching, small_gicp", "opencv-contrib-python-headless", registration.surface_matching, True
    ),
    Contestant("trimesh `mesh_other`", "trimesh", registration.trimesh_registration),
    Contestant("CHSEL", "chsel", registration.chsel, slow=True),
)


def draw(surface: Surface, count: int, with_normals: bool, rng: np.random.Generator) -> Scene:
    T = box_centred_pose(rng)
    p, n = surface_points(surface, count, rng)
    points = SE3.apply(T, p) + SD * rng.normal(size=p.shape)
    normals = n @ T[:3, :3].T if with_normals else None
    if normals is not None:
        tilt = NORMAL_SD * rng.normal(size=normals.shape)
        tilt -= np.sum(tilt * normals, axis=1, keepdims=True) * normals
        normals = (SO3.exp(tilt) @ normals[..., None])[..., 0]
    return Scene(T, points, normals, SD, NORMAL_SD if with_normals else np.pi)


def row(part: Part, scenes: list[Scene], name: str, solve: Solver) -> tuple[str, ...]:
    """How often right, how fast, and how good the covariance is."""
    right, among, counts, times, values, sure = [], [], [], [], [], []
    for k, scene in enumerate(scenes):
        rng = np.random.default_rng((1991, k))
        start = time.process_time()
        answer = solve(scene, rng)
        times.append(1e3 * (time.process_time() - start))
        close = [_close(part, T, scene.T_world_part) for T in answer.Ts]
        right.append(any(close[:1]))
        among.append(any(close))
        counts.append(len(close))
        sure.append(bool(answer.sure))
        if right[-1] and answer.covariance is not None:
            values.append(nees(part, answer.Ts[0], answer.covariance, scene.T_world_part)[0] / 6)
    n = len(scenes)
    return (
        name if n == POSES else f"{name} ({n} scenes)",
        f"{sum(right)}/{n}", f"{sum(among)}/{n}", f"{np.mean(counts):.1f}",
        f"{np.median(times):.1f}", f"{np.mean(times):.1f}",
        f"{np.mean(values):.2f} ({np.median(values):.2f})" if values else "no covariance",
        f"{sum(sure)}, {sum(s and r for s, r in zip(sure, right, strict=True))}" if answer.sure is not None else "-",
    )  # fmt: skip


def _close(part: Part, T: np.ndarray, truth: np.ndarray) -> bool:
    moved, angle = off(part, T, truth)
    return moved < CLOSE[0] and angle < CLOSE[1]


def measure(poses: int = POSES, few: int = FEW) -> Table:
    title = "Readings without correspondences, beside other programs"
    if not BRACKET.is_file():
        return Table(title, f"{TEXT}\n\nNot measured: {BRACKET.name} is missing.", COLUMNS, [])
    part = read_part(BRACKET, unit="mm")
    surface = Surface(part.vertices, part.triangles)
    scenes = {
        kind: [draw(surface, n, normals, np.random.default_rng((n, normals, k))) for k in range(poses)]
        for kind, n, normals in KINDS
    }
    rows = [row_ for c in CONTESTANTS for row_ in _rows(part, scenes, c, few)]
    order = [kind for kind, _, _ in KINDS]
    return Table(title, TEXT, COLUMNS, sorted(rows, key=lambda r: order.index(r[0])))


def _rows(part: Part, scenes: dict[str, list[Scene]], c: Contestant, few: int) -> list[tuple[str, ...]]:
    """The rows of one program, or why there are none."""
    name, nothing = f"{c.name} ({version(c.package)})", [""] * (len(COLUMNS) - 3)
    fit = {kind: some for kind, some in scenes.items() if some[0].normals is not None or not c.needs_normals}
    out: list[tuple[str, ...]] = [(kind, name, "needs normals", *nothing) for kind in scenes if kind not in fit]
    with registration.silent():
        try:
            solve = c.make(part, BRACKET)
            for some in [] if c.slow else fit.values():  # the first call of a kind is thrown away
                solve(some[0], np.random.default_rng(0))
        except ImportError as error:
            return [(kind, name, f"not measured: {error}", *nothing) for kind in scenes]
        return out + [(kind, *row(part, s[: few if c.slow else None], name, solve)) for kind, s in fit.items()]
