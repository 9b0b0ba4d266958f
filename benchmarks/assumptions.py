"""Claimed against right where touches are uneven, a size of a design is missing, or a reading is on another object.

``python benchmarks/assumptions.py [scenes] [seed] [kind ...]`` prints one row for each kind of scene when it is ready,
with standard errors: the mean probability of the best hypothesis (claimed), the fraction that is the true part at the
true pose (right), their difference, the same difference for the best part in any pose, and the number of answers
``recognized`` that are wrong. A second table has claimed against right by bins of the claimed probability, for all
kinds together. ``scenes`` is 40 and ``seed`` 1 by default. A scene takes 1 to 3 s, because uneven
touches are ambiguous among parts, and all parts are then searched to the end.
``--processes`` and ``--keep`` work as in ``campaign.py``. ``--seeds`` answers each scene with seeds 0 to 4 and prints
how often P(best) agrees within 0.05: of all scenes, and of those in which no answer is ``insufficient``. Where readings
leave a motion of the part open, modes are pieces of one region, and the piece that is best has no definite probability.
"""

from __future__ import annotations

import atexit
import itertools
import shutil
import sys
import tempfile
import time
from functools import cache, partial
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import against_scenes
import against_worker
import families
from campaign import options, run_cases
from common import Table

import tanteo
from bare_scenes import box_centred_pose, nees, off, surface_points
from random_parts import write_off
from tanteo.geometry import SE3
from tanteo.posterior import PosePrior, Priors, prepare
from tanteo.posterior import Table as Plane

SD, READINGS = 1e-4, 16
SEEDS = 5
"""Number of seeds of the search with which ``--seeds`` answers each scene."""
EXAMPLES = Path(__file__).parents[1] / "examples" / "parts"
NAMES = "block", "bracket_left", "bracket_right", "housing", "step_12mm", "wedge"
DESIGNS = {
    "bracket": (families.bracket, (90, 60, 70, 8, 10, 8, 5, 15)),
    "steps": (families.steps, (100, 60, 15, 18, 16, 30, 25, 8)),
    "clevis": (families.clevis, (70, 50, 60, 12, 15, 8, 45, 12)),
    "plate": (families.plate, (110, 70, 12, 5, 7, 15, 15, 20)),
}
"""Designs of which a folder has sizes, and their dimensions [mm]; the first one is the length."""


@cache
def examples():
    """Return the example parts and two blocks, one of which equals a corner of the other."""
    parts = [tanteo.read_part(EXAMPLES / f"{name}.step") for name in NAMES]
    return [prepare(p) for p in (*parts, _block("slab_big", 90, 70, 20), _block("slab_small", 40, 30, 20))]


def _block(name, *sizes):
    return _part(name, families.box((0, 0, 0), sizes))


def _part(name, solid):
    mesh = solid.to_mesh()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{name}.off"
        write_off(path, np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts))
        return tanteo.read_part(path, unit="mm")


@cache
def design(name, longer):
    """Return the prepared design of a length over the first one."""
    make, (x, *rest) = DESIGNS[name]
    return prepare(_part(f"{name}_{100 * longer - 100:.0f}", make(longer * x, *rest)))


def answer_of(points, directions, prepared, *, sds=SD, seed=0, priors=None):
    """Return the answer to touches of one of the parts."""
    readings = tanteo.Readings.from_columns(points, directions=directions, sds=np.full(len(points), sds))
    return tanteo.identify(readings, [p.part for p in prepared], seed=seed, priors=priors)


def is_right(answer, own, T):
    """Return whether the best hypothesis is the true part at the true pose."""
    best = answer.best
    if best is None or best.part != own.part.name:
        return False
    moved, angle = off(own.part, best.T_world_part, T)
    value, dof = nees(own.part, best.T_world_part, best.covariance, T)
    return bool((moved < 3e-3 and angle < np.radians(5)) or value < 100 + dof)


