"""Parts on a table as a camera sees them, partly hidden: ``python benchmarks/vision.py [parts images share seed]``.

``--keep FILE`` and ``--processes N`` are for long ones (``campaign.py``).

The parts are the twelve of ``examples/parts`` and random workpieces, always the same, or those of the examples that are
named (``step_12mm,step_15mm`` instead of their number); of each, so many rendered images
(``tanteo.vision.rendering``: shading, cast shadows, blur, noise) with a plate in the way that hides a share of it, 0.3
if not given. Every tenth image is of a part that is not among them. The table is told with errors that are drawn from
those stated for it. The seed is that of the scenes. Printed: how often the true part is among the first answers, how
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
from vision_scenes import in_camera, random_shot, told_table

SEED = 1991
BINS = (0.0, 0.5, 0.8, 0.95, 0.99, 1.0)
STRANGERS = 0.1
"""Share of images whose part is not in the catalogue: what the vision's prior takes it to be."""

LEAST = 1e-4
"""Truths that are less probable, or not among the answers, count as this in the mean log probability."""

TOLD = 0.95
"""Probability from which the pose counts as claimed."""


@cache
def models_of(count):
    """The example parts, then random ones; and strangers."""
    with tempfile.TemporaryDirectory() as folder:
        return _models(count, folder)


def _models(count, folder):
    parts = list(read_parts([Path(__file__).parents[1] / "examples" / "parts"]).parts)
    rng = np.random.default_rng(SEED)
    if isinstance(count, str):
        parts = [part for part in parts if part.name in count.split(",")]
    else:
        parts = parts[:count] + [random_part(Path(folder, f"random{k}.off"), rng) for k in range(count - len(parts))]
    strangers = [random_part(Path(folder, f"stranger{k}.off"), rng) for k in range(8)]
    return [prepare_vision(p) for p in parts], [prepare_vision(p) for p in strangers]


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


def look(count, k, image, hidden, seed):
    """One image: rank of the true part, what was claimed and whether it was right, pose error, time."""
    models, strangers = models_of(count)
    rng = np.random.default_rng([seed, k, image])
    stranger = strangers[int(rng.integers(len(strangers)))] if rng.uniform() < STRANGERS else None
    shot = random_shot([models[k]], rng, hidden, stranger)
    T_world_table = told_table(shot, (stranger or models[k]).part, rng)
    start = time.process_time()
    sight = see_table(shot.image, shot.camera, models, T_world_table=T_world_table, top=20)
    spent = time.process_time() - start
    if not sight.objects:
        return None
    known = stranger is None
    # the object is the one that has most of the part's place in the image; the thing in the way may be another
    there = silhouette((stranger or models[k]).frame.surface, shot.camera, in_camera(shot))
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
    claim, said = (none, None) if first is None or none > shares[first] else (shares[first], first)
    nees = mm = np.nan
    if known and best is not None and best.part == truth and best.probability > TOLD and not best.unobserved:
        nees, mm = pose_errors(models[k], best, shot.T_world_part)
    continuous = known and models[k].part.symmetry.continuous
    if known and rank > 2:
        print(f"{truth}, image {image}: rank {rank}, {100 * shot.hidden:.0f} % hidden", file=sys.stderr)
    # what is left belongs to the parts in poses that were not found
    left = max(1 - none - sum(shares.values()), 0.0) / len(models)
    truly = shares.get(truth, 0.0) + left if known else none
    return known, rank, claim, said == truth, nees if not continuous else np.nan, mm, spent, shot.hidden, truly


def report(rows, hidden):
    """The rows as a table."""
    known, rank, claim, right, nees, mm, spent, covered, truly = (
        np.array(column) for column in zip(*rows, strict=True)
    )
    known = known.astype(bool)
    table = []
    table.append(("images, of a stranger", f"{len(rows)}, {(~known).sum()}"))
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
        table.append(("position and yaw, NEES / dof", f"{z.mean() / 3:.2f} ({len(z)}); honest {low:.2f} to {high:.2f}"))
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
    rows = [row for row in run_cases(look, cases, keep, processes) if row is not None]
    print(report(rows, hidden).markdown())


if __name__ == "__main__":
    main()
