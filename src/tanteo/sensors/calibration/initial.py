"""Find starts of a calibration from the log alone, or from a rig, robust against outliers.

For a given normal, the plane's position and the beam's origin and direction are linear in the readings. The search
tries 150 normals and keeps those with the smallest sum of absolute residuals. It runs once with all stations and once
with the nearer half, because far readings have the largest errors and the largest leverage.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from tanteo.geometry import SE3
from tanteo.geometry.typing import BoolArray, FloatArray, Transforms, Vectors
from tanteo.sensors.calibration.geometry import Setup, facing_planes, plane_frame
from tanteo.sensors.calibration.log import PlaneLog
from tanteo.sensors.calibration.targets import Ball, Target

_NORMALS = 150
_STARTS = 3
_PASSES = 12
_FARTHEST = 0.3
"""Scale of a weak prior on the beam's origin [m], which only fixes undetermined directions."""

_OPEN = 1e-8
"""Scatter of points across the beams below which it counts as zero [m^2]."""


def starts(log: PlaneLog, T_hand_beams: Transforms | None, target: Target | None = None) -> list[Setup]:
    """Return setups to refine, best first, beginning with that of the rig if it is known.

    Args:
        log: stations.
        T_hand_beams: poses of the beams in the rig ``(k, 4, 4)`` [m]; None if unknown.
        target: known target of all readings; None for unknown planes.
    """
    out = [] if T_hand_beams is None else [_setup(log, T_hand_beams, np.ones(len(log), dtype=bool))]
    if target is not None and T_hand_beams is not None:
        return [replace(out[0], T_world_planes=_placed(target, log, T_hand_beams)[None], surface=target.surface)]
    out += [replace(out[0], T_world_planes=facing_planes(log, T_hand_beams))] if T_hand_beams is not None else []
    lead = int(np.argmax(np.bincount(log.beam)))
    near = log.ranges <= np.median(log.ranges[log.beam == lead])
    for use, T_hand_lead in [(take, T) for take in (near | True, near) for T in _lead_beams(log, lead, take)]:
        Ts = np.broadcast_to(np.eye(4), (len(log.beams), 4, 4)).copy()
        Ts[lead] = T_hand_lead
        planes = _planes(log, Ts, (log.beam == lead) & use)
        for k in range(len(log.beams)):
            first = int(np.argmax(log.device == log.device[k]))
            if log.device[k] == log.device[lead]:
                Ts[k] = T_hand_lead @ SE3.inverse(log.T_device_beams[lead]) @ log.T_device_beams[k]
            elif k == first:
                Ts[k] = _other_beam(log, k, planes)
            else:
                Ts[k] = Ts[first] @ SE3.inverse(log.T_device_beams[first]) @ log.T_device_beams[k]
        out.append(_setup(log, Ts, use))
    if target is None or target.T_world_target is None:
        return out
    return [replace(setup, T_world_planes=target.T_world_target[None], surface=target.surface) for setup in out]


def _placed(target: Target, log: PlaneLog, T_hand_beams: Transforms) -> Transforms:
    """Return the pose of a target; where it is unknown, it is where the beams of the rig hit something."""
    if target.T_world_target is not None:
        return target.T_world_target
    T = log.Ts_world_hand @ T_hand_beams[log.beam]
    inside = target.surface.radius if isinstance(target.surface, Ball) else 0.0
    points = T[:, :3, 3] + (log.ranges + inside)[:, None] * T[:, :3, 2]
    return SE3.from_parts(np.eye(3), np.median(points, axis=0))


def _setup(log: PlaneLog, Ts: Transforms, use: BoolArray) -> Setup:
    return Setup.of_beams(Ts, log.device, log.T_device_beams, _planes(log, Ts, use))


def _lead_beams(log: PlaneLog, lead: int, use: BoolArray) -> list[Transforms]:
    """Return beams of the sensor with the most stations, from the plane with the most of these stations."""
    mine = (log.beam == lead) & use
    mine &= log.plane == np.argmax(np.bincount(log.plane[mine]))
    T, d = log.Ts_world_hand[mine], log.ranges[mine]
    normals = _hemisphere(_NORMALS)
    solutions, costs = _beams_for_planes(T, d, normals)
    best = np.argsort(costs)[:_STARTS]
    if not np.isfinite(costs[best[0]]):
        # without rotations the log does not determine the direction: try every axis
        return [plane_frame(axis, np.zeros(3)) for axis in np.concatenate([np.eye(3), -np.eye(3)])]
    closer = [_closer(normals[i], solutions[i], float(costs[i]), T, d) for i in best if np.isfinite(costs[i])]
    return [_beam_frame(solution) for _, solution in sorted(closer, key=lambda c: c[0])]


