"""Maximum-likelihood fit of an ellipse to edge points: geometric distances, covariance, refusal of short arcs.

The ellipse is ``c + P (cos t, sin t)`` with a symmetric, positive ``P``. These five numbers are regular at
circles, whose axes have no angle. Distances are along its normal, and their derivative needs the foot only
(``math.md`` section 8). The fit starts at the direct fit of Fitzgibbon, Pilu and Fisher (1999) in OpenCV.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.errors import DegenerateError, InputError
from tanteo.geometry import freeze
from tanteo.geometry.typing import Covariances, FloatArray
from tanteo.vision.camera import opencv
from tanteo.vision.settings import EDGES, NEWTON_STEPS, SEARCH

NUMBERS = ("cx", "cy", "Pxx", "Pyy", "Pxy")
"""Definition: numbers of an ellipse, in the order of its covariance."""

_STEPS, _DONE = 20, 1e-6
"""Numerical: limit of the Levenberg-Marquardt steps, which end before, and squared length of the last step, in
variances of the ellipse by the scatter of its points."""

FEWEST = len(NUMBERS) + 1
"""Least number of points of a fit: one more than the ellipse has numbers."""


@dataclass(frozen=True, slots=True, eq=False)
class Ellipse:
    """An ellipse in pixels without distortion: ``c + P (cos t, sin t)``.

    Attributes:
        centre: centre ``c`` ``(2,)`` [px].
        shape: symmetric, positive matrix ``P`` ``(2, 2)`` [px]; its eigenvalues are the semi-axes.
        covariance: covariance of ``cx, cy, Pxx, Pyy, Pxy`` ``(5, 5)`` [px^2].
        chi2: chi-square of the distances.
        dof: degrees of freedom of the distances.
        arc: angle ``t`` of the ellipse that has points, a full turn for all of it [rad].
        count: number of points.
        dark: whether the inside is darker; None if it is unknown.
    """

    centre: FloatArray
    shape: FloatArray
    covariance: Covariances
    chi2: float
    dof: float
    arc: float
    count: int
    dark: bool | None = None

    def __post_init__(self) -> None:
        freeze(self, "centre", "shape", "covariance")

    @property
    def numbers(self) -> FloatArray:
        """``cx, cy, Pxx, Pyy, Pxy`` ``(5,)`` [px], the order of the covariance."""
        return np.array([*self.centre, self.shape[0, 0], self.shape[1, 1], self.shape[0, 1]])

    @property
    def semi_axes(self) -> FloatArray:
        """The longer and the shorter semi-axis ``(2,)`` [px]."""
        return np.asarray(np.linalg.eigvalsh(self.shape)[::-1], dtype=np.float64)

    @property
    def semi_axis_sds(self) -> FloatArray:
        """Standard deviations of the two semi-axes ``(2,)`` [px]."""
        axes = np.linalg.eigh(self.shape)[1][:, ::-1]
        rows = np.stack([[0, 0, v[0] ** 2, v[1] ** 2, 2 * v[0] * v[1]] for v in axes.T])
        return np.asarray(np.sqrt(np.einsum("ki,ij,kj->k", rows, self.covariance, rows)))

    @property
    def angle(self) -> float:
        """Angle of the longer axis from x towards y, from -90 to 90 degrees [rad]; meaningless for a circle."""
        x, y = np.linalg.eigh(self.shape)[1][:, 1]
        return float(np.arctan(y / x)) if x else 0.5 * np.pi


def fit_ellipse(
    pixels: FloatArray, sds: FloatArray, *, share: float = 1.0, blur: float = 0.0, common: float = 0.0
) -> Ellipse:
    """Fit an ellipse to points with standard deviations across it.

    Args:
        pixels: points without distortion ``(n, 2)`` [px].
        sds: standard deviations of the points across the ellipse ``(n,)`` [px].
        share: share of a point that is independent, because neighbours of :func:`tanteo.vision.find_edges` share noise.
        blur: standard deviation of the blur of the edge [px]. A blurred edge moves by ``blur^2 / 2`` over its radius of
            curvature towards the centre of curvature (Bouma and others 2005). The fit corrects it.
        common: standard deviation of an error that moves the whole edge out or in [px].

    Raises:
        InputError: there are fewer than six points, or a deviation is negative.
        DegenerateError: the points do not determine an ellipse; the message has the reason.

    Example:
        >>> t = np.radians(np.arange(0, 200, 5.0))
        >>> points = np.stack([300 + 40 * np.cos(t), 200 + 25 * np.sin(t)], axis=1)
        >>> ellipse = tanteo.vision.ellipse_fit.fit_ellipse(points, np.full(len(t), 0.05))
        >>> np.round(ellipse.semi_axes, 6), round(np.degrees(ellipse.arc))
        (array([40., 25.]), 195)
    """
    pixels, sds = np.asarray(pixels, dtype=np.float64), np.asarray(sds, dtype=np.float64)
    _check(pixels, sds)
    weights = share / (sds**2 + EDGES.floor**2)
    x = _fit(pixels, weights, _start(pixels))
    ellipse = _judged(pixels, weights, share, common, x)  # most arcs are refused, before their blur is corrected
    if not blur:
        return ellipse
    for _ in range(2):
        _, normals, radii = _feet(pixels, x)
        x = _fit(pixels + (0.5 * blur**2 / radii)[:, None] * normals, weights, x)
    _, normals, radii = _feet(pixels, x)
    return _judged(pixels + (0.5 * blur**2 / radii)[:, None] * normals, weights, share, common, x)


def _judged(pixels: FloatArray, weights: FloatArray, share: float, common: float, x: FloatArray) -> Ellipse:
    """Return the ellipse with the numbers ``x`` and its covariance.

    Raises:
        DegenerateError: the points do not determine the ellipse.
    """
    t, normals, _ = _feet(pixels, x)
    J = _derivatives(t, normals)
    off = _offsets(pixels, x, t, normals)
    chi2, dof = float(weights @ off**2), max(float(len(pixels) * share - 5), 1.0)
    covariance = _inverse((J.T * weights) @ J)
    if chi2 > dof + 3 * np.sqrt(2 * dof):  # the points scatter significantly more than stated
        covariance *= chi2 / dof
    covariance[2:4, 2:4] += common**2
    ellipse = Ellipse(x[:2], _matrix(x), covariance, chi2, dof, _arc(t), len(pixels))
    _refuse_loose(ellipse)
    return ellipse


def offsets_from(ellipse: Ellipse, pixels: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return signed distances of pixels ``(n, 2)``, positive outside, outward normals and radii of curvature [px]."""
    t, normals, radii = _feet(pixels, ellipse.numbers)
    return _offsets(pixels, ellipse.numbers, t, normals), normals, radii


