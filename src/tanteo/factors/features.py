"""Sensed features as factors with the same information about the part; world frame, metres.

A plane becomes a few of the points where it was sensed, and an edge two points, with variances that give the feature's
own covariance. A circle becomes its centre with its axis, a cylinder two points of its axis, a sphere its centre, a
cone its apex with its axis. So features are measurements like any other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tanteo.errors import InputError
from tanteo.factors.factor import KINDS, Factor
from tanteo.factors.points import ContactPoints
from tanteo.features import Feature, Sides, collect_shared, shared_root


def as_labelled_points(features: Sequence[Sides], tolerance: float = 0.0) -> ContactPoints:
    """Return factors with the same information about the part as sensed features.

    The factors of one feature have its label as their id.

    Args:
        features: planes, edges, vertices, circles, cylinders, spheres, cones; and kinds of other packages.
        tolerance: standard deviation of the made surface against its CAD [m].

    Raises:
        InputError: a kind of feature without factors; a plane of unknown side without points that spread;
            a covariance that is not positive definite.
    """
    views = [given if isinstance(given, tuple) else (given,) for given in features]
    errors, _, jacobians = collect_shared([view[0] for view in views])
    root = shared_root(errors)
    names, of_kind = _names([view[0] for view in views]), _by_feature_kind()
    labels, kinds, factors, gained = list[str](), list[str](), list[Factor](), [np.zeros((0, 3, len(root)))]
    for view, name, jacobian in zip(views, names, jacobians, strict=True):
        kind = view[0].kind.name
        if not np.linalg.eigvalsh(view[0].P).min() > 0:
            raise InputError(f"feature {name!r}, P: expected a positive variance in every direction, got zero.")
        if kind not in of_kind:
            raise InputError(
                f"feature {name!r}: expected one of {', '.join(of_kind)}, got a {kind}. Such features are not matched; "
                "give the points that were sensed on it."
            )
        reading, cls = of_kind[kind]
        for factor, own in cls.from_feature(view, name, jacobian @ root):
            labels.append(name)
            kinds.append(reading)
            factors.append(replace(factor, cov=factor.cov + tolerance**2 * np.eye(3)) if tolerance else factor)
            gained.append(own[None])
    return ContactPoints(
        tuple(labels), tuple(factors), np.concatenate(gained), tolerance, labels=tuple(labels), kinds=tuple(kinds)
    )


def _by_feature_kind() -> dict[str, tuple[str, type[Factor]]]:
    """Return the kind of reading and the class of factors for each kind of feature, by its name."""
    out = dict[str, tuple[str, type[Factor]]]()
    for reading, cls in KINDS.items():
        for feature in cls.feature_kinds:
            known = out.get(feature)
            out[feature] = (feature if KINDS.get(feature) is cls else (known or (reading, cls))[0], cls)
    return out


def _names(features: Sequence[Feature]) -> list[str]:
    """Return the labels of features, numbered where one is missing or repeated."""
    names = list[str]()
    for k, feature in enumerate(features, start=1):
        name = feature.label or f"feature {k}"
        names.append(f"{name} ({k})" if name in names else name)
    return names
