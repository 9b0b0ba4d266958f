"""How many readings does a session need? ``python benchmarks/active.py SUBJECT [scenes] [seed]``.

Subjects: ``laser`` and ``flight`` (20 parts, every policy on the same scenes and seeds: readings to a part known with
P > 0.99 and to a worst corner of 0.5 or 5 mm, and whether what was said then was true), ``stops`` (sessions that end by
their own rule: are they right, are they inside), ``twins`` (one reading after locating), ``patch`` (six planned touches
against six in a patch), ``panel`` (ten touches of a large panel), ``tells`` (random sequences of anything that can be
told), ``times`` (ask and tell over hypotheses and candidates). The parts are eight of the examples and the twelve
largest of the step_parts set, where that is at hand.
"""

from __future__ import annotations

import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from common import Table

import tanteo
from cli.conftest import prism, stl
from sensing_scenes import FLIGHT, LASER, drawn_truth, new_session, off, rough, sense, tell_anything, true_range
from tanteo.active import Probe, Start, Stop, around, at_pose, begin, draw, plan, predict, propose, update
from tanteo.active.distinguish import laid_on, located
from tanteo.active.policies import POLICIES
from tanteo.active.utility import expected_information
from tanteo.lie import SE3
from tanteo.matching import Priors
from tanteo.matching.verdict import corner_sd
from tanteo.sensors.law import NoiseLaw
from tanteo.session import Action, Sensing, Session
from tanteo.surface_search import prepare_target

HERE = Path(__file__).parents[1]
OURS = ("block", "bracket_left", "bracket_right", "clamp", "flange", "housing", "t_slot", "wedge")
SETS = HERE.parent / "shared" / "data" / "step_parts"
PLACE = 0.005, 0.15
"""How roughly the place of the part is known: each axis [m], about each axis [rad]."""


def twenty():
    """The parts, prepared."""
    parts = [tanteo.read_part(HERE / "examples" / "parts" / f"{name}.step") for name in OURS]
    if SETS.exists():
        others = sorted(tanteo.read_parts([SETS]).parts, key=lambda part: -part.diagonal)
        parts += [part for part in others if part.name != "caxif__TAIL_MIDDLE_PART"][:12]  # twice in the set
    return [prepare_target(part) for part in parts]


def until(session, target, T, rng, k, corner, most):
    """Readings to a known part and to a placed one, and whether they were right then."""
    known = placed = None
    while session.count < most and isinstance(action := session.ask(), Action):
        distance = true_range(target, T, action)
        if np.isfinite(distance):
            distance = max(distance + float(session.probe.law.const) * rng.normal(), 1e-6)
        step = session.tell(action.read(distance))
        best = int(np.argmax(step.probabilities))
        if known is None and step.probabilities[best] > 0.99:
            known = session.count, best == k
        if session.belief.weights[0] > 0.95 and step.probabilities[best] > 0.99 and step.worst_corner_sd <= corner:
            placed = session.count, off(session, k, T) / corner
            break
    return known, placed


