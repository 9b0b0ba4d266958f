"""Outline of an object on a table in a camera image, compared with all stable poses of parts.

The convex outline of a part is that of its convex hull. The hull, with its height, is projected into the camera at any
yaw and position. The region of the image may include a shadow (decision 83).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np

from tanteo import _core
from tanteo.errors import InputError
from tanteo.geometry import SE3, freeze
from tanteo.geometry.special import log_sum
from tanteo.geometry.typing import FloatArray, IntArray, Transforms, Vectors
from tanteo.posterior.settings import DEFAULTS

DIRECTIONS = 32
"""Number of directions in the table plane along which an outline is measured, from x towards y (decision 83)."""

_PIXELS, _LEAST_SD, _MADE = 0.6, 2e-4, 2e-3
"""Standard deviation of an outline in a direction: pixels, a length [m] and a fraction of its size (decision 83)."""

_SHADOW = 0.4
"""Standard deviation of the length of a shadow over the height of the object that casts it (decision 83)."""

_TOGETHER = 2.0
"""Number of adjacent directions that share one error, by which squares are divided (decision 83)."""

_MOST = 150.0
"""Largest sum of squares of a comparison; a worse outline is evidence for another part, and costs no more."""

_FITS = 40.0
"""Largest sum of squares of a fit. If no part fits better, the odds of the unknown object rise accordingly."""

MISLEADING = 0.05
"""Fraction of global measurements that do not describe the part: the region of the image is not the outline of one part
(hidden, touching another one, grey as the table), another object was weighed, or the box has other axes (decision
83)."""


@dataclass(frozen=True, slots=True, eq=False)
class SeenOutline:
    """Convex outline on a table, in the frame of the table. Its plane is z = 0; the camera is above.

    Attributes:
        reach: extent of the outline from its middle along each of 32 directions, from x towards y ``(32,)`` [m].
        middle: middle of the outline ``(2,)`` [m].
        eye: centre of the camera ``(3,)`` [m].
        pixel: size of a pixel on the table [m].
        T_world_table: frame of the table ``(4, 4)``; by default the world frame.

    Raises:
        InputError: an array of the wrong shape, a camera that is not above the table, or a pixel size that is not
            positive.
    """

    reach: FloatArray
    middle: FloatArray
    eye: Vectors
    pixel: float
    T_world_table: Transforms = field(default_factory=lambda: np.eye(4))
    _known: list[Any] = field(default_factory=list, init=False, repr=False)
    """Parts of the last query and their results; one answer queries the same parts several times."""

    def __post_init__(self) -> None:
        for name, size in (("reach", DIRECTIONS), ("middle", 2), ("eye", 3)):
            if np.shape(getattr(self, name)) != (size,) or not np.all(np.isfinite(getattr(self, name))):
                raise InputError(f"{name}: expected {size} finite numbers, got {getattr(self, name)}.")
        if not (self.eye[2] > 0 and self.pixel > 0):
            raise InputError(
                f"eye: expected one above the table, and pixels of a length, got {self.eye}, {self.pixel}."
            )
        freeze(self, "reach", "middle", "eye", "T_world_table")

    @property
    def sd(self) -> float:
        """Return the standard deviation of the outline's distance from its middle, one for all directions [m]."""
        return float(np.sqrt((_PIXELS * self.pixel) ** 2 + _LEAST_SD**2 + (_MADE * self.reach.mean()) ** 2))

    def by_rest(self, parts: Sequence[Any]) -> tuple[FloatArray, IntArray]:
        """Return the log likelihood of each stable pose at its best yaw and position, times the pose's probability.

        Returns:
            Log likelihoods of the stable poses of all parts, up to a constant ``(R,)``; first row of each part, and the
            end of the last ``(n + 1,)``.
        """
        if not self._known or self._known[0] is not parts:
            found = [self._of_table(*table) for table in _tables(parts)]
            counts = [0, *(count for _, _, start in found for count in np.diff(start))]
            log = np.concatenate([np.zeros(0), *(log for log, _, _ in found)])
            Ts = np.concatenate([np.zeros((0, 4, 4)), *(Ts for _, Ts, _ in found)])
            self._known[:] = parts, log, np.cumsum(counts), Ts
        return self._known[1], self._known[2]

    def likely(self, parts: Sequence[Any], row: int, gap: float = DEFAULTS.search.negligible) -> IntArray:
        """Return the rows of a part's stable poses that explain the outline: the likeliest, and nearly equal ones.

        Args:
            parts: candidate parts.
            row: row of the part.
            gap: log-likelihood gap to the best stable pose of all parts up to which a pose is returned [nats].
        """
        log, start = self.by_rest(parts)
        own = log[start[row] : start[row + 1]]
        return np.flatnonzero((own > log.max() - gap) | (own == own.max())) if len(own) else np.zeros(0, np.int64)

    def poses(self, parts: Sequence[Any], row: int, gap: float = DEFAULTS.search.negligible) -> Transforms:
        """Return poses of a part that explain the outline, and their half turns, which hulls hardly discriminate.

        Args:
            parts: candidate parts.
            row: row of the part.
            gap: log-likelihood gap to the best stable pose of all parts up to which a pose is returned [nats].

        Returns:
            Poses ``T_world_part`` ``(k, 4, 4)``.
        """
        which = self.likely(parts, row, gap)
        Ts = self._known[3][self._known[2][row] + which].astype(np.float64)
        about = SE3.from_parts(np.eye(3), np.array([*self.middle, 0.0]))
        half = about @ SE3.from_parts(np.diag([-1.0, -1.0, 1.0]), np.zeros(3)) @ SE3.inverse(about)
        return np.asarray(self.T_world_table @ np.concatenate([Ts, half @ Ts]))

    def log_likelihood(self, parts: Sequence[Any]) -> FloatArray:
        """Return the log likelihood of each part, up to a constant ``(n,)``."""
        log, start = self.by_rest(parts)
        out, some = np.full(len(start) - 1, _log(_MOST)), np.diff(start) > 0  # a part may have no stable pose
        out[some] = np.logaddexp.reduceat(log, start[:-1][some]) if some.any() else 0.0
        return out

    def log_odds(self, parts: Sequence[Any]) -> FloatArray:
        """Return log odds of each part against an unknown object, which may have the outline of any part ``(n,)``."""
        return odds_among(self.log_likelihood(parts))

    def _of_table(self, hull: Any, hull_start: Any, rests: Any, start: Any) -> tuple[FloatArray, Any, Any]:
        counts = np.diff(start)
        costs, Ts = _core.fit_outlines(
            np.ascontiguousarray(hull), np.ascontiguousarray(hull_start), np.ascontiguousarray(rests[:, :3]),
            np.repeat(np.arange(len(counts), dtype=np.int32), counts),
            self.reach, self.middle, self.eye, self.sd, _SHADOW, _MOST,
        )  # fmt: skip
        return _log(costs) + np.log(rests[:, 3]), Ts.astype(np.float32), start


