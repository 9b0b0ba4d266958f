"""Fit the weights of the evidence on rendered scenes of random parts: ``python benchmarks/vision_fit.py [scenes]``.

Printed are the weights that make the truth most probable, and how well a fit to the first half of the scenes does on
the second.
"""

from __future__ import annotations

import sys
import tempfile
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
from scipy.optimize import minimize
from scipy.special import logsumexp

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from random_parts import random_part
from tanteo.lie import SE3
from tanteo.vision.belief import STRETCH, UNKNOWN, Weights, candidates_in, log_weight, one_pose
from tanteo.vision.edge_map import map_edges
from tanteo.vision.edges import find_edges
from tanteo.vision.models import prepare_vision
from tanteo.vision.regions import find_regions
from tanteo.vision.table import TableErrors
from vision_scenes import random_shot

PARTS = 16
SEED = 7001
"""Of the parts and scenes; no test or benchmark uses it."""


def scene_of(models, strangers, rng):
    """Candidates of one scene as rows of evidence, which of them are right, and the stretches of edge; None unseen."""
    stranger = strangers[int(rng.integers(len(strangers)))] if rng.uniform() < 0.25 else None
    shot = random_shot(models, rng, float(rng.choice([0.0, 0.15, 0.3, 0.4])), stranger)
    points = find_edges(shot.image)
    regions = find_regions(shot.image, points)
    if not regions:
        return None
    T_camera_table = SE3.inverse(shot.camera.T_world_camera)
    found, stretches = candidates_in(models, shot.camera, T_camera_table, map_edges(points), regions[0], TableErrors())
    truth = T_camera_table @ shot.T_world_part
    rows, right, kept = [], [], []
    for c in found:
        seen = []
        for k in np.argsort(-log_weight(c.evidence, Weights()), kind="stable"):
            if any(one_pose(c.model.part, c.T_camera_part[j], c.T_camera_part[k]) for j in seen):
                continue
            seen.append(k)
            e = c.evidence
            rows.append([e.hits[k], e.misses[k], e.explained[k] / STRETCH, e.spilled[k] / STRETCH**2, c.priors[k]])
            right.append(c.model is shot.model and one_pose(c.model.part, c.T_camera_part[k], truth))
            kept.append(c.model is shot.model)
    return np.array(rows), np.array(right), np.array(kept), stretches, stranger is not None


def log_posterior(scene, theta, parts):
    """Log probabilities of the candidates and of none."""
    rows, _, _, stretches, _ = scene
    log = rows[:, :3] @ theta[:3] + theta[5] * rows[:, 3] + rows[:, 4] + np.log((1 - UNKNOWN) / parts)
    none = np.log(UNKNOWN) + theta[3] * stretches + theta[4]
    total = logsumexp(np.r_[log, none])
    return log - total, none - total


def loss(theta, scenes, parts):
    """Minus the mean log probability of the truth, strangers weighed down to their prior."""
    out = total = 0.0
    for scene in scenes:
        log, none = log_posterior(scene, theta, parts)
        weight = UNKNOWN / 0.25 if scene[4] else (1 - UNKNOWN) / 0.75
        total += weight
        if scene[4]:
            out -= weight * none
        elif scene[1].any():
            out -= weight * logsumexp(log[scene[1]])
        else:
            out -= weight * none
    return out / total


def fitted(scenes, start):
    """The weights of least loss."""
    options = {"maxiter": 4000, "maxfev": 4000}
    return minimize(loss, start, args=(scenes, PARTS), method="Nelder-Mead", options=options).x


def main():
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 150
    rng = np.random.default_rng(SEED)
    with tempfile.TemporaryDirectory() as folder:
        parts = [random_part(Path(folder, f"part{k}.off"), rng) for k in range(2 * PARTS)]
    models = [prepare_vision(part) for part in parts]
    scenes = []
    for k in range(count):
        scene = scene_of(models[:PARTS], models[PARTS:], np.random.default_rng([SEED, k]))
        scenes += [scene] if scene is not None and len(scene[0]) else []
    first, second = scenes[: len(scenes) // 2], scenes[len(scenes) // 2 :]
    start = np.array([getattr(Weights(), f.name) for f in fields(Weights)])
    whole, half = fitted(scenes, start), fitted(first, start)
    print(replace(Weights(), **{f.name: round(float(v), 3) for f, v in zip(fields(Weights), whole, strict=True)}))
    used, best = loss(start, scenes, PARTS), loss(whole, scenes, PARTS)
    print(f"loss on all: {used:.3f} with the weights in use, {best:.3f} fitted")
    print(f"loss on the second half: {loss(half, second, PARTS):.3f} fitted to the first")
    known = [s for s in second if not s[4]]
    print(f"the true pose is among the candidates in {np.mean([s[1].any() for s in known]):.3f} of {len(known)}")
    for name, theta in (("in use", start), ("fitted to the first half", half)):
        claims, right = [], []
        for scene in second:
            log, none = log_posterior(scene, theta, PARTS)
            claims.append(np.exp(max(log.max(), none)))
            right.append(scene[4] if none > log.max() else bool(scene[1][np.argmax(log)]))
        print(f"second half, {name}: best answer claimed {np.mean(claims):.3f}, right {np.mean(right):.3f}")
    if len(sys.argv) > 2:
        np.save(sys.argv[2], np.array(scenes, dtype=object), allow_pickle=True)


if __name__ == "__main__":
    main()
