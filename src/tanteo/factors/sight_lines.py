"""Lines of sight of a theodolite, a tracker or a calibrated camera through known points of the part."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo import _core
from tanteo.errors import InputError
from tanteo.factors.pose_factor import PoseFactor
from tanteo.geometry import check_covariance
from tanteo.geometry.typing import Covariances, Vectors
from tanteo.parts import Part, round_features

CORNERS, RIMS = "corners", "rims"
"""Candidate points of lines whose point is not given: corners, or centres of the rims of holes and bosses."""


@dataclass(frozen=True, eq=False, kw_only=True)
class SightLines(PoseFactor):
    """Lines of sight from one station, each through a point of the part.

    A line measures two angles. Its density per steradian is a normal density of both, averaged over all points through
    which it may pass. With probability ``outlier_rate`` it is an outlier of uniform direction. Occlusion by the part is
    not checked.

    Attributes:
        origin: station of all lines in the world ``(3,)`` [m].
        directions: directions in the world, of any length ``(n, 3)``.
        angle_sd: standard deviation of each of the two angles of a line [rad].
        through: ``corners`` or ``rims`` of the part, if a line may pass through any corner or rim; or a point in the
            part frame for each line ``(n, 3)`` [m].
        origin_sd: independent standard deviation of the origin of each line [m].
        station: covariance of the error of the station's pose, common to all lines, shift and turn in the world ``(6,
            6)`` [m, rad]; None for no error.
        outlier_rate: probability that a line passes through no such point, from 0 to 1.

    Raises:
        InputError: an array has another shape, or a number is outside its range.

    Example:
        >>> from tanteo.factors.sight_lines import SightLines
        >>> lines = SightLines(origin=[0, 0, 1], directions=[[0.1, 0, -1], [0, 0.1, -1]], angle_sd=1e-4)
        >>> lines.through, lines.states
        ('corners', 0)
    """

    origin: Vectors
    directions: Vectors
    angle_sd: float
    through: str | Vectors = CORNERS
    origin_sd: float = 0.0
    station: Covariances | None = None
    outlier_rate: float = 0.01

    def __post_init__(self) -> None:
        object.__setattr__(self, "origin", np.array(self.origin, dtype=np.float64))
        object.__setattr__(self, "directions", np.array(self.directions, dtype=np.float64))
        if self.origin.shape != (3,) or self.directions.ndim != 2 or self.directions.shape[1] != 3:
            raise InputError(
                f"sight lines: expected an origin (3,) and directions (n, 3), got shapes {self.origin.shape} and "
                f"{self.directions.shape}."
            )
        finite = np.isfinite(self.origin).all() and np.isfinite(self.directions).all()
        if not (finite and self.directions.any(1).all()):
            raise InputError("sight lines: expected finite numbers and directions of some length.")
        if not 1e-9 <= self.angle_sd <= 1 or not 0 <= self.origin_sd <= 1e3:
            raise InputError(
                "sight lines: expected an angle_sd from 1e-9 to 1 rad and an origin_sd of 0 or more, got "
                f"{self.angle_sd} rad and {self.origin_sd} m."
            )
        if not 0 <= self.outlier_rate < 1:
            raise InputError(f"sight lines: expected an outlier_rate from 0 up to 1, got {self.outlier_rate}.")
        if self.station is not None:
            object.__setattr__(self, "station", check_covariance("sight lines, station", self.station, 6))
        if isinstance(self.through, str):
            if self.through not in (CORNERS, RIMS):
                raise InputError(f"sight lines, through: expected corners, rims or points, got {self.through!r}.")
            return
        object.__setattr__(self, "through", np.array(self.through, dtype=np.float64))
        if np.shape(self.through) != self.directions.shape or not np.all(np.isfinite(np.asarray(self.through))):
            raise InputError(
                f"sight lines, through: expected one finite point for each of {len(self.directions)} lines, got an "
                f"array of shape {np.shape(self.through)}."
            )

    @property
    def states(self) -> int:
        """Return the number of shared errors: those of the station's pose."""
        return 0 if self.station is None else 6

    def points(self, part: Part) -> Vectors:
        """Return the points of a part through which lines may pass ``(K, 3)`` [m].

        Raises:
            InputError: the part has none.
        """
        if not isinstance(self.through, str):
            return self.through
        rims = [rim.centre for one in round_features(part) for rim in one.rims]
        found = np.array(part.corners.points if self.through == CORNERS else rims, dtype=np.float64).reshape(-1, 3)
        if not len(found):
            raise InputError(f"sight lines: expected a part with {self.through}, got {part.name}, which has none.")
        return found

    def term(self, part: Part, first: int, common: int = 0) -> _core.PoseTerm:
        """Compile the factor for one part.

        Args:
            part: candidate part.
            first: index of the factor's first shared error among those of all factors.
            common: not used: the factor has no errors in common with others.
        """
        arrays = {
            "origin": self.origin[None],
            "directions": self.directions,
            "points": self.points(part),
            "one_each": np.array([float(not isinstance(self.through, str))]),
            "angle_sd": np.array([self.angle_sd]),
            "origin_sd": np.array([self.origin_sd]),
            "outlier_rate": np.array([self.outlier_rate]),
        }
        if self.station is not None:
            arrays["root"] = np.linalg.cholesky(self.station + 1e-24 * np.eye(6))
        return _core.make_term(
            "sight_lines", {name: np.ascontiguousarray(array) for name, array in arrays.items()}, first
        )
