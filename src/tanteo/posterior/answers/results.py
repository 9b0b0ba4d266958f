"""What a recognition answers: frozen values with a status and a sentence."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

from tanteo.defaults import SIGNIFICANCE
from tanteo.fitting import SharedGiven
from tanteo.geometry.typing import Covariances, FloatArray, Transforms
from tanteo.words import Finding, Motion, message_of

Status = Literal["recognized", "ambiguous", "unknown", "insufficient"]


@dataclass(frozen=True, slots=True, eq=False)
class Hypothesis:
    """One answer that is still possible: a part at a pose, poses that its symmetry maps onto each other merged.

    Attributes:
        part: name of the part.
        file: where it was read from.
        probability: posterior, over all parts, poses and the unknown object.
        T_world_part: pose ``(4, 4)``, maps points of the part [m] to the world.
        covariance: ``(6, 6)``, order x y z rx ry rz, in the part frame, right perturbation [m, rad]. Directions that
            nothing observes carry the variance of a uniform draw over the part's size (diagonal of its box) or a turn.
        corner_sd: largest standard deviation of the position of a corner of the part's box [m].
        unobserved: directions that the readings leave free and no symmetry explains, in words.
        symmetry_order: number of equivalent poses, this one included.
        symmetry_poses: the other equivalent poses ``(symmetry_order - 1, 4, 4)``.
        chi2: joint squared Mahalanobis distance of all pairings, with the noise as stated.
        dof: its degrees of freedom.
        p_value: probability of a larger ``chi2`` if the hypothesis is true and the noise within what was known of it;
            1 without redundancy.
        rms: root mean square distance of the readings to the features they are paired with [m].
        outliers: ids of the readings that the hypothesis does not explain.
        pairings: reading id and model feature, for every explained reading.
        outlier_distances: signed distance of each outlier from the surface, negative inside the material [m]; NaN
            where that is not known.
        covariance_relative: the same covariance with the errors that all readings share (robot, tip, sensor bias)
            taken as known; None if nothing is shared. Where the robot's base is the only one of them, and nothing was
            said of where the part is in the world, it is how well the same robot finds the part again.
        symmetry_axis: point and unit direction, in the world ``(2, 3)``, about which every rotation is equivalent:
            not an error, and not in ``unobserved``. None for other parts.
        advice: what to sense to observe the first free direction; empty if there is none.
        noise_scale: times the stated noise that the readings have: the likeliest, and from where to where with 95 %.
        free_motions: the motions of ``unobserved`` as values.
        shared: errors that all readings share, whitened and in the order of the measurements, given the pose; None if
            nothing is shared.

    Example:
        >>> part = tanteo.read_part("parts/bracket_left.step")
        >>> best = tanteo.locate(tanteo.read_readings("readings/bracket_left.csv"), part).best
        >>> best.part, best.probability > 0.99, best.corner_sd < 1e-3
        ('bracket_left', True, True)
    """

    part: str
    file: str
    probability: float
    T_world_part: Transforms
    covariance: Covariances
    corner_sd: float
    unobserved: tuple[str, ...]
    symmetry_order: int
    symmetry_poses: Transforms
    chi2: float
    dof: int
    p_value: float
    rms: float
    outliers: tuple[str, ...]
    pairings: tuple[tuple[str, str], ...]
    outlier_distances: tuple[float, ...] = ()
    covariance_relative: Covariances | None = None
    symmetry_axis: FloatArray | None = None
    advice: str = ""
    noise_scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    free_motions: tuple[Motion, ...] = ()
    shared: SharedGiven | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Answer:
    """The answer to "which part is it, and where".

    Attributes:
        status: ``recognized`` (one answer), ``ambiguous`` (several remain), ``unknown`` (none of the parts) or
            ``insufficient`` (the readings leave a direction free that no symmetry explains).
        findings: what the answer rests on: the verdict first, then its causes, then questions about the input.
        hypotheses: best first.
        unknown_probability: posterior of the unknown object; sums to one with all hypotheses, reported or not.
        elapsed: seconds by stage.
        seed: of the search; the same seed gives the same answer.
        significance: significance level of the tests behind the status: a p-value below it rejects.

    Example:
        >>> part = tanteo.read_part("parts/bracket_left.step")
        >>> answer = tanteo.locate(tanteo.read_readings("readings/bracket_left.csv"), part)
        >>> answer.status, answer.best.part, len(answer.hypotheses)
        ('recognized', 'bracket_left', 1)
    """

    status: Status
    findings: tuple[Finding, ...]
    hypotheses: tuple[Hypothesis, ...]
    unknown_probability: float
    elapsed: Mapping[str, float] = field(default_factory=dict)
    seed: int = 0
    significance: float = SIGNIFICANCE

    @property
    def message(self) -> str:
        """The findings in words, without questions, with what to do next when it is not recognized."""
        return message_of(self.findings)

    def adding(self, *findings: Finding) -> Answer:
        """Return the answer with further findings at the end."""
        return replace(self, findings=(*self.findings, *findings))

    @property
    def best(self) -> Hypothesis | None:
        """The most probable hypothesis; None where no part is one. What it is worth is in :attr:`status`."""
        return self.hypotheses[0] if self.hypotheses else None

    def rejects(self, hypothesis: Hypothesis) -> bool:
        """Return whether the joint test rejects a hypothesis at the answer's significance level."""
        return hypothesis.p_value < self.significance

    @property
    def pose(self) -> Transforms | None:
        """``T_world_part`` of the best hypothesis ``(4, 4)`` [m]; None without one."""
        return self.best.T_world_part if self.best is not None else None

    @property
    def covariance(self) -> Covariances | None:
        """Covariance of :attr:`pose` ``(6, 6)``, as :attr:`Hypothesis.covariance`; None without one."""
        return self.best.covariance if self.best is not None else None
