"""Compare what sessions and plans promise with what they keep.

``python benchmarks/promises.py SUBJECT [scenes] [seed]``

Subjects:

- ``cast``: sessions with a stylus of 0.05 mm on parts each face of which is displaced by 0.2 mm and tilted by a third
  of it, to 0.5 mm.
- ``exact``: sessions with a touch of 0.15 mm on exact parts, to 0.3 mm.
- ``drawn``: sessions with a stylus of 0.05 mm at 0.5 m from the origin, with the scale error, drift and warp that
  sessions assume, drawn from their priors; nothing is stated; to 0.5 mm. ``plain``: the same without these errors.
  ``known``: the scenes of ``plain``, and none of these errors is assumed.
- ``next``: logs of the 3-2-1 rule at random places, with the seventh touch that ``next_reading`` names.
- ``tip``: touches with poses of the hand whose tip is 0.4 mm off, without a stated error of the tip.
- ``plans``: planned touches of the parts, made at placements from the prior and evaluated by ``locate``.
- ``assumed``: the same touches with the scale error, drift and warp that ``locate`` assumes, drawn from their prior.

``--processes`` and ``--keep`` work as in ``campaign.py``.
"""

from __future__ import annotations

import sys
import time
from functools import cache, partial
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from campaign import options, run_cases
from common import Table
from scipy.stats import chi2

import tanteo
from log_of_touches import with_the_seventh
from sensing_scenes import (
    EXACT_MACHINE,
    assumed_of,
    carried_out,
    displaced_faces,
    made_session,
    off,
    sense_made,
    touches_of_hand,
)
from tanteo.geometry import SE3
from tanteo.planning import Probe, plan
from tanteo.planning.start import at_pose
from tanteo.posterior import prepare
from tanteo.sensors.error_states import WITHIN_FACE
from tanteo.sensors.presets import NoiseLaw

PARTS = "block", "bracket_left", "housing", "t_slot", "wedge"
CAST = {"form_sd": 2e-4, "sd": 5e-5, "tolerance": 5e-4}
EXACT = {"form_sd": 0.0, "sd": 1.5e-4, "tolerance": 3e-4}
DRAWN = {"form_sd": 0.0, "sd": 5e-5, "tolerance": 5e-4, "errors": (), "at": (0.4, 0.3, 0.0)}
SESSIONS = {"cast": CAST, "exact": EXACT, "drawn": DRAWN, "plain": DRAWN, "known": DRAWN | {"errors": EXACT_MACHINE}}
DRIFTS = 15
"""Number of readings over which the drawn drift is the assumed one."""
PLANNED = 4e-4
MOST = 40
COLUMNS = "part", "reached", "median readings", "stated", "kept", "kept - stated [standard errors]", "seconds"


@cache
def target(name):
    """Return a prepared example part."""
    return prepare(tanteo.read_part(Path(__file__).parents[1] / "examples" / "parts" / f"{name}.step"))


def session(name, seed, scene, kind):
    """Run one session to its goal; return what it promised and whether it kept it."""
    part, rng, begun = target(name), np.random.default_rng((seed, scene)), time.process_time()
    setup = SESSIONS[kind]
    one, T = made_session(part, rng=rng, seed=scene, max_measurements=MOST, **setup)
    form_sd, machine = setup["form_sd"], None
    surface = displaced_faces(part, form_sd, rng, form_sd * WITHIN_FACE)
    if kind == "drawn":
        machine, surface = assumed_of(part, setup["sd"], rng, DRIFTS)
    end = sense_made(one, part, T, surface, rng, machine)
    error = off(one, 0, T)
    return {
        "stated": one.steps[-1].within, "kept": error <= setup["tolerance"], "reached": end.reached,
        "readings": one.count, "seconds": time.process_time() - begun,
    }  # fmt: skip


def sessions(kind, scenes, seed, keep, processes):
    """Return a table of sessions of one kind by part: promised and kept, for those that reached their goal."""
    cases = [(PARTS[k % len(PARTS)], seed, k, kind) for k in range(scenes)]
    done = list(zip(cases, run_cases(session, cases, keep, processes), strict=True))
    rows = [_row(name, [row for case, row in done if case[0] == name]) for name in PARTS]
    setup = SESSIONS[kind]
    text = (
        f"Touches of {1e3 * setup['sd']:g} mm, faces displaced by {1e3 * setup['form_sd']:g} mm (sd), goal "
        f"{1e3 * setup['tolerance']:g} mm at 95 %, pose known to 2 mm and 0.05 rad, at most {MOST} readings; "
        f"seed {seed}."
    )
    return Table(f"Sessions, {kind}", text, COLUMNS, [*rows, _row("all", [row for _, row in done])])


@cache
def planned(name):
    """Return the start, the sensor and the plan of a part."""
    part = target(name)
    J = SE3.adjoint(SE3.from_parts(np.eye(3), part.part.centroid))
    start = at_pose(part, np.eye(4), J @ np.diag(np.repeat([3e-3, np.radians(2)], 3) ** 2) @ J.T)
    probe = Probe("touch", NoiseLaw.of(EXACT["sd"]), contact=True, standoff=0.03)
    return start, plan(start, probe, PLANNED)


def placement(name, seed, scene, kind):
    """Make the touches of a plan at one placement, and locate the part by them."""
    start, found = planned(name)
    begun, rng, assumed = time.process_time(), np.random.default_rng((seed, scene)), kind == "assumed"
    error = carried_out(found, target(name), start, EXACT["sd"], rng, assumed=assumed)
    return {
        "stated": found.findings[0].within_assumed if assumed else found.readings[-1].within,
        "kept": error <= PLANNED, "reached": found.reached,
        "readings": len(found.readings), "seconds": time.process_time() - begun,
    }  # fmt: skip


