"""Recognizing one of a hundred to a hundred thousand parts: time, memory, what is right and what is lost.

``python benchmarks/bench_catalogue.py CATALOGUE [SCENES] [KIND...] [--seed N]`` for one of parts of ``families.py``;
with ``--narrow`` only what is narrowed: how many are left, and whether the right part is among them.
"""

from __future__ import annotations

import argparse
import resource
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from common import Table

import tanteo
from tanteo.factors import AxisCentre, ContactPoints, Factor, FreeRays, SurfacePoint, surface_points
from tanteo.factors.factor import SensedSize
from tanteo.geometry import SE3
from tanteo.parts import Part, round_features
from tanteo.parts.faces import exact_faces
from tanteo.posterior import Problem, candidate_pruning, identify_points, sized
from tanteo.posterior.candidates import Candidates

SD, NORMAL_SD = 1e-4, 0.02
"""Standard deviations of a point [m], and of each tilt of a sensed normal [rad]."""

EACH = 4
"""Points of a labelled face."""

BORE_SD, ON_FACE = 3e-5, 3
"""Standard deviation of the centre and radius that a bore cycle finds [m]; points of the face beside them."""

KINDS = {
    "labelled": "6 labelled faces, 4 points each",
    "normals": "10 points with sensed normals",
    "holes": "centres and radii of up to 4 holes, 3 points of a face",
    "centres": "centres of up to 4 holes without radii, 3 points of a face",
    "points12": "12 points",
    "points30": "30 points",
}

BORES = ("holes", "centres")
"""Kinds of scenes of parts with two holes or bosses, or more."""

SURE = 0.95
"""Probability from which an answer is sure of its part."""


@dataclass
class Outcome:
    """What came of the scenes of one kind."""

    cpu: list[float] = field(default_factory=list)
    kept: int = 0
    right: int = 0
    among: int = 0
    wrong: int = 0
    undecided: int = 0

    def count(self, true: str, status: str, unknown: float, shares: dict[str, float]) -> str:
        """Take in an answer by its status and probabilities; its best part."""
        best = max(shares, key=lambda name: shares[name], default="")
        wrong = best != true and status == "recognized"
        self.right += best == true and status == "recognized"
        self.among += true in shares and status != "recognized"
        self.wrong += wrong
        self.undecided += true not in shares and not wrong
        self.kept += true in shares or unknown > 1 - SURE
        return best

    def rates(self) -> tuple[str, ...]:
        """Return the rates of: right part kept, right, among several, undecided, wrong and sure."""
        n = len(self.cpu)
        return (
            f"{100 * self.kept / n:.1f} %", f"{100 * self.right / n:.0f} %", f"{100 * self.among / n:.0f} %",
            f"{100 * self.undecided / n:.1f} %", f"{100 * self.wrong / n:.1f} %",
        )  # fmt: skip


def shares_of(answer: tanteo.Answer) -> dict[str, float]:
    """Probability of each part."""
    shares: dict[str, float] = {}
    for h in answer.hypotheses:
        shares[h.part] = shares.get(h.part, 0.0) + h.probability
    return shares


