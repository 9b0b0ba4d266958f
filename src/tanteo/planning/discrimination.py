"""Best single reading to discriminate two parts, after the object is located as either of them."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from tanteo.factors import FreeRays, surface_points
from tanteo.geometry import SE3
from tanteo.geometry.typing import Covariances, FloatArray, Transforms, Vectors
from tanteo.parts import Part
from tanteo.planning.candidates import Candidates, propose
from tanteo.planning.predictions import predict
from tanteo.planning.probe import Probe
from tanteo.planning.rays import has_cone
from tanteo.planning.samples import draw
from tanteo.planning.start import Start
from tanteo.planning.state import SensingState, begin
from tanteo.planning.unreached import no_place
from tanteo.planning.utility import about_mode
from tanteo.posterior import PreparedPart, Priors, Problem, identify_points, prepare_all, refine_poses
from tanteo.posterior.answers import corner_moves
from tanteo.values import Value
from tanteo.words.findings import NoPlaceReached, ReadingDiscriminates

_PLACES = 60
"""Number of surface points of the first part to which the second part is fitted."""

_AGREE = 0.02
"""Standard deviation of that fit, as a fraction of the part's diagonal."""

_FITTED = np.full(8, 3.0)
"""Robust scales of the successive steps of the fit that distributes the differences, as multiples of its standard
deviation."""

_CLOSER, _SAME, _AS_MUCH = np.geomspace(3.0, 0.02, 24), 5e-5, 0.05
"""Robust scales of the fit that maximizes the common surface, as multiples of the standard deviation; largest distance
of common points [m]; and difference of the common fractions within which poses count as equally similar."""

_SAMPLES = 48
"""Number of samples for each relative pose of each part."""