def policies(probe, corner, scenes, seed):
    """Readings that every policy needs."""
    targets = twenty()
    start, rows = rough(targets, PLACE), []
    for name in ("information", "random", "nearest", "largest-face", "3-2-1"):
        known, placed, right, spent = [], [], [], time.process_time()
        for scene in range(scenes):
            rng = np.random.default_rng((seed, scene))
            k, T = drawn_truth(start, rng, scene % len(targets))
            session = new_session(start, probe, name, scene, probability=None, tolerance=corner, confidence=1 - 1e-9,
                                  least_gain=0.0, most=10**6)  # fmt: skip
            a, b = until(session, targets[k], T, np.random.default_rng((seed, scene, 1)), k, corner, MOST)
            known.append(a[0] if a else MOST + 1)
            placed.append(b[0] if b else MOST + 1)
            right.append(a is None or a[1])
        spent = (time.process_time() - spent) / max(sum(placed), 1)
        cells = [
            f"{np.median(x):.1f} / {np.percentile(x, 90):.1f}".replace(f"{MOST + 1}.0", f"> {MOST}")
            for x in (known, placed)
        ]
        rows.append(
            (name, *cells, f"{sum(p > MOST for p in placed)}", f"{np.mean(right):.3f}", f"{1e3 * spent:.0f} ms")
        )
        print(rows[-1], file=sys.stderr, flush=True)
    columns = ("policy", "part known: median / 90 %", "placed: median / 90 %", "never placed", "right when known",
               "processor time a reading")  # fmt: skip
    text = (
        f"{len(targets)} parts, {scenes} scenes, {probe.name} of {1e3 * float(probe.law.const):g} mm, place known to "
        f"{1e3 * PLACE[0]:g} mm and {PLACE[1]:g} rad an axis; placed: worst corner {1e3 * corner:g} mm, 1 sd; at most "
        f"{MOST} readings; seed {seed}."
    )
    return Table(f"Readings needed, {probe.name}", text, columns, rows)


MOST = 30


def stops(scenes, seed):
    """Sessions that end by themselves: P > 0.99 and 1 mm at 95 %."""
    targets = twenty()
    start, tolerance, rows = rough(targets, PLACE), 1e-3, []
    right, inside, stated, counts = [], [], [], []
    for scene in range(scenes):
        rng = np.random.default_rng((seed, scene))
        k, T = drawn_truth(start, rng)
        session = new_session(start, LASER, seed=scene, tolerance=tolerance, most=40)
        end = sense(session, targets[k], T, rng)
        counts.append(session.count)
        if end.reached:
            right.append(int(np.argmax(session.belief.of_parts())) == k)
            inside.append(off(session, k, T) <= tolerance)
            stated.append(session.steps[-1].within)
    rows.append((
        f"{len(right)}/{scenes}", f"{np.median(counts):.0f}", f"{sum(right)}/{len(right)}",
        f"{np.mean(inside):.3f} ± {np.sqrt(0.05 * 0.95 / max(len(inside), 1)):.3f}", f"{np.mean(stated):.3f}",
    ))  # fmt: skip
    text = f"{scenes} scenes of {len(targets)} parts, laser 0.3 mm, ends at P > 0.99 and 1 mm at 95 %, seed {seed}."
    return Table("Do sessions end rightly?", text, ("ended", "median readings", "right part", "inside", "said"), rows)


def twins(scenes, seed):
    """One reading after locating: which of the two is it?"""
    rows = []
    for names in (("bracket_left", "bracket_right"), ("step_12mm", "step_15mm")):
        pair = [prepare_target(tanteo.read_part(HERE / "examples" / "parts" / f"{n}.step")) for n in names]
        for probe in (LASER, FLIGHT):
            right = sure = 0
            for scene in range(scenes):
                rng = np.random.default_rng((seed, scene))
                k = int(rng.integers(2))
                poses = laid_on(pair[k], pair[1 - k])
                sd = 2e-4 if probe is LASER else 2e-3
                start = Start(
                    tuple(pair), np.array([k] + [1 - k] * len(poses)), np.concatenate([np.eye(4)[None], poses]),
                    np.stack([located(pair[k], sd)] + [located(pair[1 - k], sd)] * len(poses)),
                    np.r_[0.5, np.full(len(poses), 0.5 / len(poses))], Priors(),
                )  # fmt: skip
                T = SE3.exp(np.linalg.cholesky(start.covariances[0]) @ rng.normal(size=6))
                session = new_session(start, probe, seed=scene, probability=0.999, most=1)
                sense(session, pair[k], T, rng)
                P = session.belief.of_parts()
                right += int(np.argmax(P)) == k
                sure += P[k] > 0.95
            rows.append((" / ".join(names), probe.name, f"{right}/{scenes}", f"{sure}/{scenes}"))
    text = "The part is located to 0.2 mm (laser) or 2 mm (time of flight) at its corners, as either of the two."
    return Table("Twins: one reading", text, ("pair", "sensor", "right", "right with P > 0.95"), rows)


