"""How much a reading is expected to tell, about part and pose together (``math.md`` section 11).

Two things add up. Which mode is it, part and place: the mutual information of mode and reading, with the densities of
the modes made of small normal ones, so that what an edge does to a reading counts, and the chance of a miss; overlaps
of pairs are Bhattacharyya's, as in the bound of Kolchinsky and Tracey. And where is the part, given the mode: half the
log of the ratio of variances, as far as it matters for a tolerance.

A utility is one entry of a registry: what each candidate is worth by what it is expected to read. This information is
one of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from tanteo import _core
from tanteo.geometry.special import entropy
from tanteo.geometry.typing import FloatArray, IntArray
from tanteo.planning.context import DecisionContext
from tanteo.planning.predictions import Predictions, predict
from tanteo.planning.probe import Probe
from tanteo.planning.samples import Samples, draw

SAMPLES = 128
"""Poses on which every candidate is tried."""

ALONE, MEANWHILE = 0.01, 0.3
"""Share of all that is told which counts beside what is told of the part: where that alone is asked for, to decide
between equals; and until it is known, where the pose is asked for as well."""


@dataclass(frozen=True, slots=True, eq=False)
class Outlook:
    """What the candidates are expected to read, and to tell.

    Attributes:
        context: what is decided on.
        samples: poses of the belief.
        predicted: what each candidate would read at each of them.
        told: information that each is expected to give about part and pose ``(C,)`` [nats].
    """

    context: DecisionContext
    samples: Samples
    predicted: Predictions
    told: FloatArray


Utility: TypeAlias = Callable[[Outlook], FloatArray]
"""What each candidate is worth ``(C,)``, in units of its own: the greatest is taken."""


def outlook(context: DecisionContext) -> Outlook:
    """Try every candidate on poses of the belief."""
    s = context
    samples = draw(s.state, SAMPLES, s.tolerance, s.feature)
    shared = None if s.shared is None else s.shared(s.candidates)
    predicted = predict(samples, s.candidates.origins, s.candidates.directions, s.probe, shared)
    return Outlook(s, samples, predicted, expected_information(samples, predicted, s.probe))


def information(ahead: Outlook) -> FloatArray:
    """What each reading is expected to tell ``(C,)`` [nats].

    Where nobody asks for the pose it is the part that counts, and above all until it is known where both are asked for.
    """
    s = ahead.context
    if s.part_only or s.part_open:
        share = ALONE if s.part_only else MEANWHILE
        return share * ahead.told + about_mode(ahead.samples, ahead.predicted, s.probe, ahead.samples.part)
    return ahead.told


def expected_information(samples: Samples, predicted: Predictions, probe: Probe) -> FloatArray:
    """What each reading is expected to tell about part and pose ``(C,)`` [nats].

    Args:
        samples: of the belief.
        predicted: what each reading would be under them.
        probe: what senses.
    """
    return about_mode(samples, predicted, probe) + about_pose(samples, predicted, probe)


def about_pose(samples: Samples, predicted: Predictions, probe: Probe) -> FloatArray:
    """What each reading tells about the pose once the mode is known ``(C,)`` [nats]; nothing by missing."""
    echo, own = _own(predicted, probe)
    share = np.where(echo > 0, predicted.useful / (predicted.spreads + own), 0.0)
    return np.asarray((-0.5 * np.log1p(-np.minimum(share, 1 - 1e-12)) * echo) @ samples.weights)


def about_mode(samples: Samples, predicted: Predictions, probe: Probe, groups: IntArray | None = None) -> FloatArray:
    """What each reading tells about which mode it is ``(C,)`` [nats].

    Args:
        samples: of the belief.
        predicted: what each reading would be under them.
        probe: what senses.
        groups: what to discriminate instead of the modes, a number for every sample ``(S,)``; the parts, say.
    """
    groups = samples.mode if groups is None else groups
    names, group = np.unique(groups, return_inverse=True)
    if len(names) < 2:
        return np.zeros(len(predicted.ranges))
    echo, own = _own(predicted, probe)
    w, answers = echo * samples.weights, echo > 0
    variances = np.where(answers, predicted.variances + own, 1.0)
    means = np.where(answers, predicted.ranges, 0.0)
    return np.asarray(about_hit(w, samples, groups) + _core.group_information(w, means, variances, group))


def about_hit(w: FloatArray, samples: Samples, groups: IntArray) -> FloatArray:
    """What the answer alone tells, that there is one or none ``(C,)`` [nats].

    Args:
        w: probability of every sample, and that it answers ``(C, S)``.
        samples: of the belief.
        groups: number of what is to be discriminated, for every sample ``(S,)``.
    """
    names, group = np.unique(groups, return_inverse=True)
    member = (group[:, None] == np.arange(len(names))).astype(np.float64)
    total, hits = samples.weights @ member, w @ member
    miss = _of_two(w.sum(axis=1)) - _of_two(hits / total) @ total
    return np.asarray(np.maximum(miss, 0.0))


def _of_two(chance: FloatArray) -> FloatArray:
    """Entropy of whether something happens [nats]."""
    return entropy(chance) + entropy(np.maximum(1 - chance, 0.0))


def _own(predicted: Predictions, probe: Probe) -> tuple[FloatArray, FloatArray]:
    """Probability of an answer, and the variance of the reading itself ``(C, S)``."""
    answers = predicted.met & probe.answers(predicted.ranges, predicted.cosines)
    ranges, cosines = np.where(answers, predicted.ranges, 1.0), np.where(answers, predicted.cosines, 1.0)
    shared = np.where(np.isnan(predicted.shared), probe.shared_variance(cosines), predicted.shared)
    own = probe.own_variance(ranges, cosines) + shared
    return np.where(answers, predicted.shares, 0.0), own + predicted.scatter


UTILITIES: dict[str, Utility] = {"information": information}
"""All utilities by name."""
