"""Ellipses of circular rims: ``python benchmarks/ellipses.py [trials] [scenes] [seed]``.

Points of an arc of an ellipse with normal errors: how often it is refused, and the normalised squared error of the
ellipse's five numbers and of centre and axis of the circle behind it (of the nearer of the two). Then plates with holes
whose outline has a half turn or more of symmetry, rendered and seen without a table and on it, beside a twin of which
one hole is 2 to 5 mm elsewhere: which of the two, and the pose, with the rims of the holes in use and without.
"""

from __future__ import annotations

import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from OCP.Message import Message
from scipy.stats import chi2

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from common import Table
from holes import part_of

from rendered import table_camera
from tanteo.errors import DegenerateError
from tanteo.geometry import SE3, SO3
from tanteo.parts import round_features
from tanteo.vision import prepare_vision, render, see
from tanteo.vision.circles import circle_poses, project_circle
from tanteo.vision.ellipse_fit import fit_ellipse
from tanteo.vision.rendering import Stage, rendered_part
from vision import pose_errors
from vision_scenes import random_rendering

TILTS = ((0, 5), (5, 10), (10, 20), (20, 40), (40, 75))
ARCS = (360, 180, 120, 90, 75, 60, 45, 30)
SD, SPACING = 0.1, 1.5
RADIUS = 8e-3


def circle_in_view(rng, tilts=(20, 65)):
    """Return a camera without distortion, a tilted circle in front of it, and its ellipse."""
    camera = replace(table_camera(distortion=()), edge_sd=0.0)
    at = np.array([*rng.uniform(-0.05, 0.05, 2), rng.uniform(0.1, 0.2)])
    turn, tilt = rng.uniform(0, 2 * np.pi), np.radians(rng.uniform(*tilts))
    R = SO3.exp(tilt * np.array([np.cos(turn), np.sin(turn), 0.0])) @ np.diag([1.0, -1.0, -1.0])
    if R[:, 2] @ at > 0:  # from behind: axes are stated towards the camera
        R = R @ np.diag([1.0, -1.0, -1.0])
    T = SE3.from_parts(R, at)
    return camera, T, project_circle(camera, T, RADIUS)


def arc_points(ellipse, degrees, rng):
    """Points of an arc [px], at about equal steps, with errors along the normal."""
    a, b = ellipse.semi_axes
    count = max(8, int(np.radians(degrees) * np.sqrt(0.5 * (a * a + b * b)) / SPACING))
    t = rng.uniform(0, 2 * np.pi) + np.radians(degrees) * (np.arange(count) + 0.5) / count
    u = np.stack([np.cos(t), np.sin(t)], axis=1)
    n = u @ np.linalg.inv(ellipse.shape)
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    return ellipse.centre + u @ ellipse.shape + rng.normal(0, SD, count)[:, None] * n


def trial(degrees, rng, tilts=(20, 65)):
    """Squared errors over their covariances, of the ellipse and of the circle; none for what was refused."""
    camera, T, truth = circle_in_view(rng, tilts)
    points = arc_points(truth, degrees, rng)
    try:
        found = fit_ellipse(points, np.full(len(points), SD))
    except DegenerateError:
        return None
    off = found.numbers - truth.numbers
    e2 = off @ np.linalg.solve(found.covariance, off)
    poses = circle_poses(camera, found, RADIUS)
    errors = [SE3.log(SE3.inverse(pose.T_camera_circle) @ _spun(T, pose.T_camera_circle))[:5] for pose in poses]
    z = [off @ np.linalg.solve(pose.covariance[:5, :5], off) for off, pose in zip(errors, poses, strict=True)]
    return e2, min(z), len(poses)


def _spun(T, other):
    """Rotate the circle's frame about its axis until it is nearest to another frame."""
    M = T[:3, :3].T @ other[:3, :3]
    return T @ SE3.from_parts(SO3.axis_rotation(2, np.arctan2(M[1, 0] - M[0, 1], M[0, 0] + M[1, 1])), np.zeros(3))


