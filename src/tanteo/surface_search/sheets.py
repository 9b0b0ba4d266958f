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
from tanteo.matching.evidence import Priors, log_sum
from tanteo.matching.freedom import pose_scale
from tanteo.matching.prior import in_box
from tanteo.matching.verdict import off_spins
from tanteo.parts import Part
from tanteo.surface_search.given_pose import GivenPose, Posterior, given_pose
from tanteo.surface_search.moments import Moments, effective
from tanteo.surface_search.nodes import Nodes, about, of_rough_pose
from tanteo.surface_search.polish import Polished
from tanteo.surface_search.target import Target
from tanteo.surface_search.touches import FreePaths, Touches
from tanteo.typing import BoolArray, FloatArray, IntArray, Tangents, Transforms

_ROUNDS, _ENOUGH, _LEAST = 5, 200.0, 40.0
"""Rounds at most; effective draws with which no more are needed; with which the weights are believed at all."""

_HEAVY = 32
"""Draws about which the next round draws, the heaviest."""

_MAXIMA, _HOPELESS = 32, 25.0
"""Maxima that may be modes, and log odds below the best at which one is none."""

_ONE = 9.0
"""Squared Mahalanobis distance within which a maximum belongs to a larger mode."""

_FAINT = 1e-9
"""Draws that weigh less than this beside the heaviest are left out of moments."""

_NORMAL, _OFF = 0.25, 2.0
"""Root mean square by which a log density that is believed to be normal may differ; most that one draw counts."""


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
    found = found.take(np.flatnonzero(found.log_evidence > found.log_evidence[0] - _HOPELESS)[:_MAXIMA])
    posterior = partial(given_pose, touches, free, target, priors)
    drawn = all_over(touches, target, priors, posterior, found.Ts)
    inside = in_box(priors.pose, target.part, drawn.Ts)
    if drawn.effective < _LEAST or effective(np.where(inside, drawn.log_weights, -np.inf)) < _LEAST:
        return []
    log_anywhere = float(np.linalg.slogdet(pose_scale(priors.radius, target.part.centroid))[1])
    return _pieces(target.part, found, replace(drawn, log_weights=drawn.log_weights - log_anywhere), inside)


def all_over(touches: Touches, target: Target, priors: Priors, posterior: Posterior, maxima: Transforms) -> Drawn:
    """Draws from all of the posterior of a part of which a rough pose is known.

    Round after round, each from densities about what was heavy before; all weigh against all densities.

    Args:
        touches: all readings that met something.
        target: the part.
        priors: rate of clutter, the size of the workspace, and the rough pose.
        posterior: of the part, the rough pose counted in.
        maxima: of it ``(J, 4, 4)``.
    """
    nodes, tops = of_rough_pose(touches, target, priors, posterior, maxima)
    densities, peaks = [nodes], nodes.first(len(maxima))
    x, z = nodes.draw(0)
    at, log_q = posterior(nodes.poses(x), z), nodes.log_density(x)[None]
    while True:
        log = at.log - log_sum(log_q, axis=0) + np.log(len(densities) / len(x))
        drawn = Drawn(peaks, tops.first(len(maxima)), x, nodes.poses(x), at, log)
        if drawn.effective > _ENOUGH or len(densities) == _ROUNDS:
            return drawn
        heavy = np.argsort(-log, kind="stable")[:_HEAVY]
        added = about(touches, target, priors, posterior, drawn.Ts[heavy])[0]
        more, z = added.draw(len(densities))
        of_old = np.stack([density.log_density(more) for density in densities])
        x, at = np.concatenate([x, more]), at.join(posterior(nodes.poses(more), z))
        log_q, densities = np.concatenate([log_q, of_old], axis=1), [*densities, added]
        log_q = np.concatenate([log_q, added.log_density(x)[None]])


def _pieces(part: Part, found: Polished, drawn: Drawn, inside: BoolArray) -> list[Piece]:
    """Draws to modes: those about maxima that are far apart beside their spread; of draws outside a box nothing."""
    owner, w = drawn.owner, np.exp(drawn.log_weights)
    share = np.bincount(owner, weights=w, minlength=len(found.Ts))
    left, out = [int(k) for k in np.argsort(-share, kind="stable") if share[k] > 0], []
    while left:
        k = left.pop(0)
        moments = _moments(part, found, k, drawn, w * (owner == k))
        near = [i for i, gap in zip(left, _gaps(found.Ts[k], found.Ts[left], moments), strict=True) if gap < _ONE]
        left, owner = [i for i in left if i not in near], np.where(np.isin(owner, near), k, owner)
        mine = w * (owner == k)
        left_in = float(mine[inside].sum() / mine.sum())
        if not near and left_in > SURE and _is_normal(found, k, drawn, mine):
            out.append(Piece(k, float(found.log_evidence[k]), None))
        elif left_in > SURE:
            moments = _moments(part, found, k, drawn, mine) if near else moments
            out.append(Piece(k, float(np.log(mine.sum())), moments))
        elif left_in > 0:
            moments = replace(_moments(part, found, k, drawn, mine * inside), share=left_in)
            out.append(Piece(k, float(np.log(mine[inside].sum())), moments))
    return sorted(out, key=lambda piece: -piece.log_mass)


def _moments(part: Part, found: Polished, k: int, drawn: Drawn, w: FloatArray) -> Moments:
    """About a maximum; given the shared errors, what they explain of the pose is taken off.

    As if there were one draw more with the covariance of the curvature there: a few draws span no space of six.
    """
    some, keep = np.flatnonzero(w > _FAINT * w.max()), off_spins(part)
    x, share = SE3.log(SE3.inverse(found.Ts[k]) @ drawn.Ts[some]) @ keep.T, w[some] / w[some].sum()
    C = np.einsum("s,si,sk->ik", share, x, x)
    given, z = C, drawn.at.z[some] - found.z[k]
    if z.shape[1]:
        cross = np.einsum("s,si,sk->ik", share, x, z)
        spread = np.einsum("s,si,sk->ik", share, z, z) + np.einsum("s,sik->ik", share, drawn.at.spreads[some])
        given = C - cross @ np.linalg.solve(spread, cross.T)
    one = float(np.sum(share**2) / (1 + np.sum(share**2)))
    root = keep @ drawn.peaks.of_part(k)
    curvature = one * root @ root.T
    return Moments(share @ x, (1 - one) * C + curvature, (1 - one) * given + curvature, 0.0)


def _gaps(T: Transforms, others: Transforms, moments: Moments) -> FloatArray:
    """Squared Mahalanobis distances of other poses ``(S, 4, 4)`` from one with these moments."""
    x, C = SE3.log(SE3.inverse(T) @ others), moments.covariance
    s = np.sqrt(np.maximum(np.diag(C), 1e-300))
    x = x / s
    return np.asarray(np.sum(x * np.linalg.lstsq(C / np.outer(s, s), x.T, rcond=1e-9)[0].T, axis=1))


def _is_normal(found: Polished, k: int, drawn: Drawn, w: FloatArray) -> bool:
    """Whether the draws about a maximum have the density of its curvature, which has no noise then."""
    used = np.flatnonzero(w > 1e-3 * w.max())
    x, A = SE3.log(SE3.inverse(found.Ts[k]) @ drawn.Ts[used]), pose_information(found.information[k])
    off = drawn.at.log[used] - drawn.tops.log[k] + 0.5 * np.einsum("si,ik,sk->s", x, A, x)
    return bool(np.sqrt(np.average(np.clip(off, -_OFF, _OFF) ** 2, weights=w[used])) < _NORMAL)
