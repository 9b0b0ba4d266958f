"""Sub-pixel edge points of a grey image, each with its direction and standard deviation.

An edge is a maximum of the gradient of the smoothed image along the gradient (Canny 1986), placed between pixels by a
parabola through the logarithm along it: exact for a straight step that a Gaussian blurs. Its variance is that of the
parabola's top under the image's own noise, which is measured in the image (Immerkaer 1996) as a function of brightness.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry import freeze
from tanteo.geometry.typing import BoolArray, FloatArray, IntArray
from tanteo.vision.camera import opencv
from tanteo.vision.settings import EDGES, EVIDENCE, SPACING

_INTERVALS, _ENOUGH = 16, 2000
"""Numerical: intervals of the brightness in which the noise is estimated, and pixels that give it to a tenth: smoothed
noise has an independent value in 18 pixels."""


_SRGB = 2.2
"""Definition: exponent of the response curve of sRGB."""


@dataclass(frozen=True, slots=True, eq=False)
class EdgePoints:
    """Edge points of an image, in its pixels.

    Attributes:
        pixels: x and y ``(n, 2)`` [px].
        normals: unit normals from dark to bright ``(n, 2)``.
        sds: standard deviations along the normal ``(n,)`` [px]. Neighbours along an edge share their noise over
            ``EdgeSettings.correlation``.
        drifts: displacement of the point along the normal in the coarser image ``(n,)``; zero for a lone straight
            step, large near another edge, a corner or a bend, or beside shading [px].
        responses: displacement of the point along the normal by the response curve of sRGB ``(n,)`` [px].
        contrasts: gradients in standard deviations of their noise ``(n,)``.
        widths: standard deviations of the Gaussian that blurs each step, smoothing included ``(n,)`` [px].
        noise: standard deviation of one pixel of most of the image by independent noise with the same effect as noise
            and texture [grey levels].
        shape: rows and columns of the image.
    """

    pixels: FloatArray
    normals: FloatArray
    sds: FloatArray
    drifts: FloatArray
    responses: FloatArray
    contrasts: FloatArray
    widths: FloatArray
    noise: float
    shape: tuple[int, int]

    def __post_init__(self) -> None:
        freeze(self, "pixels", "normals", "sds", "drifts", "responses", "contrasts", "widths")

    def __len__(self) -> int:
        return len(self.pixels)

    def inside(self, mask: BoolArray) -> BoolArray:
        """Return which edge points are on the pixels of a mask ``(rows, columns)``."""
        x, y = np.rint(self.pixels).astype(np.int64).T
        return np.asarray(mask[y.clip(0, mask.shape[0] - 1), x.clip(0, mask.shape[1] - 1)])

    def only(self, rows: BoolArray) -> EdgePoints:
        """Return some of the edge points."""
        values = (
            self.pixels[rows], self.normals[rows], self.sds[rows], self.drifts[rows], self.responses[rows],
            self.contrasts[rows], self.widths[rows],
        )  # fmt: skip
        return EdgePoints(*values, self.noise, self.shape)


def check_image(image: FloatArray) -> FloatArray:
    """Return an image as floats.

    Raises:
        InputError: the array is not a grey image with finite values, of 16 rows and columns or more.
    """
    out = np.asarray(image, dtype=np.float64)
    if out.ndim != 2 or min(out.shape) < 16:
        raise InputError(f"image: expected rows x columns of grey values, 16 or more each, got shape {out.shape}.")
    if not np.all(np.isfinite(out)):
        raise InputError("image: expected finite grey values, got NaN or infinity. Mask them with the background.")
    return out


def image_noise(image: FloatArray) -> float:
    """Return the standard deviation of the noise of one pixel [grey levels] (Immerkaer 1996).

    The filter responds little to slopes and edges. The median of its response makes texture on a small share of the
    image count little. The result is at least the error of rounding to whole levels.
    """
    cv2 = opencv()
    kernel = np.array([[1.0, -2.0, 1.0], [-2.0, 4.0, -2.0], [1.0, -2.0, 1.0]])
    response = np.abs(cv2.filter2D(image, cv2.CV_64F, kernel))[1:-1, 1:-1]
    return max(float(np.median(response)) / (0.6745 * 6.0), 1 / np.sqrt(12))


def noise_by_level(image: FloatArray, flat: BoolArray) -> FloatArray:
    """Return the noise of gradients at each pixel over that of most of the image, as a function of the brightness.

    Photons are counted, so that bright pixels have more noise (Foi and others 2008, Practical Poissonian-Gaussian noise
    modeling and fitting for single-image raw data, IEEE Trans. Image Processing 17(10)); exposure, gamma, interpolation
    of colours and saturation make any function of it. The differences between gradients of two smoothed images have no
    slow shading. Their medians in intervals of the brightness are interpolated. Intervals with few pixels, or most of
    whose pixels are at edges, are excluded.

    Args:
        image: grey levels ``(rows, columns)``.
        flat: pixels without an edge ``(rows, columns)``.
    """
    cv2 = opencv()
    level = cv2.GaussianBlur(image, (0, 0), EDGES.coarser, borderType=cv2.BORDER_REPLICATE)
    fine, coarse = _gradient(image), _gradient(image, EDGES.coarser)
    size = np.hypot(fine[0] - coarse[0], fine[1] - coarse[1])
    order = np.argsort(level, axis=None, kind="stable")
    borders = np.searchsorted(level.ravel()[order], np.linspace(level.min(), level.max(), _INTERVALS + 1)[1:-1])
    least = (
        float(np.sqrt(2 * np.log(2) / 12)) * _SLOPE
    )  # median of gradients by the rounding to whole levels (Rayleigh)
    usual = float(np.hypot(np.median(size[flat]), least)) if flat.any() else least
    pairs = []
    for rows in np.split(order, borders):
        own = rows[flat.ravel()[rows]]
        if len(own) > max(_ENOUGH, len(rows) / 2):
            pairs.append((level.ravel()[own].mean(), np.hypot(np.median(size.ravel()[own]), least) / usual))
    return np.asarray(np.interp(level, *np.array(pairs).T)) if pairs else np.ones(image.shape)


def find_edges(image: FloatArray) -> EdgePoints:
    """Find the edge points of an image.

    Args:
        image: grey levels ``(rows, columns)``, 255 for white. The scale matters for ``EdgeSettings.least_step`` only.

    Raises:
        InputError: the array is not a grey image.
        MissingExtraError: OpenCV is not installed.
    """
    image = check_image(image)
    gx, gy = _gradient(image)
    size = np.hypot(gx, gy)
    noise = image_noise(image)
    # a tenth of the pixels shows no edge of an object: noise that neighbours share, or texture (Rayleigh's quantile)
    texture = float(np.quantile(size[3:-3, 3:-3], 0.1)) / float(np.sqrt(-2 * np.log(0.9)) * _SLOPE)
    highest = max(EDGES.strong * noise, EDGES.weak * texture) * _SLOPE
    noise = texture if texture > EDGES.textured * noise else noise
    ratio = noise_by_level(image, size < EDGES.strong * noise * _SLOPE)
    local = np.maximum(noise * ratio, 1 / np.sqrt(12))
    strong = highest * ratio
    least = EDGES.least_step / (np.sqrt(2 * np.pi) * EDGES.usual_width)
    rows, columns = _maxima(gx, gy, size, np.maximum(strong / 2, least))
    kept = _lasting(image.shape, rows, columns, (size > np.maximum(strong, 2 * least))[rows, columns])
    rows, columns = rows[kept], columns[kept]
    slope_sd, top_sd, bend_sd = (local[rows, columns] * gain for gain in (_SLOPE, _TOP, _BEND))
    g = size[rows, columns]
    normals = np.stack([gx[rows, columns], gy[rows, columns]], axis=-1) / g[:, None]
    slope, curvature = _along(np.log(np.maximum(size, 1e-3 * noise * _SLOPE)), rows, columns, normals)
    # a maximum that is flat on the grid has no place
    curvature = np.minimum(curvature, -1e-2)
    shift = np.clip(-slope / curvature, -0.75, 0.75)
    pixels = np.stack([columns, rows], axis=-1) + shift[:, None] * normals
    # the parabola goes through the logarithms of the values on either side, which are lower than the top
    sides = g * np.exp(0.5 * np.maximum(curvature, -2.0))
    sds = np.minimum(np.hypot(np.hypot(top_sd, shift * bend_sd) / (sides * np.abs(curvature)), EDGES.floor), 0.5)
    drifts = _moved(image, rows, columns, normals) - shift
    widths = 1 / np.sqrt(-curvature)
    responses = _responses(_between(_smooth(image), *pixels.T), g * widths)
    shape = image.shape[0], image.shape[1]
    return EdgePoints(pixels, normals, sds, drifts, responses, g / slope_sd, widths, noise, shape)


def _moved(image: FloatArray, i: IntArray, j: IntArray, normals: FloatArray) -> FloatArray:
    """Return the place of the edge along the normals from its pixels in the coarser image ``(n,)`` [px]."""
    size = np.hypot(*_gradient(image, EDGES.coarser))
    slope, curvature = _along(np.log(np.maximum(size, 1e-6)), i, j, normals)
    return np.asarray(np.clip(-slope / np.minimum(curvature, -1e-2), -2.0, 2.0))


def _responses(level: FloatArray, rise: FloatArray) -> FloatArray:
    """Return the displacement of edges by the response curve of sRGB, from dark to bright ``(n,)`` [px].

    The lens blurs light, and the curve ``g`` of the camera makes grey levels of it. To first order, the largest slope
    of a step from light ``a`` to ``b`` is displaced by ``log(g'(b) / g'(a)) s^2 / sqrt(2 pi (s^2 + t^2))``. The blur by
    the lens is ``s``, and ``1 / t^2 = 1 / s^2 + 1 / smoothing^2``.

    Args:
        level: grey level at each edge ``(n,)``.
        rise: slope of the grey level at each, times the width of its blur ``(n,)``.
    """
    half = 0.5 * np.sqrt(2 * np.pi) * rise
    dark, bright = (np.maximum(one, 1.0) for one in (level - half, level + half))
    s2 = EDGES.blur**2
    t2 = 1 / (1 / s2 + 1 / EDGES.smoothing**2)
    return np.asarray((1 - _SRGB) * np.log(bright / dark) * s2 / np.sqrt(2 * np.pi * (s2 + t2)))


def _smooth(image: FloatArray, smoothing: float = EDGES.smoothing) -> FloatArray:
    return np.asarray(opencv().GaussianBlur(image, (0, 0), smoothing, borderType=opencv().BORDER_REPLICATE))


def _gradient(image: FloatArray, smoothing: float = EDGES.smoothing) -> tuple[FloatArray, FloatArray]:
    smooth = _smooth(image, smoothing)
    gx, gy = np.zeros_like(smooth), np.zeros_like(smooth)
    gx[:, 1:-1] = 0.5 * (smooth[:, 2:] - smooth[:, :-2])
    gy[1:-1] = 0.5 * (smooth[2:] - smooth[:-2])
    return gx, gy


def _noise_gains() -> tuple[float, float, float]:
    """Return the standard deviations of the slope and of its first and second difference, for unit noise."""
    x = np.arange(-12, 13)
    g = np.exp(-0.5 * (x / EDGES.smoothing) ** 2)
    g /= g.sum()
    slope = np.convolve(g, [0.5, 0.0, -0.5])
    across = float(np.linalg.norm(g))
    kernels = slope, np.convolve(slope, [0.5, 0, -0.5]), np.convolve(slope, [1.0, -2.0, 1.0])
    first, second, third = (float(np.linalg.norm(kernel)) * across for kernel in kernels)
    return first, second, third


_SLOPE, _TOP, _BEND = _noise_gains()


def _maxima(gx: FloatArray, gy: FloatArray, size: FloatArray, least: FloatArray) -> tuple[IntArray, IntArray]:
    """Return rows and columns of the pixels whose gradient is a maximum along its direction."""
    inner = np.zeros(size.shape, dtype=np.bool_)
    inner[3:-3, 3:-3] = (size > least)[3:-3, 3:-3]
    rows, columns = np.nonzero(inner)
    g = size[rows, columns]
    nx, ny = gx[rows, columns] / g, gy[rows, columns] / g
    before, after = _between(size, columns - nx, rows - ny), _between(size, columns + nx, rows + ny)
    top = (g >= before) & (g > after)
    return rows[top].astype(np.int64), columns[top].astype(np.int64)


def _along(f: FloatArray, i: IntArray, j: IntArray, normals: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the first and second derivative along the normals, from nine values (Steger 1998)."""
    mid = f[i, j]
    dx, dy = 0.5 * (f[i, j + 1] - f[i, j - 1]), 0.5 * (f[i + 1, j] - f[i - 1, j])
    xx, yy = f[i, j + 1] - 2 * mid + f[i, j - 1], f[i + 1, j] - 2 * mid + f[i - 1, j]
    xy = 0.25 * (f[i + 1, j + 1] - f[i + 1, j - 1] - f[i - 1, j + 1] + f[i - 1, j - 1])
    nx, ny = normals.T
    return nx * dx + ny * dy, nx * nx * xx + 2 * nx * ny * xy + ny * ny * yy


