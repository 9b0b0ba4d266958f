"""Start of a session: a mixture of prior poses for each part, or factors such as an image."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tanteo.errors import InputError
from tanteo.factors import PoseFactor
from tanteo.geometry import SE3, check_covariances, check_transforms
from tanteo.geometry.limits import check_places, check_spreads
from tanteo.geometry.typing import Covariances, FloatArray, IntArray, Transforms
from tanteo.parts import Part
from tanteo.parts.readers import as_part
from tanteo.posterior import Hypothesis, PoseMixture, PosePrior, PreparedPart, Priors, prepare_all, sized
from tanteo.values import Value, lock

ORIGIN_SDS = 0.005, float(np.radians(3.0))
"""Default standard deviations of a prior pose along [m] and about [rad] each axis."""

_BEYOND = 1.2
"""Spread of sampled prior poses, as a multiple of the prior standard deviations."""

_TURN = 3.0
"""Numerical: largest rotation sd of a hypothesis as a prior pose [rad]. Below pi, at which a rotation is unknown."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Start(Value):
    """Prior poses of parts as a mixture of normal densities, given that one of the parts is present.

    Attributes:
        targets: parts, prepared by :func:`tanteo.posterior.prepare`.
        part: index of the part of each prior pose ``(A,)``.
        Ts: prior poses ``T_world_part`` ``(A, 4, 4)``.
        covariances: covariance of each prior pose ``(A, 6, 6)``, order x y z rx ry rz, part frame, right perturbation
            [m, rad].
        weights: probability of each prior pose given that one of the parts is present; they sum to one ``(A,)``.
        priors: priors of the unknown object and of outliers, and radius of the workspace.
        factors: measurements of the pose before the first reading, such as an image. They replace the prior poses,
            which are then only initial poses of the search, and the parts are equally probable.
        suggested: number of leading prior poses that come from the factors and were not stated by the user.

    Raises:
        InputError: part or prior pose is missing, the weights are not probabilities, or a covariance is singular.
    """

    targets: tuple[PreparedPart, ...]
    part: IntArray
    Ts: Transforms
    covariances: Covariances
    weights: FloatArray
    priors: Priors
    factors: tuple[PoseFactor, ...] = ()
    suggested: int = 0

    def __post_init__(self) -> None:
        if not self.targets or not len(self.part):
            raise InputError("start: expected a part and a prior pose of it, got none. State both.")
        Ts, C = check_transforms("start, T_world_part", self.Ts), check_covariances("start", self.covariances, 6)
        w = np.array(self.weights, dtype=np.float64)
        if not (Ts.shape[:-2] == C.shape[:-2] == w.shape == np.shape(self.part) == (len(self.part),)):
            raise InputError(
                f"start: expected as many poses, covariances and weights as parts, got {len(Ts)}, {len(C)}, {w.size} "
                f"and {len(self.part)}."
            )
        if not (np.isfinite(w).all() and (w >= 0).all() and w.sum() > 0):
            raise InputError(f"start, weights: expected probabilities, got {w.tolist()}. Normalize them.")
        if not (np.min(self.part) >= 0 and np.max(self.part) < len(self.targets)):
            which = np.asarray(self.part).tolist()
            raise InputError(f"start, part: expected indices of {len(self.targets)} parts, got {which}.")
        if self.priors.pose is not None:
            raise InputError("priors, pose: expected none, because a start has prior poses. Add it to them.")
        if np.linalg.eigvalsh(C).min() <= 0:
            raise InputError("start: expected a positive variance in all directions, got 0. Use a small one.")
        check_spreads("start", C)
        if (turn := float(np.sqrt(np.linalg.eigvalsh(C[..., 3:, 3:]).max()))) > np.pi:
            raise InputError(
                f"start, covariance: expected a rotation sd of at most pi rad, got {turn:.3g} rad. Is it in degrees?"
            )
        check_places("start, T_world_part", Ts[..., :3, 3])
        radius = max(target.part.radius for target in self.targets)
        if abs(w.sum() - 1) > 1e-12:  # weights that sum to one keep all their bits
            w = w / w.sum()
        for name, value in (("Ts", Ts), ("covariances", C), ("weights", w)):
            object.__setattr__(self, name, np.require(value, requirements="C"))
        object.__setattr__(self, "priors", sized(self.priors, radius))
        lock(self)

    def __len__(self) -> int:
        return len(self.part)

    def prior(self, rows: IntArray) -> PosePrior:
        """Return the prior poses of some rows as one object.

        Args:
            rows: indices of the prior poses.
        """
        return PosePrior(self.Ts[rows], self.covariances[rows])

    def stated(self, row: int) -> PosePrior | None:
        """Return a prior pose that the user stated, or None if it comes from a factor.

        The posterior contains factors separately.

        Args:
            row: index of the prior pose.
        """
        return None if row < self.suggested else PosePrior(self.Ts[row], self.covariances[row])

    def shares(self) -> FloatArray:
        """Return the prior probability of every part given that a part is present ``(P,)``.

        If the start has factors, the parts are equally probable.
        """
        if self.factors:
            return np.full(len(self.targets), 1 / len(self.targets))
        return np.bincount(self.part, weights=self.weights, minlength=len(self.targets)).astype(np.float64)

    def mixtures(self) -> dict[PreparedPart, PoseMixture]:
        """Return the mixture of prior poses of each part given that it is present.

        The result is empty if factors replace the prior poses.
        """
        if self.factors:
            return {}
        out = {}
        for k, share in enumerate(self.shares()):
            own = np.flatnonzero((self.part == k) & (self.weights > 0))
            if len(own):
                log = np.log(self.weights[own]) - np.log(share)
                out[self.targets[k]] = PoseMixture(self.Ts[own], self.covariances[own], log)
        return out

    def likeliest(self, part: int, T_world_part: Transforms) -> int:
        """Return the row of the prior pose with the largest density at a pose of a part, up to symmetry.

        Args:
            part: index of the part.
            T_world_part: pose of the part ``(4, 4)``.

        Returns:
            Row of the prior pose; -1 if the part has no prior pose.
        """
        own = np.flatnonzero((self.part == part) & (self.weights > 0))
        if not len(own):
            return -1
        if len(own) == 1:
            return int(own[0])
        images = T_world_part @ self.targets[part].part.symmetry.Ts
        xi = SE3.log(SE3.inverse(self.Ts[own])[:, None] @ images)
        white = np.linalg.solve(np.linalg.cholesky(self.covariances[own])[:, None], xi[..., None])[..., 0]
        log = np.log(self.weights[own]) - 0.5 * np.linalg.slogdet(self.covariances[own])[1]
        return int(own[np.argmax(log - 0.5 * np.sum(white * white, axis=-1).min(axis=1))])

    def drawn(self, part: int, count: int) -> Transforms:
        """Return reproducible samples of a part's prior poses, spread 1.2 times as widely ``(count, 4, 4)``.

        Args:
            part: index of the part.
            count: number of samples.
        """
        rows = np.flatnonzero(self.part == part)
        which = np.resize(rows, count)
        xi = np.random.default_rng((1991, part)).normal(size=(count, 6, 1))
        L = np.asarray(np.linalg.cholesky(self.covariances))[which]
        return np.asarray(self.Ts[which] @ SE3.exp(_BEYOND * (L @ xi)[..., 0]))


