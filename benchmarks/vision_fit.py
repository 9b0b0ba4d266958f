"""Fit the weights of images of tables on rendered scenes: ``python benchmarks/vision_fit.py [scenes]``.

The parts are random workpieces and random machined parts (``tests/machined_parts.py``), some with a mirror image or a
near twin; no benchmark measures any of these parts. Two catalogues of twenty have no part in common; each scene uses
one of them. ``--photographs FOLDER`` adds photographs that Mitsuba renders (``photographs.py``) and keeps them there; a
second number is their number of each kind. Every scene counts a second time as if its part, and parts of about its
size, were not in the catalogue: only readings distinguish these (decision 87). Printed are the most probable weights,
those of an unknown object if the others stay, and how well a fit to the first half of the scenes does on the second.
``--keep FILE`` and ``--processes N`` are for long runs (``campaign.py``).
"""

from __future__ import annotations

import sys
import tempfile
from dataclasses import fields, replace
from functools import cache
from pathlib import Path

import numpy as np
from scipy.optimize import minimize
from scipy.special import logsumexp

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import photographs
from campaign import options, run_cases

from machined_parts import mixed_parts
from tanteo.geometry import SE3
from tanteo.posterior import DEFAULTS, OnTable, Priors, sized
from tanteo.vision import find_edges, prepare_vision
from tanteo.vision.candidates import candidates_in, with_unknown
from tanteo.vision.edges import chance_hits, map_edges
from tanteo.vision.image_edges import ImageEdges, Weights
from tanteo.vision.posterior import searched, sums_at
from tanteo.vision.propose import edge_costs
from tanteo.vision.regions import find_regions, silhouette
from tanteo.vision.sight import area_of
from tanteo.vision.table import TableErrors
from vision_scenes import in_camera, random_shot, stated_table

CATALOGUES, SEED, FIRST = (7001, 7002), 7100, 21
"""Seeds of the parts and of the scenes, and the first scene; no test or benchmark uses them."""

HIDDEN = (0.0, 0.2, 0.3, 0.3, 0.4)
"""Hidden shares of the part, each drawn with equal probability (0.3 twice)."""

UNKNOWN_SHARE = 0.25
"""Share of scenes whose part is not in the catalogue; their weight is reduced to the prior."""

BEFOREHAND = np.array([1.0, 1.0, 1.0, 30.0])
"""Standard deviations of the weights about zero beforehand: what no scene shows has no weight without end."""

UNKNOWN = Priors().unknown
"""Prior probability that the part of a scene is not in the catalogue."""

NEAR = 0.05
"""A pose is right if no point of the part is farther off than this share of the part."""


@cache
def catalogues():
    """Return the prepared parts of both catalogues."""
    out = []
    for seed in CATALOGUES:
        with tempfile.TemporaryDirectory() as folder:
            out.append([prepare_vision(part) for part in mixed_parts(seed, folder)])
    return out


def scene(k):
    """Return the catalogue, the picture, the part if it is not in the catalogue, and the stated pose of the table."""
    rng = np.random.default_rng([SEED, k])
    known, others = catalogues()[k % 2], catalogues()[1 - k % 2]
    other = others[int(rng.integers(len(others)))] if rng.uniform() < UNKNOWN_SHARE else None
    shot = random_shot(known, rng, float(rng.choice(HIDDEN)), other)
    return known, shot, other, stated_table(shot, (other or shot.model).part, rng)


def near(model, T, truth):
    """Return whether every point of the part is within a twentieth of its size, for the nearest symmetric image."""
    gaps = SE3.apply(truth @ model.part.symmetry.Ts[:, None], model.inner) - SE3.apply(T, model.inner)
    return bool(np.linalg.norm(gaps, axis=-1).max(axis=-1).min() < NEAR * model.part.diagonal)


def similar(part, other):
    """Return whether two parts have nearly the same box, area and volume: an image alone does not distinguish them."""
    own, its = (
        np.r_[np.sort(np.ptp(one.box, axis=0)), np.sqrt(one.area / 6), np.cbrt(one.volume)] for one in (part, other)
    )
    return bool(np.abs(own - its).max() < DEFAULTS.pruning.similar * part.diagonal)


def weighed(k):
    """Return the sums of the maxima of a rendered scene; None if the part is unseen."""
    models, shot, other, T_world_table = scene(k)
    return sums_of_image(
        models, shot.image, shot.camera, T_world_table, other or shot.model, other is None, in_camera(shot)
    )


def weighed_photograph(kind, k, folder):
    """Return the sums of the maxima of a photograph (``benchmarks/photographs.py``); None if the part is unseen."""
    pixels, camera, model, known, T = photographs.shot(kind, k, photographs.FIT_SEED, folder)
    models, _ = photographs.models()
    truth = SE3.inverse(camera.T_world_camera) @ T
    return sums_of_image(models, pixels, camera, np.eye(4), model, known, truth)