def _between(values: FloatArray, x: FloatArray, y: FloatArray) -> FloatArray:
    """Interpolate values at pixels bilinearly."""
    j, i = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    u, v = x - j, y - i
    low = (1 - u) * values[i, j] + u * values[i, j + 1]
    return (1 - v) * low + v * ((1 - u) * values[i + 1, j] + u * values[i + 1, j + 1])


def _lasting(shape: tuple[int, ...], rows: IntArray, columns: IntArray, strong: BoolArray) -> BoolArray:
    """Return which points are on connected edges that are long enough and strong somewhere."""
    cv2 = opencv()
    mask = np.zeros(shape, dtype=np.uint8)
    mask[rows, columns] = 1
    count, labels = cv2.connectedComponents(mask, connectivity=8)
    label = labels[rows, columns]
    length = np.bincount(label, minlength=count)
    return np.asarray(
        (length[label] >= EVIDENCE.shortest) & (np.bincount(label, weights=strong, minlength=count)[label] > 0)
    )


@dataclass(frozen=True, slots=True, eq=False)
class EdgeMap:
    """Nearest edge points by direction.

    Attributes:
        points: edge points.
        nearest: index of the nearest point ``(channels, rows, columns)``, 32 bits; -1 where a channel is empty.
        distances: distance of that point ``(channels, rows, columns)``, single precision [px].
    """

    points: EdgePoints
    nearest: np.ndarray
    distances: np.ndarray


