"""Twins, for ``active.py``: one reading after locating, and the best that one reading allows."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from common import Table

import tanteo
from sensing_scenes import FLIGHT, LASER, beam_hits, located, new_session, sense
from tanteo.geometry import SE3
from tanteo.planning.discrimination import most_similar_poses
from tanteo.planning.start import Start
from tanteo.posterior import Priors, prepare

PARTS = Path(__file__).parents[1] / "examples" / "parts"
PAIRS = ("bracket_left", "bracket_right"), ("step_12mm", "step_15mm")
WIDE = 3e-3
"""Beams are aimed at the box of the part and so much about it [m]."""


def either(pair, k, probe):
    """Located to 0.2 mm (laser) or 2 mm (time of flight) as part ``k``, which may as well be the other."""
    sd = 2e-4 if probe is LASER else 2e-3
    poses = most_similar_poses(pair[k], pair[1 - k])
    covariances = np.stack([located(pair[k], sd)] + [located(pair[1 - k], sd)] * len(poses))
    weights = np.r_[0.5, np.full(len(poses), 0.5 / len(poses))]
    Ts = np.concatenate([np.eye(4)[None], poses])
    return Start(tuple(pair), np.array([k] + [1 - k] * len(poses)), Ts, covariances, weights, Priors())


def drawn(start, part, count, rng):
    """Poses of a part, drawn from where it is known to be ``(count, 4, 4)``."""
    rows = np.flatnonzero(start.part == part)
    rows = rows[rng.integers(len(rows), size=count)]
    L = np.linalg.cholesky(start.covariances[rows])
    return start.Ts[rows] @ SE3.exp((L @ rng.normal(size=(count, 6, 1)))[..., 0])


def chance(ranges, sd):
    """Return how often the best decision after one reading is right, for samples of the true ranges of two parts.

    The result is the sum of the larger of both densities over all readings. The densities are samples on a fine grid,
    blurred by the noise.

    Args:
        ranges: true ranges for each of the two parts ``(S,)`` [m], infinite where the beam misses.
        sd: standard deviation of the noise [m].
    """
    hits = [r[np.isfinite(r)] for r in ranges]
    missed = [1 - len(m) / len(r) for m, r in zip(hits, ranges, strict=True)]
    if not any(map(len, hits)):
        return 0.5
    low, high, h = min(m.min(initial=np.inf) for m in hits), max(m.max(initial=-np.inf) for m in hits), sd / 8
    edges = low - 5 * sd + h * np.arange((high - low) / h + 82)
    blur = np.exp(-0.5 * (np.arange(-32, 33) / 8) ** 2)
    p = [
        np.convolve(np.histogram(m, edges)[0], blur / blur.sum(), "same") / len(r)
        for m, r in zip(hits, ranges, strict=True)
    ]
    return 0.5 * (np.maximum(*p).sum() + max(missed))


def max_measurements(pair, k, probe, beams_tried, draws, seed):
    """Return how often the best decision is right after the best of random beams from anywhere."""
    rng, start = np.random.default_rng((seed, k)), either(pair, k, probe)
    v = pair[k].part.vertices
    aims = rng.uniform(v.min(axis=0) - WIDE, v.max(axis=0) + WIDE, (beams_tried, 3))
    d = rng.normal(size=(beams_tried, 3))
    half = beams_tried // 2  # of any direction; the others along the axes, as most faces are square to them
    d[half:] = np.eye(3)[rng.integers(3, size=beams_tried - half)] * rng.choice([-1, 1], (beams_tried - half, 1))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    origins, sd = aims - probe.standoff * d, float(probe.law.const)
    r = [beam_hits(pair[j], drawn(start, j, draws, rng), origins, d)[0] for j in (0, 1)]
    r = [np.where(x < probe.max_range, x, np.inf) for x in r]
    chosen = np.argmax([chance([x[b, ::2] for x in r], sd) for b in range(beams_tried)])
    return chance([x[chosen, 1::2] for x in r], sd)  # by other draws than it was chosen by


def row(names, probe, scenes, seed):
    """Return the row of one pair and sensor: how often right, how often sure and right, and the best possible."""
    pair = [prepare(tanteo.read_part(PARTS / f"{n}.step")) for n in names]
    right = sure = 0
    for scene in range(scenes):
        rng = np.random.default_rng((seed, scene))
        k = int(rng.integers(2))
        start = either(pair, k, probe)
        T = SE3.exp(np.linalg.cholesky(start.covariances[0]) @ rng.normal(size=6))
        session = new_session(start, probe, seed=scene, probability=0.999, max_measurements=1)
        sense(session, pair[k], T, rng)
        P = session.state.of_parts()
        right += int(np.argmax(P)) == k
        sure += P[k] > 0.95
    possible = np.mean([max_measurements(pair, k, probe, 4000, 1000, seed) for k in (0, 1)])
    return " / ".join(names), probe.name, f"{right}/{scenes}", f"{sure}/{scenes}", f"{100 * possible:.1f} %"


def twins(scenes, seed):
    """Return a table of the decisions between twins after one reading."""
    text = (
        "The part is located to 0.2 mm (laser) or 2 mm (time of flight) at its corners, as either of the two. "
        "PossiblePoses: the best of 4,000 beams from anywhere, its reading used as well as it can be."
    )
    rows = [row(names, probe, scenes, seed) for names in PAIRS for probe in (LASER, FLIGHT)]
    return Table("Twins: one reading", text, ("pair", "sensor", "right", "right with P > 0.95", "possible"), rows)
