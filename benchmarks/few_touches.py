"""Few touches with and without a true prior: ``python benchmarks/few_touches.py [scenes] [touches] [seed] [prior]``.

The prior is ``table`` (height to 0.05 mm), ``level`` (height and tilt, heading to 20 degrees) or ``heading`` (height
and tilt, heading open). The rows count answers that prefer an unknown object, recognized parts, and wrong ones among
them. The last figure is the mean probability of the true pose.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from tanteo import PosePrior, Priors, Readings, locate, read_part
from tanteo.geometry import ROS, SE3, SO3, uncertain_frame
from tanteo.geometry.named import NamedCovariance
from tanteo.posterior import Table

SD, HEIGHT_SD = 2e-5, 5e-5
PARTS = Path(__file__).parents[1] / "examples" / "parts"
NAMES = "bracket_left", "housing", "block"
NEAR = 3  # corner sds within which a pose is the true one


def touched(part, T, count, rng):
    corners = part.vertices[part.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(normals, axis=1)
    normals = normals / areas[:, None]
    weights = areas * (normals[:, 2] > -0.5)
    rows = rng.choice(len(areas), count, p=weights / weights.sum())
    q = np.einsum("nk,nki->ni", rng.dirichlet([1, 1, 1], count), corners[rows])
    return Readings.from_columns(
        points=SE3.apply(T, q) + SD * rng.normal(size=q.shape), sds=np.full(count, SD),
        directions=-normals[rows] @ T[:3, :3].T,
    )  # fmt: skip


def prior_of(T, kind, rng):
    height = HEIGHT_SD * rng.normal()
    if kind == "table":
        return PosePrior(table=Table(np.array([0, 0, 0.02 + height]), np.array([0, 0, 1.0]), HEIGHT_SD))
    heading = rng.uniform(-np.pi, np.pi) if kind == "heading" else np.radians(20) * rng.normal()
    about = SO3.axis_rotation(2, heading) @ T[:3, :3]
    near = SE3.from_parts(about, T[:3, 3] + [*(0.1 * rng.normal(size=2)), height])
    sds = [np.radians(0.01)] * 2 + [np.pi if kind == "heading" else np.radians(20)]
    frame = uncertain_frame(NamedCovariance(near, np.diag([0.1, 0.1, HEIGHT_SD, *sds]) ** 2, ROS))
    return PosePrior(T_world_part=frame.T, covariance=frame.C)


def outcome(answer, part, T):
    def off(one):
        images = one.T_world_part @ part.symmetry.Ts
        away = SE3.apply(images[:, None], part.vertices) - SE3.apply(T, part.vertices)
        return float(np.linalg.norm(away, axis=-1).max(axis=1).min())

    near = [off(one) < NEAR * max(one.corner_sd, SD) for one in answer.hypotheses]
    share = sum(one.probability for one, right in zip(answer.hypotheses, near, strict=True) if right)
    sure = answer.status == "recognized"
    return answer.unknown_probability > 0.5, sure, sure and not near[0], share


def scene_of(parts, touches, seed, number, kind):
    """Return a part, its pose on a table, touches of it, and a prior of its pose."""
    rng, part = np.random.default_rng((seed, number)), parts[number % len(parts)]
    place = np.array([*rng.uniform(0.1, 0.4, 2), 0.02 - part.vertices[:, 2].min()])
    T = SE3.from_parts(SO3.axis_rotation(2, rng.uniform(-np.pi, np.pi)), place)
    readings = touched(part, T, touches, rng)
    return part, T, readings, prior_of(T, kind, rng)


def main(scenes=100, touches=5, seed=1, kind="table"):
    parts = [read_part(PARTS / f"{name}.step") for name in NAMES]
    rows = {"without": [], kind: []}
    for scene in range(scenes):
        part, T, readings, pose = scene_of(parts, touches, seed, scene, kind)
        rows["without"].append(outcome(locate(readings, part), part, T))
        rows[kind].append(outcome(locate(readings, part, priors=Priors(pose=pose)), part, T))
    print("| prior | touches | scenes | P(unknown) > 0.5 | recognized | wrongly so | mean P of the true pose |")
    print("|---|---|---|---|---|---|---|")
    for name, got in rows.items():
        unknown, sure, wrong, share = np.array(got, dtype=float).T
        print(
            f"| {name} | {touches} | {scenes} | {unknown.sum():.0f} | {sure.sum():.0f} | {wrong.sum():.0f} | "
            f"{share.mean():.2f} |"
        )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:4]), *sys.argv[4:5])