def points_on(part: Part, triangles: np.ndarray, n: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Points even over some triangles of a part, moved to the round surfaces behind them, and the normals there."""
    corners = part.vertices[part.triangles[triangles]]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(across, axis=1)
    rows = rng.choice(len(corners), size=n, p=areas / areas.sum())
    u, v = np.sort(rng.uniform(size=(2, n, 1)), axis=0)
    a, b, c = corners[rows].transpose(1, 0, 2)
    points, normals = u * a + (v - u) * b + (1 - v) * c, (across / areas[:, None])[rows]
    every = part.vertices[part.triangles]
    own = np.cross(every[:, 1] - every[:, 0], every[:, 2] - every[:, 0])
    curved = exact_faces(part, own / np.linalg.norm(own, axis=1, keepdims=True))
    if curved is not None:
        off = np.zeros(n)
        curved.replace(points, triangles[rows], off, normals)
        points = points - off[:, None] * normals
    return points, normals


def scene(part: Part, kind: str, rng: np.random.Generator, sd: float = SD) -> ContactPoints:
    """Return the readings of a part at a random pose."""
    if kind in BORES:
        return bores(part, rng, sized=kind == "holes")
    labels: tuple[str, ...] = ()
    if kind == "labelled":
        planes = part.planes
        faces = rng.choice(len(planes), size=min(6, len(planes)), replace=False, p=planes.areas / planes.areas.sum())
        felt = [points_on(part, np.flatnonzero(part.triangle_face == planes.faces[k]), EACH, rng) for k in faces]
        p, n = (np.concatenate(rows) for rows in zip(*felt, strict=True))
        labels = tuple(f"face {k}" for k in faces for _ in range(EACH))
    else:
        count = {"normals": 10, "points12": 12, "points30": 30}[kind]
        p, n = points_on(part, np.arange(len(part.triangles)), count, rng)
    T = SE3.exp(np.concatenate([rng.uniform(-0.3, 0.3, size=3), rng.normal(size=3)]))
    p = SE3.apply(T, p) + sd * rng.normal(size=p.shape)
    n = n @ T[:3, :3].T
    sensed = n + NORMAL_SD * rng.normal(size=n.shape)
    sensed /= np.linalg.norm(sensed, axis=1, keepdims=True)
    oriented = kind == "normals"
    return surface_points(
        p, sd, normals=sensed if oriented else None, normal_sds=NORMAL_SD if oriented else np.pi, labels=labels,
        kind="plane" if labels else "point", outward=n if labels else None,
    )  # fmt: skip


def bores(part: Part, rng: np.random.Generator, *, sized: bool) -> ContactPoints:
    """Centres of up to four holes and bosses, anywhere along them, with radii or without, and points of a face."""
    rounds = round_features(part)
    some = [rounds[k] for k in rng.permutation(len(rounds))[:4]]
    centres = np.array([r.ends[0] + rng.uniform() * (r.ends[1] - r.ends[0]) for r in some])
    planes = part.planes
    face = planes.faces[rng.choice(len(planes), p=planes.areas / planes.areas.sum())]
    felt, n = points_on(part, np.flatnonzero(part.triangle_face == face), ON_FACE, rng)
    T = SE3.exp(np.concatenate([rng.uniform(-0.3, 0.3, size=3), rng.normal(size=3)]))
    p = SE3.apply(T, np.concatenate([centres, felt]))
    c, m = len(centres), len(p)
    radii = np.array([r.radii.mean() for r in some]) + BORE_SD * rng.normal(size=c)
    p, cov = p + BORE_SD * rng.normal(size=p.shape), BORE_SD**2 * np.eye(3)
    factors = list[Factor]()
    for k, one in enumerate(some):
        size = SensedSize(float(radii[k]), float(np.hypot(BORE_SD, 1e-4))) if sized else None
        side = (1 if one.hole else -1) if sized else 0
        factors.append(AxisCentre(at=p[k], cov=cov, sensed_size=size, material_side=side))
    outward = n @ T[:3, :3].T
    factors += [SurfacePoint(at=at, cov=cov, outward=out) for at, out in zip(p[c:], outward, strict=True)]
    return ContactPoints(
        tuple(str(k) for k in range(m)), tuple(factors), np.zeros((m, 3, 0)),
        labels=("",) * c + ("face",) * (m - c), kinds=("centre",) * c + ("plane",) * (m - c),
    )  # fmt: skip


def run(
    catalogue: tanteo.catalogue.Catalogue,
    kind: str,
    scenes: int,
    seed: int = 1,
    *,
    sd: float = SD,
    verbose: bool = False,
) -> Outcome:
    """Scenes of parts that are drawn from all."""
    out = Outcome()
    for number in range(-1, scenes):  # the first one is thrown away: it checks and maps the tables
        rng = np.random.default_rng((seed, number + 1))
        row = int(rng.integers(len(catalogue)))
        part = catalogue[row]
        while kind in BORES and len(round_features(part)) < 2:
            row = int(rng.integers(len(catalogue)))
            part = catalogue[row]
        points = scene(part, kind, rng, sd)
        begun = time.process_time()
        answer = identify_points(points, FreeRays.none(), catalogue, top=10_000)
        if number < 0:
            continue
        out.cpu.append(time.process_time() - begun)
        shares, unknown = shares_of(answer), answer.unknown_probability
        best = out.count(part.name, answer.status, unknown, shares)
        if verbose:
            laps = {name: round(value, 2) for name, value in answer.elapsed.items()}
            own = f"{shares.get(best, 0):.3f} own {shares.get(part.name, 0):.3g} unknown {unknown:.3g}"
            print(number, part.name, answer.status, best, own, laps, flush=True)
    return out


def narrow(catalogue: tanteo.catalogue.Catalogue, kind: str, scenes: int, seed: int, sd: float) -> tuple[str, ...]:
    """Return a row of the table for the pruning of candidates, on the same scenes."""
    every, cpu, left, kept = Candidates(catalogue), list[float](), list[int](), 0
    for number in range(-1, scenes):
        rng = np.random.default_rng((seed, number + 1))
        row = int(rng.integers(len(catalogue)))
        points = scene(catalogue[row], kind, rng, sd)
        begun = time.process_time()
        found = candidate_pruning.screen(
            Problem(points, FreeRays.none(), sized(None, float(every.radii.max()))), every
        ).rows
        if number >= 0:
            cpu.append(time.process_time() - begun)
            left.append(len(found))
            kept += row in found
    return (
        f"{len(catalogue):,}", KINDS[kind], str(scenes), f"{np.median(cpu):.2f}", f"{np.quantile(cpu, 0.9):.2f}",
        f"{100 * kept / scenes:.1f} %", f"{np.median(left):,.0f}",
    )  # fmt: skip


def row_of(size: int, kind: str, out: Outcome) -> tuple[str, ...]:
    """Return a row of the table."""
    return (
        f"{size:,}", KINDS[kind], str(len(out.cpu)), f"{np.median(out.cpu):.2f}", f"{np.quantile(out.cpu, 0.9):.2f}",
        *out.rates(),
    )  # fmt: skip


COLUMNS = (
    "parts", "sensed", "scenes", "CPU s, median", "90 %", "true part kept", "right", "among several", "left open",
    "wrong and sure",
)  # fmt: skip

NARROWED = ("parts", "sensed", "scenes", "CPU s, median", "90 %", "true part kept", "searched, median")


def main() -> None:
    """Measure one catalogue, and print a table."""
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("catalogue", help="or a folder of CAD files")
    words.add_argument("scenes", type=int, nargs="?", default=20)
    words.add_argument("kinds", nargs="*", metavar="KIND", default=list(KINDS))
    words.add_argument("--seed", type=int, default=1)
    words.add_argument("--verbose", action="store_true", help="print a line for each scene")
    words.add_argument("--narrow", action="store_true", help="only narrow")
    words.add_argument("--sd", type=float, default=SD, help="standard deviation of a point [m]")
    given = words.parse_args()
    start = time.perf_counter()
    is_one = (Path(given.catalogue) / "catalogue.json").exists()
    catalogue = tanteo.open_catalogue(given.catalogue) if is_one else tanteo.read_parts([given.catalogue]).parts
    opened = time.perf_counter() - start
    if given.narrow:
        rows = [narrow(catalogue, kind, given.scenes, given.seed, given.sd) for kind in given.kinds]
        print(Table("Narrowing", "Of the same scenes.", NARROWED, rows).markdown())
        return
    rows = [
        row_of(len(catalogue), kind, run(catalogue, kind, given.scenes, given.seed, sd=given.sd, verbose=given.verbose))
        for kind in given.kinds
    ]
    print(Table("Catalogue", f"Opened in {1e3 * opened:.1f} ms.", COLUMNS, rows).markdown())
    print(f"\nResident memory at most {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB.")


if __name__ == "__main__":
    main()
