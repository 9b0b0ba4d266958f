"""Action of a session: one reading to make, with its start and its direction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry import SE3, SO3
from tanteo.geometry.limits import LARGEST
from tanteo.geometry.typing import Transforms, Vectors
from tanteo.sensors import Readings
from tanteo.values import Value, lock
from tanteo.words import Finding

_BEYOND = 3.0
"""Multiple of the largest range beyond which a finite distance is probably a value in another unit."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Action(Value):
    """Next reading to make.

    Attributes:
        number: number of the action, from 1.
        origin: start of the beam or the motion, world frame ``(3,)`` [m].
        direction: unit direction of the beam or motion, world frame ``(3,)``.
        max_range: largest range [m].
        expected: range from ``origin`` that is expected if the most probable hypothesis is true [m].
        part: name of the part of that hypothesis.
        face: name of the face of that part that the reading senses then.
        gain: expected information [nats]; NaN if the policy does not compute it.
        reason: reason of the choice, for the user.
        radius: radius of the ball of a touch probe [m]; ranges are those of its centre. It is 0 for a point or a beam.
        acquires: kind of the feature that a hand must acquire completely, ``circle`` or ``cylinder``; its name is in
            ``face`` then. Empty for a single reading.
        unlikely: whether the most probable hypothesis expects no contact; ``part``, ``face`` and ``expected`` are those
            of a less probable one then.

    Example:
        >>> import numpy as np
        >>> place = tanteo.at_place([tanteo.read_part("parts/wedge.step")], np.eye(4), np.diag([1e-4] * 3 + [1e-2] * 3))
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
    unlikely: bool = False

    def __post_init__(self) -> None:
        if self.number < 1:
            raise InputError(f"action, number: expected 1 or more, got {self.number}. Correct it.")
        shapes = np.shape(self.origin) == np.shape(self.direction) == (3,)
        if not (shapes and np.isfinite(self.origin).all() and abs(np.linalg.norm(self.direction) - 1) < 1e-6):
            raise InputError(
                f"action {self.number}: expected an origin and a unit direction, got {self.origin} and "
                f"{self.direction}. Correct it."
            )

        if not (0 < self.max_range <= LARGEST):
            got = f"got {self.max_range:g} m. Correct it."
            raise InputError(f"action {self.number}, max_range: expected a positive length, {got}")
        lock(self)

    @property
    def T_world_probe(self) -> Transforms:
        """Pose of the probe ``(4, 4)``: origin at the start, z along the beam, arbitrary rotation about z."""
        return SE3.from_parts(SO3.frame_from_axis(self.direction, 2), self.origin)

    @property
    def name(self) -> str:
        """Name of the reading that the action makes, ``a1`` for the first."""
        return f"a{self.number}"

    @property
    def aim(self) -> str:
        """Name of the expected face and part, with a remark if they are not the most probable ones."""
        return f"{self.face} of {self.part}{' (if it is there)' if self.unlikely else ''}"

    @property
    def words(self) -> str:
        """Description of the action for the user, one line."""
        x, y, z = 1e3 * self.origin
        dx, dy, dz = self.direction
        if self.acquires:
            what = f"acquire {self.face} of {self.part} as a {self.acquires}"
            return f"From ({x:.1f}, {y:.1f}, {z:.1f}) mm in the world: {what}. {self.reason.message}"
        return (
            f"From ({x:.1f}, {y:.1f}, {z:.1f}) mm along ({dx:.3f}, {dy:.3f}, {dz:.3f}) in the world: {self.aim} is "
            f"expected after {1e3 * self.expected:.1f} mm. {self.reason.message}"
        )

    def read(
        self, distance: float, sd: float | None = None, name: str | None = None, T_world_hand: Transforms | None = None
    ) -> Readings:
        """Return the reading that results from a measured distance.

        Args:
            distance: measured distance from ``origin`` along ``direction`` to the centre of the stopped ball [m].
                Infinity, or more than ``max_range``, means that nothing was hit.
            sd: standard deviation of the distance [m]; None for the noise of the session's sensor.
            name: name of the reading; None for the name of the action.
            T_world_hand: pose of the hand ``(4, 4)`` at the reading; errors in the frame of the hand, such as
                ``tip_sd``, need it.

        Raises:
            InputError: the distance is not positive, it is several times ``max_range`` (another unit), or the action
                acquires a complete feature.
        """
        if self.acquires:
            raise InputError(
                f"action {self.number}: expected the readings of all of {self.face}, got one distance. Give the "
                "session the readings of sense_circle or sense_cylinder."
            )
        if np.isnan(distance) or distance <= 0:
            raise InputError(f"distance: expected a positive length or infinity, got {distance}. Omit it.")
        if self.max_range * _BEYOND < distance < np.inf:
            raise InputError(
                f"distance: expected at most {self.max_range:g} m, or infinity if nothing was hit, got "
                f"{distance:g} m. Did you mean {1e-3 * distance:g} m, with the number in millimetres?"
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
