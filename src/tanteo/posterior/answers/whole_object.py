"""Global properties of the object: its mass, the sides of its bounding box, its outline in an image.

Each enters as a likelihood: a part that differs is less probable, never impossible.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry.limits import check_number
from tanteo.geometry.typing import FloatArray
from tanteo.posterior.answers.seen_outline import MISLEADING, SeenOutline
from tanteo.posterior.settings import DEFAULTS
from tanteo.words.findings import WholeMismatch

_MADE = 0.01
"""Relative standard deviation of a made part's volume from its CAD, which lacks chamfers, threads and coatings."""


@dataclass(frozen=True, slots=True)
class WholeObject:
    """Measurements of the whole object.

    Attributes:
        mass: mass and its standard deviation [kg]; None if it was not weighed.
        density: density of the material and its standard deviation [kg/m^3]; needed with a mass.
        sides: sides of the smallest box around the object, in any order [m]; None if they were not measured.
        side_sd: standard deviation of each side [m].
        outline: outline of the object on a table in a camera image; None without one.

    Raises:
        InputError: a number that is not positive, a mass without a density, or sides without a standard deviation.

    Example:
        >>> from tanteo.posterior.answers.whole_object import WholeObject
        >>> WholeObject(mass=(0.34, 0.005), density=(2700.0, 50.0)).volume
        0.00012592592592592592
    """

    mass: tuple[float, float] | None = None
    density: tuple[float, float] | None = None
    sides: tuple[float, float, float] | None = None
    side_sd: float = 0.0
    outline: SeenOutline | None = None

    def __post_init__(self) -> None:
        for name in ("mass", "density"):
            for value in getattr(self, name) or ():
                _positive(name, value)
        if self.mass is not None and self.density is None:
            raise InputError("mass: expected the density of the material, too, got none. Add --density 7.85g/cm3+-1%.")
        for value in (*(self.sides or ()), *((self.side_sd,) if self.sides else ())):
            _positive("size", value)

    @property
    def volume(self) -> float | None:
        """Return the volume that the mass implies [m^3]; None without a mass."""
        return self.mass[0] / self.density[0] if self.mass and self.density else None

    def log_odds(self, volumes: FloatArray, boxes: FloatArray) -> FloatArray:
        """Return log odds of parts against an unknown object by mass and sides ``(n,)``.

        The unknown object may have any size between those of the parts, or somewhat beyond. The outline is compared
        separately (:meth:`SeenOutline.log_odds`), because it needs hulls and not only sizes.

        Args:
            volumes: volumes of the parts ``(n,)`` [m^3]; 0 for an open mesh, which no mass can contradict.
            boxes: sides of their boxes ``(n, 3)`` [m].
        """
        out, known = np.zeros(len(volumes)), volumes > 0
        if self.volume is not None and known.any():
            out[known] += self._of_volume(volumes[known], self._relative_sd)
        if self.sides is not None:
            sides = np.sort(np.asarray(self.sides))
            off = (np.sort(boxes, axis=1) - sides) / self.side_sd
            log = np.sum(-0.5 * off**2 - 0.5 * np.log(2 * np.pi), axis=1) - 3 * np.log(self.side_sd)
            out += _with_misleading(log + 3 * np.log(2 * float(boxes.max())))
        return out

    def mismatch(
        self, name: str, volume: float, sides: FloatArray, gate: float = DEFAULTS.search.gate
    ) -> WholeMismatch | None:
        """Return the finding that mass or sides contradict a part; None if they agree.

        Args:
            name: name of the part.
            volume: volume of the part [m^3]; 0 for an open mesh.
            sides: sides of its box ``(3,)`` [m].
            gate: deviation from which a measurement contradicts the part [standard deviations].
        """
        volumes: tuple[float, ...] = ()
        boxes: tuple[tuple[float, ...], ...] = ()
        if self.volume is not None and volume > 0 and abs(np.log(self.volume / volume)) > gate * self._relative_sd:
            volumes = self.volume, float(volume)
        if self.sides is not None and np.abs(np.sort(sides) - np.sort(self.sides)).max() > gate * self.side_sd:
            boxes = tuple(tuple(map(float, np.sort(box)[::-1])) for box in (self.sides, sides))
        return WholeMismatch(name, volumes, boxes) if volumes or boxes else None

    @property
    def _relative_sd(self) -> float:
        """Return the relative standard deviation of the volume that the mass implies."""
        (mass, mass_sd), (density, density_sd) = self.mass or (1.0, 0.0), self.density or (1.0, 0.0)
        return float(np.hypot(np.hypot(mass_sd / mass, density_sd / density), _MADE))

    def _of_volume(self, volumes: FloatArray, sd: float) -> FloatArray:
        logs = np.log(volumes)
        extent = float(np.ptp(logs)) + 2 * np.log(2.0)
        off = (logs - np.log(self.volume or 1.0)) / sd
        return _with_misleading(-0.5 * off**2 - np.log(np.sqrt(2 * np.pi) * sd) + np.log(extent))


def _with_misleading(log: FloatArray) -> FloatArray:
    """Return log odds if a fraction of the measurements describes another object."""
    return np.asarray(np.logaddexp(np.log1p(-MISLEADING) + log, np.log(MISLEADING)))


def _positive(name: str, value: float) -> None:
    check_number(name, value)
    if not value > 0 or not np.isfinite(value):
        raise InputError(f"{name}: expected positive numbers, got {value}. Check it.")
