"""Measurement factors: one type per kind of measurement (:doc:`/docs/engine`).

Every module of this package is imported, so that a new kind is one file here and one in ``_core/factors``.
"""

import importlib
import pkgutil

from tanteo.factors.axis_centre import AxisCentre
from tanteo.factors.cone_apex import ConeApex
from tanteo.factors.corner_point import CornerPoint
from tanteo.factors.edge_point import EdgePoint
from tanteo.factors.factor import (
    KINDS,
    Factor,
    FeaturePart,
    Landmark,
    MeasuredRow,
    SensedDirection,
    SensedSize,
    compile_factors,
    factor_class,
    landmark_rows,
    numbered_landmarks,
    register_factor,
)
from tanteo.factors.on_surface import OnSurface
from tanteo.factors.round_centre import RoundCentre
from tanteo.factors.sphere_centre import SphereCentre
from tanteo.factors.surface_point import SurfacePoint, WallPoint

for _module in pkgutil.iter_modules(__path__):
    importlib.import_module(f"{__name__}.{_module.name}")

__all__ = [
    "KINDS",
    "AxisCentre",
    "ConeApex",
    "CornerPoint",
    "EdgePoint",
    "Factor",
    "FeaturePart",
    "Landmark",
    "MeasuredRow",
    "OnSurface",
    "RoundCentre",
    "SensedDirection",
    "SensedSize",
    "SphereCentre",
    "SurfacePoint",
    "WallPoint",
    "compile_factors",
    "factor_class",
    "landmark_rows",
    "numbered_landmarks",
    "register_factor",
]
