"""The best poses of one part, tried on the others.

Variants of one part come in one frame: where one explains the readings, the other may as well, and better. A search of
its own can miss that pose, and a part that found nothing looks as if there were nothing to find.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tanteo.matching.priors import Priors
from tanteo.surface_search.polish import Polished, polish
from tanteo.surface_search.starts import score
from tanteo.surface_search.target import Target
from tanteo.surface_search.touches import FreePaths, Touches
from tanteo.typing import IntArray, Transforms

_BEST, _MATTER = 3, 12.0
"""Poses that are tried, and log odds below the best of all parts from which a pose is not."""

_NEAR = 1.0
"""Mean squared distance of the readings, in spacings of first poses and clipped at nine, up to which it may fit."""


def tried_on(
    touches: Touches, free: FreePaths, found: Sequence[tuple[Target, Polished | None]], priors: Priors
) -> list[Polished | None]:
    """The maxima of each part that the best poses of the other parts lead to; None where none can fit.

    Args:
        touches: the readings.
        free: paths on which nothing was met.
        found: each part with its maxima, best first; None if it has none.
        priors: as of :func:`polish`.
    """
    Ts, groups, of = _best(found)
    out: list[Polished | None] = []
    for k, (target, _) in enumerate(found):
        rows = np.flatnonzero(of != k)
        if len(rows):
            wide = float(np.hypot(target.spacing, np.median(touches.sd)))
            rows = rows[score(touches, Ts[rows], target, wide)[:, 1] < _NEAR]
        out.append(polish(touches, free, Ts[rows], target, priors, groups=groups[rows]) if len(rows) else None)
    return out


def _best(found: Sequence[tuple[Target, Polished | None]]) -> tuple[Transforms, IntArray, IntArray]:
    """The likeliest poses of all parts, the groups of readings that led to each, and the part of each."""
    some = [
        (k, maxima.take(np.arange(min(_BEST, len(maxima.Ts)))))
        for k, (_, maxima) in enumerate(found)
        if maxima is not None
    ]
    log = np.concatenate([np.zeros(0), *(m.log_evidence for _, m in some)])
    Ts = np.concatenate([np.zeros((0, 4, 4)), *(m.Ts for _, m in some)])
    groups = np.concatenate([np.zeros(0, dtype=np.int64), *(m.groups for _, m in some)])
    of = np.repeat([k for k, _ in some], [len(m.Ts) for _, m in some]).astype(np.int64)
    best = np.argsort(-log, kind="stable")[:_BEST]
    best = best[log[best] > log.max(initial=-np.inf) - _MATTER]
    return Ts[best], groups[best], of[best]
