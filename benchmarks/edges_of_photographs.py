"""Edges of photographs at the true pose: ``python benchmarks/edges_of_photographs.py [kinds images seed]``.

The photographs are those of ``photographs.py``, with the same arguments and ``--cache FOLDER``. For every edge of a
part the mean distance of its edge points from the true edge is printed, towards the bright side: as the points are
found, and after the shading (``EdgeSettings.extrapolation``) and the response curve (``EdgePoints.responses``) are
corrected. The most probable share of the response, ``EdgeSettings.by_drift`` and share of other edges follow.
"""

from __future__ import annotations

import sys

import numpy as np
import photographs
from campaign import options
from common import Table
from scipy.optimize import minimize

from tanteo.geometry import SE3
from tanteo.vision import find_edges
from tanteo.vision.edges import map_edges
from tanteo.vision.fit import meet
from tanteo.vision.settings import EDGES, EVIDENCE

FEWEST = 3
OTHER_SD = 0.8
"""Standard deviation of the distance of edges of other objects [px]."""


def edges_of(kind, image, seed, folder):
    """Return the mean distance, drift, response, variance and kind of each edge of a photograph."""
    pixels, camera, model, _, T = photographs.shot(kind, image, seed, folder)
    points, frame = find_edges(pixels), model.frame
    found = meet(frame, camera, map_edges(points), (SE3.inverse(camera.T_world_camera) @ T)[None], EVIDENCE.reach)
    heights, rims = SE3.apply(T, frame.points)[:, 2], found.seen.rims[0]
    usable = found.inside[0] & found.hits[0] & frame.sharp & ~frame.bends.any(axis=1)
    rows = []
    for group in np.unique(frame.groups[usable]):
        for rim in (True, False):
            own = usable & (frame.groups == group) & (rims == rim)
            at = found.points[0][own]
            side = np.sign(np.sum(points.normals[at] * found.normals[0][own], axis=1))
            off = side * found.offsets[0][own]
            near = np.abs(off - np.median(off)) < 4 * np.hypot(points.sds[at], EVIDENCE.spread) if len(off) else off > 0
            if near.sum() < FEWEST or abs(side.mean()) < 0.6:
                continue
            at, off = at[near], off[near]
            noise = EDGES.extrapolated_noise * points.sds[at]
            w = np.minimum(found.spans[0][own][near] / EDGES.correlation, 1) / (noise**2 + EDGES.floor**2)
            mean = [
                float(w @ one / w.sum())
                for one in (off, points.drifts[at], points.responses[at], points.drifts[at] ** 2)
            ]
            place = "on the table" if np.median(heights[own]) < 1e-4 else "rim" if rim else "crease"
            rows.append((place, *mean, 1 / w.sum()))
    return rows


def fitted(off, drift, response, squares, variance):
    """Return the most probable share of the response, misplacement by drift, and share of edges of other objects."""

    def minus_log(x):
        share, by_drift, other = x[0], np.exp(x[1]), 1 / (1 + np.exp(-x[2]))
        d = off - EDGES.extrapolation * drift - share * response
        v = variance + 0.5 * EDGES.floor**2 + 0.5 * by_drift**2 * squares
        own = np.exp(-0.5 * d**2 / v) / np.sqrt(v)
        return -np.log((1 - other) * own + other * np.exp(-0.5 * (d / OTHER_SD) ** 2) / OTHER_SD).sum()

    x = minimize(minus_log, [0.5, -1.0, -1.5], method="Nelder-Mead", options={"maxiter": 2000}).x
    return float(x[0]), float(np.exp(x[1])), float(1 / (1 + np.exp(-x[2])))


def spread(off):
    """Return the median and the robust standard deviation about zero."""
    return f"{np.median(off):.3f}; {np.median(np.abs(off)) / 0.6745:.3f}"


def main():
    arguments, _, _ = options(sys.argv[1:])
    folder = None
    if "--cache" in arguments:
        k = arguments.index("--cache")
        folder, arguments = arguments[k + 1], arguments[:k] + arguments[k + 2 :]
    kinds, images, seed = [*arguments, *[photographs.KINDS, 12, photographs.FIT_SEED][len(arguments) :]]
    rows = []
    for kind in kinds.split(","):
        for image in range(int(images)):
            rows += edges_of(kind, image, int(seed), folder)
    table = []
    for place in ("rim", "crease", "on the table", "all"):
        own = np.array([row[1:] for row in rows if place in (row[0], "all")])
        off, drift, response, _, _ = own.T
        share, by_drift, other = fitted(*own.T)
        corrected = off - EDGES.extrapolation * drift - share * response
        table.append((
            place, str(len(own)), spread(off), spread(corrected), f"{share:.2f}", f"{by_drift:.2f}", f"{other:.2f}",
        ))  # fmt: skip
    head = "edges", "number", "median; spread [px]", "corrected [px]", "response", "by drift", "other objects"
    print(Table("Edges of photographs at the true pose", "", head, table).markdown())


if __name__ == "__main__":
    main()
