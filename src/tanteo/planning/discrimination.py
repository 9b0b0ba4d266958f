"""The single reading that tells one part from another, once the part is located as either of them."""

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
from tanteo.planning.utility import about_mode
from tanteo.posterior import PreparedPart, Priors, Problem, corner_moves, identify_points, prepare_all, settle
from tanteo.words.findings import NoPlaceReached, ReadingDiscriminates

_PLACES = 60
"""Places of the one part that the other is laid on."""

_AGREE = 0.02
"""How well, in diagonals of the part."""

_FITTED = np.full(8, 3.0)
"""Steps of the fit, and the scale from which a place loses its weight [times how well they agree]."""

_CLOSER, _SAME, _AS_MUCH = np.geomspace(3.0, 0.02, 24), 5e-5, 0.05
"""Steps of the fit by as much surface as can be; what is the same surface then [m]; shares of it that are as much."""

_SAMPLES = 48
"""Poses of each place of each part, by which readings are compared."""

_TWINS = 4
"""Ways of laying it on that are looked at."""


@dataclass(frozen=True, slots=True, eq=False)
class Discrimination:
    """A reading that discriminates two parts.

    Attributes:
        parts: their names.
        origin: from where to look or move, in the frame of the first part ``(3,)`` [m].
        direction: in which, unit ``(3,)``.
        ranges: what it reads if it is the first, and if it is the second [m]; infinite for nothing.
        sds: standard deviations of these [m].
        T_first_second: where the second part is then, in the frame of the first ``(4, 4)``.
        information: about which it is [nats]; ln 2 is all there is.
        finding: the same in words.
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
        """The finding in words."""
        return self.finding.message

    @property
    def tells(self) -> bool:
        """Whether it is worth making."""
        return self.information >= ReadingDiscriminates.LEAST


def discriminate(
    first: PreparedPart | Part, second: PreparedPart | Part, probe: Probe, sd: float = 2e-4, seed: int = 0
) -> Discrimination:
    """The reading that tells most about which of two parts it is, located to ``sd`` at its corners.

    The second part is where it looks most like the first; it may look like it in several ways, and the reading is that
    which tells most in the way in which it tells least.

    Args:
        first: one part.
        second: the other.
        probe: what senses.
        sd: to which the part is located, at its corners [m].
        seed: of the places that are tried.

    Example:
        >>> left, right = (tanteo.read_part(f"parts/bracket_{side}.step") for side in ("left", "right"))
        >>> found = tanteo.discriminate(left, right, tanteo.probe_of("keyence_il300"))
        >>> found.tells
        True
    """
    first, second = prepare_all("parts", (first, second))
    twins = laid_on(first, second)
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
            names, nowhere, nowhere, nowhere[:2], nowhere[:2], twins[0], 0.0, NoPlaceReached(names)
        )  # fmt: skip
    told = _told(state, candidates, probe, len(twins))
    k = int(np.lexsort((told.sum(axis=0), told.min(axis=0)))[-1])
    twin = int(np.argmin(told[:, k]))
    here = draw(begin(start), 1)  # the middle of every pose
    seen = predict(here, candidates.origins[k : k + 1], candidates.directions[k : k + 1], probe)
    rows = [int(np.flatnonzero(here.mode == mode)[0]) for mode in (0, 1 + twin)]
    ranges = seen.ranges[0, rows]
    answers = probe.answers(ranges, seen.cosines[0, rows])
    own = probe.variance(np.where(answers, ranges, 1.0), np.where(answers, seen.cosines[0, rows], 1.0))
    sds = np.sqrt(own + seen.variances[0, rows] + seen.scatter[0, rows])
    ranges, echoes = np.where(answers, ranges, np.inf), _echoes(state, candidates.take(np.array([k])), probe)
    both, (a, b) = (float(ranges[0]), float(ranges[1])), echoes[[0, 1 + twin]]
    finding = ReadingDiscriminates(names, both, (float(a), float(b)), float(told[twin, k]))
    return Discrimination(
        names, candidates.origins[k], candidates.directions[k], ranges, sds,
        twins[twin], float(told[twin, k]), finding,
    )  # fmt: skip


def _told(state: SensingState, candidates: Candidates, probe: Probe, twins: int) -> FloatArray:
    """What each reading tells about which part it is, if the second is known to be at each of its places ``(k, C)``."""
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


def _echoes(state: SensingState, one: Candidates, probe: Probe) -> FloatArray:
    """How often a reading by a cone has an echo at every mode; 1 for a thin beam."""
    if not has_cone(probe):
        return np.ones(len(state.weights))
    samples = draw(state, _SAMPLES * len(state.weights))
    echo = predict(samples, one.origins, one.directions, probe).shares[0]
    return np.asarray(np.bincount(samples.mode, echo) / np.bincount(samples.mode))


def laid_on(first: PreparedPart, second: PreparedPart) -> Transforms:
    """Poses of the second part, in the frame of the first, at which it looks most like it ``(k, 4, 4)``.

    It does so on the whole, all differences shared out over its surface, and with as much of the surface as can be just
    where the first has it, which puts all the difference in one place: as when it was located by what both have.
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
    Ts = settle(problem, second, Ts, sd * _FITTED)  # the places are exact: no noise put one beside its face
    close = settle(problem, second, np.concatenate([Ts, np.eye(4)[None]]), sd * _CLOSER)
    off = second.surface.closest(SE3.apply(SE3.inverse(close)[:, None], points)).distances
    share = np.mean(off < _SAME, axis=1)
    return _distinct(second, np.concatenate([Ts, close[share > share.max() - _AS_MUCH]]))


def _distinct(part: PreparedPart, Ts: Transforms) -> Transforms:
    """The first of poses that are the same to what the corners of the part's box show."""
    kept: list[Transforms] = []
    for T in Ts:
        gaps = [corner_moves(part.part) @ SE3.log(SE3.inverse(other) @ T) for other in kept]
        if all(np.linalg.norm(gap, axis=1).max() > 4 * _SAME for gap in gaps):
            kept.append(T)
    return np.stack(kept)


def located(target: PreparedPart, sd: float) -> Covariances:
    """A covariance of the pose with about that standard deviation at the corners ``(6, 6)``."""
    J = corner_moves(target.part)
    return np.asarray(sd**2 * 3 / 6 * np.linalg.inv(np.mean(np.swapaxes(J, 1, 2) @ J, axis=0)))
