"""Real time-of-flight sensors calibrated on two surfaces at right angles: ``python benchmarks/real_planes.py``."""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from common import Table

from tanteo.sensors import calibrate
from tanteo.sensors.calibration import plane_angle
from tof_planes import FOLDER, PAIRS, SENSORS, SURFACES, day, run, runs

ROBOTS = None, "generic_6axis_uncalibrated", "xarm", "ur_ros_nominal_dh"


def each_run():
    """Return the calibration of every run by itself, with and without an error of the robot."""
    return {
        (s, f, robot): calibrate(run(s, f), robot=robot)
        for s in SENSORS
        for f in SURFACES
        for robot in (None, ROBOTS[3])
    }


def excluded(found):
    counts = Counter(outlier.reason for outlier in found.outliers)
    return ", ".join(f"{n} {reason}" for reason, n in counts.items()) or "none"


def table_of_runs(found):
    table = Table(
        "Every run by itself",
        "One beam, one plane.",
        ("run", "day", "places", "rms mm", "excluded", "beam sd deg", "scale", "slant", "repeats mm"),
        [],
    )
    for s in SENSORS:
        for f in SURFACES:
            c = found[s, f, None]
            beam, plane = c.beams[0], c.planes[0]
            tilt = np.degrees(np.sqrt(np.trace(beam.cov[3:5, 3:5]) / 2))
            sigma = 1e3 * float(np.median(beam.repeats.law.sigma(c.ranges)))
            table.rows.append((
                f"{s} {f}", day(s, f), f"{plane.stations}", f"{1e3 * plane.rms:.2f}", excluded(c), f"{tilt:.2f}",
                f"{1 + beam.scale:.4f}", f"{beam.slant:+.4f}", f"{sigma:.2f}",
            ))  # fmt: skip
    return table


def table_of_sensors():
    table = Table(
        "All runs of a sensor", "One beam, four planes.", ("sensor", "rms mm", "beam from mm", "sd mm", "excluded"), []
    )
    for s in SENSORS:
        c = calibrate(runs(s))
        T, sds = c.beams[0].T_hand_beam, np.sqrt(np.diag(c.beams[0].cov))
        table.rows.append((
            s, ", ".join(f"{p.name} {1e3 * p.rms:.2f}" for p in c.planes),
            " ".join(f"{1e3 * v:.1f}" for v in T[:3, 3]), " ".join(f"{1e3 * v:.1f}" for v in sds[:3]), excluded(c),
        ))  # fmt: skip
    return table


def table_of_angles(found):
    table = Table(
        "Angles",
        "Of runs fitted by themselves; the last two with the error of the robot.",
        ("pair", "one day", "angle deg", "sd deg", "off/sd", "sd deg", "off/sd"),
        [],
    )
    for s in SENSORS:
        for r, w in PAIRS:
            angle, sd = plane_angle(found[s, r, None], r, found[s, w, None], w)
            _, wide = plane_angle(found[s, r, ROBOTS[3]], r, found[s, w, ROBOTS[3]], w)
            off = angle - np.pi / 2
            same = "yes" if day(s, r) == day(s, w) else "no"
            table.rows.append((
                f"{s} {r}-{w}", same, f"{np.degrees(angle):.2f}", f"{np.degrees(sd):.2f}", f"{off / sd:+.1f}",
                f"{np.degrees(wide):.2f}", f"{off / wide:+.1f}",
            ))  # fmt: skip
    return table


def table_of_robots(found):
    """Return how many pairs have 90 degrees in their 95 % interval, for each assumed error of the robot."""
    from tanteo.sensors.presets import robot_preset

    table = Table(
        "Coverage",
        "Pairs whose 95 percent interval holds 90 degrees.",
        ("error of the robot", "its turn deg", "all pairs", "pairs of one day"),
        [],
    )
    for name in ROBOTS:
        turn = 0.0 if name is None else robot_preset(name).rot_abs_std
        inside, same = [], []
        for s in SENSORS:
            for r, w in PAIRS:
                angle, sd = plane_angle(found[s, r, None], r, found[s, w, None], w)
                # each run draws its own error of the robot
                inside.append(abs(angle - np.pi / 2) <= 1.96 * np.hypot(sd, np.sqrt(2) * turn))
                same.append(day(s, r) == day(s, w))
        inside, same = np.array(inside), np.array(same)
        table.rows.append((
            name or "none", f"{np.degrees(turn):.2f}", f"{inside.sum()} of {len(inside)}",
            f"{(inside & same).sum()} of {same.sum()}",
        ))  # fmt: skip
    return table


def main():
    if not FOLDER.is_dir():
        print(f"no data at {FOLDER}", file=sys.stderr)
        return
    found = each_run()
    for table in (table_of_runs(found), table_of_sensors(), table_of_angles(found), table_of_robots(found)):
        print(table.markdown(), end="\n\n")


if __name__ == "__main__":
    main()
