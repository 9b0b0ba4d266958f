"""Measurements and priors of an inference, compiled for the core."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from tanteo import _core
from tanteo.catalogue.copies import Resolution
from tanteo.factors import ContactPoints, FreeRays, PoseFactor
from tanteo.factors.factor import state_columns
from tanteo.geometry import SE3
from tanteo.geometry.typing import Covariances, FloatArray, Indices, IntArray, Transforms
from tanteo.parts import Part
from tanteo.posterior.answers.pose_prior import log_density_within
from tanteo.posterior.answers.priors import Priors
from tanteo.posterior.furniture_points import FurniturePoints, outlier_log_density, weigh_furniture, without_pose
from tanteo.posterior.labels import LabelEvidence, groups_of, label_evidence
from tanteo.posterior.outliers import DistantPoints, outlier_rates
from tanteo.posterior.prepared import PreparedPart
from tanteo.posterior.settings import DEFAULTS, POSE_DOF, Settings
from tanteo.posterior.stable_poses import FLUSH, log_flush, resting
from tanteo.posterior.touched_region import TouchedRegion, touched_region


@dataclass(frozen=True, slots=True, eq=False)
class PoseMixture:
    """Mixture of normal densities of the pose of one part.

    Attributes:
        Ts: means ``T_world_part`` ``(A, 4, 4)``.
        covariances: covariances ``(A, 6, 6)``, order x y z rx ry rz, part frame, right perturbation [m, rad].
        log_weights: log of the weights ``(A,)``.
    """

    Ts: Transforms
    covariances: Covariances
    log_weights: FloatArray

    def squared_distances(self, Ts: Transforms) -> FloatArray:
        """Return the squared Mahalanobis distance of poses ``(S, 4, 4)`` from the nearest mean ``(S,)``."""
        gaps = SE3.log(SE3.inverse(self.Ts)[:, None] @ Ts)
        whitened = np.linalg.solve(np.linalg.cholesky(self.covariances)[:, None], gaps[..., None])[..., 0]
        return np.asarray(np.sum(whitened**2, axis=-1).min(axis=0))


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """Measurements and priors of an inference; immutable.

    Attributes:
        points: contact points and beam hits.
        rays: free-space rays.
        priors: priors; the radius of the workspace is positive [m].
        mixtures: prior of the pose of each part, in place of ``priors.pose``.
        odds: log odds of each part by its global properties, by name; empty without measurements of these.
        pose_factors: measurements of the pose other than points and rays, such as images and functions of a user.
        settings: settings of the inference.
        typical_area: surface area of a typical object, the mean of the parts [m^2]; 0 without parts.
        furniture: points that may be on furniture.
        groups: index of the label of each point ``(n,)``; -1 for a point without a label.
        label_evidence: densities of labelled points on surfaces of an unknown object.
        distant: points that are on no object of the size of the parts which has the others.
        region: size of the region that measurements without a direction touch.
        log_outlier: log density of each point as an outlier ``(n,)``.
    """

    points: ContactPoints
    rays: FreeRays
    priors: Priors
    mixtures: dict[PreparedPart, PoseMixture] = field(default_factory=dict)
    odds: Mapping[str, float] = field(default_factory=dict)
    pose_factors: tuple[PoseFactor, ...] = ()
    settings: Settings = DEFAULTS
    typical_area: float = 0.0
    furniture: FurniturePoints = field(init=False, repr=False)
    groups: IntArray = field(init=False, repr=False)
    label_evidence: LabelEvidence = field(init=False, repr=False)
    distant: DistantPoints = field(init=False, repr=False)
    region: TouchedRegion = field(init=False, repr=False)
    log_outlier: FloatArray = field(init=False, repr=False)
    _factors: list[tuple[_core.FactorList, Indices]] = field(init=False, repr=False, default_factory=list)
    _compiled: list[_core.Problem] = field(init=False, repr=False, default_factory=list)

    def __post_init__(self) -> None:
        groups = groups_of(self.points)
        object.__setattr__(self, "groups", groups)
        object.__setattr__(self, "log_outlier", outlier_log_density(self.points, self.priors))
        object.__setattr__(self, "furniture", weigh_furniture(self.points, self.priors, self.settings.search))
        placed = self.points.placed & ~self.furniture.on_furniture  # a centre may be beyond the end of its hole
        distant = DistantPoints.of(self.points.points, placed, self.priors.radius)
        object.__setattr__(self, "distant", distant)
        region = touched_region(self.points, groups, self.furniture.others, distant.rows)
        object.__setattr__(self, "region", region)
        evidence = label_evidence(self.points, groups, self.priors.radius, region.groups)
        object.__setattr__(self, "label_evidence", evidence)

    def __reduce__(self) -> tuple[Any, ...]:
        """Return what copies and other processes need; everything else is computed again."""
        own = self.points, self.rays, self.priors, self.mixtures, self.odds, self.pose_factors, self.settings
        return Problem, (*own, self.typical_area)

    @property
    def scale_sd(self) -> float:
        """Return the log of the factor to which the noise is known, the unit of the noise state; 0 without points."""
        return self.priors.log_noise_factor if len(self.points) else 0.0

    @property
    def shared_errors(self) -> int:
        """Return the number of shared errors: of the points first, then of each pose factor."""
        own = int(self.points.shared_jacobian.shape[2])
        return own + (state_columns(self.pose_factors, own)[1] if self.pose_factors else 0)

    def may_fix(self, part: Part) -> bool:
        """Return whether there are enough measurements for the pose of a part; else the answer is insufficient."""
        if self.priors.pose is not None or self.mixtures or self.pose_factors:
            return True
        symmetry = part.symmetry
        free = POSE_DOF // 2 if symmetry.spherical else int(symmetry.continuous)
        return self.points.constrained + 2 * int(self.points.oriented.sum()) + len(self.rays) >= POSE_DOF - free

    @property
    def states(self) -> int:
        """Return the number of states beside the pose: shared errors and the noise scale."""
        return self.shared_errors + (self.scale_sd > 0)

    @property
    def resolution(self) -> Resolution:
        """Return the noise of the points, at the least scale that its prior expects.

        It is 0 without points, and if other measurements, such as images, know the parts themselves.
        """
        points = self.points
        if not len(points) or self.pose_factors:
            return Resolution(0.0)
        least = float(np.sqrt(max(np.linalg.eigvalsh(points.covs)[:, 0].min(), 0.0)))
        return Resolution(
            least * math.exp(-self.scale_sd),
            float(points.normal_sds.min()) if points.oriented.any() else math.inf,
            len(points),
        )

    @property
    def log_factors_unknown(self) -> float:
        """Return the log density of all pose factors if the object is unknown."""
        return float(sum(factor.log_unknown for factor in self.pose_factors))

    @property
    def log_not_on_part(self) -> FloatArray:
        """Return the log density of each point as an outlier or on furniture ``(n,)``."""
        return np.asarray(self.log_outlier + np.log1p(self.furniture.over_outlier))

    def log_odds(self, part: Part) -> float:
        """Return the log odds of a part by its global properties."""
        return self.odds.get(part.name, 0.0)

    def mixture(self, prepared: PreparedPart) -> PoseMixture | None:
        """Return the prior of the pose of a part as a mixture of normal densities; None without a prior pose."""
        if prepared in self.mixtures:
            return self.mixtures[prepared]
        pose = self.priors.pose
        if pose is None or pose.T_world_part is None:
            return None
        Ts = np.asarray(pose.T_world_part).reshape(-1, 4, 4)
        C = np.asarray(pose.covariance).reshape(-1, 6, 6)
        return PoseMixture(Ts, C, np.full(len(Ts), -np.log(len(Ts))))

    def log_pose_density(self, prepared: PreparedPart) -> float:
        """Return the log of the constant factors of the pose prior, a density per shift [m] and turn [rad]."""
        anywhere = -3 * np.log(2 * self.priors.radius) - np.log(8 * np.pi**2)
        pose = self.priors.pose
        placed = prepared in self.mixtures or (pose is not None and pose.T_world_part is not None)
        if placed or any(factor.is_pose_prior for factor in self.pose_factors):
            anywhere = 0.0  # the mixture, or the factor, is a density already
        if pose is None:
            return float(anywhere)
        return float(
            anywhere
            - log_flush(pose.planes, prepared.part)
            + log_density_within(replace(pose, T_world_part=None, covariance=None), self.priors.radius)
        )

    @property
    def factors(self) -> list[tuple[_core.FactorList, Indices]]:
        """Return the measurements for the core, compiled once for all parts."""
        if not self._factors and len(self.points):
            furniture = without_pose(self.points, self.priors).furniture
            self._factors.extend(self.points.compiled(self.log_outlier, [one.surface for one in furniture]))
        return self._factors

    def compiled(self, prepared: PreparedPart, *, with_prior: bool = True) -> _core.Problem:
        """Return the problem of one part for the core, with or without the prior densities of its pose.

        Without priors and pose factors it is the same for all parts.
        """
        if self.mixtures or self.pose_factors or self.priors.pose is not None:
            return self._compiled_for(prepared, with_prior=with_prior)
        if not self._compiled:
            self._compiled.append(self._compiled_for(prepared, with_prior=with_prior))
        return self._compiled[0]

    def _compiled_for(self, prepared: PreparedPart, *, with_prior: bool) -> _core.Problem:
        """Return the problem of one part for the core."""
        t, rays = self.points, self.rays
        rates, weights = outlier_rates(self.priors.outlier_rate, len(t))
        rays = rays.join(self.furniture.paths) if len(self.furniture.paths) else rays
        planes = self.priors.pose.planes if self.priors.pose is not None else ()
        lines = np.column_stack(
            [rays.origins, rays.directions, rays.lengths - rays.margin, rays.slopes, np.cos(rays.incidences)]
        )
        means, roots, log_weights = self._normals(prepared)
        if not with_prior:
            means, roots, log_weights = means[:0], roots[:0], log_weights[:0]
        more = ((0, 0), (0, 0), (0, self.shared_errors - t.shared_jacobian.shape[2]))
        turns = _c(np.pad(t.turn_jacobian, more)) if len(t.turn_jacobian) else np.zeros((0, 3, 0))
        core = _core.make_problem(
            self.factors, _c(self.furniture.over_outlier), self.groups, _c(self.label_evidence.log_odds),
            _c(np.pad(t.shared_jacobian, more)),
            turns, float(self.scale_sd), _c(rates), _c(weights), self.priors.outlier_rate, _c(lines),
            _c(np.pad(rays.shared_jacobian, more)), _c(np.pad(rays.turns, more)), _c(means), _c(roots), _c(log_weights),
            np.concatenate([np.zeros(0), *(np.r_[plane.point, plane.normal, plane.sd] for plane in planes)]),
            np.array([self.region.area, self.region.length]), self.region.groups,
            np.pad(t.one_sided, (0, self.shared_errors - len(t.one_sided))).astype(np.int32),
        )  # fmt: skip
        for plane in planes[:FLUSH]:
            core.add(resting(plane, prepared.part))
        if not self.pose_factors:
            return core
        places, _ = state_columns(self.pose_factors, t.shared_jacobian.shape[2])
        for factor, (first, common) in zip(self.pose_factors, places, strict=True):
            core.add(factor.term(prepared.part, first, common))
        return core

    def _normals(self, prepared: PreparedPart) -> tuple[Transforms, FloatArray, FloatArray]:
        """Return means, roots of inverse covariances and log weights of the pose prior, with symmetric images."""
        known = self.mixture(prepared)
        if known is None:
            return np.zeros((0, 4, 4)), np.zeros((0, 6, 6)), np.zeros(0)
        roots = np.swapaxes(np.linalg.cholesky(np.linalg.inv(known.covariances)), -1, -2)
        log = known.log_weights - 3 * np.log(2 * np.pi) - 0.5 * np.linalg.slogdet(known.covariances)[1]
        turn = np.sqrt(np.linalg.eigvalsh(known.covariances[:, 3:, 3:])[:, -1])
        log = log - np.log([math.erf(np.pi / (np.sqrt(2) * one)) for one in turn])  # no rotation exceeds half a turn
        turns = prepared.part.symmetry.Ts
        if len(turns) == 1:
            return known.Ts, roots, log
        # a pose is as probable as all that symmetry makes of it: log(T0^-1 T S) = Ad(S^-1) log((T0 S^-1)^-1 T)
        back = SE3.inverse(turns)
        means, roots = known.Ts[:, None] @ back, roots[:, None] @ SE3.adjoint(back)
        return means.reshape(-1, 4, 4), roots.reshape(-1, 6, 6), np.repeat(log, len(turns))


def _c(values: FloatArray) -> FloatArray:
    return np.ascontiguousarray(values, dtype=np.float64)