def boxed(size):
    """A block of that size [mm], prepared."""
    x, y, z = size
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "block.stl"
        path.write_text(stl(prism([(0, 0), (x, 0), (x, y), (0, y)], z)))
        return prepare_target(tanteo.read_part(path, unit="mm"))


def patch():
    """Six touches of 0.3 mm on a block of 200 x 150 x 80 mm."""
    target, C = boxed((200, 150, 80)), np.diag(np.repeat([5e-3, 0.05], 3) ** 2)
    probe = Probe("touch", NoiseLaw.of(3e-4), contact=True, standoff=0.03)
    planned = plan(at_pose(target, np.eye(4), C), probe, 1e-6, most=6)
    corner = np.array([0.2, 0.15, 0.08])
    # three on the top, two on a long side, one on a short side, all within 40 mm of one corner
    x = corner - np.array([[2, 2, 0], [38, 2, 0], [2, 38, 0], [2, 0, 10], [38, 0, 10], [0, 10, 38]]) / 1e3
    n = np.array([[0, 0, 1]] * 3 + [[0, 1, 0]] * 2 + [[1, 0, 0]], dtype=float)
    G = np.concatenate([n, np.cross(x, n)], axis=1)
    clustered = corner_sd(target.part, np.linalg.inv(np.linalg.inv(C) + G.T @ G / 3e-4**2))
    rows = [
        ("planned", f"{1e3 * planned.readings[-1].worst_corner_sd:.2f} mm"),
        ("in a patch", f"{1e3 * clustered:.2f} mm"),
    ]
    text = "Six touches of 0.3 mm on a block of 200 x 150 x 80 mm, place known to 5 mm and 0.05 rad an axis before."
    return Table("Planned and clustered", text, ("six touches", "worst corner, 1 sd"), rows)


def panel(scenes, seed):
    """Ten touches of a panel of 1.56 x 0.41 x 0.20 m that is known to 50 mm and 0.1 rad."""
    outline = [(0, 0), (1560, 0), (1560, 250), (1300, 410), (200, 410), (0, 300)]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "panel.stl"
        path.write_text(stl(prism(outline, 200)))
        target = prepare_target(tanteo.read_part(path, unit="mm"))
    start, rows = around([target], np.eye(4), np.diag(np.repeat([0.05, 0.065], 3) ** 2)), []
    for sd in (5e-4, 2e-3):
        probe = Probe("touch", NoiseLaw.of(sd), contact=True, max_range=0.6, standoff=0.3, clearance=0.02)
        moved, turned, needed = [], [], []
        for scene in range(scenes):
            rng = np.random.default_rng((seed, scene))
            _, T = drawn_truth(start, rng)
            session = Session(
                start, probe, Sensing(sd=sd), POLICIES["information"], Stop(None, 3e-3, 1 - 1e-9, 0.0, 30)
            )
            enough = None
            while session.count < 30 and isinstance(action := session.ask(), Action):
                distance = true_range(target, T, action)
                session.tell(action.read(distance + sd * rng.normal() if np.isfinite(distance) else np.inf))
                gap = SE3.inverse(T) @ session.belief.poses[0]
                at = np.linalg.norm(SE3.apply(gap, target.part.centroid) - target.part.centroid)
                if session.count == 10:
                    moved.append(at)
                    turned.append(np.linalg.norm(SE3.log(gap)[3:]))
                if enough is None and session.steps[-1].worst_corner_sd <= 3e-3:
                    enough = session.count
                if session.count >= 10 and enough is not None:
                    break
            needed.append(enough or 31)
        rows.append((
            f"{1e3 * sd:g} mm", f"{1e3 * np.mean(moved):.2f} mm", f"{np.degrees(np.mean(turned)):.3f} deg",
            f"{np.median(needed):.0f}",
        ))  # fmt: skip
    columns = ("touch sd", "place after ten", "turn after ten", "touches to a worst corner of 3 mm, median")
    text = f"A panel of 1.56 x 0.41 x 0.20 m, known to 50 mm and 0.065 rad an axis, {scenes} scenes, seed {seed}."
    return Table("A large panel", text, columns, rows)


