"""Measurements of the pose that are not points: images, stable poses, likelihoods of a user."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tanteo import _core
from tanteo.geometry.typing import Transforms
from tanteo.parts import Part


@dataclass(frozen=True, slots=True, eq=False)
class CommonErrors:
    """Errors that several factors have in common, such as those of the mounting of a camera that takes many images.

    Attributes:
        source: source of the errors. Factors whose errors have the same source (the same object) have them in common.
        states: number of errors, each with a standard normal prior.
    """

    source: object
    states: int


class PoseFactor(ABC):
    """Factor of the posterior over the part, its pose and shared errors, evaluated by the compiled core."""

    @property
    def states(self) -> int:
        """Return the number of shared errors that the factor adds, each with a standard normal prior."""
        return 0

    @property
    def common(self) -> CommonErrors | None:
        """Return the errors that the factor has in common with other factors; None for most factors."""
        return None

    @property
    def log_unknown(self) -> float:
        """Return the log density of the measurement if the object is unknown, relative to the same baseline."""
        return 0.0

    @property
    def is_pose_prior(self) -> bool:
        """Return whether the factor is itself the prior density of the pose, over shifts [m] and turns [rad]."""
        return False

    def poses(self, part: Part) -> Transforms:
        """Return poses of a part from which the search starts ``(K, 4, 4)``; empty for most factors."""
        return np.zeros((0, 4, 4))

    @abstractmethod
    def term(self, part: Part, first: int, common: int = 0) -> _core.PoseTerm:
        """Compile the factor for one part.

        Args:
            part: candidate part.
            first: index of the factor's first shared error among those of all factors.
            common: index of the first of its :attr:`common` errors.
        """


def state_columns(factors: Sequence[PoseFactor], first: int) -> tuple[list[tuple[int, int]], int]:
    """Return where the shared errors of factors are: first the errors of each factor, then common errors once.

    Args:
        factors: factors of one posterior.
        first: index of the first error.

    Returns:
        For each factor the index of its first shared error and of its first common error; the number of all errors.
    """
    own, common = [], dict[int, int]()
    at = first
    for factor in factors:
        own.append(at)
        at += factor.states
    for factor in factors:
        errors = factor.common
        if errors is not None and id(errors.source) not in common:
            common[id(errors.source)] = at
            at += errors.states
    places = [0 if factor.common is None else common[id(factor.common.source)] for factor in factors]
    return list(zip(own, places, strict=True)), at - first
