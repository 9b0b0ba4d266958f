"""Results of a recognition: hypotheses and the answer with status and findings."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

from tanteo.defaults import SIGNIFICANCE
from tanteo.fitting.localization import SharedGiven
from tanteo.geometry.limits import NOTABLE
from tanteo.geometry.typing import Covariances, FloatArray, Transforms
from tanteo.values import Value, html_table
from tanteo.words import Finding, Motion, message_of, percent

Status = Literal["recognized", "ambiguous", "unknown", "insufficient"]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Hypothesis(Value):
    """One possible answer: a part at a pose. Poses that are equal by symmetry are one hypothesis.

    Attributes:
        part: name of the part.
        file: path of the CAD file.
        probability: posterior probability over all parts, poses and the unknown object.
        T_world_part: pose ``(4, 4)``, maps points of the part [m] to the world.
        covariance: covariance of the pose ``(6, 6)``, order x y z rx ry rz, part frame, right perturbation [m, rad].
            Unobserved directions have the variance of a uniform density over the part's size (diagonal of its box) or a
            full turn.
        corner_sd: largest standard deviation of the position of a corner of the part's box [m].
        unobserved: motions that the readings leave free and no symmetry explains, as text.
        symmetry_order: number of equivalent poses, this one included.
        symmetry_poses: the other equivalent poses ``(symmetry_order - 1, 4, 4)``.
        chi2: joint squared Mahalanobis distance of all pairings, with the noise as stated.
        dof: degrees of freedom of ``chi2``.
        p_value: probability of a larger ``chi2`` if the hypothesis is true, averaged over the prior of the noise scale;
            1 without redundancy.
        rms: root mean square distance of the readings to the features they are paired with [m].
        outliers: ids of the readings that are not on the part.
        pairings: id and model feature of each reading that is on the part.
        outlier_distances: signed distance of each outlier from the surface, negative inside the material [m]; NaN
            where that is not known.
        covariance_relative: covariance given the errors that all readings share (robot, tip, sensor bias); None if
            nothing is shared. If the robot's base is the only shared error and there is no prior pose, this is the
            repeatability with the same robot.
        spherical: whether every rotation about the part's centre is equivalent, as of a ball.
        symmetry_axis: point and unit direction, in the world ``(2, 3)``, about which every rotation is equivalent:
            not an error, and not in ``unobserved``. None for a part without an axis of revolution.
        advice: what to sense to observe the first free direction; empty if there is none.
        noise_scale: estimated noise over the stated noise: the mode, and both ends of its 95 % interval.
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
    spherical: bool = False
    advice: str = ""
    noise_scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    free_motions: tuple[Motion, ...] = ()
    shared: SharedGiven | None = None


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Answer(Value):
    """Result of a recognition: which part was sensed, where it is, and how certain that is.

    Attributes:
        status: ``recognized`` (one answer), ``ambiguous`` (several remain), ``unknown`` (none of the parts) or
            ``insufficient`` (the readings leave a direction free that no symmetry explains).
        findings: findings that support the answer: the verdict, then its causes, then questions about the input.
        hypotheses: hypotheses, best first.
        unknown_probability: posterior probability of the unknown object; it sums to one with those of all hypotheses,
            also those that are not reported.
        elapsed: elapsed seconds by stage.
        seed: seed of the search; the same seed gives the same answer.
        significance: significance level of the tests for the status: a p-value below it rejects.
        frame: name of the frame of all poses, that of the readings.
        stamp: time of the last reading [s]; NaN if unknown.
        parts: probability of each part over all of its poses, most probable first; also of poses that are not reported.
        missed_probability: estimated probability of poses that the search missed; the probabilities of hypotheses and
            parts contain this doubt, so that all together sum to one.
        equal: answers for further parts that are equal to the best one, each from its own readings.

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
    frame: str = "world"
    stamp: float = math.nan
    parts: tuple[tuple[str, float], ...] = ()
    missed_probability: float = 0.0
    equal: tuple[Answer, ...] = ()

    @property
    def message(self) -> str:
        """Return the findings as text, without questions, and the next step if no part is recognized."""
        return message_of(self.findings)

    def adding(self, *findings: Finding) -> Answer:
        """Return the answer with further findings at the end."""
        return replace(self, findings=(*self.findings, *findings))

    @property
    def best(self) -> Hypothesis | None:
        """Return the most probable hypothesis; None if there is none. :attr:`status` rates it."""
        return self.hypotheses[0] if self.hypotheses else None

    @property
    def several_poses(self) -> tuple[tuple[str, float], ...]:
        """Return the probabilities of probable parts in any pose; empty if the best pose has nearly all of it."""
        if not self.parts or not self.hypotheses or self.parts[0][1] - self.hypotheses[0].probability <= NOTABLE:
            return ()
        return tuple((name, P) for name, P in self.parts if P > NOTABLE)

    def rejects(self, hypothesis: Hypothesis) -> bool:
        """Return whether the joint test rejects a hypothesis at the answer's significance level."""
        return hypothesis.p_value < self.significance

    @property
    def pose(self) -> Transforms | None:
        """Return ``T_world_part`` of the best hypothesis ``(4, 4)`` [m]; None without one."""
        return self.best.T_world_part if self.best is not None else None

    @property
    def covariance(self) -> Covariances | None:
        """Return the covariance of :attr:`pose` ``(6, 6)``, as :attr:`Hypothesis.covariance`; None without one."""
        return self.best.covariance if self.best is not None else None

    def __repr__(self) -> str:
        best = self.best
        if best is None:
            return f"Answer({self.status}; unknown object {percent(self.unknown_probability)})"
        x, y, z = best.T_world_part[:3, 3]
        return (
            f"Answer({self.status}; {best.part} {percent(best.probability)} at x={x:.6g} y={y:.6g} z={z:.6g} m, "
            f"corner_sd={best.corner_sd:.3g} m; hypotheses: {len(self.hypotheses)}, unknown object "
            f"{percent(self.unknown_probability)})"
        )

    def _repr_html_(self) -> str:
        headers = ["part", "probability", "x mm", "y mm", "z mm", "corner sd mm", "p", "outliers"]
        rows = []
        for one in self.hypotheses:
            x = [f"{1e3 * value:.3f}" for value in one.T_world_part[:3, 3]]
            numbers = [*x, f"{1e3 * one.corner_sd:.3g}", f"{one.p_value:.3g}", ", ".join(one.outliers)]
            rows.append([one.part, percent(one.probability), *numbers])
        rows.append(["unknown object", percent(self.unknown_probability), *[""] * 6])
        return html_table(self.status, headers, rows, self.message)
