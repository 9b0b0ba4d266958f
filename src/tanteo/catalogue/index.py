"""Index the parts of a segment: sorted distances and angles between faces, and groups of similar parts."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from tanteo.geometry.typing import FloatArray, Indices

LIKE = 0.06
"""Largest difference of box, centroid and size, relative to the diagonal, between similar parts."""


def index_of(arrays: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return sorted columns ``<name>_key`` with their part rows ``<name>_row``, and ``kind``, the first similar part.

    Args:
        arrays: columns of the parts' signatures.
    """
    out = {}
    for name in ("same", "opposite", "angles"):
        rows = np.repeat(np.arange(len(arrays["numbers"]), dtype=np.int32), np.diff(arrays[f"{name}_start"]))
        order = np.argsort(arrays[name], kind="stable")
        out[f"{name}_key"], out[f"{name}_row"] = arrays[name][order], rows[order]
    out["kind"] = kinds(arrays["numbers"])
    return out


def kinds(numbers: FloatArray) -> Indices:
    """Return, for each part, the row of the first part that is similar to it ``(n,)``; it may be the part itself.

    The poses of a part are good initial poses for the similar ones.

    Similar parts have nearly the same box and centroid in their own frames, and nearly the same area and volume.

    Args:
        numbers: column ``numbers`` of the signatures ``(n, 17)``.
    """
    area = numbers[:, 0]
    volume = numbers[:, 1]
    centroid = numbers[:, 5:8]
    box = numbers[:, 8:14]
    size = np.linalg.norm(box[:, 3:] - box[:, :3], axis=1)
    sizes = np.column_stack([np.sqrt(area / 6), np.cbrt(volume)])
    rows = np.column_stack([box, centroid, sizes])
    order = np.argsort(size, kind="stable")
    out = np.full(len(numbers), -1, dtype=np.int32)
    heads = list[int]()
    for k in order:
        known = np.array(heads[-_HEADS:], dtype=np.int64)
        off = np.abs(rows[known] - rows[k]).max(axis=1, initial=0.0) if len(known) else np.zeros(0)
        near = np.flatnonzero(off < LIKE * size[k]) if len(known) else known
        if len(near):
            out[k] = known[near[np.argmin(off[near])]]
        else:
            out[k] = k
            heads.append(int(k))
    return out


_HEADS = 1000
"""Number of group representatives, nearest in size, that a part is compared with."""