def patch(own, how, rng):
    """Return points and normals of a pattern in which a person may touch, part frame; None if there are too few."""
    p, n = surface_points(own, 4000, rng)
    size = own.part.diagonal
    if how == "even":
        keep = np.ones(len(p), dtype=bool)
    elif how == "corner":
        corner = own.part.vertices[rng.integers(len(own.part.vertices))]
        keep = np.linalg.norm(p - corner, axis=1) < rng.uniform(0.25, 0.4) * size
    elif how == "top":
        keep = n @ n[rng.integers(len(n))] > 0.95
    elif how == "two faces":
        up = n[rng.integers(len(n))]
        other = n[np.argmin(np.abs(n @ up) + 0.1 * rng.uniform(size=len(n)))]
        keep = (n @ up > 0.95) | (n @ other > 0.95)
    elif how == "line":
        across = rng.normal(size=3)
        keep = np.abs((p - p[rng.integers(len(p))]) @ across) < 0.01 * size * np.linalg.norm(across)
    else:
        raise ValueError(f"expected a pattern, got {how}")
    rows = np.flatnonzero(keep)
    if len(rows) < READINGS:
        return None
    rows = rng.choice(rows, READINGS, replace=False)
    return p[rows], n[rows]


def touched(how, directed, seed, k, search=0):
    """Answer touches in a pattern on one of the example parts."""
    rng = np.random.default_rng((seed, k))
    found = None
    while found is None:
        own = examples()[rng.integers(len(examples()))]
        found = patch(own, how, rng)
    T = box_centred_pose(rng)
    points = SE3.apply(T, found[0]) + SD * rng.normal(size=(READINGS, 3))
    directions = -found[1] @ T[:3, :3].T if directed else None
    return _row(lambda: answer_of(points, directions, examples(), seed=search), own, T)


def variant(longer, seed, k, search=0, readings=20):
    """Answer touches of a part of which the folder has another length only, and other designs."""
    rng = np.random.default_rng((seed, k))
    name = list(DESIGNS)[rng.integers(len(DESIGNS))]
    own, T = design(name, longer), box_centred_pose(rng)
    p, n = surface_points(own, readings, rng)
    directed = bool(rng.integers(2))
    points = SE3.apply(T, p) + SD * rng.normal(size=p.shape)
    folder = [design(other, 1.0) for other in DESIGNS]
    row = _row(lambda: answer_of(points, -n @ T[:3, :3].T if directed else None, folder, seed=search), own, T)
    near = design(name, 1.0)
    moved = SE3.apply(SE3.inverse(T), points)
    row["off"] = int(_contradictions(near, moved))
    return row


def _contradictions(near, points):
    """Return how many readings a part cannot explain at the best pose: it fits at one end or at the other."""
    ends = [0.0, near.part.box[1, 0] - points[:, 0].max(), near.part.box[0, 0] - points[:, 0].min()]
    counts = []
    for shift in ends:
        distances = near.surface.closest(points + np.array([shift, 0, 0])).distances
        counts.append(np.sum(np.abs(distances) > 5 * SD))
    return min(counts)


def one_outlier(seed, k, search=0):
    """Answer twelve touches of an example part, one of them an outlier that was touched again.

    ``as_without`` is whether the answer is recognized, or is no more so without the outlier: too few faces are touched.
    """
    rng = np.random.default_rng((seed, k))
    own, T = examples()[rng.integers(len(examples()))], box_centred_pose(rng)
    p, n = surface_points(own, 12, rng)
    points = SE3.apply(T, p) + SD * rng.normal(size=p.shape)
    again = points[:1] + SD * rng.normal(size=(1, 3))
    directions, off = -n @ T[:3, :3].T, rng.uniform(1e-3, 5e-3)
    directions = np.concatenate([directions, directions[:1]])
    exact, points = np.concatenate([points, again]), np.concatenate([points, again])
    points[0] -= off * directions[0]
    row = _row(lambda: answer_of(points, directions, examples(), seed=search), own, T)
    without = row if row["status"] == "recognized" else None
    without = without or _row(lambda: answer_of(exact, directions, examples(), seed=search), own, T)
    row["as_without"] = row["status"] == without["status"]
    return row


