"""Sessions through the controllers that are not there, beside the direct ones; latency; what stays with faults.

python benchmarks/robots.py [sessions]
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
from scipy.stats import chi2

import tanteo
from tanteo.geometry import SE3
from tanteo.machines import MachineLimits, SafeMachine, World, probe_part
from tanteo.machines.address import opened, parse_machine
from tanteo.parts import Surface
from tanteo.planning import Sensing, Session, Stop, probe_of
from tanteo.planning.start import at_pose
from tanteo.posterior import Priors

PARTS = Path(__file__).parents[1] / "examples" / "parts"
DOWN = np.array([0.0, 0.0, -1.0])
PLACE = SE3.from_parts(np.eye(3), np.array([0.1, 0.1, 0.0]))
SPREAD = np.diag([2e-3] * 3 + [np.radians(1)] * 3) ** 2
ABOVE = np.array([0.15, 0.15, 0.25])
LIMITS = MachineLimits(travel=0.2, reach=0.1)
SD, TOLERANCE = 2e-5, 0.4e-3
USUAL = Priors()
HEADS = ("ended", "of these off", "median", "worst", "NEES", "readings", "s")
MACHINES = ("fake:direct", "fake:grbl", "fake:linuxcnc", "fake:ur")


def session(part, priors: Priors, *, turns: bool) -> Session:
    mounting = {"stylus_along_motion": True} if turns else {"stylus": -DOWN}
    where = {"contact": True, "radius": 1e-3, "approach": DOWN, "cone": np.pi / 2, "standoff": 0.02, "clearance": 0.005}
    stop = Stop(tolerance=TOLERANCE, confidence=0.95, max_measurements=20)
    return Session(
        at_pose(part, PLACE, SPREAD, priors),
        probe_of(SD, **where, **mounting),
        Sensing(sd=SD),
        stop=stop,
    )


def drawn(seed: int) -> np.ndarray:
    """Return the displacement of the part from its expected pose, in standard deviations of the prior ``(6,)``."""
    return np.random.default_rng(seed).standard_normal(6)


def one(part, surface, name: str, seed: int, priors: Priors = USUAL) -> tuple[bool, float, float, int]:
    """Return whether the session reached its tolerance, the largest error of a corner [m], NEES and the readings."""
    T = PLACE @ SE3.exp(np.linalg.cholesky(SPREAD) @ drawn(seed))
    with opened(parse_machine(name), World(surface, T, 1e-3, SD, seed), ABOVE) as machine:
        probing = session(part, priors, turns=machine.facts.turns)
        done = probe_part(probing, SafeMachine(machine, LIMITS))
    best = probing.answer().hypotheses[0]
    corners = tanteo.posterior.box_corners(part)
    off = np.linalg.norm(SE3.apply(best.T_world_part, corners) - SE3.apply(T, corners), axis=1).max()
    xi = SE3.log(SE3.inverse(best.T_world_part) @ T)
    nees = float(xi @ np.linalg.solve(best.covariance, xi))
    return done.end.reached, float(off), nees, probing.count


def sessions(count: int) -> None:
    part = tanteo.read_part(PARTS / "block.step")
    surface = Surface(part.vertices, part.triangles)
    far = sum(drawn(seed) @ drawn(seed) > chi2.ppf(0.99, 6) for seed in range(count))
    print(f"\n{count} sessions each; block, sd {1e3 * SD} mm, tolerance {1e3 * TOLERANCE} mm at 95 %;", end=" ")
    print(f"{far} parts lie beyond the 99 % of the prior")
    heads = (f"{head:>{width}}" for head, width in zip(HEADS, (6, 12, 10, 10, 6, 9, 6), strict=True))
    print(f"{'machine':28}", *heads)
    for name in MACHINES:
        print_row(name, name, USUAL, part, surface, count)
    print_row("direct, noise as stated", "fake:direct", Priors(noise_factor=1.0), part, surface, count)
    exact = Priors(noise_factor=1.0, outlier_rate=1e-6)
    print_row("direct, and no outliers", "fake:direct", exact, part, surface, count)


def print_row(label: str, name: str, priors: Priors, part, surface, count: int) -> None:
    """Print one line of the table."""
    begun = time.perf_counter()
    rows = np.array([one(part, surface, name, seed, priors) for seed in range(count)], dtype=float)
    spent = (time.perf_counter() - begun) / count
    ended, off, nees, readings = rows.T
    done = ended.astype(bool)
    print(
        f"{label:28} {int(ended.sum()):6} {int((off[done] > TOLERANCE).sum()):12} {1e3 * np.median(off[done]):7.3f} mm "
        f"{1e3 * off[done].max():7.3f} mm {nees.mean():6.2f} {readings.mean():9.2f} {spent:6.2f}",
        flush=True,
    )


def block() -> Surface:
    corners = np.array([[i, j, k] for i in (0, 0.06) for j in (0, 0.04) for k in (0, 0.02)], dtype=float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return Surface(corners, np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]))


def latency(speedup: float, count: int) -> None:
    """Print the time that protocol, wrapper and fake add to the motions of touches, alone and with the retreat.

    Args:
        speedup: speed of the fake relative to the stated speed; infinite: motions take no time.
        count: number of touches.
    """
    T = SE3.from_parts(np.diag([1.0, -1.0, -1.0]), np.array([0.03, 0.02, 0.0215]))
    moving = np.isfinite(speedup)
    label = f"motions that take {'their time' if moving else 'none'}"
    print(f"\n{label:28} {'touch':>9} {'95 %':>9} {'with way back':>14}")
    for name in MACHINES:
        with opened(parse_machine(name), World(block(), np.eye(4), 1e-3), T[:3, 3], speedup) as machine:
            safe, touches, both = SafeMachine(machine, LIMITS), [], []
            safe.move(T)
            for _ in range(count):
                begun = time.perf_counter()
                with safe.touching():
                    way = safe.sense(DOWN, 2e-3).distance
                    touches.append(time.perf_counter() - begun - moving * way / LIMITS.touch)
                both.append(time.perf_counter() - begun - moving * way * (1 / LIMITS.touch + 1 / LIMITS.travel))
        a, b, c = np.median(touches), np.quantile(touches, 0.95), np.median(both)
        print(f"{name:28} {1e3 * a:6.2f} ms {1e3 * b:6.2f} ms {1e3 * c:11.2f} ms", flush=True)


if __name__ == "__main__":
    latency(np.inf, 300)
    latency(1.0, 40)
    sessions(int(sys.argv[1]) if len(sys.argv) > 1 else 200)
