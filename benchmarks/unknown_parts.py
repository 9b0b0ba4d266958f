"""Rate at which an unknown part is taken for a known one: ``python benchmarks/unknown_parts.py [scenes] [seed]``.

One of eight example parts is sensed without correspondences. The catalogue holds once only the seven others, once all
eight. The first table has the answers in both cases, the probability of the unknown object, and how often the part
itself is named if it is in the catalogue. The second table has two parts that differ by one face, 3 mm higher; one is
sensed while the catalogue holds the other. ``--processes`` and ``--keep`` work as in ``campaign.py``.

``python benchmarks/unknown_parts.py excluded [scenes] [seed] [kind ...]`` excludes the sensed part from a folder of
twelve, the example parts and machined ones, with a probability of one half, which the prior states. Each kind of
readings has a row with standard errors: the probability of the unknown object and its frequency, and the probability of
the best explanation (a part, or the unknown object) and how often it is right. Log score: the mean log
probability of the truth, known or unknown. An answer names the unknown object if
it is more probable than each part.

``python benchmarks/unknown_parts.py shapes [parts] [seed]`` prints how example, machined and random parts fill the
sides of their bounding boxes, which the model of an unknown object uses (``posterior/joint_surface_model.py``): moments
1, 2, 3 and 5 of the fraction of a side that has a face, and the area of the surface over that of the box.
"""

from __future__ import annotations

import sys
import tempfile
from functools import cache
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from campaign import options, run_cases
from common import Table
from region_coverage import FOLDER, PARTS

import tanteo
from bare_scenes import SENSORS, beams, box_centred_pose, scene, surface_points
from machined_parts import machined, write
from random_parts import random_part
from scenes import surface_planes, surface_touches
from tanteo.factors import FreeRays
from tanteo.geometry import SE3
from tanteo.posterior import Priors, identify_features, identify_points, prepare

COUNTS = 10, 16, 25
STEPS = "step_12mm", "step_15mm"


@cache
def catalogue():
    """Return the eight prepared parts."""
    return [prepare(tanteo.read_part(FOLDER / f"{name}.step")) for name in PARTS]


def both(name, s, n, seed, k):
    """Return the answers to one scene, without the part in the catalogue and with it."""
    targets, sensing = catalogue(), SENSORS[s]
    own = targets[PARTS.index(name)]
    rng = np.random.default_rng((seed, PARTS.index(name), s, n, k))
    touches, _, _ = scene(own, box_centred_pose(rng), sensing, n, rng)
    row = {}
    for kind, some in (("without", [t for t in targets if t is not own]), ("with", targets)):
        answer = identify_points(touches, FreeRays.none(), some)
        best = answer.hypotheses[0].part if answer.hypotheses else ""
        row[kind] = {"status": answer.status, "best": best, "unknown": answer.unknown_probability}
    return row


def summary(rows):
    """Return the rates of the answers without the part, and with it."""
    without, with_ = ([(case[0], row[kind]) for case, row in rows] for kind in ("without", "with"))
    n = len(rows)
    return (
        f"{sum(r['status'] == 'recognized' for _, r in without)}/{n}",
        f"{sum(r['status'] == 'unknown' for _, r in without)}/{n}",
        f"{np.mean([r['unknown'] for _, r in without]):.2f}",
        f"{sum(r['status'] == 'recognized' and r['best'] == name for name, r in with_)}/{n}",
        f"{sum(r['status'] == 'recognized' and r['best'] != name for name, r in with_)}/{n}",
        f"{sum(r['status'] == 'unknown' for _, r in with_)}/{n}",
        f"{np.mean([r['unknown'] for _, r in with_]):.3f}",
    )


@cache
def steps():
    """Two parts of which one has a higher step, prepared."""
    return {name: prepare(tanteo.read_part(FOLDER / f"{name}.step")) for name in STEPS}


def of_one_face(name, s, n, seed, k):
    """Return the answer about a part by a catalogue that holds the other, and the number of readings off that one."""
    own, sensing = steps()[name], SENSORS[s]
    other = steps()[next(x for x in STEPS if x != name)]
    rng = np.random.default_rng((seed, STEPS.index(name), s, n, k))
    T = box_centred_pose(rng)
    touches, _, _ = scene(own, T, sensing, n, rng)
    answer = identify_points(touches, FreeRays.none(), [other, *(t for t in catalogue() if "step" not in t.part.name)])
    off = other.surface.closest((touches.points - T[:3, 3]) @ T[:3, :3]).distances > 5 * sensing.sd
    return {"status": answer.status, "off": int(off.sum()), "face": "readings agree" in answer.message}


