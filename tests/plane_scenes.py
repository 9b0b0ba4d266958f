"""Simulated calibration logs: a hand at random poses in front of planes, with noise from place to place and repeats."""

import numpy as np

from tanteo.geometry import SE3, SO3
from tanteo.sensors import Readings

PLACE = (0.6e-3, 0.002, 0.004)
REPEAT = (0.5e-3, 0.003)

ZONES = """[sensors.tof]
preset = "tmf8820_zone3x3"
position_mm = [0, 0, 0]
quaternion_wxyz = [1, 0, 0, 0]
zones = [{n}, {n}]
field_deg = [33, 33]
mount_sd_mm = 8
mount_turn_sd_deg = 2
"""


def random_hands(rng, n, plane, T_hand_beam, tilt=0.7, near=0.1, far=0.5):
    """Return hands whose beam hits a plane (z of ``plane`` towards them) at up to ``tilt`` radians off the normal."""
    spots = SE3.apply(plane, np.concatenate([rng.uniform(-0.2, 0.2, (n, 2)), np.zeros((n, 1))], axis=1))
    turns = rng.uniform(-np.pi, np.pi, n)
    lean = rng.uniform(-1, 1, (n, 2)) * tilt / np.sqrt(2)
    w = np.concatenate([lean, np.zeros((n, 1))], axis=1)
    spin = np.stack([0 * turns, 0 * turns, turns], axis=1)
    R = plane[:3, :3] @ SO3.exp(w) @ SO3.exp(spin) @ np.diag([1.0, -1, -1])
    beams = SE3.from_parts(R, spots - rng.uniform(near, far, n)[:, None] * R[:, :, 2])
    return beams @ SE3.inverse(T_hand_beam)


def ranges_to(plane, Ts):
    """Ranges and incidences of beams along +z of ``Ts``."""
    n = plane[:3, 2]
    slope = Ts[:, :3, 2] @ n
    return ((plane[:3, 3] - Ts[:, :3, 3]) @ n) / slope, np.arccos(np.abs(slope))


def simulated_log(
    rng, T_hand_beam, plane, hands, *, scale=0.0, slant=0.0, repeats=4, place=PLACE, repeat=REPEAT, name="eye", label=""
):
    """Return readings of one sensor on one plane, ``repeats`` at every pose."""
    d, beta = ranges_to(plane, hands @ T_hand_beam)
    tan2 = np.tan(beta) ** 2
    off = np.sqrt(place[0] ** 2 + (place[1] * d) ** 2 + (place[2] * d) ** 2 * tan2) * rng.normal(size=len(d))
    read = (1 + scale + slant * tan2) * d + off
    sigma = np.hypot(repeat[0], repeat[1] * d)
    r = read[:, None] + sigma[:, None] * rng.normal(size=(len(d), repeats))
    n = r.size
    return Readings.from_columns(
        ranges=r.ravel(), sensors=[name] * n, Ts_world_hand=np.repeat(hands, repeats, axis=0),
        features=[label] * n, kinds=["plane" if label else "point"] * n,
        ids=[f"{name}{label}{i // repeats + 1}.{i % repeats + 1}" for i in range(n)],
    )  # fmt: skip


def joined(*logs):
    """Several logs as one."""
    n = len(logs)
    assert n
    return Readings.from_columns(
        ranges=np.concatenate([x.ranges for x in logs]),
        sensors=[s for x in logs for s in x.sensors],
        Ts_world_hand=np.concatenate([x.Ts_world_hand for x in logs]),
        features=[f for x in logs for f in x.features],
        kinds=[k for x in logs for k in x.kinds],
        ids=[i for x in logs for i in x.ids],
    )


def zones_log(rng, rig, places=12):
    """Ranges of the plane z = 0, and the height error of a plane that the nominal rig would see."""
    unit = SE3.exp(rng.normal(size=6) * np.repeat([8e-3, np.radians(2)], 3))
    offset, scale = 5e-3 * rng.normal(), 0.015 * rng.normal()
    zone = {s.name: 1.5e-3 * rng.normal() for s in rig.sensors}
    ranges, sensors, hands = [], [], []
    for _ in range(places):
        T = SE3.exp(np.r_[0.4, 0.1, rng.uniform(0.12, 0.35), 0, 0, 0])
        T = T @ SE3.exp(np.r_[0, 0, 0, np.pi, 0, 0]) @ SE3.exp(np.r_[0, 0, 0, np.radians(5) * rng.normal(size=3)])
        for s in rig.sensors:
            beam = T @ s.T_hand_unit @ unit @ SE3.inverse(s.T_hand_unit) @ s.T_hand_sensor
            d = -beam[2, 3] / beam[2, 2]
            sd = float(s.preset.law.sigma(d))
            ranges.append((1 + scale) * d + offset + zone[s.name] + sd * rng.normal())
            sensors.append(s.name)
            hands.append(T)
    return Readings.from_columns(ranges=ranges, sensors=sensors, Ts_world_hand=np.array(hands))
