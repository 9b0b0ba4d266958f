"""What senses next, as far as choosing needs it: how far it reaches, how noisy it is, what it needs around it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tanteo.errors import InputError, check_kind
from tanteo.geometry.limits import LARGEST, LEAST_SD
from tanteo.geometry.typing import BoolArray, FloatArray, Vectors
from tanteo.hand import Workspace
from tanteo.sensors import NoiseLaw, RobotPreset, SensorPreset, robot_preset, sensor_preset

_POSITIVE = ("max_range", "standoff", "clearance", "retreat", "speed")
_NOT_NEGATIVE = (
    "beam_half_angle", "shared_sd", "repeat_sd", "base_sds", "farthest", "cone", "seconds", "min_range", "radius",
)  # fmt: skip
"""Numbers of a probe that have to be so."""


@dataclass(frozen=True, slots=True, eq=False)
class Probe:
    """A beam or a touch probe, its errors, and where it may be brought.

    Attributes:
        name: for people.
        law: standard deviation along the beam or motion, by range.
        beam_half_angle: of the cone [rad]; 0 for a touch or a thin beam.
        contact: it touches: its noise is the same in every direction.
        max_range: how far it reaches [m].
        min_range: nearer than this it does not answer [m].
        radius: of the ball at its tip [m]: what it reads is where the centre of the ball stops; 0 for a point or beam.
        max_incidence: angle to the surface's normal up to which it answers [rad].
        shared_sd: of the errors that its readings share, along the beam [m].
        repeat_sd: of the hand's place from reading to reading, in every direction [m].
        base_sds: of the robot's absolute error, which all readings share: place [m] and turn about the world's
            origin [rad], each axis.
        standoff: from where it starts to the surface that it is to meet [m]; with a stylus half of the way to the wall
            behind, where that is nearer, as in a bore.
        farthest: the most that this may be, where it may also start from farther off [m]; 0 where it may not.
        clearance: radius of the room that it needs about its start and on the straight way there [m].
        retreat: length of that way [m]: straight back from the start, or up the stylus, if it has one.
        approach: direction in which it may look or move, world ``(3,)``; None for any.
        cone: largest angle to ``approach`` [rad].
        workspace: where its start may be.
        stylus: direction from the ball of a touch probe to what holds it, world ``(3,)``, which the part must leave
            free all the way; None where nothing is known.
        stylus_behind: it is held from behind instead: back along each motion.
        speed: of travelling between readings [m/s].
        seconds: that one reading takes, beside travelling.

    Example:
        >>> probe = tanteo.probe_of("keyence_il300", standoff=0.3)
        >>> isinstance(probe, tanteo.Probe), probe.standoff
        (True, 0.3)
    """

    name: str
    law: NoiseLaw
    beam_half_angle: float = 0.0
    contact: bool = False
    max_range: float = 1.0
    max_incidence: float = np.radians(60.0)
    shared_sd: float = 0.0
    repeat_sd: float = 0.0
    base_sds: tuple[float, float] = (0.0, 0.0)
    standoff: float = 0.05
    farthest: float = 0.0
    clearance: float = 0.01
    retreat: float = 0.10
    approach: Vectors | None = None
    cone: float = np.pi
    stylus: Vectors | None = None
    stylus_behind: bool = False
    workspace: Workspace = field(default_factory=Workspace.everywhere)
    speed: float = 0.1
    seconds: float = 2.0
    min_range: float = 0.0
    radius: float = 0.0

    def __post_init__(self) -> None:
        for n in _POSITIVE:
            if not 0 < getattr(self, n) <= LARGEST:
                raise self._refused(n, f"a positive number up to {LARGEST:g}", f"{getattr(self, n):g}. Correct it")
        self._check_standoff()
        if not 0 < self.max_incidence < np.pi / 2:
            got = f"{np.degrees(self.max_incidence):g} deg. Correct it"
            raise self._refused("max_incidence", "an angle between 0 and 90 deg", got)
        self._check_law()
        for n in _NOT_NEGATIVE:
            if not np.all(np.isfinite(getattr(self, n)) & (np.array(getattr(self, n)) >= 0)):
                raise self._refused(n, "0 or more", f"{getattr(self, n)}. Correct it")
        self._check_ball()
        for n in ("approach", "stylus"):
            if getattr(self, n) is not None:
                object.__setattr__(self, n, self._direction(n))

    def _refused(self, field: str, expected: str, got: str) -> InputError:
        return InputError(f"probe '{self.name}', {field}: expected {expected}, got {got}.")

    def _check_standoff(self) -> None:
        """Whether it reads at its stand-off."""
        least, most, got = (f"{1e3 * v:g} mm" for v in (self.min_range, self.max_range, self.standoff))
        if self.standoff > self.max_range:
            raise self._refused("standoff", f"a stand-off within range, {most} at most", f"{got}. Start nearer")
        if self.standoff < self.min_range:
            raise self._refused("standoff", f"{least} or more, where it begins to read", f"{got}. Start farther off")

    def _check_law(self) -> None:
        """Whether its noise is that of one sensor, and one that readings can have."""
        if np.ndim(self.law.const) or np.ndim(self.law.sigma(np.asarray(self.standoff))):
            raise self._refused("law", "that of one sensor", "arrays. Give one number each")
        sd = float(self.law.sigma(np.asarray(self.standoff)))
        if not LEAST_SD <= sd <= LARGEST:
            expected = f"a standard deviation from {LEAST_SD:g} to {LARGEST:g} m"
            raise self._refused("law", expected, f"{sd:g}. Correct it")

    def _check_ball(self) -> None:
        """Whether there is room for its ball."""
        if self.radius >= self.standoff or self.radius > self.clearance:
            ball, standoff, clearance = (f"{1e3 * v:g} mm" for v in (self.radius, self.standoff, self.clearance))
            raise self._refused(
                "radius", "a ball smaller than the stand-off and no larger than the clearance",
                f"{ball} beside {standoff} and {clearance}. Give it more of both",
            )  # fmt: skip
        if self.radius > 0 and not self.contact:
            raise self._refused("radius", "none of a beam", "one. Say contact=True")

    def _direction(self, field: str) -> Vectors:
        """A field's direction, unit."""
        d = np.asarray(getattr(self, field), dtype=np.float64)
        if d.shape != (3,) or not (np.isfinite(d).all() and np.abs(d).max() > 0):
            raise self._refused(field, "a direction", f"{d.tolist()}")
        d = d if 1e-100 < np.abs(d).max() < 1e100 else d / np.abs(d).max()  # no square overflows
        if abs(np.linalg.norm(d) - 1) > 1e-12:  # a unit vector stays as it is, to the last bit
            d = d / np.linalg.norm(d)
        return np.asarray(d)

    @property
    def standoffs(self) -> FloatArray:
        """Distances from which it may start, evenly spread from the nearest to the farthest ``(n,)`` [m]."""
        return np.linspace(self.standoff, max(self.standoff, self.farthest), 3 if self.farthest > self.standoff else 1)

    def variance(self, ranges: FloatArray, cosines: FloatArray) -> FloatArray:
        """Variance of what it reads along its beam, errors that its readings share included [m^2].

        Args:
            ranges: true ones ``(*batch)`` [m].
            cosines: of the incidence, positive ``(*batch)``.
        """
        return self.own_variance(ranges, cosines) + self.shared_variance(cosines)

    def shared_variance(self, cosines: FloatArray) -> FloatArray:
        """The part of it that its readings share."""
        return np.asarray(self.shared_sd**2 + (self.base_sds[0] / cosines) ** 2)

    def short(self, cosines: FloatArray) -> FloatArray:
        """By how much the centre of its ball stops short of a plane, along the approach [m]; 0 for a miss."""
        return np.asarray(self.radius / np.where(cosines > 0, cosines, 1.0) * (cosines > 0))

    def own_variance(self, ranges: FloatArray, cosines: FloatArray) -> FloatArray:
        """The part of it that is new at every reading."""
        along, repeat2 = self.law.sigma(ranges) ** 2, self.repeat_sd**2
        if self.contact:
            return np.asarray((along + repeat2) / cosines**2)
        return np.asarray(along + self.cone_variance(ranges, cosines) + repeat2 / cosines**2)

    def cone_variance(self, ranges: FloatArray, cosines: FloatArray) -> FloatArray:
        """What the cone adds to it on a plane, as the echo comes from any of its rays."""
        return np.asarray((0.5 * self.beam_half_angle * ranges) ** 2 * (1 / cosines**2 - 1))

    def answers(self, ranges: FloatArray, cosines: FloatArray) -> BoolArray:
        """Whether there is a reading at these ranges and incidences."""
        within = (ranges >= self.min_range) & (ranges <= self.max_range)
        return np.asarray(within & (cosines >= np.cos(self.max_incidence)))


