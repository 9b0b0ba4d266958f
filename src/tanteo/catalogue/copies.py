"""Coarser copies of parts with many triangles, which deviate from the part by far less than the readings' noise.

A copy has some of the vertices of the part, and all of its faces, edges and symmetry: vertices inside faces and along
their borders vanish. The search and the samples use the coarsest copy that the noise of the readings allows.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from tanteo import _core
from tanteo.parts import Part

LARGE = 30_000
"""Number of triangles above which a copy is always used, so that its mesh may stay on disk."""

_SMALL = 100
"""Number of triangles up to which the part is used: a copy is made in the time of few evaluations of 100 triangles."""

SHARE = 0.1
"""Largest deviation of a copy over the smallest standard deviation of a reading: below 1 % of its variance."""

SHARE_OF_MEAN = 1.0
"""Largest deviation over the standard deviation of the mean of all readings: facets inside of a round face are two
thirds of it from the face on average, which adds a tenth to the squared error of a position."""

TILT_SHARE = 0.3
"""Largest tilt of the normals of a copy over the smallest standard deviation of a sensed normal."""

_COARSEST = 0.016
"""Deviation of the coarsest copy over the diagonal: the tilt limits copies before."""

_FIELD = 1e-3
"""Deviation of the copy for a coarse field over the diagonal: a quarter of the resolution of the field."""

_WALLS = 1e-4
"""Deviation of the copy for the thickness of walls over the diagonal: the thickness only bounds the uncertainty."""

_FINEST = 24
"""Number of finer copies, each with half of the deviation of the last: the finest has 4 um for a part of 1 m."""

_USUAL = 16
"""Number of the copy from which coarser ones are made, so that most questions need one pass over all triangles."""

_SMOOTH = 0.3
"""Largest tilt of the normals of a copy for readings without sensed normals [rad]: it prevents folds."""


@dataclass(frozen=True, slots=True)
class Resolution:
    """Noise of readings, which decides how coarse a copy may be.

    Attributes:
        sd: smallest standard deviation of a point in any direction [m]; 0 for the part itself.
        tilt_sd: smallest standard deviation of a sensed normal [rad]; infinity without sensed normals.
        count: number of readings.
    """

    sd: float
    tilt_sd: float = np.inf
    count: int = 1

    @property
    def tolerance(self) -> float:
        """Return the largest deviation of a copy [m]."""
        return min(SHARE, SHARE_OF_MEAN / np.sqrt(self.count)) * self.sd


def copy_of(part: Part, resolution: Resolution) -> Part:
    """Return the coarsest copy of a part that a resolution allows; the part itself if that is not much larger.

    Copies are stored with the part. Those of large parts are made at the first use of their triangles.

    Args:
        part: any part.
        resolution: noise of the readings.
    """
    if "stored" in part.derived or len(part.triangles) <= _SMALL:
        return part  # a catalogue has the compiled shape of the part
    level = _level(part, resolution.tolerance)
    halvings = max(int(np.ceil(np.log2(_SMOOTH / (TILT_SHARE * resolution.tilt_sd) + 1e-300))), 0)
    if level > _FINEST or halvings > _FINEST:
        return part
    copy = _copy(part, level, halvings)
    return copy if len(part.triangles) > LARGE or 4 * len(copy.triangles) <= 3 * len(part.triangles) else part


def copy_for_field(part: Part) -> Part:
    """Return the coarsest copy of a part for its coarse field, whose distances are quantized."""
    return _within(part, _FIELD)


def copy_for_walls(part: Part) -> Part:
    """Return the coarsest copy of a part with which walls are as thick as in the part, within its deviation."""
    return _within(part, _WALLS)


def _within(part: Part, share: float) -> Part:
    """Return the coarsest copy of a large part within a share of its diagonal; another part itself."""
    return copy_of(part, Resolution(share * part.diagonal / SHARE)) if len(part.triangles) > LARGE else part


def _copy(part: Part, level: int, halvings: int) -> Part:
    """Return a copy from those that are stored with the part."""
    copies: dict[tuple[int, int], Part] = part.derived.setdefault("copies", {})
    if (level, halvings) not in copies:
        copies[level, halvings] = _opened(part, level, halvings)
    return copies[level, halvings]


def _level(part: Part, tolerance: float) -> int:
    """Return the number of the coarsest copy within a tolerance; 0 is the coarsest."""
    ratio = tolerance / (_COARSEST * part.diagonal)
    return 0 if ratio >= 1 else (int(np.ceil(-2 * np.log2(ratio) - 1e-9)) if ratio > 0 else _FINEST + 1)


def _opened(part: Part, level: int, halvings: int) -> Part:
    """Return a copy whose mesh is made at its first use."""
    mesh = ("vertices", "triangles", "triangle_face")
    others = {f.name: getattr(part, f.name) for f in fields(part) if f.name not in (*mesh, "derived")}
    known: dict[str, np.ndarray] = {}

    def load(name: str) -> np.ndarray:
        if not known:
            known.update(zip(mesh, _simplified(part, level, halvings), strict=True))
        return known[name]

    copy = Part.opened(load, **others)
    copy.derived["original"] = part
    if "key" in part.derived:
        copy.derived["key"] = f"{part.derived['key']}-{level}-{halvings}"
    return copy


def _simplified(part: Part, level: int, halvings: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return vertices, triangles and face of each triangle of a copy."""
    tolerance, finer = _COARSEST * part.diagonal / 2.0 ** (level / 2), part
    if level < _USUAL and not halvings:
        finer = _copy(part, _USUAL, 0)
        tolerance -= _COARSEST * part.diagonal / 2.0 ** (_USUAL / 2)
    part = finer
    triangles, rows = _core.simplify(
        np.ascontiguousarray(part.vertices, dtype=np.float64), np.ascontiguousarray(part.triangles, dtype=np.int32),
        np.ascontiguousarray(part.triangle_face, dtype=np.int32), tolerance, _SMOOTH / 2.0**halvings,
    )  # fmt: skip
    used, index = np.unique(triangles, return_inverse=True)
    arrays = part.vertices[used], index.reshape(-1, 3).astype(np.int64), part.triangle_face[rows]
    for array in arrays:
        array.setflags(write=False)
    return arrays
