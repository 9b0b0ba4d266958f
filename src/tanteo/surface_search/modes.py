"""The maxima of all parts with their probabilities, each with the mass of its whole region."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from tanteo.lie import SE3
from tanteo.matching.belief import squared_gaps
from tanteo.matching.part_motions import off_spins, spins
from tanteo.matching.prior import PosePrior, alike
from tanteo.matching.priors import Priors, log_sum
from tanteo.parts import Part
from tanteo.surface_search.adapted_draws import TooFewDrawsError
from tanteo.surface_search.around import modes_around
from tanteo.surface_search.free_space import log_free_paths
from tanteo.surface_search.likelihood import log_posterior
from tanteo.surface_search.mode import Mode
from tanteo.surface_search.moments import Moments, posterior_moments
from tanteo.surface_search.near_edges import REACH
from tanteo.surface_search.none_of_these import NEGLIGIBLE, log_none, reported
from tanteo.surface_search.polish import Polished, information_of_readings
from tanteo.surface_search.sheets import pieces
from tanteo.surface_search.target import Target
from tanteo.surface_search.touches import FreePaths, Touches
from tanteo.surface_search.within import cut, log_within, within
from tanteo.typing import FloatArray

_WEIGHED, _MOST, _FAINT = 0.03, 4, 1e-4
"""Modes that may be of at least this probability if it is one of the parts, no more of them, and none so improbable
beside "none of these", are weighed over their whole region, whose mass can be a hundred times that of the curvature."""

_FEW = 12
"""So many readings, or fewer, may leave a rough pose on sheets: then draws from all of it are weighed."""

_IMAGE = 7.0
"""A symmetric pose that is so many standard deviations off the rough one is not meant."""

_WITHIN = 9.0
"""Squared Mahalanobis distance from a weighed mode within which another maximum is part of it."""


def weigh(
    touches: Touches,
    free: FreePaths,
    found: Sequence[tuple[Target, Polished]],
    log_unknown: float,
    count: int,
    priors: Priors,
) -> tuple[list[Mode], float, float]:
    """All modes of all parts with their probabilities, best first, that of "none of these", and the log of all mass.

    Args:
        touches: the readings.
        free: paths on which nothing was met.
        found: the maxima of each part.
        log_unknown: log evidence of "none of these", its prior included.
        count: number of parts.
        priors: what is assumed beforehand.
    """
    prior = np.log1p(-priors.unknown) - np.log(max(count, 1))
    modes = [
        Mode(target, maxima, k, float(log) + np.log(alike(priors.pose, target.part)) + prior)
        for target, maxima in found
        for k, log in enumerate(maxima.log_evidence)
    ]
    modes.sort(key=lambda mode: -mode.log_mass)
    modes, weighed = _by_draws(touches, free, modes, log_unknown, priors)
    for _ in range(_MOST):
        could = _unblocked(free, modes, priors)
        if not modes or could.max() <= _least(modes + weighed, log_unknown):
            break
        mode = modes.pop(int(np.argmax(could)))
        try:
            new = _weighed(touches, free, mode, priors)
        except TooFewDrawsError:
            modes, around = _around(touches, free, mode, modes, priors)
            weighed += around
            continue
        if new.moments is not None:
            modes, apart = _not_part_of(new, modes), _not_part_of(new, weighed)
            within = [other for other in weighed if other not in apart]
            new, weighed = (_one_region(within[0], new) if within else new), apart
        weighed.append(new)
    modes = sorted(weighed + modes, key=lambda mode: -mode.log_mass)
    kin = np.array([m.log_mass + m.found.kin[m.k] for m in modes]) - np.log1p(-priors.unknown)
    log_unknown = log_none(log_unknown, kin, priors)
    total = _total(modes, log_unknown)
    alive = reported(np.array([m.log_mass for m in modes]), kin + np.log(priors.unknown * priors.kin), total)
    kept = [
        replace(_in_box(m, priors), probability=float(np.exp(m.log_mass - total)))
        for m, ok in zip(modes, alive, strict=True)
        if ok
    ]
    return kept, float(np.exp(log_unknown - total)), total


def _least(modes: Sequence[Mode], log_unknown: float) -> float:
    """Log mass that a mode has to have to be weighed."""
    return float(max(_total(modes, -np.inf) + np.log(_WEIGHED), _total(modes, log_unknown) + np.log(_FAINT)))


def _unblocked(free: FreePaths, modes: Sequence[Mode], priors: Priors) -> FloatArray:
    """Log mass of each mode if the part were in the way of no path: about its maximum it may well be in none."""
    out = np.array([mode.log_mass for mode in modes])
    if not len(free) or not modes:
        return out
    passed = len(free) * np.log1p(-priors.clutter)
    said = [
        log_free_paths(free, m.found.Ts[[m.k]], m.found.z[[m.k]], m.target, priors)[0] if near else passed
        for m, near in zip(modes, out > out.max() - NEGLIGIBLE, strict=True)
    ]
    return np.asarray(out + passed - said)


def _by_draws(
    touches: Touches, free: FreePaths, modes: list[Mode], log_unknown: float, priors: Priors
) -> tuple[list[Mode], list[Mode]]:
    """Modes that are left to weigh; and those of parts of which a rough pose is known that few readings do not fix."""
    pose = priors.pose
    if pose is None or pose.T_world_part is None or pose.T_world_part.ndim > 2 or len(touches) > _FEW:
        return modes, []
    left, weighed = modes, []
    floor = _total(modes, log_unknown) - NEGLIGIBLE
    for best in {id(mode.target): mode for mode in reversed(modes)}.values():
        if best.log_mass < floor or has_image_near(best.target.part, pose):
            continue
        found, rest = best.found, best.log_mass - float(best.found.log_evidence[best.k])
        of_part = [
            Mode(best.target, found, p.k, p.log_mass + rest, p.moments)
            for p in pieces(touches, free, best.target, found, priors)
        ]
        if of_part:
            left = [mode for mode in left if mode.target is not best.target]
            weighed += of_part
    return left, weighed


def has_image_near(part: Part, pose: PosePrior) -> bool:
    """Whether another pose that symmetry makes equal is not excluded by the rough pose."""
    assert pose.T_world_part is not None
    assert pose.root is not None
    x = SE3.log(part.symmetry.Ts) @ pose.root.T
    gaps = np.sum(x * x, axis=1)
    return bool(np.any((gaps > 1e-12) & (gaps < _IMAGE**2)))


def _total(modes: Sequence[Mode], log_unknown: float) -> float:
    return float(log_sum([log_unknown, *(mode.log_mass for mode in modes)]))


def _weighed(touches: Touches, free: FreePaths, mode: Mode, priors: Priors) -> Mode:
    """The mode with the moments and the mass of the posterior about it, where they are not those of its curvature."""
    if len(mode.free) > len(spins(mode.target.part)):
        return mode  # a direction is free: no covariance tells how the posterior looks
    target, found, k = mode.target, mode.found, mode.k
    information = np.array(found.information[k])
    if target.part.symmetry.continuous:
        keep = np.eye(len(information))
        keep[:6, :6] = off_spins(target.part)
        information = keep.T @ information @ keep
    density = partial(_density, touches, free, target, priors)
    brittle = _near_edges(touches, mode, priors)
    inside = within(priors, target.part)
    moments = posterior_moments(density, found.Ts[k], found.z[k], information, brittle, inside)
    if moments is None:
        return mode
    log = mode.log_mass - float(log_within(priors, target.part, found.Ts[[k]], found.information[[k]])[0])
    return replace(mode, log_mass=log + cut(priors, target.part, found.Ts[k], moments).log_mass, moments=moments)


def _in_box(mode: Mode, priors: Priors) -> Mode:
    """The mode with the moments of what a box leaves of it, if that is not all; its mass is of that already."""
    if within(priors, mode.target.part) is None or len(mode.free) > len(spins(mode.target.part)):
        return mode
    moments = mode.moments
    if moments is None:
        given = mode.covariance_given_shared
        moments = Moments(np.zeros(6), mode.covariance, mode.covariance if given is None else given, 0.0)
    left = cut(priors, mode.target.part, mode.found.Ts[mode.k], moments)
    if left.share == 1:
        return mode
    about = np.outer(left.mean, left.mean)
    covariances = left.covariance - about, left.covariance_given_shared - about
    return replace(mode, shift=left.mean, moments=Moments(np.zeros(6), *covariances, left.log_mass, left.share))


def _near_edges(touches: Touches, mode: Mode, priors: Priors) -> FloatArray | None:
    """Information on the pose that is of readings near edges ``(6, 6)``; None if there is none."""
    target, found, k = mode.target, mode.found, mode.k
    T, z = found.Ts[[k]], found.z[[k]]
    p = SE3.apply(SE3.inverse(T[0]), touches.points + touches.gains @ z[0])
    near = target.borders.near(p, REACH * touches.sd) & (touches.radii < touches.sd)
    if not near.any():
        return None
    own = information_of_readings(touches, T, z, target, priors)[0, near].sum(axis=0)
    keep = off_spins(target.part) if target.part.symmetry.continuous else np.eye(6)
    return np.asarray(keep.T @ own @ keep)


def _around(
    touches: Touches, free: FreePaths, mode: Mode, modes: list[Mode], priors: Priors
) -> tuple[list[Mode], list[Mode]]:
    """Other modes that are left; and those around a maximum that is unlike any single density."""
    others = [other.k for other in modes if other.found is mode.found]
    around, gone = modes_around(touches, free, mode, others, priors)
    return [other for other in modes if other.found is not mode.found or other.k not in gone], around


def _density(
    touches: Touches, free: FreePaths, target: Target, priors: Priors, Ts: FloatArray, z: FloatArray
) -> FloatArray:
    return log_posterior(touches, free, Ts, z, target, priors)


def _one_region(best: Mode, other: Mode) -> Mode:
    """Two maxima of one region, of which only the other one's draws saw the whole: about the best, with those moments.

    Each alone would count the same mass, or leave out what the best one's own ellipsoid does not reach.
    """
    assert other.moments is not None
    seen = other.moments
    mean = seen.mean + SE3.log(SE3.inverse(best.found.Ts[best.k]) @ other.found.Ts[other.k])
    shift = np.outer(mean, mean) - np.outer(seen.mean, seen.mean)
    covariances = seen.covariance + shift, seen.covariance_given_shared + shift
    moments = Moments(mean, *covariances, seen.log_mass, seen.share)
    return replace(best, log_mass=max(best.log_mass, other.log_mass), moments=moments)


def _not_part_of(mode: Mode, others: list[Mode]) -> list[Mode]:
    """Those maxima that do not lie within the region of a weighed mode."""
    own = [k for k, other in enumerate(others) if other.target is mode.target]
    if not own:
        return others
    information = np.asarray(np.linalg.pinv(mode.covariance, hermitian=True, rcond=1e-13), dtype=np.float64)
    Ts = np.stack([others[k].found.Ts[others[k].k] for k in own])
    here, rows = np.broadcast_to(mode.found.Ts[mode.k], Ts.shape), np.broadcast_to(information, (len(Ts), 6, 6))
    gaps = squared_gaps(mode.target.part, Ts, here, rows)
    gone = {k for k, gap in zip(own, gaps, strict=True) if gap <= _WITHIN}
    return [other for k, other in enumerate(others) if k not in gone]
