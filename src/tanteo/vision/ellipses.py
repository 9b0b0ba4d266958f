"""Ellipses of an image: rims of holes and bosses, ends of cylinders.

Edge points that follow each other are linked; those at which the edge is bent, all to one side, make arcs. Each arc is
fitted, points of the same ellipse that lie elsewhere (behind something in the way) are taken in, and the rest is told
with the reason.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tanteo.errors import DegenerateError
from tanteo.geometry.typing import BoolArray, FloatArray, IntArray
from tanteo.vision.camera import Camera, without_distortion
from tanteo.vision.edges import BY_DRIFT, CORRELATION, EdgePoints
from tanteo.vision.ellipse_fit import FEWEST, Ellipse, fit_ellipse, offsets_from
from tanteo.vision.fit import BIAS

SHORTEST = 14
"""Arcs of fewer points are not looked at."""

_NEAR, _TURN = 2.3, np.cos(np.radians(35.0))
"""Points that follow each other are nearer than this [px], and turn less [cosine]."""

_AROUND, _STRAIGHT = 6.0, 1 / 400
"""The bend of an edge is taken over so much to either side [px]; less bent edges are straight [1/px]."""

_OFF, _ALONG = 0.6, np.cos(np.radians(12.0))
"""Points within this of an ellipse, with its direction, may be its own [px, cosine]."""

_OUTLYING, _ROUNDS = 4.0, 4
_OWN, _ODD = 0.75, 5.0
"""An arc is an ellipse's if this share of its points is, and chi-square a degree of freedom is below the other."""

_TURNING = np.radians(20.0)
"""Edges that turn less than this are taken as straight: no arc, and nothing is said of them [rad]."""

_SPACING = 1.1
"""What an edge point stands for: about one pixel along an edge, more along a slanted one [px]."""

_COVERED = 0.25
"""An ellipse has points along this share of its circumference, at least."""


@dataclass(frozen=True, slots=True, eq=False)
class Ellipses:
    """What was found of bent edges.

    Attributes:
        found: largest first.
        refused: of every arc of 20 degrees or more that does not determine an ellipse: where it is, and why.
    """

    found: tuple[Ellipse, ...]
    refused: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.found)


def find_ellipses(camera: Camera, points: EdgePoints) -> Ellipses:
    """Find the ellipses among the edges of an image.

    Args:
        camera: that took it, for its distortion.
        points: of :func:`tanteo.vision.find_edges`.

    Returns:
        Ellipses in pixels without distortion, with covariance, and the arcs that were refused with the reason.

    Example:
        >>> camera = tanteo.read_camera("images/camera.yaml")
        >>> y, x = np.mgrid[: camera.size[1], : camera.size[0]]
        >>> disc = 200.0 - 100.0 / (1 + np.exp(2 * (np.hypot((x - 320) / 40, (y - 240) / 30) - 1) * 30))
        >>> found = tanteo.vision.find_ellipses(camera, tanteo.vision.find_edges(disc)).found
        >>> len(found), found[0].dark
        (1, True)
    """
    if len(points) < SHORTEST:
        return Ellipses((), ())
    pixels = without_distortion(camera, points.pixels)
    arcs = [arc for arc in _arcs(pixels, points.normals) if _turns(points.normals[arc]) > _TURNING]
    found: list[tuple[Ellipse, BoolArray]] = []
    refused = []
    for arc in sorted(arcs, key=len, reverse=True):
        taken = np.any([own[arc] for _, own in found], axis=0) if found else np.zeros(len(arc), dtype=np.bool_)
        if taken.mean() > 0.5:
            continue
        try:
            result = _ellipse(pixels, points, arc)
        except DegenerateError as error:
            x, y = pixels[arc].mean(axis=0)
            refused.append(f"arc about x {x:.0f} y {y:.0f} px: {error}")
            continue
        if not any((own & result[1]).sum() > 0.5 * result[1].sum() for _, own in found):
            found.append(result)
    ordered = sorted((ellipse for ellipse, _ in found), key=lambda e: -float(np.prod(e.semi_axes)))
    return Ellipses(tuple(ordered), tuple(refused))


def _arcs(pixels: FloatArray, normals: FloatArray) -> list[IntArray]:
    """Runs of edge points that are bent to one side, by index."""
    from scipy.spatial import cKDTree  # slow to import

    tree = cKDTree(pixels)
    bends = _bends(tree.query_pairs(_AROUND, output_type="ndarray"), pixels, normals)
    side = np.where(np.abs(bends) > _STRAIGHT, np.sign(bends), 0.0)
    pairs = tree.query_pairs(_NEAR, output_type="ndarray")
    i, j = pairs.T
    gap, middle = pixels[j] - pixels[i], normals[i] + normals[j]
    beside = np.abs(np.sum(gap * middle, axis=1)) < 0.7 * np.linalg.norm(gap, axis=1) + 0.5
    alike = (np.sum(normals[i] * normals[j], axis=1) > _TURN) & (side[i] == side[j]) & (side[i] != 0)
    joined = pairs[alike & beside]  # not across two edges that run side by side
    return _connected(len(pixels), joined)


