"""Identification and localization from readings: measurement, posterior, findings."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from tanteo.defaults import SIGNIFICANCE, TIP_SD, TOP, WIDE_TIP_SD
from tanteo.errors import InputError
from tanteo.factors import FreeRays, PoseFactor, as_contact_points, as_free_rays
from tanteo.factors.factor import KINDS, numbered_landmarks
from tanteo.geometry.limits import check_length
from tanteo.geometry.typing import FloatArray
from tanteo.parts import Part, part_named
from tanteo.parts.readers import as_part
from tanteo.posterior import DEFAULTS, Answer, PosePrior, Priors, Problem, identify_points, prepare, sized
from tanteo.posterior.answers import STATED, check_question, with_elapsed
from tanteo.posterior.candidates import Candidates
from tanteo.posterior.convention_checks import about_conventions
from tanteo.posterior.equal_parts import MOST, equal_parts
from tanteo.posterior.findings import about_frames, about_readings, estimates_of, scale_of, shared_estimates
from tanteo.posterior.settings import Settings
from tanteo.sensors import (
    PointMeasurements,
    Readings,
    Rig,
    check_readings_kind,
    measure,
    reading_kind,
    thinned,
    unstated_sd,
)
from tanteo.sensors.anomalies import without_repeats
from tanteo.sensors.error_states import ANGLES, MOUNTED, ErrorState, Offset, made_surface, on_faces
from tanteo.sensors.presets import RobotPreset, SensorPreset, sensor_outlier_rate
from tanteo.words import Finding
from tanteo.words.findings import (  # fmt: skip
    AssumedAngles,
    AssumedTip,
    CheckPrior,
    EstimatedNoise,
    NoPart,
    PriorContradicted,
    Scatter,
    ThinnedReadings,
    WholeMismatch,
)

if TYPE_CHECKING:
    from tanteo.vision import View

_TIP_LIMIT = 11.34
"""99 % quantile of chi-square with three degrees of freedom, above which the assumed error of the tip is too small."""

_TIP_LEAST = 0.1
"""Numerical: least fraction of the variance of the tip's estimate; below it 2 mm are not noticed, either."""

MOST_VIEWED = 64
"""Number of parts up to which images are compared with each of them, as :func:`tanteo.vision.see_table` does."""