def _check(pixels: FloatArray, sds: FloatArray) -> None:
    if pixels.ndim != 2 or pixels.shape[1:] != (2,) or len(pixels) < FEWEST:
        raise InputError(f"ellipse: expected {FEWEST} or more pixels (n, 2), got shape {pixels.shape}. Give more.")
    if sds.shape != (len(pixels),) or not (np.all(np.isfinite(sds)) and np.all(sds >= 0) and np.isfinite(pixels).all()):
        raise InputError(
            "ellipse: expected finite pixels with standard deviations of 0 or more [px], got others. Correct them."
        )


def _matrix(x: FloatArray) -> FloatArray:
    return np.array([[x[2], x[4]], [x[4], x[3]]])


def _start(pixels: FloatArray) -> FloatArray:
    """Return the numbers of the direct algebraic fit."""
    middle = pixels.mean(axis=0)
    size = float(np.abs(pixels - middle).max())
    if np.linalg.svd(pixels - middle, compute_uv=False)[1] < 1e-6 * size * np.sqrt(len(pixels)) or not size:
        raise DegenerateError("ellipse: expected points along a curve, got points on one line. Show more of the rim.")
    (cx, cy), (w, h), degrees = opencv().fitEllipseDirect(((pixels - middle) / size).astype(np.float32))
    if not (np.isfinite([cx, cy, w, h, degrees]).all() and min(w, h) > 1e-3):
        raise DegenerateError("ellipse: expected points along an ellipse, got others. Show more of the rim.")
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    R = np.array([[c, -s], [s, c]])
    P = size * 0.5 * R @ np.diag([w, h]) @ R.T
    return np.array([*(middle + size * np.array([cx, cy])), P[0, 0], P[1, 1], P[0, 1]])