def on_table(seed, k, search=0, stated=False, readings=6):
    """Answer touches of a part on a table; three of twelve are on the table unless the table is stated."""
    rng = np.random.default_rng((seed, k))
    own = examples()[rng.integers(len(examples()))]
    from tanteo.catalogue import known_stable_poses

    rests = known_stable_poses(own.part)
    rest = rests[rng.choice(len(rests), p=np.array([r.probability for r in rests]) / sum(r.probability for r in rests))]
    yaw = SE3.exp(np.array([*rng.uniform(-0.2, 0.2, 2), 0.0, 0.0, 0.0, 0.0])) @ SE3.exp(
        np.array([0, 0, 0, 0, 0, rng.uniform(-np.pi, np.pi)])
    )
    T = yaw @ rest.T_table_part
    n = readings if stated else 16
    p, normals = surface_points(own, 400, rng)
    world, directions = SE3.apply(T, p), -normals @ T[:3, :3].T
    rows = np.flatnonzero((world[:, 2] > 2e-3) & (directions[:, 2] < 0.5))[:n]
    points, directions = world[rows] + SD * rng.normal(size=(len(rows), 3)), directions[rows]
    if not stated:
        beside = np.c_[T[:2, 3] + rng.choice([-1, 1], (3, 2)) * rng.uniform(0.02, 0.1, (3, 2)), SD * rng.normal(size=3)]
        clear = own.surface.closest(SE3.apply(SE3.inverse(T), beside)).distances > 2e-3
        points = np.concatenate([points, beside[clear]])
        directions = np.concatenate([directions, np.tile([0.0, 0.0, -1.0], (int(clear.sum()), 1))])
        row = _row(lambda: answer_of(points, directions, examples(), seed=search), own, T)
        row["plane"] = "plane_of_outliers" in row["kinds"]
        return row
    priors = Priors(pose=PosePrior(table=Plane(np.zeros(3), np.array([0.0, 0.0, 1.0]), 5e-4)))
    return _row(lambda: answer_of(points, None, examples(), seed=search, priors=priors), own, T)


def from_prior_on_table(seed, k, search=0, readings=6):
    """Answer touches of a part on a stated table, all drawn from the prior of the answer.

    The part is in the folder; it leans in one of twenty cases; the table is off by its standard deviation; touches are
    even over the part; the noise is known to a factor of two; a touch is an outlier with the assumed rate.
    """
    from tanteo.catalogue import known_stable_poses

    rng = np.random.default_rng((seed, k))
    own = examples()[rng.integers(len(examples()))]
    plane = Plane(np.zeros(3), np.array([0.0, 0.0, 1.0]), 5e-4)
    radius = max(one.part.radius for one in examples())
    priors = Priors(unknown=1e-6, pose=PosePrior(table=plane), radius=radius)
    rests = known_stable_poses(own.part)
    rest = rests[rng.choice(len(rests), p=np.array([r.probability for r in rests]) / sum(r.probability for r in rests))]
    T = box_centred_pose(rng)
    if rng.uniform() > plane.leaning:
        tilt = plane.sd / (0.25 * own.part.diagonal) * rng.normal(size=2)
        turn = np.array([0.0, 0.0, 0.0, *tilt, 0.0]), np.array([0.0, 0.0, 0.0, 0.0, 0.0, rng.uniform(-np.pi, np.pi)])
        T[:3, :3] = (SE3.exp(turn[0]) @ SE3.exp(turn[1]) @ rest.T_table_part)[:3, :3]
    low = (own.part.vertices @ T[:3, :3].T)[:, 2].min()
    T[:3, 3] = *rng.uniform(-0.2, 0.2, 2), plane.sd * rng.normal() - low
    draws = rng.uniform(-2, 2, 1000)
    log_factor = 2 * priors.log_noise_factor * draws[np.argmax(rng.uniform(size=1000) < np.exp(-(draws**4)))]
    p, _ = surface_points(own, readings, rng)
    points = SE3.apply(T, p) + np.exp(log_factor) * SD * rng.normal(size=p.shape)
    outliers = rng.uniform(size=readings) < priors.outlier_rate
    away = rng.normal(size=p.shape)
    away *= (radius * rng.uniform(size=readings) ** (1 / 3) / np.linalg.norm(away, axis=1))[:, None]
    points[outliers] = (T[:3, 3] + away)[outliers]
    return _row(lambda: answer_of(points, None, examples(), seed=search, priors=priors), own, T)


FIXTURES = {
    "rails": ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    "V-block": ((1.0, 0.0, 1.0), (-1.0, 0.0, 1.0), (0.0, 1.0, 0.0)),
}
"""Normals of the planes of a fixture; a part is flush with the first two, and touches the third."""