def identify(
    readings: Readings,
    parts: Sequence[Part],
    *,
    sensor: SensorPreset | str | None = None,
    sd: float | None = None,
    tolerance: float = 0.0,
    robot: RobotPreset | str | None = None,
    tip_sd: npt.ArrayLike | None = None,
    bias_sd: float | None = None,
    shared_errors: Sequence[ErrorState] = (),
    rig: Rig | None = None,
    significance: float = SIGNIFICANCE,
    top: int = TOP,
    as_published: bool = False,
    priors: Priors | None = None,
    views: Sequence[View] = (),
    factors: Sequence[PoseFactor] = (),
    seed: int = 0,
    conventions: bool = True,
    count: int | None = None,
    settings: Settings = DEFAULTS,
) -> Answer:
    """Return which of the parts was sensed, and its pose.

    All readings are compared with the whole surface of every part. A label states that its readings share one face,
    edge or corner, nothing else; a reading that contradicts its label still counts as a measurement.

    Args:
        readings: readings of the devices; see ``tanteo.io.read_readings``.
        parts: candidates; see ``tanteo.catalogue.read_parts``.
        sensor: preset for readings without an sd of their own.
        sd: one standard deviation of a point along beam or normal [m], for readings without an sd of their own. For
            touches it is estimated from the readings if neither it nor a sensor is given.
        tolerance: sd of the made part's surface against its CAD [m], mostly common to all readings of a face; see
            :func:`tanteo.sensors.error_states.made_surface`.
        robot: preset of robot errors; its absolute error is shared by all readings.
        tip_sd: sds of the tip's offset in the hand's frame [m], one draw for the run. If none are stated and the
            readings have poses of the hand, they are 0.3 mm, or 2 mm if the readings contradict that, and a finding
            has the estimate; zeros for an exact tip.
        bias_sd: sd of an offset along the approach [m], one across and one along z: of the trigger point, the radius.
        shared_errors: further errors that readings share: scale, drift, form, stock; see
            :mod:`tanteo.sensors.error_states`.
        rig: where range sensors sit on the hand.
        significance: least p-value of the joint test at which a part is accepted.
        top: number of hypotheses to report.
        as_published: use the constraints and tests of the 1991 paper as printed, for comparison.
        priors: assumptions: rate of outliers, workspace, prior pose, box, table.
        views: images of the object from cameras whose poses are known in the world of the readings.
            Readings and images share one posterior; at most 64 parts can be compared with images.
        factors: further measurements of the pose, such as a :class:`tanteo.PythonFactor` of your own.
        seed: seed of the random numbers.
        conventions: whether, if no part explains the readings, usual mistakes (units, directions, quaternions, radius)
            are undone one by one and the search is repeated; a finding names the mistake that fits. Each takes a
            search.
        count: number of equal parts that the readings are of. None: several are considered if one leaves seven
            readings or more unexplained; each then has its own answer, see :attr:`tanteo.Answer.equal`.
        settings: numbers of the search, the sampler and the checks.

    Returns:
        The answer with its status. Readings that fit no part, or several, give a status and findings, not an exception.

    Raises:
        InputError: an argument or a reading is outside its range, or two of them contradict each other.

    Example:
        >>> parts = tanteo.read_parts("parts/")
        >>> answer = tanteo.identify(tanteo.read_readings("readings/bracket_left.csv"), parts)
        >>> answer.status, answer.best.part
        ('recognized', 'bracket_left')
    """
    start = time.perf_counter()
    check_length("tolerance", tolerance)
    _check_count(count)
    parts = check_question(parts, significance, top, seed, priors)
    check_readings_kind("readings", readings)
    readings, repeated = without_repeats(readings)
    given, readings = len(readings), thinned(readings)
    tip_sd, assumed = _with_tip(readings, None if as_published and tip_sd is None else tip_sd, as_published)
    unstated = unstated_sd(readings, sensor=sensor, sd=sd, rig=rig)
    stated_sd, sd = sd, sd if unstated is None else unstated
    priors = _with_noise_factor(priors, readings, sensor, stated_sd, unstated)
    placed = priors is not None and priors.pose is not None
    first_tip, (of_surface, own_sd) = tip_sd, made_surface(tolerance)

    def measured_with(tip_sd: npt.ArrayLike | None, errors: Sequence[ErrorState]) -> PointMeasurements:
        return measure(
            readings,
            sensor=sensor,
            robot=robot,
            sd=sd,
            tip_sd=tip_sd,
            bias_sd=bias_sd,
            rig=rig,
            shared_errors=errors,
            angle_sd=0.0 if as_published else MOUNTED,
        )

    def answer_of(measured: PointMeasurements) -> tuple[Answer, FreeRays]:
        points = as_contact_points(measured, own_sd, readings.ranges.take(measured.rows))
        rays = as_free_rays(measured, own_sd)
        all_factors = (*factors, *_factors(views, measured.points, parts, priors))
        return identify_points(
            points, rays, parts, shared=measured.shared, significance=significance, top=top, priors=priors,
            factors=all_factors, seed=seed, settings=settings, unstated=measured.unstated,
        ), rays  # fmt: skip

    for wider in (False, True):
        tip_sd = np.full(3, WIDE_TIP_SD) if wider else first_tip
        measured = measured_with(tip_sd, (*shared_errors, *(() if as_published else of_surface)))
        if as_published:
            from tanteo.paper import identify_labelled_as_published

            return identify_labelled_as_published(
                measured, parts, tolerance=tolerance, significance=significance, top=top, seed=seed, placed=placed,
                seconds=time.perf_counter() - start,
            )  # fmt: skip
        elapsed = time.perf_counter() - start
        answer, rays = answer_of(measured)
        if not assumed:
            break
        tip = _tip_estimate(answer, measured, WIDE_TIP_SD if wider else TIP_SD)
        if answer.status != "unknown" and not _is_contradicted(tip):
            break
    errors = (*shared_errors, *of_surface)
    if any(one.by_face for one in errors) and answer.best is not None:  # its pose distinguishes faces of one plane
        part = prepare(part_named(parts, answer.best.part))
        faces = part.faces_of_readings(measured, len(readings), answer.best.T_world_part)
        apart = measured_with(tip_sd, on_faces(errors, faces))
        if apart.stacked()[0].shape != measured.stacked()[0].shape:
            measured = apart
            answer, rays = answer_of(measured)
    if unstated is not None and answer.best is not None:
        answer = _with_estimated_noise(answer, unstated, measured.rounding)
    if assumed:
        answer = answer.adding(tip)
    if loose := tuple(one.name.removeprefix(ANGLES) for one in measured.shared if one.name.startswith(ANGLES)):
        answer = answer.adding(AssumedAngles(loose, MOUNTED))
    question = Query(
        sensor=sensor, sd=sd, tolerance=tolerance, robot=robot, tip_sd=tip_sd, bias_sd=bias_sd, rig=rig,
        shared_errors=shared_errors, significance=significance, priors=priors, views=views, factors=factors,
        seed=seed, settings=settings,
    )  # fmt: skip
    if count is not None or answer.status == "unknown" or (answer.best is not None and answer.best.outliers):
        start = time.perf_counter()
        several = equal_parts(answer, readings, parts, question, count)
        answer = answer if several is None else replace(several, elapsed=answer.elapsed)
        answer = with_elapsed(answer, equal_parts=time.perf_counter() - start)
    if answer.status == "unknown" and placed and not any(isinstance(f, PriorContradicted) for f in answer.findings):
        answer = answer.adding(CheckPrior())
    answer = _without_features(answer, readings, parts)
    stated_errors = (*(() if bias_sd is None else (Offset(bias_sd),)), *shared_errors)
    answer = answer.adding(*estimates_of(answer, measured, stated_errors, len(of_surface)))
    answer = answer.adding(*about_readings(answer, readings, measured, rays, parts, settings))
    if repeated is not None:
        answer = answer.adding(repeated)
    if len(readings) < given:
        answer = answer.adding(ThinnedReadings(len(readings), given))
    if (whole := _of_whole(answer, priors, parts, settings)) is not None:
        answer = answer.adding(whole)
    answer = with_elapsed(answer, measure=elapsed)
    frames = about_frames(answer, readings, scale_of(measured.points, parts), measured, settings.checks)

    note: Finding | None = None
    if conventions:
        start = time.perf_counter()
        note = about_conventions(answer, readings, parts, question, placed=placed, settings=settings)
        answer = with_elapsed(answer, conventions=time.perf_counter() - start)
    note = note or frames  # a mistake that explains the readings is more specific than an odd frame
    answer = replace(answer, frame=readings.frame, stamp=readings.stamp)
    return answer if note is None else answer.adding(note)


