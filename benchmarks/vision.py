"""Recognition of partly hidden parts on a table from images: ``python benchmarks/vision.py [parts images share seed]``.

``--keep FILE`` and ``--processes N`` are for long runs (``campaign.py``).

The parts are the twelve of ``examples/parts`` and random workpieces, always the same; names of examples
(``step_12mm,step_15mm``) may replace the number of parts. ``images`` is the number of rendered images of each part
(``tanteo.vision.rendering``: shading, cast shadows, blur, noise). A plate in front hides a share of the part, 0.3 by
default. Every tenth image shows a part that is not in the catalogue. The pose of the table has errors drawn from those
stated for it. ``seed`` is the seed of the scenes. Printed are: how often the true part is among the first answers, how
often the probabilities are right, the mean log probability of the truth, and the normalised squared error of position
and yaw.
"""

from __future__ import annotations

import sys
import tempfile
import time
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.stats import chi2

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from campaign import options, run_cases
from common import Table

from random_parts import random_part
from tanteo.catalogue import read_parts
from tanteo.geometry import SE3
from tanteo.vision import prepare_vision, see_table
from tanteo.vision.regions import silhouette
from vision_scenes import in_camera, random_shot, stated_table

SEED = 1991
BINS = (0.0, 0.5, 0.8, 0.95, 0.99, 1.0)
UNKNOWN_SHARE = 0.1
"""Share of images whose part is not in the catalogue: what the vision's prior takes it to be."""

LEAST = 1e-4
"""Truths that are less probable, or not among the answers, count as this in the mean log probability."""

CLAIMED = 0.95
"""Probability from which the pose counts as claimed."""


@cache
def models_of(count):
    """Return the example parts, then random ones, and parts that are not in the catalogue."""
    with tempfile.TemporaryDirectory() as folder:
        return _models(count, folder)


def _models(count, folder):
    parts = list(read_parts([Path(__file__).parents[1] / "examples" / "parts"]).parts)
    rng = np.random.default_rng(SEED)
    if isinstance(count, str):
        parts = [part for part in parts if part.name in count.split(",")]
    else:
        parts = parts[:count] + [random_part(Path(folder, f"random{k}.off"), rng) for k in range(count - len(parts))]
    others = [random_part(Path(folder, f"stranger{k}.off"), rng) for k in range(8)]
    return [prepare_vision(p) for p in parts], [prepare_vision(p) for p in others]


def pose_errors(model, best, truth):
    """Error in the plane and in yaw over their covariance, for the symmetric image nearest to the truth; and in mm."""
    T = best.T_world_part
    images = truth @ model.part.symmetry.Ts
    about = SE3.apply(T, model.part.centroid)
    # motion of the middle in the world, and turn about the vertical
    turns = SE3.log(images @ SE3.inverse(T))[:, 3:]
    k = int(np.argmin(np.linalg.norm(turns, axis=1)))
    move = SE3.apply(images[k], model.part.centroid) - about
    R, c = T[:3, :3], model.part.centroid
    J = np.zeros((3, 6))
    J[:2, :3] = R[:2]
    J[:2, 3:] = (R @ -np.array([[0, -c[2], c[1]], [c[2], 0, -c[0]], [-c[1], c[0], 0]]))[:2]
    J[2, 3:] = R[2]
    e = np.array([move[0], move[1], turns[k, 2]])
    return float(e @ np.linalg.solve(J @ best.covariance @ J.T, e)), 1e3 * float(np.linalg.norm(move[:2]))