def plans(kind, scenes, seed, keep, processes):
    """Return a table of planned touches at placements from the prior: promised and kept."""
    cases = [(PARTS[k % len(PARTS)], seed, k, kind) for k in range(scenes)]
    done = list(zip(cases, run_cases(placement, cases, keep, processes), strict=True))
    rows = [_row(name, [row for case, row in done if case[0] == name]) for name in PARTS]
    text = (
        f"Touches of {1e3 * EXACT['sd']:g} mm, goal {1e3 * PLANNED:g} mm at 95 %, prior of 3 mm and 2 degrees about "
        f"the centroid; located by tanteo.locate with this prior; seed {seed}."
    )
    return Table(
        "Plans" if kind == "plans" else "Plans, with the errors that locate assumes",
        text,
        COLUMNS,
        [*rows, _row("all", [row for _, row in done])],
    )


LOGS = "bracket_left", "clamp", "housing"


def seventh(name, seed, scene):
    """Locate a part by six touches of the 3-2-1 rule, and again with a seventh."""
    part, rng = target(name).part, np.random.default_rng((seed, scene))
    first, second, T = with_the_seventh(part, rng)
    off = SE3.log(SE3.inverse(second.best.T_world_part) @ T)
    return {
        "before": first.status == "recognized", "after": second.status == "recognized",
        "inside": bool(off @ np.linalg.solve(second.best.covariance, off) < chi2.ppf(0.95, 6)),
    }  # fmt: skip


def following(scenes, seed, keep, processes):
    """Return a table of 3-2-1 logs, recognized before and after the seventh touch."""
    cases = [(LOGS[k % len(LOGS)], seed, k) for k in range(scenes)]
    done = list(zip(cases, run_cases(seventh, cases, keep, processes), strict=True))
    table = []
    for name in (*LOGS, "all"):
        rows = [row for case, row in done if name in (case[0], "all")]
        sure = [row for row in rows if row["after"]]
        table.append((
            name, f"{sum(row['before'] for row in rows)}/{len(rows)}", f"{len(sure)}/{len(rows)}",
            f"{sum(row['inside'] for row in sure)}/{len(sure)}",
        ))  # fmt: skip
    columns = "part", "recognized by six", "recognized by seven", "truth in the 95 % region then"
    return Table(
        "The seventh touch of a 3-2-1 log", f"Touches of 0.05 mm at random places; seed {seed}.", columns, table
    )


TIP_OFF = 4e-4


def tipped(name, seed, scene):
    """Locate a part by 14 touches whose tip is off by the same vector in the frame of the hand."""
    part, rng = target(name), np.random.default_rng((seed, scene))
    T, readings = touches_of_hand(part, rng, 14, TIP_OFF)
    answer = tanteo.locate(readings, part.part)
    away = [SE3.log(SE3.inverse(answer.best.T_world_part) @ T @ S) for S in part.part.symmetry.Ts]
    least = min(float(x @ np.linalg.solve(answer.best.covariance, x)) for x in away)
    return {"recognized": answer.status == "recognized", "inside": bool(least < chi2.ppf(0.95, 6))}


def tips(scenes, seed, keep, processes):
    """Return a table of touches with an unstated error of the tip."""
    cases = [(PARTS[k % len(PARTS)], seed, k) for k in range(scenes)]
    done = list(zip(cases, run_cases(tipped, cases, keep, processes), strict=True))
    table = []
    for name in (*PARTS, "all"):
        rows = [row for case, row in done if name in (case[0], "all") and row["recognized"]]
        count = sum(name in (case[0], "all") for case, _ in done)
        table.append((name, f"{len(rows)}/{count}", f"{sum(row['inside'] for row in rows)}/{len(rows)}"))
    text = (
        f"14 touches of 0.05 mm with poses of the hand, tip off by {1e3 * TIP_OFF:g} mm, nothing stated; seed {seed}."
    )
    return Table("Tips that are off", text, ("part", "recognized", "truth in the 95 % region"), table)


def _row(name, rows):
    ended = [row for row in rows if row["reached"]]
    stated, kept = (np.array([row[key] for row in ended], dtype=float) for key in ("stated", "kept"))
    error = np.sqrt(np.sum(stated * (1 - stated)))
    away = f"{(kept.sum() - stated.sum()) / error:+.1f}" if len(ended) else "-"
    return (
        name, f"{len(ended)}/{len(rows)}", f"{np.median([row['readings'] for row in rows]):.0f}",
        f"{stated.mean():.3f}" if len(ended) else "-", f"{kept.sum():.0f}/{len(ended)}", away,
        f"{np.mean([row['seconds'] for row in rows]):.1f}",
    )  # fmt: skip


def main():
    arguments, keep, processes = options(sys.argv[1:])
    subject = arguments[0] if arguments else "cast"
    scenes = int(arguments[1]) if len(arguments) > 1 else 60
    seed = int(arguments[2]) if len(arguments) > 2 else 1991
    many = scenes, seed, keep, processes
    subjects = {
        **{kind: partial(sessions, kind, *many) for kind in SESSIONS},
        "plans": lambda: plans("plans", *many), "assumed": lambda: plans("assumed", *many),
        "next": lambda: following(*many), "tip": lambda: tips(*many),
    }  # fmt: skip
    if subject not in subjects:
        sys.exit(f"subject: expected one of {', '.join(subjects)}, got {subject}.")
    print(subjects[subject]().markdown())


if __name__ == "__main__":
    main()
