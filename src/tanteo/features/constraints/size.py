"""Return the radius or half angle of a round feature as a constraint (``math.md`` section 4.8)."""

from __future__ import annotations

import numpy as np

from tanteo.errors import InputError
from tanteo.features.constraints.constraint import Constraint, ConstraintKind
from tanteo.features.constraints.relation import CONSTRAINT_KINDS
from tanteo.features.feature import Feature

RADIUS = ConstraintKind("radius", ("m",), "radius of a circle, cylinder or sphere")
HALF_ANGLE = ConstraintKind("half_angle", ("rad",), "half angle of a cone")
CONSTRAINT_KINDS.update({kind.name: kind for kind in (RADIUS, HALF_ANGLE)})


def relate_size(feature: Feature) -> Constraint:
    """Return the radius of a circle, cylinder or sphere, or the half angle of a cone, with its total variance.

    A caution states if it is unknown whether the feature is a boss or a bore; then it matches model values of both.

    Args:
        feature: round feature.

    Raises:
        InputError: the feature is not round, or its size is unknown.

    Example:
        >>> hole = tanteo.fitting.given_round(
        ...     tanteo.features.kinds.CIRCLE, [0, 0, 0], 1e-5, size=3e-3, size_sd=1e-5, convex=False, label="A"
        ... )
        >>> found = tanteo.features.relate_size(hole)
        >>> bool(found.p_value(3.02e-3) > 0.01), bool(found.p_value(3.05e-3) > 0.01)
        (True, False)
    """
    size = feature.size
    if size is None:
        raise InputError(
            f"feature {feature.label!r}: expected a circle, cylinder, cone or sphere of known size, got a "
            f"{feature.kind.name} without. Fit it, or give its size."
        )
    variance = size.variance
    for gain, term in zip(size.shared, feature.shared, strict=False):
        variance += float((gain @ term.error.covariance @ gain.T)[0, 0])
    kind = HALF_ANGLE if feature.kind.size_name == "half angle" else RADIUS
    caution = "" if size.convex is not None else "it is not known whether this is a boss or a bore."
    return Constraint(kind, (feature.label,), np.array([size.value]), np.array([[variance]]), np.zeros(1), caution)
