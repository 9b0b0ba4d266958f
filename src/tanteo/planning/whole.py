"""Complete features as candidates, such as the rim or the wall of a bore: expected information and duration.

No single reading locates a rim. The hand acquires it by many readings, which together determine a feature with a
covariance. For every sample of the posterior, the deviations of the feature's frame and size from the expected ones are
predicted. The information about part and pose follows from them as for readings (``utility``).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TypeAlias

import numpy as np

from tanteo import _core
from tanteo.features.kinds import CIRCLE, CYLINDER, FeatureKind
from tanteo.geometry import SE3
from tanteo.geometry.typing import BoolArray, FloatArray, IntArray, Transforms, Vectors
from tanteo.parts import Part, round_features
from tanteo.planning.context import DecisionContext
from tanteo.planning.feature_candidates import shrunk
from tanteo.planning.samples import Samples, draw
from tanteo.planning.state import SensingState
from tanteo.planning.utility import ALONE, MEANWHILE, SAMPLES, about_hit

_ACQUIRED = 0.95
"""Probability that an acquisition succeeds if the feature exists."""

_OTHER = 5.0
"""Deviation from the initial guess beyond which a feature counts as a different one [standard deviations]."""

_SAME_AXIS = 0.5
"""Cosine of the angle between two axes above which they may belong to the same feature."""


@dataclass(frozen=True, slots=True, eq=False)
class PartFeatures:
    """Features of one kind on a part that a hand can acquire completely.

    Attributes:
        points: origins of their frames, part frame ``(n, 3)`` [m].
        axes: axes of rotational symmetry, part frame ``(n, 3)``.
        sizes: radii ``(n,)`` [m].
        convex: whether the material is inside the radius, as for a boss ``(n,)``.
    """

    points: Vectors
    axes: Vectors
    sizes: FloatArray
    convex: IntArray


@dataclass(frozen=True, slots=True)
class WholeKind:
    """Kind of feature that a hand acquires completely.

    Attributes:
        kind: kind of the feature.
        sds: usual standard deviations of an acquired feature's frame, for the constrained components of the kind
            [m, rad].
        size_sd: usual standard deviation of an acquired feature's radius [m].
        seconds: usual duration of an acquisition without travel [s].
        of_part: function that returns all features of this kind on a part.
    """

    kind: FeatureKind
    sds: tuple[float, ...]
    size_sd: float
    seconds: float
    of_part: Callable[[Part], PartFeatures]


@dataclass(frozen=True, slots=True, eq=False)
class WholeFeature:
    """Feature of a part at one mode that the hand can reach and acquire completely.

    Attributes:
        kind: key of :data:`WHOLE`.
        name: name of the feature.
        mode: index of the mode whose part has it.
        T_world_feature: frame of the feature at that mode ``(4, 4)``, z along its axis.
        size: radius [m].
        convex: whether the material is inside the radius, as for a boss.
        place_sd: standard deviation of its position [m]; a feature more than five of these away is a different one.
        size_share: standard deviation of its radius as a fraction of it, with the same meaning.
        origin: start of the acquisition, world frame ``(3,)`` [m].
    """

    kind: str
    name: str
    mode: int
    T_world_feature: Transforms
    size: float
    convex: bool
    place_sd: float
    size_share: float
    origin: Vectors


Offers: TypeAlias = Sequence[WholeFeature]


def _rims(part: Part) -> PartFeatures:
    """Return the open ends of bores and bosses."""
    rows = [(r.centre, r.axis, r.radius, not one.hole) for one in round_features(part) for r in one.rims if r.open]
    return _listed(rows)


def _walls(part: Part) -> PartFeatures:
    """Return the open ends of cylindrical bores and bosses, from which the wall is acquired."""
    some = [one for one in round_features(part) if one.surface == "cylinder"]
    return _listed([(r.centre, r.axis, r.radius, not one.hole) for one in some for r in one.rims if r.open])


def _listed(rows: list[tuple[FloatArray, FloatArray, float, bool]]) -> PartFeatures:
    n = len(rows)
    points, axes = (np.array([row[k] for row in rows]).reshape(n, 3) for k in (0, 1))
    return PartFeatures(
        points, axes, np.array([row[2] for row in rows]), np.array([row[3] for row in rows], dtype=np.int64)
    )


WHOLE: Mapping[str, WholeKind] = MappingProxyType({
    CIRCLE.name: WholeKind(CIRCLE, (1.5e-4, 1.9e-4, 2.7e-4, 2.5e-3, 1.2e-2), 1e-4, 90.0, _rims),
    CYLINDER.name: WholeKind(CYLINDER, (1.5e-4, 1.9e-4, 2.5e-3, 1.2e-2), 1e-4, 155.0, _walls),
})  # fmt: skip
"""Kinds of complete features by name. ``benchmarks/sense_round.py`` measures their standard deviations and durations,
which include the face around the rim."""


def whole_information(offers: Offers, context: DecisionContext) -> FloatArray:
    """Return the expected information of each feature about part and pose ``(F,)`` [nats].

    It is weighted by the goal as for single readings (``information``).

    Args:
        offers: features that the hand can acquire.
        context: posterior, tolerance and goal.
    """
    s = context
    samples = draw(s.state, SAMPLES, s.tolerance, s.feature)
    predicted = [_PredictedFeature.of(one, samples, s.state) for one in offers]
    information = np.array([each.about_pose() + each.about(samples.mode) for each in predicted])
    if not (s.part_only or s.part_open):
        return information
    return np.asarray(
        (ALONE if s.part_only else MEANWHILE) * information + [each.about(samples.part) for each in predicted]
    )


def whole_seconds(offers: Offers, context: DecisionContext) -> FloatArray:
    """Return the duration of each acquisition including travel ``(F,)`` [s].

    Args:
        offers: features that the hand can acquire.
        context: position and speed of the probe.
    """
    place = context.place
    travel = np.array([0.0 if place is None else float(np.linalg.norm(one.origin - place)) for one in offers])
    return np.asarray([WHOLE[one.kind].seconds for one in offers] + travel / context.probe.speed)


@dataclass(frozen=True, slots=True, eq=False)
class _PredictedFeature:
    """Predicted results of the acquisition of a feature for every sample.

    Attributes:
        one: feature to acquire.
        samples: samples of the posterior.
        G: Jacobian of the feature's frame over the pose of the part, rows of its kind ``(m, 6)``.
        means: deviation of frame and size from the expected ones ``(m + 1, S)``.
        there: whether the acquisition would find a feature ``(S,)``.
    """

    one: WholeFeature
    samples: Samples
    G: FloatArray
    means: FloatArray
    there: BoolArray

    @classmethod
    def of(cls, one: WholeFeature, samples: Samples, state: SensingState) -> _PredictedFeature:
        T_part_feature = SE3.inverse(state.poses[one.mode]) @ one.T_world_feature
        G = SE3.adjoint_inverse(T_part_feature)[list(WHOLE[one.kind].kind.rows)]
        means, there = np.zeros((len(G) + 1, len(samples))), np.zeros(len(samples), dtype=bool)
        for part in np.unique(samples.part):
            some = np.flatnonzero(samples.part == part)
            found = WHOLE[one.kind].of_part(samples.targets[part].part)
            if (found.convex == one.convex).any():
                means[:, some], there[some] = _nearest(one, found, samples.Ts[some])
        return cls(one, samples, G, means, there)

    def about_pose(self) -> float:
        """Return the information about the pose if the mode is true: half the log of a ratio of determinants."""
        rows = np.flatnonzero(self.samples.mode == self.one.mode)
        if not len(rows):
            return 0.0
        R, first = np.diag(np.square(WHOLE[self.one.kind].sds)), rows[0]
        information = shrunk(self.G, R, self.samples.whole[first], self.samples.useful[first])
        return float(_ACQUIRED * self.samples.weights[rows].sum() * information)

    def about(self, groups: IntArray) -> float:
        """Return the information about the samples' group, from success or failure and the best single component."""
        group = np.unique(groups, return_inverse=True)[1]
        if group.max(initial=0) == 0:
            return 0.0
        entry, w = WHOLE[self.one.kind], np.where(self.there, _ACQUIRED, 0.0) * self.samples.weights
        spread = np.einsum("ri,sij,rj->rs", self.G, self.samples.covariances, self.G)
        sds = np.array([*entry.sds, entry.size_sd])
        variances = np.concatenate([spread, np.zeros((1, len(w)))]) + np.square(sds)[:, None]
        each = _core.group_information(np.tile(w, (len(sds), 1)), self.means, variances, group)
        return float(about_hit(w[None], self.samples, groups)[0] + each.max())


def _nearest(one: WholeFeature, found: PartFeatures, Ts: Transforms) -> tuple[FloatArray, BoolArray]:
    """Return the deviations of the nearest feature at every pose ``(m + 1, S)``, and whether it would be acquired."""
    same = found.convex == one.convex
    sizes, R = found.sizes[same], one.T_world_feature[:3, :3]
    places = (SE3.apply(Ts[:, None], found.points[same]) - one.T_world_feature[:3, 3]) @ R
    axes = np.einsum("sij,nj->sni", Ts[:, :3, :3], found.axes[same]) @ R
    x, y, z = np.moveaxis(axes, -1, 0)
    off = np.concatenate([places, np.stack([-y, x, np.zeros_like(x)], axis=-1)], axis=-1)
    away = np.maximum(np.linalg.norm(places, axis=-1) / one.place_sd, np.abs(np.log(sizes / one.size)) / one.size_share)
    away = np.where(z > _SAME_AXIS, away, np.inf)
    best, line = np.argmin(away, axis=1), np.arange(len(Ts))
    rows = off[line, best][:, list(WHOLE[one.kind].kind.rows)].T
    return np.concatenate([rows, sizes[best][None] - one.size]), away[line, best] <= _OTHER