def odds_among(log: FloatArray) -> FloatArray:
    """Return log odds of parts against the unknown object, from log likelihoods of their outlines ``(n,)``.

    A fraction :data:`MISLEADING` of all outlines does not describe the object.
    """
    if not len(log):
        return log
    mean = max(float(log_sum(log)), _log(_FITS)) - np.log(len(log))
    return np.asarray(np.logaddexp(np.log1p(-MISLEADING) + log - mean, np.log(MISLEADING)))


def _log(costs: Any) -> Any:
    return -0.5 * costs / _TOGETHER


_Table: TypeAlias = tuple[Any, Any, Any, Any]


def _tables(parts: Sequence[Any]) -> Iterator[_Table]:
    """Yield hulls, stable poses and their first rows for tables of parts; those of a catalogue are memory-mapped."""
    from tanteo.catalogue import Catalogue
    from tanteo.catalogue.stability import hull_points, stable_pose_rows

    if isinstance(parts, Catalogue):
        for segment in parts.segments:
            yield tuple(segment.table[name] for name in ("hull", "hull_start", "rests", "rests_start"))  # type: ignore[misc]
        return
    hulls, rests = [], []
    for one in parts:
        part = getattr(one, "part", one)
        if "outline" not in part.derived:
            part.derived["outline"] = hull_points(part), stable_pose_rows(part)
        hulls.append(part.derived["outline"][0])
        rests.append(part.derived["outline"][1])
    if hulls:
        starts = (np.cumsum([0, *map(len, rows)]).astype(np.int64) for rows in (hulls, rests))
        yield np.concatenate(hulls), next(starts), np.concatenate(rests), next(starts)