def probe_of(preset: SensorPreset | str | float, robot: RobotPreset | str | None = None, **where: object) -> Probe:
    """The probe of a sensor's preset on a robot; ``where`` are further fields of :class:`Probe`.

    Args:
        preset: the sensor, or its name; or one standard deviation of its readings [m], and nothing else is known of it.
        robot: its errors, or its name; none are assumed without it.
        where: standoff, clearance, approach, workspace and so on.

    Raises:
        InputError: a stand-off at which the sensor reads nothing yet.

    Example:
        >>> tanteo.probe_of("keyence_il300", robot="calibrated_small").name
        'keyence_il300'
    """
    preset = sensor_preset(preset) if isinstance(preset, str) else preset
    robot = robot_preset(robot) if isinstance(robot, str) else robot
    errors: dict[str, object] = {
        "repeat_sd": 0.0 if robot is None else robot.pos_repeat_std,
        "base_sds": (0.0, 0.0) if robot is None else (robot.pos_abs_std, robot.rot_abs_std),
    }
    if isinstance(preset, float):
        values = {"name": f"sd {1e3 * preset:g} mm", "law": NoiseLaw.of(preset), **errors}
        return Probe(**(values | where))  # type: ignore[arg-type]
    check_kind("preset", preset, (SensorPreset, str), "Name one of tanteo.sensors.sensor_presets().")
    far = 0.3 if preset.is_contact else preset.max_range
    standoff = min(0.05, far) if preset.is_contact else float(np.clip(0.05, 1.2 * preset.min_range, 0.8 * far))
    standoff = float(where.get("standoff", standoff))  # type: ignore[arg-type]
    values = {
        "name": preset.name, "law": preset.law, "contact": preset.is_contact, "max_range": far,
        "min_range": 0.0 if preset.is_contact else preset.min_range,
        "beam_half_angle": float(np.nan_to_num(preset.beam_half_angle)),
        "max_incidence": min(preset.max_incidence, np.radians(80.0)),
        "shared_sd": float(np.hypot(preset.bias_std, preset.bias_prop_std * standoff)),
        "standoff": standoff, **errors,
    }  # fmt: skip
    return Probe(**(values | where))  # type: ignore[arg-type]
