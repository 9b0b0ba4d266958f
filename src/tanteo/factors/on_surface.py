"""Points sensed on the surface of the part: on a face, an edge or a corner."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from tanteo.errors import InputError
from tanteo.factors.factor import NO_DIRECTION, Factor, MeasuredRow
from tanteo.geometry.typing import Vectors


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class OnSurface(Factor):
    """Point of the surface, or centre of a ball that touches it.

    Attributes:
        ball_radius: radius of the tip's ball, 0 for a point of the surface itself [m].
        approach: unit direction of the beam or of the tip's motion, into the material ``(3,)``; None if unknown.
        outward: approximate outward direction if only the material side is known ``(3,)``; None otherwise.
        free_path: length of the straight free-space ray before the point [m]; 0 if unknown.
    """

    ball_radius: float = 0.0
    approach: Vectors | None = None
    outward: Vectors | None = None
    free_path: float = 0.0

    def log_outlier(self, radius: float) -> float:
        """Return the log density of an outlier: uniform in the workspace, or along the beam if there is one.

        Args:
            radius: radius of the ball of the workspace [m].
        """
        if self.approach is None:
            return super(OnSurface, self).log_outlier(radius)
        return -math.log(2 * radius) - (0.0 if self.normal is None else math.log(4 * math.pi))

    def columns(self) -> dict[str, Any]:
        """Return radius of the ball, directions and length of the free-space ray; zero for what is unknown."""
        return {
            "radii": self.ball_radius,
            "directions": NO_DIRECTION if self.approach is None else self.approach,
            "sides": NO_DIRECTION if self.outward is None else self.outward,
            "free_reach": self.free_path,
            "round_face": self.round_face,
        }

    @classmethod
    def from_row(cls, row: MeasuredRow) -> OnSurface:
        """Return a factor from one row of measurements.

        Raises:
            InputError: contact of a ball with an edge or corner, whose place on the ball is unknown.
        """
        if cls.codimension > 1 and row.ball_radius > 0:
            raise InputError(
                f"{row.kind} {row.label!r}: expected surface points, got centres of a ball of "
                f"{1e3 * row.ball_radius:g} mm, whose contact on an edge is unknown. Sense the two faces beside it, or "
                f"give points of the {row.kind} itself."
            )
        return cls(
            at=row.at, cov=row.cov, normal=row.normal, ball_radius=row.ball_radius, approach=row.approach,
            free_path=row.free_path,
        )  # fmt: skip
