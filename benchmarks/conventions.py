"""Usual mistakes of a file, and how often they are named: ``python benchmarks/conventions.py [scenes] [seed]``.

Each scene is a part of the demo, touched at random places of its surface with 0.05 mm noise, and then written wrongly.
``named`` counts the answers whose finding names the mistake, ``another`` those that name another one. The last rows
have no mistake, and a part that is not among the candidates: nothing may be named there. Times are processor time.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
from common import Table

import tanteo
from tanteo.factors import FreeRays, as_contact_points
from tanteo.geometry import SE3, SO3
from tanteo.posterior import Priors, Problem, prepare, sized
from tanteo.posterior.candidates import Candidates
from tanteo.posterior.trial_fit import trial_fits
from tanteo.sensors import measure
from tanteo.words.findings import Convention, MirrorQuestion, OffsetQuestion

ROOT = Path(__file__).resolve().parents[1]
DEMO = ROOT / "src" / "tanteo" / "bench" / "demo" / "parts"
SD, POINTS, RADII = 5e-5, 20, (1e-3, 3e-3)


def touches(part, rng, radius):
    """Return touches with a ball: its centres and contact points less their noise, and outward normals, in the world.

    The ball is outside of the part everywhere, so it touches no point that is deep in a corner.
    """
    n = 8 * POINTS
    triangles = part.vertices[part.triangles]
    areas = np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
    chosen = rng.choice(len(areas), n, p=areas / areas.sum())
    u, v = np.sort(rng.random((2, n)), axis=0)
    a, b, c = np.moveaxis(triangles[chosen], 1, 0)
    p = u[:, None] * a + (v - u)[:, None] * b + (1 - v)[:, None] * c
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    T = np.eye(4)
    T[:3, :3] = SO3.exp(rng.normal(size=3))
    T[:3, 3] = rng.uniform(-0.2, 0.2, 3) + np.array([0.5, 0.0, 0.1])
    outside = prepare(part).surface.closest(p + radius * normals).distances > radius * (1 - 1e-6)
    p, normals = p[outside][:POINTS], normals[outside][:POINTS]
    points = SE3.apply(T, p + SD * rng.normal(size=p.shape))
    normals = normals @ T[:3, :3].T
    return points, points + radius * normals, normals


def radius_forgotten(points, centres, normals):
    """Write the centres of the ball as contact points."""
    return {"points": centres}


def with_directions(points, centres, normals):
    """Write the centres of the ball as contact points, with the directions of approach."""
    return {"points": centres, "directions": -normals}


def inches(points, centres, normals):
    """Write inches where millimetres are meant."""
    return {"points": points / 25.4}


def mirrored(points, centres, normals):
    """Write a left-handed frame."""
    return {"points": points * [1.0, -1.0, 1.0]}


def normals_reversed(points, centres, normals):
    """Write normals into the material."""
    return {"points": points, "normals": -normals, "normal_sds": np.full(len(points), 0.02)}


def right(points, centres, normals):
    """Write correct readings."""
    return {"points": points}


ROWS = (
    ("radius forgotten, no directions", radius_forgotten, (OffsetQuestion,), False),
    ("radius forgotten, directions", with_directions, (OffsetQuestion,), False),
    ("inches for millimetres", inches, (Convention,), False),
    ("left-handed", mirrored, (Convention, MirrorQuestion), False),
    ("normals reversed", normals_reversed, (Convention,), False),
    ("no mistake", right, (), False),
    ("no mistake, part missing", right, (), True),
)


def trials(parts, scenes, seed):
    """Return rows of the table of trial fits: how often the right part explains nine tenths of the points."""
    lines = []
    for n in (8, 11, 14, 20):
        found, ms = 0, []
        for k in range(scenes):
            rng = np.random.default_rng((seed, k))
            part = parts[k % len(parts)]
            points, _, _ = touches(part, rng, RADII[0])
            readings = tanteo.Readings.from_columns(sds=np.full(n, SD), points=points[:n])
            contacts = as_contact_points(measure(readings), 0.0, readings.ranges)
            candidates = Candidates([part])
            priors = sized(Priors(noise_factor=2.0), float(candidates.radii.max()))
            start = time.process_time()
            fit, *_ = trial_fits(Problem(contacts, FreeRays.none(), priors), candidates)
            ms.append(1e3 * (time.process_time() - start))
            found += fit.explained >= 0.9 * n
        lines.append((str(n), str(scenes), str(found), f"{np.median(ms):.0f}", f"{np.max(ms):.0f}"))
    return Table(
        "Trial fits of the right part",
        "A trial fit decides whether a search is made.",
        ("points", "scenes", "explained", "ms, median", "ms, worst"),
        tuple(lines),
    )


def main():
    """Print both tables."""
    scenes, seed = (int(text) for text in (*sys.argv[1:3], *("24", "1991")[len(sys.argv) - 1 :]))
    parts = tanteo.read_parts(sorted(DEMO.glob("*.stl")), unit="mm").parts
    lines = []
    for name, write, kinds, missing in ROWS:
        named, another, ms = 0, 0, []
        for k in range(scenes):
            rng = np.random.default_rng((seed, k))
            part = parts[k % len(parts)]
            columns = write(*touches(part, rng, rng.uniform(*RADII)))
            readings = tanteo.Readings.from_columns(sds=np.full(POINTS, SD), **columns)
            among = [other for other in parts if not (missing and other is part)]
            start = time.process_time()
            answer = tanteo.identify(readings, among)
            ms.append(1e3 * (time.process_time() - start))
            found = [one for one in answer.findings if isinstance(one, (Convention, OffsetQuestion, MirrorQuestion))]
            named += any(isinstance(one, kinds) for one in found)
            another += any(not isinstance(one, kinds) for one in found)
        times = f"{np.median(ms):.0f}", f"{np.max(ms):.0f}"
        lines.append((name, str(scenes), str(named) if kinds else "", str(another), *times))
        print(*lines[-1], file=sys.stderr, flush=True)
    columns = "scene", "scenes", "named", "another", "ms, median", "ms, worst"
    print(Table("Usual mistakes", __doc__.split("\n\n")[1], columns, tuple(lines)).markdown())
    print(trials(parts, 4 * scenes, seed).markdown())


if __name__ == "__main__":
    main()
