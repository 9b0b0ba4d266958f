"""Measurements with changed columns: each factor is rebuilt."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tanteo.factors.factor import SensedDirection, factor_class

OF_FACTORS = {"points": "at", "covs": "cov", "radii": "ball_radius", "reach": "free_path"}
VECTORS = {"directions": "approach", "sides": "outward"}


def altered(measurements, /, **columns):
    """Return the same measurements with some columns changed; a zero direction or normal means not sensed."""
    kinds = columns.pop("kinds", measurements.kinds)
    normals, sds = columns.pop("normals", measurements.normals), columns.pop("normal_sds", measurements.normal_sds)
    columns.pop("sd", None)  # follows from the covariances
    factors = []
    for k, factor in enumerate(measurements.factors):
        own = {OF_FACTORS[name]: columns[name][k] for name in OF_FACTORS if name in columns}
        own |= {VECTORS[n]: columns[n][k] if columns[n][k].any() else None for n in VECTORS if n in columns}
        own["normal"] = SensedDirection(normals[k], float(sds[k])) if np.any(normals[k]) else None
        if kinds[k] != measurements.kinds[k]:
            factor = factor_class(kinds[k])(at=factor.at, cov=factor.cov)
        factors.append(replace(factor, **own))
    rest = {name: value for name, value in columns.items() if name not in OF_FACTORS | VECTORS}
    return replace(measurements, factors=tuple(factors), kinds=tuple(kinds), **rest)
