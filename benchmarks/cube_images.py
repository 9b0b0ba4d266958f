"""A cube in real grey images, refined, followed, and found without a first pose: ``python benchmarks/cube_images.py``.

Needs the folder of real measurements beside the checkout (``grey_cube``).
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import grey_cube
from tanteo.lie import SE3
from tanteo.vision import find_edges, follow, map_edges, prepare_vision, project, see_anywhere
from tanteo.vision.fit import refine


def first_image(model):
    """The published pose refined, and both against the corners that the image has."""
    image, published = grey_cube.load(grey_cube.images()[0]), grey_cube.published()
    T = refine(model.frame, grey_cube.camera(), map_edges(find_edges(image)), published[None])[0]
    corners, measured = grey_cube.measured_corners(image, model, T)
    for name, pose in (("refined", T), ("published", published)):
        off = project(grey_cube.camera(), SE3.apply(pose, corners)) - measured
        print(f"{name}: {np.sqrt(np.mean(np.sum(off**2, axis=1))):.2f} px rms from {len(corners)} corners of the image")
    turn = np.degrees(np.linalg.norm(SE3.log(SE3.inverse(published) @ T)[3:]))
    near, far = np.linalg.norm(published[:3, 3]), np.linalg.norm(T[:3, 3])
    shift = np.linalg.norm(T[:3, 3] - published[:3, 3])
    print(
        f"refined against published: {turn:.2f} deg, range {far / near - 1:+.2%}, shift {shift / near:.2%} of the range"
    )
    return T


def main():
    with tempfile.TemporaryDirectory() as folder:
        model = prepare_vision(grey_cube.cube(Path(folder)))
    T = first_image(model)
    rng, camera = np.random.default_rng(1), grey_cube.camera()
    among = best = 0
    claims, shares, spent = [], [], []
    names = grey_cube.images()
    for name in names:
        image = grey_cube.load(name)
        T = follow(image, camera, model, T, rng)
        start = time.process_time()
        answer = see_anywhere(image, camera, [model]).objects[0].recognition
        spent.append(time.process_time() - start)
        right = [grey_cube.same_pose(model.part, h.T_world_part, T) for h in answer.hypotheses]
        among, best = among + any(right), best + right[0]
        claims.append(answer.hypotheses[0].probability)
        shares.append(answer.status == "recognized")
    print(f"followed through {len(names)} images; without a first pose among the modes in {among}, the best in {best}")
    print(f"claimed for the best {np.mean(claims):.3f}, recognized {sum(shares)}, {np.median(spent):.1f} s an image")


if __name__ == "__main__":
    main()