def variants(scenes, seed, keep, processes):
    """Two parts that differ by one face."""
    cases = [(name, s, n, seed, k) for k in range(scenes) for s in (0, 1) for n in COUNTS for name in STEPS]
    done = list(zip(cases, run_cases(of_one_face, cases, keep, processes), strict=True))
    table = []
    for s in (0, 1):
        for low, high in ((0, 0), (1, 1), (2, 99)):
            rows = [r for c, r in done if c[1] == s and low <= r["off"] <= high]
            rates = [f"{sum(r['status'] == x for r in rows)}/{len(rows)}" for x in ("recognized", "unknown")]
            off = f"{low}" if low == high else f"{low} or more"
            table.append((SENSORS[s].name, off, *rates, f"{sum(r['face'] for r in rows)}"))
    columns = "sensor", "readings off the known part", "taken for it", "unknown", "face named"
    text = f"{' and '.join(STEPS)}, {scenes} scenes each, {', '.join(map(str, COUNTS))} readings, seed {seed}."
    return Table("One face elsewhere", text, columns, table)


def run(scenes, seed, keep, processes):
    """Return a table of all scenes."""
    cases = [
        (name, s, n, seed, k) for k in range(scenes) for s in range(len(SENSORS)) for n in COUNTS for name in PARTS
    ]
    done = list(zip(cases, run_cases(both, cases, keep, processes), strict=True))
    rows = [
        (sensing.name, str(n), *summary([(c, r) for c, r in done if c[1] == s and c[2] == n]))
        for s, sensing in enumerate(SENSORS)
        for n in COUNTS
    ]
    columns = (
        "sensor", "readings", "taken for another", "unknown", "P(none), mean",
        "in the catalogue: named", "another named", "unknown", "P(none), mean",
    )  # fmt: skip
    return Table("Strangers", f"8 parts x {scenes} scenes a row, seed {seed}.", columns, rows)


FOLDER_SIZE, TOUCHES, SD = 12, (8, 16), 1e-4
"""Number of parts in a folder, fewest and most readings, and their standard deviation [m]."""


@cache
def folder():
    """Return the example parts and as many machined ones, prepared."""
    rng, parts = np.random.default_rng(1), list(catalogue())
    with tempfile.TemporaryDirectory() as name:
        for k in range(len(parts)):
            write(machined(rng), Path(name) / f"machined{k}.step")
            parts.append(prepare(tanteo.read_part(Path(name) / f"machined{k}.step")))
    return parts


def _touches(own, T, n, rng):
    """Return points and normals of touches even over a part, in the world."""
    p, normals = surface_points(own, n, rng)
    return SE3.apply(T, p) + SD * rng.normal(size=p.shape), normals @ T[:3, :3].T, p


def _readings(points, **columns):
    return tanteo.Readings.from_columns(points, sds=np.full(len(points), SD), **columns)


def bare(own, T, n, rng):
    """Touches without direction."""
    return _readings(_touches(own, T, n, rng)[0])


def directed(own, T, n, rng):
    """Touches along the normals."""
    points, normals, _ = _touches(own, T, n, rng)
    return _readings(points, directions=-normals)


