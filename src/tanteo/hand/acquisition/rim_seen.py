"""Where the beams so far show a bore or a boss in a face: the circle that tells best which of them met the face.

A beam whose axis passes the plane of the face inside a bore goes on, beside it it ends there; at a boss it is the other
way round. Where the axis is near the rim, the share of the cone on either side says how likely each is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.features import Feature
from tanteo.geometry import SO3
from tanteo.geometry.typing import BoolArray, FloatArray, Vectors
from tanteo.hand.acquisition.guesses import RoundGuess
from tanteo.hand.acquisition.run import SensingRun
from tanteo.hand.acquisition.seen import cloud_of

_STEEP = 0.5
"""Beams that come to the face at a smaller cosine than this say little about where they pass it."""

_SURE, _FORM = 4.0, 1e-3
"""A point is on the face within so many standard deviations and this much more [m]; else it is below or above."""

_ASTRAY = 0.02
"""Share of beams that say the contrary, whatever is there."""

_SOFT = 0.276
"""Scale of the logistic law, in radii of a cone's spot, that has the variance of a point of a disc along one axis."""

_CENTRES, _RADII = 11, np.geomspace(0.6, 1.6, 9)
"""Centres along each axis and shares of the radius that are tried, then finer about the best."""

_FINER = 4
"""So many times."""

LEAST_GAIN = 8.0
"""Log likelihood by which a circle has to explain the beams better than none."""


@dataclass(frozen=True, slots=True, eq=False)
class Disc:
    """A circle in the plane of a face.

    Attributes:
        centre: ``(3,)`` [m].
        radius: [m].
        gain: Log likelihood over that without a circle.
        inside: Beams that pass the plane inside.
    """

    centre: FloatArray
    radius: float
    gain: float
    inside: int


@dataclass(frozen=True, slots=True, eq=False)
class _Passing:
    """Beams where they pass the plane: their places ``(n, 2)`` and spots ``(n,)`` [m], and which went on ``(n,)``."""

    feet: Vectors
    spots: FloatArray
    through: BoolArray


def in_face(face: Feature, guess: RoundGuess) -> tuple[FloatArray, FloatArray]:
    """The guessed centre in the plane of the face ``(3,)``, and two axes across its normal ``(3, 2)``."""
    origin, normal = face.T_world_feature[:3, 3], face.T_world_feature[:3, 2]
    centre = guess.point - ((guess.point - origin) @ normal) * normal
    return np.asarray(centre), np.asarray(SO3.frame_from_axis(normal, 2)[:, :2])


def seen_disc(run: SensingRun, face: Feature, guess: RoundGuess) -> Disc:
    """The circle that the beams so far show near the guess."""
    centre, axes = in_face(face, guess)
    reach = 2 * guess.sd + 1.6 * guess.radius + 0.005
    beams = _passing(run, face, centre, axes, reach)
    best, step = np.array([0.0, 0.0, guess.radius]), 4 * guess.sd / (_CENTRES - 1)
    shares, shifts = _RADII, (np.arange(_CENTRES) - _CENTRES // 2)
    for _ in range(1 + _FINER):
        x, y, r = (a.ravel() for a in np.meshgrid(shifts * step, shifts * step, shares, indexing="ij"))
        tried = np.stack([best[0] + x, best[1] + y, best[2] * r], axis=1)
        scores = _log_likelihoods(beams, tried, guess.convex) - _misfit(tried, guess)
        best, step = tried[int(np.argmax(scores))], 0.4 * step
        shares = shares**0.4
    none = np.count_nonzero(beams.through if not guess.convex else ~beams.through)
    without = none * np.log(_ASTRAY) + (len(beams.through) - none) * np.log(1 - _ASTRAY)
    gain = float(_log_likelihoods(beams, best[None], guess.convex)[0] - without)
    inside = int(np.count_nonzero(np.linalg.norm(beams.feet - best[:2], axis=1) < best[2]))
    return Disc(centre + axes @ best[:2], float(best[2]), gain, inside)


def _passing(run: SensingRun, face: Feature, centre: FloatArray, axes: FloatArray, reach: float) -> _Passing:
    """The beams that pass the plane near the guess, or end there."""
    origin, normal = face.T_world_feature[:3, 3], face.T_world_feature[:3, 2]
    cloud = cloud_of(run.hand, run.motions)
    cosines = -(cloud.beams @ normal)
    cloud, cosines = cloud.keep(cosines > _STEEP), cosines[cosines > _STEEP]
    way = ((origin - cloud.starts) @ normal) / -cosines
    feet = (cloud.starts + way[:, None] * cloud.beams - centre) @ axes
    height, sd = cloud.heights(origin, normal)
    limit = _SURE * sd + _FORM
    use = (way > 0) & (height < limit) & (np.linalg.norm(feet, axis=1) < reach)
    return _Passing(feet[use], (way * cloud.slopes)[use], (height < -limit)[use])


def _log_likelihoods(beams: _Passing, tried: FloatArray, convex: bool) -> FloatArray:
    """Of which beams went on, for circles ``(m, 3)`` of centre and radius ``(m,)``."""
    out = np.empty(len(tried))
    for k, (x, y, r) in enumerate(tried):
        away = np.hypot(beams.feet[:, 0] - x, beams.feet[:, 1] - y)
        spots = np.maximum(beams.spots, 1e-4)
        within = 1 / (1 + np.exp(np.clip((away - r) / (_SOFT * spots), -50, 50)))
        within *= np.minimum(1.0, (r / spots) ** 2)
        through = _ASTRAY + (1 - 2 * _ASTRAY) * (1 - within if convex else within)
        out[k] = np.log(np.where(beams.through, through, 1 - through)).sum()
    return out


def _misfit(tried: FloatArray, guess: RoundGuess) -> FloatArray:
    """Minus log density of circles by the guess ``(m,)``."""
    place = np.sum(tried[:, :2] ** 2, axis=1) / guess.sd**2
    return np.asarray(0.5 * (place + (np.log(tried[:, 2] / guess.radius) / guess.radius_share) ** 2))
