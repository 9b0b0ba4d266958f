"""Measurements of the pose that are not points: images, stable poses, likelihoods of a user."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

import numpy as np

from tanteo import _core
from tanteo.geometry.typing import Transforms
from tanteo.parts import Part

if TYPE_CHECKING:
    from tanteo.factors.factor import CommonErrors


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

    def alternatives(self) -> tuple[tuple[PoseFactor, ...], ...]:
        """Return groups of factors of which exactly one applies; empty for most factors."""
        return ()

    @abstractmethod
    def term(self, part: Part, first: int, common: int = 0) -> _core.PoseTerm:
        """Compile the factor for one part.

        Args:
            part: candidate part.
            first: index of the factor's first shared error among those of all factors.
            common: index of the first of its :attr:`common` errors.
        """