def in_fixture(which, seed, k, search=0, readings=4):
    """Answer few touches of a part that rests against stated planes: faces are flush with two of them."""
    from tanteo.catalogue import known_stable_poses

    rng = np.random.default_rng((seed, k))
    own, N = examples()[rng.integers(len(examples()))], np.array(FIXTURES[which])
    N /= np.linalg.norm(N, axis=1, keepdims=True)
    ups = np.array([r.T_table_part[2, :3] for r in known_stable_poses(own.part)])
    p = np.array([r.probability for r in known_stable_poses(own.part)])
    fits = p[:, None] * p * (np.abs(ups @ ups.T - N[0] @ N[1]) < 1e-3)
    i, j = np.unravel_index(rng.choice(fits.size, p=fits.ravel() / fits.sum()), fits.shape)
    frames = [np.stack([a, b, np.cross(a, b)], axis=1) for a, b in ((N[0], N[1]), (ups[i], ups[j]))]
    T = np.eye(4)
    T[:3, :3] = frames[0] @ np.linalg.inv(frames[1])
    T[:3, 3] = np.linalg.solve(N, -(N @ T[:3, :3] @ own.part.vertices.T).min(axis=1))
    p, _ = surface_points(own, 400, rng)
    world = SE3.apply(T, p)
    points = world[(N @ world.T > 2e-3).all(axis=0)][:readings] + SD * rng.normal(size=(readings, 3))
    planes = [Plane(np.zeros(3), n, 2e-4) for n in N]
    priors = Priors(pose=PosePrior(rests=planes))
    return _row(lambda: answer_of(points, None, examples(), seed=search, priors=priors), own, T)


@cache
def _drawn_parts():
    """Return the function that reads the parts of ``against_scenes.py``."""
    folder = Path(tempfile.mkdtemp(prefix="assumptions"))
    atexit.register(shutil.rmtree, folder)
    demo = Path(tanteo.__file__).parent / "bench" / "demo" / "parts"
    return against_worker.part_reader(EXAMPLES, demo, folder / "bracket.stl", folder)


def drawn(row, seed, k, search=0):
    """Answer a scene of ``against_scenes.py``."""
    part = _drawn_parts()
    scene = against_scenes.draw(row, k, seed, part)
    readings, parts = tanteo.Readings.from_columns(**scene.columns), [part(key) for key in scene.among]
    return _row(lambda: tanteo.identify(readings, parts, seed=search), prepare(part(scene.truth)), scene.T)


def few(seed, k, search=0):
    """Answer five to seven touches on one of six example parts."""
    rng = np.random.default_rng((seed, k))
    own, T = examples()[rng.integers(6)], box_centred_pose(rng)
    p, _ = surface_points(own, int(rng.integers(5, 8)), rng)
    points = SE3.apply(T, p) + SD * rng.normal(size=p.shape)
    return _row(lambda: answer_of(points, None, examples()[:6], seed=search), own, T)


def _row(answered, own, T):
    start = time.process_time()
    answer = answered()
    part, of_part = answer.parts[0] if answer.parts else ("", 0.0)
    return {
        "part": part == own.part.name, "P_part": of_part,
        "seconds": time.process_time() - start, "status": answer.status, "right": is_right(answer, own, T),
        "P": answer.best.probability if answer.best else 0.0, "kinds": [one.kind for one in answer.findings],
        "unknown": answer.unknown_probability,
    }  # fmt: skip


KINDS = {
    **{f"{how}, {'directed' if directed else 'bare'}": partial(touched, how, directed)
       for how in ("even", "corner", "top", "two faces", "line") for directed in (False, True)},
    "10 % longer": partial(variant, 1.1), "30 % longer": partial(variant, 1.3),
    "outlier, touched again": one_outlier,
    "on an unstated table": on_table,
    **{f"on a stated table, {n} touches": partial(on_table, stated=True, readings=n) for n in (4, 5, 6)},
    "from the prior on a table": from_prior_on_table,
    **{f"in {which}, {n} touches": partial(in_fixture, which, readings=n) for which in FIXTURES for n in (3, 5)},
    **{row: partial(drawn, row) for row in ("touch", "twins", "labelled_bare", "laser")}, "few touches": few,
}  # fmt: skip
"""Kinds of scenes and their functions of seed and number."""


def case(kind, seed, k, search):
    """Return the row of one scene of a kind."""
    return KINDS[kind](seed, k, search)


