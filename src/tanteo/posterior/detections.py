"""Poses of a detector as a factor: a second opinion with broad errors, which may be wrong."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from tanteo import _core
from tanteo.defaults import DETECTION_SDS, DETECTION_TRUST
from tanteo.errors import InputError
from tanteo.factors import PoseFactor
from tanteo.geometry import SE3, check_covariance, check_transforms
from tanteo.geometry.typing import Covariances, Transforms
from tanteo.parts import Part
from tanteo.posterior.alternatives import NormalPoses
from tanteo.posterior.answers.part_motions import without_symmetric_rotation
from tanteo.posterior.problem import PoseMixture


@dataclass(frozen=True, slots=True, eq=False)
class Detection:
    """One pose of a detector.

    Attributes:
        part: name of the part.
        score: score from 0 to 1, which counts as the probability that the detection is right, up to 0.9.
        T_world_part: pose ``(4, 4)`` [m].
        covariance: its covariance ``(6, 6)``, order x y z rx ry rz, part frame, right [m, rad]; that of 10 mm and 5
            degrees about each axis if None.

    Raises:
        InputError: the score is no probability, or the pose is no rigid motion.
    """

    part: str
    score: float
    T_world_part: Transforms
    covariance: Covariances | None = None

    def __post_init__(self) -> None:
        if not 0 <= self.score <= 1:
            raise InputError(
                f"detection of {self.part}, score: expected a number from 0 to 1, got {self.score:g}. Correct it."
            )
        object.__setattr__(self, "T_world_part", check_transforms("detection, pose", self.T_world_part))
        own = np.diag(np.repeat(np.square(DETECTION_SDS), 3)) if self.covariance is None else self.covariance
        object.__setattr__(self, "covariance", check_covariance("detection, covariance", own, 6))


@dataclass(frozen=True, slots=True, eq=False)
class Detections(PoseFactor):
    """Detections of one object as a factor of the posterior.

    With the probability of its score a detection has the object's part and pose with a normal error. Otherwise it is of
    any candidate at any pose of the workspace, without information.

    Attributes:
        found: detections of parts among the candidates.
        count: number of candidate parts.
        radius: radius of the workspace about the object [m].
    """

    found: tuple[Detection, ...]
    count: int
    radius: float
    shares: tuple[float, ...] = field(init=False)

    def __post_init__(self) -> None:
        total = sum(one.score for one in self.found)
        scale = min(1.0, DETECTION_TRUST / total) if total > 0 else 0.0
        object.__setattr__(self, "shares", tuple(scale * one.score for one in self.found))

    @property
    def log_unknown(self) -> float:
        """Return the log density of the detections if the object is unknown: all are wrong then."""
        return float(np.log1p(-sum(self.shares)))

    def poses(self, part: Part) -> Transforms:
        """Return poses of a part near its detections ``(K, 4, 4)``, from which the search starts."""
        return self._normals(part).poses(part)

    def term(self, part: Part, first: int, common: int = 0) -> _core.PoseTerm:
        """Compile the factor for one part; it adds no shared error.

        Args:
            part: candidate part.
            first: not used.
            common: not used.
        """
        own = self._normals(part)
        if part not in own.mixtures:
            return _core.alternatives([[]], np.array([self.log_unknown]))
        # a wrong detection has any of the parts and an even density of poses
        even = -3 * np.log(2 * self.radius) - np.log(8 * np.pi**2) - np.log(self.count)
        return _core.alternatives([[own.term(part, first)], []], np.array([-even, self.log_unknown]))

    def _normals(self, part: Part) -> NormalPoses:
        """Return the normal densities of the detections of a part, weighted by their shares."""
        own = [(one, share) for one, share in zip(self.found, self.shares, strict=True) if one.part == part.name]
        own = [(one, share) for one, share in own if share > 0]
        if not own:
            return NormalPoses({})
        mixture = PoseMixture(
            np.stack([one.T_world_part for one, _ in own]), np.stack([np.asarray(one.covariance) for one, _ in own]),
            np.log([share for _, share in own]),
        )  # fmt: skip
        return NormalPoses({part: mixture})


def agreement(
    one: Detection, part: Part, T_world_part: Transforms, covariance: Covariances
) -> tuple[float, float, bool]:
    """Return how far a pose of the same part is from a detection [m, rad], and whether it is within three deviations.

    Args:
        one: detection.
        part: the part.
        T_world_part: pose of an answer ``(4, 4)``.
        covariance: its covariance ``(6, 6)``, part frame, right.
    """
    total = np.linalg.inv(np.asarray(one.covariance) + covariance)
    gaps = SE3.inverse(one.T_world_part) @ T_world_part @ part.symmetry.Ts
    if part.symmetry.continuous or part.symmetry.spherical:
        gaps = without_symmetric_rotation(part, gaps)
    logs = SE3.log(gaps)
    squared = np.einsum("ki,ij,kj->k", logs, total, logs)
    k = int(np.argmin(squared))
    moved = float(np.linalg.norm(SE3.apply(gaps[k], part.centroid) - part.centroid))
    return moved, float(np.linalg.norm(logs[k, 3:])), bool(squared[k] < len(logs[k]) * 3**2)


def named(found: Sequence[Detection], parts: Sequence[Part]) -> tuple[tuple[Detection, ...], tuple[str, ...]]:
    """Return the detections of candidate parts, and the names of others.

    Args:
        found: detections.
        parts: candidates.
    """
    names = {part.name for part in parts}
    others = tuple(dict.fromkeys(one.part for one in found if one.part not in names))
    return tuple(one for one in found if one.part in names), others
