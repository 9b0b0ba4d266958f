"""Sets that are made: readings even over the surface of parts at random poses, the same for the same seed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import as_file, files

import numpy as np

from tanteo.bench.sets import BenchScene, BenchSet, Candidate, range_scene
from tanteo.errors import InputError
from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import Transforms, Vectors
from tanteo.parts import Part, Surface, read_part
from tanteo.sensors import Readings, Rig, RigSensor
from tanteo.sensors.noise import cone_rays

TOLERANCE = 0.05
"""Farthest that a corner of a right answer may be off, of the middle diagonal of the parts: the strictest threshold of
the BOP benchmark."""

SD, NORMAL_SD = 5e-4, float(np.radians(3.0))
"""Of the readings: a laser on a robot arm [m], a surface that is felt at three places [rad]."""

RAYS, REACH, LEAST_COSINE = 400, 0.5, 0.05
"""Definition: rays that fill a cone, the largest range [m], and the smallest cosine of the incidence with an echo."""


@dataclass(frozen=True, slots=True)
class Recipe:
    """Recipe of the scenes of a set.

    Attributes:
        words: sentence that describes the scenes.
        readings: number of readings in each scene.
        normals: whether normals are sensed.
        alone: whether the true part is the only candidate; otherwise all parts are candidates.
        true_noise: true standard deviation of the noise divided by the stated one.
        outliers: number of readings of each scene that are up to 50 mm off.
        absent: fraction of the scenes whose true part is removed from the candidates.
        half_angle: half angle of the cone of ranges [rad]; None for points.
        response: what the sensor reports of its cone.
    """

    words: str
    readings: int
    normals: bool = False
    alone: bool = True
    true_noise: float = 1.0
    outliers: int = 0
    absent: float = 0.0
    half_angle: float | None = None
    response: str = ""


GENERATED: dict[str, Recipe] = {
    "points": Recipe("30 points on one part, no first guess", 30),
    "few": Recipe("10 points on one part: often more than one pose fits", 10),
    "normals": Recipe("10 points with sensed normals on one part", 10, normals=True),
    "catalogue": Recipe("15 points on one of twelve parts", 15, alone=False),
    "unknown": Recipe("15 points, every second time on a part that is no candidate", 15, alone=False, absent=0.5),
    "noise": Recipe("20 points on one part, with twice the noise that is stated", 20, true_noise=2.0),
    "outliers": Recipe("20 points on one part, two of them up to 50 mm off", 20, outliers=2),
    "ranges": Recipe(
        "20 ranges of a thin beam on one part, and the beams that missed it as free space", 20, half_angle=1e-3
    ),
    "cones": Recipe(
        "25 ranges to the nearest point in a cone of 10 degrees on one of twelve parts, and empty cones",
        25,
        alone=False,
        half_angle=float(np.radians(10.0)),
        response="nearest",
    ),
}
"""Recipes of the generated sets by name."""


def generate(name: str, count: int = 50, seed: int = 0, parts: Sequence[Part] | None = None) -> BenchSet:
    """Return a generated set.

    Args:
        name: name in :data:`GENERATED`.
        count: number of scenes.
        seed: seed of all random numbers; scenes do not depend on the count.
        parts: candidate parts; by default the twelve of the demo.

    Raises:
        InputError: the name is unknown, or the count is below one.

    Example:
        >>> tanteo.bench.generate("few", 2).scenes[0].points.shape
        (10, 3)
    """
    if name not in GENERATED:
        raise InputError(f"set: expected one of {', '.join(GENERATED)} or a folder, got '{name}'.")
    if count < 1:
        raise InputError(f"scenes: expected one or more, got {count}.")
    recipe, own = GENERATED[name], tuple(demo_parts() if parts is None else parts)
    number = list(GENERATED).index(name)
    rngs = [np.random.default_rng((seed, number, k)) for k in range(count)]
    if recipe.alone:
        part = own[min(1, len(own) - 1)]
        return BenchSet(
            name,
            (part,),
            tuple(_scene(recipe, part, k, rng) for k, rng in enumerate(rngs)),
            tolerance_of((part,)),
            recipe.words,
        )
    absent_part = own[-1] if recipe.absent and len(own) > 1 else None
    candidates = tuple(part for part in own if part is not absent_part)
    scenes = []
    for k, rng in enumerate(rngs):
        away = rng.uniform() < recipe.absent and absent_part is not None
        part = absent_part if away and absent_part is not None else candidates[int(rng.integers(len(candidates)))]
        scenes.append(_scene(recipe, part, k, rng, known=not away))
    return BenchSet(name, candidates, tuple(scenes), tolerance_of(candidates), recipe.words)


def tolerance_of(parts: Sequence[Part]) -> float:
    """Return the default tolerance of a corner [m]."""
    return TOLERANCE * float(np.median([part.diagonal for part in parts]))


def demo_parts() -> list[Part]:
    """Return the twelve parts of the demo."""
    out = []
    for file in sorted(files("tanteo.bench.demo").joinpath("parts").iterdir(), key=lambda one: one.name):
        with as_file(file) as path:
            out.append(read_part(path, unit="mm"))
    return out


def _scene(recipe: Recipe, part: Part, k: int, rng: np.random.Generator, *, known: bool = True) -> BenchScene:
    T = SE3.from_parts(SO3.from_quaternion(_unit(rng.normal(size=4))), rng.uniform(-0.5, 0.5, 3))
    if recipe.half_angle is not None:
        return _ranges(recipe, part, k, T, rng, known=known)
    p, n = surface_points(part, recipe.readings, rng)
    points = SE3.apply(T, p) + recipe.true_noise * SD * rng.normal(size=p.shape)
    off = rng.normal(size=(recipe.outliers, 3))
    points[: recipe.outliers] += 0.05 * rng.uniform(0.1, 1.0, (len(off), 1)) * _unit(off)
    rows = rng.permutation(len(points))
    normals = None
    if recipe.normals:
        normals = n @ T[:3, :3].T
        tilt = NORMAL_SD * rng.normal(size=normals.shape)
        tilt -= np.sum(tilt * normals, axis=1, keepdims=True) * normals
        normals = (SO3.exp(tilt) @ normals[..., None])[rows, :, 0]
    spread = NORMAL_SD if recipe.normals else float(np.pi)
    return BenchScene(f"{k}", points[rows], SD, normals, spread, part.name if known else None, T if known else None)


def _ranges(recipe: Recipe, part: Part, k: int, T: Transforms, rng: np.random.Generator, *, known: bool) -> BenchScene:
    """Return ranges from all sides, of beams aimed at places in the part's sphere; those that miss are free space."""
    assert recipe.half_angle is not None
    surface, local = (
        Surface(part.vertices, part.triangles),
        cone_rays(recipe.half_angle, RAYS if recipe.response else 1),
    )
    centre, radius = 0.5 * (part.vertices.max(axis=0) + part.vertices.min(axis=0)), 0.5 * part.diagonal
    Ts, ranges = list[Transforms](), list[float]()
    while np.isfinite(ranges).sum() < recipe.readings:
        outward = _unit(rng.normal(size=3))
        origin = centre + outward * (radius + rng.uniform(0.05, 0.15))
        aim = centre + 0.6 * radius * rng.uniform() * _unit(rng.normal(size=3)) - origin
        frame = SE3.from_parts(SO3.frame_from_axis(_unit(aim), 2), origin)
        rays = local @ frame[:3, :3].T
        hits = surface.cast(np.repeat(origin[None], len(rays), axis=0), rays)
        facing = np.isfinite(hits.distances) & (
            -np.sum(surface.normals[np.maximum(hits.triangles, 0)] * rays, axis=1) > LEAST_COSINE
        )
        nearest = float(hits.distances[facing].min(initial=np.inf))
        Ts.append(T @ frame)
        ranges.append(nearest + recipe.true_noise * SD * float(rng.normal()) if nearest < REACH else np.inf)
    free = ~np.isfinite(ranges)
    sensor = RigSensor(
        "beam", np.eye(4), None, SD, recipe.half_angle, REACH, 0.0, np.zeros((6, 6)), response=recipe.response
    )
    readings = Readings.from_columns(
        ranges=np.where(free, np.nan, ranges), is_free=free, sensors=["beam"] * len(free), Ts_world_hand=np.array(Ts)
    )
    return range_scene(f"{k}", readings, Rig((sensor,)), part.name if known else None, T if known else None)


def _unit(v: Vectors) -> Vectors:
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))


def surface_points(part: Part | Candidate, n: int, rng: np.random.Generator) -> tuple[Vectors, Vectors]:
    """Places even over the mesh of a part and its outward normals there, part frame ``(n, 3)`` [m]."""
    corners = part.vertices[part.triangles]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(across, axis=1)
    chosen = rng.choice(len(corners), size=n, p=areas / areas.sum())
    u, v = np.sort(rng.uniform(size=(2, n, 1)), axis=0)
    a, b, c = corners[chosen].transpose(1, 0, 2)
    return u * a + (v - u) * b + (1 - v) * c, across[chosen] / areas[chosen, None]