def _check_count(count: int | None) -> None:
    """Check the stated number of equal parts."""
    if count is not None and not (isinstance(count, int) and 1 <= count <= MOST):
        raise InputError(f"count: expected a number of equal parts from 1 to {MOST}, got {count!r}.")


_MOST_EXAMINED = 20
"""Largest number of parts that are examined for features."""


def _without_features(answer: Answer, readings: Readings, parts: Sequence[Part]) -> Answer:
    """Return an answer whose verdict names centres that no part can have, if none explains the readings."""
    centres = {kind for kind in readings.kinds if reading_kind(kind).is_centre}
    if answer.status != "unknown" or not centres or len(parts) > _MOST_EXAMINED:
        return answer
    classes = {cls for part in parts for cls, _, _ in numbered_landmarks(part)}
    present = {kind for kind, cls in KINDS.items() if cls in classes}
    missing = tuple(sorted(centres.difference(present)))
    if not missing:
        return answer
    freeform = any(face.surface == "freeform" for part in parts for face in part.faces)
    found = NoPart(parts[0].name if len(parts) == 1 else "", missing, tuple(sorted(present)), freeform)
    others = [one for one in answer.findings if one.role != "verdict"]
    return replace(answer, findings=(found, *others))


class Query:
    """Options of a call of :func:`identify`, with which it is repeated for other readings."""

    def __init__(self, **options: Any) -> None:
        """Keep the keyword arguments of :func:`identify`."""
        self._options = options

    @property
    def rig(self) -> Rig | None:
        """Range sensors on the hand; None if there are none."""
        rig: Rig | None = self._options.get("rig")
        return rig

    def with_rig(self, rig: Rig) -> Query:
        """Return the options with another rig."""
        return Query(**self._options | {"rig": rig})

    def problem(self, readings: Readings, parts: Sequence[Part]) -> tuple[Problem, Candidates]:
        """Return the measurements and priors of the inference for other readings, and its candidate parts."""
        own, settings = self._options, self._options.get("settings", DEFAULTS)
        of_surface, own_sd = made_surface(own["tolerance"])
        candidates = Candidates(parts)
        own = own | {"tip_sd": _with_tip(readings, own["tip_sd"])[0]}
        unstated = unstated_sd(readings, sensor=own["sensor"], sd=own["sd"], rig=own["rig"])
        sd = own["sd"] if unstated is None else unstated
        known = {name: own[name] for name in ("sensor", "robot", "tip_sd", "bias_sd", "rig") if name in own}
        errors = *own.get("shared_errors", ()), *of_surface
        measured = measure(readings, sd=sd, shared_errors=errors, angle_sd=MOUNTED, **known)
        points = as_contact_points(measured, own_sd, readings.ranges.take(measured.rows))
        priors = _with_noise_factor(own["priors"], readings, own["sensor"], own["sd"], unstated)
        priors = sized(priors, float(candidates.radii.max()))
        area, rays = float(candidates.areas.mean()), as_free_rays(measured, own_sd)
        return Problem(points, rays, priors, settings=settings, typical_area=area), candidates

    def answer(
        self,
        readings: Readings,
        parts: Sequence[Part],
        *,
        shared_errors: Sequence[ErrorState] = (),
        outlier_rate: float | None = None,
        anywhere: bool = False,
        settings: Settings | None = None,
    ) -> Answer:
        """Return the answer for other readings or parts, without checks of conventions.

        Args:
            readings: the readings.
            parts: the candidates.
            shared_errors: errors that the readings share, in addition to those of the first inference.
            outlier_rate: rate of outliers; None for that of the first inference.
            anywhere: whether to omit the prior pose and the box; a table remains.
            settings: settings of the search; None for those of the first inference.
        """
        errors = (*self._options.get("shared_errors", ()), *shared_errors)
        priors: Priors = self._options.get("priors") or Priors()
        if outlier_rate is not None:
            priors = replace(priors, outlier_rate=outlier_rate)
        if anywhere and priors.pose is not None:
            pose = priors.pose
            priors = replace(priors, pose=PosePrior(table=pose.table, rests=pose.rests) if pose.planes else None)
        settings = settings or self._options.get("settings", DEFAULTS)
        own = self._options | {"shared_errors": errors, "priors": priors, "settings": settings.repeated}
        return identify(readings, parts, **own, top=1, conventions=False, count=1)


