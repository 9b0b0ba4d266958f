"""Accuracy of three views of a part without a table: ``python benchmarks/views.py [scenes views seed photographs]``.

A camera on a hand (1,000 px focal length) takes ``views`` images of a part in any pose from 0.5 m. The pose of the
camera on the hand has the errors of a hand-eye calibration, the same in all images, and each pose of the hand has the
repeatability of a robot. All parts of ``examples/parts`` are candidates. One row is printed for one view and one for
all views. It states how often the part is right and recognized, position and rotation errors, NEES over its degrees of
freedom with the interval of 95 % for the number of scenes, and the processor time. With the word ``photographs``, the
path tracer of ``photographs.py`` makes the images: the part floats over a table with a texture.

``--keep FILE`` and ``--processes N``: ``campaign.py``.
"""

from __future__ import annotations

import sys
import time
from functools import cache
from pathlib import Path

import numpy as np
from scipy.stats import chi2

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import photographs
from campaign import options, run_cases
from common import Table

from tanteo.catalogue import read_parts
from tanteo.geometry import SE3, SO3
from tanteo.vision import Camera, View, see
from tanteo.vision.camera import Mounting
from tanteo.vision.rendering import Appearance, Stage, render, rendered_part
from vision_scenes import looking

SEED, SCENES, VIEWS = 571, 20, 3
SIZE, FOCAL, DISTANCE = (800, 600), 1000.0, 0.5
HAND_EYE = 3e-4, np.radians(0.05)
"""Standard deviations of the camera's pose on the hand about each axis [m, rad]."""

HAND = 5e-5, np.radians(0.01)
"""Standard deviations of each pose of the hand [m, rad]: the repeatability of an arm."""

MIDDLE = np.array([0.5, 0.1, 0.3])
"""Place of the part [m]."""

LIT = np.array([0.0, 0.0, 0.1])
"""Place of the part in a photograph, below the lamps [m]."""


@cache
def parts():
    """Return the candidates."""
    return list(read_parts([Path(__file__).parents[1] / "examples" / "parts"]).parts)


def placed(part, rng, traced=False):
    """Return a random pose of a part."""
    T = SE3.from_parts(SO3.exp(rng.normal(size=3) * 2), np.zeros(3))
    T[:3, 3] = (LIT if traced else MIDDLE) - T[:3, :3] @ part.centroid
    return T


def views_of(part, T_world_part, count, rng, traced=False):
    """Return images of a part with the cameras that the errors of hand and mounting make of the true ones.

    Args:
        part: the part.
        T_world_part: its pose.
        count: number of images.
        rng: generator of everything that is random.
        traced: whether the path tracer makes the images.
    """
    spread = np.diag(np.repeat(np.square(HAND_EYE), 3))
    mounting = Mounting(SE3.exp(np.array([0.03, 0.0, 0.05, 0.0, 0.0, 0.7])), spread)
    T_hand_camera = mounting.T_hand_camera @ SE3.exp(rng.normal(size=6) * np.repeat(HAND_EYE, 3))
    own, first = np.diag(np.repeat(np.square(HAND), 3)), rng.uniform(0, 2 * np.pi)
    middle = SE3.apply(T_world_part, part.centroid)
    paint = rendered_part(part, T_world_part, rng.uniform(60, 180))
    scene = photographs.in_light([paint], float(rng.choice([0.0, 0.08, 0.2])), rng) if traced else None
    K = np.array([[FOCAL, 0, SIZE[0] / 2 - 0.5], [0, FOCAL, SIZE[1] / 2 - 0.5], [0, 0, 1]])
    out = []
    for k in range(count):
        turn, tilt = first + 2 * np.pi * k / max(count, 1) + rng.normal(0, 0.2), rng.uniform(0.3, 0.7)
        way = np.array([np.cos(turn) * np.sin(tilt), np.sin(turn) * np.sin(tilt), np.cos(tilt)])
        T = looking(middle + DISTANCE * way, middle + rng.normal(0, 0.01, 3), rng.uniform(-0.5, 0.5))
        camera = Camera(K, SIZE, T_world_camera=T)
        if scene is None:
            light = Appearance(table=rng.uniform(90, 210), blur=rng.uniform(0.5, 1.0), noise=rng.uniform(1.0, 3.0))
            pixels, _ = render(Stage(camera, [paint], light), rng)
        else:
            pixels = photographs.photograph(scene, camera, rng)
        reported = T @ SE3.inverse(T_hand_camera) @ SE3.exp(-rng.normal(size=6) * np.repeat(HAND, 3))
        out.append(View(pixels, mounting.camera_at(camera, reported, own)))
    return out