def sums_of_image(models, pixels, camera, T_world_table, model, known, truth):
    """Return the sums of the maxima, their parts, which are right, and the edges that an unknown object has."""
    points = find_edges(pixels)
    chance, there = chance_hits(points), silhouette(model.frame.surface, camera, truth)
    regions, errors = find_regions(pixels, points, chance), TableErrors()
    region = max(regions, key=lambda r: (r.mask & there).sum(), default=None)
    if region is None:
        return None
    T_camera_table = SE3.inverse(camera.T_world_camera) @ T_world_table
    seen = ImageEdges(camera, map_edges(points), chance)
    costs = edge_costs(seen.edges, chance)
    _, found = candidates_in(models, seen, T_camera_table, region, costs, errors)
    lying = OnTable(T_world_table, errors.height, errors.tilt, area_of(region, camera, T_camera_table))
    priors = sized(Priors(), max(0.5 * c.model.part.diagonal for c in found))
    poses = [(c.model.part, camera.T_world_camera @ c.T_camera_part) for c in found]
    (seen,), _, searches = searched((seen,), poses, priors, lying)
    rows, right, own = [], [], []
    for c, search in zip(found, searches, strict=True):
        peaks = search.peaks
        if not len(peaks):
            continue
        (sums,) = sums_at((seen,), search)
        rest = np.array([lying.log_probability(c.model.part, T) for T in peaks.Ts])
        rows += np.stack([sums.hits, sums.misses, rest], axis=1).tolist()
        T_camera_world = SE3.inverse(camera.T_world_camera)
        right += [c.model is model and near(c.model, T_camera_world @ T, truth) for T in peaks.Ts]
        own += [similar(c.model.part, model.part)] * len(peaks)
    unit = replace(seen, weights=Weights(unknown=1.0, base=0.0))
    information = [
        with_unknown(unit, region, some).log_unknown
        for some in (found, [c for c in found if not similar(c.model.part, model.part)])
    ]
    return {
        "rows": rows, "right": right, "own": own, "information": information, "unknown": not known,
        "parts": len(models),
    }  # fmt: skip


def without_the_part(scene):
    """Return a scene as if its part and parts like it were not in the catalogue."""
    rest = ~np.array(scene["own"], dtype=bool)
    return scene | {
        "rows": scene["rows"][rest], "right": scene["right"][rest], "unknown": True, "parts": scene["parts"] - 1,
        "information": scene["information"][1:],
    }  # fmt: skip


def log_posterior(scene, theta):
    """Log probabilities of the maxima and of none."""
    rows, hits, misses, unknown, base = scene["rows"], *theta
    log = rows[:, :2] @ np.array([hits, misses]) + rows[:, 2]
    none = np.log(UNKNOWN) + unknown * scene["information"][0] + base
    log = log + np.log((1 - UNKNOWN) / scene["parts"])
    total = logsumexp(np.r_[log, none])
    return log - total, none - total


def loss(theta, scenes):
    """Return minus the mean log probability of the truth; scenes of unknown parts have their prior weight."""
    out = total = 0.0
    for scene in scenes:
        log, none = log_posterior(scene, theta)
        weight = UNKNOWN / UNKNOWN_SHARE if scene["unknown"] else (1 - UNKNOWN) / (1 - UNKNOWN_SHARE)
        total += weight
        true = scene["right"].any() and not scene["unknown"]
        out -= weight * float(logsumexp(log[scene["right"]]) if true else none)
    return out / total


def fitted(scenes, start, kept=0):
    """Return the most probable weights; the first ``kept`` stay."""

    def cost(rest):
        theta = np.r_[start[:kept], rest]
        return loss(theta, scenes) + 0.5 * float(np.sum((theta / BEFOREHAND) ** 2)) / len(scenes)

    found = minimize(cost, start[kept:], method="Nelder-Mead", options={"maxiter": 4000, "maxfev": 4000}).x
    return np.r_[start[:kept], found]


def fit_weights(scenes):
    """Print the weights, and what they are worth on scenes that they were not fitted to."""
    scenes = [s for s in scenes if s and s["rows"]]
    scenes = [s | {"rows": np.array(s["rows"]), "right": np.array(s["right"], dtype=bool)} for s in scenes]
    scenes = [one for s in scenes for one in (s, without_the_part(s)) if s["own"] and len(one["rows"])]
    first, second = scenes[: len(scenes) // 2], scenes[len(scenes) // 2 :]
    start = np.array([getattr(Weights(), f.name) for f in fields(Weights)])
    whole, half = fitted(scenes, start), fitted(first, start)
    for theta in (whole, fitted(scenes, start, 2)):  # all of them, and those of the unknown object alone
        print(replace(Weights(), **{f.name: round(float(v), 3) for f, v in zip(fields(Weights), theta, strict=True)}))
    for name, some, theta in (("all", scenes, whole), ("the second half", second, half)):
        print(
            f"loss on {name} ({len(some)}): {loss(start, some):.3f} with those in use, {loss(theta, some):.3f} fitted"
        )
    known = [s for s in scenes if not s["unknown"]]
    print(f"the true pose is among the candidates in {sum(s['right'].any() for s in known)} of {len(known)}")
    for name, theta in (("in use", start), ("fitted to the first half", half)):
        claims, right = [], []
        for scene in second:
            log, none = log_posterior(scene, theta)
            claims.append(np.exp(max(log.max(), none)))
            right.append(scene["unknown"] if none > log.max() else bool(scene["right"][np.argmax(log)]))
        print(f"second half, {name}: best answer claimed {np.mean(claims):.3f}, right {np.mean(right):.3f}")


def main():
    arguments, keep, processes = options(sys.argv[1:])
    folder = None
    if "--photographs" in arguments:
        k = arguments.index("--photographs")
        folder, arguments = arguments[k + 1], arguments[:k] + arguments[k + 2 :]
    count = int(arguments[0]) if arguments else 150
    scenes = run_cases(weighed, [(k,) for k in range(FIRST, FIRST + count)], keep, processes)
    if folder is not None:
        each = int(arguments[1]) if len(arguments) > 1 else count // 3
        cases = [(kind, k, folder) for k in range(each) for kind in photographs.KINDS.split(",")]
        scenes += run_cases(
            weighed_photograph, cases, None if keep is None else keep.with_suffix(".photographs"), processes
        )
    fit_weights(scenes[::2] + scenes[1::2])


if __name__ == "__main__":
    main()
