"""Model zero errors of a robot's joints as errors that readings share.

A zero error turns everything beyond its joint about the joint's axis: ``dp = dq a x (p - o)`` for a point ``p``, with
the axis ``a`` through ``o``. The axes at a reading follow from the joint angles, which are those that give the reported
pose of the hand (Newton's method from stated angles). The model is the product of exponentials of its joints; a URDF or
a table of Denavit and Hartenberg states it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import FloatArray, Transforms
from tanteo.sensors.error_states import Columns, ErrorState, Sensed

_STEPS, _ROUNDS = 20, 3
"""Numerical: Newton steps from one start, and rounds in which unsolved poses start from solved neighbours."""
_LONGEST = 0.5
"""Numerical: largest change of a joint in one step [rad]."""
_REACHED = 1e-6
"""Numerical: residual of a pose that counts as reached [m, rad]."""
_DAMPING = 1e-8
"""Numerical: damping of Newton's method, relative to squared lengths in metres."""
_ARM = 0.3
"""Numerical: length by which an angle is compared with a displacement in the distance of two poses [m/rad]."""


@dataclass(frozen=True, slots=True, eq=False)
class JointChain:
    """Serial chain of joints from the robot's base to the frame that the controller reports as the hand.

    Attributes:
        names: names of the joints ``(d,)``.
        before: fixed transform before each joint, which then turns about its z axis or slides along it ``(d, 4, 4)``.
        turns: mask of the joints that turn ``(d,)``.
        after: fixed transform from the last joint to the hand ``(4, 4)``.
        source: file, for messages.
    """

    names: tuple[str, ...]
    before: Transforms
    turns: np.ndarray
    after: Transforms
    source: str = "arm"
    _last: dict[bytes, tuple[FloatArray, FloatArray]] = field(default_factory=dict, init=False, repr=False)

    def frames(self, q: FloatArray) -> tuple[Transforms, Transforms]:
        """Return the frames of the joints ``(n, d, 4, 4)`` and the pose of the hand ``(n, 4, 4)`` in the base.

        Args:
            q: joint values ``(n, d)`` [rad or m].
        """
        T = np.broadcast_to(np.eye(4), (len(q), 4, 4))
        frames = []
        for k in range(len(self.names)):
            T = T @ self.before[k]
            frames.append(T)
            step = np.zeros((len(q), 6))
            step[:, 5 if self.turns[k] else 2] = q[:, k]
            T = T @ SE3.exp(step)
        return np.stack(frames, axis=1), T @ self.after

    def solve(self, Ts_world_hand: Transforms, seeds: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the joint values at which the hand has given poses ``(n, d)``, and the distances left ``(n,)`` [m].

        Args:
            Ts_world_hand: poses of the hand in the robot's base ``(n, 4, 4)``.
            seeds: joint values near those of some poses ``(m, d)``; each pose starts from the nearest.
        """
        key = np.ascontiguousarray(Ts_world_hand).tobytes()
        if key not in self._last:  # all joints of an arm need the same poses
            self._last.clear()
            self._last[key] = self._solved(Ts_world_hand, seeds)
        return self._last[key]

    def _solved(self, Ts_world_hand: Transforms, seeds: FloatArray) -> tuple[FloatArray, FloatArray]:
        known, at = seeds, self.frames(seeds)[1]
        q = np.zeros((len(Ts_world_hand), len(self.names)))
        left = np.full(len(q), np.inf)
        for _ in range(_ROUNDS):
            open_ = np.flatnonzero(left > _REACHED)
            if not len(open_):
                break
            start = known[np.argmin(_distances(Ts_world_hand[open_], at), axis=1)]
            found, rest = self._newton(Ts_world_hand[open_], start)
            better = rest < left[open_]
            q[open_[better]], left[open_[better]] = found[better], rest[better]
            solved = left <= _REACHED
            known = np.concatenate([seeds, q[solved]])
            at = self.frames(known)[1]
        return q, left

    def _newton(self, Ts: Transforms, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        for _ in range(_STEPS):
            frames, hand = self.frames(q)
            error = _error(hand, Ts)
            axes = frames[:, :, :3, 2]
            arms = hand[:, None, :3, 3] - frames[:, :, :3, 3]
            J = np.concatenate(
                [np.where(self.turns[:, None], np.cross(axes, arms), axes), axes * self.turns[:, None]], axis=2
            )
            A = np.swapaxes(J, 1, 2) @ J + _DAMPING * np.eye(6)
            step = np.einsum("ndi,ni->nd", J, np.linalg.solve(A, error[:, :, None])[:, :, 0])
            size = np.abs(step).max(axis=1, keepdims=True)
            q = q + step * np.minimum(1.0, _LONGEST / np.maximum(size, 1e-300))
            if size.max() < 1e-12:
                break
        return q, np.linalg.norm(_error(self.frames(q)[1], Ts), axis=1)


def _error(hand: Transforms, Ts: Transforms) -> FloatArray:
    """Return displacement and rotation from one pose to the other, in the base frame ``(n, 6)``."""
    turn = SO3.log(Ts[:, :3, :3] @ np.swapaxes(hand[:, :3, :3], 1, 2))
    return np.concatenate([Ts[:, :3, 3] - hand[:, :3, 3], turn], axis=1)


def _distances(Ts: Transforms, others: Transforms) -> FloatArray:
    """Return the distances of poses from others ``(n, m)`` [m]."""
    moved = np.linalg.norm(Ts[:, None, :3, 3] - others[None, :, :3, 3], axis=-1)
    cosine = 0.5 * (np.einsum("nij,mij->nm", Ts[:, :3, :3], others[:, :3, :3]) - 1)
    return np.asarray(moved + _ARM * np.arccos(np.clip(cosine, -1, 1)))


@dataclass(frozen=True, slots=True, eq=False)
class JointZero(ErrorState):
    """Zero error of one joint of the robot [rad]: the true angle is the reported one plus the error.

    Readings without a pose of the hand do not have it.

    Attributes:
        chain: kinematic model of the robot, in whose base frame the hand's poses are.
        joint: index of the joint.
        seeds: joint values near those of some readings ``(m, d)``.
    """

    chain: JointChain = field(kw_only=True)
    joint: int = field(kw_only=True)
    seeds: FloatArray = field(kw_only=True)
    name: ClassVar[str] = "joint zero"
    unit: ClassVar[str] = "rad"

    def columns(self, sensed: Sensed) -> Columns:
        """Return the motion of points and beams by the joint's rotation.

        Args:
            sensed: the readings.
        """
        hands = sensed.Ts_world_hand
        axis, origin = np.zeros((len(sensed.points), 3)), np.zeros((len(sensed.points), 3))
        if hands.given.any():
            q, _ = self.chain.solve(hands.values, self.seeds)
            frames = self.chain.frames(q)[0][:, self.joint]
            axis[hands.given], origin[hands.given] = frames[:, :3, 2], frames[:, :3, 3]
        points = np.cross(axis, sensed.points - origin)[..., None]
        turns = np.cross(axis, sensed.directions.filled(0.0))[..., None]
        return Columns(points, (f"zero of joint {self.joint + 1} ({self.chain.names[self.joint]})",), turns)


def joint_zeros(chain: JointChain, seeds: FloatArray, sd: float, Ts_world_hand: Transforms) -> tuple[JointZero, ...]:
    """Return the zero errors of all joints that turn, after a check that the model reaches the poses of the hand.

    Args:
        chain: kinematic model of the robot.
        seeds: joint values near those of some readings ``(m, d)`` [rad].
        sd: standard deviation of each zero [rad].
        Ts_world_hand: poses of the hand of the readings ``(n, 4, 4)``.

    Raises:
        InputError: a pose of the hand is out of reach of the model: its base, hand or units differ.
    """
    if seeds.ndim != 2 or seeds.shape[1] != len(chain.names):
        raise InputError(
            f"{chain.source}: expected {len(chain.names)} joint values ({', '.join(chain.names)}), got "
            f"{seeds.shape[-1]}. State all of them."
        )
    if not len(Ts_world_hand):
        raise InputError(f"{chain.source}: expected readings with the hand's pose, got none. Add the hand_ columns.")
    left = chain.solve(Ts_world_hand, seeds)[1]
    worst = int(np.argmax(left))
    if not left[worst] < 1e-3:
        raise InputError(
            f"{chain.source}: expected poses of the hand that the arm reaches, got one that it misses by "
            f"{1e3 * left[worst]:.3g} mm. Is '{chain.source}' that arm up to the frame that the readings call the hand "
            "(FILE#base/hand), and are the poses in its base?"
        )
    return tuple(JointZero(sd, chain=chain, joint=int(k), seeds=seeds) for k in np.flatnonzero(chain.turns))
