"""Are the probabilities right? Scenes drawn from the stated model: ``python benchmarks/calibration.py [scenes]``.

A catalogue of eight random workpieces; the object is one of them or, with the stated probability, a ninth that is not
in it; every feature is outliers with the stated probability, else a touch that falls on the surface evenly. Printed for
every way of sensing: what the best answer (a part, or the unknown object) claimed on the average and how often it was
right, and the same by bins of what it claimed.
"""

from __future__ import annotations

import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from random_parts import random_part
from scenes import clutter_touch, random_pose, sensed_edge, surface_planes, surface_touches
from tanteo.posterior import Priors, identify_features, prepare

PARTS, SCENES = 8, 50
"""Parts in a catalogue, and scenes for each catalogue."""

SLANTED = 0.3
"""Share of workpieces with slanted faces."""

BINS = (0.0, 0.5, 0.7, 0.85, 0.95, 0.99, 1.0)


def scenes_of(task):
    """Claimed probability of the best answer, whether it was right, and more, for each scene of one catalogue."""
    seed, index, mode, settings, count = task
    rng = np.random.default_rng([seed, index])
    with tempfile.TemporaryDirectory() as folder:
        parts = [random_part(Path(folder, f"part{k}.off"), rng, SLANTED) for k in range(PARTS + count)]
    models = [prepare(part) for part in parts[:PARTS]]
    priors = Priors(radius=max(model.part.radius for model in models), **settings)
    return [_scene(rng, mode, models, parts[PARTS + k], priors) for k in range(count)]


def _scene(rng, mode, models, absent, priors):
    unknown = rng.uniform() < priors.unknown
    true = None if unknown else models[rng.integers(len(models))].part.name
    part = absent if unknown else next(model.part for model in models if model.part.name == true)
    T = random_pose(rng, priors.radius)
    features = draw(rng, mode, part, T, priors)
    answer = identify_features(features, models, priors=priors, top=100)
    claims = {None: answer.unknown_probability}
    for h in answer.hypotheses:
        claims[h.part] = claims.get(h.part, 0.0) + h.probability
    best = max(claims, key=claims.get)
    total = answer.elapsed["total"]
    return claims[best], best == true, answer.unknown_probability, unknown, claims.get(true, 0.0), total


def draw(rng, mode, part, T, priors):
    """Sensed features of one scene, outliers among them."""
    n = int(rng.integers(3, 7))
    if mode == "touches":
        given = surface_touches(part, T, n, rng)
    elif mode == "planes":
        given = surface_planes(part, T, n, rng)
    else:
        edges = rng.choice(len(part.edges), size=2, p=part.edges.lengths / part.edges.lengths.sum())
        given = [*surface_touches(part, T, n - 1, rng), *(sensed_edge(part, T, e, 2e-4, rng, f"e{e}") for e in edges)]
    outlier = rng.uniform(size=len(given)) < priors.outlier_rate
    return [
        clutter_touch(priors.radius, rng, f"c{k}") if s else f
        for k, (f, s) in enumerate(zip(given, outlier, strict=True))
    ]


def campaign(mode, scenes, *, seed=1, pool=None, **settings):
    """Return all scenes of one sensing mode ``(scenes, 6)``, from several catalogues if necessary."""
    settings = {"unknown": 0.2, "outlier_rate": 0.05, **settings}
    tasks = [(seed, k, mode, settings, min(SCENES, scenes - k)) for k in range(0, scenes, SCENES)]
    rows = (pool.map if pool else map)(scenes_of, tasks)
    return np.array([row for task in rows for row in task], dtype=float)


def table(rows):
    """Claimed against right, overall and by bins, as markdown."""
    claimed, right = rows[:, 0], rows[:, 1]
    lines = ["| claimed | scenes | mean claimed | right | s.e. |", "| --- | --- | --- | --- | --- |"]
    for low, high in ((0.0, 1.01), *zip(BINS[:-1], (*BINS[1:-1], 1.01), strict=True)):
        k = (claimed >= low) & (claimed < high)
        if k.any():
            se = np.sqrt((claimed[k] * (1 - claimed[k])).sum()) / k.sum()
            name = "all" if high - low > 1 else f"{low:g} to {min(high, 1):g}"
            lines.append(f"| {name} | {k.sum()} | {claimed[k].mean():.4f} | {right[k].mean():.4f} | {se:.4f} |")
    lines.append("")
    lines.append(
        f"None of these: claimed {rows[:, 2].mean():.3f}, true {rows[:, 3].mean():.3f}. "
        f"Time a scene: median {1e3 * np.median(rows[:, 5]):.1f} ms, longest {1e3 * rows[:, 5].max():.0f} ms."
    )
    return "\n".join(lines)


CAMPAIGNS = {
    "single touches with normals": ("touches", {}),
    "planes from five points each": ("planes", {}),
    "touches and two edges": ("edges", {}),
}


def main(scenes=2000):
    with ProcessPoolExecutor(2) as pool:
        for name, (mode, settings) in CAMPAIGNS.items():
            print(f"\n### {name}\n\n{table(campaign(mode, scenes, pool=pool, **settings))}", flush=True)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