def map_edges(points: EdgePoints, used: BoolArray | None = None) -> EdgeMap:
    """Tabulate the nearest edge points by direction.

    Args:
        points: edge points of the image.
        used: whether each point counts ``(n,)``; all count if not given.
    """
    cv2 = opencv()
    rows, columns = points.shape
    at = np.clip(np.rint(points.pixels).astype(np.int64), 0, [columns - 1, rows - 1])
    angle = np.arctan2(points.normals[:, 1], points.normals[:, 0]) % np.pi
    nearest = np.full((EDGES.channels, rows, columns), -1, dtype=np.int32)
    distances = np.full((EDGES.channels, rows, columns), np.inf, dtype=np.float32)
    for k in range(EDGES.channels):
        turn = np.abs((angle - k * EDGES.direction + np.pi / 2) % np.pi - np.pi / 2)
        members = np.flatnonzero((turn <= EDGES.direction) & (True if used is None else used))
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
    """Return the channel ``(*batch,)`` of edges with normals ``(*batch, 2)``, either sign."""
    angle = np.arctan2(normals[..., 1], normals[..., 0]) / EDGES.direction
    return np.asarray(np.rint(angle).astype(np.int64) % EDGES.channels)


def cell_of(shape: tuple[int, int], pixels: FloatArray) -> tuple[IntArray, IntArray, BoolArray]:
    """Return row and column of pixels ``(*batch, 2)``, and whether they are in the image; NaN is not."""
    x, y = pixels[..., 0], pixels[..., 1]
    inside = (x > -0.5) & (y > -0.5) & (x < shape[1] - 0.5) & (y < shape[0] - 0.5)
    column = np.where(inside, x, 0.0)
    row = np.where(inside, y, 0.0)
    return np.rint(row).astype(np.int64), np.rint(column).astype(np.int64), inside