def _with_tip(
    readings: Readings, tip_sd: npt.ArrayLike | None, as_published: bool = False
) -> tuple[npt.ArrayLike | None, bool]:
    """Return the standard deviations of the tip's offset, and whether they are assumed because none are stated.

    Without a statement, touches with poses of the hand have an offset of a typical tool.
    """
    if tip_sd is not None:
        return tip_sd, False
    touched, hands = readings.points.given, readings.Ts_world_hand.given
    if as_published or not touched.any() or not hands.all():
        return None, False
    return np.full(3, TIP_SD), True


def _tip_estimate(answer: Answer, measured: PointMeasurements, sd: float) -> AssumedTip:
    """Return the finding about an assumed tip, with its estimate in the best hypothesis."""
    best = answer.best
    sizes = [len(error.covariance) for error in measured.shared]
    names = [error.name for error in measured.shared]
    if best is None or best.shared is None or answer.status == "unknown" or "tip offset" not in names:
        return AssumedTip(sd)
    k = names.index("tip offset")
    rows = slice(sum(sizes[:k]), sum(sizes[: k + 1]))
    mean, covariance = shared_estimates(best)
    sds = np.sqrt(np.diag(covariance)[rows].clip(0.0))
    return AssumedTip(sd, tuple(sd * mean[rows]), tuple(sd * np.minimum(sds, 1.0)))


def _is_contradicted(tip: AssumedTip) -> bool:
    """Return whether the estimate of the tip contradicts the assumed standard deviation.

    If the assumption is right, the estimates have the variance ``sd^2 - sds^2``. Where the readings hardly observe the
    tip, this difference is less than the errors of both terms, and the estimate contradicts nothing.
    """
    if not tip.estimate:
        return False
    expected = np.maximum(tip.sd**2 - np.square(tip.sds), _TIP_LEAST * tip.sd**2)
    return float(np.sum(np.square(tip.estimate) / expected)) > _TIP_LIMIT


def _factors(
    views: Sequence[View], points: FloatArray, parts: Sequence[Part], priors: Priors
) -> tuple[PoseFactor, ...]:
    """Return views of the object as factors.

    Raises:
        InputError: more parts than images are compared with, or a view that does not show the readings.
    """
    if not views:
        return ()
    from tanteo.vision import view_factors

    if len(parts) > MOST_VIEWED:
        raise InputError(
            f"views: expected at most {MOST_VIEWED} parts to compare images with, got {len(parts):,}. Narrow them by "
            "the outline (outline_of_readings), or give fewer."
        )
    some = [getattr(part, "part", part) for part in parts]
    radius = float(Candidates(some).radii.max())
    table = priors.pose.table if priors.pose is not None else None
    frame = np.eye(4) if table is None else table.frame
    return view_factors(views, points, some, sized(priors, radius), T_world_table=frame)