def labelled(own, T, n, rng):
    """Three bare touches on each of some faces that are drawn by area, with the face as label."""
    p, _ = surface_points(own, 400, rng)
    faces = own.part.triangle_face[own.surface.closest(p).triangles]
    chosen = [f for f in dict.fromkeys(faces.tolist()) if np.sum(faces == f) >= 3][: n // 3]
    rows = np.concatenate([np.flatnonzero(faces == f)[:3] for f in chosen])
    points = SE3.apply(T, p[rows]) + SD * rng.normal(size=(len(rows), 3))
    return _readings(points, features=[f"f{f}" for f in faces[rows]])


def laser(own, T, n, rng):
    """Beams from outside, tilted against the normals."""
    p, d = beams(own, n, rng)
    d = d @ T[:3, :3].T
    return _readings(SE3.apply(T, p) + SD * rng.normal(size=(n, 1)) * d, directions=d)


def normals(own, T, n, rng):
    """Touches with sensed normals."""
    return surface_touches(own.part, T, n // 2, rng)


def planes(own, T, n, rng):
    """Planes from five points each."""
    return surface_planes(own.part, T, n // 3, rng)


SENSED = {f.__name__: f for f in (bare, directed, labelled, laser, normals, planes)}
"""Kinds of readings and their functions of part, pose, number and generator."""


def excluded(kind, seed, k):
    """Return the probabilities of one scene and the truth; common scenes of all kinds have the same part and folder."""
    rng = np.random.default_rng((seed, k))
    rows = rng.permutation(len(folder()))
    own, absent = folder()[rows[0]], bool(rng.integers(2))
    among = [folder()[row] for row in rows[1 if absent else 0 :][:FOLDER_SIZE]]
    T, n = box_centred_pose(rng), int(rng.integers(TOUCHES[0], TOUCHES[1] + 1))
    sensed = SENSED[kind](own, T, n, rng)
    radius = max(part.part.radius for part in among)
    if isinstance(sensed, tanteo.Readings):
        answer = tanteo.identify(sensed, [p.part for p in among], priors=Priors(unknown=0.5), conventions=False)
    else:
        answer = identify_features(sensed, among, priors=Priors(unknown=0.5, radius=radius), top=100)
    claims = {"": answer.unknown_probability, **dict(answer.parts)}
    best = max(claims, key=claims.get)
    true = "" if absent else own.part.name
    return {"unknown": claims[""], "absent": absent, "P": claims[best], "right": best == true, "n": n,
            "own": own.part.name, "best": best, "status": answer.status}  # fmt: skip


def excluded_table(scenes, seed, kinds, keep, processes):
    """Return the table of scenes whose part is excluded from the folder with a probability of one half."""
    table = []
    for kind in kinds:
        rows = run_cases(excluded, [(kind, seed, k) for k in range(scenes)], keep, processes)
        unknown, absent, P, right = (
            np.array([r[x] for r in rows], dtype=float) for x in ("unknown", "absent", "P", "right")
        )
        cells = [kind, str(len(rows))]
        for claimed, true in ((unknown, absent), (P, right)):
            se = (claimed - true).std() / np.sqrt(len(rows))
            cells += [f"{claimed.mean():.3f}", f"{true.mean():.3f}", f"{(claimed - true).mean():+.3f} ± {se:.3f}"]
        score = np.log(np.where(absent > 0, unknown, 1 - unknown).clip(1e-4))
        cells.append(f"{score.mean():.3f}")
        sure, wrong = P > 0.9, (P > 0.9) & (right == 0)
        counts = [int(np.sum(wrong & (absent == truth))) for truth in (1, 0)]
        cells.append(f"{counts[0]}, {counts[1]} of {int(sure.sum())}")
        table.append(tuple(cells))
        print(*cells, sep="\t", flush=True)
    columns = ("readings", "scenes", "P(unknown)", "unknown", "difference", "P(best)", "right", "difference",
               "log score", "wrong above 0.9: unknown, known")  # fmt: skip
    text = f"Folders of {FOLDER_SIZE} parts, {TOUCHES[0]} to {TOUCHES[1]} readings, seed {seed}."
    return Table("Parts excluded from the folder", text, columns, table)


def shape_of(part):
    """Return the fractions of the six sides of the bounding box that have a face, and the area over that of the box.

    The box is along the axes of the part, which are those of most faces for all parts here.
    """
    corners = part.vertices[part.triangles]
    n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    ends, size = part.box, np.ptp(part.box, axis=0)
    sections, at = np.prod(size) / size, corners.mean(axis=1)
    on = [
        n[(np.abs(at[:, k] - ends[end, k]) < 1e-6 * part.diagonal), k].sum() / sections[k]
        for k in range(3)
        for end in (0, 1)
    ]
    return np.abs(on), np.linalg.norm(n, axis=1).sum() / (2 * sections.sum())


def shapes(count, seed):
    """Return the table of the shapes of parts."""
    rng, table = np.random.default_rng(seed), []
    with tempfile.TemporaryDirectory() as name:
        made = {
            "example": [tanteo.read_part(path) for path in sorted(FOLDER.glob("*.step"))],
            "machined": [],
            "random": [],
        }
        for k in range(count):
            write(machined(rng), Path(name) / f"machined{k}.step")
            made["machined"].append(tanteo.read_part(Path(name) / f"machined{k}.step"))
            made["random"].append(random_part(Path(name) / f"random{k}.off", rng))
        for kind, parts in [*made.items(), ("all", [part for some in made.values() for part in some])]:
            sides, areas = zip(*(shape_of(part) for part in parts), strict=True)
            moments = [f"{np.mean(np.concatenate(sides) ** m):.2f}" for m in (1, 2, 3, 5)]
            table.append((kind, str(len(parts)), *moments, f"{np.mean(areas):.2f}"))
    columns = "parts", "number", "fraction of a side", "moment 2", "moment 3", "moment 5", "area over that of the box"
    return Table("Sides of bounding boxes", f"{count} machined and random parts, seed {seed}.", columns, table)


if __name__ == "__main__":
    rest, keep, processes = options(sys.argv[1:])
    if rest[:1] == ["excluded"]:
        figures, kinds = [w for w in rest[1:] if w.isdecimal()], [w for w in rest[1:] if not w.isdecimal()]
        scenes, seed = (int(figures[i]) if len(figures) > i else default for i, default in ((0, 100), (1, 1)))
        print(excluded_table(scenes, seed, kinds or list(SENSED), keep, processes).markdown())
        sys.exit()
    if rest[:1] == ["shapes"]:
        print(shapes(*(int(rest[i]) if len(rest) > i else default for i, default in ((1, 24), (2, 1)))).markdown())
        sys.exit()
    scenes, seed = (int(rest[i]) if len(rest) > i else default for i, default in ((0, 4), (1, 20261203)))
    print(run(scenes, seed, keep, processes).markdown())
    print(variants(5 * scenes, seed, keep and keep.with_suffix(".variants.jsonl"), processes).markdown())
