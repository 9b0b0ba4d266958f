"""A beam is a cone: where in it the echo comes from, and what that does at an edge (``math.md`` section 7).

Two ways to look along a cone. One ray drawn from it for every reading (:func:`draw_aims`) is what :func:`measure`
assumes: the point met is off the axis by a quarter of the squared half angle per axis, independently. Many rays that
fill it (:func:`cone_rays`) and are blended into one range (:func:`blend`) show what a real device does where only a
share of its spot is on the part.
"""

from __future__ import annotations

import math

import numpy as np

from tanteo.errors import InputError
from tanteo.typing import FloatArray, Vectors

_GOLDEN_TURN = math.pi * (3 - math.sqrt(5))


def draw_aims(rng: np.random.Generator, half_angles: FloatArray | float, batch: tuple[int, ...] = ()) -> Vectors:
    """One unit direction per reading, drawn uniformly from the disc of the cone about +z of the sensor.

    Args:
        rng: Source of chance.
        half_angles: Half angles of the cones [rad], any shape.
        batch: Leading axes of the result, before those of ``half_angles``.

    Returns:
        ``(*batch, *half_angles.shape, 3)`` in the sensor's frame.
    """
    half_angles = np.asarray(half_angles, dtype=np.float64)
    u = rng.random((2, *batch, *half_angles.shape))
    off = np.tan(half_angles) * np.sqrt(u[0])
    return _directions(off, 2 * math.pi * u[1])


def cone_rays(half_angle: FloatArray | float, n: int) -> Vectors:
    """``n`` unit directions that fill the disc of a cone about +z evenly, each for the same area (a sunflower).

    Args:
        half_angle: Half angle [rad], any shape.
        n: How many.

    Returns:
        ``(*half_angle.shape, n, 3)`` in the sensor's frame.

    Raises:
        InputError: ``n`` is less than one.
    """
    if n < 1:
        raise InputError(f"n: expected one ray or more, got {n}. Use 64.")
    k = np.arange(n, dtype=np.float64)
    off = np.asarray(np.tan(half_angle))[..., None] * np.sqrt((k + 0.5) / n)
    return _directions(off, k * _GOLDEN_TURN)


def _directions(off: FloatArray, turn: FloatArray) -> Vectors:
    rays = np.empty((*off.shape, 3))
    rays[..., 0], rays[..., 1], rays[..., 2] = off * np.cos(turn), off * np.sin(turn), 1.0
    return np.asarray(rays / np.sqrt(1 + off * off)[..., None])


def blend(ranges: FloatArray, *, threshold: float = 0.5, nearest: bool = False) -> tuple[FloatArray, FloatArray]:
    """The range that a device makes of all the rays of its cone.

    Args:
        ranges: Along the rays [m], rays on the last axis; not finite where a ray met nothing within range.
        threshold: Share of the spot that must be met for the device to answer.
        nearest: The device answers with the nearest echo (ultrasonic) instead of the mean of them (time of flight).

    Returns:
        The ranges [m], infinite where the share is below the threshold, and the shares, without the last axis.

    Raises:
        InputError: A threshold that is not in (0, 1].
    """
    if not 0 < threshold <= 1:
        raise InputError(f"threshold: expected a share above 0 and up to 1, got {threshold:g}. Use 0.5.")
    met = np.isfinite(ranges)
    share = met.mean(axis=-1)
    if nearest:
        reading = np.min(ranges, axis=-1, where=met, initial=np.inf)
    else:
        reading = np.sum(ranges, axis=-1, where=met) / np.maximum(met.sum(axis=-1), 1)
    return np.where((share >= threshold) & (share > 0), reading, np.inf), share


def edge_shift(threshold: FloatArray | float) -> FloatArray:
    """How far the axis is over the part when a cone that crosses its edge begins to see it, in radii of the spot.

    Zero at half the spot; negative where a smaller share is enough, so that the edge seems to stand out by this many
    radii, from whichever side it is crossed: crossings of two opposite edges, or of one edge coming and going with a
    part and a background that are both seen, cancel it.

    Args:
        threshold: Share of the spot at which the device changes its mind, within (0, 1).
    """
    # the covered share is the distribution function of a uniform disc along one axis: Beta(3/2, 3/2)
    from scipy.special import betaincinv

    return np.asarray(2 * betaincinv(1.5, 1.5, threshold) - 1)


def edge_bias(d: FloatArray | float, half_angle: FloatArray | float, threshold: FloatArray | float) -> FloatArray:
    """Bias of an edge event [m] along the crossing, positive towards the part: ``d tan(gamma) g(threshold)``.

    Args:
        d: Range to the edge [m].
        half_angle: Of the cone [rad].
        threshold: Share of the spot at which the device changes its mind.
    """
    return np.asarray(np.asarray(d) * np.tan(half_angle) * edge_shift(threshold))


def edge_variance(
    d: FloatArray | float, half_angle: FloatArray | float, stride: FloatArray | float = 0.0
) -> FloatArray:
    """Variance of an edge event along the crossing [m^2], at a threshold of half the spot (``math.md`` section 7).

    Args:
        d: Range to the edge [m].
        half_angle: Of the cone [rad].
        stride: Way of the sensor from reading to reading [m]: speed times sampling time.
    """
    return np.asarray(np.asarray(stride) ** 2 / 12 + (0.5 * np.asarray(d) * half_angle) ** 2)
