"""The real time-of-flight runs as readings: one folder a run, a sensor on a wrist in front of a flat surface."""

from pathlib import Path

import numpy as np

from tanteo.sensors import Readings

FOLDER = Path(__file__).resolve().parents[1].parent / "shared" / "data" / "tof_planes"
SENSORS = {"L3CX": "P1", "6180": "P3"}
SURFACES = "R1", "R2", "W1", "W2"
PAIRS = [(r, w) for r in ("R1", "R2") for w in ("W1", "W2")]


def _numbers(path, skip):
    """Return the numbers of every line without the first ``skip`` cells and empty ones."""
    lines = [line.split(",")[skip:] for line in path.read_text().splitlines()]
    return [[float(cell) for cell in cells if cell.strip()] for cells in lines]


def run(sensor, surface):
    """Return readings of one run; the repeats of a place are named ``R1/14.3``."""
    folder = FOLDER / f"{sensor}_{surface}_{SENSORS[sensor]}"
    places = np.array(_numbers(folder / "transforms.csv", 0)).reshape(-1, 4, 4)
    repeats = _numbers(folder / "measurements.csv", 1)
    # the file has seven to ten digits: the nearest rotation
    U, _, Vt = np.linalg.svd(places[:, :3, :3])
    places[:, :3, :3], places[:, 3] = U @ Vt, [0, 0, 0, 1]
    counts = [len(r) for r in repeats]
    n = sum(counts)
    return Readings.from_columns(
        ranges=1e-3 * np.concatenate(repeats), sensors=[sensor] * n, features=[surface] * n, kinds=["plane"] * n,
        Ts_world_hand=np.repeat(places[: len(repeats)], counts, axis=0),
        ids=[f"{surface}/{i + 1}.{j + 1}" for i, c in enumerate(counts) for j in range(c)],
    )  # fmt: skip


def runs(sensor):
    """Return all the runs of a sensor as one log."""
    parts = [run(sensor, surface) for surface in SURFACES]
    return Readings.from_columns(
        ranges=np.concatenate([p.ranges for p in parts]),
        Ts_world_hand=np.concatenate([p.Ts_world_hand for p in parts]),
        **{k: [x for p in parts for x in getattr(p, k)] for k in ("sensors", "features", "kinds", "ids")},
    )


def day(sensor, surface):
    """Return the day of a run."""
    text = (FOLDER / f"{sensor}_{surface}_{SENSORS[sensor]}" / "measurements.csv").read_text()
    return text.partition("T")[0]
