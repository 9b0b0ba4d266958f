"""A measurement of the pose that is no list of points: an image, a stable pose, a likelihood of a user."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from tanteo import _core
from tanteo.parts import Part
from tanteo.typing import Transforms


class PoseFactor(ABC):
    """A factor of the posterior that depends on the part, its pose and shared errors; the core evaluates it."""

    @property
    def states(self) -> int:
        """Number of shared errors that the factor adds, each with a unit normal prior."""
        return 0

    @property
    def log_unknown(self) -> float:
        """Log density of the measurement if the object is unknown, relative to the same baseline as the density."""
        return 0.0

    @property
    def is_pose_prior(self) -> bool:
        """Whether the factor is itself the prior density of the pose, over shifts [m] and turns [rad]."""
        return False

    def proposals(self, part: Part) -> Transforms:
        """Return poses ``T_world_part`` of a part that the measurement suggests ``(k, 4, 4)``; none by default."""
        return np.zeros((0, 4, 4))

    @abstractmethod
    def term(self, part: Part, first: int) -> _core.PoseTerm:
        """Compile the factor for one part.

        Args:
            part: candidate part.
            first: index of the factor's first shared error among all of them.
        """
