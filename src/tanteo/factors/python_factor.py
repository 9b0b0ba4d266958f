"""Likelihood of a user as Python functions of a batch of poses."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from tanteo import _core
from tanteo.errors import InputError
from tanteo.factors.pose_factor import PoseFactor
from tanteo.geometry.typing import FloatArray, Transforms
from tanteo.parts import Part

PoseFunction: TypeAlias = Callable[[Transforms, Part], FloatArray]
"""A function of poses ``T_world_part`` ``(S, 4, 4)`` and the part."""

_SHIFT, _TURN = 1e-6, 1e-5
"""Steps of numeric differences [m, rad]: the cube root of the rounding error of a log density of ten, for features of a
millimetre and a hundredth of a radian (Press et al. 2007, section 5.7)."""


@dataclass(frozen=True, eq=False, kw_only=True)
class PythonFactor(PoseFactor):
    """Measurement whose log density is a Python function, for your own sensor without a compiler.

    The posterior multiplies its density with those of the readings. The function is called with a batch of poses and
    returns log p(measurement | pose) - log p(measurement | unknown object or outlier): 0 means that the measurement is
    as probable at the pose as without any part. It may be an outlier with probability ``outlier_rate``.

    Attributes:
        name: name in messages.
        log_density: log density relative to that of an outlier, for poses ``T_world_part`` ``(S, 4, 4)`` and the part;
            returns ``(S,)``, with ``-inf`` for impossible poses.
        gradient: its derivative by small motions ``T exp(xi)``, ``xi = [v, w]`` in the part frame [1/m, 1/rad]; returns
            ``(S, 6)``. None: central differences.
        propose: function that returns poses ``(K, 4, 4)`` of a part from which the search starts, in addition to its
            own.
        outlier_rate: probability that the measurement does not come from the part, from 0 to 1.
        steps: steps of the differences: shift [m] and turn [rad].

    Example:
        >>> def height(Ts, part):  # a gauge reads that the part's centroid is 30.0 +- 0.1 mm high
        ...     z = Ts[:, 2, :3] @ part.centroid + Ts[:, 2, 3]
        ...     return -0.5 * ((z - 0.030) / 1e-4) ** 2 + np.log(0.5 / (np.sqrt(2 * np.pi) * 1e-4))
        >>> gauge = tanteo.PythonFactor(name="height gauge", log_density=height)
        >>> gauge.outlier_rate
        0.01
    """

    name: str
    log_density: PoseFunction
    gradient: PoseFunction | None = None
    propose: Callable[[Part], Transforms] | None = None
    outlier_rate: float = 0.01
    steps: tuple[float, float] = (_SHIFT, _TURN)

    def __post_init__(self) -> None:
        if not callable(self.log_density):
            raise InputError(f"{self.name}: expected log_density to be a function, got {self.log_density!r}.")
        if not 0 <= self.outlier_rate < 1:
            raise InputError(f"{self.name}: expected an outlier_rate from 0 up to 1, got {self.outlier_rate}.")

    def poses(self, part: Part) -> Transforms:
        """Return poses of a part from which the search starts ``(K, 4, 4)``.

        Raises:
            InputError: ``propose`` does not return finite poses ``(K, 4, 4)``.
        """
        if self.propose is None:
            return np.zeros((0, 4, 4))
        Ts = np.asarray(self.propose(part), dtype=np.float64)
        if Ts.ndim != 3 or Ts.shape[1:] != (4, 4) or not np.all(np.isfinite(Ts)):
            raise InputError(f"{self.name}: expected propose to return finite poses (K, 4, 4), got shape {Ts.shape}.")
        return Ts

    def term(self, part: Part, first: int, common: int = 0) -> _core.PoseTerm:
        """Compile the factor for one part.

        Exceptions of the functions reach the caller with a note that names the factor.
        """
        gradient = self.gradient
        return _core.python_term(
            self.name,
            lambda Ts: self._called("log_density", self.log_density, Ts, part, finite=False),
            None if gradient is None else lambda Ts: self._called("gradient", gradient, Ts, part, finite=True),
            *self.steps,
            self.outlier_rate,
        )

    def _called(self, what: str, function: PoseFunction, Ts: Transforms, part: Part, *, finite: bool) -> FloatArray:
        """Call a function of the user and check its result.

        Raises:
            InputError: it returns no numbers, another number of them than poses, nan or inf.
        """
        try:
            found = function(Ts, part)
        except BaseException as error:
            error.add_note(f"This happened in {what} of the factor '{self.name}', for {len(Ts)} poses of {part.name}.")
            raise
        shape = (len(Ts), 6) if finite else (len(Ts),)
        try:
            values = np.asarray(found, dtype=np.float64)
        except (TypeError, ValueError):
            raise InputError(
                f"{self.name}: expected {what} to return an array {shape} of numbers, got {type(found).__name__}."
            ) from None
        if values.shape != shape:
            each = "six numbers" if finite else "one number"
            raise InputError(
                f"{self.name}: expected {what} to return {each} for each of {len(Ts)} poses, got shape {values.shape}."
            )
        wrong = ~np.isfinite(values) if finite else np.isnan(values) | (values == np.inf)
        if wrong.any():
            allowed = "finite numbers" if finite else "finite numbers or -inf"
            raise InputError(
                f"{self.name}: expected {what} to return {allowed}, got nan or inf for {int(np.sum(wrong))} of "
                f"{values.size} numbers."
            )
        return np.ascontiguousarray(values)