def arcs(trials, seed):
    rows, low_high = [], chi2.ppf([0.025, 0.975], 5 * trials) / (5 * trials)
    for degrees in ARCS:
        rng = np.random.default_rng([seed, degrees])
        found = [trial(degrees, rng) for _ in range(trials)]
        ellipses, circles = ([f[k] for f in found if f is not None] for k in (0, 1))
        shown = [f"{np.mean(z) / 5:.3f}" if len(z) > 0.02 * trials else "-" for z in (ellipses, circles)]
        inside = [f"{100 * np.mean(np.array(z) < chi2.ppf(0.95, 5)):.1f} %" if len(z) > 0.02 * trials else "-"
                  for z in (ellipses, circles)]  # fmt: skip
        rows.append(
            (str(degrees), f"{100 * (1 - len(circles) / trials):.1f} %", shown[0], inside[0], shown[1], inside[1])
        )
    head = ("arc deg", "refused", "ellipse, NEES / 5", "in 95 %", "circle, NEES / 5", "in 95 %")
    words = (
        f"{trials} trials a row, sd {SD} px, a point every {SPACING} px, circles tilted by 20 to 65 degrees. 95 % "
        f"interval of the mean NEES with nothing refused: {low_high[0]:.3f} to {low_high[1]:.3f}."
    )
    return Table("Arcs of ellipses", words, head, rows)


def tilted(trials, seed):
    rows = []
    for tilts in TILTS:
        rng = np.random.default_rng([seed, *tilts])
        found = [one for one in (trial(360, rng, tilts) for _ in range(trials)) if one is not None]
        z = np.array([one[1] for one in found])
        inside = f"{100 * np.mean(z < chi2.ppf(0.95, 5)):.1f} %"
        alone = f"{100 * np.mean([one[2] == 1 for one in found]):.0f} %"
        rows.append((f"{tilts[0]} to {tilts[1]}", alone, f"{np.mean(z) / 5:.3f}", inside))
    words = f"{trials} trials a row, whole rims; tilt against the line of sight."
    return Table("Circles", words, ("tilt deg", "one solution", "NEES / 5", "in 95 %"), rows)


def plates(rng, folder, name):
    """Return a plate whose outline has a symmetry of 180 or 90 degrees, and a near variant with one hole displaced."""
    half = np.full(2, rng.uniform(35, 55)) if rng.uniform() < 0.5 else rng.uniform(30, 60, 2)
    holes = []
    while len(holes) < 5:
        p, radius = rng.uniform(-1, 1, 2) * (half - 12), float(rng.uniform(3, 6))
        if all(np.hypot(*(p - q)) > radius + r + 8 for q, r, _ in holes):
            holes.append((p, radius, False))
    turn = rng.uniform(0, 2 * np.pi)
    p = holes[0][0] + rng.uniform(2, 5) * np.array([np.cos(turn), np.sin(turn)])
    thick = float(rng.uniform(6, 12))
    specs = [holes, [(p, *holes[0][1:]), *holes[1:]]]
    return [part_of((False, half, thick, some, []), f"{name}{k}", folder) for k, some in enumerate(specs)]


def without_rims(model):
    """Return the model of a plate without the search for rims of holes."""
    part = replace(model.part)
    part.derived["rounds"] = ()
    some = [_beside_rims(frame, round_features(model.part)) for frame in (model.frame, model.coarse)]
    return replace(model, part=part, frame=some[0], coarse=some[1])


def _beside_rims(frame, features):
    own = np.ones(len(frame), dtype=bool)
    for rim in (rim for feature in features for rim in feature.rims):
        local = frame.points - rim.centre
        height = local @ rim.axis
        out = np.linalg.norm(local - height[:, None] * rim.axis, axis=1) - rim.radius
        own &= np.hypot(height, out) > 1e-3 * rim.radius
    fields = (frame.points, frame.tangents, frame.bends, frame.normals, frame.lengths, frame.sharp, frame.groups)
    return type(frame)(*(a[own] for a in fields), frame.surface, frame.diagonal, frame.middle)


