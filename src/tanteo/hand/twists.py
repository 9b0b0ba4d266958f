"""Velocities of the hand in its own frame ``[v, w]``, and what becomes of a pose under one. Small and fast."""

from __future__ import annotations

import math

import numpy as np

from tanteo.typing import FloatArray, Tangents, Transforms, Vectors


def shift(velocity: Vectors) -> Tangents:
    """The twist of a translation [m/s], hand's frame."""
    out = np.zeros(6)
    out[:3] = velocity
    return out


def turn(rate: Vectors, pivot: Vectors) -> Tangents:
    """The twist of a rotation [rad/s] about a point of the hand's frame [m] that stays where it is."""
    x, y, z = rate
    a, b, c = pivot
    return np.array([b * z - c * y, c * x - a * z, a * y - b * x, x, y, z])


def about(points: Vectors, twist: Tangents) -> Vectors:
    """Velocities ``(k, 3)`` of points ``(k, 3)`` of the hand under a twist, hand's frame [m/s]."""
    x, y, z = twist[3], twist[4], twist[5]
    W = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])
    return np.asarray(points @ W + twist[:3])


def advance(T: Transforms, twist: Tangents, time: float) -> Transforms:
    """The pose after a constant velocity in the hand's frame: ``T exp(twist time)``, for one pose, in few steps."""
    vx, vy, vz, wx, wy, wz = (twist * time).tolist()
    t2 = wx * wx + wy * wy + wz * wz
    t = math.sqrt(t2)
    if t < 1e-4:
        a, b, c = 1 - t2 / 6, 0.5 - t2 / 24, 1 / 6 - t2 / 120
    else:
        half = math.sin(0.5 * t) / t
        a, b, c = math.sin(t) / t, 2 * half * half, (t - math.sin(t)) / (t2 * t)
    ux, uy, uz = wy * vz - wz * vy, wz * vx - wx * vz, wx * vy - wy * vx
    d = wx * vx + wy * vy + wz * vz
    # p = v + b w x v + c w x (w x v), and w x (w x v) = w (w . v) - v |w|^2
    k = 1 - c * t2
    out: FloatArray = np.array(
        [
            [1 - b * (wy * wy + wz * wz), b * wx * wy - a * wz, b * wx * wz + a * wy, k * vx + b * ux + c * wx * d],
            [b * wx * wy + a * wz, 1 - b * (wx * wx + wz * wz), b * wy * wz - a * wx, k * vy + b * uy + c * wy * d],
            [b * wx * wz - a * wy, b * wy * wz + a * wx, 1 - b * (wx * wx + wy * wy), k * vz + b * uz + c * wz * d],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )
    return T @ out


def gap(T_from: Transforms, T_to: Transforms) -> tuple[Vectors, Vectors]:
    """What is missing from one pose to another, in the frame of the first: position [m] and rotation vector [rad]."""
    R = T_from[:3, :3].T
    D = R @ T_to[:3, :3]
    x, y, z = float(D[2, 1] - D[1, 2]), float(D[0, 2] - D[2, 0]), float(D[1, 0] - D[0, 1])
    s = math.sqrt(x * x + y * y + z * z)
    angle = math.atan2(s, float(D[0, 0] + D[1, 1] + D[2, 2]) - 1.0)
    if s > 1e-6:
        w = np.array([x, y, z]) * (angle / s)
    elif angle < 1.0:
        w = 0.5 * np.array([x, y, z])
    else:
        # half a turn: any of the two ways round
        values, vectors = np.linalg.eigh(D + D.T)
        w = math.pi * vectors[:, np.argmax(values)]
    return R @ (T_to[:3, 3] - T_from[:3, 3]), w
