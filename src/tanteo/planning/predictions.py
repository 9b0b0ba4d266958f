"""What beams would read: by rays on every sample of a belief, and off one plane of a part."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo import _core
from tanteo.errors import DegenerateError
from tanteo.geometry import SE3
from tanteo.geometry.typing import BoolArray, Covariances, FloatArray, IntArray, Tangents, Transforms, Vectors
from tanteo.planning.probe import Probe
from tanteo.planning.rays import has_cone, of_cone, rays_met
from tanteo.planning.samples import Samples
from tanteo.planning.shared import SharedAhead
from tanteo.posterior import PreparedPart


@dataclass(frozen=True, slots=True, eq=False)
class Predictions:
    """What beams would meet under every sample.

    Attributes:
        ranges: ``(C, S)`` [m]; infinite where nothing is met.
        cosines: of the incidence ``(C, S)``; 0 where nothing is met.
        variances: of the range from the sample's own covariance ``(C, S)`` [m^2].
        spreads: from that of its mode ``(C, S)`` [m^2].
        useful: from the part of that which is worth knowing ``(C, S)`` [m^2].
        faces: index of the part's face that is met ``(C, S)``; -1 for none.
        shares: of the rays of the beam's cone, those that are answered ``(C, S)``; 1 for a thin beam.
        scatter: variance of the range from ray to ray beyond that on one plane ``(C, S)`` [m^2]; 0 for a thin beam.
        shared: variance from what the pose leaves open of the errors that readings share ``(C, S)`` [m^2]; NaN where
            only the probe says it.
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
    def met(self) -> BoolArray:
        """Whether anything is met ``(C, S)``."""
        return np.isfinite(self.ranges)


def predict(
    samples: Samples,
    origins: Vectors,
    directions: Vectors,
    probe: Probe | None = None,
    shared: SharedAhead | None = None,
) -> Predictions:
    """What beams would read, by rays on every sample; ``math.md`` section 7, end, for the variance.

    The echo of a cone comes from any one of its rays: some may meet the part, and others nothing or another face.

    Args:
        samples: where the parts may be.
        origins: of the beams, world ``(C, 3)`` [m].
        directions: unit, world ``(C, 3)``.
        probe: what senses, if its cone or ball is to count.
        shared: errors that the readings share, with those told before.
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
    """What :class:`Predictions` has, under the samples of part ``k``."""
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
    """What beams meet on a part at poses: range, cosine of incidence, face, and how the range moves with the pose.

    Args:
        target: the part.
        Ts: poses ``(S, 4, 4)``.
        origins: of the beams, world ``(C, 3)`` [m].
        directions: unit, world ``(C, 3)``.

    Returns:
        ``(C, S)`` three times (infinite, 0 and -1 for a miss), and the derivatives ``(C, S, 6)``, 0 for a miss.
    """
    met = rays_met(target, Ts, origins, directions[:, None])
    return met.distances, met.cosines, met.faces, met.derivatives


@dataclass(frozen=True, slots=True, eq=False)
class RangePrediction:
    """The range that a beam is expected to read.

    Attributes:
        mean: ``(*batch,)`` [m]; negative if the plane is behind.
        variance: of the reading: pose and device together.
        gradient: over the body error of the part's pose ``(*batch, 6)``.
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
    """Range along a beam to a plane of the part, with the part's pose uncertain (``math.md`` section 7, end).

    Args:
        T_world_part: pose of the part ``(*batch, 4, 4)``.
        C: its body covariance ``(*batch, 6, 6)``.
        T_part_plane: frame of the plane, z outward ``(*batch, 4, 4)``.
        origin: of the beam, world ``(*batch, 3)`` [m].
        direction: unit, world ``(*batch, 3)``.
        variance: of the device at that range [m^2].

    Raises:
        DegenerateError: if a beam is parallel to its plane.
    """
    T = T_world_part @ T_part_plane
    n_world = T[..., :3, 2]
    along = np.sum(n_world * direction, axis=-1)
    if np.any(along == 0):
        raise DegenerateError("range: expected a beam that meets the plane, got one parallel to it. Turn the beam.")
    mean = np.sum(n_world * (T[..., :3, 3] - origin), axis=-1) / along
    hit = origin + mean[..., None] * direction
    X = SE3.apply(SE3.inverse(T_world_part), hit)
    n = np.broadcast_to(T_part_plane[..., :3, 2], X.shape)
    g = np.concatenate([n, np.cross(X, n)], axis=-1) / along[..., None]
    spread = np.sum(g * (C @ g[..., None])[..., 0], axis=-1)
    return RangePrediction(mean, spread + variance, g)
