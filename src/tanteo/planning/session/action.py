"""A question of a session: one reading, where from and which way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry import SE3, SO3
from tanteo.geometry.limits import LARGEST
from tanteo.geometry.typing import Transforms, Vectors
from tanteo.sensors import Readings
from tanteo.words import Finding

_BEYOND = 3.0
"""A finite distance of more than so many times the range is no reading of this sensor, but one of another unit."""


@dataclass(frozen=True, slots=True, eq=False)
class Action:
    """The next reading to make.

    Attributes:
        number: of the question, from 1.
        origin: from where to look or move, world ``(3,)`` [m].
        direction: in which, unit, world ``(3,)``.
        max_range: how far [m].
        expected: mean range from ``origin`` if the likeliest hypothesis is true [m].
        part: at which part it is aimed.
        face: at which of its faces.
        gain: what it is expected to tell [nats]; NaN where the policy does not ask.
        reason: why the policy chose it.
        radius: of the ball that touches [m]: the range is that of its centre; 0 for a point or beam.
        acquires: kind of the feature that a hand is to acquire whole, ``circle`` or ``cylinder``, whose name is then in
            ``face``; empty for one reading.

    Example:
        >>> import numpy as np
        >>> place = tanteo.around([tanteo.read_part("parts/wedge.step")], np.eye(4), np.diag([1e-4] * 3 + [1e-2] * 3))
        >>> session = tanteo.Session(place, tanteo.probe_of("keyence_il300"))
        >>> action = session.ask()
        >>> action.origin.shape, action.direction.shape
        ((3,), (3,))
    """

    number: int
    origin: Vectors
    direction: Vectors
    max_range: float
    expected: float
    part: str
    face: str
    gain: float
    reason: Finding
    radius: float = 0.0
    acquires: str = ""

    def __post_init__(self) -> None:
        if self.number < 1:
            raise InputError(f"question, number: expected 1 or more, got {self.number}. Correct it.")
        shapes = np.shape(self.origin) == np.shape(self.direction) == (3,)
        if not (shapes and np.isfinite(self.origin).all() and abs(np.linalg.norm(self.direction) - 1) < 1e-6):
            raise InputError(
                f"question {self.number}: expected a place and a unit direction, got {self.origin} and "
                f"{self.direction}. Correct it."
            )

        if not (0 < self.max_range <= LARGEST):
            got = f"got {self.max_range:g} m. Correct it."
            raise InputError(f"question {self.number}, max_range: expected a positive length, {got}")

    @property
    def T_world_probe(self) -> Transforms:
        """A pose of the probe ``(4, 4)`` that looks along its z; its turn about z is free."""
        return SE3.from_parts(SO3.frame_from_axis(self.direction, 2), self.origin)

    @property
    def name(self) -> str:
        """Of the reading that answers it."""
        return f"a{self.number}"

    @property
    def words(self) -> str:
        """One line for a person."""
        x, y, z = 1e3 * self.origin
        dx, dy, dz = self.direction
        if self.acquires:
            what = f"acquire {self.face} of {self.part} as a {self.acquires}"
            return f"From ({x:.1f}, {y:.1f}, {z:.1f}) mm in the world: {what}. {self.reason.message}"
        return (
            f"From ({x:.1f}, {y:.1f}, {z:.1f}) mm along ({dx:.3f}, {dy:.3f}, {dz:.3f}) in the world: {self.face} of "
            f"{self.part} is expected after {1e3 * self.expected:.1f} mm. {self.reason.message}"
        )

    def read(
        self, distance: float, sd: float | None = None, name: str | None = None, T_world_hand: Transforms | None = None
    ) -> Readings:
        """The reading of a beam or touch that met something after ``distance`` [m]; infinite: it met nothing.

        Args:
            distance: from ``origin`` along ``direction``, as measured, to where the centre of a ball stops; beyond
                ``max_range`` it met nothing, too.
            sd: of it [m], where the session's sensor does not say it.
            name: of the reading; that of the question by default.
            T_world_hand: pose of the hand ``(4, 4)`` at the reading; errors that turn with it, as that of its tip
                (``tip_sd``), need it.

        Raises:
            InputError: not a length, or several times ``max_range``, which may be one of another unit; or a feature is
                to be acquired whole.
        """
        if self.acquires:
            raise InputError(
                f"question {self.number}: expected the readings of {self.face}, acquired whole, got one distance. Tell "
                "the session what acquisition.sense_circle or sense_cylinder read."
            )
        if np.isnan(distance) or distance <= 0:
            raise InputError(f"distance: expected a positive length or infinity, got {distance}. Leave it out.")
        if self.max_range * _BEYOND < distance < np.inf:
            raise InputError(
                f"distance: expected metres, no more than {self.max_range:g}, or infinity where nothing was met, got "
                f"{distance:g}. Did you mean {1e-3 * distance:g}, that many millimetres?"
            )
        names, free = [name or self.name], not np.isfinite(distance)
        hands = None if T_world_hand is None else np.asarray(T_world_hand, dtype=np.float64)[None]
        if free or distance > self.max_range:
            return Readings.from_columns(
                self.origin[None], ids=names, directions=self.direction[None], is_free=np.array([True]),
                max_ranges=np.array([self.max_range]), Ts_world_hand=hands,
            )  # fmt: skip
        return Readings.from_columns(
            (self.origin + distance * self.direction)[None], ids=names, directions=self.direction[None],
            ranges=np.array([distance]), sds=None if sd is None else np.array([sd]), Ts_world_hand=hands,
            radii=np.array([self.radius]),
        )  # fmt: skip
