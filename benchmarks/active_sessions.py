"""Sessions by the hundred, for ``active.py``: one function runs one scene, another makes the table of all."""

from __future__ import annotations

import sys
import time
from functools import cache
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from campaign import run_cases
from common import Table

import tanteo
from sensing_scenes import (
    FLIGHT,
    LASER,
    beam_hits,
    drawn_truth,
    give_any_readings,
    new_session,
    off,
    rough,
    sense,
    true_range,
)
from tanteo.planning import Action
from tanteo.planning.context import Choice
from tanteo.planning.predictions import predict
from tanteo.planning.samples import draw
from tanteo.posterior import Priors, prepare
from tanteo.words.findings import Stated

HERE = Path(__file__).parents[1]
OURS = ("block", "bracket_left", "bracket_right", "clamp", "flange", "housing", "t_slot", "wedge")
SETS = HERE.parent / "shared" / "data" / "step_parts"
PLACE = 0.005, 0.15
"""How roughly the place of the part is known: each axis [m], about each axis [rad]."""

SENSORS = {"laser": (LASER, 5e-4), "flight": (FLIGHT, 5e-3)}
"""Sensor, and the largest corner sd at which a part counts as placed [m]."""

POLICIES = "information", "random", "nearest", "largest-face", "3-2-1"
MOST = 30
USUAL = Priors().unknown
"""Prior probability of the unknown object if no other is given."""

TOLERANCE = 1e-3
"""Of the sessions that end by themselves [m]."""


@cache
def twenty():
    """Return the twenty prepared parts."""
    parts = [tanteo.read_part(HERE / "examples" / "parts" / f"{name}.step") for name in OURS]
    if SETS.exists():
        others = sorted(tanteo.read_parts([SETS]).parts, key=lambda part: -part.diagonal)
        parts += [part for part in others if part.name != "caxif__TAIL_MIDDLE_PART"][:12]  # twice in the set
    return [prepare(part) for part in parts]


@cache
def three():
    """Two mirrored parts and a wedge."""
    names = "bracket_left", "bracket_right", "wedge"
    return [prepare(tanteo.read_part(HERE / "examples" / "parts" / f"{name}.step")) for name in names]


def readings_of(sensor, policy, seed, scene, unknown=USUAL):
    """Return the readings until the part is known and until it is placed (``MOST + 1``: never), and both verdicts."""
    (probe, corner), targets = SENSORS[sensor], twenty()
    start, rng = rough(targets, PLACE, Priors(unknown=unknown)), np.random.default_rng((seed, scene))
    k, T = drawn_truth(start, rng, scene % len(targets))
    session = new_session(start, probe, policy, scene, tolerance=corner, confidence=1 - 1e-9,
                          least_gain=0.0, max_measurements=10**6)  # fmt: skip
    begun, row = time.process_time(), {"known": MOST + 1, "placed": MOST + 1, "right": True, "off": 0.0}
    rng = np.random.default_rng((seed, scene, 1))
    while session.count < MOST and isinstance(action := session.ask(), Action):
        distance = true_range(targets[k], T, action)
        if np.isfinite(distance):
            distance = max(distance + float(session.probe.law.const) * rng.normal(), 1e-6)
        step = session.tell(action.read(distance))
        best = int(np.argmax(step.probabilities))
        if row["known"] > MOST and step.probabilities[best] > 0.99:
            row |= {"known": session.count, "right": best == k}
        if step.probabilities[best] > 0.99 and step.corner_sd <= corner:
            row |= {"placed": session.count, "off": off(session, k, T) / corner}
            break
    return row | {"spent": (time.process_time() - begun) / max(session.count, 1)}


