"""Ellipses of an image: rims of holes and bosses, ends of cylinders.

Neighbouring edge points at which the edge bends to one side make arcs. An ellipse is fitted to each arc, then to all
edge points on it, those of other arcs included. Arcs that determine no ellipse are reported with the reason.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tanteo.errors import DegenerateError
from tanteo.geometry.typing import BoolArray, FloatArray, IntArray
from tanteo.posterior import DEFAULTS
from tanteo.vision.camera import Camera, without_distortion
from tanteo.vision.edges import EdgePoints
from tanteo.vision.ellipse_fit import FEWEST, Ellipse, fit_ellipse, offsets_from
from tanteo.vision.settings import EDGES, EVIDENCE, NEWTON_STEPS, SEARCH, SPACING


@dataclass(frozen=True, slots=True, eq=False)
class Ellipses:
    """Ellipses of an image, and the arcs that were refused.

    Attributes:
        found: ellipses, largest first.
        refused: place and reason of every longer arc that does not determine an ellipse.
    """

    found: tuple[Ellipse, ...]
    refused: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.found)


def find_ellipses(camera: Camera, points: EdgePoints) -> Ellipses:
    """Find the ellipses among the edges of an image.

    Args:
        camera: camera of the image, for its distortion.
        points: edge points of :func:`tanteo.vision.find_edges`.

    Returns:
        Ellipses in pixels without distortion, with covariance, and the refused arcs with the reason.

    Example:
        >>> camera = tanteo.read_camera("images/camera.yaml")
        >>> y, x = np.mgrid[: camera.size[1], : camera.size[0]]
        >>> disc = 200.0 - 100.0 / (1 + np.exp(2 * (np.hypot((x - 320) / 40, (y - 240) / 30) - 1) * 30))
        >>> found = tanteo.vision.find_ellipses(camera, tanteo.vision.find_edges(disc)).found
        >>> len(found), found[0].dark
        (1, True)
    """
    if len(points) < EVIDENCE.stretch:
        return Ellipses((), ())
    pixels = without_distortion(camera, points.pixels)
    arcs = [arc for arc in _arcs(pixels, points.normals) if _turns(points.normals[arc]) > EDGES.direction]
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
    """Return runs of edge points that bend to one side, by index."""
    from scipy.spatial import cKDTree  # slow to import

    tree = cKDTree(pixels)
    bends = _bends(tree.query_pairs(EVIDENCE.shortest, output_type="ndarray"), pixels, normals)
    side = np.where(np.abs(bends) > 1 / SEARCH.straight, np.sign(bends), 0.0)
    pairs = tree.query_pairs(EDGES.correlation / 2, output_type="ndarray")
    i, j = pairs.T
    gap, middle = pixels[j] - pixels[i], normals[i] + normals[j]
    beside = np.abs(np.sum(gap * middle, axis=1)) < 0.7 * np.linalg.norm(gap, axis=1) + 0.5
    similar = (
        (np.sum(normals[i] * normals[j], axis=1) > np.cos(2 * EDGES.direction)) & (side[i] == side[j]) & (side[i] != 0)
    )
    joined = pairs[similar & beside]  # not across two parallel edges
    return _connected(len(pixels), joined)


def _turns(normals: FloatArray) -> float:
    """Return the angle by which normals ``(n, 2)`` turn, if it is less than a whole turn [rad]."""
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
    return [run for run in runs if len(run) >= EVIDENCE.stretch]


def _bends(pairs: IntArray, pixels: FloatArray, normals: FloatArray) -> FloatArray:
    """Return the curvature of the edge at each point ``(n,)``, from the normals of its neighbours [1/px].

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
    """Return the ellipse of an arc, and which edge points are on it ``(n,)``.

    Raises:
        DegenerateError: the arc is not on an ellipse, or determines none.
    """
    alone = _fitted(pixels, points, arc)
    outward = float(np.sign(np.sum(points.normals[arc] * offsets_from(alone, pixels[arc])[1])))
    own, ellipse = arc, alone
    for _ in range(NEWTON_STEPS):
        before, own = own, _near(pixels, points, ellipse, outward)
        if len(own) < EVIDENCE.stretch:
            break
        ellipse = _fitted(pixels, points, own)
        if np.array_equal(before, own):
            break
    # the points of other arcs may be on another curve: then the arc counts alone
    for points_on, found in ((own, ellipse), (arc, alone)):
        fits = found.chi2 < SEARCH.scatter * found.dof
        if fits and np.isin(arc, points_on).mean() > 0.5:
            return replace(found, dark=bool(outward > 0)), np.isin(np.arange(len(pixels)), points_on)
    raise DegenerateError(
        f"ellipse: expected an arc of an ellipse, got {len(arc)} points that are not on one (chi2 {alone.chi2:.0f} of "
        f"{alone.dof:.0f}). Show more of the rim, or closer."
    )


def _near(pixels: FloatArray, points: EdgePoints, ellipse: Ellipse, outward: float) -> IntArray:
    """Return the edge points on an ellipse that have dark and bright on the same sides, by index."""
    box = np.flatnonzero(np.linalg.norm(pixels - ellipse.centre, axis=1) < ellipse.semi_axes[0] + 2)
    off, normals, radii = offsets_from(ellipse, pixels[box])
    off = off + 0.5 * points.widths[box] ** 2 / radii
    similar = outward * np.sum(points.normals[box] * normals, axis=1) > np.cos(SEARCH.sharp)
    near = np.abs(off) < np.sqrt(2 * DEFAULTS.search.negligible) * np.hypot(points.sds[box], EDGES.bias)
    return np.asarray(box[similar & near])


def _fitted(pixels: FloatArray, points: EdgePoints, own: IntArray) -> Ellipse:
    if len(own) < FEWEST:
        raise DegenerateError("ellipse: expected an arc with more points. Show more of the rim.")
    blur = float(np.median(points.widths[own]))
    sds = np.hypot(points.sds[own], EDGES.by_drift * points.drifts[own])
    return fit_ellipse(pixels[own], sds, share=SPACING / EDGES.correlation, blur=blur, common=EDGES.bias)
