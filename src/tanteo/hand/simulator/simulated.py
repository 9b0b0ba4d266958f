"""Simulated robot hand with velocity commands and ray-cast ranges; it implements :class:`~tanteo.hand.Robot`."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry import SE3
from tanteo.geometry.typing import FloatArray, Tangents, Transforms, Vectors
from tanteo.hand.robot import FREE, HIT, LOST, NEAR, Hand, HandReading
from tanteo.hand.simulator.scene import Scene
from tanteo.hand.twists import advance
from tanteo.sensors import error_model
from tanteo.sensors.emission import Status, draw_base, draw_units, emit
from tanteo.sensors.noise import blend, cone_rays, draw_aims
from tanteo.sensors.presets import RobotPreset

_BLOCK = 256
"""Number of readings whose ray directions are drawn at once."""

_STATES = np.zeros(len(Status), dtype=np.int64)
_STATES[[Status.OK, Status.NONE, Status.NEAR, Status.OBLIQUE]] = HIT, FREE, NEAR, LOST


@dataclass(frozen=True, slots=True)
class Cell:
    """Settings of the simulated robot.

    Attributes:
        period: time between two commands, and between two readings [s].
        latency: time from a command to its motion [s]; any value, not only multiples of the period.
        max_speed: limit of the speed of the hand's origin [m/s]; a faster twist is scaled down as a whole.
        max_turn: limit of the hand's angular speed [rad/s]; a faster twist is scaled down as a whole.
        robot: error model of the reported pose; no errors if None.
        cone: number of rays that sample each beam's cone and are blended into one range. With 0, one random ray of the
            cone is cast per reading, as :func:`~tanteo.sensors.measure` assumes.
    """

    period: float = 0.01
    latency: float = 0.03
    max_speed: float = 0.25
    max_turn: float = 1.5
    robot: RobotPreset | None = None
    cone: int = 0

    def __post_init__(self) -> None:
        for name in ("period", "max_speed", "max_turn"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise InputError(f"{name}: expected a positive number, got {getattr(self, name):g}. Correct it.")
        if not (0 <= self.latency <= 10) or self.cone < 0:
            raise InputError(
                f"latency, cone: expected a latency of 0 to 10 s and no negative number of rays, got "
                f"{self.latency:g} s and {self.cone}. Correct them."
            )


class Carrier(Protocol):
    """Interface of what moves the hand, such as the joints of an arm."""

    def carry(self, T_world_hand: Transforms, twist: Tangents, seconds: float) -> Transforms:
        """Move the hand by a twist for a time and return its new pose ``(4, 4)``.

        Args:
            T_world_hand: present pose ``(4, 4)``.
            twist: velocity ``[v, w]`` in the hand frame [m/s, rad/s].
            seconds: duration.
        """
        ...


class SimulatedHand:
    """Simulated robot hand in a scene, with state: pose, pending commands and drawn errors.

    Constant errors (bias, scale and mounting of every sensor, the robot's absolute error) are drawn once on creation;
    the others are drawn at every reading. The same seed and commands give the same run.

    Args:
        scene: solids of the cell.
        hand: sensors and body of the hand.
        T_world_hand: true initial pose ``(4, 4)``.
        rng: random generator of all errors.
        cell: settings of the robot; the defaults if None.
        carrier: what moves the hand; without one every twist is carried out.

    Attributes:
        truth: true pose of the hand at every reading, ``(4, 4)`` each.
        carrier: what moves the hand; None if every twist is carried out.
    """

    def __init__(
        self,
        scene: Scene,
        hand: Hand,
        T_world_hand: Transforms,
        *,
        rng: np.random.Generator,
        cell: Cell | None = None,
        carrier: Carrier | None = None,
    ) -> None:
        self.carrier, self._carry = carrier, advance if carrier is None else carrier.carry
        self._scene, self._hand, self._cell = scene, hand, cell or Cell()
        self._rng, self._time = rng, 0.0
        self._model = error_model(hand.rig)
        self._units = draw_units(rng, self._model)
        robot = self._cell.robot
        base = np.zeros(6) if robot is None else draw_base(rng, robot)
        self._base = SE3.exp(base)
        self._T = SE3.inverse(self._base) @ np.array(T_world_hand, dtype=np.float64)
        T = self._units.T_hand_sensors
        self._origins, self._axes = T[:, :3, 3], T[:, :3, :3]
        self._rays = self._filled() if self._cell.cone else None
        whole = math.floor(self._cell.latency / self._cell.period + 1e-9)
        self._late = self._cell.latency - whole * self._cell.period
        # while a period begins, the hand still follows the oldest command for the fractional part of the latency
        self._commands: deque[Tangents] = deque([np.zeros(6)] * (whole + 1), maxlen=whole + 2)
        self._aims, self._next = np.zeros((0, len(hand.origins), 3)), 0
        self._beams = self._aims
        self.truth: list[Transforms] = []
        self._sensed = self._sense()

    @property
    def hand(self) -> Hand:
        """Return the hand that the robot carries."""
        return self._hand

    @property
    def period(self) -> float:
        """Return the time between two commands [s]."""
        return self._cell.period

    @property
    def latency(self) -> float:
        """Return the time from a command to its motion [s]."""
        return self._cell.latency

    @property
    def sensed(self) -> HandReading:
        """Return the most recent reading."""
        return self._sensed

    def step(self, twist: Tangents) -> HandReading:
        """Command a twist for one period and return the reading at its end; the hand follows after the latency.

        Args:
            twist: velocity ``[v, w]`` in the hand frame [m/s, rad/s].

        Raises:
            InputError: The command is not six finite numbers.
        """
        self._commands.append(self._limited(twist))
        if self._late > 0:
            self._T = self._carry(self._T, self._commands[0], self._late)
        self._T = self._carry(self._T, self._commands[1], self._cell.period - self._late)
        self._time += self._cell.period
        self._sensed = self._sense()
        return self._sensed

    def _limited(self, twist: Tangents) -> Tangents:
        vx, vy, vz, wx, wy, wz = np.asarray(twist, dtype=np.float64).tolist()
        speed, turn = math.sqrt(vx * vx + vy * vy + vz * vz), math.sqrt(wx * wx + wy * wy + wz * wz)
        if not math.isfinite(speed + turn):
            raise InputError(f"twist: expected six finite numbers, got {np.asarray(twist).tolist()}. Command zero.")
        excess = max(speed / self._cell.max_speed, turn / self._cell.max_turn, 1.0)
        return np.array([vx, vy, vz, wx, wy, wz]) / excess

    def _sense(self) -> HandReading:
        T_true, robot = self._base @ self._T, self._cell.robot
        if robot is not None:
            # the robot reports its nominal pose; the true pose differs by the repeatability
            repeat = np.repeat([robot.pos_repeat_std, robot.rot_repeat_std], 3) * self._rng.standard_normal(6)
            T_true = advance(T_true, repeat, 1.0)
        self.truth.append(T_true)
        ranges, incidences, aims = self._measure(T_true)
        reported, statuses = emit(self._rng, self._model, self._units, ranges, incidences, aims)
        return HandReading(self._time, self._T, reported, _STATES[statuses])

    def _measure(self, T: Transforms) -> tuple[FloatArray, FloatArray, Vectors | None]:
        """Return true ranges, incidence angles and the drawn ray directions (None where cones are sampled)."""
        Rt = T[:3, :3].T
        starts = self._origins @ Rt + T[:3, 3]
        if self._rays is not None:
            return *self._measure_cones(starts, self._rays @ Rt), None
        aims, beams = self._aim()
        return *self._cast(starts, beams @ Rt), aims

    def _aim(self) -> tuple[Vectors, Vectors]:
        """Return the next drawn ray directions in the sensor frames and in the hand frame, ``(k, 3)`` each."""
        if self._next >= len(self._aims):
            self._aims = draw_aims(self._rng, self._model.beam_half_angle, (_BLOCK,))
            self._beams, self._next = np.einsum("kij,nkj->nki", self._axes, self._aims), 0
        self._next += 1
        return self._aims[self._next - 1], self._beams[self._next - 1]

    def _cast(self, starts: Vectors, rays: Vectors) -> tuple[FloatArray, FloatArray]:
        distances, triangles = self._scene.surface.cast_unit(starts, rays)
        cosines = np.abs(np.einsum("ij,ij->i", self._scene.surface.normals[triangles], rays))
        return distances, np.arccos(np.minimum(cosines, 1.0))

    def _filled(self) -> Vectors:
        rays = cone_rays(self._model.beam_half_angle, self._cell.cone)
        return np.einsum("kij,knj->kni", self._axes, rays)

    def _measure_cones(self, starts: Vectors, rays: Vectors) -> tuple[FloatArray, FloatArray]:
        k, n = rays.shape[:2]
        flat, oblique = self._cast(np.repeat(starts, n, axis=0), rays.reshape(k * n, 3))
        within = np.where(flat <= np.repeat(self._model.max_range, n), flat, np.inf).reshape(k, n)
        return blend(within)[0], np.asarray(np.median(oblique.reshape(k, n), axis=1))
