"""Paths without a hit, beside touches with labels and without: they count, and contradicting ones are named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bare_scenes import box_centred_pose
from scenes import points_on_plane
from tanteo import Readings, identify
from tanteo.geometry import SE3
from tanteo.parts import Surface, read_part

PARTS = Path(__file__).parents[1] / "examples" / "parts"
SD, LENGTH = 1e-4, 0.4


@pytest.fixture(scope="module")
def steps():
    """Twins: the step of one is 3 mm higher."""
    return [read_part(PARTS / f"step_{height}mm.step") for height in (12, 15)]


def in_common(first, second):
    """Planes of the first part that the second has, too."""
    heights = [np.sum(p.planes.normals * p.planes.centroids, axis=1) for p in (first, second)]
    same = np.abs(first.planes.normals @ second.planes.normals.T) > 0.999
    same &= np.abs(heights[0][:, None] - heights[1]) < 1e-6
    return [k for k in np.flatnonzero(same.any(axis=1)) if first.planes.areas[k] > 1e-3][:4]


def path_that_meets(meets, misses, rng):
    """Start and direction in the part frame of a path that meets one part well before its end, and misses the other."""
    hit, miss = (Surface(p.vertices, p.triangles) for p in (meets, misses))
    while True:
        d = rng.normal(size=(4000, 3))
        d /= np.linalg.norm(d, axis=1, keepdims=True)
        starts = meets.centroid + 0.03 * rng.normal(size=d.shape) - 0.2 * d
        ok = (hit.cast(starts, d).distances < LENGTH - 0.1) & ~np.isfinite(miss.cast(starts, d).distances)
        ok &= np.all([~np.isfinite(miss.cast(starts + e, d).distances) for e in 1e-3 * np.eye(3)], axis=0)
        if ok.any():
            k = np.flatnonzero(ok)[0]
            return starts[k], d[k]


def sensed(part, T, planes, paths, rng, labels=True):
    """Return touches of planes and beams without a hit, from a hand that points along its z."""
    points = np.concatenate([SE3.apply(T, points_on_plane(part, k, 4, rng)) for k in planes])
    into = -np.repeat(part.planes.normals[planes], 4, axis=0) @ T[:3, :3].T
    n, m = len(points), len(paths)
    starts = SE3.apply(T, np.array([p for p, _ in paths]).reshape(-1, 3))
    along = np.array([d for _, d in paths]).reshape(-1, 3) @ T[:3, :3].T
    names = [f"face {k}" for k in planes for _ in range(4)] if labels else [""] * n
    return Readings.from_columns(
        np.concatenate([points + SD * rng.normal(size=points.shape), starts]),
        directions=np.concatenate([into, along]), sds=np.full(n + m, SD), features=names + [""] * m,
        is_free=np.arange(n + m) >= n, max_ranges=np.r_[np.full(n, np.nan), np.full(m, LENGTH)],
    )  # fmt: skip


def by_part(answer, name):
    return sum(h.probability for h in answer.hypotheses if h.part == name)


@pytest.mark.parametrize("labels", [True, False])
def test_a_free_space_ray_discriminates_twins(steps, labels):
    rng, (low, high) = np.random.default_rng(1), steps
    T, planes = box_centred_pose(rng), in_common(low, high)
    paths = [path_that_meets(high, low, rng) for _ in range(2)]
    readings = sensed(low, T, planes, paths, rng, labels)
    alone = identify(readings.take(~readings.is_free), steps)
    assert alone.status != "recognized"
    answer = identify(readings, steps)
    assert answer.hypotheses[0].part == low.name
    odds = [by_part(a, low.name) / max(by_part(a, high.name), 1e-12) for a in (alone, answer)]
    assert odds[1] > 30 * odds[0]  # 49 for each path, if the pose were exact: the steps differ by 3 mm
    assert "free-space paths" not in answer.message


@pytest.mark.parametrize("labels", [True, False])
def test_a_path_through_the_part_is_named_with_how_far(steps, labels):
    rng, low = np.random.default_rng(2), steps[0]
    T = box_centred_pose(rng)
    d = np.array([0.0, 0.6, 0.8])
    start = low.centroid - 0.2 * d
    distance = Surface(low.vertices, low.triangles).cast(start[None], d[None]).distances[0]
    beside = start + 1.0, d
    readings = sensed(low, T, np.argsort(-low.planes.areas)[:7], [beside, (start, d)], rng, labels)
    answer = identify(readings, [low])
    text = f"{readings.ids[-1]} (by {float(f'{1e3 * (LENGTH - distance):.2g}'):.0f} mm)."
    assert f"blocks 1 of 2 free-space paths: {text}" in answer.message


def test_a_labelled_part_in_way_of_many_paths_is_none_of_these(steps):
    rng, low = np.random.default_rng(3), steps[0]
    T = box_centred_pose(rng)
    paths = [(low.centroid - 0.2 * d, d) for d in SE3.exp(rng.normal(size=(24, 6)))[:, :3, 0]]
    planes = np.argsort(-low.planes.areas)[:4]
    assert identify(sensed(low, T, planes, [], rng), [low]).hypotheses[0].probability > 0.5
    answer = identify(sensed(low, T, planes, paths, rng), [low])
    assert answer.status == "unknown"
    assert answer.unknown_probability > 0.999
