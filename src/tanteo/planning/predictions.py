"""Predicted readings: by ray casting on every sample of a posterior, and analytically for one plane of a part."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo import _core
from tanteo.errors import DegenerateError
from tanteo.geometry import SE3
from tanteo.geometry.typing import BoolArray, Covariances, FloatArray, IntArray, Tangents, Transforms, Vectors
from tanteo.planning.probe import Probe
from tanteo.planning.rays import cast_rays, has_cone, of_cone
from tanteo.planning.samples import Samples
from tanteo.planning.shared import SharedAhead
from tanteo.posterior import PreparedPart


@dataclass(frozen=True, slots=True, eq=False)
class Predictions:
    """Predicted readings of ``C`` beams for ``S`` samples of a posterior.

    Attributes:
        ranges: ranges ``(C, S)`` [m]; infinite for a miss.
        cosines: cosines of the incidence ``(C, S)``; 0 for a miss.
        variances: variances of the range from the covariance of the sample ``(C, S)`` [m^2].
        spreads: variances of the range from the covariance of the sample's mode ``(C, S)`` [m^2].
        useful: variances of the range from the useful part of that covariance ``(C, S)`` [m^2].
        faces: indices of the faces that are hit ``(C, S)``; -1 for a miss.
        shares: fraction of the rays of the beam's cone that have an echo ``(C, S)``; 1 for a thin beam.
        scatter: variance of the range between the rays of a cone, minus that on one plane ``(C, S)`` [m^2]; 0 for a
            thin beam.
        shared: variance of the range from the shared errors given the pose ``(C, S)`` [m^2]; NaN if only the probe
            models them.
    """

    ranges: FloatArray
    cosines: FloatArray
    variances: FloatArray
    spreads: FloatArray
    useful: FloatArray
    faces: IntArray
    shares: FloatArray
    scatter: FloatArray
    shared: FloatArray

    @property
    def hit(self) -> BoolArray:
        """Whether each beam hits the part ``(C, S)``."""
        return np.isfinite(self.ranges)


def predict(
    samples: Samples,
    origins: Vectors,
    directions: Vectors,
    probe: Probe | None = None,
    shared: SharedAhead | None = None,
) -> Predictions:
    """Predict the readings of beams for every sample (variance: ``math.md`` section 7, end).

    The echo of a wide beam may come from any ray of its cone; other rays may miss the part or hit another face.

    Args:
        samples: samples of the posterior.
        origins: origins of the beams, world frame ``(C, 3)`` [m].
        directions: unit directions, world frame ``(C, 3)``.
        probe: sensor model, for the cone of a beam or the ball of a tip; None for an exact ray.
        shared: errors that the beams share with earlier readings; None for none.
    """
    parts = np.unique(samples.part).tolist() or [0]
    rows = [np.flatnonzero(samples.part == k) for k in parts]
    found = [
        _of_part(samples, k, some, origins, directions, probe, shared) for k, some in zip(parts, rows, strict=True)
    ]
    if len(found) == 1:
        return Predictions(*found[0])
    order = np.argsort(np.concatenate(rows))
    return Predictions(*(np.concatenate(columns, axis=1)[:, order] for columns in zip(*found, strict=True)))


def _of_part(
    samples: Samples,
    k: int,
    some: IntArray,
    origins: Vectors,
    directions: Vectors,
    probe: Probe | None,
    shared: SharedAhead | None,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, IntArray, FloatArray, FloatArray, FloatArray]:
    """Return the fields of :class:`Predictions` for the samples of part ``k``."""
    target, Ts = samples.targets[k], samples.Ts[some]
    d, cosine, face, g = beams(target, Ts, origins, directions)
    shares, scatter = np.ones(d.shape), np.zeros(d.shape)
    if probe is not None and has_cone(probe):
        d, cosine, g, shares, scatter = of_cone(target, Ts, origins, directions, (d, cosine, g), probe)
    if probe is not None:
        d = d - probe.short(cosine)
    rest = np.full(d.shape, np.nan)
    if shared is not None:
        off, g, rest = shared.moved(samples.mode[some], Ts, g)
        d = d + off
    forms = np.stack([A[some] for A in (samples.covariances, samples.whole, samples.useful)])
    variances, spreads, useful = _core.spreads(np.ascontiguousarray(g), forms)
    return d, cosine, variances, spreads, useful, face, shares, scatter, rest


def beams(
    target: PreparedPart, Ts: Transforms, origins: Vectors, directions: Vectors
) -> tuple[FloatArray, FloatArray, IntArray, FloatArray]:
    """Return the first intersection of each beam with a part at several poses.

    Args:
        target: the part.
        Ts: poses ``(S, 4, 4)``.
        origins: origins of the beams, world frame ``(C, 3)`` [m].
        directions: unit directions, world frame ``(C, 3)``.

    Returns:
        Ranges [m], cosines of incidence and faces ``(C, S)``, and derivatives of the ranges over the pose ``(C, S,
        6)``. For a miss the range is infinite, the cosine 0 and the face -1.
    """
    hits = cast_rays(target, Ts, origins, directions[:, None])
    return hits.distances, hits.cosines, hits.faces, hits.derivatives


@dataclass(frozen=True, slots=True, eq=False)
class RangePrediction:
    """Predicted range of a beam to a plane.

    Attributes:
        mean: expected range ``(*batch,)`` [m]; negative if the plane is behind the origin.
        variance: variance of the reading from pose and sensor ``(*batch,)`` [m^2].
        gradient: gradient of the range over the right perturbation of the part's pose ``(*batch, 6)``.
    """

    mean: FloatArray
    variance: FloatArray
    gradient: Tangents


def predict_range(
    T_world_part: Transforms,
    C: Covariances,
    T_part_plane: Transforms,
    origin: Vectors,
    direction: Vectors,
    variance: FloatArray | float,
) -> RangePrediction:
    """Predict the range along a beam to a plane of a part with uncertain pose (``math.md`` section 7, end).

    Args:
        T_world_part: pose of the part ``(*batch, 4, 4)``.
        C: covariance of that pose, part frame, right perturbation ``(*batch, 6, 6)`` [m, rad].
        T_part_plane: frame of the plane in the part, z outward ``(*batch, 4, 4)``.
        origin: origin of the beam, world frame ``(*batch, 3)`` [m].
        direction: unit direction, world frame ``(*batch, 3)``.
        variance: variance of the sensor at that range [m^2].

    Raises:
        DegenerateError: a beam is parallel to its plane.
    """
    T = T_world_part @ T_part_plane
    n_world = T[..., :3, 2]
    along = np.sum(n_world * direction, axis=-1)
    if np.any(along == 0):
        raise DegenerateError("range: expected a beam that hits the plane, got one parallel to it. Turn the beam.")
    mean = np.sum(n_world * (T[..., :3, 3] - origin), axis=-1) / along
    hit = origin + mean[..., None] * direction
    X = SE3.apply(SE3.inverse(T_world_part), hit)
    n = np.broadcast_to(T_part_plane[..., :3, 2], X.shape)
    g = np.concatenate([n, np.cross(X, n)], axis=-1) / along[..., None]
    spread = np.sum(g * (C @ g[..., None])[..., 0], axis=-1)
    return RangePrediction(mean, spread + variance, g)