def at_place(
    targets: Sequence[PreparedPart] | Sequence[Part],
    T_world_place: Transforms,
    covariance: Covariances,
    priors: Priors | None = None,
) -> Start:
    """Return the start of a session with an object, one of several parts, at a known place such as a feeder or fixture.

    The mean pose of each part has its centroid at the origin of the place, and its axes parallel to those of the place.

    Args:
        targets: possible parts, prepared or not, all equally probable.
        T_world_place: frame of the place in the world ``(4, 4)``.
        covariance: covariance of the part's pose about its centroid, order x y z rx ry rz, axes of the place
            ``(6, 6)`` [m, rad].
        priors: priors of the unknown object and of outliers; None for the defaults.

    Raises:
        InputError: no part is given, the place is not a rigid motion, or the covariance is invalid or in degrees.

    Example:
        >>> import numpy as np
        >>> feeder = np.eye(4)
        >>> place = tanteo.at_place(tanteo.read_parts("parts/"), feeder, np.diag([0.015] * 3 + [0.17] * 3) ** 2)
        >>> len(place)
        12
    """
    targets = prepare_all("parts", targets)
    if not targets:
        raise InputError("parts: expected at least one part, got none.")
    T_world_place = check_transforms("T_world_place", T_world_place)
    covariance = check_covariances("covariance", covariance, 6)
    T_part_centre = np.stack([SE3.from_parts(np.eye(3), target.part.centroid) for target in targets])
    J = SE3.adjoint(T_part_centre)
    return Start(
        tuple(targets),
        np.arange(len(targets)),
        T_world_place @ SE3.inverse(T_part_centre),
        J @ covariance @ np.swapaxes(J, 1, 2),
        np.ones(len(targets)),
        priors or Priors(),
    )