def run_scene(scene, count, seed, traced=False):
    """Return the figures of one scene, for one view and for all."""
    rng = np.random.default_rng([seed, scene])
    part = parts()[scene % len(parts())]
    T = placed(part, rng, traced)
    first, *others = views_of(part, T, count, rng, traced)
    rows = []
    for further in ((), others):
        start = time.process_time()
        sight = see(first.pixels, first.camera, parts(), others=further, on_table=False)
        answer = sight.objects[0].answer if sight.objects else None
        row = {"views": 1 + len(further), "part": part.name, "spent": time.process_time() - start, "right": False}
        row["status"] = "nothing" if answer is None else answer.status
        best = None if answer is None else answer.best
        if best is not None and best.part == part.name:
            poses = T @ part.symmetry.Ts
            gaps = SE3.log(SE3.inverse(poses) @ best.T_world_part)
            squared = np.einsum("ki,ij,kj->k", gaps, np.linalg.inv(best.covariance), gaps)
            nearest = int(np.argmin(squared))
            about = SE3.inverse(poses[nearest]) @ best.T_world_part
            row |= {
                "right": True, "nees": float(squared[nearest]), "free": bool(best.unobserved),
                "mm": 1e3 * float(np.linalg.norm(SE3.apply(about, part.centroid) - part.centroid)),
                "deg": float(np.degrees(np.linalg.norm(gaps[nearest, 3:]))),
            }  # fmt: skip
        rows.append(row)
    return rows


def report(rows):
    """Return a table with a row for one view and one for all views."""
    table = []
    for count in sorted({row["views"] for row in rows}):
        own = [row for row in rows if row["views"] == count]
        right = [row for row in own if row["right"] and row["status"] == "recognized" and not row["free"]]
        n = len(right)
        if not n:
            table.append((f"{count}", f"0 of {len(own)}", *["-"] * 6))
            continue
        mm, deg, nees = (np.array([row[name] for row in right]) for name in ("mm", "deg", "nees"))
        low, high = chi2.ppf([0.025, 0.975], 6 * n) / (6 * n)
        table.append((
            f"{count}", f"{sum(r['right'] and r['status'] == 'recognized' for r in own)} of {len(own)}",
            f"{np.median(mm):.2f}, {mm.max():.2f}", f"{np.median(deg):.3f}, {deg.max():.3f}",
            f"{nees.mean() / 6:.2f} ({low:.2f} to {high:.2f})",
            f"{int((nees < chi2.ppf(0.95, 6)).sum())} of {n}",
            f"{sum(not r['right'] and r['status'] == 'recognized' for r in own)}",
            f"{np.median([r['spent'] for r in own]):.1f}",
        ))  # fmt: skip
    head = (
        "views", "recognized", "position error, median and largest [mm]", "rotation error [deg]",
        "NEES / 6 (interval)", "pose in the 95 % region", "wrong and recognized", "CPU for an object [s]",
    )  # fmt: skip
    return Table("Views without a table", "", head, table)


def main():
    arguments, keep, processes = options(sys.argv[1:])
    traced = "photographs" in arguments
    arguments = [word for word in arguments if word != "photographs"]
    scenes, views, seed = (int(arguments[k]) if len(arguments) > k else v for k, v in enumerate((SCENES, VIEWS, SEED)))
    found = run_cases(run_scene, [(scene, views, seed, traced) for scene in range(scenes)], keep, processes)
    print(report([row for rows in found for row in rows]).markdown())


if __name__ == "__main__":
    main()