def chance_hits(points: EdgePoints) -> FloatArray:
    """Return the probability that a random place has an edge as strong as each edge point within reach ``(n,)``.

    Edges of texture, noise, shadows and other objects are a Poisson process. Its rate depends on the direction and on
    the contrast. It is estimated in a window: the number of points of the same direction with at least 0.7 of the
    contrast (half the energy), for each unit of area. A strong edge on a weak texture is rare, an edge along the grain
    of the table is not.

    Args:
        points: edge points of the image.
    """
    if not len(points):
        return np.zeros(0)
    cell = 2 * EDGES.cell
    at = (np.maximum(points.pixels, 0.0) / cell).astype(np.int64)
    size = at.max(axis=0) + 1
    angle = np.arctan2(points.normals[:, 1], points.normals[:, 0])
    channel = np.rint(angle / EDGES.direction).astype(np.int64) % EDGES.channels
    levels = np.quantile(points.contrasts, np.arange(EDGES.channels) / EDGES.channels)
    level = np.searchsorted(levels, points.contrasts, side="right") - 1
    counts = np.zeros((len(levels), EDGES.channels, size[1], size[0]), dtype=np.float32)
    np.add.at(counts, (level, channel, at[:, 1], at[:, 0]), 1.0)
    stronger = counts[::-1].cumsum(axis=0)[::-1]
    same = stronger + 0.5 * (np.roll(stronger, 1, axis=1) + np.roll(stronger, -1, axis=1))
    window = (2 * (EVIDENCE.surroundings // (2 * cell)) + 1,) * 2
    planes = np.moveaxis(same, (0, 1), (2, 3)).reshape(size[1], size[0], -1)
    cv2 = opencv()
    how = {"normalize": False, "borderType": cv2.BORDER_CONSTANT}
    split = (np.ascontiguousarray(planes[..., k]) for k in range(planes.shape[-1]))
    sums = np.stack([cv2.boxFilter(plane, -1, window, **how) for plane in split], axis=-1)
    cells = cv2.boxFilter(np.ones((int(size[1]), int(size[0])), np.float32), -1, window, **how)
    own = np.searchsorted(levels, np.sqrt(EDGES.weak / EDGES.strong) * points.contrasts, side="right").clip(1) - 1
    row, column = at[:, 1], at[:, 0]
    near = sums[row, column, own * EDGES.channels + channel] / (cells[row, column] * cell**2)
    return np.maximum(-np.expm1(-near * SPACING * 2 * EVIDENCE.reach), EVIDENCE.rarest)
