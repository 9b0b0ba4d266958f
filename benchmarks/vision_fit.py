"""Fit what images of tables are weighed with on rendered scenes: ``python benchmarks/vision_fit.py [scenes] [errors]``.

The parts are random workpieces and random machined parts (``tests/machined_parts.py``), some with a mirror image or a
near twin; none of them is measured anywhere. Two catalogues of twenty are strangers to each other; in each scene all
parts of one are asked about. Printed are the weights that make the truth most probable, and how well a fit to
the first half of the scenes does on the second. With ``errors`` instead: the errors of edge points under which the true
poses are most probable. ``--keep FILE`` and ``--processes N`` are for long ones (``campaign.py``).
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
from scipy.stats import chi2

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from campaign import options, run_cases

from machined_parts import mixed_parts
from tanteo.lie import SE3
from tanteo.vision import TableErrors, find_edges, find_regions, map_edges, prepare_vision, silhouette
from tanteo.vision.candidates import candidates_in
from tanteo.vision.choices import EdgeErrors
from tanteo.vision.evidence import STRETCH, Weights, log_weight
from tanteo.vision.posterior import UNKNOWN, ImageMode, distinct_poses, settle_lying
from vision_scenes import random_shot, told_table

CATALOGUES, SEED, FIRST = (7001, 7002), 7100, 21
"""Seeds of the parts and of the scenes, and the first scene; no test or benchmark uses them."""

HIDDEN = (0.0, 0.2, 0.3, 0.3, 0.4)
"""Shares of the part that are hidden, as often as they are named."""

STRANGERS = 0.25
"""Share of scenes whose part is not asked about; they are weighed down to the prior."""

BEFOREHAND = np.array([1.0, 1.0, 1.0, 3.0, 1.0])
"""Standard deviations of the weights about zero beforehand: what no scene shows has no weight without end."""

NEAR = 0.05
"""A pose is right if no point of the part is farther off than this share of the part."""

ERRORS = tuple(product((0.01, 0.02), (0.12, 0.25), (0.15, 0.3), (0.0, 0.15, 0.3, 0.5)))
"""Errors of edge points that are tried: the first fields of ``EdgeErrors``."""

WORST = 60.0
"""Densities farther below the median than this count as this: gross failures do not decide [nats]."""


@cache
def catalogues():
    """The prepared parts of both."""
    out = []
    for seed in CATALOGUES:
        with tempfile.TemporaryDirectory() as folder:
            out.append([prepare_vision(part) for part in mixed_parts(seed, folder)])
    return out


def scene(k):
    """The parts, the picture, the stranger if it shows one, and the table as it is told."""
    rng = np.random.default_rng([SEED, k])
    known, others = catalogues()[k % 2], catalogues()[1 - k % 2]
    stranger = others[int(rng.integers(len(others)))] if rng.uniform() < STRANGERS else None
    shot = random_shot(known, rng, float(rng.choice(HIDDEN)), stranger)
    return known, shot, stranger, told_table(shot, (stranger or shot.model).part, rng)


def near(model, T, truth):
    """Whether no point of the part is farther off than a twentieth of it, for the nearest symmetric image."""
    gaps = SE3.apply(truth @ model.part.symmetry.Ts[:, None], model.inner) - SE3.apply(T, model.inner)
    return bool(np.linalg.norm(gaps, axis=-1).max(axis=-1).min() < NEAR * model.part.diagonal)


def looked_at(shot, model):
    """Pose of the part in the camera, edges of the picture, and the region that shows it; None where none does."""
    truth = SE3.inverse(shot.camera.T_world_camera) @ shot.T_world_part
    points = find_edges(shot.image)
    there = silhouette(model.frame.surface, shot.camera, truth)
    regions = find_regions(shot.image, points)
    return truth, map_edges(points), max(regions, key=lambda r: (r.mask & there).sum(), default=None)


def weighed(k):
    """Evidence of the candidates of one scene, which of them are right, and the stretches of edge; None unseen."""
    models, shot, stranger, T_world_table = scene(k)
    truth, edges, region = looked_at(shot, stranger or shot.model)
    if region is None:
        return None
    table = SE3.inverse(shot.camera.T_world_camera) @ T_world_table
    found, stretches = candidates_in(models, shot.camera, table, edges, region, TableErrors(), Weights())
    rows, right = [], []
    for c in found:
        e = c.evidence
        for k in distinct_poses(c.model.part, c.T_camera_part, log_weight(e, Weights())):
            rows.append([e.hits[k], e.misses[k], e.spilled[k] / STRETCH**2, c.priors[k]])
            right.append(c.model is shot.model and near(c.model, c.T_camera_part[k], truth))
    known = stranger is None
    return {"rows": rows, "right": right, "stretches": stretches, "stranger": not known, "parts": len(models)}


def pose_scores(k):
    """Log density of the true pose and its squared error for each of :data:`ERRORS`; None without a pose to know."""
    _, shot, stranger, T_world_table = scene(k)
    if stranger is not None or shot.model.part.symmetry.continuous:
        return None
    truth, edges, region = looked_at(shot, shot.model)
    if region is None:
        return None
    mode = ImageMode(shot.model, shot.rest, truth, 0.0, 1.0)
    T_camera_table = SE3.inverse(shot.camera.T_world_camera) @ T_world_table
    out = []
    for values in ERRORS:
        seen, errors = (shot.camera, edges, region, T_camera_table), EdgeErrors(*values)
        settled = settle_lying(mode, *seen, TableErrors(), Weights(), errors=errors)
        e = SE3.log(SE3.inverse(settled.T_camera_part) @ truth)
        sign, log = np.linalg.slogdet(settled.information)
        square = e @ settled.information @ e
        out.append((0.5 * (log - square) if sign > 0 else -np.inf, square))
    return out


def log_posterior(scene, theta):
    """Log probabilities of the candidates and of none."""
    rows = scene["rows"]
    log = rows[:, :2] @ theta[:2] + theta[4] * rows[:, 2] + rows[:, 3] + np.log((1 - UNKNOWN) / scene["parts"])
    none = np.log(UNKNOWN) + theta[2] * scene["stretches"] + theta[3]
    total = logsumexp(np.r_[log, none])
    return log - total, none - total


def loss(theta, scenes):
    """Minus the mean log probability of the truth, strangers weighed down to their prior."""
    out = total = 0.0
    for scene in scenes:
        log, none = log_posterior(scene, theta)
        weight = UNKNOWN / STRANGERS if scene["stranger"] else (1 - UNKNOWN) / (1 - STRANGERS)
        total += weight
        true = scene["right"].any() and not scene["stranger"]
        out -= weight * float(logsumexp(log[scene["right"]]) if true else none)
    return out / total


def fitted(scenes, start):
    """The most probable weights."""

    def cost(theta):
        return loss(theta, scenes) + 0.5 * float(np.sum((theta / BEFOREHAND) ** 2)) / len(scenes)

    return minimize(cost, start, method="Nelder-Mead", options={"maxiter": 4000, "maxfev": 4000}).x


def fit_weights(cases, keep, processes):
    """Print the weights, and what they are worth on scenes that they were not fitted to."""
    scenes = [s for s in run_cases(weighed, cases, keep, processes) if s and s["rows"]]
    scenes = [s | {"rows": np.array(s["rows"]), "right": np.array(s["right"], dtype=bool)} for s in scenes]
    first, second = scenes[: len(scenes) // 2], scenes[len(scenes) // 2 :]
    start = np.array([getattr(Weights(), f.name) for f in fields(Weights)])
    whole, half = fitted(scenes, start), fitted(first, start)
    print(replace(Weights(), **{f.name: round(float(v), 3) for f, v in zip(fields(Weights), whole, strict=True)}))
    for name, some, theta in (("all", scenes, whole), ("the second half", second, half)):
        print(
            f"loss on {name} ({len(some)}): {loss(start, some):.3f} with those in use, {loss(theta, some):.3f} fitted"
        )
    known = [s for s in scenes if not s["stranger"]]
    print(f"the true pose is among the candidates in {sum(s['right'].any() for s in known)} of {len(known)}")
    for name, theta in (("in use", start), ("fitted to the first half", half)):
        claims, right = [], []
        for scene in second:
            log, none = log_posterior(scene, theta)
            claims.append(np.exp(max(log.max(), none)))
            right.append(scene["stranger"] if none > log.max() else bool(scene["right"][np.argmax(log)]))
        print(f"second half, {name}: best answer claimed {np.mean(claims):.3f}, right {np.mean(right):.3f}")


def fit_errors(cases, keep, processes):
    """Print the errors of edge points under which true poses are most probable, and the coverage of those in use."""
    scores, squares = np.moveaxis([row for row in run_cases(pose_scores, cases, keep, processes) if row], -1, 0)
    mean = np.maximum(scores, np.median(scores) - WORST).mean(axis=0)
    order = np.argsort(-mean)[:5]
    print("; ".join(f"{EdgeErrors(*ERRORS[k])}: {mean[k]:.2f}" for k in order), f"log density of {len(scores)} poses")
    own = squares[:, [EdgeErrors(*values) for values in ERRORS].index(EdgeErrors())]
    shares = ", ".join(f"{np.mean(own < chi2.ppf(p, 6)):.3f} in the {p:.1%} region" for p in (0.95, 0.999))
    print(f"{EdgeErrors()}: {shares}, NEES / dof {own.mean() / 6:.2f}, farthest {own.max():.0f}")


def main():
    arguments, keep, processes = options(sys.argv[1:])
    errors = "errors" in arguments
    numbers = [int(a) for a in arguments if a != "errors"]
    cases = [(k,) for k in range(FIRST, FIRST + (numbers[0] if numbers else 150))]
    (fit_errors if errors else fit_weights)(cases, keep, processes)


if __name__ == "__main__":
    main()
