"""Simulate an 8 x 8 time-of-flight sensor over a part on a table, and find the part.

Each zone reports the mean of what returns in its square, of the part and of the table, weighted by the signal.
Replace the ranges by those of your device.

    python examples/13_simulate_zones.py
"""

from pathlib import Path

import numpy as np

import tanteo
from tanteo.geometry import SE3, SO3
from tanteo.parts import Surface
from tanteo.posterior import Table
from tanteo.sensors import Readings

HERE, rng = Path(__file__).parent, np.random.default_rng(0)
part = tanteo.read_part(HERE / "parts" / "bracket_left.step")
rig = tanteo.read_rig(HERE / "readings" / "zones_rig.toml")
surface = Surface(part.vertices, part.triangles)
truth = SE3.from_parts(SO3.exp(np.array([0, 0, 0.7])), np.array([0.4, 0.2, 0.0]))
ranges, names, hands = [], [], []
steps = (np.arange(14) + 0.5) / 7 - 1  # of the rays that fill a zone, over its half axes
middle = SE3.apply(truth, part.centroid)
for place in ([0.3, 0.15, 0.25], [0.5, 0.25, 0.25], [0.42, 0.1, 0.28]):
    hand = SE3.from_parts(SO3.frame_from_axis(middle - place, 2), np.array(place))
    for sensor in rig.sensors:
        T = hand @ sensor.T_hand_sensor
        across, up = sensor.half_axes
        local = (np.array([0, 0, 1]) + steps[:, None, None] * across + steps[:, None] * up).reshape(-1, 3)
        rays = local / np.linalg.norm(local, axis=1, keepdims=True) @ T[:3, :3].T
        hits = surface.cast((T[:3, 3] - truth[:3, 3]) @ truth[:3, :3], rays @ truth[:3, :3])
        cosines = -np.sum(surface.normals[np.maximum(hits.triangles, 0)] @ truth[:3, :3].T * rays, axis=1)
        table = np.where(rays[:, 2] < 0, -T[2, 3] / np.minimum(rays[:, 2], -1e-9), np.inf)
        cosines = np.where(hits.distances < table, cosines, -rays[:, 2])
        distances = np.minimum(hits.distances, table)
        echo = np.isfinite(distances) & (cosines > 0)
        if echo.any():
            signal = cosines[echo] / distances[echo] ** 2
            r = signal @ distances[echo] / signal.sum()
            ranges.append((r + 1.5e-3 * rng.normal()) * sensor.axis_cosine)
            names.append(sensor.name)
            hands.append(hand)

readings = Readings.from_columns(ranges=ranges, sensors=names, Ts_world_hand=np.array(hands))
prior = tanteo.PosePrior(table=Table(np.zeros(3), np.array([0.0, 0.0, 1.0]), 1e-3))
answer = tanteo.locate(readings, part, rig=rig, priors=tanteo.Priors(pose=prior))
print(f"{len(readings)} ranges: {answer.status}: {answer.message}")
for best in answer.hypotheses[:1]:
    off = np.linalg.norm(best.T_world_part[:3, 3] - truth[:3, 3])
    print(f"{1e3 * off:.1f} mm from the truth, stated {1e3 * best.corner_sd:.1f} mm")
