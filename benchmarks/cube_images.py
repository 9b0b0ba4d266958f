"""A cube in real grey images, refined, followed, and found without a first pose: ``python benchmarks/cube_images.py``.

Needs the folder of real measurements beside the checkout (``grey_cube``).
"""

from __future__ import annotations

import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import grey_cube
from tanteo.geometry import SE3
from tanteo.vision import find_edges, prepare_vision
from tanteo.vision.camera import project, project_linearized
from tanteo.vision.edges import map_edges
from tanteo.vision.fit import refine
from tanteo.vision.solid import follow, see_anywhere


def first_image(model):
    """Refine the published pose, and compare both with the corners in the image."""
    image, published = grey_cube.load(grey_cube.images()[0]), grey_cube.published()
    T = refine(model.frame, grey_cube.camera(), map_edges(find_edges(image)), published[None])[0]
    corners, measured = grey_cube.measured_corners(image, model, T)
    rms = {}
    for name, pose in (("refined", T), ("published", published)):
        off = project(grey_cube.camera(), SE3.apply(pose, corners)) - measured
        rms[name] = np.sqrt(np.mean(np.sum(off**2, axis=1)))
        print(f"{name}: {rms[name]:.2f} px rms from {len(corners)} corners of the image")
    turn = np.degrees(np.linalg.norm(SE3.log(SE3.inverse(published) @ T)[3:]))
    near, far = np.linalg.norm(published[:3, 3]), np.linalg.norm(T[:3, 3])
    shift = np.linalg.norm(T[:3, 3] - published[:3, 3])
    print(
        f"refined against published: {turn:.2f} deg, range {far / near - 1:+.2%}, shift {shift / near:.2%} of the range"
    )
    free = by_lines(corners, measured, T)
    print(f"fitted to corners of the image alone: range {np.linalg.norm(free[:3, 3]) / near - 1:+.2%} of the published")
    for name in rms:
        print(f"so far off at corners, the {name} range is known to {by_corners(T, corners, rms[name]):.2%}")
    print(f"the jackknife over edges moves the refined range by {by_edges(model, image, T):.2%}")
    return T


def seen_from(T, points):
    """Pixels of points ``(n, 2)``, and their derivative by the pose ``(2 n, 6)``."""
    pixels, D = project_linearized(grey_cube.camera(), SE3.apply(T, points))
    JR = D @ T[:3, :3]
    return pixels, np.concatenate([JR, np.cross(points[:, None], JR)], axis=-1).reshape(-1, 6)


def by_lines(corners, measured, T):
    """Return the pose nearest to the corners of the image, by Gauss-Newton."""
    for _ in range(20):
        pixels, J = seen_from(T, corners)
        T = T @ SE3.exp(np.linalg.lstsq(J, (measured - pixels).ravel(), rcond=None)[0])
    return T


def by_corners(T, corners, rms):
    """Deviation of the range of a pose that is fitted to corners and so comes to be ``rms`` off at them, as a share."""
    J = seen_from(T, corners)[1]
    way = T[:3, :3].T @ T[:3, 3] / np.linalg.norm(T[:3, 3])
    # points with unit deviation leave six numbers of variance one in the fitted pixels
    unit = np.sqrt(6 / len(corners))
    return rms / unit * np.sqrt(way @ np.linalg.inv(J.T @ J)[:3, :3] @ way) / np.linalg.norm(T[:3, 3])


def by_edges(model, image, T):
    """Deviation of the range, as a share, by the jackknife: refined without each of the edges in turn (Efron 1982)."""
    frame, edges, ranges = model.frame, map_edges(find_edges(image)), []
    for group in np.unique(frame.groups):
        some = frame.groups != group
        per_sample = ("points", "tangents", "normals", "lengths", "sharp", "groups")
        less = replace(frame, **{name: getattr(frame, name)[some] for name in per_sample})
        ranges.append(np.linalg.norm(refine(less, grey_cube.camera(), edges, T[None])[0][:3, 3]))
    ranges = np.array(ranges) / np.linalg.norm(T[:3, 3])
    return np.sqrt((len(ranges) - 1) * np.var(ranges))


def main():
    with tempfile.TemporaryDirectory() as folder:
        model = prepare_vision(grey_cube.cube(Path(folder)))
    T = first_image(model)
    rng, camera = np.random.default_rng(1), grey_cube.camera()
    among = best = 0
    claims, shares, misfits, spent = [], [], [], []
    names = grey_cube.images()
    for name in names:
        image = grey_cube.load(name)
        T = follow(image, camera, model, T, rng)
        start = time.process_time()
        answer = see_anywhere(image, camera, [model]).objects[0].answer
        spent.append(time.process_time() - start)
        right = [grey_cube.same_pose(model.part, h.T_world_part, T) for h in answer.hypotheses]
        among, best = among + any(right), best + right[0]
        claims.append(answer.hypotheses[0].probability)
        shares.append(answer.status == "recognized")
        misfits.append(right[0] and answer.hypotheses[0].p_value < 1e-6)
    print(f"followed through {len(names)} images; without a first pose among the modes in {among}, the best in {best}")
    print(f"claimed for the best {np.mean(claims):.3f}, recognized {sum(shares)}, {np.median(spent):.1f} s an image")
    print(f"right, though their edges fit badly (p < 1e-6): {sum(misfits)}")


if __name__ == "__main__":
    main()
