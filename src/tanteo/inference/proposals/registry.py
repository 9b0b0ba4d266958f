"""The proposers of a search, in the order in which they propose; those of other distributions come last."""

from __future__ import annotations

from functools import cache

from tanteo.errors import InputError
from tanteo.inference.proposals.built_in import (
    CentreTriples,
    FactorPoses,
    HalfTurnsAndSlides,
    KnownPoses,
    PlanePoses,
    PosesOfOtherParts,
)
from tanteo.inference.proposals.drawn import PointPairs, PriorSamples
from tanteo.inference.proposals.proposer import Proposer

GROUP = "tanteo.proposals"
"""Entry points of proposers of other distributions: classes without arguments, or objects."""


@cache
def proposers() -> tuple[Proposer, ...]:
    """Return all proposers; those of other distributions are loaded once.

    Raises:
        InputError: an entry point cannot be loaded, or is no proposer.
    """
    found = (
        PointPairs(), CentreTriples(), FactorPoses(), KnownPoses(), PlanePoses(), PriorSamples(), PosesOfOtherParts(),
    )  # fmt: skip
    return (*found, *_of_other_distributions(), HalfTurnsAndSlides())


def _of_other_distributions() -> tuple[Proposer, ...]:
    from importlib.metadata import entry_points  # slow to import

    out = []
    for entry in sorted(entry_points(group=GROUP), key=lambda entry: entry.name):
        try:
            loaded = entry.load()
            one = loaded() if isinstance(loaded, type) else loaded
        except Exception as error:
            raise InputError(
                f"{GROUP}: the proposer '{entry.name}' ({entry.value}) cannot be loaded: {error}. Mend the "
                "distribution that declares it, or uninstall it."
            ) from error
        if not isinstance(one, Proposer):
            raise InputError(
                f"{GROUP}: expected a Proposer, got {type(one).__name__} from '{entry.name}' ({entry.value}). Derive "
                "it from tanteo.inference.Proposer."
            )
        out.append(one)
    return tuple(out)