def _turns(normals: FloatArray) -> float:
    """By how much normals ``(n, 2)`` turn altogether, as long as that is less than a whole turn [rad]."""
    mean = normals.mean(axis=0)
    angles = np.arctan2(normals[:, 1], normals[:, 0]) - np.arctan2(mean[1], mean[0])
    return float(np.ptp((angles + np.pi) % (2 * np.pi)))


def _connected(count: int, pairs: IntArray) -> list[IntArray]:
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    _, label = connected_components(links, directed=False)
    order = np.argsort(label, kind="stable")
    runs = np.split(order, np.flatnonzero(np.diff(label[order])) + 1)
    return [run for run in runs if len(run) >= SHORTEST]


def _bends(pairs: IntArray, pixels: FloatArray, normals: FloatArray) -> FloatArray:
    """Curvature of the edge at each point ``(n,)``, by how the normals of its neighbours turn along it [1/px].

    It is positive where the normal points out of the bend.
    """
    i, j = pairs.T
    gap = pixels[j] - pixels[i]
    same = np.sum(normals[i] * normals[j], axis=1) > 0.5
    beside = np.abs(np.sum(gap * (normals[i] + normals[j]), axis=1)) < 0.6 * np.linalg.norm(gap, axis=1) + 0.5
    i, j, gap = i[same & beside], j[same & beside], gap[same & beside]
    middle = normals[i] + normals[j]
    along = gap[:, 1] * middle[:, 0] - gap[:, 0] * middle[:, 1]
    along = along / np.maximum(np.linalg.norm(middle, axis=1), 1e-9)
    turn = normals[i, 0] * normals[j, 1] - normals[i, 1] * normals[j, 0]
    up, down = np.zeros(len(pixels)), np.full(len(pixels), 1e-9)
    for k in (i, j):
        np.add.at(up, k, turn * along)
        np.add.at(down, k, along**2)
    return up / down


def _ellipse(pixels: FloatArray, points: EdgePoints, arc: IntArray) -> tuple[Ellipse, BoolArray]:
    """The ellipse of an arc and which edge points are its own.

    Raises:
        DegenerateError: the arc is of another curve, or determines none.
    """
    alone = _fitted(pixels, points, arc)
    outward = float(np.sign(np.sum(points.normals[arc] * offsets_from(alone, pixels[arc])[1])))
    own, ellipse = arc, alone
    for _ in range(_ROUNDS):
        before, own = own, _near(pixels, points, ellipse, outward)
        if len(own) < SHORTEST:
            break
        ellipse = _fitted(pixels, points, own)
        if np.array_equal(before, own):
            break
    # points that lie elsewhere may be of another curve: the arc by itself, then
    for its, found in ((own, ellipse), (arc, alone)):
        whole = 2 * np.pi * float(np.sqrt(np.mean(found.semi_axes**2)))
        fits = found.chi2 < _ODD * found.dof and len(its) > _COVERED * whole
        if fits and np.isin(arc, its).mean() > _OWN:
            return replace(found, dark=bool(outward > 0)), np.isin(np.arange(len(pixels)), its)
    raise DegenerateError(
        f"ellipse: expected an arc of one, got {len(arc)} points that do not run along one (chi2 {alone.chi2:.0f} of "
        f"{alone.dof:.0f}), or along too little of it. Show more of the rim, or closer."
    )


def _near(pixels: FloatArray, points: EdgePoints, ellipse: Ellipse, outward: float) -> IntArray:
    """Edge points that are on an ellipse, dark and bright on the same sides."""
    box = np.flatnonzero(np.linalg.norm(pixels - ellipse.centre, axis=1) < ellipse.semi_axes[0] + 2)
    off, normals, radii = offsets_from(ellipse, pixels[box])
    off = off + 0.5 * points.widths[box] ** 2 / radii
    alike = outward * np.sum(points.normals[box] * normals, axis=1) > _ALONG
    near = np.abs(off) < np.minimum(_OFF, _OUTLYING * np.hypot(points.sds[box], 2 * BIAS))
    return np.asarray(box[alike & near])


def _fitted(pixels: FloatArray, points: EdgePoints, own: IntArray) -> Ellipse:
    if len(own) < FEWEST:
        raise DegenerateError("ellipse: expected an arc with more points. Show more of the rim.")
    blur = float(np.median(points.widths[own]))
    sds = np.hypot(points.sds[own], BY_DRIFT * points.drifts[own])
    return fit_ellipse(pixels[own], sds, share=_SPACING / CORRELATION, blur=blur, common=BIAS)
