"""How common edges are about a place: what a hit there is worth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.typing import FloatArray
from tanteo.vision.cv import opencv
from tanteo.vision.edge_map import CHANNELS, EdgeMap, cell_of, channel_of
from tanteo.vision.evidence import REACH


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