def at_pose(
    target: PreparedPart | Part, T_world_part: Transforms, covariance: Covariances, priors: Priors | None = None
) -> Start:
    """Return the start of a session with one part at one prior pose.

    Args:
        target: part, prepared or not.
        T_world_part: mean of the prior pose ``(4, 4)``.
        covariance: covariance of the prior pose, order x y z rx ry rz, part frame ``(6, 6)`` [m, rad].
        priors: priors of the unknown object and of outliers; None for the defaults.
    """
    T, C = np.asarray(T_world_part, dtype=np.float64), np.asarray(covariance, dtype=np.float64)
    return Start(
        prepare_all("part", as_part("part", target)),
        np.zeros(1, dtype=np.int64),
        T[None],
        C[None],
        np.ones(1),
        priors or Priors(),
    )


def at_origin(target: PreparedPart | Part, priors: Priors | None = None) -> Start:
    """Return the start of a plan with the part's CAD frame at the world's, and default standard deviations.

    Args:
        target: part, prepared or not.
        priors: priors of the unknown object and of outliers; None for the defaults.

    Returns:
        Start whose standard deviations at the part's centroid are :data:`ORIGIN_SDS`: 5 mm and 3 degrees.
    """
    part = prepare_all("part", as_part("part", target))[0].part
    J = SE3.adjoint(SE3.from_parts(np.eye(3), part.centroid))
    return at_pose(target, np.eye(4), J @ np.diag(np.repeat(ORIGIN_SDS, 3) ** 2) @ J.T, priors)


def from_hypotheses(
    hypotheses: Sequence[Hypothesis], targets: Sequence[PreparedPart] | Sequence[Part], priors: Priors | None = None
) -> Start:
    """Return the start of a session with the hypotheses of an answer, from an image or from earlier readings.

    Do not add the readings of that answer to the session, because they would count twice.

    Args:
        hypotheses: hypotheses of the answer.
        targets: parts that the hypotheses name, prepared or not.
        priors: priors of the unknown object and of outliers; None for the defaults.

    Raises:
        InputError: a hypothesis names a part that is not among the targets.
    """
    targets = prepare_all("parts", targets)
    names = [target.part.name for target in targets]
    missing = sorted({h.part for h in hypotheses} - set(names))
    if missing:
        raise InputError(f"hypotheses: expected parts among {', '.join(names)}, got {missing[0]}. Add its file.")
    return Start(
        tuple(targets),
        np.array([names.index(h.part) for h in hypotheses], dtype=np.int64),
        np.array([h.T_world_part for h in hypotheses]).reshape(-1, 4, 4),
        _turned_at_most(np.array([h.covariance for h in hypotheses]).reshape(-1, 6, 6)),
        np.array([h.probability for h in hypotheses]),
        priors or Priors(),
    )


def _turned_at_most(covariances: Covariances) -> Covariances:
    """Return covariances of poses with rotation sds of at most :data:`_TURN` ``(n, 6, 6)``.

    The covariance of an estimate is linear at the pose, so that it may exceed a turn.
    """
    variances, axes = np.linalg.eigh(covariances[:, 3:, 3:])
    shrink = np.tile(np.eye(6), (len(covariances), 1, 1))
    share = np.minimum(1.0, _TURN / np.sqrt(np.maximum(variances, _TURN**2)))
    shrink[:, 3:, 3:] = (axes * share[:, None, :]) @ np.swapaxes(axes, 1, 2)
    return np.asarray(shrink @ covariances @ np.swapaxes(shrink, 1, 2))
