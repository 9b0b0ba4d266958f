"""Errors that planned readings share: stated ones as states, and those that ``locate`` assumes if none are stated."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tanteo.geometry.typing import FloatArray, IntArray, Vectors
from tanteo.planning.probe import Probe
from tanteo.sensors import Column
from tanteo.sensors.error_states import ErrorState, Sensed, UnstatedError, unstated_errors

_SEED = 1991, 53


def assumed_errors(
    points: Vectors, directions: Vectors, ranges: FloatArray, probe: Probe, stated: Sequence[ErrorState] = ()
) -> tuple[UnstatedError, ...]:
    """Return the errors that :func:`tanteo.locate` assumes for planned readings although they are not stated.

    Args:
        points: points on the surface in the order of the readings, world frame ``(n, 3)`` [m].
        directions: unit directions of the beams or motions, world frame ``(n, 3)``.
        ranges: ranges ``(n,)`` [m].
        probe: sensor model.
        stated: errors that are stated.
    """
    along = probe.law.sigma(ranges) ** 2
    across = along if probe.contact else (0.5 * probe.beam_half_angle * ranges) ** 2
    noise = float(np.sqrt(np.median((along + 2 * across) / 3) + probe.repeat_sd**2))
    return unstated_errors(_sensed(points, directions, noise), noise, stated, machine=max(probe.base_sds) > 0)


def stated_columns(
    points: Vectors, directions: Vectors, normals: Vectors, errors: Sequence[ErrorState]
) -> tuple[FloatArray, FloatArray, tuple[str, ...]]:
    """Return the effect of stated errors on the ranges of candidate readings, whose order is not known yet.

    An error that depends on the order, such as a drift, has its mean over an order and the reverse. The deviation from
    it counts as independent noise.

    Args:
        points: points on the surface, world frame ``(n, 3)`` [m].
        directions: unit directions of the beams or motions, world frame ``(n, 3)``.
        normals: normals of the surface over the cosine of the incidence, world frame ``(n, 3)``.
        errors: the errors.

    Returns:
        Derivatives of the ranges by the states, whose unit is their standard deviation ``(n, d)`` [m], variances of
        the independent rest ``(n,)`` [m^2], and name of the error of each state ``(d,)``.
    """
    effects, rest, names = [np.zeros((len(points), 0))], np.zeros(len(points)), []
    for error in errors:
        forward = error.columns(_sensed(points, directions, 0.0))
        backward = error.columns(_sensed(points[::-1], directions[::-1], 0.0)).points[::-1]
        mean = 0.5 * (forward.points + backward)
        effects.append(error.spread * error.sd * np.einsum("ni,nid->nd", normals, mean))
        names += [error.name] * mean.shape[2]
        off = np.mean((forward.points - mean) ** 2, axis=0).sum(axis=1)
        rest += (error.spread * error.sd) ** 2 * normals**2 @ off
        if forward.covs is not None:
            rest += np.einsum("ni,nij,nj->n", normals, forward.covs, normals)
    return np.concatenate(effects, axis=1), rest, tuple(names)


def _sensed(points: Vectors, directions: Vectors, noise: float) -> Sensed:
    """Return planned readings as the errors need them."""
    n = len(points)
    return Sensed(
        points, Column.from_rows(directions), np.ones(n, dtype=np.bool_), Column.from_rows(directions), ("",) * n,
        ("",) * n, Column.empty(n, (4, 4)), np.zeros(n, dtype=np.int64), np.full(n, noise), np.ones(n, dtype=np.bool_),
        Column.empty(n, (4, 4)),
    )  # fmt: skip


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
        columns = error.columns()
        rng = np.random.default_rng((*_SEED, number))
        sizes = rng.choice(list(error.sizes), size=(count, draws), p=list(error.sizes.values()))
        effect = np.einsum("ni,nid->nd", normals, columns)
        states = np.stack([rng.normal(size=(count, draws)) for _ in range(effect.shape[1])], axis=-1)
        out += ((sizes[..., None] * states) @ effect.T)[placements]
    return out