def scene(k, seed, folder):
    """Return for each setting whether the part is right, and for right poses the squared error over its covariance."""
    rng = np.random.default_rng([seed, k])
    models = [prepare_vision(part) for part in plates(rng, folder, f"s{k}_")]
    truth = models[int(rng.integers(2))]
    camera = replace(table_camera(rng.uniform(0.4, 0.5), rng.uniform(15, 40), rng.uniform(-180, 180)), edge_sd=0.0)
    place = np.r_[rng.uniform(-0.02, 0.02, 2), 0.0]
    turned = SE3.from_parts(SO3.axis_rotation(2, rng.uniform(-np.pi, np.pi)), place)
    flat = max(truth.rests, key=lambda rest: rest.probability)
    T = turned @ flat.T_table_part
    image, _ = render(Stage(camera, [rendered_part(truth.part, T, rng.uniform(70, 150))], random_rendering(rng)), rng)
    out = {}
    for rims in (True, False):
        some = models if rims else [without_rims(model) for model in models]
        wanted = some[models.index(truth)]
        for table in (True, False):
            start = time.perf_counter()
            sight = see(image, camera if table else replace(camera, T_world_camera=None), some)
            world = T if table else SE3.inverse(camera.T_world_camera) @ T
            out[rims, table] = (*judged(sight, wanted, world, table), time.perf_counter() - start)
    return out


def judged(sight, wanted, T, table):
    """Return whether the first answer is the part, its probability, and its squared error (None for another pose)."""
    if not sight.objects or not sight.objects[0].modes:
        return False, 0.0, None
    seen = sight.objects[0]
    mode, best = seen.modes[0], seen.answer.hypotheses[0]
    share = sum(h.probability for h in seen.answer.hypotheses if h.part == wanted.part.name)
    if mode.model is not wanted:
        return False, share, None
    off = SE3.log(SE3.inverse(best.T_world_part) @ T)
    if np.linalg.norm(off[3:]) > np.radians(4) or best.unobserved:
        return True, share, None
    if table:
        return True, share, pose_errors(wanted, best, T)[0] / 3
    return True, share, off @ np.linalg.solve(best.covariance, off) / 6


def seen(scenes, seed):
    with tempfile.TemporaryDirectory() as folder:
        found = [scene(k, seed, Path(folder)) for k in range(scenes)]
    rows = []
    for way in found[0] if found else ():
        right, share, z, seconds = zip(*(f[way] for f in found), strict=True)
        z, dof = np.array([v for v in z if v is not None]), 3 if way[1] else 6
        nees = f"{z.mean():.2f}, median {np.median(z) * dof / chi2.median(dof):.2f}" if len(z) else "-"
        inside = f"{100 * np.mean(z * dof < chi2.ppf(0.95, dof)):.0f} %" if len(z) else "-"
        low, high = chi2.ppf([0.025, 0.975], dof * max(len(z), 1)) / (dof * max(len(z), 1))
        rows.append((
            "on the table" if way[1] else "no table", "in use" if way[0] else "not used",
            f"{100 * np.mean(right):.0f} %", f"{np.mean(share):.2f}",
            f"{100 * len(z) / scenes:.0f} %", f"{nees} ({low:.2f} to {high:.2f})", inside,
            f"{np.median(seconds):.1f} s",
        ))  # fmt: skip
    head = ("camera", "rims", "plate right", "mean P of it", "plate and pose right", "NEES / dof (expected)", "in 95 %",
            "time")  # fmt: skip
    words = f"{scenes} scenes of two plates that differ in one hole by 2 to 5 mm, images of 640 x 480."
    return Table("Plates with holes", words, head, rows)


def main():
    trials, scenes, seed = (int(a) for a in (*sys.argv[1:], *("2000", "60", "1991")[len(sys.argv) - 1 :]))
    Message.DefaultMessenger_s().ChangePrinters().Clear()
    print(arcs(trials, seed).markdown(), end="\n\n")
    print(tilted(trials // 2, seed).markdown(), end="\n\n")
    if scenes:
        print(seen(scenes, seed).markdown())


if __name__ == "__main__":
    main()
