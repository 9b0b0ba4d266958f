"""Which maxima are of one region of the posterior: broad modes of noisy readings hold many of them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from tanteo.lie import SE3
from tanteo.localization import pose_information, weak_motions
from tanteo.matching.belief import gaps_between
from tanteo.matching.part_motions import part_scale, spins, without_spins
from tanteo.surface_search.polish import Polished
from tanteo.surface_search.target import Target
from tanteo.typing import BoolArray, FloatArray, IntArray, Transforms

LogDensity = Callable[[Transforms, FloatArray], FloatArray]
"""Log posterior density at poses ``(S, 4, 4)`` and whitened shared errors ``(S, D)``."""

_NEAR = 16.8
"""Squared Mahalanobis distance within which two maxima may be of one region: 99 % of six dimensions."""

_VALLEY = 1.0
"""Between maxima of one region the log density is nowhere lower than at the lower of them by more than this."""

_BETWEEN = np.array([0.25, 0.5, 0.75])
"""Shares of the way at which it is looked at."""

_MATTERS = 8.0
"""Log odds below the best maximum at which it does not matter any more of which region another one is."""


def groups_of_regions(found: Polished, target: Target, log_density: LogDensity) -> IntArray:
    """Groups of readings that led to any maximum of the region of each, a bit each ``(S,)``.

    With much noise a region holds many maxima within a nat of each other, and each group of readings leads to others
    of them: none of them is a place that had been missed. Two maxima are of one region if the one lies within the
    ellipsoid of the other and the density is not lower between them. Where a motion is free there is no ellipsoid.

    Args:
        found: distinct maxima of one part, best first.
        target: the part.
        log_density: of the posterior.
    """
    n = int(np.sum(found.log_evidence > found.log_evidence[0] - _MATTERS))
    i, j = np.triu_indices(n, 1)
    doubtful = np.bitwise_count(found.groups[i] | found.groups[j]) > np.bitwise_count(found.groups[j])
    i, j = i[doubtful], j[doubtful]
    xi, gaps = gaps_between(target.part, found.Ts[j], found.Ts[i], pose_information(found.information[i]))
    near = np.flatnonzero(gaps <= _NEAR)
    near = near[bounded(found, target, i[near])]
    i, j, xi = i[near], j[near], xi[near]
    joined = _no_valley(found, i, j, xi, log_density)
    size = len(found.Ts)
    pairs = coo_array((np.ones(joined.sum()), (i[joined], j[joined])), shape=(size, size))
    _, region = connected_components(pairs, directed=False)
    groups = np.zeros(size, dtype=np.int64)
    np.bitwise_or.at(groups, region, found.groups)
    return np.asarray(groups[region])


def bounded(found: Polished, target: Target, rows: IntArray) -> BoolArray:
    """At which maxima no motion but that of the part's symmetry is free ``(P,)``: those are sampled in the end."""
    scale, fixed = part_scale(target.part), spins(target.part)
    some, back = np.unique(rows, return_inverse=True)
    information = without_spins(target.part, pose_information(found.information[some]))
    held = [len(weak_motions(A, scale, fixed=fixed)) == len(fixed) for A in information]
    return np.array(held, dtype=bool)[back.reshape(-1)]


def _no_valley(found: Polished, i: IntArray, j: IntArray, xi: FloatArray, log_density: LogDensity) -> BoolArray:
    """Whether the density between each two maxima is about as high as at the lower of them ``(P,)``."""
    if not len(i):
        return np.zeros(0, dtype=bool)
    share = np.concatenate([[0.0], _BETWEEN, [1.0]])[:, None, None]
    Ts = found.Ts[i] @ SE3.exp(share * xi)
    z = (1 - share) * found.z[i] + share * found.z[j]
    log = log_density(Ts.reshape(-1, 4, 4), z.reshape(len(share) * len(i), -1)).reshape(len(share), -1)
    return np.asarray(log[1:-1].min(axis=0) >= np.minimum(log[0], log[-1]) - _VALLEY)
