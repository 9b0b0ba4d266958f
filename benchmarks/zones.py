"""Parts seen by the square zones of a multi-zone sensor: ``python benchmarks/zones.py --scenes 12``.

A VL53L5CX senses one of three parts from three places. Each of its 64 zones reports the mean of 144 rays that fill
its square, weighted by the returned signal, of the part and of the table; rays meet triangles in NumPy and share no
code with the factor. Offset, scale and mounting of the device are drawn once for each scene from what the rig states.
``--reflectance 2`` lets the part return twice as much as the table, which the model does not know.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from common import Table

import tanteo
from bare_scenes import inside, nees, off
from tanteo.geometry import SE3, SO3
from tanteo.posterior import Table as OnTable
from tanteo.sensors import Readings

PARTS = ("block", "bracket_left", "clamp")
FOLDER = Path(__file__).parents[1] / "examples" / "parts"
SIDE = 12  # rays along each side of a zone
RIG = """[sensors.eye]
preset = "vl53l5cx_zone8x8"
zones = [8, 8]
field_deg = 45
position_mm = [0, 0, 0]
quaternion_wxyz = [1, 0, 0, 0]
bias_sd_mm = 1
scale_sd = 0.005
mount_sd_mm = 1
mount_turn_sd_deg = 0.5
"""


def hits(origin, rays, corners):
    """Return ranges and cosines of the first front faces that rays meet (Moeller and Trumbore 1997)."""
    a, ab, ac = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normals = np.cross(ab, ac)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    across = np.cross(rays[:, None], ac[None])
    det = np.sum(across * ab, axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = np.sum(across * (origin - a), axis=-1) / det
        turned = np.cross(origin - a, ab)
        v = rays @ turned.T / det
        t = np.sum(turned * ac, axis=-1) / det
    found = (det > 1e-14) & (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
    t = np.where(found, t, np.inf)
    k = t.argmin(axis=1)
    return t[np.arange(len(rays)), k], -np.sum(normals[k] * rays, axis=1)


def frame(T_world_device, T_world_part, part, on_table, reflectance):
    """Return the range along the beam of each zone, row by row; infinite without an echo."""
    steps = np.radians(45) * ((np.arange(8 * SIDE) + 0.5) / (8 * SIDE) - 0.5)
    y, x = np.meshgrid(np.tan(steps), np.tan(steps), indexing="ij")
    rays = np.stack([x, y, np.ones_like(x)], axis=-1)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    rays = rays.reshape(-1, 3) @ T_world_device[:3, :3].T
    origin = T_world_device[:3, 3]
    corners = SE3.apply(T_world_part, part.vertices)[part.triangles]
    pieces = [hits(origin, some, corners) for some in np.array_split(rays, 16)]
    r, cosines = (np.concatenate(values) for values in zip(*pieces, strict=True))
    signal = np.where(np.isfinite(r), reflectance, 1.0)
    if on_table:
        down = np.where(rays[:, 2] < 0, -origin[2] / np.minimum(rays[:, 2], -1e-9), np.inf)
        cosines = np.where(r < down, cosines, -rays[:, 2])
        signal = np.where(r < down, signal, 1.0)
        r = np.minimum(r, down)
    with np.errstate(invalid="ignore"):
        signal = np.where(np.isfinite(r), signal * cosines / r**2, 0.0)
    r = np.where(np.isfinite(r), r, 0.0)
    zones = [v.reshape(8, SIDE, 8, SIDE).sum(axis=(1, 3)).ravel() for v in (signal, signal * r)]
    full = signal.reshape(8, SIDE, 8, SIDE).astype(bool).mean(axis=(1, 3)).ravel()
    return np.where(full > 0.2, zones[1] / np.maximum(zones[0], 1e-300), np.inf)


def read(text):
    """Return the rig of a text."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "rig.toml"
        file.write_text(text)
        return tanteo.read_rig(file)


