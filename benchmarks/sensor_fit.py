"""Calibration of NEES by the number of places: ``python benchmarks/sensor_fit.py [logs]``.

``python benchmarks/sensor_fit.py zones 50 SEED`` fits devices of 1 to 64 zones over one plane instead.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from scipy.stats import chi2

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from common import Table

import tanteo
from plane_scenes import ZONES, joined, random_hands, simulated_log, zones_log
from tanteo.geometry import SE3, SO3
from tanteo.sensors import calibrate
from tanteo.sensors.calibration import plane_angle


def one_log(seed, places, saturated):
    """Return squared errors over variances for two planes, and counts of right and wrong exclusions."""
    rng = np.random.default_rng(seed)
    floor = SE3.exp(rng.normal(size=6) * [0.3, 0.3, 0.3, 2, 2, 2])
    wall = floor @ SE3.from_parts(SO3.exp(np.array([np.pi / 2, 0, 0])), np.array([0.0, 0.3, 0]))
    T = SE3.exp(np.r_[0.05 * rng.normal(size=3), rng.normal(size=3) * [0.3, 0.3, 1]])
    scale, slant = 0.01 * rng.normal(), 0.01 * rng.normal()
    log = joined(
        *(
            simulated_log(rng, T, p, random_hands(rng, places // 2, p, T), scale=scale, slant=slant, label=name)
            for name, p in (("floor", floor), ("wall", wall))
        )
    )
    wrong = np.zeros(len(log), dtype=bool)
    if saturated:
        ceiling = np.quantile(log.ranges, 0.85)
        wrong = log.ranges > ceiling + 0.01
        log = type(log).from_columns(
            ranges=np.minimum(log.ranges, ceiling), sensors=log.sensors, features=log.features, kinds=log.kinds,
            Ts_world_hand=log.Ts_world_hand, ids=log.ids,
        )  # fmt: skip
    start = time.perf_counter()
    found = calibrate(log)
    seconds = time.perf_counter() - start
    beam = found.beams[0]
    R = beam.T_hand_beam[:3, :3]
    aim = R.T @ T[:3, 2]
    e = np.r_[R.T @ (T[:3, 3] - beam.T_hand_beam[:3, 3]), -aim[1], aim[0], scale - beam.scale, slant - beam.slant]
    angle, sd = plane_angle(found, "floor", found, "wall")
    named = {name for outlier in found.outliers for name in outlier.ids}
    truth = {name for name, bad in zip(log.ids, wrong, strict=True) if bad}
    inside = abs(angle - np.pi / 2) <= 1.96 * sd
    return e @ np.linalg.solve(beam.cov, e) / 7, inside, len(named & truth), len(truth), len(named - truth), seconds


def zones(logs, seed):
    """Print the table of fits of devices with a grid of zones over an unknown plane, z = 0 of the world."""
    columns = ("zones", "NEES of the plane / 3", "in its 95 % region", "s CPU, mean", "worst")
    table = Table("Devices with zones", f"{logs} logs each, seed {seed}; 12 places.", columns, [])
    for side in (1, 3, 4, 8):
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "rig.toml"
            file.write_text(ZONES.format(n=side))
            rig = tanteo.read_rig(file)
        rows = []
        for k in range(logs):
            log = zones_log(np.random.default_rng((seed, side, k)), rig)  # each row has devices of its own
            start = time.process_time()
            found = calibrate(log, rig=rig)
            spent = time.process_time() - start
            plane = found.planes[0]
            x, y, z = plane.T_world_plane[2, :3]  # the true normal in the fitted frame
            e = np.array([-y, x, -plane.T_world_plane[2, 3] / z])
            rows.append((e @ np.linalg.solve(plane.cov, e), spent))
        squares, spent = np.array(rows).T
        inside = np.mean(squares < chi2.ppf(0.95, 3))
        spread = np.std(squares / 3) / np.sqrt(logs)
        table.rows.append(
            (
                str(side**2),
                f"{squares.mean() / 3:.2f} +- {spread:.2f}",
                f"{100 * inside:.0f} %",
                f"{spent.mean():.2f}",
                f"{spent.max():.1f}",
            )
        )
    print(table.markdown())


def main():
    logs = int(sys.argv[1]) if len(sys.argv) > 1 else 60
    columns = (
        "places", "saturated", "NEES of the beam / 7", "expected", "right angle in 95 %", "saturated readings named",
        "others excluded", "seconds a log",
    )  # fmt: skip
    table = Table("Calibration of simulated logs", f"{logs} logs each; 4 readings a place.", columns, [])
    for places, saturated in ((16, False), (30, False), (60, False), (30, True), (60, True)):
        rows = np.array([one_log(1000 * places + k, places, saturated) for k in range(logs)], dtype=float)
        nees, inside, named, truth, others, seconds = rows.T
        # the noise is estimated from what 13 parameters leave: F, not chi-square
        dof = places - 13
        expected = f"{dof / (dof - 2):.2f}" if dof > 4 else "no mean"
        spread = np.std(nees) / np.sqrt(logs)
        row = (
            str(places), "yes" if saturated else "no", f"{nees.mean():.2f} +- {spread:.2f}", expected,
            f"{100 * inside.mean():.0f} %", f"{named.sum():.0f} of {truth.sum():.0f}" if saturated else "",
            f"{100 * others.sum() / (4 * places * logs):.1f} %", f"{seconds.mean():.1f}",
        )  # fmt: skip
        table.rows.append(row)
    print(table.markdown())


if __name__ == "__main__":
    if sys.argv[1:2] == ["zones"]:
        zones(int(sys.argv[2]), int(sys.argv[3]))
    else:
        main()
