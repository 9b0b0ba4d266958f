"""Sub-pixel edge points of a grey image, each with its direction and standard deviation.

An edge is a maximum of the gradient of the smoothed image along the gradient (Canny 1986), placed between pixels by a
parabola through the logarithm along it: exact for a straight step that a Gaussian blurs. Its variance is that of the
parabola's top under the image's own noise, which is measured in the image (Immerkaer 1996).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry import freeze
from tanteo.geometry.typing import BoolArray, FloatArray, IntArray
from tanteo.vision.camera import opencv

SMOOTHING = 1.2
"""Standard deviation of the Gaussian that the image is smoothed with [px]."""

CORRELATION = 2 * np.sqrt(np.pi) * SMOOTHING
"""Length of edge over which smoothed noise is one draw [px]: the integral of its correlation."""

STRONG, WEAK = 9.0, 4.5
"""An edge has a point with this gradient, and goes on while it has the other, in standard deviations of its noise."""

LEAST_STEP = 3.0
"""A step of fewer grey levels is no edge, whatever the noise: rounding and compression make some. One that is strong
somewhere has twice as much there."""

SHORTEST = 6
"""Fewer connected points than this are no edge."""

COARSER = 2.0
"""The image is smoothed so much more to see which edge points move [px]."""

BY_DRIFT = 0.25
"""Standard deviation that each pixel of an edge point's drift adds to it; the fit of decision 32 chose it."""

FLOOR = 0.01
"""What interpolation between pixels adds to the standard deviation [px]."""


@dataclass(frozen=True, slots=True, eq=False)
class EdgePoints:
    """Points of edges, in the pixels of the image that they were found in.

    Attributes:
        pixels: ``(n, 2)``, x and y [px].
        normals: ``(n, 2)``, unit, from dark to bright.
        sds: ``(n,)``, standard deviation along the normal [px]; neighbours along an edge share their noise over
            :data:`CORRELATION`.
        drifts: ``(n,)``, how far the point moves along the normal if the image is smoothed with :data:`COARSER`;
            nothing for a straight step that stands alone, much where another edge, a corner or a bend is near [px].
        contrasts: ``(n,)``, gradient in standard deviations of its noise.
        widths: ``(n,)``, standard deviation of the Gaussian that a step was blurred with, smoothing included [px].
        noise: standard deviation of one pixel of the image [grey levels].
        shape: rows and columns of the image.
    """

    pixels: FloatArray
    normals: FloatArray
    sds: FloatArray
    drifts: FloatArray
    contrasts: FloatArray
    widths: FloatArray
    noise: float
    shape: tuple[int, int]

    def __post_init__(self) -> None:
        freeze(self, "pixels", "normals", "sds", "drifts", "contrasts", "widths")

    def __len__(self) -> int:
        return len(self.pixels)


def check_image(image: FloatArray) -> FloatArray:
    """The image as floats.

    Raises:
        InputError: unless it is a grey image of some size with finite values.
    """
    out = np.asarray(image, dtype=np.float64)
    if out.ndim != 2 or min(out.shape) < 16:
        raise InputError(f"image: expected rows x columns of grey values, 16 or more each, got shape {out.shape}.")
    if not np.all(np.isfinite(out)):
        raise InputError("image: expected finite grey values, got NaN or infinity. Mask them with the background.")
    return out


def image_noise(image: FloatArray) -> float:
    """Standard deviation of one pixel, from a filter that sees neither slopes nor edges much [grey levels].

    The median of its response is taken, so that texture on a small part of the image counts little; at least what
    rounding to whole levels makes.
    """
    cv2 = opencv()
    kernel = np.array([[1.0, -2.0, 1.0], [-2.0, 4.0, -2.0], [1.0, -2.0, 1.0]])
    response = np.abs(cv2.filter2D(image, cv2.CV_64F, kernel))[1:-1, 1:-1]
    return max(float(np.median(response)) / (0.6745 * 6.0), 1 / np.sqrt(12))


