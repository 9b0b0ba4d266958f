"""Twists ``[v, w]`` of the hand in its own frame and the motion of poses and points under them (scalar fast paths)."""

from __future__ import annotations

import math

import numpy as np

from tanteo.geometry.typing import FloatArray, Tangents, Transforms, Vectors


def translation_twist(velocity: Vectors) -> Tangents:
    """Return the twist of a pure translation.

    Args:
        velocity: linear velocity ``(3,)``, hand frame [m/s].
    """
    out = np.zeros(6)
    out[:3] = velocity
    return out


def rotation_twist(rate: Vectors, pivot: Vectors) -> Tangents:
    """Return the twist of a rotation about a fixed point.

    Args:
        rate: angular velocity ``(3,)``, hand frame [rad/s].
        pivot: point that does not move ``(3,)``, hand frame [m].
    """
    x, y, z = rate
    a, b, c = pivot
    return np.array([b * z - c * y, c * x - a * z, a * y - b * x, x, y, z])


def point_velocities(points: Vectors, twist: Tangents) -> Vectors:
    """Return the velocities of points that are fixed to the hand.

    Args:
        points: positions ``(k, 3)``, hand frame [m].
        twist: velocity ``[v, w]`` of the hand, hand frame [m/s, rad/s].

    Returns:
        Velocities ``(k, 3)``, hand frame [m/s].
    """
    x, y, z = twist[3], twist[4], twist[5]
    W = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])
    return np.asarray(points @ W + twist[:3])


def advance(T: Transforms, twist: Tangents, time: float) -> Transforms:
    """Return the pose after a constant twist, ``T exp(twist time)``, by the closed form for a single pose.

    Args:
        T: initial pose ``(4, 4)``.
        twist: velocity ``[v, w]`` in the hand frame [m/s, rad/s].
        time: duration of the motion [s].
    """
    vx, vy, vz, wx, wy, wz = (twist * time).tolist()
    t2 = wx * wx + wy * wy + wz * wz
    t = math.sqrt(t2)
    if t < 1e-4:
        a, b, c = 1 - t2 / 6, 0.5 - t2 / 24, 1 / 6 - t2 / 120  # Taylor series of the coefficients below
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


def pose_difference(T_from: Transforms, T_to: Transforms) -> tuple[Vectors, Vectors]:
    """Return the translation [m] and the rotation vector [rad] from one pose to another, in the frame of the first.

    Args:
        T_from: first pose ``(4, 4)``.
        T_to: second pose ``(4, 4)``.
    """
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
        # at half a turn the axis is the eigenvector of D + D^T of the largest eigenvalue; its sign is free
        values, vectors = np.linalg.eigh(D + D.T)
        w = math.pi * vectors[:, np.argmax(values)]
    return R @ (T_to[:3, 3] - T_from[:3, 3]), w
