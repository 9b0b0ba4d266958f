"""Estimate the rim of a bore or boss in a face from the beams so far, as the circle of largest likelihood.

A beam whose axis passes the plane of the face inside a bore continues; outside it ends at the face. A boss has the
inverse effect. Near the rim, the fraction of the cone on either side is the probability of each.
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
"""Smallest cosine between a beam and the normal of the face for the beam to be used."""

_SURE, _FORM = 4.0, 1e-3
"""Largest distance of a point on the face from its plane, in standard deviations, and additional distance [m]."""

_ASTRAY = 0.02
"""Probability that a beam contradicts the circle by chance."""

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
    """Beams at the plane of the face.

    Attributes:
        feet: intersections with the plane ``(n, 2)`` [m].
        spots: radii of the spots ``(n,)`` [m].
        through: mask of the beams that continue beyond the plane ``(n,)``.
    """

    feet: Vectors
    spots: FloatArray
    through: BoolArray


def in_face(face: Feature, guess: RoundGuess) -> tuple[FloatArray, FloatArray]:
    """Return the guessed centre in the plane of a face ``(3,)`` [m], and two axes across its normal ``(3, 2)``.

    Args:
        face: face of the rim.
        guess: approximate bore or boss.
    """
    origin, normal = face.T_world_feature[:3, 3], face.T_world_feature[:3, 2]
    centre = guess.point - ((guess.point - origin) @ normal) * normal
    return np.asarray(centre), np.asarray(SO3.frame_from_axis(normal, 2)[:, :2])


def seen_disc(run: SensingRun, face: Feature, guess: RoundGuess) -> Disc:
    """Return the most likely circle near a guess, from the beams so far.

    Args:
        run: running acquisition.
        face: face of the rim.
        guess: approximate bore or boss.
    """
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
    """Return the beams that pass the plane near the guess, or end there."""
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
    """Return the log likelihood of circles, each of centre and radius ``(m, 3)``, given the beams ``(m,)``."""
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
    """Return the negative log prior density of circles, given the guess ``(m,)``."""
    place = np.sum(tried[:, :2] ** 2, axis=1) / guess.sd**2
    return np.asarray(0.5 * (place + (np.log(tried[:, 2] / guess.radius) / guess.radius_share) ** 2))