def policies(sensor, scenes, seed, keep, processes, names=POLICIES, unknown=None):
    """Return a table of the readings that each policy needs; ``unknown`` is the prior of the unknown object."""
    more = () if unknown is None else (unknown,)
    cases = [(sensor, policy, seed, scene, *more) for scene in range(scenes) for policy in names]
    done = list(zip(cases, run_cases(readings_of, cases, keep, processes), strict=True))
    table = [_policy_row(name, [row for case, row in done if case[1] == name]) for name in names]
    probe, corner = SENSORS[sensor]
    columns = ("policy", "part known: median / 90 %", "placed: median / 90 %", "never placed", "right when known",
               "processor time a reading")  # fmt: skip
    text = (
        f"{len(twenty())} parts, {scenes} scenes, {probe.name} of {1e3 * float(probe.law.const):g} mm, place known to "
        f"{1e3 * PLACE[0]:g} mm and {PLACE[1]:g} rad an axis; placed: largest corner sd {1e3 * corner:g} mm; at most "
        f"{MOST} readings; prior of the unknown object {USUAL if unknown is None else unknown:g}; seed {seed}."
    )
    return Table(f"Readings needed, {probe.name}", text, columns, table)


def _policy_row(name, rows):
    known, placed = ([row[key] for row in rows] for key in ("known", "placed"))
    cells = [
        f"{np.median(x):.1f} / {np.percentile(x, 90):.1f}".replace(f"{MOST + 1}.0", f"> {MOST}")
        for x in (known, placed)
    ]
    right, spent = np.mean([row["right"] for row in rows]), np.median([row["spent"] for row in rows])
    return name, *cells, f"{sum(p > MOST for p in placed)}", f"{right:.3f}", f"{1e3 * spent:.0f} ms"


class Clairvoyant:
    """Policy that has the true reading of each candidate, and takes the one that makes the true part most probable."""

    name = "clairvoyant"

    def __init__(self, target, part, T):
        self.target, self.part, self.T = target, part, T

    def choose(self, context):
        """Choose by samples of the posterior, a reading without noise, and the session's outlier rate."""
        s, c, priors = context, context.candidates, context.state.start.priors
        samples = draw(s.state, 600)
        p = predict(samples, c.origins, c.directions)
        true = beam_hits(self.target, self.T[None], c.origins, c.directions)[0]  # (C, 1)
        answers, hits = p.hit & s.probe.answers(p.ranges, p.cosines), np.isfinite(true)
        own = s.probe.variance(np.where(answers, p.ranges, 1.0), np.where(answers, p.cosines, 1.0)) + p.variances
        gaps = np.where(answers, p.ranges, 0.0) - np.where(hits, true, 0.0)
        hit = np.where(answers, np.exp(-0.5 * gaps**2 / own) / np.sqrt(2 * np.pi * own), 0.0)
        read = (1 - priors.outlier_rate) * hit + priors.outlier_rate / (2 * priors.radius)
        nothing = np.where(answers, priors.outlier_rate, 1 - priors.outlier_rate)
        w = np.where(hits, read, nothing) * samples.weights
        P = w @ (samples.part == self.part) / np.maximum(w.sum(axis=1), 1e-300)
        return Choice(int(np.argmax(P)), 1.0, Stated("The true part is most probable after it."))


def named(policy, seed, scene):
    """Return the readings until a session is sure of the part, and whether the part is right."""
    (probe, _), targets = SENSORS["laser"], twenty()
    start, rng = rough(targets, PLACE), np.random.default_rng((seed, scene))
    k, T = drawn_truth(start, rng, scene % len(targets))
    clairvoyant = policy == Clairvoyant.name
    session = new_session(
        start, probe, "random" if clairvoyant else policy, scene, least_gain=0.0, max_measurements=MOST
    )
    if clairvoyant:
        session.policy = Clairvoyant(targets[k], k, T)
    end = sense(session, targets[k], T, np.random.default_rng((seed, scene, 1)))
    count = session.count if end.reached else MOST + 1
    return {"known": count, "right": int(np.argmax(session.state.of_parts())) == k}