def _of_whole(answer: Answer, priors: Priors, parts: Sequence[Part], settings: Settings) -> WholeMismatch | None:
    """Return the finding that mass or size of the whole object contradict the answer; None if they agree."""
    if priors.whole is None or not answer.hypotheses or answer.status == "unknown":
        return None
    named = part_named(parts, answer.hypotheses[0].part)
    part = getattr(named, "part", named)
    return priors.whole.mismatch(part.name, part.volume, part.box[1] - part.box[0], settings.search.gate)


def _with_estimated_noise(answer: Answer, sd: float, rounding: float) -> Answer:
    """Return the answer with the estimate of a standard deviation that was not given, instead of its scatter."""
    best = answer.hypotheses[0]
    if answer.status == "unknown" or best.dof <= 0:
        return answer.adding(EstimatedNoise(math.nan, math.nan, math.nan))
    estimate = EstimatedNoise(*(float(np.hypot(sd * factor, rounding)) for factor in best.noise_scale))
    findings = (*(one for one in answer.findings if not isinstance(one, Scatter)), estimate)
    return replace(answer, findings=findings)


def _with_noise_factor(
    priors: Priors | None,
    readings: Readings,
    sensor: SensorPreset | str | None,
    sd: float | None,
    unstated: float | None,
) -> Priors:
    """Return the priors with the prior of the noise factor, by the origin of the noise, unless it is given.

    Without priors, the rate of outliers is that of the sensor.
    """
    if priors is None:
        rate = sensor_outlier_rate(sensor)
        priors = Priors() if rate is None else Priors(outlier_rate=rate)
    if priors.noise_factor is not None:
        return priors
    if unstated is not None:
        return replace(priors, noise_factor=STATED["unstated"])
    typed = sd is not None or bool(readings.sds.given.any()) or sensor is None
    return replace(priors, noise_factor=STATED["typed" if typed else "preset"])


def locate(
    readings: Readings,
    part: Part,
    *,
    sensor: SensorPreset | str | None = None,
    sd: float | None = None,
    tolerance: float = 0.0,
    robot: RobotPreset | str | None = None,
    tip_sd: npt.ArrayLike | None = None,
    bias_sd: float | None = None,
    shared_errors: Sequence[ErrorState] = (),
    rig: Rig | None = None,
    significance: float = SIGNIFICANCE,
    top: int = TOP,
    as_published: bool = False,
    priors: Priors | None = None,
    views: Sequence[View] = (),
    factors: Sequence[PoseFactor] = (),
    seed: int = 0,
    conventions: bool = True,
    count: int | None = None,
    settings: Settings = DEFAULTS,
) -> Answer:
    """Return the pose of a known part; the readings may still come from another object.

    Arguments that are not explained here are those of :func:`identify`.

    Args:
        readings: readings of the devices.
        part: the part.
        sensor: preset for readings without an sd of their own.
        sd: one standard deviation of a point along beam or normal [m], for readings without an sd of their own.
        tolerance: sd of the made part's surface [m].
        robot: preset of robot errors.
        tip_sd: sds of the tip's offset [m]; 0.3 mm with poses of the hand if none are stated.
        bias_sd: sd of an offset along the approach [m].
        shared_errors: further errors that readings share.
        rig: where range sensors sit on the hand.
        significance: least p-value of the joint test at which the part is accepted.
        top: number of poses to report.
        as_published: use the constraints and tests of the 1991 paper as printed, for comparison.
        priors: assumptions: rate of outliers, workspace, prior pose, box, table.
        views: images of the object from cameras whose poses are known in the world of the readings.
        factors: further measurements of the pose.
        seed: seed of the random numbers.
        conventions: whether usual mistakes are undone and searched again if the part does not fit.
        count: number of equal parts that the readings are of; None if not known.
        settings: numbers of the search, the sampler and the checks.

    Raises:
        InputError: as for :func:`identify`; or ``part`` is a sequence of parts.

    Example:
        >>> part = tanteo.read_part("parts/bracket_left.step")
        >>> answer = tanteo.locate(tanteo.read_readings("readings/bracket_left.csv"), part)
        >>> answer.pose.shape, answer.covariance.shape
        ((4, 4), (6, 6))
    """
    return identify(
        readings, [as_part("part", part)], sensor=sensor, sd=sd, tolerance=tolerance, robot=robot, tip_sd=tip_sd,
        bias_sd=bias_sd, shared_errors=shared_errors, rig=rig, significance=significance, top=top,
        as_published=as_published, priors=priors,
        views=views, factors=factors, seed=seed, conventions=conventions, count=count, settings=settings,
    )  # fmt: skip
