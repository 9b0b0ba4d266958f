"""Value of bores for a touch session: ``python benchmarks/bores.py [parts] [seed]``.

The parts are plates and round flanges with random holes, placed to 1 mm and 0.5 degrees (1 sd). The ball has a radius
of
1 mm, the noise is 0.05 mm, the stylus points down, the clearance is 3 mm. A session plans touches until all corners are
within 0.2 mm with 95 %, at most 40: once anywhere, walls of bores and bosses included, once on flat faces only. A
clamped plate is one of the plates with its four sides in a vice: no touch can reach them.
``--processes`` and ``--keep`` work as in ``campaign.py``.
"""

from __future__ import annotations

import sys
import tempfile
from functools import cache
from pathlib import Path

import numpy as np
from campaign import options, run_cases
from common import Table
from holes import part_of, plate
from OCP.Message import Message

from tanteo.geometry import SE3, SO3
from tanteo.parts.shapes import ball_contact
from tanteo.planning import POLICIES, Action, Sensing, Session, Stop, probe_of
from tanteo.planning.start import at_pose
from tanteo.planning.stopping import corner_distances
from tanteo.posterior import prepare

SD, RADIUS, TOLERANCE, MOST = 5e-5, 1e-3, 2e-4, 40
KNOWN = np.diag(np.repeat([1e-3, np.radians(0.5)], 3) ** 2)
OUTLINES = "plate", "clamped plate", "flange"
PLACES = "anywhere", "flat faces only"


@cache
def target_of(outline, seed, k):
    """Return one random part of an outline."""
    Message.DefaultMessenger_s().ChangePrinters().Clear()
    rng = np.random.default_rng((seed, k))
    spec = next(s for s in iter(lambda: plate(rng), None) if s[0] == (outline == "flange"))
    with tempfile.TemporaryDirectory() as folder:
        return prepare(part_of(spec, f"{outline}_{k}", Path(folder)))


def touchable(part, outline, places):
    """Return which faces may be touched ``(F,)``."""
    ok = np.array([places == PLACES[0] or face.surface == "plane" for face in part.faces])
    if outline == "clamped plate":
        ok[part.planes.faces[np.abs(part.planes.normals[:, 2]) < 0.5]] = False
    return ok


def run_one(outline, places, seed, k):
    """Return what one session planned, and its true error at the end."""
    target, rng = target_of(outline, seed, k), np.random.default_rng((seed, k, 1))
    T_expected = SE3.from_parts(SO3.exp(np.array([0.0, 0.0, rng.uniform(-3, 3)])), rng.uniform(-0.1, 0.1, 3))
    T = T_expected @ SE3.exp(np.sqrt(np.diag(KNOWN)) * rng.normal(size=6))
    probe = probe_of(
        SD, contact=True, radius=RADIUS, standoff=0.01, clearance=0.003, retreat=0.05,
        approach=np.array([0.0, 0.0, -1.0]), cone=np.pi / 2, stylus=np.array([0.0, 0.0, 1.0]),
    )  # fmt: skip
    usable = touchable(target.part, outline, places)
    stop = Stop(tolerance=TOLERANCE, confidence=0.95, max_measurements=MOST, least_gain=0.0)
    session = Session(
        at_pose(target, T_expected, KNOWN),
        probe,
        Sensing(sd=SD),
        POLICIES["information"],
        stop,
        k,
        lambda state, candidates: usable[candidates.face],
    )
    faces = []
    to_part = SE3.inverse(T)
    while isinstance(action := session.ask(), Action):
        origin, along = SE3.apply(to_part, action.origin), to_part[:3, :3] @ action.direction
        way = ball_contact(target.surface, origin, along, RADIUS)
        faces.append(action.face)
        session.tell(action.read(max(way + SD * rng.normal(), 1e-6)))
    surface = {face.name: face.surface for face in target.part.faces}
    away = float(corner_distances(session.state, 0, T[None])[0]) if len(session.state.weights) else np.inf
    return {
        "k": k, "readings": session.count, "reached": action.reached, "why": action.message, "off": away,
        "round": sum(surface[face] != "plane" for face in faces),
    }  # fmt: skip


def summary(outline, places, rows):
    """Return one row of the table."""
    ended = [r for r in rows if r["reached"]]
    counts = np.array([r["readings"] if r["reached"] else np.inf for r in rows])

    def shown(q):
        value = np.quantile(counts, q, method="higher")
        return f"{value:.0f}" if np.isfinite(value) else "never"

    return (
        f"{outline}, {places}", str(len(rows)), str(len(ended)), f"{shown(0.5)} ({shown(0.9)})",
        f"{np.mean([r['round'] / max(r['readings'], 1) for r in rows]):.0%}",
        f"{sum(r['off'] <= TOLERANCE for r in ended)}",
    )  # fmt: skip


def main() -> None:
    arguments, keep, processes = options(sys.argv[1:])
    count, seed = int(arguments[0]) if arguments else 20, int(arguments[1]) if len(arguments) > 1 else 1
    kinds = [(outline, places) for outline in OUTLINES for places in PLACES]
    rows = run_cases(run_one, [(*kind, seed, k) for kind in kinds for k in range(count)], keep, processes)
    table = [summary(*kind, rows[n * count :][:count]) for n, kind in enumerate(kinds)]
    columns = (
        "part, touched", "sessions", "goal reached", "touches, median (90 %)", "of these on round walls",
        "within 0.2 mm",
    )  # fmt: skip
    print(
        Table(
            "Touches to 0.2 mm", "Touches of sessions that do not reach the goal count as never.", columns, table
        ).markdown()
    )


if __name__ == "__main__":
    main()
