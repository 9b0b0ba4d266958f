"""Recognize plates and flanges by their holes: ``python benchmarks/holes.py [scenes] [families] [seed]``.

Each family has ten random plates and round flanges with holes, some with a hub. One part is sensed in any pose: the
centres of up to six holes and bosses to 0.03 mm, and four points of the face. The centres are at any depth, all at a
rim, or all moved by up to 200 mm along their axes, as tables in two dimensions have them. Every other scene has radius
and side as well. Twins are ten copies of one plate with one hole each displaced by 1 to 5 mm; all
their
holes are sensed. A last figure is the time of labelled touches on five sides, where a half turn fits similarly well.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt
from OCP.Message import Message
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from bare_scenes import box_centred_pose, nees, off
from tanteo import Readings, identify, read_part
from tanteo.parts import round_features

SD = 3e-5
RADII = 2.0, 2.5, 3.3, 4.2, 5.5
NINETY_FIVE = 12.592  # of chi2 with six degrees of freedom
FAR = 1e-3, np.radians(1)  # of the part's centre [m] and attitude: another pose is farther


def cylinder(x, y, low, high, radius):
    return BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(x, y, low), gp_Dir(0, 0, 1)), radius, high - low).Shape()


def scattered(rng, half, count, round_one, kept=()):
    """Places of holes in a plate [mm], no two near each other, with their radii."""
    found = list(kept)
    while len(found) < count + len(kept):
        p, radius = rng.uniform(-1, 1, 2) * (half - 10), float(rng.choice(RADII))
        if round_one and np.hypot(*p) > half[0] - 10:
            continue
        if all(np.hypot(*(p - q)) > radius + r + 4 for q, r, _ in found):
            found.append((p, radius, False))
    return found[len(kept) :]


def plate(rng):
    """Outline, thickness, holes and bosses of a plate or flange [mm]."""
    round_one = rng.uniform() < 0.4
    half = rng.uniform(35, 75, 2)
    half = np.full(2, half[0]) if round_one else half
    bosses = [(np.zeros(2), float(rng.uniform(8, 14)), True)] if rng.uniform() < 0.5 else []
    holes = scattered(rng, half, int(rng.integers(4, 9)), round_one, bosses)
    return round_one, half, float(rng.uniform(6, 20)), holes, bosses


def shape_of(round_one, half, thick, holes, bosses):
    body = cylinder(0, 0, 0, thick, half[0]) if round_one else BRepPrimAPI_MakeBox(
        gp_Pnt(*(-half), 0), gp_Pnt(*half, thick)
    ).Shape()  # fmt: skip
    for p, radius, _ in bosses:
        body = BRepAlgoAPI_Fuse(body, cylinder(*p, 0, thick + 15, radius)).Shape()
    for p, radius, _ in holes:
        body = BRepAlgoAPI_Cut(body, cylinder(*p, -1, thick + 1, radius)).Shape()
    return body


def part_of(spec, name, folder):
    writer = STEPControl_Writer()
    writer.Transfer(shape_of(*spec), STEPControl_AsIs)
    path = folder / f"{name}.step"
    writer.Write(str(path))
    return read_part(path)


def twins(rng, count=10):
    """Return a plate, and copies with one hole each displaced by 1 to 5 mm."""
    round_one, half, thick, holes, bosses = plate(rng)
    specs = [(round_one, half, thick, holes, bosses)]
    while len(specs) < count:
        k, turn = rng.integers(len(holes)), rng.uniform(0, 2 * np.pi)
        p = holes[k][0] + rng.uniform(1, 5) * np.array([np.cos(turn), np.sin(turn)])
        rest = [*holes[:k], *holes[k + 1 :], *bosses]
        if all(np.hypot(*(p - q)) > holes[k][1] + r + 1.5 for q, r, _ in rest):
            specs.append((round_one, half, thick, [*holes[:k], (p, *holes[k][1:]), *holes[k + 1 :]], bosses))
    return specs


def on_top(part, spec, count, rng):
    """Points of the upper face, beside holes and bosses [m]."""
    round_one, half, thick, holes, bosses = spec
    found = []
    while len(found) < count:
        p = rng.uniform(-1, 1, 2) * (half - 2)
        inside = not round_one or np.hypot(*p) < half[0] - 2
        near = any(np.hypot(*(p - q)) < r + 1 for q, r, _ in [*holes, *bosses])
        apart = all(np.hypot(*(p - 1e3 * np.array(q[:2]))) > 0.4 * half.min() for q in found)
        if inside and not near and apart:
            found.append([*(1e-3 * p), 1e-3 * thick])
    return np.array(found)


def sensed_holes(part, spec, T, rng, *, sized, most):
    """Return centres of holes and bosses at any depth, except the rim of a flange, and four points on top."""
    rounds = [r for r in round_features(part) if r.radii[0] < 0.03]
    some = [rounds[k] for k in rng.permutation(len(rounds))[:most]]
    where = rng.integers(3)  # at any depth, at the upper rim, or moved along the axes
    away = rng.uniform(-0.2, 0.2)
    depths = [rng.uniform() if where == 0 else 1.0 for _ in some]
    centres = np.array([r.ends[0] + t * (r.ends[1] - r.ends[0]) for r, t in zip(some, depths, strict=True)])
    centres[:, 2] += away * (where == 2)
    face = on_top(part, spec, 4, rng)
    p = np.concatenate([centres, face]) @ T[:3, :3].T + T[:3, 3]
    n, m = len(centres), len(face)
    none = np.full((n, 3), np.nan)
    return Readings.from_columns(
        points=p + SD * rng.normal(size=p.shape), sds=np.full(n + m, SD), kinds=["centre"] * n + ["plane"] * m,
        features=[f"h{k}" for k in range(n)] + ["top"] * m,
        directions=np.concatenate([none, np.tile(-T[:3, 2], (m, 1))]),
        hole_radii=np.r_[[r.radii[0] if sized else np.nan for r in some], np.full(m, np.nan)],
        material_sides=[("hole" if r.hole else "boss") if sized else "" for r in some] + [""] * m,
    )  # fmt: skip


def sensed_planes(part, T, rng):
    """Three touches on each of the five largest flat faces; None if there are fewer."""
    planes = part.planes
    if len(planes) < 6:
        return None
    p, directions, labels = [], [], []
    for k in np.argsort(-planes.areas)[:5]:
        mine = part.triangle_face == planes.faces[k]
        corners = part.vertices[part.triangles[mine]]
        areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        rows = rng.choice(len(corners), size=3, p=areas / areas.sum())
        w = rng.dirichlet([2, 2, 2], size=3)
        p.append(np.einsum("nk,nki->ni", w, corners[rows]))
        directions += [-planes.normals[k]] * 3
        labels += [f"face {k}"] * 3
    p = np.concatenate(p) @ T[:3, :3].T + T[:3, 3]
    return Readings.from_columns(
        points=p + SD * rng.normal(size=p.shape), sds=np.full(len(p), SD), kinds=["plane"] * len(p), features=labels,
        directions=np.array(directions) @ T[:3, :3].T,
    )  # fmt: skip


def outcome(readings, parts, part, T):
    """Right part and pose, status, whether the 95 % region holds the pose, wrongly sure, and CPU time [s]."""
    start = time.process_time()
    answer = identify(readings, parts, conventions=False)
    taken = time.process_time() - start
    best = answer.best
    if best is None or best.part != part.name:
        return False, answer.status, np.nan, answer.status == "recognized", taken
    right = bool(np.all(np.array(off(part, best.T_world_part, T)) < FAR))
    chi2 = nees(part, best.T_world_part, best.covariance, T)[0]
    return (
        right,
        answer.status,
        float(chi2 < NINETY_FIVE) if right else np.nan,
        not right and answer.status == "recognized",
        taken,
    )


def row(name, results):
    right, status, inside, sure, taken = (list(x) for x in zip(*results, strict=True))
    recognized = np.mean([s == "recognized" for s in status])
    ms = 1e3 * np.array(taken)
    print(
        f"| {name} | {len(right)} | {100 * np.mean(right):.1f} % | {100 * recognized:.1f} % | {np.sum(sure)} | "
        f"{100 * np.nanmean(inside):.1f} % | {np.median(ms):.0f} | {ms.max():.0f} |", flush=True,
    )  # fmt: skip


def main(scenes=200, families=20, seed=1):
    Message.DefaultMessenger_s().ChangePrinters().Clear()
    print("| parts | scenes | right | recognized | wrongly so | in the 95 % region | ms of one core, median | worst |")
    print("|---|---|---|---|---|---|---|---|")
    for name, make in (("ten of a family", lambda rng: [plate(rng) for _ in range(10)]), ("ten twins", twins)):
        results, flat = [], []
        for family in range(families):
            rng = np.random.default_rng((seed, family, name == "ten twins"))
            specs = make(rng)
            with tempfile.TemporaryDirectory() as folder:
                parts = [part_of(spec, f"part_{k}", Path(folder)) for k, spec in enumerate(specs)]
            for number in range(scenes // families):
                k = int(rng.integers(len(parts)))
                T = box_centred_pose(rng)
                sized, most = bool(number % 2), 20 if make is twins else 6
                sensed = sensed_holes(parts[k], specs[k], T, rng, sized=sized, most=most)
                results.append(outcome(sensed, parts, parts[k], T))
                if name == "ten of a family" and (by_planes := sensed_planes(parts[k], T, rng)) is not None:
                    flat.append(outcome(by_planes, parts, parts[k], T))
        row(name, results)
        if flat:
            row("the same by five flat faces", flat)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