def find_edges(image: FloatArray) -> EdgePoints:
    """Find the edge points of an image.

    Args:
        image: rows x columns, grey levels, 255 for white (the scale matters only for :data:`LEAST_STEP`).

    Raises:
        InputError: it is no grey image.
        MissingExtraError: without OpenCV.
    """
    image = check_image(image)
    gx, gy = _gradient(image)
    size = np.hypot(gx, gy)
    noise = image_noise(image)
    slope_sd, top_sd, bend_sd = noise * _SLOPE, noise * _TOP, noise * _BEND
    least = LEAST_STEP / (np.sqrt(2 * np.pi) * np.hypot(SMOOTHING, 0.7))
    rows, columns = _maxima(gx, gy, size, max(WEAK * slope_sd, least))
    kept = _lasting(image.shape, rows, columns, size[rows, columns] > max(STRONG * slope_sd, 2 * least))
    rows, columns = rows[kept], columns[kept]
    g = size[rows, columns]
    normals = np.stack([gx[rows, columns], gy[rows, columns]], axis=-1) / g[:, None]
    slope, curvature = _along(np.log(np.maximum(size, 1e-3 * slope_sd)), rows, columns, normals)
    # where the grid calls a maximum flat, nothing is claimed
    curvature = np.minimum(curvature, -1e-2)
    shift = np.clip(-slope / curvature, -0.75, 0.75)
    pixels = np.stack([columns, rows], axis=-1) + shift[:, None] * normals
    # the logarithm is taken of the values on either side, which are lower than the top
    sides = g * np.exp(0.5 * np.maximum(curvature, -2.0))
    sds = np.minimum(np.hypot(np.hypot(top_sd, shift * bend_sd) / (sides * np.abs(curvature)), FLOOR), 0.5)
    drifts = np.abs(_moved(image, rows, columns, normals) - shift)
    widths = 1 / np.sqrt(-curvature)
    shape = image.shape[0], image.shape[1]
    return EdgePoints(pixels, normals, sds, drifts, g / slope_sd, widths, noise, shape)


def _moved(image: FloatArray, i: IntArray, j: IntArray, normals: FloatArray) -> FloatArray:
    """Where the edge is along the normals from its pixels, in the coarser image [px]."""
    size = np.hypot(*_gradient(image, COARSER))
    slope, curvature = _along(np.log(np.maximum(size, 1e-6)), i, j, normals)
    return np.asarray(np.clip(-slope / np.minimum(curvature, -1e-2), -2.0, 2.0))


def _gradient(image: FloatArray, smoothing: float = SMOOTHING) -> tuple[FloatArray, FloatArray]:
    cv2 = opencv()
    smooth = cv2.GaussianBlur(image, (0, 0), smoothing, borderType=cv2.BORDER_REPLICATE)
    gx, gy = np.zeros_like(smooth), np.zeros_like(smooth)
    gx[:, 1:-1] = 0.5 * (smooth[:, 2:] - smooth[:, :-2])
    gy[1:-1] = 0.5 * (smooth[2:] - smooth[:-2])
    return gx, gy


def _noise_gains() -> tuple[float, float, float]:
    """Standard deviations of the slope and of its first and second difference, for unit noise."""
    x = np.arange(-12, 13)
    g = np.exp(-0.5 * (x / SMOOTHING) ** 2)
    g /= g.sum()
    slope = np.convolve(g, [0.5, 0.0, -0.5])
    across = float(np.linalg.norm(g))
    kernels = slope, np.convolve(slope, [0.5, 0, -0.5]), np.convolve(slope, [1.0, -2.0, 1.0])
    first, second, third = (float(np.linalg.norm(kernel)) * across for kernel in kernels)
    return first, second, third


_SLOPE, _TOP, _BEND = _noise_gains()


def _maxima(gx: FloatArray, gy: FloatArray, size: FloatArray, least: float) -> tuple[IntArray, IntArray]:
    """Pixels whose gradient is the largest along itself."""
    inner = np.zeros(size.shape, dtype=np.bool_)
    inner[3:-3, 3:-3] = size[3:-3, 3:-3] > least
    rows, columns = np.nonzero(inner)
    g = size[rows, columns]
    nx, ny = gx[rows, columns] / g, gy[rows, columns] / g
    before, after = _between(size, columns - nx, rows - ny), _between(size, columns + nx, rows + ny)
    top = (g >= before) & (g > after)
    return rows[top].astype(np.int64), columns[top].astype(np.int64)


