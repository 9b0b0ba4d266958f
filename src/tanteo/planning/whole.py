"""Features that a hand acquires whole, as candidates: the rim of a bore, its wall; what each would tell, and its time.

No single reading shows where a rim is. The hand acquires it by many readings in a row, which give a feature with
covariance: so far is its frame off where the likeliest pose has it, so far its size. That is predicted for every sample
of the belief, and tells about part and pose as readings do (``utility``).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TypeAlias

import numpy as np

from tanteo import _core
from tanteo.features import CIRCLE, CYLINDER, FeatureKind
from tanteo.geometry import SE3
from tanteo.geometry.typing import BoolArray, FloatArray, IntArray, Transforms, Vectors
from tanteo.parts import Part, round_features
from tanteo.planning.context import DecisionContext
from tanteo.planning.feature_candidates import shrunk
from tanteo.planning.samples import Samples, draw
from tanteo.planning.state import SensingState
from tanteo.planning.utility import ALONE, MEANWHILE, SAMPLES, about_hit

_ACQUIRED = 0.95
"""Probability that a feature is acquired that is there."""

_OTHER = 5.0
"""What is more standard deviations off the idea is not acquired, as it is another one."""

_ALIKE = 0.5
"""Product of the directions of axes from which they are alike."""


@dataclass(frozen=True, slots=True, eq=False)
class PartFeatures:
    """Features of one kind of a part that can be acquired whole.

    Attributes:
        points: origins of their frames, in the part's ``(n, 3)`` [m].
        axes: about which they are free to turn ``(n, 3)``.
        sizes: as of the kind ``(n,)``.
        convex: on which side the material is ``(n,)``.
    """

    points: Vectors
    axes: Vectors
    sizes: FloatArray
    convex: IntArray


@dataclass(frozen=True, slots=True)
class WholeKind:
    """A kind of feature that is acquired whole.

    Attributes:
        kind: of the feature.
        sds: with which it is acquired as a rule, by the rows of the kind [m, rad], and of its size [m].
        seconds: that this takes, travelling there not included.
        of_part: all that a part has.
    """

    kind: FeatureKind
    sds: tuple[float, ...]
    size_sd: float
    seconds: float
    of_part: Callable[[Part], PartFeatures]


@dataclass(frozen=True, slots=True, eq=False)
class WholeFeature:
    """A feature that can be acquired now.

    Attributes:
        kind: key of :data:`WHOLE`.
        name: in words.
        mode: of the belief, of whose part it is.
        T_world_feature: where that mode has it ``(4, 4)``, its z along its axis.
        size: of it.
        convex: on which side the material is.
        place_sd: farther off than five of these [m] another one would be sensed.
        size_share: likewise of the size, as a share of it.
        origin: where the hand begins, world ``(3,)`` [m].
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
    """Ends of bores and bosses that are open."""
    rows = [(r.centre, r.axis, r.radius, not one.hole) for one in round_features(part) for r in one.rims if r.open]
    return _listed(rows)


def _walls(part: Part) -> PartFeatures:
    """The same ends of those that are cylinders: the wall is acquired from there."""
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
"""What is acquired whole, by kind; spreads and times as ``benchmarks/sense_round.py`` has them, the face included."""


def whole_information(offers: Offers, context: DecisionContext) -> FloatArray:
    """What each is expected to tell about part and pose ``(F,)`` [nats], as far as it is asked for.

    Args:
        offers: the features.
        context: belief, tolerance, and what is asked for.
    """
    s = context
    samples = draw(s.state, SAMPLES, s.tolerance, s.feature)
    seen = [_Seen.of(one, samples, s.state) for one in offers]
    told = np.array([each.about_pose() + each.about(samples.mode) for each in seen])
    if not (s.part_only or s.part_open):
        return told
    return np.asarray((ALONE if s.part_only else MEANWHILE) * told + [each.about(samples.part) for each in seen])


def whole_seconds(offers: Offers, context: DecisionContext) -> FloatArray:
    """Time that each takes, travelling there included ``(F,)``."""
    place = context.place
    ways = np.array([0.0 if place is None else float(np.linalg.norm(one.origin - place)) for one in offers])
    return np.asarray([WHOLE[one.kind].seconds for one in offers] + ways / context.probe.speed)


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    """A feature, and what would be sensed of it at every sample.

    Attributes:
        one: the feature.
        samples: of the belief.
        G: how the part's perturbation moves it, rows of its kind ``(m, 6)``.
        means: how far off where it should be it is, and its size ``(m + 1, S)``.
        there: whether there is one that would be taken for it ``(S,)``.
    """

    one: WholeFeature
    samples: Samples
    G: FloatArray
    means: FloatArray
    there: BoolArray

    @classmethod
    def of(cls, one: WholeFeature, samples: Samples, state: SensingState) -> _Seen:
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
        """What it tells of the pose if its mode is true: half the log of a ratio of determinants."""
        rows = np.flatnonzero(self.samples.mode == self.one.mode)
        if not len(rows):
            return 0.0
        R, first = np.diag(np.square(WHOLE[self.one.kind].sds)), rows[0]
        told = shrunk(self.G, R, self.samples.whole[first], self.samples.useful[first])
        return float(_ACQUIRED * self.samples.weights[rows].sum() * told)

    def about(self, groups: IntArray) -> float:
        """What it tells of which group it is: by whether it is acquired, and by the best of its numbers."""
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
    """Of the features of a part at poses that which would be taken for it: rows and size ``(m + 1, S)``; if any is."""
    same = found.convex == one.convex
    sizes, R = found.sizes[same], one.T_world_feature[:3, :3]
    places = (SE3.apply(Ts[:, None], found.points[same]) - one.T_world_feature[:3, 3]) @ R
    axes = np.einsum("sij,nj->sni", Ts[:, :3, :3], found.axes[same]) @ R
    x, y, z = np.moveaxis(axes, -1, 0)
    off = np.concatenate([places, np.stack([-y, x, np.zeros_like(x)], axis=-1)], axis=-1)
    away = np.maximum(np.linalg.norm(places, axis=-1) / one.place_sd, np.abs(np.log(sizes / one.size)) / one.size_share)
    away = np.where(z > _ALIKE, away, np.inf)
    best, line = np.argmin(away, axis=1), np.arange(len(Ts))
    rows = off[line, best][:, list(WHOLE[one.kind].kind.rows)].T
    return np.concatenate([rows, sizes[best][None] - one.size]), away[line, best] <= _OTHER
