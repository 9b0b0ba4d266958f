"""Seeds: few sensed centres and planes that fix a pose.

A seed has three centres, two centres and a plane, one centre and two planes, or two with a sensed axis. There are
several seeds, so that at least one is right if any one reading, or any two, are wrong.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from tanteo.geometry.typing import BoolArray, FloatArray, Indices
from tanteo.posterior.settings import SearchSettings


class Seeds:
    """Sensed centres and planes that fix a pose, the most accurate seeds first."""

    def __init__(self, settings: SearchSettings, rows: FloatArray, planes: FloatArray, usable: BoolArray) -> None:
        self.settings = settings
        self.rows, self.planes, self.count = rows, planes, len(rows)
        self.centres = list(range(min(len(rows), settings.items)))
        self.flat = [len(rows) + int(k) for k in np.flatnonzero(usable)[: settings.items]]
        at = np.concatenate([rows[:, :3], planes[:, 3:6]])
        self.reach = float(np.linalg.norm(np.ptp(at, axis=0))) if len(at) else 0.0

    def chosen(self) -> tuple[Indices, Indices, bool]:
        """Return seeds without a common item, further seeds without two common items, and whether they fix a pose.

        If none fixes a pose, two centres and a plane still discriminate parts, because a motion along the unobserved
        direction changes none of their distances.
        """
        known = sorted((error, seed) for seed in self._all() if (error := self._error(seed)) is not None)
        seeds = [seed for _, seed in known]
        if not seeds:
            seeds = [(*two, k) for two in combinations(self.centres, 2) for k in self.flat]
            seeds = seeds or [(k, m) for k in self.centres for m in self.flat]
        first = _covering(seeds, [], 1, self.settings.tuples)
        return _as_rows(first), _as_rows(_covering(seeds, first, 2, self.settings.items)), len(known) > 0

    def _all(self) -> list[tuple[int, ...]]:
        c, f = self.centres, self.flat
        some = [*combinations(c, 3), *combinations(c, 2)]
        some += [(*two, k) for two in combinations(c, 2) for k in f]
        return some + [(k, *two) for k in c for two in combinations(f, 2)] + [(k, m) for k in c for m in f]

    def _error(self, seed: tuple[int, ...]) -> float | None:
        """Return the approximate error of the pose at the farthest reading [m]; None if a seed fixes none."""
        centres = [k for k in seed if k < self.count]
        directions = [(plane[:3], plane[7]) for plane in (self.planes[k - self.count] for k in seed if k >= self.count)]
        if len(centres) == 3:
            return self._of_three(centres)
        if len(seed) == 2:  # the axis of a centre instead of a plane
            directions += [(self.rows[k, 3:6], self.rows[k, 7]) for k in centres if np.any(self.rows[k, 3:6])][:1]
        if len(centres) == 2 and len(directions) == 1:
            return self._of_two(centres, *directions[0])
        if len(directions) < 2:
            return None
        size = float(np.linalg.norm(np.cross(directions[0][0], directions[1][0])))
        tilt = max(tilt for _, tilt in directions)
        return (
            float(self.reach * tilt / size)
            if size > max(self.settings.independent, self.settings.gate * tilt)
            else None
        )

    def _of_three(self, centres: list[int]) -> float | None:
        """Return the error of three centres; their heights along the axes are unknown, so tilts are inaccurate."""
        a, b, c = self.rows[centres, :3]
        longest = max(float(np.linalg.norm(x)) for x in (b - a, c - a, c - b))
        height = float(np.linalg.norm(np.cross(b - a, c - a))) / max(longest, 1e-12)
        return (
            self.settings.gate * self.reach * float(self.rows[centres, 6].max()) / height
            if height > self.settings.off_line * longest
            else None
        )

    def _of_two(self, centres: list[int], direction: FloatArray, tilt: float) -> float | None:
        off = self.rows[centres[1], :3] - self.rows[centres[0], :3]
        across = float(np.linalg.norm(off - (off @ direction) * direction))
        if across <= max(self.settings.off_line, self.settings.gate * tilt) * float(np.linalg.norm(off)):
            return None
        return self.reach * max(tilt, float(np.linalg.norm(self.rows[centres, 6])) / across)


def _covering(
    seeds: list[tuple[int, ...]], known: list[tuple[int, ...]], wrong: int, most: int
) -> list[tuple[int, ...]]:
    """Return the best seeds such that at least one is right if ``wrong`` items are wrong."""
    items = sorted({k for seed in seeds for k in seed})
    spoiled = [set(some) for some in combinations(items, wrong) if all(set(some) & set(seed) for seed in known)]
    chosen = list[tuple[int, ...]]() if known else seeds[:1]
    spoiled = [some for some in spoiled if not any(some.isdisjoint(seed) for seed in chosen)]
    while spoiled and len(chosen) < most:
        right = [sum(some.isdisjoint(seed) for some in spoiled) for seed in seeds]
        if not max(right):
            break
        chosen.append(seeds[int(np.argmax(right))])
        spoiled = [some for some in spoiled if not some.isdisjoint(chosen[-1])]
    return chosen


def _as_rows(seeds: list[tuple[int, ...]]) -> Indices:
    return np.array([[*seed, *[-1] * (3 - len(seed))] for seed in seeds], dtype=np.int32).reshape(-1, 3)
