"""Sessions through the controllers that are not there, beside the direct ones; latency; what stays with faults.

python benchmarks/robots.py [sessions]
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

import tanteo
from tanteo.active import Stop, at_pose, probe_of
from tanteo.lie import SE3
from tanteo.machines import MachineLimits, SafeMachine, World, opened, parse_machine, probe_part
from tanteo.session import Sensing, Session
from tanteo.shapes import Surface

PARTS = Path(__file__).parents[1] / "examples" / "parts"
DOWN = np.array([0.0, 0.0, -1.0])
PLACE = SE3.from_parts(np.eye(3), np.array([0.1, 0.1, 0.0]))
SPREAD = np.diag([2e-3] * 3 + [np.radians(1)] * 3) ** 2
ABOVE = np.array([0.15, 0.15, 0.25])
LIMITS = MachineLimits(travel=0.2, reach=0.1)
SD, TOLERANCE = 2e-5, 0.4e-3
HEADS = ("ended", "within", "median", "worst", "NEES", "readings", "s")
MACHINES = ("fake:direct", "fake:grbl", "fake:ur")


def session(part, *, turns: bool) -> Session:
    held = {"stylus_behind": True} if turns else {"stylus": -DOWN}
    where = {"contact": True, "radius": 1e-3, "approach": DOWN, "cone": np.pi / 2, "standoff": 0.02, "clearance": 0.005}
    stop = Stop(tolerance=TOLERANCE, confidence=0.95, max_measurements=20)
    return Session(at_pose(part, PLACE, SPREAD), probe_of(SD, **where, **held), Sensing(sd=SD), stop=stop)


def one(part, surface, name: str, seed: int) -> tuple[bool, float, float, int]:
    """Whether it ended as asked; the largest error of a corner [m]; NEES; readings."""
    error = np.linalg.cholesky(SPREAD) @ np.random.default_rng(seed).standard_normal(6)
    T = PLACE @ SE3.exp(error)
    with opened(parse_machine(name), World(surface, T, 1e-3, SD, seed), ABOVE) as machine:
        asked = session(part, turns=machine.facts.turns)
        done = probe_part(asked, SafeMachine(machine, LIMITS))
    best = asked.answer().hypotheses[0]
    corners = tanteo.answers.box_corners(part)
    off = np.linalg.norm(SE3.apply(best.T_world_part, corners) - SE3.apply(T, corners), axis=1).max()
    xi = SE3.log(SE3.inverse(best.T_world_part) @ T)
    nees = float(xi @ np.linalg.solve(best.covariance, xi))
    return done.end.reached, float(off), nees, asked.count


def sessions(count: int) -> None:
    part = tanteo.read_part(PARTS / "block.step")
    surface = Surface(part.vertices, part.triangles)
    print(f"{count} sessions each; block, sd {1e3 * SD} mm, tolerance {1e3 * TOLERANCE} mm at 95 %")
    heads = (f"{head:>{width}}" for head, width in zip(HEADS, (6, 7, 10, 10, 6, 9, 6), strict=True))
    print(f"{'machine':12}", *heads)
    for name in MACHINES:
        begun = time.perf_counter()
        rows = np.array([one(part, surface, name, seed) for seed in range(count)], dtype=float)
        spent = (time.perf_counter() - begun) / count
        ended, off, nees, readings = rows.T
        print(
            f"{name:12} {int(ended.sum()):6} {int((off < TOLERANCE).sum()):7} {1e3 * np.median(off):7.3f} mm "
            f"{1e3 * off.max():7.3f} mm {nees.mean():6.2f} {readings.mean():9.2f} {spent:6.2f}",
            flush=True,
        )


def latency(count: int = 300) -> None:
    """Time of a touch and of the way back whose motion takes none: what protocol, wrapper and fake cost."""
    corners = np.array([[i, j, k] for i in (0, 0.06) for j in (0, 0.04) for k in (0, 0.02)], dtype=float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    surface = Surface(corners, np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]))
    T = SE3.from_parts(np.diag([1.0, -1.0, -1.0]), np.array([0.03, 0.02, 0.03]))
    print(f"\n{'machine':12} {'touch':>9} {'95 %':>9} {'touch and back':>15}")
    for name in MACHINES:
        with opened(parse_machine(name), World(surface, np.eye(4), 1e-3), T[:3, 3]) as machine:
            safe, touches, both = SafeMachine(machine, LIMITS), [], []
            safe.move(T)
            for _ in range(count):
                begun = time.perf_counter()
                with safe.touching():
                    safe.sense(DOWN, 0.02)
                    touches.append(time.perf_counter() - begun)
                both.append(time.perf_counter() - begun)
        a, b, c = np.median(touches), np.quantile(touches, 0.95), 1 / np.median(both)
        print(f"{name:12} {1e3 * a:6.2f} ms {1e3 * b:6.2f} ms {c:9.0f} a second")


if __name__ == "__main__":
    latency()
    sessions(int(sys.argv[1]) if len(sys.argv) > 1 else 200)