def summary(kind, rows):
    """Return the figures of one kind."""
    claimed, right = np.array([r["P"] for r in rows]), np.array([r["right"] for r in rows])
    sure = [r for r in rows if r["status"] == "recognized"]
    more = ""
    if "off" in rows[0]:
        more = ", ".join(
            f"{sum(r['off'] in those and not r['right'] and r['status'] == 'recognized' for r in rows)} of "
            f"{sum(r['off'] in those for r in rows)} sure where {what}"
            for what, those in (("none", (0,)), ("1", (1,)), ("2 or more contradict", range(2, 99)))
        )
    if "plane" in rows[0]:
        more = f"named {sum(r['plane'] for r in rows)}"
    if "as_without" in rows[0]:
        more = f"{sum(r['as_without'] for r in rows)} as without the outlier"
    gap = (claimed - right).std() / np.sqrt(len(rows))
    return (
        kind, str(len(rows)), f"{claimed.mean():.3f}", f"{right.mean():.3f}",
        f"{claimed.mean() - right.mean():+.3f} ± {gap:.3f}",
        f"{np.mean([r['P_part'] - r['part'] for r in rows]):+.3f}", f"{sum(r['right'] for r in sure)} of {len(sure)}",
        str(int(np.sum((claimed > 0.9) & ~right))), str(sum(r["status"] == "unknown" for r in rows)),
        f"{np.mean([r['seconds'] for r in rows]):.2f} s", more,
    )  # fmt: skip


def run(kinds, scenes, seed, keep=None, processes=1, seeds=(0,)):
    """Print the table of the kinds, and return the reliability table."""
    done, rows = {}, []
    for kind in kinds:
        cases = [(kind, seed, k, search) for k in range(scenes) for search in seeds]
        done |= dict(zip(cases, run_cases(case, cases, keep, processes), strict=True))
        rows.append(summary(kind, [done[c] for c in cases]))
        print(*rows[-1], sep="\t", flush=True)
    columns = (
        "kind", "scenes", "claimed", "right", "claimed - right", "of the part", "recognized, right",
        "wrong above 0.9", "unknown", "time", "",
    )  # fmt: skip
    if len(seeds) > 1:
        columns = (*columns, "seeds agree in P", "of the part", "in P, pose fixed")
        rows = [(*row, *agreement([[done[row[0], seed, k, s] for s in seeds] for k in range(scenes)])) for row in rows]
        scenes_of_all = [[done[kind, seed, k, s] for s in seeds] for kind in kinds for k in range(scenes)]
        print("all kinds: seeds agree in", " | ".join(agreement(scenes_of_all)), flush=True)
    text = f"{READINGS} touches of {1e3 * SD:g} mm, seed {seed}, {len(seeds)} seeds of the search."
    print(Table("Claimed against right", text, columns, rows).markdown(), "", sep="\n")
    return reliability(list(done.values()))


def agreement(scenes):
    """Return how many scenes have the same probability for all seeds of the search, within 0.05.

    Args:
        scenes: rows of all seeds of each scene.

    Returns:
        Of the best hypothesis; of the best part; of the best hypothesis where no answer is ``insufficient``.
    """
    fixed = [rows for rows in scenes if all(row["status"] != "insufficient" for row in rows)]
    return tuple(
        f"{sum(np.ptp([row[name] for row in rows]) < SAME_P for rows in some)} of {len(some)}"
        for name, some in (("P", scenes), ("P_part", scenes), ("P", fixed))
    )


SAME_P = 0.05
"""Largest difference of two probabilities that are the same."""

BINS = (0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 0.98, 1.0)
"""Borders of the bins of the reliability table."""


def reliability(rows):
    """Return the table of claimed against right by bins of the claimed probability, of the pose and of the part."""
    lines = []
    for low, high in itertools.pairwise(BINS):
        cells = [f"{low:g} to {high:g}"]
        for claimed, right in (("P", "right"), ("P_part", "part")):
            some = [row for row in rows if low <= row[claimed] < high or row[claimed] == high == 1]
            p, q = (np.mean([row[name] for row in some]) if some else np.nan for name in (claimed, right))
            se = np.sqrt(p * (1 - p) / len(some)) if some else np.nan
            cells += [str(len(some)), f"{p:.3f}", f"{q:.3f} ± {se:.3f}"]
        lines.append(tuple(cells))
    columns = "claimed", "scenes", "pose claimed", "right", "scenes", "part claimed", "right"
    text = "All kinds above. The standard error is that of the fraction right if the claim holds."
    return Table("Reliability", text, columns, lines)


if __name__ == "__main__":
    rest, keep, processes = options(sys.argv[1:])
    seeds = range(SEEDS) if "--seeds" in rest else (0,)
    numbers, names = [w for w in rest if w.isdecimal()], [w for w in rest if not w.isdecimal() and w != "--seeds"]
    scenes, seed = (int(numbers[i]) if len(numbers) > i else default for i, default in ((0, 40), (1, 1)))
    kinds = [kind for kind in KINDS if not names or any(kind.startswith(name) for name in names)]
    print(run(kinds, scenes, seed, keep, processes, tuple(seeds)).markdown())
