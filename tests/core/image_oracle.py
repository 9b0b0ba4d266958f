"""Image factors of the core in plain NumPy: visible edges, their hits, the pose, slid drawings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo import _core
from tanteo.fitting.localization import motion_scale
from tanteo.geometry import SE3
from tanteo.vision.camera import Camera, project, project_linearized
from tanteo.vision.edges import cell_of, channel_of
from tanteo.vision.settings import EDGES

SIZE = 96, 64
DIAGONAL, MIDDLE, SLACK = 0.1, np.array([0.01, -0.02, 0.005]), 2e-5


@dataclass
class Scene:
    """A camera, samples of edges in front of it and beside, what hides them, poses, edge points, the nearest ones."""

    camera: Camera
    points: np.ndarray
    tangents: np.ndarray
    normals: np.ndarray
    lengths: np.ndarray
    sharp: np.ndarray
    corners: np.ndarray
    Ts: np.ndarray
    pixels: np.ndarray
    sds: np.ndarray
    nearest: np.ndarray

    def frame(self, **others):
        """Return the samples in the form of the core."""
        values = {k: getattr(self, k) for k in ("points", "tangents", "normals", "lengths", "sharp", "corners")}
        values.update(diagonal=DIAGONAL, middle=MIDDLE, slack=SLACK, view_step=1e-9)
        return _core.make_edge_frame(**{**values, **others})

    @property
    def image(self):
        """Return the columns of the image that the core needs."""
        return self.camera.numbers, self.nearest, self.pixels, self.sds


def scene(seed, lens):
    rng = np.random.default_rng(seed)
    camera = Camera(np.array([[90.0, 0, 47], [0, 88.0, 31], [0, 0, 1]]), SIZE, np.array(lens))
    units = rng.normal(size=(3, 40, 3))
    units /= np.linalg.norm(units, axis=-1, keepdims=True)
    Ts = SE3.from_parts(np.eye(3), np.array([0.0, 0, 0.15])) @ SE3.exp(
        rng.normal(size=(5, 6)) * np.repeat([0.01, 0.8], 3)
    )
    Ts[-1, 2, 3] = 0.0  # half of it is behind the camera
    return Scene(
        camera, rng.uniform(-0.06, 0.06, (40, 3)), units[0], np.stack(units[1:], axis=1), rng.uniform(1e-3, 1e-2, 40),
        rng.uniform(size=40) < 0.6, rng.uniform(-0.04, 0.04, (12, 1, 3)) + rng.normal(size=(12, 3, 3)) * 0.02, Ts,
        rng.uniform([0, 0], [SIZE[0] - 1, SIZE[1] - 1], (30, 2)), rng.uniform(0.1, 0.5, 30),
        rng.integers(-1, 30, (EDGES.channels, SIZE[1], SIZE[0])).astype(np.int32),
    )  # fmt: skip


def see(s, Ts, hidden):
    """Return which samples are visible, and which visible samples are on the outline."""
    eye = SE3.inverse(Ts)[:, :3, 3]
    ahead = np.einsum("bnj,nkj->bnk", eye[:, None] - s.points, s.normals) > 0
    rims = ahead[..., 0] ^ ahead[..., 1]
    shown = rims | (ahead.all(axis=-1) & s.sharp)
    if hidden:
        lift = s.normals.sum(axis=1)
        targets = s.points + SLACK * lift / np.linalg.norm(lift, axis=1, keepdims=True)
        for b, n in np.argwhere(shown):
            way = targets[n] - eye[b]
            shown[b, n] = not crossed(s.corners, eye[b], way, 1 - SLACK / np.linalg.norm(way))
    return shown, rims


def crossed(corners, start, way, reach):
    """Return whether a ray hits a triangle before ``reach``, by ``start + t way = a + u (b - a) + v (c - a)``."""
    a, b, c = np.moveaxis(corners, 1, 0)
    M = np.stack([np.broadcast_to(-way, a.shape), b - a, c - a], axis=-1)
    t, u, v = np.linalg.solve(M, (start - a)[..., None])[..., 0].T
    return bool(np.any((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (t < reach)))


@dataclass
class EdgeMatches:
    """What samples at poses meet."""

    pixels: np.ndarray
    normals: np.ndarray
    spans: np.ndarray
    inside: np.ndarray
    hits: np.ndarray
    which: np.ndarray
    offsets: np.ndarray
    sds: np.ndarray
    jacobian: np.ndarray


def meet(s, Ts, shown, reach):
    local = s.points @ np.swapaxes(Ts[:, :3, :3], 1, 2) + Ts[:, None, :3, 3]
    at, D = project_linearized(s.camera, local)
    J = D @ Ts[:, None, :3, :3]
    along = (J @ s.tangents[:, :, None])[..., 0]
    scale = np.linalg.norm(along, axis=-1)
    row, column, within = cell_of((SIZE[1], SIZE[0]), at)
    within &= shown & (local[..., 2] > 0) & (scale * DIAGONAL > 1)
    normals = np.stack([-along[..., 1], along[..., 0]], axis=-1) / scale[..., None]
    point = s.nearest[channel_of(np.nan_to_num(normals)), row, column]
    gap = s.pixels[point] - at
    off, across = np.sum(gap * normals, axis=-1), np.abs(gap[..., 0] * normals[..., 1] - gap[..., 1] * normals[..., 0])
    hits = within & (point >= 0) & (np.abs(off) < reach) & (across < max(2.0, 0.5 * reach))
    by = np.einsum("bni,bnij->bnj", normals, J)
    jacobian = np.concatenate([by, np.cross(s.points, by)], axis=-1)
    which = np.where(hits, point, -1)
    return EdgeMatches(
        at, normals, np.where(within, scale * s.lengths, 0), within, hits, which, np.where(hits, off, 0),
        np.where(hits, s.sds[which], 1), jacobian,
    )  # fmt: skip


def normal_equations(hits, reach, bias, correlation):
    """Information and gradient of the offsets under a redescending weight (Tukey 1960)."""
    sd2 = hits.sds**2 + bias**2 + (0.25 * reach) ** 2
    robust = np.where(hits.hits, (1 - (hits.offsets / (1.01 * reach)) ** 2) ** 2, 0.0)
    w = np.where(hits.hits, robust * hits.spans / correlation / sd2, 0.0)
    J = np.where(hits.hits[..., None], hits.jacobian, 0.0)
    JW = np.swapaxes(J, -1, -2) * w[..., None, :]
    return JW @ J, (JW @ hits.offsets[..., None])[..., 0]


def refine(s, Ts, starts, priors, rounds, bias, correlation):
    """Robust Gauss-Newton; the priors are on motions by the diagonal or a radian about the middle."""
    T, scale, shown = Ts, motion_scale(DIAGONAL, MIDDLE), None
    to_unit = np.linalg.inv(scale)
    for reach, wanted in rounds:
        shown = see(s, T, True)[0] if wanted else shown
        A, g = normal_equations(meet(s, T, shown, reach), reach, bias, correlation)
        off = SE3.log(SE3.inverse(starts) @ T) @ to_unit.T
        A = scale.T @ A @ scale + priors
        g = g @ scale - np.einsum("bij,bj->bi", priors, off)
        hold = 1e-6 * np.trace(A, axis1=1, axis2=2)[:, None, None] + 1e-9
        step = np.linalg.solve(A + hold * np.eye(6), g[..., None])[..., 0]
        step *= np.minimum(1.0, 0.3 / np.maximum(np.linalg.norm(step, axis=1), 1e-12))[:, None]
        T = T @ SE3.exp(step @ scale.T)
    return T


@dataclass
class Sliding:
    """A drawing that is slid over tables with a margin of cells."""

    distances: np.ndarray
    places: np.ndarray
    cell: float
    margin: int
    samples: int

    def cells(self, pixels):
        """Return columns and rows at a distance from a place; the end of the margin for those beyond."""
        at = np.nan_to_num(pixels / self.cell + self.margin, nan=0.0)
        return np.rint(at.clip(0, 2 * self.margin - 1)).astype(int)

    def costs(self, s, Ts, centre):
        """Costs of each pose at each place."""
        shown, _ = see(s, Ts, True)
        out = np.empty((len(Ts), len(self.places)))
        column, row = np.rint(self.places / self.cell).astype(int).T
        for T, seen, cost in zip(Ts, shown, out, strict=True):
            at, beside, middle = (
                project(s.camera, SE3.apply(T, p)) for p in (s.points, s.points + 1e-3 * s.tangents, centre)
            )
            upto = np.cumsum(np.linalg.norm(beside - at, axis=1) * s.lengths * seen)
            k = np.searchsorted(upto, (np.arange(self.samples) + 0.5) / self.samples * upto[-1])
            x, y = self.cells(at[k] - middle).T
            channel = channel_of(np.stack([at[k, 1] - beside[k, 1], beside[k, 0] - at[k, 0]], axis=-1))
            cost[:] = self.distances[channel[:, None], y[:, None] + row, x[:, None] + column].mean(axis=0, dtype=float)
        return out
