"""Sensor model for planning: noise, measuring range, and clearance and limits of the approach."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tanteo.errors import InputError, check_kind
from tanteo.geometry import SO3
from tanteo.geometry.limits import LARGEST, LEAST_SD
from tanteo.geometry.typing import BoolArray, FloatArray, Vectors
from tanteo.hand import Body, Workspace
from tanteo.parts import Surface
from tanteo.sensors.error_states import made_surface
from tanteo.sensors.presets import NoiseLaw, RobotPreset, SensorPreset, robot_preset, sensor_preset
from tanteo.values import Value, lock

_POSITIVE = ("max_range", "standoff", "clearance", "retreat", "speed")
_NOT_NEGATIVE = (
    "beam_half_angle", "shared_sd", "repeat_sd", "base_sds", "farthest", "cone", "seconds", "min_range", "radius",
    "form_sd", "tilt",
)  # fmt: skip
"""Fields of a probe that must not be negative."""

_UP = np.array([0.0, 0.0, 1.0])
"""Direction from the ball to the holder of an upright tool."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Probe(Value):
    """Model of a beam or a touch probe, its errors, and the limits of its approach.

    Attributes:
        name: name of the sensor for messages.
        law: standard deviation along the beam or motion as a function of the range.
        beam_half_angle: half angle of the beam's cone [rad]; 0 for a touch or a thin beam.
        contact: whether the sensor touches the part; its noise is isotropic then.
        max_range: largest range [m].
        max_incidence: largest angle between beam and surface normal with an echo [rad].
        shared_sd: standard deviation of the errors that all readings share, along the beam [m].
        repeat_sd: repeatability of the hand's position, standard deviation in every direction [m].
        base_sds: standard deviations of the robot's absolute error, which all readings share: along each axis [m] and
            about each axis through the world's origin [rad].
        standoff: distance of the start from the surface [m]. With a stylus it is at most half of the distance to an
            opposite wall, as in a bore.
        farthest: largest stand-off, if the probe may also start farther away than ``standoff`` [m]; otherwise 0.
        clearance: radius of the free space around the start and the approach path [m].
        retreat: length of the approach path [m], straight back from the start, or along the stylus if there is one.
        approach: middle direction of beams or motions, world frame ``(3,)``; None for any direction.
        cone: largest angle to ``approach`` [rad].
        stylus: direction from the ball of a touch probe to its holder, world frame ``(3,)``. The stylus must not
            touch the part. None if the direction is unknown.
        stylus_along_motion: whether the stylus points backward along each motion; ``stylus`` is None then.
        workspace: bounds of the probe's positions, and forbidden boxes.
        speed: speed of travel between readings [m/s].
        seconds: duration of one reading without travel [s].
        min_range: smallest range with an echo [m].
        radius: radius of the ball at its tip [m]; a reading is the centre of the stopped ball. It is 0 for a point or a
            beam.
        form_sd: standard deviation of the made part's surface from its CAD [m], mostly common to a face; see
            :func:`tanteo.sensors.error_states.made_surface`.
        tilt: largest angle between the holder of a stylus that points along the motion and the vertical [rad].
        axis_parallel: whether motions are parallel to an axis of the world, as those of a milling machine.
        body: spheres of stylus and tool, in the frame of the probe: origin at the ball's centre, z along the stylus,
            away from the holder. None for the stylus and the clearance alone.
        obstacles: known surfaces in the world, such as a fixture, of which the approach must be clear.

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
    stylus_along_motion: bool = False
    workspace: Workspace = field(default_factory=Workspace.everywhere)
    speed: float = 0.1
    seconds: float = 2.0
    min_range: float = 0.0
    radius: float = 0.0
    form_sd: float = 0.0
    tilt: float = np.pi
    axis_parallel: bool = False
    body: Body | None = None
    obstacles: tuple[Surface, ...] = ()

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
        lock(self)

    def _refused(self, field: str, expected: str, got: str) -> InputError:
        return InputError(f"probe '{self.name}', {field}: expected {expected}, got {got}.")

    def _check_standoff(self) -> None:
        """Check that the stand-off is within the measuring range."""
        least, most, got = (f"{1e3 * v:g} mm" for v in (self.min_range, self.max_range, self.standoff))
        if self.standoff > self.max_range:
            raise self._refused("standoff", f"at most {most}, the largest range of the sensor", f"{got}. Start nearer")
        if self.standoff < self.min_range:
            raise self._refused(
                "standoff", f"{least} or more, the smallest range of the sensor", f"{got}. Start farther away"
            )

    def _check_law(self) -> None:
        """Check that the noise law belongs to one sensor and has a plausible size."""
        if np.ndim(self.law.const) or np.ndim(self.law.sigma(np.asarray(self.standoff))):
            raise self._refused("law", "the law of one sensor", "arrays. Give one number for each field")
        sd = float(self.law.sigma(np.asarray(self.standoff)))
        if not LEAST_SD <= sd <= LARGEST:
            expected = f"a standard deviation from {LEAST_SD:g} to {LARGEST:g} m"
            raise self._refused("law", expected, f"{sd:g}. Correct it")

    def _check_ball(self) -> None:
        """Check that the ball fits into stand-off and clearance."""
        if self.radius >= self.standoff or self.radius > self.clearance:
            ball, standoff, clearance = (f"{1e3 * v:g} mm" for v in (self.radius, self.standoff, self.clearance))
            raise self._refused(
                "radius", "a ball smaller than the stand-off and no larger than the clearance",
                f"{ball} with a stand-off of {standoff} and a clearance of {clearance}. Increase both",
            )  # fmt: skip
        if self.radius > 0 and not self.contact:
            raise self._refused("radius", "0 for a beam", "a ball. Use contact=True")

    def _direction(self, field: str) -> Vectors:
        """Return the direction of a field as a unit vector."""
        d = np.asarray(getattr(self, field), dtype=np.float64)
        if d.shape != (3,) or not (np.isfinite(d).all() and np.abs(d).max() > 0):
            raise self._refused(field, "a direction", f"{d.tolist()}")
        d = d if 1e-100 < np.abs(d).max() < 1e100 else d / np.abs(d).max()  # no square overflows
        if abs(np.linalg.norm(d) - 1) > 1e-12:  # a unit vector keeps all its bits
            d = d / np.linalg.norm(d)
        return np.asarray(d)

    def holders(self, directions: Vectors) -> Vectors:
        """Return the unit directions from the ball to its holder for motions along given directions ``(C, 3)``.

        Args:
            directions: unit directions of the motions, world frame ``(C, 3)``.
        """
        if self.stylus is not None:
            return np.broadcast_to(self.stylus, directions.shape)
        return nearest_in_cone(-directions, _UP, self.tilt)

    @property
    def standoffs(self) -> FloatArray:
        """Possible stand-offs, evenly spread from the nearest to the farthest ``(n,)`` [m]."""
        return np.linspace(self.standoff, max(self.standoff, self.farthest), 3 if self.farthest > self.standoff else 1)

    def variance(self, ranges: FloatArray, cosines: FloatArray) -> FloatArray:
        """Return the variance of a reading along its beam, with the errors that readings share [m^2].

        Args:
            ranges: true ranges ``(*batch,)`` [m].
            cosines: cosines of the incidence, positive ``(*batch,)``.
        """
        return self.own_variance(ranges, cosines) + self.shared_variance(cosines)

    def shared_variance(self, cosines: FloatArray) -> FloatArray:
        """Return the variance of the errors that all readings share, along the beam [m^2].

        Args:
            cosines: cosines of the incidence, positive ``(*batch,)``.
        """
        return np.asarray(self.shared_sd**2 + (self.base_sds[0] ** 2 + self.face_variance) / cosines**2)

    @property
    def face_variance(self) -> float:
        """Variance of the offset of each face of the made part, along its normal [m^2]."""
        return float(sum(one.sd**2 for one in made_surface(self.form_sd)[0]))

    def short(self, cosines: FloatArray) -> FloatArray:
        """Return the distance from the centre of the stopped ball to the surface along the approach [m].

        Args:
            cosines: cosines of the incidence ``(*batch,)``; for a miss they are 0, and so is the distance.
        """
        return np.asarray(self.radius / np.where(cosines > 0, cosines, 1.0) * (cosines > 0))

    def own_variance(self, ranges: FloatArray, cosines: FloatArray) -> FloatArray:
        """Return the variance of the errors that are independent between readings, along the beam [m^2].

        Args:
            ranges: true ranges ``(*batch,)`` [m].
            cosines: cosines of the incidence, positive ``(*batch,)``.
        """
        along, repeat2 = self.law.sigma(ranges) ** 2, self.repeat_sd**2 + made_surface(self.form_sd)[1] ** 2
        if self.contact:
            return np.asarray((along + repeat2) / cosines**2)
        return np.asarray(along + self.cone_variance(ranges, cosines) + repeat2 / cosines**2)

    def cone_variance(self, ranges: FloatArray, cosines: FloatArray) -> FloatArray:
        """Return the variance of the range on a plane because the echo may come from any ray of the cone [m^2].

        Args:
            ranges: true ranges along the axis ``(*batch,)`` [m].
            cosines: cosines of the incidence, positive ``(*batch,)``.
        """
        return np.asarray((0.5 * self.beam_half_angle * ranges) ** 2 * (1 / cosines**2 - 1))

    def answers(self, ranges: FloatArray, cosines: FloatArray) -> BoolArray:
        """Return whether the sensor returns a value, which needs an allowed range and incidence ``(*batch,)``.

        Args:
            ranges: true ranges ``(*batch,)`` [m].
            cosines: cosines of the incidence ``(*batch,)``.
        """
        within = (ranges >= self.min_range) & (ranges <= self.max_range)
        return np.asarray(within & (cosines >= np.cos(self.max_incidence)))


def nearest_in_cone(directions: Vectors, axis: Vectors, angle: float) -> Vectors:
    """Return the unit directions within a cone that are nearest to given ones ``(C, 3)``.

    Args:
        directions: unit directions ``(C, 3)``.
        axis: unit axis of the cone ``(3,)``.
        angle: half angle of the cone [rad].
    """
    along = directions @ axis
    across = directions - along[:, None] * axis
    length = np.linalg.norm(across, axis=1, keepdims=True)
    beside = SO3.frame_from_axis(axis, 2)[:, 0]  # opposite to the axis, all directions on the cone are equally near
    across = np.where(length > 1e-9, across, beside)
    length = np.where(length > 1e-9, length, 1.0)
    edge = np.cos(angle) * axis + np.sin(angle) * across / length
    return np.where((along >= np.cos(angle))[:, None], directions, edge)


def probe_of(preset: SensorPreset | str | float, robot: RobotPreset | str | None = None, **where: object) -> Probe:
    """Return the sensor model for planning of a sensor preset that a robot carries.

    Args:
        preset: sensor preset or its name, or only the standard deviation of the readings [m].
        robot: robot preset or its name; None for an exact robot.
        where: other fields of :class:`Probe`, such as standoff, clearance, approach and workspace.

    Raises:
        InputError: a field is invalid, such as a stand-off out of the sensor's range.

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
    check_kind("preset", preset, (SensorPreset, str), "Name one of tanteo.sensors.presets.sensor_presets().")
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