def _along(f: FloatArray, i: IntArray, j: IntArray, normals: FloatArray) -> tuple[FloatArray, FloatArray]:
    """First and second derivative along the normals, from the nine values around (Steger 1998)."""
    mid = f[i, j]
    dx, dy = 0.5 * (f[i, j + 1] - f[i, j - 1]), 0.5 * (f[i + 1, j] - f[i - 1, j])
    xx, yy = f[i, j + 1] - 2 * mid + f[i, j - 1], f[i + 1, j] - 2 * mid + f[i - 1, j]
    xy = 0.25 * (f[i + 1, j + 1] - f[i + 1, j - 1] - f[i - 1, j + 1] + f[i - 1, j - 1])
    nx, ny = normals.T
    return nx * dx + ny * dy, nx * nx * xx + 2 * nx * ny * xy + ny * ny * yy


def _between(values: FloatArray, x: FloatArray, y: FloatArray) -> FloatArray:
    """Bilinear interpolation."""
    j, i = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    u, v = x - j, y - i
    low = (1 - u) * values[i, j] + u * values[i, j + 1]
    return (1 - v) * low + v * ((1 - u) * values[i + 1, j] + u * values[i + 1, j + 1])


def _lasting(shape: tuple[int, ...], rows: IntArray, columns: IntArray, strong: BoolArray) -> BoolArray:
    """Points of connected edges that are long enough and strong somewhere."""
    cv2 = opencv()
    mask = np.zeros(shape, dtype=np.uint8)
    mask[rows, columns] = 1
    count, labels = cv2.connectedComponents(mask, connectivity=8)
    label = labels[rows, columns]
    length = np.bincount(label, minlength=count)
    return np.asarray((length[label] >= SHORTEST) & (np.bincount(label, weights=strong, minlength=count)[label] > 0))


CHANNELS = 8
"""Directions that are discriminated; a channel holds the edges within one step of its own direction."""

_FAR = 1e3


@dataclass(frozen=True, slots=True, eq=False)
class EdgeMap:
    """Nearest edge points by direction.

    Attributes:
        points: the edge points.
        nearest: ``(CHANNELS, rows, columns)``, index of the nearest point; -1 where a channel is empty; 32 bits.
        distances: ``(CHANNELS, rows, columns)``, how far it is, single precision [px].
    """

    points: EdgePoints
    nearest: np.ndarray
    distances: np.ndarray


def map_edges(points: EdgePoints, used: BoolArray | None = None) -> EdgeMap:
    """Tabulate the nearest edge points.

    Args:
        points: of the image.
        used: which of them count ``(n,)``; all if not given.
    """
    cv2 = opencv()
    rows, columns = points.shape
    at = np.clip(np.rint(points.pixels).astype(np.int64), 0, [columns - 1, rows - 1])
    angle = np.arctan2(points.normals[:, 1], points.normals[:, 0]) % np.pi
    nearest = np.full((CHANNELS, rows, columns), -1, dtype=np.int32)
    distances = np.full((CHANNELS, rows, columns), _FAR, dtype=np.float32)
    for k in range(CHANNELS):
        turn = np.abs((angle - k * np.pi / CHANNELS + np.pi / 2) % np.pi - np.pi / 2)
        members = np.flatnonzero((turn <= np.pi / CHANNELS) & (True if used is None else used))
        if not len(members):
            continue
        free = np.ones((rows, columns), dtype=np.uint8)
        free[at[members, 1], at[members, 0]] = 0
        distance, label = cv2.distanceTransformWithLabels(free, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)
        owner = np.zeros(int(label.max()) + 1, dtype=np.int32)
        owner[label[at[members, 1], at[members, 0]]] = members
        nearest[k], distances[k] = owner[label], distance
    return EdgeMap(points, nearest, distances)


def channel_of(normals: FloatArray) -> IntArray:
    """The channel ``(*batch,)`` of edges with normals ``(*batch, 2)``, either sign."""
    angle = np.arctan2(normals[..., 1], normals[..., 0]) * (CHANNELS / np.pi)
    return np.asarray(np.rint(angle).astype(np.int64) % CHANNELS)


def cell_of(shape: tuple[int, int], pixels: FloatArray) -> tuple[IntArray, IntArray, BoolArray]:
    """Row and column of pixels ``(*batch, 2)``, and whether they are in the image; NaN is not."""
    x, y = pixels[..., 0], pixels[..., 1]
    inside = (x > -0.5) & (y > -0.5) & (x < shape[1] - 0.5) & (y < shape[0] - 0.5)
    column = np.where(inside, x, 0.0)
    row = np.where(inside, y, 0.0)
    return np.rint(row).astype(np.int64), np.rint(column).astype(np.int64), inside
