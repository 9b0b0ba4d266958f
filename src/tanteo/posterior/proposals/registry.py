"""Registry of proposers: built-in ones, and those of other distributions by entry point."""

from __future__ import annotations

from tanteo.plugins import Registry
from tanteo.posterior.proposals.built_in import (
    CentreTriples,
    FaceAssignments,
    FactorPoses,
    HalfTurnsAndSlides,
    KnownPoses,
    NearbyAssignments,
    PlanePoses,
)
from tanteo.posterior.proposals.drawn import PointPairs, PriorSamples
from tanteo.posterior.proposals.outlier_poses import OutlierPoses
from tanteo.posterior.proposals.proposer import Proposer

_FIRST = PointPairs(), CentreTriples(), FactorPoses(), KnownPoses(), PlanePoses(), FaceAssignments(), PriorSamples()
_LAST = HalfTurnsAndSlides(), NearbyAssignments(), OutlierPoses()

PROPOSERS: Registry[Proposer] = Registry("tanteo.proposals", Proposer, {one.name: one for one in (*_FIRST, *_LAST)})
"""All proposers by name; an entry point refers to an object of a class derived from :class:`Proposer`."""


def proposers() -> tuple[Proposer, ...]:
    """Return all proposers in the order of a round; motions of the best maxima come last."""
    return (*_FIRST, *(one for one in PROPOSERS.entries() if one.name not in PROPOSERS.builtin), *_LAST)
