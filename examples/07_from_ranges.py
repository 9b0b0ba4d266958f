"""Identify a part from ranges of a proximity sensor and poses of the hand.

The pose of the sensor on the hand is in a rig file. Noise, beam and bias come from its preset or from the file. The
bias and the error of the mounting are the same for all readings. More readings do not average out such shared errors.

    python examples/07_from_ranges.py
"""

from pathlib import Path

import numpy as np

import tanteo
from tanteo.io import read_rig
from tanteo.sensors import measure

HERE = Path(__file__).parent
rig = read_rig(HERE / "readings" / "laser_rig.toml")
readings = tanteo.read_readings(HERE / "readings" / "wedge_ranges.csv")
measured = measure(readings, rig=rig)
beam = measured.directions[0]
along = np.sqrt(beam @ measured.covs[0] @ beam)
across = np.sqrt((np.trace(measured.covs[0]) - along**2) / 2)
print(f"first point {np.round(1e3 * measured.points[0], 2)} mm")
print(f"sd along the beam {1e3 * along:.3f} mm, across it {1e3 * across:.3f} mm")
for error in measured.shared:
    print(f"shared: {error.name}, sd {1e3 * np.sqrt(error.covariance[0, 0]):.3f} mm, {error.meaning}")

answer = tanteo.identify(readings, tanteo.read_parts(HERE / "parts").parts, rig=rig)
best = answer.hypotheses[0]
print(f"{answer.status}: {answer.message}")
x, y, z = np.round(1e3 * best.T_world_part[:3, 3], 3) + 0.0
print(f"origin {x:.3f} {y:.3f} {z:.3f} mm (truth 410 -90 0)")
