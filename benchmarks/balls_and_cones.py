"""Recognize plates by their balls and countersinks: ``python benchmarks/balls_and_cones.py [scenes] [families]
[seed]``.

Each family has ten random plates with two to four balls and two to four countersinks. One plate is sensed in any pose:
centres of up to four balls or countersinks to 0.03 mm, apexes with their axis to 0.3 degrees, and four points of the
upper face. Every other scene has size and side as well. A second set of parts are ball bars: two balls and a face.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
from holes import SD, box_centred_pose, cylinder, on_top, outcome, row
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCone, BRepPrimAPI_MakeSphere
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt
from OCP.Message import Message
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer

from tanteo import Readings, read_part

TILT = np.radians(0.3)


def plate(rng):
    """Half lengths, thickness, balls (x, y, radius) and countersinks (x, y, radius at the top) [mm]."""
    half, thick, places = rng.uniform(40, 70, 2), float(rng.uniform(10, 18)), []
    while len(places) < 8:
        p = rng.uniform(-1, 1, 2) * (half - 14)
        if all(np.hypot(*(p - q)) > 26 for q in places):
            places.append(p)
        elif rng.uniform() < 0.01:
            half = half + 5
    balls = [(*p, float(rng.choice([5.0, 6.0, 8.0]))) for p in places[: rng.integers(2, 5)]]
    sinks = [(*p, float(rng.choice([5.0, 6.0, 7.0]))) for p in places[4 : 4 + rng.integers(2, 5)]]
    return half, thick, balls, sinks


def bar(rng):
    """Return a long block with two balls."""
    half = np.array([rng.uniform(50, 90), 12.0])
    ends = (-half[0] + 15, half[0] - 15)
    return half, 10.0, [(x, 0.0, float(rng.choice([6.0, 8.0, 10.0]))) for x in ends], []


def part_of(spec, name, folder):
    half, thick, balls, sinks = spec
    body = BRepPrimAPI_MakeBox(gp_Pnt(*(-half), 0), gp_Pnt(*half, thick)).Shape()
    for x, y, radius in balls:
        ball = BRepPrimAPI_MakeSphere(gp_Pnt(x, y, thick + 0.6 * radius), radius).Shape()
        body = BRepAlgoAPI_Fuse(body, ball).Shape()
    for x, y, radius in sinks:
        body = BRepAlgoAPI_Cut(body, cylinder(x, y, -1, thick + 1, radius - 3)).Shape()
        cone = BRepPrimAPI_MakeCone(gp_Ax2(gp_Pnt(x, y, thick - 3), gp_Dir(0, 0, 1)), radius - 3, radius, 3).Shape()
        body = BRepAlgoAPI_Cut(body, cone).Shape()
    writer = STEPControl_Writer()
    writer.Transfer(body, STEPControl_AsIs)
    writer.Write(str(folder / f"{name}.step"))
    return read_part(folder / f"{name}.step")


def sensed(spec, T, rng, *, sized):
    """Return up to four centres and apexes, and four points of the upper face."""
    half, thick, balls, sinks = spec
    marks = [("sphere_centre", (x, y, thick + 0.6 * r), 1e-3 * r, "boss") for x, y, r in balls]
    marks += [("apex", (x, y, thick - r), np.pi / 4, "hole") for x, y, r in sinks]
    some = [marks[k] for k in rng.permutation(len(marks))[:4]]
    circles = [(np.array([x, y]), r, False) for x, y, r in [*balls, *sinks]]
    face = on_top(None, (False, half, thick, circles, []), 4, rng)
    p = np.concatenate([1e-3 * np.array([at for _, at, _, _ in some]), face]) @ T[:3, :3].T + T[:3, 3]
    n, m = len(some), len(face)
    axes = T[:3, 2] + TILT * rng.normal(size=(n, 3))
    plain = np.array([kind != "apex" for kind, *_ in some])
    axes[plain] = np.nan
    sizes = np.array([size if sized else np.nan for _, _, size, _ in some])
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    return Readings.from_columns(
        points=p + SD * rng.normal(size=p.shape), sds=np.full(n + m, SD),
        kinds=[kind for kind, *_ in some] + ["plane"] * m, features=[f"c{k}" for k in range(n)] + ["top"] * m,
        directions=np.concatenate([np.full((n, 3), np.nan), np.tile(-T[:3, 2], (m, 1))]),
        normals=np.concatenate([axes, np.full((m, 3), np.nan)]),
        normal_sds=np.r_[np.where(plain, np.nan, TILT), np.full(m, np.nan)],
        hole_radii=np.r_[np.where(plain, sizes, np.nan), np.full(m, np.nan)],
        half_angles=np.r_[np.where(plain, np.nan, sizes), np.full(m, np.nan)],
        material_sides=[side if sized else "" for *_, side in some] + [""] * m,
    )  # fmt: skip


def main(scenes=200, families=20, seed=1):
    Message.DefaultMessenger_s().ChangePrinters().Clear()
    print("| parts | scenes | right | recognized | wrongly so | in the 95 % region | ms of one core, median | worst |")
    print("|---|---|---|---|---|---|---|---|")
    for name, make in (("ten plates with balls and countersinks", plate), ("ten ball bars", bar)):
        results = []
        for family in range(families):
            rng = np.random.default_rng((seed, family, name == "ten ball bars"))
            specs = [make(rng) for _ in range(10)]
            with tempfile.TemporaryDirectory() as folder:
                parts = [part_of(spec, f"part_{k}", Path(folder)) for k, spec in enumerate(specs)]
            for number in range(scenes // families):
                k, T = int(rng.integers(len(parts))), box_centred_pose(rng)
                sized = bool(number % 2) or make is bar
                results.append(outcome(sensed(specs[k], T, rng, sized=sized), parts, parts[k], T))
        row(name, results)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