def _fit(pixels: FloatArray, weights: FloatArray, x: FloatArray) -> FloatArray:
    """Return the numbers of the ellipse that fits best, by Levenberg-Marquardt on the distances."""
    damping, done = 1e-3, _DONE / max(len(pixels) - len(NUMBERS), 1)
    t, normals, _ = _feet(pixels, x)
    off = _offsets(pixels, x, t, normals)
    cost = float(weights @ off**2)
    for _ in range(_STEPS):
        J = _derivatives(t, normals)
        A, g = (J.T * weights) @ J, J.T @ (weights * off)
        step = np.linalg.solve(A + damping * np.diag(np.diagonal(A)), g)
        tried = x + step
        if np.linalg.eigvalsh(_matrix(tried))[0] <= 0.02 * np.linalg.eigvalsh(_matrix(x))[0]:
            damping *= 10
            continue
        t_new, n_new, _ = _feet(pixels, tried)
        off_new = _offsets(pixels, tried, t_new, n_new)
        new = float(weights @ off_new**2)
        if new > cost * (1 + 1e-12):
            damping *= 10
            continue
        small = float(step @ A @ step) < max(_DONE, done * new)
        x, t, normals, off, cost, damping = tried, t_new, n_new, off_new, new, damping * 0.2
        if small:
            return x
    return x


def _feet(pixels: FloatArray, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the angles ``t`` of the nearest points of the ellipse, outward normals and radii of curvature."""
    values, axes = np.linalg.eigh(_matrix(x))
    a, b = values[1], values[0]
    local = (pixels - x[:2]) @ axes[:, ::-1]
    t = np.arctan2(local[:, 1] * a, local[:, 0] * b)
    # Newton on (p - x(t)) x'(t) = 0, in the ellipse's own axes
    for _ in range(NEWTON_STEPS):
        c, s = np.cos(t), np.sin(t)
        dx, dy = local[:, 0] - a * c, local[:, 1] - b * s
        f = -dx * a * s + dy * b * c
        slope = -((a * s) ** 2) - (b * c) ** 2 - dx * a * c - dy * b * s
        slope = np.minimum(slope, -0.2 * b * b)
        t = t - np.clip(f / slope, -0.3, 0.3)
    c, s = np.cos(t), np.sin(t)
    n = np.stack([b * c, a * s], axis=1)
    length = np.linalg.norm(n, axis=1)
    n = (n / length[:, None]) @ axes[:, ::-1].T
    # the same angle about the axes of the image: u = P^-1 (x - c)
    u = np.stack([c, s], axis=1) @ axes[:, ::-1].T
    return np.arctan2(u[:, 1], u[:, 0]), n, length**3 / (a * b)


def _offsets(pixels: FloatArray, x: FloatArray, t: FloatArray, normals: FloatArray) -> FloatArray:
    feet = x[:2] + np.stack([np.cos(t), np.sin(t)], axis=1) @ _matrix(x)
    return np.asarray(np.sum((pixels - feet) * normals, axis=1))


def _derivatives(t: FloatArray, n: FloatArray) -> FloatArray:
    """Return the derivative of the motion along the normal by the five numbers ``(k, 5)``; the foot moves along it."""
    c, s = np.cos(t), np.sin(t)
    return np.stack([n[:, 0], n[:, 1], n[:, 0] * c, n[:, 1] * s, n[:, 0] * s + n[:, 1] * c], axis=1)


def _inverse(A: FloatArray) -> FloatArray:
    power = np.sqrt(np.maximum(np.diagonal(A), 1e-300))
    values, vectors = np.linalg.eigh(A / np.outer(power, power))
    inverse = (vectors / np.maximum(values, 1e-14)) @ vectors.T
    return np.asarray(inverse / np.outer(power, power))


def _arc(t: FloatArray) -> float:
    """Return the angle that has points [rad]: a full turn, less the largest gap if it exceeds those of neighbours."""
    turns = np.sort(t % (2 * np.pi))
    gaps = np.diff(np.r_[turns, turns[0] + 2 * np.pi])
    usual = float(np.median(gaps))
    return 2 * np.pi if gaps.max() < 4 * usual + 0.02 else float(2 * np.pi - gaps.max())


def _refuse_loose(ellipse: Ellipse) -> None:
    """Refuse an ellipse that the points do not determine.

    Raises:
        DegenerateError: the standard deviation of the size in some direction exceeds ``SearchSettings.loose``.
    """
    sds = ellipse.semi_axis_sds / ellipse.semi_axes
    if sds.max() > SEARCH.loose or not np.isfinite(sds).all():
        known = f"{100 * sds.max():.0f} %" if sds.max() < 10 else "nothing"
        raise DegenerateError(
            f"ellipse: expected an arc that determines it, got {np.degrees(ellipse.arc):.0f} degrees of one. A "
            f"semi-axis is known to {known}, at most {100 * SEARCH.loose:.0f} % is accepted. Show more of the rim."
        )