def tells(sequences, seed):
    """Random sequences: as asked, wrong, free, late, repeated, not finite; each tell must leave a valid belief."""
    names = "bracket_left", "bracket_right", "wedge"
    start = rough([prepare_target(tanteo.read_part(HERE / "examples" / "parts" / f"{name}.step")) for name in names])
    count = broken = 0
    for number in range(sequences):
        rng = np.random.default_rng((seed, number))
        k, T = drawn_truth(start, rng)
        session = new_session(start, seed=number, policy="random", tolerance=1e-6, most=1000, least_gain=0.0)
        try:
            tell_anything(session, start.targets[k], T, rng, int(rng.integers(1, 7)))
        except Exception as error:  # noqa: BLE001 - whatever it is, it is counted and shown
            broken += 1
            print(f"sequence {number}: {type(error).__name__}: {error}", file=sys.stderr)
        count += len(session.steps)
    text = "Weights sum to one, covariances are positive, nothing is raised but for what is not finite."
    return Table(
        "Random sequences of tell",
        text,
        ("sequences", "tells", "broken"),
        [tuple(map(str, (sequences, count, broken)))],
    )


def times():
    """Processor time of ask and tell."""
    target = prepare_target(tanteo.read_part(HERE / "examples" / "parts" / "bracket_left.step"))
    rows = []
    for hypotheses in (1, 3, 10, 30):
        rng = np.random.default_rng(1)
        Ts = SE3.exp(np.r_[[np.zeros(6)], 0.05 * rng.normal(size=(hypotheses - 1, 6))])
        C = np.tile(located(target, 1e-3), (hypotheses, 1, 1))
        start = Start((target,), np.zeros(hypotheses, dtype=int), Ts, C, np.ones(hypotheses), Priors())
        for count in (100, 500, 2000):
            belief = begin(start)
            asked = cpu(lambda b=belief, n=count: _asked(b, n))
            session = new_session(start, LASER, least_gain=0.0)
            action = session.ask()
            readings = session.sensing.touches(action.read(true_range(target, Ts[0], action)))
            told = cpu(lambda b=belief, r=readings: update(b, *r))
            rows.append((str(hypotheses), str(count), f"{1e3 * asked:.0f} ms", f"{1e3 * told:.0f} ms"))
    return Table(
        "Times", "One core, processor time, median of five.", ("hypotheses", "candidates", "ask", "tell"), rows
    )


def _asked(belief, count):
    candidates = propose(belief, replace(LASER, clearance=0.005), count)
    samples = draw(belief, 128)
    expected_information(samples, predict(samples, candidates.origins, candidates.directions), LASER)


def cpu(work):
    """Median processor time of five calls after one [s]."""
    work()
    spent = []
    for _ in range(5):
        begun = time.process_time()
        work()
        spent.append(time.process_time() - begun)
    return float(np.median(spent))


def main():
    subject = sys.argv[1] if len(sys.argv) > 1 else "times"
    scenes = int(sys.argv[2]) if len(sys.argv) > 2 else 20
    seed = int(sys.argv[3]) if len(sys.argv) > 3 else 1991
    subjects = {
        "laser": lambda: policies(LASER, 5e-4, scenes, seed), "flight": lambda: policies(FLIGHT, 5e-3, scenes, seed),
        "stops": lambda: stops(scenes, seed), "twins": lambda: twins(scenes, seed), "patch": patch,
        "panel": lambda: panel(scenes, seed), "tells": lambda: tells(scenes, seed), "times": times,
    }  # fmt: skip
    if subject not in subjects:
        sys.exit(f"subject: expected one of {', '.join(subjects)}, got {subject}.")
    print(subjects[subject]().markdown())


if __name__ == "__main__":
    main()
