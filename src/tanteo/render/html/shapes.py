"""Outlines of features of labelled readings, with their uncertainty magnified."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tanteo.errors import SideError
from tanteo.features import Feature, outline, outlines_off
from tanteo.features.kinds import CIRCLE
from tanteo.fitting import fit_labelled, given_round
from tanteo.geometry.typing import FloatArray
from tanteo.sensors import PointMeasurements, reading_kind

_SDS, _SEEN = 2.0, 0.04
"""Displacement of the drawn features [standard deviations], and its largest drawn size as a fraction of the view."""

_WORST = 4
"""Number of displaced outlines of each feature: both signs of its two most uncertain directions."""


@dataclass(frozen=True, slots=True, eq=False)
class Shapes:
    """Outlines of sensed features, world frame.

    Attributes:
        names: kind and label of each feature.
        lines: outlines ``(L, 2, 3)`` [m].
        off: outlines displaced by two standard deviations times ``enlarged`` ``(M, 2, 3)`` [m].
        enlarged: magnification of the displacements.
    """

    names: tuple[str, ...]
    lines: FloatArray
    off: FloatArray
    enlarged: int

    def __bool__(self) -> bool:
        return bool(self.names)

    @property
    def flat(self) -> bool:
        """Whether all features are planes, whose faces are drawn already."""
        return all(name.startswith("plane ") for name in self.names)


def shapes_of(measured: PointMeasurements, size: float, tolerance: float = 0.0) -> Shapes:
    """Return the features of labelled readings; none if the labels do not determine one.

    Args:
        measured: measurements of the readings.
        size: size of the view [m].
        tolerance: standard deviation of the real surface from the CAD [m].
    """
    if not any(measured.features):
        return draw_shapes((), size)
    try:
        fitted = fit_labelled(measured, tolerance).features
    except SideError:
        fitted = ()
    return draw_shapes([*(f if isinstance(f, Feature) else f[0] for f in fitted), *_rims(measured)], size)


def _rims(measured: PointMeasurements) -> list[Feature]:
    """Return the circles of readings that state centre, axis and radius."""
    sds = np.sqrt(np.linalg.eigvalsh(measured.total_covs())[:, -1])
    return [
        given_round(
            CIRCLE, measured.points[k], measured.total_covs()[k], axis=measured.normals[k],
            axis_sd=float(measured.normal_sds[k]), size=size, size_sd=float(sds[k]),
            label=measured.features[k] or measured.ids[k],
        )
        for k, size in enumerate(measured.sizes)
        if size is not None
        and reading_kind(measured.kinds[k]).centre_of is CIRCLE
        and np.isfinite(measured.normals[k]).all()
    ]  # fmt: skip


def draw_shapes(features: Sequence[Feature], size: float) -> Shapes:
    """Return the outlines of features with magnified displacements.

    Args:
        features: features; those without a label are skipped.
        size: size of the view [m].
    """
    none, labelled = np.zeros((0, 2, 3)), [f for f in features if f.label]
    lines = [outline(f) for f in labelled]
    moved = [outlines_off(f, _SDS)[-_WORST:] - at for f, at in zip(labelled, lines, strict=True)]
    farthest = max((float(np.linalg.norm(one, axis=-1).max()) for one in moved if one.size), default=0.0)
    enlarged = _round_below(_SEEN * size / farthest) if farthest > 0 else 1
    off = [(at + enlarged * one).reshape(-1, 2, 3) for at, one in zip(lines, moved, strict=True)]
    return Shapes(
        tuple(f"{f.kind.name} {f.label}" for f in labelled), np.concatenate([none, *lines]),
        np.concatenate([none, *off]), enlarged,
    )  # fmt: skip


def _round_below(wanted: float) -> int:
    return max((m * 10**e for e in range(4) for m in (1, 2, 5) if m * 10**e <= wanted), default=1)
