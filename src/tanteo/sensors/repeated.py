"""Readings that came in twice under two names, as far as their numbers can show it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tanteo.sensors.measurements import PointMeasurements

_SAME = 1e-9
"""Numbers (m, or parts of a unit direction) that agree to this are the same."""

_NAMED = 3
"""So many sets of equal readings are named, the rest are counted."""


def say_repeated(measured: PointMeasurements) -> str:
    """A sentence that names readings with equal point, direction, normal and spread; empty if there are none.

    They are not merged: a device with a coarse resolution may honestly say the same again.
    """
    sets = _equal(measured)
    if not sets:
        return ""
    names = [f"{', '.join(ids[:-1])} and {ids[-1]}" for ids in sets[:_NAMED]]
    rest = len(sets) - _NAMED
    more = f" (and {rest} more such set{'s' * (rest > 1)})" if rest > 0 else ""
    return (
        f"Readings {'; '.join(names)}{more} are equal in place, direction and spread, and each counts: if they are one "
        "reading under several names, keep one, or the covariance is too small."
    )


def _equal(measured: PointMeasurements) -> list[Sequence[str]]:
    """Names of readings that are equal, a set at a time, in the order of their first ones."""
    if not len(measured):
        return []
    sds = np.sqrt(np.diagonal(measured.covs, axis1=-2, axis2=-1))
    directions, normals = np.nan_to_num(measured.directions), np.nan_to_num(measured.normals)
    numbers = np.concatenate([measured.points, directions, normals, sds, measured.radii[:, None]], axis=1)
    inverse = np.unique(np.round(numbers / _SAME) + 0.0, axis=0, return_inverse=True)[1].ravel()  # 0.0: no minus zero
    sets: dict[int, list[str]] = {}
    for name, row in zip(measured.ids, inverse.tolist(), strict=True):
        sets.setdefault(row, []).append(name)
    return [ids for ids in sets.values() if len(ids) > 1]
