"""The posterior of a part of which a rough pose is known, by draws from all of it.

Where readings alone do not fix the pose, the posterior is no sum of ellipsoids about its maxima: a part slides along
the faces that were met, as far as the rough pose lets it, and where a face ends another piece begins, with or without a
maximum of its own. Draws from densities about poses all over it (:mod:`nodes`), weighed by the posterior, tell masses
and moments whatever the shape; where some weigh much, densities are added there and more is drawn (incremental mixture
importance sampling: Raftery and Bao 2010).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from tanteo.lie import SE3
from tanteo.localization import pose_information
from tanteo.matching.box import SURE
from tanteo.matching.freedom import pose_scale
from tanteo.matching.part_motions import off_spins
from tanteo.matching.prior import in_box
from tanteo.matching.priors import Priors, log_sum
from tanteo.parts import Part
from tanteo.surface_search.adapted_draws import effective
from tanteo.surface_search.given_pose import GivenPose, given_pose
from tanteo.surface_search.moments import Moments
from tanteo.surface_search.nodes import Nodes, Rough, about, of_rough_pose
from tanteo.surface_search.of_draws import ONE, gaps, is_normal, moments_of
from tanteo.surface_search.polish import Polished
from tanteo.surface_search.target import Target
from tanteo.surface_search.touches import FreePaths, Touches
from tanteo.typing import BoolArray, FloatArray, IntArray, Tangents, Transforms

_ROUNDS, _ENOUGH, LEAST = 5, 200.0, 40.0
"""Rounds at most; effective draws with which no more are needed; with which the weights are believed at all."""

_HEAVY = 32
"""Draws about which the next round draws, the heaviest."""

MOST_MAXIMA, HOPELESS = 32, 25.0
"""Maxima that may be modes, and log odds below the best at which one is none."""

_FAINT = 1e-9
"""Draws that weigh less than this beside the heaviest are left out of moments."""


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """A mode of the posterior.

    Attributes:
        k: its maximum.
        log_mass: of it, over "anywhere".
        moments: about its maximum; None where the posterior is normal there.
    """

    k: int
    log_mass: float
    moments: Moments | None


@dataclass(frozen=True, slots=True, eq=False)
class Drawn:
    """Draws from all of a posterior.

    Attributes:
        peaks: densities about its maxima, by their curvature.
        tops: the posterior at these.
        x: the draws, as perturbations of the rough pose ``(S, 6)``.
        Ts: the same as poses ``(S, 4, 4)``.
        at: the posterior there.
        log_weights: of each; they sum to the integral of the posterior ``(S,)``.
    """

    peaks: Nodes
    tops: GivenPose
    x: Tangents
    Ts: Transforms
    at: GivenPose
    log_weights: FloatArray

    @property
    def effective(self) -> float:
        """Number of draws that carry the weight."""
        return effective(self.log_weights)

    @property
    def owner(self) -> IntArray:
        """The maximum that each draw is about, in the spread of its curvature ``(S,)``."""
        return self.peaks.nearest(self.x)


def pieces(touches: Touches, free: FreePaths, target: Target, found: Polished, priors: Priors) -> list[Piece]:
    """The modes of a part of which a rough pose is known, best first; none if too few draws count to believe them.

    Args:
        touches: all readings that met something.
        free: all paths on which nothing was met.
        target: the part.
        found: its maxima, best first.
        priors: rate of clutter, the size of the workspace, and the rough pose.
    """
    found = found.take(np.flatnonzero(found.log_evidence > found.log_evidence[0] - HOPELESS)[:MOST_MAXIMA])
    posterior = partial(given_pose, touches, free, target, priors)
    drawn = all_over(Rough.of_prior(touches, target, priors, posterior), found.Ts)
    inside = in_box(priors.pose, target.part, drawn.Ts)
    if drawn.effective < LEAST or effective(np.where(inside, drawn.log_weights, -np.inf)) < LEAST:
        return []
    log_anywhere = float(np.linalg.slogdet(pose_scale(priors.radius, target.part.centroid))[1])
    return pieces_of(target.part, found, replace(drawn, log_weights=drawn.log_weights - log_anywhere), inside)


def all_over(rough: Rough, maxima: Transforms) -> Drawn:
    """Draws from all of the posterior of a part of which a rough pose is known.

    Round after round, each from densities about what was heavy before; all weigh against all densities.

    Args:
        rough: the part, with its readings.
        maxima: of the posterior ``(J, 4, 4)``.
    """
    nodes, tops = of_rough_pose(rough, maxima)
    densities, peaks = [nodes], nodes.first(len(maxima))
    x, z = nodes.draw(0)
    at, log_q = rough.posterior(nodes.poses(x), z), nodes.log_density(x)[None]
    while True:
        log = at.log - log_sum(log_q, axis=0) + np.log(len(densities) / len(x))
        drawn = Drawn(peaks, tops.first(len(maxima)), x, nodes.poses(x), at, log)
        if drawn.effective > _ENOUGH or len(densities) == _ROUNDS:
            return drawn
        heavy = np.argsort(-log, kind="stable")[:_HEAVY]
        added = about(rough, drawn.Ts[heavy])[0]
        more, z = added.draw(len(densities))
        of_old = np.stack([density.log_density(more) for density in densities])
        x, at = np.concatenate([x, more]), at.join(rough.posterior(nodes.poses(more), z))
        log_q, densities = np.concatenate([log_q, of_old], axis=1), [*densities, added]
        log_q = np.concatenate([log_q, added.log_density(x)[None]])


def pieces_of(part: Part, found: Polished, drawn: Drawn, inside: BoolArray) -> list[Piece]:
    """Draws to modes: those about maxima that are far apart beside their spread; of draws outside a box nothing."""
    owner, w = drawn.owner, np.exp(drawn.log_weights)
    share = np.bincount(owner, weights=w, minlength=len(found.Ts))
    left, out = [int(k) for k in np.argsort(-share, kind="stable") if share[k] > 0], []
    while left:
        k = left.pop(0)
        moments = _moments(part, found, k, drawn, w * (owner == k))
        apart = gaps(found.Ts[k], found.Ts[left], moments.covariance)
        near = [i for i, gap in zip(left, apart, strict=True) if gap < ONE]
        left, owner = [i for i in left if i not in near], np.where(np.isin(owner, near), k, owner)
        mine = w * (owner == k)
        left_in = float(mine[inside].sum() / mine.sum())
        if not near and left_in > SURE and is_normal(_off_normal(found, k, drawn), mine):
            out.append(Piece(k, float(found.log_evidence[k]), None))
        elif left_in > SURE:
            moments = _moments(part, found, k, drawn, mine) if near else moments
            out.append(Piece(k, float(np.log(mine.sum())), moments))
        elif left_in > 0:
            moments = replace(_moments(part, found, k, drawn, mine * inside), share=left_in)
            out.append(Piece(k, float(np.log(mine[inside].sum())), moments))
    return sorted(out, key=lambda piece: -piece.log_mass)


def _moments(part: Part, found: Polished, k: int, drawn: Drawn, w: FloatArray) -> Moments:
    """About a maximum, of draws with weights ``(S,)``; a continuous symmetry is no spread."""
    some, keep = np.flatnonzero(w > _FAINT * w.max()), off_spins(part)
    x, z = SE3.log(SE3.inverse(found.Ts[k]) @ drawn.Ts[some]) @ keep.T, drawn.at.z[some] - found.z[k]
    return moments_of(x, w[some], z, drawn.at.spreads[some], keep @ drawn.peaks.of_part(k))


def _off_normal(found: Polished, k: int, drawn: Drawn) -> FloatArray:
    """By how much the log density at the draws is off that of the curvature at a maximum ``(S,)``."""
    x, A = SE3.log(SE3.inverse(found.Ts[k]) @ drawn.Ts), pose_information(found.information[k])
    return np.asarray(drawn.at.log - drawn.tops.log[k] + 0.5 * np.einsum("si,ik,sk->s", x, A, x))
