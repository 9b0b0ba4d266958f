"""Parts sensed by wide cones: ``python benchmarks/wide_cones.py --scenes 40``.

A range is computed from 4000 rays that fill the cone, by what a device reports of it; this shares no code with the
factor of a cone. Each response is inferred with its cone; ``--as thin`` takes the beam for a thin one, ``--as mean``
states another response than that of the device, and ``--as unknown`` none. The pose is known to 20 mm and 15 degrees;
the part is one of eight.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from common import Table

import tanteo
from bare_scenes import inside, nees, off
from tanteo import _core
from tanteo.geometry import SE3, SO3
from tanteo.posterior import PosePrior, Priors, prepare
from tanteo.sensors import Readings, Rig, RigSensor
from tanteo.sensors.noise import cone_rays
from tanteo.sensors.presets import RESPONSES

PARTS = ("block", "bracket_left", "clamp", "flange", "housing", "step_12mm", "t_slot", "wedge")
FOLDER = Path(__file__).parents[1] / "examples" / "parts"
RAYS, SD = 40_000, 1e-3
SPREAD, TURN = 0.02, np.radians(15)


@cache
def catalogue():
    """Return the prepared parts."""
    return [prepare(tanteo.read_part(FOLDER / f"{name}.step")) for name in PARTS]


def reported(response, ranges, cosines, faces, rng):
    """Return what a device reports of the rays of its cone [m]; infinite without an echo."""
    hit = np.isfinite(ranges) & (cosines > 0)
    r = ranges[hit]
    if not hit.any():
        return np.inf
    if response == "ray":
        return ranges[k] if hit[k := rng.integers(len(ranges))] else np.inf
    if response == "nearest":
        return r.min()
    if response == "mean":
        return r.mean()
    signal = np.bincount(faces[hit], weights=cosines[hit] / r**2)
    return r[faces[hit] == np.argmax(signal)].mean()


def scene(prepared, response, half_angle, count, rng):
    """Return readings of a part at a random pose, the pose and its prior."""
    T = SE3.from_parts(SO3.exp(rng.normal(size=3)), np.array([0.45, 0.1, 0.05]) + 0.05 * rng.normal(size=3))
    Ts, ranges = [], []
    local = cone_rays(half_angle, RAYS)
    while len(ranges) < count:
        outward = rng.normal(size=3)
        outward /= np.linalg.norm(outward)
        target = prepared.part.centroid + 0.25 * prepared.part.diagonal * rng.normal(size=3)
        aim = SO3.exp(0.2 * rng.normal(size=3)) @ -outward
        origin = target + outward * (0.5 * prepared.part.diagonal + rng.uniform(0.06, 0.15))
        frame = SE3.from_parts(SO3.frame_from_axis(aim, 2), origin)
        sensor = T @ frame
        rays = local @ sensor[:3, :3].T
        starts = np.ascontiguousarray(np.repeat(sensor[None, :3, 3], RAYS, 0))
        found = _core.beams(prepared.shape, T[None], starts, np.ascontiguousarray(rays[:, None]))
        d, cosines, faces = (np.asarray(values)[:, 0] for values in found[:3])
        r = reported(response, d, cosines, np.maximum(faces, 0), rng)
        if np.isfinite(r) and r < 0.8:
            Ts.append(sensor)
            ranges.append(r + SD * rng.normal())
    readings = Readings.from_columns(
        ids=[str(k) for k in range(count)], ranges=ranges, sensors=["cone"] * count, Ts_world_hand=np.array(Ts)
    )
    C = np.diag(np.r_[np.full(3, SPREAD**2), np.full(3, TURN**2)])
    prior = T @ SE3.exp(np.linalg.cholesky(C) @ rng.normal(size=6))
    return readings, T, PosePrior(T_world_part=prior, covariance=C)


def rig_of(response, half_angle):
    if response == "thin":
        response, half_angle = "", np.radians(0.2)
    response = "" if response == "unknown" else response
    sensor = RigSensor("cone", np.eye(4), None, SD, half_angle, 1.0, 0.0, np.zeros((6, 6)), response=response)
    return Rig((sensor,))


def judged(answer, own, T):
    """Return probability, right, covers, decided."""
    if not answer.hypotheses:
        return 0.0, False, None, False
    best = answer.hypotheses[0]
    right = False
    if best.part == own.part.name:
        moved, angle = off(own.part, best.T_world_part, T)
        value, dof = nees(own.part, best.T_world_part, best.covariance, T)
        right = (moved < 3e-3 and angle < np.radians(5)) or value < 30 + dof
        covers = inside(value, dof)
    return best.probability, right, covers if right else None, answer.status == "recognized"


def main():
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--scenes", type=int, default=40)
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("--response", choices=RESPONSES, action="append")
    options.add_argument("--as", dest="stated", choices=(*RESPONSES, "own", "unknown", "thin"), action="append")
    options.add_argument("--verbose", action="store_true", help="one line for each scene")
    arguments = options.parse_args()
    columns = ("response", "as", "told", "right", "decided", "wrong above 95 %", "region holds", "s CPU")
    table = Table("Wide cones", f"{arguments.scenes} scenes each.", columns, [])
    for response in arguments.response or RESPONSES:
        for stated in arguments.stated or ("own",):
            found = []
            for k in range(arguments.scenes):
                rng = np.random.default_rng((arguments.seed, k))
                own = catalogue()[k % len(PARTS)]
                half_angle, count = np.radians(rng.uniform(2, 20)), int(rng.integers(5, 26))
                readings, T, prior = scene(own, response, half_angle, count, rng)
                rig = rig_of(response if stated == "own" else stated, half_angle)
                start = time.process_time()
                answer = tanteo.identify(
                    readings, [one.part for one in catalogue()], rig=rig, priors=replace(Priors(), pose=prior)
                )
                found.append((*judged(answer, own, T), time.process_time() - start))
                if arguments.verbose:
                    P, right, covers, _, spent = found[-1]
                    print(
                        f"{response} as {stated} {k}: {own.part.name}, {np.degrees(half_angle):.1f} deg, "
                        f"{count} ranges: {answer.status}, {P:.4f}, {right=!s}, {covers=!s}, {spent:.1f} s",
                        flush=True,
                    )
            P, right, covers, decided, spent = (list(x) for x in zip(*found, strict=True))
            covers = [h for h in covers if h is not None]
            wrong = sum(p > 0.95 and d and not r for p, r, d in zip(P, right, decided, strict=True))
            table.rows.append(
                (
                    response, stated, f"{np.mean(P):.3f}", f"{np.mean(right):.3f}", str(sum(decided)), str(wrong),
                    f"{sum(covers)} of {len(covers)}", f"{np.mean(spent):.2f}",
                )
            )  # fmt: skip
            print(table.markdown(), flush=True)


if __name__ == "__main__":
    main()
