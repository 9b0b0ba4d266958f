"""Fit the weights of the evidence on rendered scenes of random parts: ``python benchmarks/vision_fit.py [scenes]``.

Printed are the weights that make the truth most probable, and how well a fit to the first half of the scenes does on
the second; then the errors of edge points under which the true poses are most probable. ``--keep FILE`` and
``--processes N`` are for long ones (``campaign.py``).
"""

from __future__ import annotations

import sys
import tempfile
from dataclasses import fields, replace
from functools import cache
from itertools import product
from pathlib import Path

import numpy as np
from scipy.optimize import minimize
from scipy.special import logsumexp

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from campaign import options, run_cases

from random_parts import random_part
from tanteo.lie import SE3
from tanteo.vision.belief import STRETCH, UNKNOWN, Weights, candidates_in, lie_down, log_weight, one_pose
from tanteo.vision.edge_map import map_edges
from tanteo.vision.edges import find_edges
from tanteo.vision.fit import refine
from tanteo.vision.models import prepare_vision
from tanteo.vision.regions import find_regions
from tanteo.vision.settle import EdgeErrors, settle
from tanteo.vision.silhouettes import silhouette
from tanteo.vision.table import TableErrors, lying_information
from vision import told_table
from vision_scenes import random_shot

PARTS = 16
SEED = 7001
"""Of the parts and scenes; no test or benchmark uses it."""

ERRORS = tuple(product((0.03, 0.04, 0.05, 0.07), (0.25, 0.4, 0.6), (0.05, 0.15, 0.3)))
"""Errors of edge points that are tried."""

LAST = (2.5, 1.5, 1.0, 0.8, 0.8)
"""How far the refinement looks, which starts at the truth [px]."""

WORST = 60.0
"""Densities farther below the median than this count as this: gross failures do not decide [nats]."""


@cache
def models():
    """The parts of the catalogue, then as many strangers."""
    rng = np.random.default_rng(SEED)
    with tempfile.TemporaryDirectory() as folder:
        return [prepare_vision(random_part(Path(folder, f"part{k}.off"), rng)) for k in range(2 * PARTS)]


def scene_of(k):
    """Candidates of one scene as rows of evidence, which of them are right, and the stretches of edge; None unseen."""
    rng, known = np.random.default_rng([SEED, k]), models()[:PARTS]
    stranger = models()[PARTS + int(rng.integers(PARTS))] if rng.uniform() < 0.25 else None
    shot = random_shot(known, rng, float(rng.choice([0.0, 0.15, 0.3, 0.4])), stranger)
    T_camera_table = SE3.inverse(shot.camera.T_world_camera)
    truth = T_camera_table @ shot.T_world_part
    points = find_edges(shot.image)
    edges, regions = map_edges(points), find_regions(shot.image, points)
    if not regions:
        return None
    there = silhouette((stranger or shot.model).frame.surface, shot.camera, truth)
    region = max(regions, key=lambda region: (region.mask & there).sum())
    found, stretches = candidates_in(known, shot.camera, T_camera_table, edges, region, TableErrors())
    rows, right = [], []
    for c in found:
        seen, e = [], c.evidence
        for k in np.argsort(-log_weight(e, Weights()), kind="stable"):
            if any(one_pose(c.model.part, c.T_camera_part[j], c.T_camera_part[k]) for j in seen):
                continue
            seen.append(k)
            rows.append([e.hits[k], e.misses[k], e.explained[k] / STRETCH, e.spilled[k] / STRETCH**2, c.priors[k]])
            right.append(c.model is shot.model and one_pose(c.model.part, c.T_camera_part[k], truth))
    scores = pose_scores(shot, edges, told_table(shot, shot.model, rng)) if stranger is None else None
    return {"rows": rows, "right": right, "stretches": stretches, "stranger": stranger is not None, "scores": scores}


