"""Verdict on the searched parts: status, supporting findings, and the parts that were not searched."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tanteo.catalogue import cache
from tanteo.catalogue.copies import copy_for_walls
from tanteo.factors import ContactPoints
from tanteo.features import SharedError
from tanteo.fitting.localization import weak_motions
from tanteo.geometry.limits import NOTABLE
from tanteo.geometry.typing import BoolArray
from tanteo.parts import round_features
from tanteo.posterior.answers.part_motions import part_scale
from tanteo.posterior.answers.pose_prior import Table
from tanteo.posterior.answers.priors import Priors
from tanteo.posterior.answers.results import Hypothesis, Status
from tanteo.posterior.answers.status import CONFIDENCE, verdict
from tanteo.posterior.candidate_pruning import Active
from tanteo.posterior.candidates import Candidates
from tanteo.posterior.contradictions import NEAR, PlaneBeside, outlier_or_variant
from tanteo.posterior.diagnostics import (
    against_labels,
    correlated_readings,
    face_elsewhere,
    mostly_on,
    mostly_on_part,
    on_furniture,
    outlier_finding,
    scattered,
)
from tanteo.posterior.dominant_error import dominant_shared_error
from tanteo.posterior.fit_at_mode import GoodnessOfFit
from tanteo.posterior.posterior import Posterior
from tanteo.posterior.prepared import PreparedPart, prepare
from tanteo.posterior.prior_check import PriorCheck
from tanteo.posterior.sampling.modes import Mode
from tanteo.posterior.stable_poses import nearest_stable_pose
from tanteo.words import Finding
from tanteo.words.findings import (
    AmongUnsearched,
    CloseTogether,
    MayBeUnknown,
    MissedPoses,
    MostlyOnPart,
    NotSearched,
    OneRegion,
    OnOtherSide,
    OutliersOnPlane,
    PriorContradicted,
    SharedErrorLimits,
    TooCoarse,
    WorstReading,
)

_NINETY_FIVE = 1.96
"""Numerical: standard deviations of a normal error within which 95 % are."""

_FLAT = 1e-6
"""Numerical: size over the diagonal below which a feature has no extent, and the depth of a ray below its face."""

_SMALLEST = "smallest1"
"""Kind and version of the cached size and name of the smallest feature."""


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """Result of a search, before the verdict.

    Attributes:
        candidates: all parts.
        chosen: parts that were searched.
        posterior: posterior over the searched parts.
        modes: all modes of the posterior that is reported, best first.
        found: goodness of fit of the first of them, all probable ones included.
        hypotheses: hypotheses that are reported.
        check: agreement of the prior pose with the measurements.
        worst: the reading that contradicts the best hypothesis most; None if no reading is far off.
        unstated: the finding that unstated errors limit the answer; None if they do not.
        plane: plane beside the part on which outliers lie; None if there is none.
    """

    candidates: Candidates
    chosen: Active
    posterior: Posterior
    modes: tuple[Mode, ...]
    found: list[GoodnessOfFit]
    hypotheses: tuple[Hypothesis, ...]
    check: PriorCheck
    worst: WorstReading | None
    unstated: SharedErrorLimits | None = None
    plane: PlaneBeside | None = None


def verdict_of(
    outcome: Outcome, significance: float, shared: Sequence[SharedError]
) -> tuple[Status, tuple[Finding, ...]]:
    """Return the status of an answer and its findings: the verdict, its causes, and anomalies of the measurements.

    Args:
        outcome: result of the search.
        significance: p-value below which the joint test rejects a hypothesis.
        shared: shared errors of the measurements, in the order of the states.
    """
    posterior, found, hypotheses, check = outcome.posterior, outcome.found, outcome.hypotheses, outcome.check
    unknown, priors = posterior.unknown, posterior.problem.priors
    same, mirrored = outcome.candidates.names_of_same_shape(found[0].mode.prepared.part) if found else ([], [])
    status, finding = verdict(
        hypotheses,
        unknown,
        significance,
        worst=outcome.worst,
        shares=[(mode.prepared.part.name, mode.probability) for mode in outcome.modes],
        prior_p=check.p,
        elsewhere=check.elsewhere,
        missed=posterior.missing * (1 - unknown),
        same=same,
        mirrored=mirrored,
    )
    findings: tuple[Finding, ...] = (finding,)
    if status == "unknown" and not check.elsewhere:
        status, findings = _known_after_all(findings, hypotheses, outcome.chosen, posterior)
    if status == "recognized" and (coarse := _too_coarse(hypotheses[0], found[0].mode.prepared, priors)):
        status, findings = "insufficient", (coarse,)
    more: list[Finding | None] = []
    if found and hypotheses:
        explained = np.zeros(len(posterior.problem.points), dtype=np.bool_)
        if outcome.plane is not None:
            explained = outcome.plane.rows
            more.append(outliers_on_plane(posterior.problem.points, outcome.plane))
        if status == "recognized" or isinstance(finding, MayBeUnknown) or _one_reading_decides(findings[0]):
            status, findings = _doubted(status, findings, found[0], priors, explained)
    if hypotheses and status == "recognized":
        dominant = dominant_shared_error(found[0], shared, hypotheses[0].corner_sd)
        more += [dominant, outcome.unstated, outlier_finding(hypotheses[0], priors)]
    if found and status != "insufficient":
        more.append(face_elsewhere(posterior.problem.points, found[0], unknown, priors))
    if found:
        more += [on_furniture(found[0]), correlated_readings(found[0])]
    if found and hypotheses and priors.pose is not None and priors.pose.table is not None:
        more.append(_on_other_side(found[0], hypotheses[0], priors.pose.table))
    if found and status in ("ambiguous", "insufficient"):
        more.append(_in_one_region(found))
    if status in ("ambiguous", "insufficient") and posterior.missing > NOTABLE:
        more.append(MissedPoses(posterior.missing))
    if status != "recognized" and NOTABLE < posterior.unsearched < 0.5:
        more.append(NotSearched(len(outcome.chosen.others), posterior.unsearched))
    if hypotheses and not any(isinstance(one, PriorContradicted) for one in findings):
        # a contradicted prior biases the pose, and with it the scatter
        more.append(scattered(hypotheses[0], outcome.worst, unknown=status == "unknown"))
    return status, (*findings, *(one for one in more if one is not None))


def _known_after_all(
    findings: tuple[Finding, ...], hypotheses: tuple[Hypothesis, ...], chosen: Active, posterior: Posterior
) -> tuple[Status, tuple[Finding, ...]]:
    """Return the verdict on an unknown object that may be a part that was not searched, or similar to the best."""
    if posterior.unsearched > 0.5 * posterior.unknown > 0:
        best = hypotheses[0].part if hypotheses else ""
        return "ambiguous", (AmongUnsearched(best, len(chosen.others), posterior.unsearched),)
    if hypotheses and mostly_on(hypotheses[0], posterior.unknown):
        return "unknown", (mostly_on_part(hypotheses[0], posterior.unknown),)
    return "unknown", findings


def _one_reading_decides(finding: Finding) -> bool:
    """Return whether a single reading makes an unknown object more probable than a part, but not certain."""
    return isinstance(finding, MostlyOnPart) and len(finding.outliers) == 1 and finding.unknown < CONFIDENCE


def outliers_on_plane(points: ContactPoints, plane: PlaneBeside) -> OutliersOnPlane:
    """Return the finding that outliers lie on a plane beside the part.

    Args:
        points: the measurements.
        plane: the plane.
    """
    return OutliersOnPlane(tuple(points.ids[k] for k in np.flatnonzero(plane.rows)), len(points))


def _on_other_side(one: GoodnessOfFit, best: Hypothesis, table: Table) -> OnOtherSide | None:
    """Return the finding that a part does not lie on its most probable side; None if it does, or may do."""
    part, sds = one.mode.prepared.part, np.sqrt(np.diag(best.covariance)[3:])
    rests, k, tilt = nearest_stable_pose(part, table.normal, best.T_world_part)
    slack = one.mode.objective.problem.settings.search.gate * float(sds.max() + table.sd / (0.25 * part.diagonal))
    own, most = rests[k].probability, max(rest.probability for rest in rests)
    if tilt > slack:
        return OnOtherSide(part.name, 0.0, most, tilt)
    return OnOtherSide(part.name, own, most, tilt) if own < 0.5 * most else None


def _in_one_region(found: Sequence[GoodnessOfFit]) -> OneRegion | None:
    """Return the finding that all touches are in less than half of a possible part; None if they are not."""
    possible = [one for one in found if one is found[0] or one.mode.probability > NOTABLE]
    best = max(possible, key=lambda one: one.mode.prepared.part.area)
    region, part = best.mode.objective.problem.region, best.mode.prepared.part
    points = best.mode.objective.problem.points.points[best.inliers]
    if len(points) < 2 or not 0 < region.area < 0.5 * part.area or best.at.uneven[0] < 0.5:
        return None
    return OneRegion(float(np.linalg.norm(points[:, None] - points, axis=2).max()), part.diagonal)


def _doubted(
    status: Status, findings: tuple[Finding, ...], best: GoodnessOfFit, priors: Priors, explained: BoolArray
) -> tuple[Status, tuple[Finding, ...]]:
    """Return the verdict on the only part that fits, which contradictions and close readings make ambiguous."""
    variant = outlier_or_variant(best, explained)
    if variant is not None:
        return "ambiguous", (variant,)
    if status != "recognized":
        return status, findings
    if _close_together(best):
        return "ambiguous", (*findings, CloseTogether())
    doubt = against_labels(best, priors)
    return ("ambiguous", (doubt,)) if doubt is not None else ("recognized", findings)


def _too_coarse(best: Hypothesis, prepared: PreparedPart, priors: Priors) -> Finding | None:
    """Return a finding if the pose is less certain than the smallest feature is large; None otherwise.

    A prior pose that leaves no motion free states its own uncertainty, which the user accepts.
    """
    part = prepared.part
    if priors.pose is not None and priors.pose.T_world_part is not None:
        stated = np.linalg.inv(np.asarray(priors.pose.covariance).reshape(-1, 6, 6)[0])
        if not len(weak_motions(stated, part_scale(part))):
            return None
    limit, what = smallest_feature(prepared)
    bound = _NINETY_FIVE * best.corner_sd
    return TooCoarse(best.part, bound, limit, what) if bound > limit else None


def smallest_feature(prepared: PreparedPart) -> tuple[float, str]:
    """Return the size of the smallest feature of a part [m] and its name: a wall, a hole, a boss, or the whole part.

    Args:
        prepared: the part.
    """
    part = prepared.part.derived.get("original", prepared.part)
    if "smallest" not in part.derived:
        stored = cache.load_derived(part, _SMALLEST)
        if stored is None:
            sizes = [(part.diagonal, "its diagonal")]
            sizes += [(2 * float(one.radii.min()), f"the diameter of {one.name}") for one in round_features(part)]
            sizes += [(thickness, "its thinnest wall") for thickness in _walls(prepare(copy_for_walls(part)))]
            size, what = min(size for size in sizes if size[0] > _FLAT * part.diagonal)
            cache.store_derived(part, _SMALLEST, np.float64(size).tobytes() + what.encode())
            part.derived["smallest"] = size, what
        else:
            part.derived["smallest"] = float(stored[:8].view(np.float64)[0]), stored[8:].tobytes().decode()
    smallest: tuple[float, str] = part.derived["smallest"]
    return smallest


def _walls(prepared: PreparedPart) -> list[float]:
    """Return the thickness of the material behind the largest triangle of each flat face; none if the part is open."""
    part = prepared.part
    if not part.closed or not len(part.planes):
        return []
    corners = part.vertices[part.triangles]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    order = np.lexsort((-areas, part.triangle_face))
    first = order[np.searchsorted(part.triangle_face[order], part.planes.faces)]
    inward = -part.planes.normals
    starts = corners[first].mean(axis=1) + _FLAT * part.diagonal * inward
    thickness = prepared.surface.cast(starts, inward).distances
    return [float(one) for one in thickness if np.isfinite(one)]


def _close_together(best: GoodnessOfFit) -> bool:
    """Return whether the points cover a small patch, which may fit several places, and nothing else fixes the pose."""
    problem = best.mode.objective.problem
    known = problem.priors.pose is not None and problem.priors.pose.T_world_part is not None
    placed = known or bool(problem.pose_factors)
    points = problem.points.take(problem.furniture.others)
    off = np.linalg.norm(points.points - np.median(points.points, axis=0), axis=1)
    return not placed and 2 * float(np.quantile(off, 0.75)) < NEAR * best.mode.prepared.part.diagonal