_TWINS = 4
"""Largest number of relative poses of the two parts from the search."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Discrimination(Value):
    """Best single reading to discriminate two parts.

    Attributes:
        parts: names of the two parts.
        origin: start of the beam or motion, frame of the first part ``(3,)`` [m].
        direction: unit direction, frame of the first part ``(3,)``.
        ranges: expected range for the first and the second part ``(2,)`` [m]; infinite for a miss.
        sds: standard deviations of the two ranges ``(2,)`` [m].
        T_first_second: pose of the second part in the frame of the first ``(4, 4)``.
        information: expected information about the part [nats], at most ln 2.
        finding: result as a typed finding.
    """

    parts: tuple[str, str]
    origin: Vectors
    direction: Vectors
    ranges: FloatArray
    sds: FloatArray
    T_first_second: Transforms
    information: float
    finding: ReadingDiscriminates | NoPlaceReached

    @property
    def message(self) -> str:
        """Text of the finding."""
        return self.finding.message

    @property
    def discriminates(self) -> bool:
        """Whether the reading is worth making."""
        return self.information >= ReadingDiscriminates.LEAST


def discriminate(
    first: PreparedPart | Part, second: PreparedPart | Part, probe: Probe, sd: float = 2e-4, seed: int = 0
) -> Discrimination:
    """Find the single reading that best discriminates two parts.

    The second part is placed where it is most similar to the first. If there are several such poses, the reading
    maximizes the information for the least favourable one.

    Args:
        first: one part.
        second: the other part.
        probe: sensor model.
        sd: standard deviation of the part's pose at the corners of its box [m].
        seed: seed of the random surface points.

    Example:
        >>> left, right = (tanteo.read_part(f"parts/bracket_{side}.step") for side in ("left", "right"))
        >>> found = tanteo.discriminate(left, right, tanteo.probe_of("keyence_il300"))
        >>> found.discriminates
        True
    """
    first, second = prepare_all("parts", (first, second))
    twins = most_similar_poses(first, second)
    start = Start(
        (first, second),
        np.array([0] + [1] * len(twins)),
        np.concatenate([np.eye(4)[None], twins]),
        np.stack([located(first, sd)] + [located(second, sd)] * len(twins)),
        np.r_[0.5, np.full(len(twins), 0.5 / max(len(twins), 1))],
        Priors(),
    )
    state = begin(start)
    candidates = propose(state, probe, 1500, seed)
    names = (first.part.name, second.part.name)
    if not len(candidates):
        nowhere = np.full(3, np.nan)
        return Discrimination(
            names, nowhere, nowhere, nowhere[:2], nowhere[:2], twins[0], 0.0, no_place(state, probe, seed, names)
        )  # fmt: skip
    information = _information(state, candidates, probe, len(twins))
    k = int(np.lexsort((information.sum(axis=0), information.min(axis=0)))[-1])
    twin = int(np.argmin(information[:, k]))
    here = draw(begin(start), 1)  # the mean of every mode
    seen = predict(here, candidates.origins[k : k + 1], candidates.directions[k : k + 1], probe)
    rows = [int(np.flatnonzero(here.mode == mode)[0]) for mode in (0, 1 + twin)]
    ranges = seen.ranges[0, rows]
    answers = probe.answers(ranges, seen.cosines[0, rows])
    own = probe.variance(np.where(answers, ranges, 1.0), np.where(answers, seen.cosines[0, rows], 1.0))
    sds = np.sqrt(own + seen.variances[0, rows] + seen.scatter[0, rows])
    ranges, echoes = np.where(answers, ranges, np.inf), _echo_rates(state, candidates.take(np.array([k])), probe)
    both, (a, b) = (float(ranges[0]), float(ranges[1])), echoes[[0, 1 + twin]]
    finding = ReadingDiscriminates(names, both, (float(a), float(b)), float(information[twin, k]))
    return Discrimination(
        names, candidates.origins[k], candidates.directions[k], ranges, sds,
        twins[twin], float(information[twin, k]), finding,
    )  # fmt: skip


def _information(state: SensingState, candidates: Candidates, probe: Probe, twins: int) -> FloatArray:
    """Return the information of each reading for each relative pose of the second part ``(k, C)`` [nats]."""
    samples = draw(state, _SAMPLES * (1 + twins))
    predicted = predict(samples, candidates.origins, candidates.directions, probe)
    out = []
    for twin in range(1, 1 + twins):
        rows = np.flatnonzero((samples.mode == 0) | (samples.mode == twin))
        w = samples.weights[rows] / np.where(samples.mode[rows] == 0, 1.0, 1.0 / twins)
        some = {f.name: getattr(samples, f.name)[rows] for f in fields(samples) if f.name not in ("targets", "weights")}
        of_two = {f.name: getattr(predicted, f.name)[:, rows] for f in fields(predicted)}
        out.append(about_mode(replace(samples, weights=w / w.sum(), **some), replace(predicted, **of_two), probe))
    return np.minimum(out, np.log(2))


def _echo_rates(state: SensingState, one: Candidates, probe: Probe) -> FloatArray:
    """Return the probability of an echo at every mode ``(M,)``; 1 for a thin beam."""
    if not has_cone(probe):
        return np.ones(len(state.weights))
    samples = draw(state, _SAMPLES * len(state.weights))
    echo = predict(samples, one.origins, one.directions, probe).shares[0]
    return np.asarray(np.bincount(samples.mode, echo) / np.bincount(samples.mode))


def most_similar_poses(first: PreparedPart, second: PreparedPart) -> Transforms:
    """Return the poses of the second part, in the frame of the first, at which both are most similar ``(k, 4, 4)``.

    Two criteria are used. One distributes the differences over the whole surface. The other maximizes the common
    surface, as if the object were located by the common faces, so that the differences are in one place.

    Args:
        first: one part.
        second: the other part.
    """
    points, normals = first.samples[:_PLACES], first.normals[:_PLACES]
    sd = _AGREE * first.part.diagonal
    touches = surface_points(points, sd, normals=normals, normal_sds=0.2)
    priors = Priors(outlier_rate=0.2, radius=max(first.part.radius, second.part.radius))
    answer = identify_points(touches, FreeRays.none(), [second], priors=priors, top=_TWINS)
    if not answer.hypotheses:
        return SE3.from_parts(np.eye(3), first.part.centroid - second.part.centroid)[None]
    Ts = np.stack([h.T_world_part for h in answer.hypotheses])
    problem = Problem(touches, FreeRays.none(), priors)
    Ts = refine_poses(problem, second, Ts, sd * _FITTED)  # the points are exact and need no normal sign check
    close = refine_poses(problem, second, np.concatenate([Ts, np.eye(4)[None]]), sd * _CLOSER)
    off = second.surface.closest(SE3.apply(SE3.inverse(close)[:, None], points)).distances
    share = np.mean(off < _SAME, axis=1)
    return _distinct(second, np.concatenate([Ts, close[share > share.max() - _AS_MUCH]]))


def _distinct(part: PreparedPart, Ts: Transforms) -> Transforms:
    """Return poses without near duplicates, compared at the corners of the part's box."""
    kept: list[Transforms] = []
    for T in Ts:
        gaps = [corner_moves(part.part) @ SE3.log(SE3.inverse(other) @ T) for other in kept]
        if all(np.linalg.norm(gap, axis=1).max() > 4 * _SAME for gap in gaps):
            kept.append(T)
    return np.stack(kept)


def located(target: PreparedPart, sd: float) -> Covariances:
    """Return a pose covariance with about a given standard deviation at the corners of the box ``(6, 6)`` [m, rad].

    Args:
        target: the part.
        sd: standard deviation of a corner [m].
    """
    J = corner_moves(target.part)
    return np.asarray(sd**2 * 3 / 6 * np.linalg.inv(np.mean(np.swapaxes(J, 1, 2) @ J, axis=0)))
