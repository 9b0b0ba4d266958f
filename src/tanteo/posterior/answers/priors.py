"""Priors of an inference: unknown object, outliers, noise, furniture, pose, global properties."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry.limits import check_length, check_number
from tanteo.posterior.answers.furniture import Furniture
from tanteo.posterior.answers.pose_prior import PosePrior
from tanteo.posterior.answers.whole_object import WholeObject

STATED = {"typed": 2.0, "preset": 1.5, "unstated": 5.0}
"""Factor to which the noise is known, by the origin of its standard deviation: typed by the user, preset from a data
sheet, or unstated and estimated. With the first, the 95 % region of a dozen readings has a coverage of 90 to 97 % if
the true noise is half to twice the stated one (``benchmarks/misspecification.py``)."""

_MOST = 100.0
"""Largest noise factor that is accepted."""

OFTEN = 0.99
"""Largest outlier rate that is accepted: with more outliers hardly a reading would be on the part."""


@dataclass(frozen=True, slots=True)
class Priors:
    """Priors of an inference.

    Attributes:
        unknown: probability that the object is none of the parts.
        outlier_rate: probability that a sensed feature is not on the part; for unlabelled readings the mean of a rate
            that is estimated from the readings (decision 35).
        radius: radius of the ball in which the part lies [m]; 0 for that of the largest part of the catalogue.
        right_angled: fraction of the faces of an unknown part with normals along three perpendicular axes (decision
            62).
        near_variant: fraction of unknown parts that equal a part of the catalogue except for some faces; for unlabelled
            readings.
        noise_factor: factor to which the noise is known: standard deviations within this factor of the stated one are
            equally probable, beyond its cube nearly impossible; 1 if the noise is as stated. None: by the origin of
            the standard deviation, see :data:`STATED`.
        furniture: known surfaces that a sensor may hit instead of the part, in addition to the table of ``pose``.
        pose: prior of the pose.
        whole: measurements of the whole object: mass, size, outline.

    Raises:
        InputError: a probability outside (0, 1) (no reading can change a prior of 0 or 1), an outlier rate above 99 %,
            ``right_angled`` outside [0, 1), a radius that is not a length, or a noise factor outside 1 to 100.

    Example:
        >>> priors = tanteo.Priors(outlier_rate=0.1, unknown=0.01)
        >>> priors.outlier_rate
        0.1
    """

    unknown: float = 0.05
    outlier_rate: float = 0.01
    radius: float = 0.0
    right_angled: float = 0.8
    near_variant: float = 0.5
    noise_factor: float | None = None
    furniture: tuple[Furniture, ...] = ()
    pose: PosePrior | None = None
    whole: WholeObject | None = None

    def __post_init__(self) -> None:
        for name in ("unknown", "outlier_rate", "near_variant", "right_angled"):
            check_number(f"priors, {name}", getattr(self, name))
        for name in ("unknown", "outlier_rate", "near_variant"):
            if not 0 < getattr(self, name) < 1:
                raise InputError(
                    f"priors, {name}: expected a probability between 0 and 1, got {getattr(self, name)}. A tiny one is "
                    "enough."
                )
        if not 0 <= self.right_angled < 1:
            raise InputError(f"priors, right_angled: expected a fraction from 0 to below 1, got {self.right_angled}.")
        if self.outlier_rate > OFTEN:
            raise InputError(f"priors, outliers: expected at most {OFTEN}, got {self.outlier_rate}. Lower it.")
        check_length("priors, radius", self.radius)
        if not isinstance(self.furniture, tuple) or not all(isinstance(f, Furniture) for f in self.furniture):
            raise InputError(
                f"priors, furniture: expected a tuple of Furniture, got {type(self.furniture).__name__}. "
                "Write furniture=(Furniture.of_part(shape, T_world_shape, sd),)."
            )
        if self.noise_factor is None:
            return
        check_number("priors, noise_factor", self.noise_factor)
        if not 1 <= self.noise_factor <= _MOST:
            raise InputError(
                f"priors, noise_factor: expected a factor from 1 (as stated) to {_MOST:g}, got {self.noise_factor}."
            )

    @property
    def log_noise_factor(self) -> float:
        """Return the log of the factor to which the noise is known; 0 if the noise is exactly as stated."""
        return float(np.log(STATED["typed"] if self.noise_factor is None else self.noise_factor))


def sized(priors: Priors | None, radius: float) -> Priors:
    """Return the priors with the radius of the workspace, if they state none.

    Args:
        priors: priors of the inference; None for the defaults.
        radius: radius of the largest part [m].
    """
    priors = priors or Priors()
    return replace(priors, radius=radius) if priors.radius == 0 else priors
