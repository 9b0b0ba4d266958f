"""Errors that ``locate`` assumes although they are not stated, in the prediction of a plan."""

from __future__ import annotations

import numpy as np

from tanteo.geometry.typing import FloatArray, IntArray, Vectors
from tanteo.planning.probe import Probe
from tanteo.sensors import Column
from tanteo.sensors.error_states import Sensed, UnstatedError, unstated_errors

_SEED = 1991, 53


def assumed_errors(points: Vectors, directions: Vectors, ranges: FloatArray, probe: Probe) -> tuple[UnstatedError, ...]:
    """Return the errors that :func:`tanteo.locate` assumes for planned readings without stated errors.

    Args:
        points: points on the surface in the order of the readings, world frame ``(n, 3)`` [m].
        directions: unit directions of the beams or motions, world frame ``(n, 3)``.
        ranges: ranges ``(n,)`` [m].
        probe: sensor model.
    """
    n = len(points)
    along = probe.law.sigma(ranges) ** 2
    across = along if probe.contact else (0.5 * probe.beam_half_angle * ranges) ** 2
    noise = float(np.sqrt(np.median((along + 2 * across) / 3) + probe.repeat_sd**2))
    sensed = Sensed(
        points, Column.from_rows(directions), np.ones(n, dtype=np.bool_), Column.from_rows(directions), ("",) * n,
        ("",) * n, Column.empty(n, (4, 4)), np.zeros(n, dtype=np.int64), np.full(n, noise), np.ones(n, dtype=np.bool_),
    )  # fmt: skip
    return unstated_errors(sensed, noise, (), machine=max(probe.base_sds) > 0)


def drawn_ranges(errors: tuple[UnstatedError, ...], normals: Vectors, placements: IntArray, draws: int) -> FloatArray:
    """Return deviations of the ranges by draws of assumed errors ``(k, draws, n)`` [m].

    The same placement has the same draws, so that plans can be compared.

    Args:
        errors: the errors, at the readings.
        normals: normals of the surface over the cosine of the incidence, world frame ``(n, 3)``.
        placements: index of each placement ``(k,)``.
        draws: number of draws for each placement.
    """
    count = int(placements.max(initial=-1)) + 1
    out = np.zeros((len(placements), draws, len(normals)))
    for number, error in enumerate(errors):
        rng = np.random.default_rng((*_SEED, number))
        sizes = rng.choice(list(error.sizes), size=(count, draws), p=list(error.sizes.values()))
        effect = np.einsum("ni,nid->nd", normals, error.columns)
        states = np.stack([rng.normal(size=(count, draws)) for _ in range(effect.shape[1])], axis=-1)
        out += ((sizes[..., None] * states) @ effect.T)[placements]
    return out
