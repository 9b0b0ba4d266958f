"""Measure how many readings a session needs: ``python benchmarks/active.py SUBJECT [scenes] [seed]``.

Subjects:

- ``laser``, ``flight``: 20 parts, every policy on the same scenes and seeds. The table has the readings until the part
  is known with P > 0.99 and until the largest corner sd is 0.5 or 5 mm, and how often the answer was right then.
- ``names``: the same parts, where only the part matters, and a policy that has the truth.
- ``stops``: sessions that end by their own rule, and how often they end with the right part and within the tolerance.
- ``twins``: one reading after locating.
- ``patch``: six planned touches against six in a patch.
- ``panel``: ten touches of a large panel.
- ``reports``: random sequences of all kinds of readings, valid and invalid.
- ``times``: processor time of a proposal and of an update over hypotheses and candidates.

The parts are eight of the examples and the twelve largest of the step_parts set, if that is installed. ``--processes``
and ``--keep`` work as in ``campaign.py``, for ``laser``, ``flight``, ``names``, ``stops`` and ``reports``. For the
first
two, ``--policies NAME,NAME`` selects policies, and ``--unknown P`` sets the prior probability of the unknown object.
"""

from __future__ import annotations

import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from active_sessions import HERE, known_parts, policies, reports, stops
from active_sessions import POLICIES as ALL
from active_twins import twins
from campaign import options
from common import Table

import tanteo
from cli.conftest import prism, stl
from sensing_scenes import LASER, drawn_truth, located, new_session, true_range
from tanteo.geometry import SE3
from tanteo.planning import POLICIES, Action, Probe, Sensing, Session, Stop, at_place, begin, plan, update
from tanteo.planning.candidates import propose
from tanteo.planning.predictions import predict
from tanteo.planning.samples import draw
from tanteo.planning.start import Start, at_pose
from tanteo.planning.utility import expected_information
from tanteo.posterior import Priors, prepare
from tanteo.posterior.answers import corner_sd
from tanteo.sensors.presets import NoiseLaw


def boxed(size):
    """Return a prepared block of a given size [mm]."""
    x, y, z = size
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "block.stl"
        path.write_text(stl(prism([(0, 0), (x, 0), (x, y), (0, y)], z)))
        return prepare(tanteo.read_part(path, unit="mm"))


def patch():
    """Six touches of 0.3 mm on a block of 200 x 150 x 80 mm."""
    target, C = boxed((200, 150, 80)), np.diag(np.repeat([5e-3, 0.05], 3) ** 2)
    probe = Probe("touch", NoiseLaw.of(3e-4), contact=True, standoff=0.06)
    planned = plan(at_pose(target, np.eye(4), C), probe, 1e-6, max_measurements=6)
    corner = np.array([0.2, 0.15, 0.08])
    # three on the top, two on a long side, one on a short side, all within 40 mm of one corner
    x = corner - np.array([[2, 2, 0], [38, 2, 0], [2, 38, 0], [2, 0, 10], [38, 0, 10], [0, 10, 38]]) / 1e3
    n = np.array([[0, 0, 1]] * 3 + [[0, 1, 0]] * 2 + [[1, 0, 0]], dtype=float)
    G = np.concatenate([n, np.cross(x, n)], axis=1)
    clustered = corner_sd(target.part, np.linalg.inv(np.linalg.inv(C) + G.T @ G / 3e-4**2))
    rows = [
        ("planned", f"{1e3 * planned.readings[-1].corner_sd:.2f} mm"),
        ("in a patch", f"{1e3 * clustered:.2f} mm"),
    ]
    text = "Six touches of 0.3 mm on a block of 200 x 150 x 80 mm, place known to 5 mm and 0.05 rad an axis before."
    return Table("Planned and clustered", text, ("six touches", "largest corner sd"), rows)


