"""Errors of poses from images, relative to the stated ones: ``python benchmarks/vision_poses.py [images]``.

Recognition is excluded: the part is known and the search starts at the truth. The same scenes are rendered with 30 % of
the part hidden, with nothing hidden, and without noise as well; the pose of the table has errors as stated. The
accuracy
of the lens is stated or not, and its distortion is right or wrong. Printed is the normalised squared error of position
and yaw. ``--keep FILE`` and ``--processes N``: ``campaign.py``.
"""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
from campaign import options, run_cases
from common import Table
from scipy.stats import chi2

from tanteo.geometry import SE3
from tanteo.posterior import OnTable
from tanteo.vision import find_edges
from tanteo.vision.answers import hypothesis
from tanteo.vision.camera import USUAL_EDGE_SD, project
from tanteo.vision.edges import chance_hits, map_edges
from tanteo.vision.image_edges import ImageEdges
from tanteo.vision.posterior import infer
from tanteo.vision.regions import find_regions, silhouette
from tanteo.vision.sight import area_of
from tanteo.vision.table import TableErrors
from vision import models_of, pose_errors
from vision_scenes import in_camera, random_shot, stated_table

SEED = 2024
WAYS = {
    "30 % hidden": (0.3, 1.0, 0.0, 0.0),
    "nothing hidden": (0.0, 1.0, 0.0, 0.0),
    "nothing hidden, no noise": (0.0, 0.0, 0.0, 0.0),
    "30 % hidden, lens accuracy not stated": (0.3, 1.0, 0.0, USUAL_EDGE_SD),
    "lens wrong by 0.1 px, not stated": (0.3, 1.0, 0.1, USUAL_EDGE_SD),
    "lens wrong by 0.3 px, not stated": (0.3, 1.0, 0.3, USUAL_EDGE_SD),
    "lens wrong by 0.3 px, stated so": (0.3, 1.0, 0.3, 0.3),
    "lens wrong by 0.1 px, stated as exact": (0.3, 1.0, 0.1, 0.0),
}
"""Hidden share, factor of the noise, error of the lens, and its stated error [px]."""


def distorted_camera(camera, wrong, rng):
    """Return the camera with a random distortion of a given rms pixel error along each axis and zero mean."""
    size = np.array(camera.size)
    rays = np.stack(np.meshgrid(*(np.linspace(0, n, 20) for n in size)), axis=-1).reshape(-1, 2)
    rays = np.c_[(rays - camera.centre) / camera.focal, np.ones(len(rays))]
    distorted, before = camera, project(camera, rays)
    for k, weight in enumerate(rng.normal(size=4)):
        one = 1e-4 * (np.arange(len(camera.distortion)) == k)
        moved = project(replace(camera, distortion=camera.distortion + one), rays) - before
        distorted = replace(distorted, distortion=distorted.distortion + weight * one / np.std(moved, axis=0).max())
    moved = project(distorted, rays) - before
    share = wrong / np.sqrt(np.mean((moved - moved.mean(axis=0)) ** 2))
    distorted = replace(distorted, distortion=camera.distortion + share * (distorted.distortion - camera.distortion))
    K = camera.K.copy()
    K[:2, 2] -= (project(distorted, rays) - before).mean(axis=0)
    return replace(distorted, K=K)


def pose(image, hidden, noise, wrong, stated):
    """Return the squared error over its covariance and the error in mm; None if a direction is unobserved."""
    models = [m for m in models_of(20)[0] if not m.part.symmetry.continuous]
    model, rng = models[image % len(models)], np.random.default_rng([SEED, image])
    shot = random_shot([model], rng, hidden, noise=noise)
    camera, points = replace(shot.camera, edge_sd=stated), find_edges(shot.image)
    if wrong:
        camera = distorted_camera(camera, wrong, np.random.default_rng([SEED, image, 2]))
    table = stated_table(shot, model.part, np.random.default_rng([SEED, image, 1]))
    T_camera_table = SE3.inverse(camera.T_world_camera) @ table
    truth, errors = in_camera(shot), TableErrors()
    there = silhouette(model.frame.surface, camera, truth)
    region = max(find_regions(shot.image, points), key=lambda region: (region.mask & there).sum())
    seen = ImageEdges(camera, map_edges(points), chance_hits(points))
    lying = OnTable(table, errors.height, errors.tilt, area_of(region, camera, T_camera_table))
    found = infer((seen,), [(model, (camera.T_world_camera @ truth)[None])], 1, lying=lying)
    answer = hypothesis(found.modes[0], (seen,), lying=True)
    return None if answer.unobserved else pose_errors(model, answer, shot.T_world_part)


def main():
    arguments, keep, processes = options(sys.argv[1:])
    count = int(arguments[0]) if arguments else 200
    cases = [(image, *way) for image in range(count) for way in WAYS.values()]
    found = dict(zip(cases, run_cases(pose, cases, keep, processes), strict=True))
    rows = []
    for name, way in WAYS.items():
        z, mm = np.array([found[image, *way] for image in range(count) if found[image, *way]]).T
        low, high = chi2.ppf([0.005, 0.995], 3 * len(z)) / (3 * len(z))
        near = np.mean(z < chi2.ppf(0.95, 3))
        middle = np.median(z) / chi2.median(3)
        rows.append(
            (name, str(len(z)), f"{z.mean() / 3:.2f} ({low:.2f} to {high:.2f})", f"{middle:.2f}", f"{near:.1%}",
             f"{np.median(mm):.3f} mm", f"{z.max():.0f}")
        )  # fmt: skip
    head = ("scenes", "poses", "NEES / dof (expected)", "median / expected", "in the 95 % region", "error", "worst")
    print(Table("Poses", "", head, rows).markdown())


if __name__ == "__main__":
    main()