def run_image(count, k, image, hidden, seed):
    """Return the figures of one image: rank of the true part, claim and whether it was right, pose error, time."""
    models, others = models_of(count)
    rng = np.random.default_rng([seed, k, image])
    other = others[int(rng.integers(len(others)))] if rng.uniform() < UNKNOWN_SHARE else None
    shot = random_shot([models[k]], rng, hidden, other)
    T_world_table = stated_table(shot, (other or models[k]).part, rng)
    start = time.process_time()
    sight = see_table(shot.image, shot.camera, models, T_world_table=T_world_table, top=20)
    spent = time.process_time() - start
    if not sight.objects:
        return None
    known = other is None
    #     # the object covers most of the part's place in the image; the plate in front may be another object
    there = silhouette((other or models[k]).frame.surface, shot.camera, in_camera(shot))
    seen = max(sight.objects, key=lambda seen: (seen.region.mask & there).sum())
    answer = seen.answer
    truth = models[k].part.name if known else None
    best = answer.hypotheses[0] if answer.hypotheses else None
    shares = {}
    for h in answer.hypotheses:
        shares[h.part] = shares.get(h.part, 0.0) + h.probability
    names = sorted(shares, key=lambda name: -shares[name])
    rank = names.index(truth) if truth in names else 99
    first = max(shares, key=shares.get) if shares else None
    none = answer.unknown_probability
    claim, named = (none, None) if first is None or none > shares[first] else (shares[first], first)
    nees = mm = np.nan
    if known and best is not None and best.part == truth and best.probability > CLAIMED and not best.unobserved:
        nees, mm = pose_errors(models[k], best, shot.T_world_part)
    continuous = known and models[k].part.symmetry.continuous
    if known and rank > 2:
        print(f"{truth}, image {image}: rank {rank}, {100 * shot.hidden:.0f} % hidden", file=sys.stderr)
    # what is left belongs to the parts in poses that were not found
    left = max(1 - none - sum(shares.values()), 0.0) / len(models)
    truly = shares.get(truth, 0.0) + left if known else none
    return known, rank, claim, named == truth, nees if not continuous else np.nan, mm, spent, shot.hidden, truly


def report(rows, hidden):
    """Return the rows as a table."""
    known, rank, claim, right, nees, mm, spent, covered, truly = (
        np.array(column) for column in zip(*rows, strict=True)
    )
    known = known.astype(bool)
    table = []
    table.append(("images, of a part that is not in the catalogue", f"{len(rows)}, {(~known).sum()}"))
    table.append(("hidden on the average", f"{100 * covered.mean():.0f} %"))
    table.append(("true part is the first", f"{100 * np.mean(rank[known] == 0):.1f} %"))
    table.append(("true part in the first three", f"{100 * np.mean(rank[known] < 3):.1f} %"))
    table.append(("claimed, right (all)", f"{claim.mean():.3f}, {right.mean():.3f}"))
    table.append(("mean log probability of the truth", f"{np.mean(np.log(np.maximum(truly, LEAST))):.3f}"))
    for low, high in pairwise(BINS):
        inside = (claim > low) & (claim <= high)
        if inside.any():
            text = f"{claim[inside].mean():.3f}, {right[inside].mean():.3f} ({inside.sum()})"
            table.append((f"claimed {low:g} to {high:g}, right", text))
    z = nees[np.isfinite(nees)]
    near = z[z < 50]
    if len(z):
        low, high = chi2.ppf([0.005, 0.995], 3 * len(z)) / (3 * len(z))
        table.append(
            ("position and yaw, NEES / dof", f"{z.mean() / 3:.2f} ({len(z)}); expected {low:.2f} to {high:.2f}")
        )
        table.append(("the same without gross errors", f"{near.mean() / 3:.2f} ({len(near)})"))
        table.append(("inside the 95 % region", f"{100 * np.mean(z < chi2.ppf(0.95, 3)):.1f} %"))
        table.append(("error of position, median", f"{np.nanmedian(mm):.2f} mm"))
    table.append(("time for an image, median", f"{np.median(spent):.1f} s"))
    return Table(f"{hidden:.0%} hidden", "", ("", ""), table)


def main():
    arguments, keep, processes = options(sys.argv[1:])
    count = arguments[0] if arguments else "20"
    count = int(count) if count.isdigit() else count
    images = int(arguments[1]) if len(arguments) > 1 else 50
    hidden = float(arguments[2]) if len(arguments) > 2 else 0.3
    seed = int(arguments[3]) if len(arguments) > 3 else SEED
    parts = len(count.split(",")) if isinstance(count, str) else count
    cases = [(count, k, image, hidden, seed) for image in range(images) for k in range(parts)]
    rows = [row for row in run_cases(run_image, cases, keep, processes) if row is not None]
    print(report(rows, hidden).markdown())


if __name__ == "__main__":
    main()