def scene(part, rig, on_table, reflectance, rng):
    """Return readings of a part and its pose."""
    spin = SE3.from_parts(SO3.exp(np.array([0, 0, rng.uniform(-np.pi, np.pi)])), np.zeros(3))
    if on_table:
        T = spin @ SE3.from_parts(np.eye(3), -np.array([*part.centroid[:2], part.box[0][2]]))
        T = SE3.from_parts(np.eye(3), np.array([0.4, 0.1, 0])) @ T
    else:
        T = SE3.from_parts(SO3.exp(rng.normal(size=3)), np.array([0.4, 0.1, 0.3]))
    first, preset = rig.sensors[0], rig.sensors[0].preset
    mounting = SE3.exp(np.sqrt(np.diag(first.cov_mount)) * rng.normal(size=6))
    bias, scale = first.bias_sd * rng.normal(), first.scale_sd * rng.normal()
    middle = SE3.apply(T, part.centroid)
    ranges, names, hands = [], [], []
    for k in range(3):
        turn, tilt = 2 * np.pi * (k + rng.random()) / 3, rng.uniform(0.2, 0.6)
        outward = np.array([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)])
        target = middle + 0.01 * rng.normal(size=3)
        facing = SO3.frame_from_axis(-outward, 2) @ SO3.exp(np.array([0, 0, rng.uniform(0, 2 * np.pi)]))
        hand = SE3.from_parts(facing, target + rng.uniform(0.15, 0.22) * outward)
        r = frame(hand @ mounting, T, part, on_table, reflectance)
        for sensor, d in zip(rig.sensors, r, strict=True):
            if np.isfinite(d):
                noise = float(preset.law.sigma(d)) * rng.normal()
                ranges.append(((1 + scale) * d + bias + noise) * sensor.axis_cosine)
                names.append(sensor.name)
                hands.append(hand)
    return Readings.from_columns(ranges=ranges, sensors=names, Ts_world_hand=np.array(hands)), T


def main():
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--scenes", type=int, default=12)
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("--table", choices=("stated", "none"), action="append")
    options.add_argument("--response", default="", help="state another response")
    options.add_argument("--footprint", default="", help="state another section, circle")
    options.add_argument("--reflectance", type=float, default=1.0)
    options.add_argument("--verbose", action="store_true", help="one line for each scene")
    arguments = options.parse_args()
    parts = [tanteo.read_part(FOLDER / f"{name}.step") for name in PARTS]
    rig = read(RIG)
    stated = RIG + (f'response = "{arguments.response}"\n' if arguments.response else "")
    stated += "beam_half_angle_deg = 2.8\n" if arguments.footprint == "circle" else ""
    stated = read(stated)
    columns = ("table", "mean stated probability", "right", "NEES / 6", "sd", "region holds", "off mm", "s CPU")
    table = Table("Square zones", f"{arguments.scenes} scenes each.", columns, [])
    for kind in arguments.table or ("stated", "none"):
        found = []
        for k in range(arguments.scenes):
            rng = np.random.default_rng((arguments.seed, k))
            part = parts[k % len(parts)]
            readings, T = scene(part, rig, kind == "stated", arguments.reflectance, rng)
            on = OnTable(np.zeros(3), np.array([0.0, 0.0, 1.0]), 1e-3) if kind == "stated" else None
            priors = tanteo.Priors(pose=tanteo.PosePrior(table=on)) if on else tanteo.Priors()
            start = time.process_time()
            answer = tanteo.identify(readings, parts, rig=stated, priors=priors)
            spent = time.process_time() - start
            best = answer.hypotheses[0] if answer.hypotheses else None
            right, moved, value = False, np.nan, np.nan
            if best is not None and best.part == part.name:
                moved, angle = off(part, best.T_world_part, T)
                value, dof = nees(part, best.T_world_part, best.covariance, T)
                value /= dof / 6
                right = (moved < 10e-3 and angle < np.radians(10)) or value < 30
            found.append((best.probability if best else 0.0, right, value, moved, spent))
            if arguments.verbose:
                print(
                    f"{kind} {k}: {part.name}, {len(readings)} ranges: {answer.status}, {found[-1][0]:.4f}, "
                    f"{right=!s}, {1e3 * moved:.1f} mm, stated {1e3 * best.corner_sd if best else 0:.1f}, "
                    f"NEES {value:.1f}, {spent:.1f} s",
                    flush=True,
                )
        P, right, values, moved, spent = (np.array(x) for x in zip(*found, strict=True))
        ok = right.astype(bool)
        table.rows.append(
            (
                kind, f"{P.mean():.3f}", f"{right.mean():.3f}", f"{values[ok].mean() / 6:.2f}",
                f"{np.sqrt(12 / max(ok.sum(), 1)) / 6:.2f}", f"{sum(inside(v, 6) for v in values[ok])} of {ok.sum()}",
                f"{1e3 * np.median(moved[ok]):.1f}", f"{spent.mean():.1f}",
            )
        )  # fmt: skip
        print(table.markdown(), flush=True)


if __name__ == "__main__":
    main()
