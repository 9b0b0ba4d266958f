"""How well a part at a pose explains the edges of an image, against chance.

The part says where edges should be; some are missed (no contrast, something in the way), some meet an edge by chance.
Both are counted by length, a stretch of :data:`STRETCH` being one observation, under two laws of images. An edge of the
image comes from one edge: of several edges of the part that meet it the nearest explains it, the others are not asked
(:func:`foremost`). And edges are met and missed as wholes: those that are there by chance go on, too, so that more
of an edge tells less and less (:func:`of_edges`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo import _core
from tanteo.typing import BoolArray, FloatArray, IntArray
from tanteo.vision.camera import opencv
from tanteo.vision.edges import CHANNELS, EdgeMap, EdgePoints, cell_of, channel_of
from tanteo.vision.fit import EdgeMatches
from tanteo.vision.wireframe import Wireframe

STRETCH = 12.0
"""Length of edge that is seen or missed as one [px]."""

RIM_SEEN, CREASE_SEEN = 0.85, 0.65
"""Probability that an edge of the part shows in the image: where the part ends, and between two of its faces."""

REACH = 2.5
"""An edge point within this of the sample is its own [px]."""

SPREADS, SHARES = (0.15, 0.8), (0.7, 0.3)
"""Offsets of edges from where the refined pose puts them: most by noise and blur, some by shadows and rounding [px]."""

WHOLE = 60.0
"""Length from which more of the same edge of the part tells little more [px]."""

_BESIDE, _ALONG = 4.0, 0.9
"""Samples met the same edge of the image if it is the same place within this or what they stand for, and they run the
same way [px, cosine]."""


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """Log likelihood ratios of poses, against edges that come by chance.

    Attributes:
        hits: from the part's edges that meet edges of the image ``(*batch,)``.
        misses: from those that do not ``(*batch,)``.
        spilled: how much of the silhouette lies on bare table ``(*batch,)`` [px of area]; 0 where that is not asked.
    """

    hits: FloatArray
    misses: FloatArray
    spilled: FloatArray


def chance_hits(points: EdgePoints, used: BoolArray) -> float:
    """Probability that a random place among these edges has one of the same direction within reach.

    Edges of one direction (an eighth of them, if all are as common) cover ``2 REACH`` px for each pixel of length.
    """
    if used.sum() < 2:
        return 0.02
    low, high = points.pixels[used].min(axis=0), points.pixels[used].max(axis=0)
    area = float(np.prod(high - low + 10.0))
    density = float(used.sum()) / area * 2 * REACH * 0.25
    return float(np.clip(density, 0.02, 0.4))


def weigh(frame: Wireframe, met: EdgeMatches, chance: FloatArray | float) -> Evidence:
    """Evidence of poses whose edges were met within :data:`REACH`; chance by :func:`chance_hits`, or a sample's."""
    stretch = met.spans / STRETCH
    seen = np.where(met.seen.rims, RIM_SEEN, CREASE_SEEN)
    own = sum(
        share * np.exp(-0.5 * (met.offsets / sd) ** 2) / (np.sqrt(2 * np.pi) * sd)
        for sd, share in zip(SPREADS, SHARES, strict=True)
    )
    any_hit = chance / (2 * REACH)
    hit = np.log(seen * own + (1 - seen) * any_hit) - np.log(any_hit)
    hits = of_edges(frame.groups, stretch * hit, np.where(foremost(frame.groups, met), met.spans, 0.0))
    missed = np.where(met.inside & ~met.hits, met.spans, 0.0)
    return Evidence(hits, of_edges(frame.groups, stretch * np.log1p(-seen), missed), np.zeros_like(hits))


def foremost(groups: IntArray, met: EdgeMatches) -> BoolArray:
    """Which samples explain the edge of the image that they met ``(*batch, N)``: no other edge met it nearer."""
    places, normals = met.pixels + met.offsets[..., None] * met.normals, np.ascontiguousarray(met.normals)
    widths, off = (a.reshape(-1, len(groups)) for a in (np.maximum(met.spans, _BESIDE), np.abs(met.offsets)))
    hits = met.hits.reshape(off.shape)
    return _core.foremost_edges(groups, hits, places, normals, widths, off, _ALONG).reshape(met.hits.shape)


def of_edges(groups: IntArray, values: FloatArray, spans: FloatArray) -> FloatArray:
    """Sum of what samples say ``(*batch,)``, edge by edge: an edge of length L counts as L / (1 + L / WHOLE).

    Values and the lengths that they stand for are ``(*batch, N)`` [px]; samples of length 0 are left out.
    """
    members = np.eye(groups.max(initial=-1) + 1)[groups]
    return np.asarray((np.where(spans > 0, values, 0.0) @ members / (1 + spans @ members / WHOLE)).sum(axis=-1))


@dataclass(frozen=True, slots=True, eq=False)
class Weights:
    """How much each kind of evidence counts, fitted on rendered scenes of random parts (``benchmarks/vision_fit.py``).

    Edges are not independent of each other, shadows and occluders make edges of their own: what that does to the sums
    of :class:`Evidence` is measured, not derived.

    Attributes:
        hits: of edges of the part that meet edges of the image.
        misses: of those that do not.
        unknown: for each stretch of the image's edges, if none of the poses holds.
        base: log odds of that without edges, besides the prior.
        spilled: for each square of a stretch that the silhouette covers where bare table is seen.
    """

    hits: float = 0.409
    misses: float = 0.103
    unknown: float = 0.151
    base: float = 1.065
    spilled: float = -0.624


def log_weight(evidence: Evidence, weights: Weights) -> FloatArray:
    """Log weight of poses, without prior."""
    spilled = weights.spilled * evidence.spilled / STRETCH**2
    return np.asarray(weights.hits * evidence.hits + weights.misses * evidence.misses + spilled)


@dataclass(frozen=True, slots=True, eq=False)
class Chance:
    """How often a random place near a pixel has an edge of one direction within reach.

    Attributes:
        shares: ``(CHANNELS, rows, columns)``.
    """

    shares: FloatArray

    def at(self, normals: FloatArray, pixels: FloatArray) -> FloatArray:
        """At pixels ``(*batch, 2)`` for edges with the given normals."""
        row, column, _ = cell_of((self.shares.shape[1], self.shares.shape[2]), pixels)
        return np.asarray(self.shares[channel_of(np.nan_to_num(normals)), row, column], dtype=np.float64)


def chance_map(edges: EdgeMap, window: int = 81) -> Chance:
    """Measure, in windows of the image, how common edges of each direction are."""
    near = (edges.distances < REACH).astype(np.float32)
    shares = np.stack([opencv().blur(near[k], (window, window)) for k in range(CHANNELS)])
    return Chance(np.clip(shares, 0.02, 0.6))