def known_parts(scenes, seed, keep, processes):
    """Return a table of sessions that stop at a sure part; the clairvoyant policy gives a lower bound."""
    compared = ("information", "random", Clairvoyant.name)
    cases = [(policy, seed, scene) for scene in range(scenes) for policy in compared]
    done = list(zip(cases, run_cases(named, cases, keep, processes), strict=True))
    table = []
    for policy in compared:
        rows = [row for case, row in done if case[0] == policy]
        known = [row["known"] for row in rows]
        cells = f"{np.median(known):.1f} / {np.percentile(known, 90):.1f}", f"{np.mean(known):.1f}"
        table.append((policy, *cells, f"{sum(row['right'] for row in rows)}/{scenes}"))
    columns = "policy", "part known: median / 90 %", "mean", "right"
    text = f"{len(twenty())} parts, {scenes} scenes, laser 0.3 mm, ends at P > 0.99 for any pose, seed {seed}."
    return Table("Which part is it?", text, columns, table)


def ended(seed, scene):
    """Return whether a session that ends at P > 0.99 and 1 mm at 95 % is right and within 1 mm."""
    targets, rng = twenty(), np.random.default_rng((seed, scene))
    start = rough(targets, PLACE)
    k, T = drawn_truth(start, rng)
    session = new_session(start, LASER, seed=scene, tolerance=TOLERANCE, max_measurements=40)
    end = sense(session, targets[k], T, rng)
    return {
        "readings": session.count, "reached": end.reached, "stated": session.steps[-1].within,
        "right": int(np.argmax(session.state.of_parts())) == k, "inside": bool(off(session, k, T) <= TOLERANCE),
    }  # fmt: skip


def stops(scenes, seed, keep, processes):
    """Sessions that end by themselves."""
    rows = run_cases(ended, [(seed, scene) for scene in range(scenes)], keep, processes)
    good = [row for row in rows if row["reached"]]
    right, inside, stated = (np.mean([row[key] for row in good]) for key in ("right", "inside", "stated"))
    cells = (
        f"{len(good)}/{scenes}", f"{np.median([row['readings'] for row in rows]):.0f}",
        f"{sum(row['right'] for row in good)}/{len(good)} ({right:.3f})",
        f"{inside:.3f} ± {np.sqrt(0.05 * 0.95 / max(len(good), 1)):.3f}", f"{stated:.3f}",
    )  # fmt: skip
    text = f"{scenes} scenes of {len(twenty())} parts, laser 0.3 mm, ends at P > 0.99 and 1 mm at 95 %, seed {seed}."
    return Table(
        "Do sessions end rightly?", text, ("ended", "median readings", "right part", "inside", "stated"), [cells]
    )


def run_sequence(seed, number):
    """Run a random sequence of planned, wrong, free, late, repeated and infinite readings; return count and error."""
    targets, rng = three(), np.random.default_rng((seed, number))
    start = rough(targets)
    k, T = drawn_truth(start, rng)
    session, broke = (
        new_session(start, seed=number, policy="random", tolerance=1e-6, max_measurements=1000, least_gain=0.0),
        "",
    )
    try:
        give_any_readings(session, targets[k], T, rng, int(rng.integers(1, 7)))
    except Exception as error:  # noqa: BLE001 - every exception is counted and shown
        broke = f"sequence {number}: {type(error).__name__}: {error}"
    return {"readings": len(session.steps), "broke": broke}


def reports(sequences, seed, keep, processes):
    """Return a table of random sequences of readings; each must leave a valid posterior."""
    rows = run_cases(run_sequence, [(seed, number) for number in range(sequences)], keep, processes)
    broken = [row["broke"] for row in rows if row["broke"]]
    print(*broken, sep="\n", file=sys.stderr)
    text = "Weights sum to one, covariances are positive, only values that are not finite raise an error."
    cells = tuple(map(str, (sequences, sum(row["readings"] for row in rows), len(broken))))
    return Table("Random sequences of readings", text, ("sequences", "readings", "broken"), [cells])