def pose_scores(shot, edges, T_world_table):
    """Log density of the true pose for each choice of :data:`ERRORS`; None where the edges leave a direction free."""
    model, camera, table = shot.model, shot.camera, TableErrors()
    if model.part.symmetry.continuous:
        return None
    T_camera_table = SE3.inverse(camera.T_world_camera) @ T_world_table
    truth = SE3.inverse(camera.T_world_camera) @ shot.T_world_part
    start = lie_down(model, np.array([shot.rest]), truth[None], T_camera_table)
    prior = lying_information(SE3.inverse(T_camera_table) @ start, model.part.centroid, table)
    T = refine(model.frame, camera, edges, start, prior=prior, reaches=LAST)[0]
    out = []
    for errors in ERRORS:
        settled = settle(model, camera, edges, T, start=start[0], prior=prior[0], errors=EdgeErrors(*errors))
        e = SE3.log(SE3.inverse(settled.T_camera_part) @ truth)
        sign, log = np.linalg.slogdet(settled.information)
        out.append(0.5 * (log - e @ settled.information @ e) if sign > 0 else -np.inf)
    return out


def log_posterior(scene, theta, parts):
    """Log probabilities of the candidates and of none."""
    rows, stretches = scene["rows"], scene["stretches"]
    log = rows[:, :3] @ theta[:3] + theta[5] * rows[:, 3] + rows[:, 4] + np.log((1 - UNKNOWN) / parts)
    none = np.log(UNKNOWN) + theta[3] * stretches + theta[4]
    total = logsumexp(np.r_[log, none])
    return log - total, none - total


def loss(theta, scenes, parts):
    """Minus the mean log probability of the truth, strangers weighed down to their prior."""
    out = total = 0.0
    for scene in scenes:
        log, none = log_posterior(scene, theta, parts)
        weight = UNKNOWN / 0.25 if scene["stranger"] else (1 - UNKNOWN) / 0.75
        total += weight
        if scene["stranger"]:
            out -= weight * none
        elif scene["right"].any():
            out -= weight * logsumexp(log[scene["right"]])
        else:
            out -= weight * none
    return out / total


def fitted(scenes, start):
    """The weights of least loss."""
    options = {"maxiter": 4000, "maxfev": 4000}
    return minimize(loss, start, args=(scenes, PARTS), method="Nelder-Mead", options=options).x


def main():
    arguments, keep, processes = options(sys.argv[1:])
    count = int(arguments[0]) if arguments else 150
    scenes = [s for s in run_cases(scene_of, [(k,) for k in range(count)], keep, processes) if s and s["rows"]]
    scenes = [s | {"rows": np.array(s["rows"]), "right": np.array(s["right"], dtype=bool)} for s in scenes]
    first, second = scenes[: len(scenes) // 2], scenes[len(scenes) // 2 :]
    start = np.array([getattr(Weights(), f.name) for f in fields(Weights)])
    whole, half = fitted(scenes, start), fitted(first, start)
    print(replace(Weights(), **{f.name: round(float(v), 3) for f, v in zip(fields(Weights), whole, strict=True)}))
    used, best = loss(start, scenes, PARTS), loss(whole, scenes, PARTS)
    print(f"loss on all {len(scenes)}: {used:.3f} with the weights in use, {best:.3f} fitted")
    second_used, second_best = loss(start, second, PARTS), loss(half, second, PARTS)
    print(f"loss on the second half: {second_used:.3f} with the weights in use, {second_best:.3f} fitted to the first")
    known = [s for s in second if not s["stranger"]]
    print(f"the true pose is among the candidates in {np.mean([s['right'].any() for s in known]):.3f} of {len(known)}")
    for name, theta in (("in use", start), ("fitted to the first half", half)):
        claims, right = [], []
        for scene in second:
            log, none = log_posterior(scene, theta, PARTS)
            claims.append(np.exp(max(log.max(), none)))
            right.append(scene["stranger"] if none > log.max() else bool(scene["right"][np.argmax(log)]))
        print(f"second half, {name}: best answer claimed {np.mean(claims):.3f}, right {np.mean(right):.3f}")
    scores = np.array([s["scores"] for s in scenes if s["scores"]])
    mean = np.maximum(scores, np.median(scores) - WORST).mean(axis=0)
    order = np.argsort(-mean)[:5]
    print("; ".join(f"{EdgeErrors(*ERRORS[k])}: {mean[k]:.2f}" for k in order), f"log density of {len(scores)} poses")


if __name__ == "__main__":
    main()
