"""How well a part at a pose explains the edges of an image, against chance.

The part says where edges should be; some are missed (no contrast, something in the way), some meet an edge by chance.
The image has edges; those that the part does not explain need another cause. Both are counted by length, a stretch of
:data:`STRETCH` being one observation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.typing import BoolArray, FloatArray
from tanteo.vision.edges import EdgePoints
from tanteo.vision.fit import Met
from tanteo.vision.wireframe import Wireframe

STRETCH = 12.0
"""Length of edge that is seen or missed as one [px]."""

RIM_SEEN, CREASE_SEEN = 0.85, 0.65
"""Probability that an edge of the part shows in the image: where the part ends, and between two of its faces."""

REACH = 2.5
"""An edge point within this of the sample is its own [px]."""

SPREADS, SHARES = (0.15, 0.8), (0.7, 0.3)
"""Offsets of edges from where the refined pose puts them: most by noise and blur, some by shadows and rounding [px]."""

UNEXPLAINED = 0.9
"""What a stretch of the image's edges costs that the part does not explain [nats]."""


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """Log likelihood ratios of poses, against edges that come by chance.

    Attributes:
        hits: from the part's edges that meet edges of the image ``(*batch,)``.
        misses: from those that do not ``(*batch,)``.
        explained: length of the image's edges that the part explains ``(*batch,)`` [px].
        shown: length of edge that the part should show ``(*batch,)`` [px].
        met: how much of that meets an edge ``(*batch,)`` [px].
        spilled: how much of the silhouette lies on bare table ``(*batch,)`` [px of area]; 0 where that is not asked.
    """

    hits: FloatArray
    misses: FloatArray
    explained: FloatArray
    shown: FloatArray
    met: FloatArray
    spilled: FloatArray

    @property
    def log(self) -> FloatArray:
        """Log evidence up to what all hypotheses about these edges have in common."""
        return self.hits + self.misses + UNEXPLAINED * self.explained / STRETCH


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


def weigh(frame: Wireframe, met: Met, chance: FloatArray | float, used: BoolArray | None) -> Evidence:
    """Evidence of poses.

    Args:
        frame: of the part.
        met: its edges at the poses, found within :data:`REACH`.
        chance: of :func:`chance_hits`, or for every sample ``(*batch, N)``.
        used: edge points that count as the object's own ``(n,)``; None if that is not known.
    """
    stretch = met.spans / STRETCH
    seen = np.where(met.seen.rims, RIM_SEEN, CREASE_SEEN)
    own = sum(
        share * np.exp(-0.5 * (met.offsets / sd) ** 2) / (np.sqrt(2 * np.pi) * sd)
        for sd, share in zip(SPREADS, SHARES, strict=True)
    )
    any_hit = chance / (2 * REACH)
    hit = np.log(seen * own + (1 - seen) * any_hit) - np.log(any_hit)
    miss = np.log1p(-seen)
    met_length = np.where(met.hits, met.spans, 0.0).sum(axis=-1)
    return Evidence(
        hits=np.where(met.hits, stretch * hit, 0.0).sum(axis=-1),
        misses=np.where(met.inside & ~met.hits, stretch * miss, 0.0).sum(axis=-1),
        explained=np.zeros_like(met_length) if used is None else np.minimum(met_length, float(used.sum())),
        shown=met.spans.sum(axis=-1),
        met=met_length,
        spilled=np.zeros_like(met_length),
    )
