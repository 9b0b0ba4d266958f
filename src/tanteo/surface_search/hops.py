"""Other maxima beside those that were found, where errors that readings share are large beside the noise.

Then each pose has shared errors that fit it best, and what is met depends on both: maxima stand side by side, and first
poses find some of them. From a maximum the next ones are found by supposing other shared errors: near those of the
maximum, and any; the pose follows them, then both climb together.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from tanteo.localization import motions_about
from tanteo.matching.priors import Priors
from tanteo.surface_search.distinct import distinct_maxima
from tanteo.surface_search.polish import Polished, polish
from tanteo.surface_search.refine import moved, step_to
from tanteo.surface_search.shared_start import bend, equations_within
from tanteo.surface_search.target import Target
from tanteo.surface_search.touches import FreePaths, Touches
from tanteo.typing import FloatArray, Transforms

_FROM, _EACH = 2, 48
"""Maxima from which others are looked for, and shared errors that are supposed about each."""

_NEAR = 0.5
"""Half of them are so far from those of the maximum, in sds of what is known beforehand; the rest are any."""

_WIDE, _NARROW, _STEPS = 2.0, 0.25, 6
"""Readings keep half their weight up to so many times what shared errors bend them, at first and at last; steps."""

_DAMPING = 1e-4
"""Share of the information that is added to it while the pose follows."""


def hop(
    touches: Touches, free: FreePaths, found: Polished, target: Target, priors: Priors, round_: int, group: int
) -> Polished:
    """The distinct maxima that are reached from the best ones by supposing other shared errors.

    Args:
        touches: the readings.
        free: paths on which nothing was met.
        found: maxima, best first.
        target: the part.
        priors: as of :func:`polish`.
        round_: which of the draws of shared errors are supposed.
        group: number of the group of readings that counts as having led to them.
    """
    best = np.repeat(np.arange(min(_FROM, len(found.Ts))), _EACH)
    draws = np.tile(_draws(found.z.shape[1], round_), (len(best) // _EACH, 1))
    near = np.arange(len(best)) % 2 == 0
    kept = np.where(near, np.sqrt(1 - _NEAR**2), 0.0)[:, None]
    z = kept * found.z[best] + np.where(near, _NEAR, 1.0)[:, None] * draws
    Ts = _followed(touches, found.Ts[best], z, target)
    return distinct_maxima(
        polish(touches, free, Ts, target, priors, groups=np.full(len(best), 1 << group), z=z), target
    )


@cache
def _draws(D: int, round_: int) -> FloatArray:
    """The same standard normal draws every time ``(K, D)``, others in each round."""
    return np.asarray(np.random.default_rng((1991, 49, D, round_)).normal(size=(_EACH, D)))


def _followed(touches: Touches, Ts: Transforms, z: FloatArray, target: Target) -> Transforms:
    """The poses that fit best while the shared errors are held ``(S, 4, 4)``."""
    M, bent = motions_about(target.part.centroid, 6), bend(touches)
    for width in np.geomspace(_WIDE * bent, max(_NARROW * bent, 1.0), _STEPS):
        A, b = equations_within(touches, Ts, z, target, width)
        step = step_to(M.T @ A[:, :6, :6] @ M, b[:, :6] @ M, np.full(len(Ts), _DAMPING))
        Ts = moved(Ts, step, target.part.centroid)
    return Ts