def panel(scenes, seed):
    """Ten touches of a panel of 1.56 x 0.41 x 0.20 m that is known to 50 mm and 0.1 rad."""
    outline = [(0, 0), (1560, 0), (1560, 250), (1300, 410), (200, 410), (0, 300)]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "panel.stl"
        path.write_text(stl(prism(outline, 200)))
        target = prepare(tanteo.read_part(path, unit="mm"))
    start, rows = at_place([target], np.eye(4), np.diag(np.repeat([0.05, 0.065], 3) ** 2)), []
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
                gap = SE3.inverse(T) @ session.state.poses[0]
                at = np.linalg.norm(SE3.apply(gap, target.part.centroid) - target.part.centroid)
                if session.count == 10:
                    moved.append(at)
                    turned.append(np.linalg.norm(SE3.log(gap)[3:]))
                if enough is None and session.steps[-1].corner_sd <= 3e-3:
                    enough = session.count
                if session.count >= 10 and enough is not None:
                    break
            needed.append(enough or 31)
        rows.append((
            f"{1e3 * sd:g} mm", f"{1e3 * np.mean(moved):.2f} mm", f"{np.degrees(np.mean(turned)):.3f} deg",
            f"{np.median(needed):.0f}",
        ))  # fmt: skip
    columns = ("touch sd", "place after ten", "turn after ten", "touches to a largest corner sd of 3 mm, median")
    text = f"A panel of 1.56 x 0.41 x 0.20 m, known to 50 mm and 0.065 rad an axis, {scenes} scenes, seed {seed}."
    return Table("A large panel", text, columns, rows)


def times():
    """Return a table of the processor times of a proposal and of an update."""
    target = prepare(tanteo.read_part(HERE / "examples" / "parts" / "bracket_left.step"))
    rows = []
    for hypotheses in (1, 3, 10, 30):
        rng = np.random.default_rng(1)
        Ts = SE3.exp(np.r_[[np.zeros(6)], 0.05 * rng.normal(size=(hypotheses - 1, 6))])
        C = np.tile(located(target, 1e-3), (hypotheses, 1, 1))
        start = Start((target,), np.zeros(hypotheses, dtype=int), Ts, C, np.ones(hypotheses), Priors())
        for count in (100, 500, 2000):
            state = begin(start)
            chosen = cpu(lambda b=state, n=count: _choose(b, n))
            session = new_session(start, LASER, least_gain=0.0)
            action = session.ask()
            readings = session.sensing.touches(action.read(true_range(target, Ts[0], action)), session.probe)
            updated = cpu(lambda b=state, r=readings: update(b, *r))
            rows.append((str(hypotheses), str(count), f"{1e3 * chosen:.0f} ms", f"{1e3 * updated:.0f} ms"))
    return Table(
        "Times", "One core, processor time, median of five.", ("hypotheses", "candidates", "ask", "tell"), rows
    )


def _choose(state, count):
    candidates = propose(state, replace(LASER, clearance=0.005), count)
    samples = draw(state, 128)
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


def _taken(arguments, name):
    """Remove an option from the arguments and return its value, or None if it is absent."""
    if name not in arguments:
        return None
    k = arguments.index(name)
    return [arguments.pop(k), arguments.pop(k)][1]


def main():
    arguments, keep, processes = options(sys.argv[1:])
    names, unknown = (_taken(arguments, name) for name in ("--policies", "--unknown"))
    subject = arguments[0] if arguments else "times"
    scenes = int(arguments[1]) if len(arguments) > 1 else 20
    seed = int(arguments[2]) if len(arguments) > 2 else 1991
    many = scenes, seed, keep, processes
    chosen = tuple(names.split(",")) if names else ALL, float(unknown) if unknown else None
    subjects = {
        "laser": lambda: policies("laser", *many, *chosen), "flight": lambda: policies("flight", *many, *chosen),
        "names": lambda: known_parts(*many),
        "stops": lambda: stops(*many), "reports": lambda: reports(*many), "twins": lambda: twins(scenes, seed),
        "patch": patch, "panel": lambda: panel(scenes, seed), "times": times,
    }  # fmt: skip
    if subject not in subjects:
        sys.exit(f"subject: expected one of {', '.join(subjects)}, got {subject}.")
    print(subjects[subject]().markdown())


if __name__ == "__main__":
    main()