def _closer(n: Vectors, solution: FloatArray, cost: float, T: Transforms, d: FloatArray) -> tuple[float, FloatArray]:
    """Return the minimum of the sum over neighbouring normals, with decreasing steps."""
    turn = math.radians(8.0)
    while turn > math.radians(0.2):
        x, y = plane_frame(n, np.zeros(3))[:3, :2].T
        tried = n + turn * np.stack([x, y, -x, -y, x + y, x - y, -x - y, y - x])
        tried /= np.linalg.norm(tried, axis=1, keepdims=True)
        solutions, costs = _beams_for_planes(T, d, tried)
        i = int(np.argmin(costs))
        if costs[i] < cost:
            n, solution, cost = tried[i], solutions[i], float(costs[i])
        else:
            turn *= 0.5
    return cost, solution


def _beams_for_planes(T: Transforms, d: FloatArray, normals: Vectors) -> tuple[FloatArray, FloatArray]:
    """Return origin, direction and plane offset ``(n, 7)`` for every normal, and the sums of absolute distances.

    A sum is infinite if the length of the direction is far from one, so that there is no beam.
    """
    n_hand = np.einsum("mji,nj->nmi", T[:, :3, :3], normals)
    A = np.concatenate([n_hand, d[:, None] * n_hand, np.full((*n_hand.shape[:2], 1), -1.0)], axis=2)
    x, costs = _least_absolute(A, -normals @ T[:, :3, 3].T)
    lengths = np.linalg.norm(x[:, 3:6], axis=1)
    return x, np.where((lengths > 0.5) & (lengths < 2), costs, np.inf)


def _least_absolute(A: FloatArray, target: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the solutions of ``A x = target`` with least absolute residuals, and their sums, by re-weighting."""
    ridge = np.diag(np.r_[np.full(3, 1e-6 / _FARTHEST**2), np.full(3, 1e-6), np.full(A.shape[2] - 6, 1e-12)])
    weights = np.ones(target.shape)
    x, r = np.zeros(A.shape[::2]), target
    for _ in range(_PASSES):
        W = weights / weights.mean(axis=1, keepdims=True)
        AW = np.swapaxes(A * W[..., None], 1, 2)
        x = np.linalg.solve(AW @ A + ridge, AW @ target[..., None])[..., 0]
        r = np.abs(np.einsum("nmk,nk->nm", A, x) - target)
        weights = 1 / np.maximum(r, 1e-4 + 0.1 * np.median(r, axis=1, keepdims=True))
    return x, r.sum(axis=1)


def _other_beam(log: PlaneLog, k: int, planes: Transforms) -> Transforms:
    """Return the beam of another sensor from known planes."""
    mine = log.beam == k
    T, n = log.Ts_world_hand[mine], planes[log.plane[mine], :3, 2]
    n_hand = np.einsum("mji,mj->mi", T[:, :3, :3], n)
    A = np.concatenate([n_hand, log.ranges[mine, None] * n_hand], axis=1)
    target = np.sum(n * (planes[log.plane[mine], :3, 3] - T[:, :3, 3]), axis=1)
    solution = _least_absolute(A[None], target[None])[0][0]
    if np.linalg.norm(solution[3:6]) < 0.1:
        solution[3:6] = [0.0, 0.0, 1.0]
    return _beam_frame(solution)


def _beam_frame(solution: FloatArray) -> Transforms:
    return plane_frame(solution[3:6] / np.linalg.norm(solution[3:6]), solution[:3])


def _planes(log: PlaneLog, Ts: Transforms, use: BoolArray) -> Transforms:
    """Return planes through the measured points by least absolute distances, facing the sensors."""
    T = log.Ts_world_hand @ Ts[log.beam]
    points = T[:, :3, 3] + log.ranges[:, None] * T[:, :3, 2]
    out = np.empty((len(log.planes), 4, 4))
    for p in range(len(log.planes)):
        mine = (log.plane == p) & use if ((log.plane == p) & use).any() else log.plane == p
        q, weights = points[mine], np.ones(int(mine.sum()))
        aim = T[mine, :3, 2].mean(axis=0)
        # if the points do not determine the normal, it is opposite to the beams
        open_ = _OPEN * (aim @ aim * np.eye(3) - np.outer(aim, aim))
        for _ in range(_PASSES):
            middle = np.average(q, axis=0, weights=weights)
            scatter = ((q - middle) * weights[:, None]).T @ (q - middle) / weights.sum()
            n = np.linalg.eigh(scatter + open_)[1][:, 0]
            off = np.abs((q - middle) @ n)
            weights = 1 / np.maximum(off, 1e-4 + 0.1 * np.median(off))
        towards = -np.sign(aim @ n) or 1.0
        out[p] = plane_frame(towards * n, middle)
    return out


def _hemisphere(n: int) -> Vectors:
    """Return directions spread evenly over half a sphere, along a spiral ``(n, 3)``."""
    z = (np.arange(n) + 0.5) / n
    turn = np.arange(n) * math.pi * (3 - math.sqrt(5))
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=1)
